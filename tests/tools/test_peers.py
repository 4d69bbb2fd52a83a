"""Beside other codes: the problems and their references, a run of a peer in a process of its own, the page."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("skfem")

import peers.references
from finite_elements import Membrane, rectangle
from peers.__main__ import HERE, chosen, main, measure, parsed
from peers.adapters.this_code import tear
from peers.codes import CODES, Code
from peers.elements import UnderBall, newton_membrane, rubber, solved
from peers.page import fastest
from peers.problems import PROBLEMS
from peers.references import Reference, outside

from warp_pd import InputError
from warp_pd.scenes import pure_shear_tear


def test_every_code_has_runs_or_a_reason_for_every_problem():
    for code in CODES:
        assert (HERE / "adapters" / f"{code.adapter}.py").is_file()
        assert set(code.runs).isdisjoint(code.cannot)
        assert set(code.runs) | set(code.cannot) == set(PROBLEMS), code.name


def test_adapters_are_short_and_peers_are_pinned():
    for adapter in (HERE / "adapters").glob("*.py"):
        assert len(adapter.read_text().splitlines()) <= 80, adapter.name
    lines = [line for line in (HERE / "requirements.txt").read_text().splitlines() if not line.startswith("#")]
    assert all("==" in line and "#" in line for line in lines)


def test_derivatives_of_the_energy_of_newtons_membrane():
    response = newton_membrane(PROBLEMS["strip"])
    t, d = np.array([2.4]), np.array([1.3])
    w_dd = response(t, d)[4]
    assert (response(t, d + 1e-6)[1] - response(t, d - 1e-6)[1]) / 2e-6 == pytest.approx(w_dd, rel=1e-6)
    # At rest there is no stress: 2 (W_t + W_d) = 0.
    at_rest = response(np.array([2.0]), np.array([1.0]))
    assert at_rest[0] + at_rest[1] == pytest.approx(0.0, abs=1e-9 * PROBLEMS["strip"].mu)


def test_elements_converge_to_the_reference(monkeypatch, tmp_path):
    monkeypatch.setattr(peers.references, "FINEST", 49)
    problem = PROBLEMS["strip"]
    reference = Reference(problem, rubber, tmp_path)
    errors = [reference.error(m.nodes, m.displacement) for m in (solved(problem, n, rubber(problem)) for n in (7, 13))]
    assert reference.points == 49 and reference.change < 1e-3
    assert errors[1] < 0.5 * errors[0] < 0.01
    again = Reference(problem, rubber, tmp_path)
    assert (again.points, again.change) == (49, reference.change)


def test_a_ball_and_elements_exchange_momentum_and_nodes_stay_outside():
    problem = PROBLEMS["ball"]
    sheet = Membrane(rectangle(*[np.linspace(0.0, 0.1, 13)] * 2, False), rubber(problem), problem.thickness, 3)
    sheet.displacement[:] = problem.start(sheet.nodes)
    nothing = np.zeros(len(sheet.nodes), dtype=bool)
    motion = UnderBall(problem, sheet, problem.density, 0.0, nothing, lambda _: np.zeros((0, 3)), 4e-5)
    motion.run(2e-3)
    momentum = (motion.masses[:, None] * motion.velocity).sum(axis=0) + problem.ball_mass * motion.ball_velocity
    assert momentum == pytest.approx([0.0, 0.0, -problem.ball_mass * problem.ball_speed], abs=1e-9)
    assert motion.ball_velocity[2] > -0.99 * problem.ball_speed
    arms = sheet.displacement - motion.ball_centre
    arms[:, :2] += sheet.nodes
    assert np.linalg.norm(arms, axis=1).min() > (1.0 - 1e-9) * problem.ball


def test_points_inside_the_ball_come_to_its_surface_and_held_ones_stay():
    problem = PROBLEMS["drape"]
    places = problem.grid(25)
    held = problem.fixed(places)
    assert held.sum() == 9
    moved = outside(problem, places, np.zeros((len(places), 3)) - 0.005 * ~held[:, None])
    distance = np.linalg.norm(np.column_stack([places, 0.0 * held]) + moved - problem.ball_at, axis=1)
    assert distance[~held].min() == pytest.approx(problem.ball) and (moved[held] == 0.0).all()


def test_this_code_tears_the_strip_of_its_scene():
    problem, scene = PROBLEMS["tear"], pure_shear_tear
    own = (scene.LENGTH, scene.HEIGHT), scene.CUT, scene.THICKNESS, scene.MU
    assert own == (problem.size, problem.cut, problem.thickness, problem.mu)
    told = tear(problem, {"points": 20, "horizon": 2.015, "rate": 0.2, "device": "cpu"})["told"]
    assert 1.165 < told["stretch"] < 1.18


def test_a_whole_name_is_one_code():
    assert [code.name for code in chosen(["this code"])] == ["this code"]
    assert len(chosen(["this"])) == 3 and len(chosen([""])) == len(CODES)


def test_a_peer_runs_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setattr(peers.references, "FINEST", 25)
    code = Code("elements", "scikit_fem", "", {})
    row = measure(code, "pressure", {"points": 7, "nodes": 9}, "cpu", Path(sys.executable))
    assert row["error"] < 0.02 and row["runs"] == 2
    assert 0.0 < row["cpu"] < 30.0 and 3e7 < row["memory"] < 1e9
    failed = measure(code, "pressure", {"points": 7}, "cpu", Path(sys.executable))
    assert failed["failed"] == "KeyError: 'nodes'"


def test_the_page_comes_from_the_numbers(tmp_path, monkeypatch):
    page = tmp_path / "peers.md"
    page.with_suffix(".json").write_text((HERE.parents[1] / "docs" / "peers.json").read_text())
    main(["--only-page", "--out", str(page)])
    text = page.read_text()
    assert "## The fastest" in text and all(problem.title in text for problem in PROBLEMS.values())
    assert page.read_text().count("](peers-") == len(list(tmp_path.glob("peers-*.png")))


def test_the_fastest_run_within_an_error_counts():
    def row(points, error, cpu):
        return {"problem": "strip", "device": "CPU", "code": "a", "points": points, "error": error, "cpu": cpu}

    assert fastest([row(13, 0.02, 1.0), row(25, 0.009, 3.0), row(49, 0.004, 2.0)])[-2].endswith("| a | 1 | 1 | 2 | - |")
    assert not any("| a |" in line for line in fastest([row(13, 0.2, 1.0)]))
    # An error that a finer run does not keep is a coincidence.
    assert fastest([row(13, 0.0005, 1.0), row(25, 0.02, 3.0)])[-2].endswith("| a | 1 | 1 | - | - |")


def test_wrong_names_are_refused():
    with pytest.raises(InputError, match="--codes abaqus: expected the beginning of one of"):
        parsed(["--codes", "abaqus"])
    with pytest.raises(InputError, match="--python /nowhere/python: expected a Python"):
        parsed(["--python", "/nowhere/python"])
