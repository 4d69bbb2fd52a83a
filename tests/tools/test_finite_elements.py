"""Finite elements are right by themselves: materials, tangent, equilibrium, pressure, dynamics."""

import numpy as np
import pytest

pytest.importorskip("skfem")

from finite_elements import Membrane, Motion, TensionField, gent, incompressible, neo_hookean, rectangle


def neo_hookean_energy(t, d, c):
    q = c * d
    return 0.5 * 2.0 * (q ** (-1 / 3) * (t + c) - 3.0) + 70.0 / 8.0 * (q + 1.0 / q - 2.0)


def gent_energy(t, d, c):
    q = c * d
    first = q ** (-1 / 3) * (t + c)
    return -0.5 * 2.0 * 30.0 * np.log(1.0 - (first - 3.0) / 30.0) + 70.0 / 4.0 * (q - 1.0 - np.log(q))


def yeoh_energy(t, d, c):
    first = t + 1.0 / d - 3.0
    return 0.5 * 2.0 * (first + 0.3 * first**2)


MATERIALS = {
    "neo-Hookean": (neo_hookean(2.0, 70.0), neo_hookean_energy),
    "Gent": (gent(2.0, 70.0, 30.0), gent_energy),
    "Yeoh": (incompressible(2.0, 0.3), yeoh_energy),
}


def least(energy, t, d):
    """Energy at the stretch across the sheet that makes it least."""
    from scipy.optimize import minimize_scalar

    return minimize_scalar(
        lambda c: energy(t, d, c), bounds=(0.05, 5.0), method="bounded", options={"xatol": 1e-10}
    ).fun


@pytest.mark.parametrize("name", MATERIALS)
def test_derivatives_of_a_material_are_those_of_its_energy(name):
    response, energy = MATERIALS[name]
    at = np.array([2.7]), np.array([1.4])
    step = 1e-4
    w_t, w_d, w_tt, w_td, w_dd = (float(x[0]) for x in response(*at))

    def slope(f, axis):
        moves = [tuple(x + s * step * (k == axis) for k, x in enumerate(at)) for s in (1, -1)]
        return (f(*moves[0]) - f(*moves[1])) / (2.0 * step)

    def value(t, d):
        return least(energy, float(t[0]), float(d[0]))

    assert (slope(value, 0), slope(value, 1)) == pytest.approx((w_t, w_d), rel=1e-6)
    for axis, second in ((0, (w_tt, w_td)), (1, (w_td, w_dd))):
        assert slope(lambda t, d: np.array(response(t, d)[:2])[:, 0], axis) == pytest.approx(second, rel=1e-5, abs=1e-8)


@pytest.mark.parametrize("across", [1.1, 0.5])
def test_relaxed_stress_is_the_derivative_of_the_relaxed_energy(across):
    """Taut: the material's own. Slack: that of a strip, whose width is the one of least energy."""
    response, energy = MATERIALS["neo-Hookean"]

    def relaxed(large, small):
        if across > 1.0:
            return least(energy, large + small, large * small)
        width = float(response.strip_width(np.array(large)))
        return energy(large + width, large * width, width)

    large, small, step = 1.9, across, 1e-6
    by_t, by_d, *_ = (float(x[0]) for x in response.relaxed(np.array([large + small]), np.array([large * small])))
    slope = (relaxed(large + step, small) - relaxed(large - step, small)) / (2.0 * step)
    assert by_t + by_d * small == pytest.approx(slope, rel=1e-6)
    assert (by_t + by_d * large == pytest.approx(0.0, abs=1e-12)) == (across < 1.0)


