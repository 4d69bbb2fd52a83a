"""Compressible materials: the constants that they refuse."""

import re

import pytest
from helpers import refused

from warp_pd import Gent, NeoHookean


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((0.0, 1.0), "mu = 0.0: expected a positive number"),
        ((-1.0, 1.0), "mu = -1.0: expected a positive number"),
        ((float("nan"), 1.0), "mu = nan: expected a finite number"),
        ((1.0, float("inf")), "bulk = inf: expected a finite number"),
        (("x", 1.0), "mu = 'x': expected a number"),
    ],
)
def test_moduli_must_be_positive(numbers, said):
    with refused(match=f"^{re.escape(said)}$"):
        NeoHookean(*numbers)
    with refused(match=f"^{re.escape(said)}$"):
        Gent(*numbers, lock=10.0)
    with refused(match="lock = 0"):
        Gent(1.0, 1.0, 0.0)
