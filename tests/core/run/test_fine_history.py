"""Rows of the history between frames, which the device sums and the host reads at the frame's end."""

import numpy as np
import pytest
import warp as wp
from helpers import refused, square
from small_runs import BALL, cli, simulate

from warp_pd import (
    BodyPath,
    Explicit,
    Fixed,
    Free,
    Measure,
    Motion,
    Newton,
    Reaction,
    RigidBody,
    Sphere,
)
from warp_pd.measures import support_force
from warp_pd.run.folder import read_history
from warp_pd.run.recorder import FineHistory

DURATION, FRAMES, EVERY = 0.02, 4, 4e-4


def pulled(every=EVERY, frames=FRAMES, duration=DURATION, **parts):
    sheet = square(11)
    right = sheet.edges("right")
    return simulate(
        sheet,
        Explicit(duration, frames=frames, history_every=every, step=1e-4, damping=1.0),
        loads=[
            Fixed(sheet.edges("left")),
            Motion(right, times=[0.0, 0.02], x=[0.0, 0.01], y=0.0, z=0.0),
            Reaction(right, "pull"),
        ],
        measures=[Measure("pull", "N", lambda built, frame: support_force(built, right)[0])],
        **parts,
    )


def test_rows_change_no_bit_of_the_run(device):
    plain, fine = (pulled(every).run(device=device, precision=32) for every in (None, EVERY))
    assert plain.frame.displacement.tobytes() == fine.frame.displacement.tobytes()
    assert plain.history == fine.history
    assert not plain.fine_history and len(fine.fine_history) > 40


def test_rows_are_close_and_those_at_frames_are_the_frames():
    result = pulled().run(device="cpu", precision=64)
    times = np.array([row["time"] for row in result.fine_history])
    assert np.diff(times).max() == pytest.approx(EVERY, rel=1e-6) and (np.diff(times) > 0.0).all()
    assert len(times) == 1 + FRAMES * 13  # 50 steps in a frame, a row after every fourth, and that of the frame
    at = {row["time"]: row for row in result.fine_history}
    for row in result.history:
        found = at[row["time"]]
        assert found.keys() == {"time", "step", "kinetic", "half_step_kinetic", "strain", "external", "damping",
                                "rupture", "pull_x", "pull_y", "pull_z"}  # fmt: skip
        assert all(found[name] == row[name] for name in found)
        # The sum on the device is the one that a measure takes on the host.
        assert row["pull_x"] == pytest.approx(row["pull"], rel=1e-12, abs=1e-9)


def test_rows_follow_the_energy_between_frames():
    result = pulled().run(device="cpu", precision=64)
    rows = {name: np.array([row[name] for row in result.fine_history]) for name in result.fine_history[0]}
    work = np.concatenate([[0.0], np.cumsum(np.diff(0.01 / 0.02 * rows["time"]) * 0.5
                                            * (rows["pull_x"][1:] + rows["pull_x"][:-1]))])  # fmt: skip
    stored = rows["kinetic"] + rows["strain"] + rows["damping"]
    assert np.abs(stored - rows["external"]).max() < 0.02 * stored.max()
    # The force of the support, on its path, is the work: what it takes for the inertia of its own points is missing.
    assert work[-1] == pytest.approx(rows["external"][-1], rel=0.1)


@pytest.mark.parametrize(
    "motion",
    [BodyPath.straight((0.05, 0.05, 0.016), (0.0, 0.0, -2.0), 1.0), Free(0.02, (0.05, 0.05, 0.016), (0.0, 0.0, -2.0))],
    ids=["path", "free"],
)
def test_mean_forces_of_rows_add_up_to_those_of_frames(motion):
    sheet, body = square(11), RigidBody(Sphere(0.015), motion, name="ball")
    solver = Explicit(0.01, frames=2, history_every=5e-4)
    result = simulate(sheet, solver, loads=[Fixed(sheet.edges("all"))], contact=body).run(device="cpu")
    fine, begin = result.fine_history, 0.0
    times = [row["time"] for row in fine]
    for row in result.history[1:]:
        force = sum(
            r["ball_force_z"] * (r["time"] - earlier)
            for r, earlier in zip(fine[1:], times, strict=False)
            if begin < r["time"] <= row["time"]
        )
        assert row["ball_force_z"] != 0.0
        assert force / (row["time"] - begin) == pytest.approx(row["ball_force_z"], rel=1e-5)
        begin = row["time"]


