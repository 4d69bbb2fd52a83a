"""Runs of static solvers: exit codes, resuming, and the share of the load in place of a time."""

import json

import pytest
from helpers import StopAt, square
from small_runs import cli, run, simulate

from warp_pd import Fixed, Newton, Pressure, Relaxation
from warp_pd.output import info, plots
from warp_pd.output.progress import Progress

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
    assert "load factor 0 to load factor 1" in info.describe(tmp_path / "frames.vtkhdf")
    assert [frame.when for frame in plots.frames_at(tmp_path, [1.5, 3.0])] == ["load factor 0.5", "load factor 1"]


def test_too_few_steps_end_as_not_converged():
    sheet = square(9)
    solver = Relaxation(most_steps=50)
    result = run(sheet, solver, weights="auto", loads=[Fixed(sheet.edges()), Pressure(5.0)])
    assert result.status == "not converged" and "not converged" in result.summary["message"]
    assert result.summary["solve"]["iterations"] == 50