@pytest.mark.parametrize(("t", "d"), [(2.7, 1.4), (3.0, 0.9), (2.2, 0.5), (1.2, 0.3)], ids=str)
@pytest.mark.parametrize("share", [0.0, 0.2])
def test_derivatives_of_the_tension_field_are_those_of_its_energy(t, d, share):
    """Taut, nearly so, wrinkled and slack; no state is compressed but by the share."""
    material, step, at = TensionField(2.0, share), 1e-6, np.array([t, d])

    def slopes(f):
        return [(f(*(at + move)) - f(*(at - move))) / (2.0 * step) for move in step * np.eye(2)]

    w_t, w_d, w_tt, w_td, w_dd = map(float, material(*at))
    assert slopes(material.energy) == pytest.approx([w_t, w_d], abs=1e-8)
    assert slopes(lambda *x: float(material(*x)[0])) == pytest.approx([w_tt, w_td], abs=1e-7)
    assert slopes(lambda *x: float(material(*x)[1])) == pytest.approx([w_td, w_dd], abs=1e-7)
    small = 0.5 * t - np.sqrt(0.25 * t**2 - d)
    assert share > 0.0 or w_t + w_d * (t - small) > -1e-12


@pytest.mark.parametrize("nine", [False, True])
@pytest.mark.parametrize(
    ("components", "material", "pressure"), [(2, incompressible(2.0, 0.1), 0.0), (3, gent(1.0, 200.0, 160.0), 0.3)]
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
        forces.append(sheet.forces())
    sheet.displacement = start
    expected = (forces[0] - forces[1]) / (2.0 * step)
    found = (sheet.assembled()[1] @ way.ravel()).reshape(way.shape)
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_a_uniform_stretch_is_in_equilibrium_under_the_exact_stress():
    """Incompressible, stretched by l in both directions: P = mu (l - l^-5)."""
    x = np.linspace(0.0, 1.0, 4)
    sheet = Membrane(rectangle(x, x, True), incompressible(3.0), 0.1, 2)
    sheet.displacement = 0.5 * sheet.nodes
    forces = sheet.forces()
    inside = ((sheet.nodes > 1e-9) & (sheet.nodes < 1.0 - 1e-9)).all(axis=1)
    assert np.abs(forces[inside]).max() < 1e-13
    right = sheet.nodes[:, 0] > 1.0 - 1e-9
    assert forces[right, 0].sum() == pytest.approx(0.1 * 3.0 * (1.5 - 1.5**-5), rel=1e-12)


def in_space(cells, pressure=0.0):
    x = np.linspace(0.0, 1.0, cells + 1)
    return Membrane(rectangle(x, x, False), neo_hookean(1e3, 1e5), 0.01, 3, pressure)


def test_pressure_pushes_along_the_normal_by_the_deformed_area():
    forces = []
    for pressure in (0.0, 3.0):
        sheet = in_space(5, pressure)
        x, y = sheet.nodes.T
        sheet.displacement = np.column_stack([0.3 * x, 0.2 * y, 0.5 * x])
        forces.append(sheet.forces().sum(axis=0))
    assert forces[0] - forces[1] == pytest.approx(3.0 * np.cross([1.3, 0.0, 0.5], [0.0, 1.2, 0.0]), rel=1e-12)


def test_momentum_of_a_free_sheet_is_conserved():
    sheet = in_space(6)
    x, y = sheet.nodes.T
    sheet.displacement = 0.05 * np.column_stack([np.sin(4 * x) * y, np.cos(3 * y), np.sin(5 * x + y)])
    motion = Motion(sheet, 1000.0, 0.0, np.zeros(len(x), bool), lambda time: np.zeros((0, 3)), 0.02)
    assert motion.masses.sum() == pytest.approx(10.0)
    motion.run(0.2)
    momentum = (motion.velocity * motion.masses[:, None]).sum(axis=0)
    assert np.abs(momentum).max() < 1e-12 * (np.abs(motion.velocity) * motion.masses[:, None]).sum()


def test_a_sheet_without_an_equilibrium_says_so():
    x = np.linspace(0.0, 1.0, 3)
    sheet = Membrane(rectangle(x, x, False), incompressible(1.0), 0.1, 2)
    held = np.repeat(((sheet.nodes == 0.0) | (sheet.nodes == 1.0)).any(axis=1)[:, None], 2, axis=1)
    goal = np.where(sheet.nodes > 0.5, -1.1 * sheet.nodes, 0.0)
    with pytest.raises(ArithmeticError, match="smaller steps"):
        sheet.solve(held, goal)
