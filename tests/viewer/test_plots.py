"""Pictures: what they show, and damaged frames that cannot be drawn."""

import json
import os
import shutil

import pytest
from small_runs import cli

from warp_pd.viewer import plots


def test_pictures_know_the_ball_and_say_when_nothing_happens(ball, tmp_path):
    first, last = plots.frames_at(ball, [0.0, 4.0])
    assert (first.when, last.when) == ("t = 0 s", "t = 4 s")
    assert first.balls == [(pytest.approx([0.5, 0.5, 0.15]), 0.3)]
    assert last.balls == [(pytest.approx([0.5, 0.5, -0.25]), 0.3)]
    for length in (0.0, 1.0):
        history = [{"time": t, "crack_length": t * length} for t in (0.0, 1.0)]
        plots.curves(tmp_path / "crack.svg", history, ["crack_length"], ylabel="m")
        # Matplotlib notes a text beside its outlines.
        assert ("<!-- zero throughout -->" in (tmp_path / "crack.svg").read_text()) == (length == 0.0)


def test_draw_refuses_the_scene_of_another_run(ball):
    done = cli("draw", ball, "--scene", "double_notch")
    assert done.exit_code == 2 and "expected 'ball_penetration', the scene of this run" in done.output


def test_a_scene_of_ones_own_is_drawn_from_its_file(tmp_path):
    """Whatever it is called; and it may import the files beside it."""
    (tmp_path / "beside_it.py").write_text("POINTS = 5\n")
    (tmp_path / "pressure.py").write_text(
        "from beside_it import POINTS\n"
        "from warp_pd import *\n"
        "def draw(history, folder): (folder / 'mine.png').write_bytes(b'mine')\n"
        "def build():\n"
        "    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=POINTS)\n"
        "    law = BondAssociated(NeoHookean(mu=1e3, bulk=1e5))\n"
        "    return Simulation(sheet, law, Explicit(1e-4, frames=1), pictures=draw)\n"
    )
    out = tmp_path / "out"
    done = cli("run", tmp_path / "pressure.py", "--device", "cpu", "--quiet", "--no-usd", "--out", out)
    assert done.exit_code == 0, done.output
    (out / "mine.png").unlink()
    done = cli("draw", out, "--scene", tmp_path / "pressure.py")
    assert done.exit_code == 0 and [p.name for p in out.glob("*.png")] == ["mine.png"]


@pytest.mark.parametrize(
    "named", [{"file": "trap.py"}, {"scene": "trap.py"}, {"scene": "trap", "file": None}, {"scene": "../trap.py"}]
)
def test_draw_runs_no_file_that_a_results_folder_names(ball, tmp_path, monkeypatch, named):
    """Neither a file, nor a scene whose name is a file's, nor a module beside the folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "theirs"
    shutil.copytree(ball, folder)
    (tmp_path / "trap.py").write_text("import pathlib\npathlib.Path('sprung').touch()\ndef build(**given): ...\n")
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    summary |= {name: value and value.replace("trap.py", str(tmp_path / "trap.py")) for name, value in named.items()}
    (folder / "summary.json").write_text(json.dumps(summary), "utf-8")
    for command in ("draw", "info", "view"):
        done = cli(command, folder)
        assert not (tmp_path / "sprung").exists(), command
        assert (done.exit_code, "expected --scene FILE.py" in done.output) == (
            (2, True) if command == "draw" else (0, False)
        )


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), lambda path: os.truncate(path, 5000)])
def test_pictures_of_damaged_frames_are_refused_in_one_line(ball, tmp_path, damage):
    folder = tmp_path / "copy"
    shutil.copytree(ball, folder)
    damage(folder / "frames.vtkhdf")
    done = cli("draw", folder)
    assert done.exit_code == 2 and "frames.vtkhdf" in done.output and "Traceback" not in done.output
    assert len(done.output.strip().splitlines()) == 1
