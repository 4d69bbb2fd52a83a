"""The command line: scenes, wrong input in one line, `list` and `info`."""

import json
import os
import re
import shlex
import subprocess
import sys

import pytest
from small_runs import cli

from warp_pd import BondAssociated, Explicit, NeoHookean, Sheet, Simulation
from warp_pd.command.scene_files import _meant


def test_broken_scene_files_end_with_one_line(tmp_path):
    for text, said in (
        ("def build(:\n", "line 1"),
        ("build = 3\n", "no function build"),
        ("\x00\n", "mine.py': source code string cannot contain null bytes"),
        ("def build(): return 3\n", "build returned int"),
        ("from warp_pd import *\ndef build(): return Simulation(1, 2, 3)\n", "sheet = 1: expected a Sheet"),
        ("import numpyy\n", "line 1: ModuleNotFoundError"),
        (
            "from warp_pd import *\n\ndef build():\n    return Fixed([0], component='x')\n",
            "line 4: TypeError: Fixed.__init__() got an unexpected keyword argument 'component' (did you mean "
            "'components'?)",
        ),
        (
            "from warp_pd import *\n\ndef build():\n    return Sheet.rectangle(1.0, 1.0, thicknes=1.0)\n",
            "unexpected keyword argument 'thicknes' (did you mean 'thickness'?)",
        ),
        (
            "from warp_pd import *\n\ndef build():\n    return Sheet.rectangle(1, 1, thickness=1, density=1, points=9)"
            ".edges('lefft')\n",
            "edge = 'lefft': expected one of 'left', 'right', 'bottom', 'top', 'all' (did you mean",
        ),
        ("def build():\n    return sheet()\n\n\ndef sheet():\n    return Sheet(3)\n", "line 6: NameError"),
    ):
        (tmp_path / "mine.py").write_text(text)
        done = cli("run", tmp_path / "mine.py")
        assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output


def test_what_was_meant_is_said_once():
    """Python says it itself from version 3.13 on."""
    text = "Pressure.__init__() got an unexpected keyword argument 'valu'"
    assert _meant(TypeError(text)) == " (did you mean 'value'?)"
    assert _meant(TypeError(f"{text}. Did you mean 'value'?")) == ""


WRONG_LINES = [
    (["run", "ball_penetratoin"], "did you mean 'ball_penetration'"),
    (["run", "nowhere/at_all"], "expected a name from `warp-pd list`, or a Python file"),
    (["run", "nothing"], "or a Python file, *.py"),
    (["run", os.path.splitext(__file__)[0]], f"did you mean {__file__!r}"),
    (["run", "pressure", "--set", "presure=3"], "did you mean 'pressure'"),
    (["run", "pressure", "--set", "points=many"], "points = 'many': expected a whole number"),
    (["run", "pressure", "--set", "pressure"], "--set 'pressure': expected name=value"),
    (["run", "pressure", "--points", "2"], "points = 2: expected a whole number of 3 or more"),
    (["run", "pressure", "--horizon", "0.9"], "horizon = 0.9: expected at least 1 spacing"),
    (["run", "pressure", "--horizon", "1.2"], "horizon = 1.2: expected at least 1.42 on a lattice"),
    (["run", "pressure", "--horizon", "nan"], "horizon = nan"),
    (["run", "pressure", "--horizon", "9.015", "--weights", "corrected"], "expected a horizon up to 4.5"),
    (["run", "pressure", "--weights", "planar"], "did you mean 'plain'"),
    (["run", "pressure", "--device", "cuda:7"], "device = 'cuda:7': expected one of 'cpu'"),
    (["run", "pressure", "--precision", "16"], "precision = 16: expected one of 32, 64"),
    (["run", "pressure", "--out", "/proc/nowhere"], "out = '/proc/nowhere': expected a writable folder"),
    (["run", "pressure", "--out", ""], "out = '': expected a writable folder"),
    (["run", "pressure", "--set", "points=31", "--points", "41"], "points = 41 is already given"),
    (["run", "pressure", "--horizon", "200", "--points", "101"], "horizon = 200.0: expected at most 16 spacings"),
    (["run", "pressure", "--horizon", "4.15", "--points", "4"], "horizon = 4.15: expected at most 3 spacings"),
    (["run", "off_plane_tear", "--duration", "3"], "the duration is travel / speed"),
    (["run", "double_notch", "--frames", "-3"], "frames = -3: expected a whole number of 1 or more"),
    (["run", "nothing.py"], "the file does not exist"),
    (["run", "pressure", "--points", "x"], "'x' is not a valid integer"),
    (["runn"], "No such command 'runn'"),
    (["--nope"], "No such option '--nope'"),
    (["run", "pressure", "--stride", "0"], "stride = 0: expected a whole number of 1 or more"),
    (["run", "pressure", "--no-pictures", "--pictures", "pdf"], "--pictures: expected only without --no-pictures"),
    (["run", "pressure", "--no-vtkhdf", "--fields", "damage"], "--fields: expected only without --no-vtkhdf"),
    (["run", "pressure", "--no-vtkhdf", "--pictures", "pdf"], "--pictures: expected only without --no-vtkhdf"),
    (["run", "pressure", "--no-vtkhdf", "--stride", "2"], "--stride: expected only without --no-vtkhdf"),
    (["plan", "pressure", "--json", "--time"], "--time: expected only without --json"),
    (["run", "pressure", "--pictures", ""], "pictures = '': expected one of 'png', 'pdf', 'svg'"),
    (["run", "pressure", "--pictures", "gif"], "pictures = 'gif': expected one of 'png', 'pdf', 'svg'"),
    (["sweep", "pressure", "--points", "9,11", "--pictures", "bmp"], "pictures = 'bmp': expected one of"),
    (["run", "pressure", "--set", "=3"], "--set '=3': expected name=value"),
    (["info", "nothing.usd"], "the file does not exist"),
    (["info", __file__], "expected a .vtkhdf, .usd or .json"),
]


