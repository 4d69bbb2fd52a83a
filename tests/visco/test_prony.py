"""Prony terms."""

import pytest
from helpers import refused

from warp_pd import Prony


def test_a_fixed_rate_makes_the_relaxation_time_a_constant():
    """VE table 2 at 0.15 /s."""
    c10, c20, time, exponent = Prony(0.01733e6, 0.0015e6, time=0.9466, exponent=1.6665, rate=0.15).constants
    assert (c10, c20, exponent) == (0.01733e6, 0.0015e6, 0.0)
    assert time == pytest.approx(0.9466 * 0.15**-1.6665)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Prony(0.0), r"^Prony\.c10 = 0\.0: expected a positive number$"),
        (lambda: Prony(1.0, -1.0), r"^Prony\.c20 = -1\.0: expected 0 or a positive number$"),
        (lambda: Prony(1.0, time=0.0), r"^Prony\.time = 0\.0: expected a positive number$"),
        (lambda: Prony(1.0, rate=0.0), r"^Prony\.rate = 0\.0: expected a positive number$"),
    ],
)
def test_wrong_constants_are_refused(make, said):
    with refused(match=said):
        make()
