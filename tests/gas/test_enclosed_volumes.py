"""Enclosed volumes in runs: a maximum of pressure, work of a gas, bits, restarts, torn sheets."""

import numpy as np
import pytest
from helpers import build, jittered, refused, sever, soften, square
from references.shooting import at_stretch
from resumed_runs import require_same_when_stopped
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from small_runs import run, simulate

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    CutsInTime,
    EnclosedGas,
    EnclosedVolume,
    Explicit,
    Fixed,
    MooneyRivlin,
    Newton,
    Pressure,
    Punch,
    Relaxation,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.shapes.curves import Circle

RUBBER = MooneyRivlin(500.0)
RADIUS, THICKNESS = 0.1, 1e-3


def disc(points, solver, most):
    """A disc that is inflated to a volume, in cubes of its radius."""
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), thickness=THICKNESS, density=1e3
    )
    rim = sheet.where(lambda x, y: np.hypot(x, y) > RADIUS * (1.0 - 1e-9))
    volume = EnclosedVolume([(0.0, 0.0), (1.0, most * RADIUS**3)], stiffness=40.0 / RADIUS**3)
    law = BondAssociated(RUBBER, horizon=2.015, weights="corrected")
    return Simulation(sheet, law, solver, loads=[Fixed(rim), volume]).run(device="cpu")


def reference():
    """Pressure [Pa] of the disc as a function of its volume [m^3]; its maximum is 18.79 Pa at 2.79 cubes."""
    discs = [at_stretch(pole) for pole in np.linspace(1.2, 3.2, 30)]
    volumes = [disc.volume * RADIUS**3 for disc in discs]
    return CubicSpline(volumes, [disc.pressure * 1e3 * THICKNESS / RADIUS for disc in discs])


def test_an_inflated_disc_passes_its_maximum_of_pressure():
    pressure = reference()
    errors = {}
    for points, solver in ((33, Relaxation(load_steps=6, tolerance=1e-5)), (17, Newton(load_steps=6))):
        result = disc(points, solver, 3.9)
        assert result.status == "finished"
        rows = result.history[2:]
        found = np.array([row["pressure"] for row in rows])
        assert rows[-1]["volume"] > 3.2 * RADIUS**3 and found.argmax() < len(found) - 1
        errors[points] = np.abs(found / pressure([row["volume"] for row in rows]) - 1.0).max()
    assert errors[33] < 0.005
    # Of second order.
    assert np.log(errors[17] / errors[33]) / np.log(2.0) > 1.8


def test_both_solvers_find_one_equilibrium_of_a_gas():
    sheet = jittered(13)
    gas = EnclosedGas(ambient=200.0, exponent=1.4, chamber=2e-4, amount=[(0.0, 1.0), (1.0, 1.5)])
    parts = {"loads": [Fixed(sheet.edges("all")), gas], "material": RUBBER, "weights": "corrected"}
    newton = run(sheet, Newton(load_steps=3), **parts)
    relaxed = run(sheet, Relaxation(load_steps=3, tolerance=1e-8), **parts)
    assert newton.status == relaxed.status == "finished"
    for one, other in zip(newton.history, relaxed.history, strict=True):
        assert one["pressure"] == pytest.approx(other["pressure"], rel=1e-5)
        absolute = 200.0 * ((one["time"] * 0.5 + 1.0) * 2e-4 / one["volume"]) ** 1.4
        assert one["pressure"] + 200.0 == pytest.approx(absolute, rel=1e-9)
    assert newton.frame.displacement == pytest.approx(relaxed.frame.displacement, abs=1e-6)
    # With the exact tangent the last load step takes a handful of steps.
    assert newton.summary["solve"]["iterations"] < 30


def test_a_gas_works_what_its_law_says():
    """From an excess pressure: the work on the sheet is the loss of energy of the gas, less the push on the air."""
    sheet = square(13)
    gas = EnclosedGas(gauge=60.0, ambient=200.0, chamber=2e-4)
    result = run(
        sheet, Explicit(0.03, frames=3, safety=0.05), loads=[Fixed(sheet.edges("all")), gas], material=RUBBER,
        precision=64,
    )  # fmt: skip
    for row in result.history[1:]:
        volume = row["volume"]
        work = 260.0 * 2e-4 * np.log(volume / 2e-4) - 200.0 * (volume - 2e-4)
        assert volume > 2.1e-4
        assert row["pressure"] + 200.0 == pytest.approx(260.0 * 2e-4 / volume, rel=1e-6)
        assert row["external"] == pytest.approx(work, rel=2e-4)
        assert abs(row["balance_error"]) < 5e-4


def test_bits_repeat_and_a_resumed_run_goes_on_with_them(tmp_path):
    def simulation():
        sheet = square(9)
        gas = EnclosedGas(ambient=200.0, chamber=2e-4, amount=[(0.0, 1.0), (0.02, 1.5)])
        return simulate(sheet, Explicit(0.02, frames=6), loads=[Fixed(sheet.edges("all")), gas], material=RUBBER)

    require_same_when_stopped(simulation, tmp_path, (2, 4), precision=32)


