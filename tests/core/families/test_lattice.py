"""Families of a lattice: stencil and rows."""

import numpy as np
import pytest
from helpers import square

from warp_pd.families import build_families, lattice, pack

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


def test_classes_are_those_of_a_table_of_all_codes():
    """Also where every point of a class lost members, or the first one."""
    rng = np.random.default_rng(0)
    near_x, near_y = lattice.clipped_index(23, 4), lattice.clipped_index(9, 5)
    code = (near_y[:, None] * (near_x.max() + 1) + near_x[None, :]).ravel()
    touched = np.unique(np.append(rng.choice(len(code), 40), [0, 4, 5, 6, 23 * 4 + 4, 23 * 4 + 5]))
    lost = rng.random((len(touched), 12)) < 0.2
    patterns, which = np.unique(pack(lost), axis=0, return_inverse=True)
    wide = code * (len(patterns) + 1)
    wide[touched] += 1 + which.ravel()
    for codes, found in (
        (code, lattice._classes(near_x, near_y)),
        (wide, lattice._with_lost(lattice._classes(near_x, near_y)[1], touched, lost)),
    ):
        _, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
        np.testing.assert_array_equal(found[0], first)
        np.testing.assert_array_equal(found[1], inverse.ravel())
        assert found[1].dtype == np.int32
