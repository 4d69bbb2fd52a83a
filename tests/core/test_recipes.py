"""The recipes of docs/recipes against closed forms, in every solver that takes them, through restart and plan."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers import refused, square
from own_parts import RECIPES, recipe
from resumed_runs import require_same_when_stopped
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import erf

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
    ValuesInTime,
)

NAMES = sorted(path.stem for path in RECIPES.glob("*.py"))
C10 = 1e5
LAW = BondAssociated(MooneyRivlin(C10))
STATIC = {"newton": Newton(tolerance=1e-9), "relaxation": Relaxation(tolerance=1e-8, ramp_steps=300)}
FALL = 9.81


def run(simulation):
    result = simulation.run(device="cpu", precision=64)
    assert result.status == "finished", result.summary["message"]
    return result


@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_has_less_than_eighty_lines_and_is_on_the_page(name):
    assert len([line for line in (RECIPES / f"{name}.py").read_text().splitlines() if line.strip()]) < 80
    assert f"recipes/{name}.py" in (RECIPES.parent / "recipes.md").read_text()


WRONG = {
    "thickness = 0": lambda: recipe("dielectric").charge(4e-11, 1e3, 0.0),
    "voltage = 'high'": lambda: recipe("dielectric").charge(4e-11, "high", 1e-3),
    "directions: expected shape (25, 3), got (3,)": lambda: recipe("fibres").along(square(5), (0.0, 1.0, 0.0)),
    "directions[0, 0] = nan": lambda: recipe("fibres").along(square(5), np.full((25, 3), np.nan)),
    "Mullins.r = 0.5": lambda: recipe("mullins").Mullins(C10, r=0.5, m=1e4),
    "Mullins.b = -0.1": lambda: recipe("mullins").Mullins(C10, r=2.0, m=1e4, b=-0.1),
}


@pytest.mark.parametrize("said", WRONG)
def test_a_recipe_refuses_wrong_numbers(said):
    with refused(said):
        WRONG[said]()


# Gravity


@pytest.mark.parametrize("name", STATIC)
def test_a_stretched_strip_sags_under_its_weight(name):
    sheet, most, acceleration = square(25), 1.5, 0.2
    loads = [
        Fixed(sheet.edges("left")), Fixed(np.arange(sheet.size), components="y"),
        Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, (most - 1.0) * 0.1], z=0.0),
        recipe("gravity").Gravity((0.0, 0.0, -acceleration)),
    ]  # fmt: skip
    sag = -run(Simulation(sheet, LAW, STATIC[name], loads=loads)).frame.displacement[:, 2].min()
    tension = 2.0 * C10 * (most - most**-3)
    assert sag == pytest.approx(1000.0 * acceleration * most * 0.1**2 / (8.0 * tension), rel=5e-3)


# Air drag


def falling(frames=8, gravity=FALL, duration=0.8):
    sheet = square(5)
    start = np.tile([0.3, 0.0, -3.0], (sheet.size, 1)) if gravity == 0.0 else None
    loads = [recipe("air_drag").AirDrag()] + ([recipe("gravity").Gravity((0.0, 0.0, -gravity))] if gravity else [])
    return Simulation(sheet, LAW, Explicit(duration, frames=frames), loads=loads, initial_velocity=start)


def test_a_thrown_sheet_slows_down_in_air():
    result = run(falling(gravity=0.0))
    speed, each = np.hypot(3.0, 0.3), 0.5 * 1.2 / (1000.0 * 1e-3)
    expected = speed / (1.0 + each * speed * 0.8)
    np.testing.assert_allclose(np.linalg.norm(result.frame.velocity, axis=1), expected, rtol=1e-3)
    last = result.history[-1]
    assert abs(last["balance_error"]) < 1e-4
    assert last["drag"] == pytest.approx(0.5 * 1e-2 * (speed**2 - expected**2), rel=1e-3)


def test_a_falling_sheet_comes_to_its_terminal_velocity():
    result = run(falling())
    fastest = np.sqrt(2.0 * FALL / 1.2)
    np.testing.assert_allclose(-result.frame.velocity[:, 2], fastest * np.tanh(FALL * 0.8 / fastest), rtol=1e-3)
    assert abs(result.history[-1]["balance_error"]) < 1e-3


# A gas that leaves through a valve


def deflating(frames=8):
    sheet = square(9)
    gas = recipe("valve").GasWithValve(gauge=2e3, ambient=1e4, exponent=1.4, chamber=1e-2, opening=5e-5, opens_at=500.0)
    return Simulation(sheet, LAW, Explicit(1.0, frames=frames, damping=50.0), loads=[Fixed(sheet.edges("all")), gas])


def test_a_valve_lets_out_what_its_differential_equation_says():
    result = run(deflating(frames=200))
    time, volume, pressure = (
        np.array([row[name] for row in result.history]) for name in ("time", "volume", "pressure")
    )
    mass = 1.2 * 1.2 ** (1.0 / 1.4) * volume[0]

    def gauge(t, left):
        return 1.2e4 * (left * volume[0] / np.interp(t, time, volume)) ** 1.4 - 1e4

    def rate(t, left):
        p = gauge(t, left)
        return -5e-5 * np.sqrt(2.0 * p * left / (mass * np.interp(t, time, volume))) if p > 500.0 else 0.0 * left

    found = solve_ivp(rate, (0.0, time[-1]), [1.0], t_eval=time, rtol=1e-8, max_step=1e-4)
    np.testing.assert_allclose(pressure, gauge(time, found.y[0]), rtol=5e-3)
    assert pressure[-1] == pytest.approx(500.0, rel=5e-3)


# A dielectric elastomer


def free_to_stretch(sheet):
    return [
        Fixed(sheet.edges("left"), components="x"), Fixed(sheet.edges("bottom"), components="y"),
        Fixed(np.arange(sheet.size), components="z"),
    ]  # fmt: skip


# Nominal stress at the edges over 2 C10, so small that it only says to solvers what a small force is.
PULLED = 1e-5
MOST = 4.0 ** (-1.0 / 3.0) - 4.0 ** (-4.0 / 3.0)


def pulled_at_edges(sheet, stress):
    force = stress * 1e-3 * 0.1
    return [PointForce(sheet.edges("right"), (force, 0.0, 0.0)), PointForce(sheet.edges("top"), (0.0, force, 0.0))]


def actuator(share, solver):
    """A square of equal biaxial stretch at a share of the voltage at which it pulls in."""
    sheet, dielectric = square(9).as_cloud(), recipe("dielectric")
    permittivity = 4.7 * 8.854e-12
    volts = share * 1e-3 * np.sqrt(2.0 * C10 * MOST / permittivity)
    law = BondAssociated(dielectric.DielectricSheet(C10, by_point=dielectric.charge(permittivity, volts, 1e-3)))
    loads = [
        *free_to_stretch(sheet),
        *pulled_at_edges(sheet, PULLED * 2.0 * C10),
        ValuesInTime([(0.0, 0.0), (1.0, 1.0)]),
    ]
    return Simulation(sheet, law, solver, loads=loads)


def stretch_at(share):
    """Closed form of an ideal actuator: epsilon E^2 / mu = l^-2 - l^-8, with E of the undeformed thickness."""
    return brentq(lambda s: s**-2 - s**-8 - PULLED * s**-3 - share**2 * MOST, 1.0, 4.0 ** (1.0 / 6.0))


@pytest.mark.parametrize("name", STATIC)
def test_an_actuator_stretches_as_its_closed_form(name):
    moved = run(actuator(0.95, STATIC[name])).frame.displacement
    assert np.ptp(moved[:, 0]) / 0.1 + 1.0 == pytest.approx(stretch_at(0.95), rel=1e-4)
    assert np.ptp(moved[:, 1]) / 0.1 + 1.0 == pytest.approx(stretch_at(0.95), rel=1e-4)


def test_an_actuator_pulls_in_at_a_stretch_of_1_26():
    last = run(actuator(0.99995, Newton(tolerance=1e-9))).frame.displacement
    assert np.ptp(last[:, 0]) / 0.1 + 1.0 == pytest.approx(4.0 ** (1.0 / 6.0), rel=5e-3)
    beyond = actuator(1.001, Newton(most_cuts=4)).run(device="cpu", precision=64)
    assert beyond.status == "not converged"


# A temperature that changes the modulus


def warming(solver):
    """A square at a biaxial dead load, which from load time 0.5 on is 1.5 times as warm."""
    law = BondAssociated(recipe("temperature").WarmRubber(C10, by_point=1.2))
    sheet = square(7).as_cloud()
    ramp = [(0.0, 0.0), (0.5, 1.0), (1.0, 1.0)]
    loads = [
        *free_to_stretch(sheet), ValuesInTime([(0.0, 1.0), (0.5, 1.0), (1.0, 1.5)]),
        *(replace(load, ramp=ramp) for load in pulled_at_edges(sheet, 1.5 * C10)),
    ]  # fmt: skip
    return Simulation(sheet, law, solver, loads=loads)


@pytest.mark.parametrize("name", STATIC)
def test_stress_is_proportional_to_the_temperature(name):
    moved = run(warming(replace(STATIC[name], load_steps=2))).frame.displacement
    stretch = brentq(lambda s: 2.0 * 1.2 * 1.5 * (s - s**-5) - 1.5, 1.0, 3.0)
    assert np.ptp(moved[:, 0]) / 0.1 + 1.0 == pytest.approx(stretch, rel=1e-4)


def test_a_temperature_may_vary_from_point_to_point():
    warm = recipe("temperature").WarmRubber(C10, by_point=lambda x, y: 1.0 + 5.0 * x)
    sheet, stress = square(25).as_cloud(), 2e5
    loads = [
        Fixed(sheet.edges("left")), Fixed(np.arange(sheet.size), components="yz"),
        PointForce(sheet.edges("right"), (stress * 1e-4, 0.0, 0.0)),
    ]  # fmt: skip
    moved = run(Simulation(sheet, BondAssociated(warm), STATIC["newton"], loads=loads)).frame.displacement
    place = np.linspace(0.0, 0.1, 201)
    stretch = [brentq(lambda s, x=x: 2.0 * C10 * (1.0 + 5.0 * x) * (s - s**-3) - stress, 1.0, 3.0) for x in place]
    assert moved[:, 0].max() == pytest.approx(np.trapezoid(stretch, place) - 0.1, rel=5e-3)


def test_heat_is_no_energy_out_of_nowhere():
    """Three times as warm, a stretched sheet has three times the energy, and no frame is taken for unsound."""
    sheet = square(7).prestretched(1.3).as_cloud()
    law = BondAssociated(recipe("temperature").WarmRubber(C10))
    loads = [Fixed(np.arange(sheet.size)), ValuesInTime([(0.0, 1.0), (0.1, 3.0)])]
    result = run(Simulation(sheet, law, Explicit(0.1, frames=10), loads=loads))
    assert result.status == "finished" and result.summary["repeated"] == 0
    assert result.history[-1]["strain"] == pytest.approx(3.0 * result.history[0]["strain"], rel=1e-6)
    assert "balance_error" not in result.history[-1]
    assert any("ValuesInTime changes energies" in note for note in result.summary["notes"])


# Fibres


def slopes(fibres, first, second):
    """Derivatives of the energy [Pa] by the stretches along and across the direction of the fibres."""
    c, s = np.cos(fibres.angle) ** 2, np.sin(fibres.angle) ** 2
    E = max(first**2 * c + second**2 * s - 1.0, 0.0)
    pull, gone = 4.0 * fibres.k1 * E * np.exp(fibres.k2 * E**2), (first * second) ** -2.0
    return tuple(2.0 * fibres.c10 * (a - gone / a) + pull * w * a for a, w in ((first, c), (second, s)))


def fibred(solver):
    """A square with fibres at 35 degrees from y."""
    sheet, fibres = square(9).as_cloud(), recipe("fibres")
    along = fibres.along(sheet, np.tile([0.0, 1.0, 0.0], (sheet.size, 1)))
    material = fibres.Fibres(C10, 5.0 * C10, 0.5, np.radians(35.0), by_point=along)
    loads = [*free_to_stretch(sheet), *pulled_at_edges(sheet, C10)]
    return Simulation(sheet, BondAssociated(material), solver, loads=loads)


@pytest.mark.parametrize("name", STATIC)
def test_fibres_carry_what_their_energy_says(name):
    scene = fibred({**STATIC, "relaxation": replace(STATIC["relaxation"], safety=0.4)}[name])
    moved, material = run(scene).frame.displacement, scene.force.material
    across, along, _ = 1.0 + moved[-1] / 0.1
    assert across > 1.05
    assert along < 1.0
    assert slopes(material, along, across) == pytest.approx((C10, C10), rel=1e-4)


def wound_tube(angle):
    """Axial and hoop stretch of a closed tube under pressure with fibres at an angle to its axis [degrees]."""
    radius, length, pressure = 0.02, 0.04, 2e3
    sheet = Sheet.tube(radius, length, thickness=1e-3, density=1e3, points=40)
    fibres = recipe("fibres")
    direction = fibres.along(sheet, np.tile([0.0, 0.0, 1.0], (sheet.size, 1)))
    material = fibres.Fibres(1e4, 2e6, 0.5, np.radians(angle), by_point=direction)
    loads = [
        Pressure(pressure), PointForce(sheet.edges("top"), (0.0, 0.0, np.pi * radius**2 * pressure)),
        Fixed(sheet.edges("bottom"), components="z"),
        *(Fixed(np.flatnonzero(np.abs(sheet.points[:, k]) < 1e-9), components="xy"[k]) for k in range(2)),
    ]  # fmt: skip
    moved = run(Simulation(sheet, BondAssociated(material), Newton(tolerance=1e-8), loads=loads)).frame.displacement
    place = sheet.points + moved
    middle = np.abs(sheet.points[:, 2] - 0.5 * length) < 0.1 * length
    found = (
        1.0 + moved[sheet.edges("top"), 2].mean() / length,
        np.hypot(place[:, 0], place[:, 1])[middle].mean() / radius,
    )
    axial = pressure * radius / 2e-3

    def unbalanced(stretches):
        along, around = slopes(material, *stretches)
        return along - axial, around - pressure * radius / 1e-3 * stretches[0] * stretches[1]

    return found, fsolve(unbalanced, found, xtol=1e-12)


def test_a_tube_wound_at_54_7_degrees_keeps_its_length():
    (along, around), exact = wound_tube(np.degrees(np.arctan(np.sqrt(2.0))))
    assert along == pytest.approx(1.0, abs=5e-3)
    assert (along, around) == pytest.approx(exact, rel=5e-3)


def test_a_tube_wound_at_another_angle_does_not():
    (along, around), exact = wound_tube(45.0)
    assert abs(along - 1.0) > 0.05
    assert (along, around) == pytest.approx(exact, rel=5e-3)


# Mullins softening

SOFT = {"r": 1.5, "m": 0.2 * C10, "b": 0.1}


def softened_stress(stretch, largest):
    """Nominal stress [Pa] in equal biaxial tension: Ogden and Roxburgh 1999."""
    now, most = (C10 * (2.0 * s**2 + s**-4 - 3.0) for s in (stretch, largest))
    eta = 1.0 - erf(max(most - now, 0.0) / (SOFT["m"] + SOFT["b"] * most)) / SOFT["r"]
    return eta * 2.0 * C10 * (stretch - stretch**-5)


def softening(solver):
    """A square that is loaded and half unloaded."""
    sheet, ramp = square(7).as_cloud(), [(0.0, 0.0), (0.5, 1.0), (1.0, 0.5)]
    loads = [*free_to_stretch(sheet), *(replace(load, ramp=ramp) for load in pulled_at_edges(sheet, 3.0 * C10))]
    return Simulation(sheet, BondAssociated(recipe("mullins").Mullins(C10, **SOFT)), solver, loads=loads)


@pytest.mark.parametrize("name", STATIC)
def test_softened_rubber_unloads_along_its_closed_form(name):
    # Relaxation must not count on the estimate, which averages loading and unloading (docs/recipes.md).
    solver = replace(STATIC[name], load_steps=4)
    sheet_run = softening(replace(solver, safety=0.6) if name == "relaxation" else solver)
    largest = brentq(lambda s: 2.0 * C10 * (s - s**-5) - 3.0 * C10, 1.0, 3.0)
    found = np.ptp(run(sheet_run).frame.displacement[:, 0]) / 0.1 + 1.0
    assert found == pytest.approx(brentq(lambda s: softened_stress(s, largest) - 1.5 * C10, 1.0, largest), rel=1e-3)


def stretched_and_back():
    sheet = square(9).as_cloud()
    loads = [
        *free_to_stretch(sheet)[1:], Motion(sheet.edges("left"), [0.0, 0.2], x=[0.0, 0.0]),
        Motion(sheet.edges("right"), [0.0, 0.1, 0.2], x=[0.0, 0.05, 0.0]),
    ]  # fmt: skip
    law = BondAssociated(recipe("mullins").Mullins(C10, **SOFT))
    return Simulation(sheet, law, Explicit(0.2, frames=4), loads=loads)


def test_softening_dissipates_what_the_energy_balance_says():
    history = run(stretched_and_back()).history
    assert max(abs(row["balance_error"]) for row in history) < 5e-3
    # The sheet is as at the start, and the work that it took stays.
    assert history[-1]["external"] > 0.2 * history[2]["external"]


def test_softening_keeps_the_energy_balance_in_uneven_strain():
    """An intersection that remembered the mean of its family lost 1.5 %, with any step."""
    sheet = square(9).as_cloud()
    left, right = sheet.edges("left"), sheet.edges("right")
    flat = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    loads = [
        Fixed(left), Motion(right, [0.0, 0.1, 0.2], x=[0.0, 0.05, 0.0], y=0.0, z=0.0), Fixed(flat, "z")
    ]  # fmt: skip
    law = BondAssociated(recipe("mullins").Mullins(C10, **SOFT))
    history = run(Simulation(sheet, law, Explicit(0.2, frames=8), loads=loads)).history
    assert max(abs(row["balance_error"]) for row in history) < 5e-4


# Restart, plan, refusals

EXPLICIT = Explicit(0.02, frames=8)
SCENES = {
    "air_drag": falling, "gravity": falling, "valve": deflating,
    "dielectric": lambda: actuator(0.5, EXPLICIT), "temperature": lambda: warming(EXPLICIT),
    "fibres": lambda: fibred(replace(EXPLICIT, safety=0.4)), "mullins": stretched_and_back,
    "mullins at rest": lambda: softening(replace(STATIC["newton"], load_steps=4)),
}  # fmt: skip
ARRAYS = {
    "air_drag": "drag .*AirDrag", "valve": "gas_left .*GasWithValve", "dielectric": "unit_values .*ValuesInTime",
    "temperature": "unit_values .*ValuesInTime", "fibres": "point_values .*BondAssociated",
    "mullins": "remembered .*BondAssociated",
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in SCENES if name not in ("gravity", "dielectric", "fibres")])
def test_a_run_with_a_recipe_goes_on_bit_for_bit(name, tmp_path):
    require_same_when_stopped(SCENES[name], tmp_path, [3], precision=64)


@pytest.mark.parametrize("name", ARRAYS)
def test_plan_names_what_a_recipe_allocates(name):
    assert re.search(rf"^  {ARRAYS[name]}$", SCENES[name]().plan("cpu", 64), re.MULTILINE)


@pytest.mark.parametrize("solver", [Newton(), Relaxation()])
@pytest.mark.parametrize("name", ["air_drag", "valve"])
def test_static_solvers_refuse_what_needs_time_in_one_line(name, solver):
    scene = SCENES[name]()
    scene.solver = solver
    with refused(match="expected Explicit"):
        scene.build("cpu")
