"""Sheets of graded spacing, and outlines with everything: balance, energy, and what is refused."""

import numpy as np
import pytest
from helpers import MU, NEO, build, internal_force, refused, strain_energy

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalEnergy,
    Explicit,
    RigidBall,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.geometry.triangulation import boundary_edges
from warp_pd.measures import TearLine
from warp_pd.shapes.curves import Circle
from warp_pd.shapes.roughness import rough_surface

SQUARE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
SHEET = {"thickness": 1e-3, "density": 1000.0}
STRIP = [(0.0, 0.0), (0.12, 0.0), (0.12, 0.05), (0.0, 0.05)]


def graded(x, y):
    return 0.004 + 0.04 * np.hypot(x - 0.05, y - 0.05)


def fine_in_the_middle(x, y):
    return np.clip(0.0025 + 0.15 * (np.abs(x - 0.06) - 0.02), 0.0025, 0.005)


def sheet_of(spacing):
    return Sheet.outline(
        SQUARE, holes=[Circle((0.05, 0.03), 0.012)], cracks=[[(0.02, 0.07), (0.07, 0.075)]], spacing=spacing, **SHEET
    )


def strip():
    return Sheet.outline(STRIP, spacing=fine_in_the_middle, **SHEET)


SPACINGS = pytest.mark.parametrize("spacing", [0.006, graded], ids=["even", "graded"])


@SPACINGS
@pytest.mark.parametrize("horizon", [2.015, 3.15])
def test_uniform_stress_is_in_equilibrium(spacing, horizon):
    """Forces are on the boundary alone, and there those of the stress: P n over half of each adjacent edge."""
    sheet = sheet_of(spacing)
    built = build(sheet, horizon=horizon, weights="corrected")
    gradient = np.array([[1.2, 0.1], [-0.05, 0.9]])
    displacement = np.zeros((sheet.size, 3))
    displacement[:, :2] = sheet.points @ (gradient - np.eye(2)).T
    force = internal_force(built, displacement)
    inside = np.setdiff1d(np.arange(sheet.size), boundary_edges(sheet.triangles))
    unit = MU * sheet.thickness * sheet.spacing
    assert np.abs(force[inside]).max() < 1e-10 * unit
    edges = boundary_edges(sheet.triangles)
    along = sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]]
    outward = np.zeros((sheet.size, 2))
    for end in (0, 1):
        np.add.at(outward, edges[:, end], 0.5 * sheet.thickness * np.column_stack([along[:, 1], -along[:, 0]]))
    stress = -np.linalg.lstsq(outward, force[:, :2], rcond=None)[0].T
    assert np.abs(force[:, :2] + outward @ stress.T).max() < 1e-10 * unit
    # In plane stress, P = mu (F - J^-2 F^-T) but for the bulk modulus, a hundred times as large.
    incompressible = gradient - np.linalg.det(gradient) ** -2 * np.linalg.inv(gradient).T
    assert np.allclose(stress, MU * incompressible, atol=0.02 * MU)


@SPACINGS
def test_momentum_and_the_gradient_of_the_energy(spacing):
    sheet = sheet_of(spacing)
    built = build(sheet, horizon=2.015, weights="corrected")
    generator = np.random.default_rng(0)
    displacement = 0.05 * sheet.spacing * generator.standard_normal((sheet.size, 3))
    displacement[:, 0] += 0.1 * sheet.points[:, 0]
    force = internal_force(built, displacement)
    scale = np.abs(force).max()
    assert np.abs(force.sum(axis=0)).max() < 1e-10 * scale
    place = sheet.positions + displacement
    assert np.abs(np.cross(place, force).sum(axis=0)).max() < 1e-10 * scale * 0.1
    direction = generator.standard_normal((sheet.size, 3))
    step = 1e-4 * sheet.spacing
    energies = [strain_energy(built, displacement + sign * step * direction) for sign in (-1.0, 1.0)]
    slope = (energies[1] - energies[0]) / (2.0 * step)
    assert np.isclose(slope, -(force * direction).sum(), rtol=1e-5)


def test_points_follow_the_spacing():
    sheet = sheet_of(graded)
    edges = np.concatenate([sheet.triangles[:, [0, 1]], sheet.triangles[:, [1, 2]], sheet.triangles[:, [2, 0]]])
    ratio = np.linalg.norm(np.diff(sheet.points[edges], axis=1), axis=-1)[:, 0] / sheet.spacings[edges].mean(axis=1)
    assert 0.6 < ratio.min() and ratio.max() < 1.65
    inside = np.setdiff1d(np.arange(sheet.size), boundary_edges(sheet.triangles))
    cells = (sheet.areas / sheet.spacings**2)[inside]
    assert 0.45 < cells.min() and cells.max() < 1.6
    assert abs(cells.mean() - 1.0) < 0.05


def test_a_function_of_one_value_has_as_many_points_as_a_number():
    even, function = (Sheet.outline(SQUARE, spacing=s, **SHEET).size for s in (0.004, lambda x, y: 0.004 + 0 * x))
    assert abs(function / even - 1.0) < 0.03


def test_weights_are_corrected_on_a_graded_sheet_also_if_bonds_can_break():
    law = BondAssociated(NEO)
    assert law.resolved_weights(True) == "plain"
    assert law.resolved_weights(True, graded=True) == "corrected"
    assert build(strip(), weights="auto", damage=TearingEnergy(10.0, spared=spared(strip()))).law.weights == "corrected"


def spared(sheet):
    """All points but those of the fine middle."""
    return sheet.where(lambda x, y: np.abs(x - 0.06) > 0.02)


def built(sheet, **parts):
    return Simulation(sheet, force=BondAssociated(NEO), solver=Explicit(1.0), **parts).build("cpu", 64)


def test_the_length_of_a_tearing_energy_does_not_follow_the_spacing():
    graded, even = (
        built(sheet, damage=TearingEnergy(10.0, length=0.02)).rupture
        for sheet in (strip(), Sheet.outline(STRIP, spacing=0.0025, **SHEET))
    )
    assert graded.limit == even.limit and graded.length == even.length


def test_parts_that_know_one_spacing_are_refused():
    with refused(match="expected a sheet of uniform spacing, got a graded sheet"):
        built(strip(), damage=CriticalEnergy(1e3))
    with refused(match="force = BondBased: expected BondAssociated or Visco on a sheet of graded"):
        Simulation(strip(), force=BondBased(Bimodular(1e3)), solver=Explicit(1.0)).build("cpu", 64)


def test_a_ball_must_not_pass_between_the_points_of_the_coarse_part():
    ball = RigidBall(diameter=0.006, start=(0.06, 0.025, 0.01), velocity=(0.0, 0.0, -1.0))
    with refused(match=r"RigidBall\.diameter = 0\.006"):
        built(strip(), contact=ball)


def test_bumps_are_as_high_as_the_local_spacing_says():
    sheet = strip()
    height = np.abs(rough_surface(sheet, 0.1, 0)[:, 2])
    assert (height <= 0.1 * sheet.spacings).all()
    assert height.max() > 0.1 * sheet.spacing


def test_specks_are_told_by_the_local_spacing():
    """One torn triangle is a broken bond, not a crack, wherever it is."""
    sheet = strip()
    line = TearLine(sheet)
    for place in ((0.06, 0.025), (0.1, 0.025)):
        intact = np.ones(len(sheet.triangles), bool)
        intact[np.argmin(np.linalg.norm(line.centres - place, axis=1))] = False
        assert line.without_specks(intact).all()
        intact[np.linalg.norm(line.centres - place, axis=1) < 0.011] = False
        assert not line.without_specks(intact).all()
