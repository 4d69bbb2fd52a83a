"""Runs of static solvers: exit codes, resuming, and the share of the load in place of a time."""

import itertools
import json
import re

import numpy as np
import pytest
from helpers import NEO, StopAt, square
from small_runs import cli, run, simulate

from warp_pd import (
    BondAssociated,
    EnclosedVolume,
    Fixed,
    Gent,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    Simulation,
    TensionField,
    Yeoh,
)
from warp_pd.output import info
from warp_pd.output.progress import Progress
from warp_pd.run.checks import free_motions
from warp_pd.viewer import plots

SCENE = """
from warp_pd import *

def build(points=9):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points)
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), SOLVER, [Fixed(sheet.edges()), Pressure(5.0)])
"""


@pytest.mark.parametrize("solver", ["Newton(most_iterations=1, most_cuts=0)", "Relaxation(most_steps=50)"])
def test_no_convergence_ends_the_command_with_code_3(solver, tmp_path):
    scene = tmp_path / "scene.py"
    scene.write_text(SCENE.replace("SOLVER", solver))
    done = cli("run", scene, "--device", "cpu", "--quiet", "--no-usd", "--out", tmp_path / "out")
    assert done.exit_code == 3, done.output
    assert "not converged" in done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "not converged" and summary["solve"]["reached"] == 0.0
    assert summary["solve"]["seconds"] > 0.0


@pytest.mark.parametrize("solver", ["Newton(most_iterations=1, most_cuts=0)", "Relaxation(most_steps=50)"])
def test_resuming_what_did_not_converge_is_not_taken_for_finished(solver, tmp_path):
    """Relaxation goes on from where it stopped, until equilibrium; Newton fails at the same load step again."""
    scene = tmp_path / "scene.py"
    scene.write_text(SCENE.replace("SOLVER", solver))
    command = ["run", scene, "--device", "cpu", "--quiet", "--no-usd", "--out", tmp_path / "out"]
    assert cli(*command).exit_code == 3
    codes = [cli(*command, "--resume").exit_code for _ in range(4)]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    if "Newton" in solver:
        assert codes == [3, 3, 3, 3] and summary["status"] == "not converged"
    else:
        assert codes[-1] == 0 and summary["status"] == "finished"


@pytest.mark.parametrize(
    "solver", [Newton(load_steps=4), Relaxation(load_steps=4, tolerance=1e-4)], ids=["newton", "relaxation"]
)
def test_a_resumed_run_reports_all_its_load_steps(solver, tmp_path):
    sheet = square(9)
    simulation = simulate(sheet, solver, loads=[Fixed(sheet.edges()), Pressure(5.0, ramp=[(0.0, 0.0), (1.0, 1.0)])])
    begun = simulation.run(out=tmp_path, device="cpu", usd=False, writers=[StopAt(3)]).summary
    assert begun["status"] == "interrupted"
    ended = simulation.run(out=tmp_path, device="cpu", usd=False, resume=True).summary
    again = simulation.run(out=tmp_path, device="cpu", usd=False, resume=True).summary
    assert [step["share"] for step in ended["solve"]["load_steps"]] == [0.25, 0.5, 0.75, 1.0]
    assert ended["solve"]["iterations"] == ended["steps"] > 0
    # It has nothing left to do, and says what was done all the same.
    for name in ("status", "steps", "residual", "solve", "load_share"):
        assert again[name] == ended[name]


def test_static_runs_say_their_share_of_the_load_and_no_time(tmp_path, capfd):
    sheet = square(9)
    simulation = simulate(sheet, Newton(load_steps=2, duration=3.0), loads=[Fixed(sheet.edges()), Pressure(5.0)])
    summary = simulation.run(out=tmp_path, device="cpu", reporter=Progress()).summary
    assert summary["time"] is None and summary["load_share"] == 1.0
    said = capfd.readouterr().err
    assert "load factor 0.5" in said and "t = " not in said
    # The bar goes on from frame to frame, and is full once.
    percents = [float(found) for found in re.findall(r"^ *([0-9.]+) %", said, re.MULTILINE)]
    assert percents == sorted(percents) and percents.count(100.0) == 1
    assert "load factor 0 to load factor 1" in info.describe(tmp_path / "frames.vtkhdf")
    assert [frame.when for frame in plots.frames_at(tmp_path, [1.5, 3.0])] == ["load factor 0.5", "load factor 1"]


def inflated(pressure, load_steps):
    sheet = square(11)
    height = Measure("height", "m", lambda built, frame: frame.displacement[:, 2].max())
    return run(
        sheet, Newton(load_steps=load_steps), material=Yeoh(c10=5e4, c30=20.0), weights="corrected",
        loads=[Fixed(sheet.edges("all")), Pressure(pressure)], measures=[height],
    )  # fmt: skip


def test_a_jump_over_a_limit_point_is_told_with_its_load_step():
    """A Yeoh sheet snaps from 0.05 to 0.10 m between two load steps; below the limit point nothing is said."""
    result = inflated(4.5e3, 15)
    heights = [row["height"] for row in result.history]
    rises = [b - a for a, b in itertools.pairwise(heights)]
    jump = rises.index(max(rises))
    assert result.status == "finished" and jump == 11 and rises[jump] > 5.0 * rises[jump - 1]
    (note,) = [note for note in result.summary["notes"] if note.startswith("Newton: between")]
    assert f"load factors {jump / 15:.4g} and {(jump + 1) / 15:.4g}" in note and "limit point" in note
    assert not [note for note in inflated(3.2e3, 12).summary["notes"] if note.startswith("Newton: between")]


