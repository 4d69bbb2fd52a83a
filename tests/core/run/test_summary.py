"""The summary: measures and outcomes, and those that fail."""

import csv
import dataclasses
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from helpers import NEO, refused, square

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    Motion,
    Outcome,
    Reaction,
    Simulation,
)
from warp_pd.interfaces.frame import Frame
from warp_pd.measures import largest
from warp_pd.run.folder import read_history
from warp_pd.run.recorder import commit_of


def one_frame(tmp_path, usd=False, **parts):
    simulation = Simulation(square(5), BondAssociated(NEO), Explicit(1e-4, frames=1), **parts)
    return simulation.run(device="cpu", out=tmp_path, usd=usd, pictures="pictures" in parts)


@pytest.mark.parametrize(("value", "said"), [(lambda h: 1 / 0, "ZeroDivisionError"), (lambda h: "many", "'many'")])
def test_an_outcome_that_fails_leaves_the_other_numbers(tmp_path, value, said):
    kept = Measure("kept", "1", lambda built, frame: 3.0)
    one_frame(tmp_path, measures=[kept], outcomes=[Outcome("peak", "N", value)])
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["measures"]["kept"]["value"] == 3.0 and summary["measures"]["peak"]["value"] is None
    assert any("Outcome 'peak'" in note and said in note for note in summary["notes"])


@pytest.mark.parametrize(
    ("value", "said"), [(1 / 3, ""), ("abc", "it returned 'abc': expected a number"), (None, "ZeroDiv")]
)
def test_a_measure_that_fails_in_a_frame_leaves_the_run(tmp_path, value, said):
    def failing(built, frame):
        if frame.index != 2:
            return 1.0
        return 1 / 0 if value is None else value

    simulation = Simulation(
        square(5), BondAssociated(NEO), Explicit(3e-4, frames=3),
        measures=[Measure("m", "N", failing), Measure("kept", "1", lambda built, frame: 3.0)],
        outcomes=[Outcome("peak", "N", largest("m"))],
    )  # fmt: skip
    result = simulation.run(device="cpu", out=tmp_path, usd=False)
    summary = json.loads((tmp_path / "summary.json").read_text())
    notes = [note for note in summary["notes"] if note.startswith("Measure 'm': missing in one frame, first at t =")]
    assert summary["status"] == "finished" and summary["measures"]["peak"]["value"] == 1.0
    cells = [row["m"] for row in csv.DictReader((tmp_path / "history.csv").read_text().splitlines())]
    if said:
        assert len(notes) == 1 and "(frame 2)" in notes[0] and said in notes[0]
        assert cells == ["1.0", "1.0", "", "1.0"] and np.isnan(result.history[2]["m"])
        assert np.isnan(read_history(tmp_path / "history.csv")[2]["m"])
    else:
        assert not notes and float(cells[2]) == value


@pytest.mark.parametrize(("value", "said"), [
    (lambda frame: np.nan if frame == 0 else 2.0, ""),
    (lambda frame: None if frame == 0 else 2.0, ""),
    (lambda frame: (None if frame == 0 else 3.0) - 1.0, "unsupported operand"),
    (lambda frame: np.full(frame, 2.0)[0], "with size 0"),
])  # fmt: skip
def test_a_measure_may_have_its_first_number_later(value, said):
    simulation = Simulation(
        square(5), BondAssociated(NEO), Explicit(2e-4, frames=2),
        measures=[Measure("m", "N", lambda built, frame: value(frame.index))],
        outcomes=[Outcome("peak", "N", largest("m"))],
    )  # fmt: skip
    summary = simulation.run(device="cpu").summary
    assert [summary["measures"][name]["value"] for name in ("m", "peak")] == [2.0, 2.0]
    notes = [note for note in summary["notes"] if note.startswith("Measure 'm': missing in one frame, first at t = 0")]
    assert [said in note for note in notes] == ([True] if said else [])


def test_an_outcome_of_an_unknown_column_is_refused_before_the_run():
    peak = Outcome("peak", "N", largest("puul"))
    pull = Measure("pull", "N", lambda built, frame: 1.0)
    scene = Simulation(square(5), BondAssociated(NEO), Explicit(1e-4), measures=[pull], outcomes=[peak])
    with refused(match=r"Outcome 'peak': column = 'puul': expected one of .*did you mean 'pull'"):
        scene.build("cpu")


