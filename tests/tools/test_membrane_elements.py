"""Membrane finite elements: their tangent, their order, and the plane elements of the references."""

import numpy as np
import pytest

pytest.importorskip("skfem")

from error_vs_time.elements import SCENES
from error_vs_time.membrane import Membrane, around_hole, gent, neo_hookean, rectangle
from error_vs_time.results import Row
from error_vs_time.studies import Configuration
from error_vs_time.tables import against_elements


def row(points, seconds, field, law="plain", horizon=2.015):
    run = Configuration("pressure", law, horizon, points, 64, "newton")
    return Row(run, "finished", 0.01, field, seconds, 0.0, 0.0, 0.0, 1.0, "CPU, one core", "today")


@pytest.mark.parametrize("nine", [False, True])
@pytest.mark.parametrize(
    ("components", "material", "pressure"), [(2, neo_hookean(2.0), 0.0), (3, gent(1.0, 200.0, 160.0), 0.3)]
)
def test_the_tangent_is_the_derivative_of_the_forces(components, material, pressure, nine):
    x = np.linspace(0.0, 1.0, 3)
    sheet = Membrane(rectangle(x, x, nine), material, 0.1, components, pressure)
    rng, step = np.random.default_rng(0), 1e-6
    start = 0.03 * rng.standard_normal(sheet.displacement.shape)
    way = rng.standard_normal(start.shape)
    forces = []
    for sign in (1.0, -1.0):
        sheet.displacement = start + sign * step * way
        forces.append(sheet.assembled()[0])
    sheet.displacement = start
    expected = (forces[0] - forces[1]) / (2.0 * step)
    found = (sheet.assembled()[1] @ way.ravel()).reshape(way.shape)
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_a_uniform_stretch_is_in_equilibrium_under_the_exact_stress():
    """Incompressible, stretched by l in both directions: P = mu (l - l^-5)."""
    x = np.linspace(0.0, 1.0, 4)
    sheet = Membrane(rectangle(x, x, True), neo_hookean(3.0), 0.1, 2)
    sheet.displacement = 0.5 * sheet.nodes
    forces, _ = sheet.assembled()
    inside = ((sheet.nodes > 1e-9) & (sheet.nodes < 1.0 - 1e-9)).all(axis=1)
    assert np.abs(forces[inside]).max() < 1e-13
    right = sheet.nodes[:, 0] > 1.0 - 1e-9
    assert forces[right, 0].sum() == pytest.approx(0.1 * 3.0 * (1.5 - 1.5**-5), rel=1e-12)


def test_the_hole_is_round():
    mesh = around_hole(0.3, 1.0, 4, True)
    sheet = Membrane(mesh, neo_hookean(1.0), 1.0, 2)
    assert np.hypot(*sheet.nodes.T).min() == pytest.approx(0.3, rel=1e-12)
    assert sheet.weights.sum() == pytest.approx(4.0 - np.pi * 0.09, rel=2e-5)


@pytest.mark.parametrize("scene", SCENES)
def test_finer_elements_come_nearer_to_the_reference(scene):
    """Elements of nine nodes, corners and reference in the way of their order three."""
    coarse, fine = (SCENES[scene](points, True).errors()[1] for points in (13, 25))
    assert fine < 0.35 * coarse
    assert fine < 1e-3


def test_who_needs_how_long():
    rows = [
        row(26, 0.1, 2e-3),
        row(51, 0.4, 5e-4),
        row(13, 0.02, 9e-4, law="membrane_q9", horizon=0.0),
    ]
    lines = against_elements(rows)
    assert lines[2].endswith("plain, 2.015, 26 points, newton, float64: 0.1 s | 5.0 |")
    assert lines[3].endswith("0.4 s | 20.0 |")
    assert lines[4].endswith("| - | - | - |")