def test_supports_that_jump_are_no_jump_of_the_sheet():
    sheet = square(7)
    motion = Motion(sheet.edges("right"), times=[0.0, 0.75, 1.0], x=[0.0, 1e-4, 0.02], y=0.0, z=0.0)
    result = run(sheet, Newton(load_steps=4), loads=[Fixed(sheet.edges("left")), motion])
    assert result.status == "finished" and not result.summary["notes"]


@pytest.mark.parametrize(
    ("load_steps", "pressure", "said"),
    [
        (1, 0.0, "the first load step fails: try a smaller load or motion"),
        (3, 0.0, "supports alone move the sheet"),
        (3, 1.0, "the load has its maximum there (a limit point)"),
    ],
)
def test_a_search_that_fails_says_what_to_try(load_steps, pressure, said):
    """A maximum of the load is no advice where no load acts; a Gent sheet locks at a stretch of 2."""
    sheet = square(7)
    motion = Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.2], y=0.0, z=0.0)
    loads = [Fixed(sheet.edges("left")), motion, *([Pressure(pressure)] if pressure else [])]
    result = run(sheet, Newton(load_steps=load_steps, most_cuts=0), material=Gent(1e3, 1e7, 2.0), loads=loads)
    assert result.status == "not converged" and said in result.summary["message"]


@pytest.mark.parametrize(
    ("loads", "free"),
    [([], 6), ([("left", "xz")], 2), ([("left", "xyz")], 1), ([("left", "xyz"), ("right", "z")], 0)],
)
def test_a_sheet_that_can_move_freely_is_named_as_the_cause(loads, free):
    sheet = square(7)
    supports = [Fixed(sheet.edges(side), components) for side, components in loads]
    solver = Newton(most_iterations=3, most_cuts=0)
    result = run(sheet, solver, loads=[*supports, PointForce(sheet.edges("right"), (1.0, 3.0, 0.0))])
    assert result.status == "not converged"
    said = f"the supports leave {free} of 6 rigid-body motions free; expected supports (Fixed, Motion)"
    assert (said in result.summary["message"]) == bool(free)
    assert ("rigid-body motions free" in result.summary["message"]) == bool(free)


@pytest.mark.parametrize(("stiffness", "advised"), [(0.0, True), (1.0, False)])
def test_a_slack_stiffness_that_is_there_is_not_advised(stiffness, advised):
    sheet = square(7)
    material, solver = TensionField(NEO, slack_stiffness=stiffness), Newton(most_iterations=1, most_cuts=0)
    result = run(sheet, solver, material=material, loads=[Fixed(sheet.edges("left")), Pressure(5.0)])
    (note,) = [note for note in result.summary["notes"] if "slack regions" in note]
    assert ("slack_stiffness" in note) == advised and note.endswith("Explicit with damping, or Relaxation")
    assert "load_steps=1 with most_iterations=200, " in note


def test_a_turn_that_supports_stop_once_it_is_large_is_not_free():
    """Of the right edge x is prescribed: a turn about the left edge shortens it."""
    sheet = square(7)
    motion = Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.01])
    hinged = [Fixed(sheet.edges("left"))]
    for loads, free in ((hinged, 1), ([*hinged, motion], 0), ([Fixed([0])], 3), ([Fixed(range(sheet.size), "z")], 3)):
        built = Simulation(sheet, BondAssociated(NEO), Newton(), loads).build("cpu")
        assert free_motions(built) == free
    # Held points that lie on a line in the flat sheet, and not where it starts.
    middle, right = sheet.nearest(0.05, 0.05), sheet.nearest(0.1, 0.05)
    loads = [Fixed([sheet.nearest(0.0, 0.05)]), Fixed([middle, right], "yz")]
    for height, free in ((0.0, 1), (0.03, 0)):
        start = np.zeros((sheet.size, 3))
        start[middle, 2] = height
        placed = Simulation(sheet, BondAssociated(NEO), Newton(), loads, initial_displacement=start)
        assert free_motions(placed.build("cpu")) == free


@pytest.mark.parametrize(("ramp_steps", "retries"), [(1, 0), (5000, 0), (1, 5)])
def test_an_infinite_residual_is_divergence_that_more_ramp_steps_or_shorter_ones_cure(ramp_steps, retries):
    """A volume a hundred times larger within one step of the relaxation; spread over steps it reaches equilibrium."""
    sheet = square(11)
    volume = EnclosedVolume([(0.0, 0.0), (0.5, 1e-5), (1.0, 1e-3)], stiffness=1e10)
    solver = Relaxation(load_steps=2, ramp_steps=ramp_steps, most_steps=20000, retries=retries)
    result = run(
        sheet, solver, material=NeoHookean(1e5, 1e7), weights="auto", loads=[Fixed(sheet.edges("all")), volume]
    )
    message = result.summary["message"]
    if ramp_steps > 1 or retries:
        assert result.status == "finished" and (result.summary["repeated"] > 0) == bool(retries)
        return
    assert result.status == "diverged" and len(result.history) == 2
    assert (
        "the residual is inf beyond load factor 0.5" in message
        and "more ramp_steps, over which a load step is applied (here 1)" in message
    )
    assert "prescribe" not in message