@pytest.mark.parametrize("make", [square, jittered])
def test_cut_triangles_carry_no_pressure(make):
    """The force of each triangle that is still whole, a third for each corner; the volume still counts all."""
    sheet = make(13)
    built = build(
        sheet, loads=[Fixed(sheet.edges("all")), EnclosedGas(gauge=5.0, chamber=1.0)], damage=CriticalStretch(3.0)
    )
    built.context.run("setup")
    undamaged = built.to_numpy(built.state.external)
    assert undamaged[:, 2].sum() == pytest.approx(5.0 * 0.01, rel=1e-12)
    sever(built, ((0.0, 0.0512), (0.06, 0.0512)))
    built.context.run("setup")
    built.context.run("frame")
    torn = built.to_numpy(built.state.external)
    far = np.abs(sheet.points[:, 1] - 0.0512) > 2.0 * sheet.spacing
    assert (torn[far] == undamaged[far]).all()
    whole = built.to_numpy(built.rupture.intact_faces).astype(bool)
    corners = sheet.points[sheet.triangles]
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * np.abs(side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0])
    assert 0 < (~whole).sum() < 40
    # On a grid the other cuts of squares have triangles of their own; all of a square that the crack crosses go.
    assert torn[:, 2].sum() == pytest.approx(5.0 * areas[whole].sum(), rel=1e-3 if make is jittered else 0.02)
    assert torn[:, 2].sum() < 0.99 * undamaged[:, 2].sum()


def test_damage_reduces_the_pressure_of_a_gas_as_it_reduces_stiffness():
    sheet = square(9)
    parts = {"loads": [Fixed(sheet.edges("all")), EnclosedGas(gauge=5.0, chamber=1.0)]}
    sound, torn = build(sheet, **parts), build(sheet, **parts, damage=TearingEnergy(1e3))
    damage = soften(torn)
    for built in (sound, torn):
        built.context.run("setup")
    expected = (1.0 - damage[:, None]) ** 2 * sound.to_numpy(sound.state.external)
    assert torn.to_numpy(torn.state.external) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("gauge", [40.0, -40.0])
@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_gas_flows_through_what_is_torn_as_through_an_orifice(gauge, exponent):
    """Out of a rigid vessel, or into it, until both sides have one pressure; the opening is that of torn triangles."""
    sheet = jittered(13)
    gas = EnclosedGas(gauge=gauge, ambient=200.0, exponent=exponent, chamber=1e-4, leak=0.7, density=0.5)
    built = build(
        sheet, loads=[Fixed(np.arange(sheet.size)), gas], damage=CriticalStretch(3.0), solver=Explicit(1.0, frames=1)
    )
    sever(built, ((0.0, 0.0512), (0.06, 0.0512)))
    built.context.run("setup")
    built.context.run("frame")
    whole = built.to_numpy(built.rupture.intact_faces).astype(bool)
    corners = sheet.points[sheet.triangles[~whole]]
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    opening = 0.5 * np.abs(side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]).sum()
    load = built.external.following[0]
    step, steps = 2e-5, 400
    built.state.step.fill_(step)
    built.set_clock(step, 1.0, 0.0)
    sequence, found = built.context.sequence("step"), []
    for _ in range(steps):
        sequence.run()
        found.append(load.enclosed.numpy()[0])

    def rate(time, state):
        inside = 0.5 * ((200.0 + gauge) / 200.0) ** (1.0 / exponent) * state[0]
        pressure = (200.0 + gauge) * state[0] ** exponent - 200.0
        flowing = inside if pressure > 0.0 else 0.5
        mass = 1e-4 * 0.5 * ((200.0 + gauge) / 200.0) ** (1.0 / exponent)
        return [-np.sign(pressure) * 0.7 * opening * np.sqrt(2.0 * abs(pressure) * flowing) / mass]

    exact = solve_ivp(rate, (0.0, step * steps), [1.0], rtol=1e-9, atol=1e-12, max_step=step)
    for index in (20, 60):
        lost = 1.0 - np.interp((index + 1) * step, exact.t, exact.y[0])
        assert 1.0 - abs(found[index] / gauge) > 0.05
        # Of first order in the step, which is a hundredth of the time of the flow and less.
        assert 1.0 - ((200.0 + found[index]) / (200.0 + gauge)) ** (1.0 / exponent) == pytest.approx(lost, rel=5e-3)
    assert abs(found[-1]) < 1e-9 * 200.0


@pytest.mark.parametrize(("leak", "at", "notes"), [(0.0, 0.002, 1), (0.7, 0.002, 0), (0.0, 1.0, 0)])
def test_a_gas_that_cannot_leave_a_torn_sheet_is_noted(leak, at, notes):
    sheet = Sheet.sphere(RADIUS, thickness=THICKNESS, density=1e3, points=8)
    punch = CutsInTime(Punch((0.0, 0.0, RADIUS), 0.4 * RADIUS, at=at))
    gas = EnclosedGas(gauge=5.0, ambient=1e3, leak=leak)
    result = simulate(sheet, Explicit(0.004, frames=2), loads=[gas], material=RUBBER, damage=punch).run(device="cpu")
    found = [note for note in result.summary["notes"] if "nothing flows out" in note]
    assert len(found) == notes and all(note.startswith("EnclosedGas: ") for note in found)


