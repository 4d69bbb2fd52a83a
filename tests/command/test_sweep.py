"""Sweeps: every combination once, what is done is skipped, what fails is told and does not stop the rest."""

import csv
import json
import os
import sys

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from small_runs import cli

from warp_pd.command.scene_files import build_scene
from warp_pd.command.sweep import folder_name

SCENE = """
from warp_pd import *

def build(points=7, horizon=2.015, load=1.0):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points)
    pull = Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.01 * load], y=0.0)
    return Simulation(
        sheet, BondAssociated(NeoHookean(1e3, 1e5), horizon=horizon),
        Newton(load_steps=1, most_iterations=8, most_cuts=0),
        [Fixed(sheet.edges("left"), "xy"), Fixed(range(sheet.size), "z"), pull],
        measures=[Measure("stretched", "m", lambda built, frame: frame.displacement[:, 0].max(), reference=0.01)],
    )
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(SCENE)
    return tmp_path


def sweep(*arguments):
    return cli("sweep", "mine.py", "--device", "cpu", *arguments)


def rows(folder):
    with (folder / "sweep.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_all_combinations_once(scene):
    done = sweep("--points", "7,9", "--set", "load=1,2")
    assert done.exit_code == 0, done.output
    folder = scene / "runs" / "mine-sweep"
    found = rows(folder)
    assert [(row["points"], row["load"]) for row in found] == [("7", "1"), ("7", "2"), ("9", "1"), ("9", "2")]
    assert [row["status"] for row in found] == ["finished"] * 4
    assert [float(row["stretched"]) for row in found] == pytest.approx([0.01, 0.02, 0.01, 0.02])
    assert [float(row["stretched error"]) for row in found] == pytest.approx([0.0, 1.0, 0.0, 1.0], abs=1e-9)
    assert (folder / "sweep.png").stat().st_size > 5000
    assert json.loads((folder / "points=9,load=2" / "summary.json").read_text())["settings"]["load"] == 2.0
    assert "[4/4] points=9, load=2: finished in" in done.output and "+100.000 %" in done.output
    # A longer sweep runs what is new.
    stamps = {path: path.stat().st_mtime_ns for path in folder.glob("*/summary.json")}
    again = sweep("--points", "7,9", "--set", "load=1,2,3")
    assert again.exit_code == 0 and again.output.count("finished, done before") == 4
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())
    assert len(rows(folder)) == 6


def test_a_run_that_fails_does_not_stop_the_others(scene):
    done = sweep("--points", "2,7", "--quiet")
    assert done.exit_code == 2
    refused, finished = rows(scene / "runs" / "mine-sweep")
    assert (refused["status"], refused["stretched"], finished["status"]) == ("refused", "", "finished")
    assert done.output.count("points = 2: expected a whole number") == 1 and "Traceback" not in done.output
    lost = sweep("--points", "2,7", "--set", "load=1,400", "--out", "far")
    assert lost.exit_code == 3, "a run that did not converge outweighs a refused one"
    assert [row["status"] for row in rows(scene / "far")] == ["refused", "refused", "finished", "not converged"]
    assert sweep("--set", "load=400", "--out", "far2").exit_code == 3
    assert "done before" in sweep("--set", "load=400", "--out", "far2").output, "it would not converge again"


def test_a_note_of_many_runs_is_told_once(scene):
    told = """, notes=["all: one"] + ["heavy: bends"] * (load > 1) + [f"load = {load}: of 3"])"""
    ends = ", reference=0.01)],\n    )\n"
    assert SCENE.endswith(ends)
    (scene / "mine.py").write_text(SCENE.removesuffix(ends) + ", reference=0.01)]" + told)
    for quiet in ([], ["--quiet"]):
        lines = sweep("--set", "load=1,2,3", *quiet).stderr.splitlines()
        assert [line for line in lines if "runs)" in line] == [
            "all: one (3 of 3 runs)",
            "load = 1.0: of 3 (as at load=1, with other numbers elsewhere: 3 of 3 runs)",
            "heavy: bends (2 of 3 runs)",
        ], "runs of before have their notes, too"


def test_a_run_that_was_interrupted_goes_on(scene):
    """What a killed run leaves: a restart file and no summary."""
    assert sweep("--points", "7").exit_code == 0
    folder = scene / "runs" / "mine-sweep" / "points=7"
    (folder / "summary.json").unlink()
    done = sweep("--points", "7")
    assert done.exit_code == 0, done.output
    summary = json.loads((folder / "summary.json").read_text())
    assert "nothing to do" in summary["message"], "it was resumed, not run again"


def test_other_settings_in_the_folder_are_refused(scene):
    (scene / "mine.py").write_text(SCENE)
    assert sweep("--points", "7").exit_code == 0
    (scene / "mine.py").write_text(SCENE.replace("load=1.0", "load=3.0"))
    changed = sweep("--points", "7")
    assert changed.exit_code == 2 and "contains a run with other settings (load = 1.0, here 3.0)" in changed.output
    assert sweep("--points", "7", "--overwrite").exit_code == 0
    assert float(rows(scene / "runs" / "mine-sweep")[0]["stretched"]) == pytest.approx(0.03)


def test_a_scene_is_its_file_and_no_byte_code_of_the_same_second(scene, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file, loads = scene / "mine.py", []
    for load in ("1.0", "3.0"):
        file.write_text(SCENE.replace("load=1.0", f"load={load}"))
        os.utime(file, (1e9, 1e9))
        loads.append(build_scene("mine.py", {}).settings["load"])
    assert loads == [1.0, 3.0]


TEXTS = (
    "a/b",
    "a_b",
    "a b",
    "ab",
    "a%2Fb",
    "H\u00f6he",
    "(1,2)",
    "(1",
    "",
    ".",
    "a\\b",
    "a:b",
    "a=b",
    "x" * 300,
    "x" * 299 + "y",
)


@settings(deadline=None, suppress_health_check=list(HealthCheck))
@given(
    one=st.dictionaries(st.sampled_from("abc"), st.text(), min_size=1),
    two=st.dictionaries(st.sampled_from("abc"), st.text()),
)
@example({"a": "1,b=2"}, {"a": "1", "b": "2"})
def test_names_of_folders_are_injective_and_fit_every_file_system(one, two):
    names = [folder_name(values) for values in (one, two)]
    assert (names[0] == names[1]) == (list(one.items()) == list(two.items()))
    assert all(len(name.encode()) <= 200 and not set(name) & set('/\\:*?"<>|\0') for name in names)


def test_every_value_has_its_own_folder(scene):
    names = [folder_name({"name": text}) for text in TEXTS]
    assert len(set(names)) == len(TEXTS)
    (scene / "mine.py").write_text(
        SCENE.replace("load=1.0):", "load=1.0, name='a'):").replace(
            "frame.displacement[:, 0].max()", "float(len(name))"
        ),
        "utf-8",
    )
    done = sweep("--set", "name=a/b,a_b,abc/" + "x" * 300)
    assert done.exit_code == 0, done.output
    assert [float(row["stretched"]) for row in rows(scene / "runs" / "mine-sweep")] == [3.0, 3.0, 304.0]
    assert "done before" not in done.output


def test_a_file_system_that_takes_two_names_for_one_does_not_mix_their_results(scene, monkeypatch):
    """As those of Windows and macOS do with capitals."""
    monkeypatch.setattr("warp_pd.command.sweep.folder_name", lambda values: "one")
    done = sweep("--points", "7,9")
    assert done.exit_code == 2 and "other settings (points = 7, here 9)" in done.output
    assert [row["status"] for row in rows(scene / "runs" / "mine-sweep")] == ["finished", "refused"]


def test_results_of_another_version_are_refused(scene, monkeypatch):
    assert sweep("--points", "7").exit_code == 0
    monkeypatch.setattr("warp_pd.command.sweep.code_version", lambda: "warp-pd 9.0 abc, Warp 1.19.0")
    upgraded = sweep("--points", "7")
    assert upgraded.exit_code == 2 and "here warp-pd 9.0 abc" in upgraded.output
    assert len(upgraded.output.strip().splitlines()) == 1


def test_a_damaged_summary_is_one_line(scene):
    assert sweep("--points", "7").exit_code == 0
    path = scene / "runs" / "mine-sweep" / "points=7" / "summary.json"
    whole = json.loads(path.read_text("utf-8"))
    for name in whole:
        path.write_text(json.dumps({key: value for key, value in whole.items() if key != name}), "utf-8")
        done = sweep("--points", "7")
        assert "Traceback" not in done.output and not isinstance(done.exception, KeyError | TypeError), name


@pytest.mark.parametrize(
    ("names", "value"),
    [
        (("identity", "parts"), None),
        (("identity", "sources"), [1]),
        (("identity", "code"), 1),
        (("units", "strain"), float("nan")),
        (("wall_s",), 10**400),
        (("measures", "stretched", "value"), 10**400),
    ],
)
def test_a_wrong_entry_inside_a_summary_is_one_line(scene, names, value):
    assert sweep("--points", "7").exit_code == 0
    folder = scene / "runs" / "mine-sweep" / "points=7"
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    inside = summary
    for name in names[:-1]:
        inside = inside[name]
    inside[names[-1]] = value
    (folder / "summary.json").write_text(json.dumps(summary), "utf-8")
    for done in (sweep("--points", "7"), cli("info", folder), cli("view", folder)):
        assert isinstance(done.exception, SystemExit | None), done.exception


@pytest.mark.parametrize("damage", [b"\xff\xfe", b'"' + b"x" * 200_000])
def test_a_damaged_table_is_not_replaced_by_one_with_refused_runs(scene, damage):
    assert sweep("--points", "7").exit_code == 0
    table = scene / "runs" / "mine-sweep" / "sweep.csv"
    table.write_bytes(table.read_bytes() + damage)
    refused = sweep("--points", "2,7")
    assert refused.exit_code == 2 and "sweep.csv: not replaced" in refused.output
    assert table.read_bytes().endswith(damage)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.01 * load", "0.03 * load", "other settings (loads.2.x = [0.0, 0.01], here [0.0, 0.03])"),
        ("[:, 0].max()", "[:, 0].max() / arm", "other code (mine.py has changed)"),
        ("arm = 1.0", "arm = 2.0", "other code (beside.py has changed)"),
    ],
)
def test_an_edited_scene_never_gets_its_old_results(scene, old, new, said):
    files = {
        "mine.py": SCENE.replace("\n\ndef", "\nfrom beside import arm\n\ndef"),
        "beside.py": "import json\narm = 1.0\n",
    }

    def write(old, new):
        sys.modules.pop("beside", None)
        for name, text in files.items():
            (scene / name).write_text(text.replace(old, new))

    write("", "")
    assert sweep("--points", "7,9").exit_code == 0
    folder = scene / "runs" / "mine-sweep"
    table = (folder / "sweep.csv").read_bytes()
    write("\n", "\n# A comment changes nothing.\n")
    assert sweep("--points", "7,9").output.count("done before") == 2
    write(old, new)
    edited = sweep("--points", "9,7,11")
    assert edited.exit_code == 2 and said in edited.output and len(edited.output.strip().splitlines()) == 1
    assert (folder / "sweep.csv").read_bytes() == table and not (folder / "points=11").exists()


def test_a_table_is_not_replaced_by_one_of_refused_runs(scene):
    assert sweep("--points", "7").exit_code == 0
    folder = scene / "runs" / "mine-sweep"
    table = (folder / "sweep.csv").read_bytes()
    refused = sweep("--points", "2")
    assert refused.exit_code == 2 and "sweep.csv: not replaced" in refused.output
    assert (folder / "sweep.csv").read_bytes() == table
    assert sweep("--points", "2,7").exit_code == 2
    assert [row["status"] for row in rows(folder)] == ["refused", "finished"], "it lacks no result"


def test_a_sweep_of_refused_runs_leaves_no_files(scene):
    refused = sweep("--points", "1,2")
    assert refused.exit_code == 2 and "not replaced" not in refused.output
    assert not (scene / "runs" / "mine-sweep").exists()


def test_an_interrupted_sweep_stops_and_says_how_to_continue(scene, monkeypatch):
    from warp_pd import Simulation

    run = Simulation.run

    def stopped(simulation, **options):
        if simulation.sheet.size > 49:
            raise KeyboardInterrupt
        return run(simulation, **options)

    with monkeypatch.context() as patched:
        # Ctrl-C within the second run.
        patched.setattr(Simulation, "run", stopped)
        done = sweep("--points", "7,9,11")
    assert done.exit_code == 130 and "repeat the command to continue" in done.output
    assert [row["status"] for row in rows(scene / "runs" / "mine-sweep")] == ["finished", "interrupted"]
    assert sweep("--points", "7,9,11").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "sweep: expected values, such as --points 51,101"),
        (["--points", "7,9", "--set", "points=5"], "is already given"),
        (["--set", "points"], "expected name=value"),
    ],
)
def test_wrong_commands_end_with_one_line(scene, arguments, said):
    done = sweep(*arguments)
    assert done.exit_code == 2 and said in done.output
    assert len(done.output.strip().splitlines()) == 1
    unknown = cli("sweep", "presure", "--points", "7")
    assert unknown.exit_code == 2 and "did you mean 'pressure'" in unknown.output


def test_help_names_the_options_of_run():
    """Each of them has a word of its own."""
    said = cli("sweep", "--help").output
    assert all(
        f"As for `run`: {name}." in said for name in ("points", "horizon", "force", "weights", "solver", "frames")
    )