def test_the_host_reads_nothing_between_frames(monkeypatch):
    built, reads, read = pulled().build("cpu"), [], wp.array.numpy
    built.context.run("start")
    built.context.run("setup")
    kept = FineHistory(built)
    # What the host reads has no other trace.
    monkeypatch.setattr(wp.array, "numpy", lambda array: reads.append(array) or read(array))
    kept.keep(1e-4, 1e-4)
    assert not reads
    kept.end_frame(2e-4, 1e-4, built.sums.totals(built.sums.keep()), 0.0)
    assert reads and len(kept.rows) == 2


def test_a_resumed_run_has_the_rows_of_one_that_was_not(tmp_path):
    whole = pulled(duration=0.02, frames=4).run(device="cpu", out=tmp_path / "whole", usd=False, view=False)
    pulled(duration=0.01, frames=2).run(device="cpu", out=tmp_path / "a", usd=False, view=False)
    rest = pulled(duration=0.02, frames=4).run(device="cpu", out=tmp_path / "a", usd=False, view=False, resume=True)
    assert rest.fine_history == whole.fine_history
    assert read_history(tmp_path / "a" / "fine_history.csv") == whole.fine_history

    # Another distance of the rows is no other run; without rows the old ones would end before it does.
    def goes_on(every):
        scene = pulled(every=every, frames=5, duration=0.025)
        return scene.run(device="cpu", out=tmp_path / "a", usd=False, view=False, resume=True)

    with refused("it holds fine_history.csv; expected history_every"):
        goes_on(None)
    assert goes_on(2e-3).fine_history[-1]["time"] == 0.025


def test_the_command_line_asks_for_rows(tmp_path):
    done = cli("run", *BALL, "--duration", "1", "--frames", "2", "--no-usd", "--no-vtkhdf", "--history-every",
               "0.1", "--out", tmp_path / "a")  # fmt: skip
    assert done.exit_code == 0, done.output
    rows = read_history(tmp_path / "a" / "fine_history.csv")
    assert len(rows) >= 9 and {"kinetic", "strain", "ball_force_z"} <= rows[0].keys()


def test_tables_and_curves_of_the_rows():
    result = pulled().run(device="cpu")
    figure = result.plot("pull_x", fine=True)
    assert len(figure.axes[0].lines[0].get_xdata()) == len(result.fine_history)
    assert figure.axes[0].get_ylabel() == "pull x (N)"
    pytest.importorskip("pandas")
    assert len(result.table(fine=True)) == len(result.fine_history)


def test_wrong_input_is_one_line():
    sheet = square(7)
    for make, said in (
        (lambda: Explicit(1.0, history_every=0.0), "history_every = 0.0"),
        (lambda: Reaction([0], "my force"), "Reaction.name = 'my force'"),
        (lambda: simulate(sheet, loads=[Reaction([49])]).build("cpu"), "Reaction.points"),
        (lambda: simulate(sheet, loads=[Reaction([0]), Reaction([1])]).build("cpu"), "with the name 'reaction'"),
        (lambda: simulate(sheet, Newton()).run(device="cpu", history_every=0.1), "expected the solver Explicit"),
        (lambda: simulate(sheet).run(device="cpu", history_every=-1.0), "history_every = -1.0"),
        (lambda: simulate(sheet).run(device="cpu").plot("kinetic", fine=True), "fine = True"),
    ):
        with refused(said):
            make()