@pytest.mark.parametrize(("stiffness", "notes"), [(1e7, 1), (1e9, 0)])
def test_a_volume_that_yields_is_noted(stiffness, notes):
    """A soft liquid leaves the sheet a third short of what is prescribed, which nothing else tells."""
    sheet = square(9)
    volume = EnclosedVolume([(0.0, 0.0), (1.0, 5e-5)], stiffness=stiffness)
    loads = [Fixed(sheet.edges("all")), volume]
    result = run(sheet, Newton(load_steps=2), material=MooneyRivlin(1.5e5), weights="corrected", loads=loads)
    found = [note for note in result.summary["notes"] if note.startswith(f"EnclosedVolume.stiffness = {stiffness:g}")]
    assert result.status == "finished" and len(found) == notes
    assert (abs(result.history[-1]["volume"] / 5e-5 - 1.0) > 0.01) == bool(notes)
    assert all("5e-05 is prescribed" in note for note in found)


def test_a_burst_that_is_resumed_goes_on_bit_for_bit(tmp_path):
    """A sheet over a vessel tears at its clamp, and the gas leaves it."""

    def simulation():
        sheet = square(13).prestretched(1.3)
        gas = EnclosedGas(gauge=150.0, ambient=1e3, chamber=1e-3, leak=0.8)
        edge = sheet.edges("all")
        return simulate(
            sheet, Explicit(0.03, frames=6, safety=0.2), loads=[Fixed(edge), gas], material=RUBBER,
            damage=CriticalStretch(1.6, spared=edge),
        )  # fmt: skip

    history = require_same_when_stopped(simulation, tmp_path, (2, 4), precision=32).history
    assert history[-1]["mean_damage"] > 0.1 and abs(history[-1]["pressure"]) < 1e-6


def test_a_balloon_stretched_to_its_size_by_a_gas_is_at_rest():
    """Of the exact pressure 2 mu h / R (1/l - 1/l^7), R and h without stress; flat triangles lack volume, at h^2."""
    stretch = 1.5
    exact = 2.0 * 1e3 * THICKNESS * stretch / RADIUS * (1.0 / stretch - stretch**-7)
    moved = []
    for points in (8, 16):
        sheet = Sheet.sphere(RADIUS, thickness=THICKNESS, density=1e3, points=points).prestretched(stretch)
        law = BondAssociated(RUBBER, horizon=2.015, weights="corrected")
        gas = EnclosedGas(gauge=exact, ambient=1e3)
        result = Simulation(sheet, law, Explicit(0.3, frames=2, damping=20.0), loads=[gas]).run(
            device="cpu", precision=64
        )
        assert result.history[0]["pressure"] == pytest.approx(exact, rel=1e-6)
        assert abs(result.history[-1]["balance_error"]) < 1e-3
        moved.append(np.linalg.norm(result.frame.displacement, axis=1).max() / RADIUS)
    assert moved[1] < 0.01 and moved[1] < 0.4 * moved[0]


def test_a_balloon_grows_as_the_pressure_outside_falls():
    """A rising balloon: (ambient - fall + p) l^3 = ambient, p = 2 mu (h / R) (1 / l - 1 / l^7)."""
    ambient, fall, mu, radius, thickness = 101325.0, 4000.0, 2e5, 0.1, 1e-3
    sheet = Sheet.sphere(radius, thickness=thickness, density=1e3, points=12)
    low, high, side = (sheet.nearest(*place) for place in ((0, 0, -radius), (0, 0, radius), (radius, 0, 0)))
    result = Simulation(
        sheet,
        BondAssociated(MooneyRivlin(0.5 * mu), horizon=2.015),
        Newton(load_steps=2),
        loads=[
            Fixed([low]), Fixed([high], "xy"), Fixed([side], "y"), EnclosedGas(ambient=ambient),
            Pressure(fall, ramp=[(0.0, 0.0), (1.0, 1.0)]),
        ],
    ).run(device="cpu")  # fmt: skip

    def excess(stretch):
        rubber = 2.0 * mu * thickness / radius * (stretch**-1 - stretch**-7)
        return (ambient - fall + rubber) * stretch**3 - ambient

    exact, row = brentq(excess, 1.0, 1.05), result.history[-1]
    assert (row["volume"] / result.history[0]["volume"]) ** (1.0 / 3.0) - 1.0 == pytest.approx(exact - 1.0, rel=0.01)
    assert row["pressure"] == pytest.approx(ambient * exact**-3 - ambient, rel=0.01)
    with refused(match=r"EnclosedGas.ambient = \[.*\]: expected one number, .*; a Pressure acts like its fall"):
        EnclosedGas(ambient=[(0.0, ambient), (1.0, ambient - fall)])
