"""Zero-energy modes: the nodal law has them, the others resist."""

import numpy as np
import pytest
from helpers import NEO, array, internal_force, square, uniform
from point_laws import build

from warp_pd import BondAssociated, Neural, Nodal

RESISTING = {
    "closed form": lambda horizon: Neural(NEO, horizon=horizon, evaluation="closed_form"),
    "neural": lambda horizon: Neural(NEO, horizon=horizon),
    "bond-associated": lambda horizon: BondAssociated(NEO, horizon=horizon, weights="plain"),
}


def checkerboard(sheet, direction):
    """A checkerboard in the middle of a sheet, with margins of uniform deformation, [m]."""
    column, row = np.arange(sheet.size) % sheet.lattice.columns, np.arange(sheet.size) // sheet.lattice.columns
    board = np.zeros((sheet.size, 3))
    board[:, direction] = 0.02 * sheet.spacing * (-1.0) ** (column + row)
    return board


def resistance(law, sheet, mode, rows):
    """Work of the force against a mode, at the points `rows`, over E h times its squared size."""
    built = build(sheet, law)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    change = internal_force(built, stretched + mode) - internal_force(built, stretched)
    return -(change * mode)[rows].sum() / (3e3 * sheet.thickness * (mode[rows] ** 2).sum())


@pytest.mark.parametrize("direction", [0, 1, 2])
@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
def test_a_checkerboard_is_felt_by_all_laws_but_the_nodal_one(horizon, direction):
    sheet = square(21)
    inside = np.flatnonzero(np.abs(sheet.points - 0.05).max(axis=1) < 0.01)
    board = checkerboard(sheet, direction)
    assert abs(resistance(Nodal(NEO, horizon=horizon), sheet, board, inside)) < 1e-12
    for name, law in RESISTING.items():
        assert resistance(law(horizon), sheet, board, inside) > 0.1 / horizon**2, name


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_a_family_does_not_feel_its_own_middle_only_in_the_nodal_law(direction):
    """The centre-point mode: what the family of a moved point does, not what its neighbours' families do."""
    sheet = square(21)
    middle = sheet.nearest(0.05, 0.05)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    moved = stretched.copy()
    moved[middle, direction] += 0.2 * sheet.spacing
    changes = {}
    for name, law in {"nodal": lambda horizon: Nodal(NEO, horizon=horizon), **RESISTING}.items():
        built = build(sheet, law(3.15))
        internal_force(built, stretched)
        before = built.to_numpy(array(built, "bond_force"))[:, middle]
        internal_force(built, moved)
        after = built.to_numpy(array(built, "bond_force"))[:, middle]
        changes[name] = (after - before).sum(axis=0)[direction] / np.linalg.norm(before, axis=1).max()
    assert abs(changes.pop("nodal")) < 1e-12
    # The sum of the family's pull on the moved point is against its move.
    assert all(change < -1e-2 for change in changes.values()), changes
