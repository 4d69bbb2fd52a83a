"""Lattice and cloud: the same forces in both layouts, and no force across a cut."""

import numpy as np
import pytest
from helpers import build, internal_force, rough, square

from warp_pd import Sheet


@pytest.mark.parametrize(
    ("horizon", "weights", "precision"),
    # At smaller horizons the correction of a cloud reaches one layer deeper than that of a lattice.
    [(1.5, "plain", 64), (3.15, "published", 32), (3.15, "corrected", 64)],
)
def test_lattice_and_cloud_give_the_same_forces(horizon, weights, precision, device):
    lattice = Sheet.rectangle(0.1, 0.08, thickness=1e-3, density=1000.0, points=(13, 11))
    displacement = rough(lattice)
    forces = [
        internal_force(build(s, horizon=horizon, weights=weights, precision=precision, device=device), displacement)
        for s in (lattice, lattice.as_cloud())
    ]
    scale = np.abs(forces[0]).max()
    assert np.abs(forces[0] - forces[1]).max() <= (1e-9 if precision == 64 else 2e-4) * scale
    assert scale > 0.0


def test_lattice_and_cloud_agree_at_a_horizon_of_six_spacings():
    lattice = square(21)
    forces = [internal_force(build(s, horizon=6.015), rough(lattice)) for s in (lattice, lattice.as_cloud())]
    assert np.abs(forces[0] - forces[1]).max() <= 1e-9 * np.abs(forces[0]).max()


def test_lattice_and_cloud_agree_beside_a_cut():
    lattice = square(13).cut((-0.01, 0.054), (0.052, 0.054))
    forces = [internal_force(build(s, horizon=3.15), rough(lattice)) for s in (lattice, lattice.as_cloud())]
    assert np.abs(forces[0] - forces[1]).max() <= 1e-9 * np.abs(forces[0]).max()


def test_no_bond_crosses_a_cut():
    uncut = square(13)
    cut = uncut.cut((-0.01, 0.054), (0.11, 0.054))
    displacement = np.zeros((cut.size, 3))
    displacement[cut.points[:, 1] > 0.054, 1] = 0.05
    assert np.abs(internal_force(build(cut, horizon=3.15), displacement)).max() < 1e-12
    assert np.abs(internal_force(build(uncut, horizon=3.15), displacement)).max() > 1e-3