def test_rows_of_the_history_are_those_that_outcomes_are_tried_with():
    """Every column of a run may be read; a row may be asked for a column that it lacks."""
    read: list[set[str]] = []
    seen = Outcome("seen", "1", lambda history: read.append(set(history[-1])) or history[-1].get("none", 2.0))
    sheet = square(5)
    loads = [Fixed(sheet.edges("left")), Reaction(sheet.edges("left"), "pull")]
    result = Simulation(sheet, BondAssociated(NEO), Explicit(1e-4, frames=1), loads, outcomes=[seen]).run(device="cpu")
    tried, had = read
    assert had <= tried and result.summary["measures"]["seen"]["value"] == 2.0


@pytest.mark.parametrize(("value", "said"), [
    (lambda built, frame: frame.displacement, r"it returned float64 array of shape \(25, 3\): expected a number"),
    (lambda built, frame: "3.5", "it returned '3.5': expected a number"),
    (lambda built, frame: np.array("3.5"), "it returned .*: expected a number"),
    (lambda built, frame: frame.displacment[0, 0], "AttributeError: .*displacment"),
    (lambda built, frame: frame.displacement[99, 0], "IndexError: index 99 is out of bounds"),
    (lambda built, frame: frame.point_data["stress"], "KeyError: 'stress'"),
])  # fmt: skip
def test_a_measure_that_fails_in_every_frame_is_refused_at_the_first(value, said, tmp_path):
    with refused(match=rf"Measure 'm': {said}"):
        one_frame(tmp_path, measures=[Measure("m", "m", value)])


def test_a_reference_of_zero_is_printed(tmp_path):
    from warp_pd.run.result import report

    shift = Measure("shift", "m", lambda built, frame: 0.25, reference=0.0)
    none = Measure("none", "m", lambda built, frame: None)
    event = Outcome("event", "s", lambda history: None)
    lines = list(report(one_frame(tmp_path, measures=[shift, none], outcomes=[event])))
    assert "shift = 0.25 m   reference 0 m, error +0.25 m" in lines
    assert "none = none: no number in the last frame" in lines
    assert "event = none: the event did not occur" in lines


def test_pictures_that_fail_are_told_in_a_line_and_take_no_other_file(tmp_path):
    with refused(match="pictures: KeyError"):
        one_frame(tmp_path, usd=True, pictures=lambda history, folder: history[0]["nothing"])
    assert (tmp_path / "summary.json").is_file() and (tmp_path / "animation.usd").is_file()


@pytest.mark.parametrize("every", [None, 2e-4])
def test_an_outcome_reads_the_peak_between_frames(tmp_path, every):
    sheet = square(7)
    right = sheet.edges("right")
    # Pulled to the middle of the frame and back: frames see the load before and after its peak.
    motion = Motion(right, times=[0.0, 0.01, 0.02], x=[0.0, 0.01, 0.0], y=0.0, z=0.0)
    result = Simulation(
        sheet, BondAssociated(NEO), Explicit(0.02, frames=1, history_every=every, step=1e-4, damping=1.0),
        [Fixed(sheet.edges("left")), motion, Reaction(right, "pull")],
        outcomes=[Outcome("peak", "N", largest("pull_x"), fine=True)],
    ).run(device="cpu")  # fmt: skip
    found = result.summary["measures"]["peak"]["value"]
    at_frames = max(row["pull_x"] for row in result.history)
    told = [note for note in result.summary["notes"] if note.startswith("peak: computed from frames only")]
    if every is None:
        assert found == at_frames and told
    else:
        assert found == max(row["pull_x"] for row in result.fine_history) > at_frames + 1e-3 and not told


def test_a_summary_names_the_commit_of_a_checkout_and_of_a_worktree(tmp_path):
    def git(*words, at="."):
        who = ["-c", "user.name=a", "-c", "user.email=a@b"]
        done = subprocess.run(["git", "-C", tmp_path / at, *who, *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    git("init", "-q", "first")
    git("commit", "-q", "--allow-empty", "-m", "one", at="first")
    git("worktree", "add", "-q", "-b", "other", "../second", at="first")
    git("commit", "-q", "--allow-empty", "-m", "two", at="second")
    commits = [git("rev-parse", "HEAD", at=folder) for folder in ("first", "second")]
    assert [commit_of(tmp_path / folder) for folder in ("first", "second")] == commits and len(set(commits)) == 2
    git("pack-refs", "--all", at="first")
    assert commit_of(tmp_path / "second") == commits[1]
    assert commit_of(tmp_path) is None


def test_the_guide_names_all_that_a_frame_has():
    page = (Path(__file__).parents[3] / "docs" / "guide.md").read_text(encoding="utf-8")
    table = page.split("### Measures")[1].split("####")[0]
    assert {item.name for item in dataclasses.fields(Frame)} <= set(re.findall(r"[a-z_]+", table))
