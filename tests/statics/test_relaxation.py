"""Relaxation: its tolerance, its residual, and rupture in static equilibrium."""

import numpy as np
import pytest
from helpers import square
from small_runs import run

from warp_pd import (
    BodyForce,
    BondAssociated,
    CriticalStretch,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)

CONSTANT = [(0.0, 1.0)]


@pytest.mark.parametrize(
    ("tolerance", "ramp", "status", "steps"),
    [
        (1e-9, CONSTANT, "finished", [100, 50, 50, 50]),
        (1e-6, None, "not converged", [100, 50]),
        (1e-15, CONSTANT, "not converged", [100]),
    ],
)
def test_a_load_step_that_begins_without_steps_left_looks_at_the_residual_once(tolerance, ramp, status, steps):
    sheet = square(9)
    solver = Relaxation(load_steps=4, ramp_steps=7, most_steps=100, tolerance=tolerance)
    result = run(sheet, solver, loads=[Fixed(sheet.edges()), Pressure(5.0, ramp=ramp)])
    assert result.status == status
    assert [entry["steps"] for entry in result.summary["solve"]["load_steps"]] == steps


def test_a_load_without_a_ramp_grows_with_the_load_factor_in_both_static_solvers():
    sheet = square(9)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    solvers = Newton(load_steps=2), Relaxation(load_steps=2, tolerance=1e-8)
    strains = [[row["strain"] for row in run(sheet, solver, loads=loads).history] for solver in solvers]
    assert strains[1] == pytest.approx(strains[0], rel=1e-6)
    assert 0.0 < strains[0][1] < 0.6 * strains[0][2]


