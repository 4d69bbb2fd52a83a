"""Families of a lattice: stencil and rows."""

import pytest
from helpers import square

from warp_pd.families import build_families

MEMBERS = {1.5: 8, 2.015: 12, 3.015: 28, 3.15: 28, 4.15: 56, 9.015: 252}


@pytest.mark.parametrize("horizon", MEMBERS)
def test_stencil_size(horizon):
    families = build_families(square(25), horizon, "linear")
    assert families.members == MEMBERS[horizon]
    assert families.words == -(-MEMBERS[horizon] // 32)


def test_rows_are_few_on_a_large_lattice():
    families = build_families(square(401), 3.15, "linear")
    assert families.exists.shape[0] <= 81
    assert families.points == 401**2