@pytest.mark.parametrize(
    ("arguments", "text"), WRONG_LINES, ids=[" ".join(map(os.path.basename, a)) for a, _ in WRONG_LINES]
)
def test_wrong_input_ends_with_one_line(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = cli(*arguments)
    assert done.exit_code == 2, done.output
    lines = [line for line in done.output.splitlines() if line.startswith("warp-pd:")]
    assert len(lines) == 1 and text in lines[0]
    left = list(tmp_path.rglob("*"))
    assert not [p for p in left if p.is_file()]


def test_ctrl_c_before_a_run_ends_with_one_line(monkeypatch):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("warp_pd.__main__.require_scene", interrupt)
    done = cli("run", "pressure")
    assert done.exit_code == 130 and done.output.splitlines() == ["warp-pd: interrupted"]


def test_list_and_info(ball):
    listed = cli("list").output
    assert {"ball_penetration", "pressure", "tension"} <= {line.split()[0] for line in listed.splitlines()}
    told = cli("info", ball)
    assert told.exit_code == 0 and "25 frames" in told.output and "/World/Sheet" in told.output


def test_a_scene_of_ones_own(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from warp_pd import *\n"
        "def build(points=9, speed=0.1):\n"
        "    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)\n"
        "    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5), weights='plain'), Explicit(0.1, frames=2),\n"
        "                      loads=[Fixed(sheet.edges('left'))])\n"
    )
    done = cli("run", tmp_path / "mine.py", "--set", "speed=0.2", "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["settings"] == {"points": 9, "speed": 0.2}


def test_quiet_hides_progress_and_neither_notes_nor_results(tmp_path):
    """A note known before the run, one of the end, and a number; each once."""
    (tmp_path / "mine.py").write_text(
        "from warp_pd import *\n"
        "def build():\n"
        "    sheet = Sheet.rectangle(100.0, 100.0, thickness=1e-3, density=1e3, points=5)\n"
        "    seen = Measure('seen', 'm', lambda built, frame: 0.25)\n"
        "    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(0.02, frames=2),\n"
        "                      loads=[Fixed(sheet.edges())], measures=[seen], notes=['a choice'])\n"
    )
    files = ("--no-usd", "--no-pictures", "--no-view", "--no-vtkhdf", "--overwrite", "--out", tmp_path / "out")
    quiet, loud, as_json = (
        cli("run", tmp_path / "mine.py", "--device", "cpu", *files, *more) for more in (["--quiet"], [], ["--json"])
    )
    notes = json.loads(as_json.stdout)["notes"]
    assert "a choice" in notes and any("the sheet is 100 m wide" in note for note in notes)
    assert sorted(quiet.stderr.splitlines()) == sorted(notes)
    assert quiet.stdout == loud.stdout and "seen = 0.25 m" in quiet.stdout
    assert set(notes) < set(loud.stderr.splitlines()) and "100.0 %" in loud.stderr


def complete(shell, *words):
    """What a shell is offered for the last word."""
    line = {"COMP_WORDS": shlex.join(["warp-pd", *words]), "COMP_CWORD": str(len(words))}
    given = {**os.environ, "_WARP_PD_COMPLETE": f"{shell}_complete", **line}
    command = [sys.executable, "-c", "from warp_pd.__main__ import main; main(prog_name='warp-pd')"]
    done = subprocess.run(command, env=given, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_names_of_scenes_and_arguments_are_completed(shell, tmp_path):
    """Those of a file, too, which is not run."""
    (tmp_path / "mine.py").write_text("raise RuntimeError\ndef build(points=3, *, polish=1): ...\n")
    assert {"pressure_dynamic", "pressure_static"} <= set(re.split("[,\n]", complete(shell, "run", "pressure_")))
    assert "follower=" in complete(shell, "run", "pressure", "--set", "fol")
    found = complete(shell, "sweep", str(tmp_path / "mine.py"), "--set", "po")
    assert "points=" in found and "polish=" in found


def test_json(ball, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    listed = json.loads(cli("list", "--json").stdout)
    assert {"name": "ball_penetration"}.items() <= listed[0].items() and all(entry["description"] for entry in listed)
    told = json.loads(cli("info", ball, "--json").stdout)
    assert told["frames.vtkhdf"]["points"] == 441 and len(told["frames.vtkhdf"]["times"]) == 25
    summary = json.loads((ball / "summary.json").read_text("utf-8"))
    assert told["summary.json"]["scene"] == "ball_penetration" and summary.keys() == told["summary.json"].keys()
    small = ("pressure", "--points", "7", "--horizon", "2.015", "--device", "cpu")
    plan = json.loads(cli("plan", *small, "--json").stdout)
    assert sum(int(array["bytes"]) for array in plan["arrays"]) == plan["bytes"] and plan["launches"]
    done = cli("run", *small, "--json", "--no-pictures", "--no-usd")
    ran = json.loads(done.stdout)
    assert done.exit_code == 0 and ran["status"] == "finished" and ran["folder"] == "runs/pressure"
    refused = cli("info", tmp_path / "nowhere", "--json")
    assert refused.exit_code == 2 and refused.stdout == ""


def test_notes_are_warnings_of_the_logger(caplog):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=7)
    scene = Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(1e-4, frames=1), notes=["a choice"])
    with caplog.at_level("INFO", "warp_pd"):
        scene.run(device="cpu")
    told = [(record.levelname, record.getMessage()) for record in caplog.records if record.name == "warp_pd"]
    assert ("WARNING", "a choice") in told and any(text.startswith("finished") for _, text in told)