def test_newton_names_what_helps_where_slack_regions_do_not_converge():
    """A strip with an edge crack, slack beside it: a slack stiffness, or Relaxation, finds its equilibrium."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=41).cut((0.0512, -0.01), (0.0512, 0.01))
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.01], y=0.0, z=0.0)]
    parts = {"loads": loads, "material": TensionField(MooneyRivlin(2e5))}
    failed = run(sheet, Newton(most_cuts=0), **parts)
    assert failed.status == "not converged"
    for helps in ("slack_stiffness", "Relaxation"):
        assert any(helps in note for note in failed.summary["notes"])
    relaxed = run(sheet, Relaxation(), **parts)
    stiffer = run(sheet, Newton(), **{**parts, "material": TensionField(MooneyRivlin(2e5), slack_stiffness=400.0)})
    assert [result.status for result in (relaxed, stiffer)] == ["finished"] * 2
    assert stiffer.history[-1]["strain"] == pytest.approx(relaxed.history[-1]["strain"], rel=3e-3)


def test_relaxation_breaks_only_in_equilibrium_and_relaxes_again():
    """A notched strip pulled until its tip bonds pass the criterion: it tears, and what is left is in equilibrium."""
    sheet = square(13).cut((-0.01, 0.051), (0.03, 0.051))
    motion = Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=[0.0, 0.05], z=0.0)
    solver = Relaxation(tolerance=1e-5, load_steps=2, ramp_steps=100, most_steps=20_000)
    loads = [Fixed(sheet.edges("bottom")), motion]
    unbroken = run(sheet, Relaxation(tolerance=1e-5, ramp_steps=100), loads=loads)
    torn = run(sheet, solver, loads=loads, damage=CriticalStretch(1.56))
    assert torn.status == "finished" and torn.summary["residual"] <= 1e-5
    assert [entry["share"] for entry in torn.summary["solve"]["load_steps"]] == [0.5, 1.0]
    assert sum(entry["rounds"] for entry in torn.summary["solve"]["load_steps"]) >= 1
    assert torn.frame.damage.max() > 0.0
    assert torn.history[-1]["strain"] < unbroken.history[-1]["strain"]
    # Nothing left to break: one more round of rupture leaves the bits alone.
    intact = torn.built.law.intact.numpy().copy()
    torn.built.context.run("rupture")
    assert (torn.built.law.intact.numpy() == intact).all()


def test_a_sheet_that_a_dead_load_tears_in_two_ends_with_a_message():
    """What is torn off has no equilibrium: it flies, and the state is that of the last good load step."""
    sheet = square(13).cut((-0.01, 0.051), (0.03, 0.051))
    grips = sheet.edges("top", "bottom")
    loads = [Fixed(sheet.edges("bottom")), PointForce(sheet.edges("top"), (0.0, 0.2, 0.0))]
    result = run(sheet, Relaxation(load_steps=4, ramp_steps=100), loads=loads, damage=CriticalStretch(1.4, grips))
    assert result.status == "not converged" and result.summary["steps"] < 10_000
    assert "moved more than 100 times the size of the sheet" in result.summary["message"]
    assert np.abs(result.frame.displacement).max() < 1.0


# A small load on a sheet under large stress ----------------------------------------------------------------


def drum(solver, force, precision=64, points=41, load_steps=1):
    """Deflection of a stretched strip under a small body force, over that of a string, q L^2 / (8 T)."""
    length, stretch = 0.1, 1.1
    sheet = Sheet.rectangle(length, 0.02, thickness=1e-3, density=1000.0, points=points).prestretched(stretch, 1.0)
    exact = force * 1e-3 / stretch * length**2 / (8.0 * 2e5 * (stretch - stretch**-3) * 1e-3)
    loads = [Fixed(sheet.edges("left", "right")), Fixed(range(sheet.size), "y"), BodyForce((0.0, 0.0, force))]
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(1e5)), solver(load_steps=load_steps), loads=loads if force else loads[:2]
    ).run(device="cpu", precision=precision)  # fmt: skip
    assert result.status == "finished"
    return result, result.frame.displacement[sheet.nearest(0.05, 0.01), 2] / (exact or 1.0)


@pytest.mark.parametrize("solver", [Relaxation, Newton])
@pytest.mark.parametrize("force", [100.0, 1e-3])
def test_small_loads_move_a_stressed_sheet_as_they_do_a_string(solver, force):
    _, deflection = drum(solver, force)
    assert deflection == pytest.approx(1.0, abs=2e-3)


def test_load_steps_of_a_small_load_on_a_stressed_sheet():
    _, deflection = drum(Relaxation, 100.0, points=21, load_steps=3)
    assert deflection == pytest.approx(drum(Newton, 100.0, points=21)[1], rel=5e-4)


def test_small_load_on_a_stressed_sheet_in_float32():
    result, deflection = drum(Relaxation, 300.0, precision=32, points=21)
    assert deflection == pytest.approx(drum(Newton, 300.0, points=21)[1], rel=1e-3) and not result.summary["notes"]
    assert drum(Newton, 0.1, precision=32, points=21)[1] == pytest.approx(deflection, rel=1e-3)


def test_load_that_round_off_hides_is_noted():
    result, _ = drum(Relaxation, 1e-3, precision=32, points=21)
    assert len(result.summary["notes"]) == 1 and "expected 64, or the solver Newton" in result.summary["notes"][0]
    # Against all reactions, as it is and not as the tolerance.
    assert result.summary["solve"]["load_steps"][-1]["round_off"] and 0.0 < result.summary["residual"] < 1e-5


def test_a_load_step_that_is_computed_again_hides_no_load():
    """Its displacement begins at that of the stressed sheet, which said that round-off hides a pressure of 200 Pa."""
    sheet = Sheet.rectangle(0.1, 0.06, thickness=1e-3, density=1e3, points=(13, 9)).prestretched(1.2, 1.1)
    loads = [Fixed(sheet.edges("left", "right")), Pressure(200.0)]
    notes = Simulation(sheet, BondAssociated(MooneyRivlin(1e5)), Relaxation(), loads).run(device="cpu").summary["notes"]
    assert notes == ["steps: a frame or load step was computed again once, each time with half the step"]


@pytest.mark.parametrize("precision", [64, 32])
@pytest.mark.parametrize("solver", [Relaxation, Newton])
def test_stressed_sheet_without_loads_stays_where_it_is(solver, precision):
    result, moved = drum(solver, 0.0, precision=precision, points=21)
    assert abs(moved) < 1e-9 and not result.summary["notes"]
    assert result.summary["residual"] < {64: 1e-8, 32: 1e-5}[precision]
