"""The explicit finite elements are right by themselves, and the stored fields are theirs."""

from pathlib import Path

import numpy as np
import pytest
from references import membrane_dynamics as fe

DATA = Path(__file__).parents[1] / "physics" / "references" / "data"


def energy(gradient, relaxed):
    """Per volume, by the principal stretches."""
    small, large = np.linalg.eigvalsh(gradient.T @ gradient)
    if relaxed:
        large = max(large, 1.0)
        small = max(small, fe.strip_width(np.array(large)).item())
    j2_of = large * small
    c33 = fe.thickness_stretch(np.array(large + small), np.array(j2_of), np.array(1.0 / j2_of)).item()
    j2 = c33 * j2_of
    return 0.5 * fe.MU * (j2 ** (-1 / 3) * (large + small + c33) - 3.0) + fe.BULK / 8.0 * (j2 + 1.0 / j2 - 2.0)


@pytest.mark.parametrize("relaxed", [False, True])
@pytest.mark.parametrize("across", [1.1, 0.8, 0.5])
def test_stress_is_the_derivative_of_the_energy(relaxed, across):
    rng = np.random.default_rng(3)
    at = np.array([[1.3, 0.1], [0.0, across], [0.1, 0.1]]) + 0.03 * rng.normal(size=(3, 2))
    towards, step = rng.normal(size=(3, 2)), 1e-6
    slope = (energy(at + step * towards, relaxed) - energy(at - step * towards, relaxed)) / (2.0 * step)
    of = fe.tension_field_stress if relaxed else fe.stress
    guess = np.array([1.0 / np.linalg.det(at.T @ at)])
    first, second, _ = of(at[:, :1].copy(), at[:, 1:].copy(), guess)
    assert (np.column_stack([first, second]) * towards).sum() == pytest.approx(slope, rel=1e-6, abs=1e-4)


def still(cells, pressure=0.0, damping=0.0):
    return fe.Sheet(cells, pressure, damping, np.zeros((cells + 1, cells + 1), bool), lambda time: np.zeros((3, 0)))


def test_a_uniform_gradient_is_a_patch_without_inner_forces():
    sheet = still(6)
    x, y = fe.nodes(6)
    sheet.displacement = np.array([0.3 * x + 0.1 * y, -0.2 * y, 0.4 * x - 0.3 * y])
    force = sheet.forces()
    assert np.abs(force[:, 1:-1, 1:-1]).max() < 1e-12 * np.abs(force).max()
    assert np.abs(force.sum(axis=(1, 2))).max() < 1e-12 * np.abs(force).max()


def test_pressure_pushes_along_the_normal_by_the_deformed_area():
    sheet = still(5, pressure=3.0)
    x, y = fe.nodes(5)
    sheet.displacement = np.array([0.3 * x, 0.2 * y, 0.5 * x])
    push = sheet.forces() - still_at(5, sheet.displacement)
    assert push.sum(axis=(1, 2)) == pytest.approx(3.0 * np.cross([1.3, 0.0, 0.5], [0.0, 1.2, 0.0]), rel=1e-12)


def still_at(cells, displacement):
    sheet = still(cells)
    sheet.displacement = displacement
    return sheet.forces()


def test_momentum_of_a_free_sheet_is_kept():
    sheet = still(6)
    x, y = fe.nodes(6)
    sheet.displacement = 0.05 * np.array([np.sin(4 * x) * y, np.cos(3 * y), np.sin(5 * x + y)])
    sheet.run(0.2)
    momentum = (sheet.velocity * sheet.masses()).sum(axis=(1, 2))
    assert np.abs(momentum).max() < 1e-12 * (np.abs(sheet.velocity) * sheet.masses()).sum()


def test_the_sudden_pressure_is_that_of_the_older_elements():
    """Another program of the same elements; 100 cells there."""
    found = fe.snapshots(fe.under_pressure(100), (0.25,))[0]
    assert found[2].max() == pytest.approx(0.06334, rel=2e-4)
    older = np.load(DATA / "pressure_dynamic_20Pa.npz")
    x, y = fe.nodes(100)
    quarter = np.column_stack([x[50:, 50:].ravel(), y[50:, 50:].ravel()]) - 0.5
    order = np.lexsort(np.round(older["X"].T, 9))
    mine = np.lexsort(np.round(quarter.T, 9))
    assert quarter[mine] == pytest.approx(older["X"][order], abs=1e-9)
    deflection = found[2, 50:, 50:].ravel()[mine]
    assert deflection == pytest.approx(older["x_t0.25"][order, 2], abs=2e-4 * deflection.max())


def test_coarse_elements_come_near_the_stored_field_of_the_lifted_sheet():
    """The relaxed energy, to the end of the first snapshot; 5.0 % from 50 to 200 elements."""
    stored = np.load(DATA / "out_of_plane.npz")
    found = fe.snapshots(fe.lifted(50, relaxed=True), (1.5,))[0]
    exact = stored["relaxed_u_t1.5"]
    assert np.linalg.norm(found - exact) < 0.055 * np.linalg.norm(exact)
    assert np.linalg.norm(fe.snapshots(fe.lifted(10, relaxed=True), (1.5,))[0] - exact[:, ::5, ::5]) > 0.1 * (
        np.linalg.norm(exact[:, ::5, ::5])
    )
