"""Results that are there are kept, runs do not meet in one folder, and what a disk cannot take ends in one line."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from filelock import FileLock
from helpers import NEO, refused, square
from small_runs import cli

from warp_pd import BondAssociated, Explicit, Fixed, InputError, Measure, Outcome, RigidBall, Simulation
from warp_pd.device.checks import OutputError
from warp_pd.output import background, vtkhdf
from warp_pd.output.background import require_room
from warp_pd.run.folder import claimed_folder, newest_folder, sole_use

SMALL = ["run", "pressure", "--points", "9", "--device", "cpu", "--no-pictures", "--no-usd"]


def simulation(**parts):
    sheet = square(7)
    return Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=2), [Fixed(sheet.edges())], **parts)


def test_a_folder_with_results_is_kept_unless_asked(tmp_path):
    simulation().run(out=tmp_path, device="cpu", usd=False)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with refused(match=r"it contains summary\.json; expected a folder without results, overwrite"):
        simulation().run(out=tmp_path, device="cpu", usd=False)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert simulation().run(out=tmp_path, device="cpu", usd=False, overwrite=True).status == "finished"
    with refused(match="resume = True, overwrite = True: expected at most one of them"):
        simulation().run(out=tmp_path, device="cpu", resume=True, overwrite=True)


def test_files_of_others_are_never_touched(tmp_path):
    """A summary of something else, and a part of a picture of something else."""
    (tmp_path / "summary.json").write_text("lab\n")
    (tmp_path / "fig.png.part").write_text("mine")
    for overwrite in (False, True):
        with refused(match=r"summary\.json"):
            simulation().run(out=tmp_path, device="cpu", usd=False, overwrite=overwrite)
    (tmp_path / "summary.json").unlink()
    simulation().run(out=tmp_path, device="cpu", usd=False)
    assert (tmp_path / "fig.png.part").read_text() == "mine"


def test_default_folders_are_numbered(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("pressure", "pressure-2", "pressure-3"):
        done = cli(*SMALL)
        assert done.exit_code == 0 and f"results in runs/{name}" in done.output
    assert newest_folder(tmp_path / "runs" / "pressure").name == "pressure-3"
    with claimed_folder(tmp_path / "runs" / "pressure") as folder:
        assert folder.name == "pressure-4"
    assert not folder.exists() and newest_folder(tmp_path / "runs" / "other").name == "other"
    done = cli(*SMALL, "--resume")
    assert done.exit_code == 0 and "results in runs/pressure-3" in done.output
    assert "the run had already finished" in done.output
    done = cli(*SMALL, "--overwrite")
    assert done.exit_code == 0 and "results in runs/pressure\n" in done.output


def test_a_second_run_at_the_same_time_takes_the_next_default_folder(tmp_path, monkeypatch):
    """A run that has begun and written nothing yet holds its folder."""
    monkeypatch.chdir(tmp_path)
    holds = "from warp_pd.run.folder import *; import pathlib, sys\n"
    holds += "with claimed_folder(pathlib.Path('runs/pressure')) as folder: print(folder, flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", holds]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as one, subprocess.Popen(command, **pipes) as two:
        assert {one.stdout.readline().strip(), two.stdout.readline().strip()} == {"runs/pressure", "runs/pressure-2"}
        done = cli(*SMALL)
        assert done.exit_code == 0 and "results in runs/pressure-3" in done.output
        one.stdin.close()
        two.stdin.close()
    assert os.listdir(tmp_path / "runs") == ["pressure-3"]


def test_results_are_looked_for_once_the_folder_is_locked(tmp_path, monkeypatch):
    """A run that ends between the two would lose its results."""
    lock = FileLock.acquire

    def ended_meanwhile(self, *arguments, **options):
        (tmp_path / "history.csv").write_text("time,step\n")
        return lock(self, *arguments, **options)

    monkeypatch.setattr(FileLock, "acquire", ended_meanwhile)
    with refused(match="it contains history.csv"):
        simulation().run(out=tmp_path, device="cpu")


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
@pytest.mark.parametrize("name", [".lock", ".probe"])
def test_no_link_is_followed(tmp_path, name):
    (tmp_path / "mine").write_text("mine")
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / name).symlink_to(tmp_path / "mine")
    try:
        simulation().run(out=folder, device="cpu", usd=False)
    except InputError as error:
        assert "expected a writable folder" in str(error)
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_history_of_others_is_never_replaced(tmp_path, overwrite):
    (tmp_path / "history.csv").write_text("date,event\n")
    with refused(match=r"history\.csv"):
        simulation().run(out=tmp_path, device="cpu", overwrite=overwrite)
    assert (tmp_path / "history.csv").read_text() == "date,event\n"


def test_pictures_of_others_are_never_replaced(tmp_path, default_pictures):
    """Not by a run, nor by a later one in its place, nor by one that goes on, nor by those drawn again."""
    (tmp_path / "sheet.png").write_text("mine")
    scene = tmp_path / "scene.py"
    scene.write_text(
        "from warp_pd import *\n"
        "def build(frames=2):\n"
        "    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=7)\n"
        "    pull = Motion(sheet.edges('right'), times=[0.0, 1e-3], x=[0.0, 1e-3])\n"
        "    law = BondAssociated(NeoHookean(mu=1e3, bulk=1e5))\n"
        "    return Simulation(sheet, law, Explicit(frames * 1e-3, frames=frames), [pull])\n"
    )
    run = ("run", scene, "--out", tmp_path, "--device", "cpu", "--no-usd")
    for more in ((), ("--overwrite",), ("--resume", "--set", "frames=4")):
        done = cli(*run, *more)
        assert done.exit_code == 0 and "sheet-2.png instead of sheet.png" in done.output, done.output
    drawn = sorted(p.name for p in tmp_path.glob("*.png"))
    for _ in range(2):
        assert cli("draw", tmp_path, "--scene", scene).exit_code == 0
    assert sorted(p.name for p in tmp_path.glob("*.png")) == drawn and "sheet-2.png" in drawn
    assert (tmp_path / "sheet.png").read_text() == "mine"


def test_a_second_run_is_kept_out(tmp_path):
    with sole_use(tmp_path), pytest.raises(InputError, match="another run is writing there"):
        simulation().run(out=tmp_path, device="cpu")
    assert simulation().run(out=tmp_path, device="cpu", usd=False).status == "finished"
    assert not (tmp_path / ".lock").exists()


def test_a_lock_dies_with_its_run(tmp_path):
    """A killed run leaves the file, and the system takes the lock."""
    (tmp_path / ".lock").write_text("")
    assert simulation().run(out=tmp_path, device="cpu", usd=False).status == "finished"


def test_a_disk_without_room_is_one_line_before_anything_is_written(tmp_path, monkeypatch):
    with pytest.raises(OutputError, match=r"MB are free, expected 1e\+12 MB"):
        require_room(tmp_path, 10**18)
    # A disk that is full.
    monkeypatch.setattr(background.shutil, "disk_usage", lambda path: type("Usage", (), {"free": 1000}))
    with pytest.raises(OutputError, match=r"0\.001 MB are free"):
        simulation().run(out=tmp_path, device="cpu")
    assert not (tmp_path / "frames.vtkhdf").exists()


def test_room_is_asked_for_before_every_hdf5_file(tmp_path, monkeypatch):
    """For the bodies, too, and for as much as the file can grow; HDF5 would end with a segmentation fault."""
    asked, grown = [], []
    monkeypatch.setattr(vtkhdf, "require_room", lambda folder, needed: asked.append(needed))
    write = vtkhdf.VtkHdfSeries.write

    def measured(series, frame):
        before = series.path.stat().st_size if series.path.exists() else 0
        write(series, frame)
        grown.append(series.path.stat().st_size - before)

    monkeypatch.setattr(vtkhdf.VtkHdfSeries, "write", measured)
    for points in (7, 61):
        sheet = square(points)
        ball = RigidBall(diameter=0.05, start=(0.05, 0.05, 0.03), velocity=(0.0, 0.0, -0.1))
        scene = Simulation(sheet, BondAssociated(NEO), Explicit(1e-4, frames=20), contact=ball)
        scene.run(out=tmp_path / str(points), device="cpu", usd=False, view=False)
        assert (tmp_path / str(points) / "bodies.vtkhdf").is_file()
    assert len(asked) == len(grown) == 2 * 2 * 21
    assert all(size <= most for size, most in zip(grown, asked, strict=True))


@pytest.mark.parametrize("gone", ["after", "before"])
def test_a_folder_that_is_deleted_during_a_run_is_one_line(tmp_path, gone):
    """Before or after a frame is written."""
    folder = tmp_path / "out"

    class Deletes:
        def write(self, frame):
            if frame.index == 1:
                shutil.rmtree(folder)

        def save(self):
            pass

        def close(self):
            pass

    scene = simulation(
        measures=[] if gone == "after" else [Measure("x", "m", lambda built, frame: Deletes().write(frame))]
    )
    with pytest.raises(OutputError, match="could not be written: No such file") as raised:
        scene.run(out=folder, device="cpu", usd=False, writers=[Deletes()] if gone == "after" else [])
    assert "\n" not in str(raised.value)


def test_a_run_that_goes_on_keeps_its_files(tmp_path):
    """Frames would be those of the first half alone; the animation is made of all frames, and not kept from before."""
    simulation().run(out=tmp_path, device="cpu", usd=True)
    with refused(match=r"it holds frames\.vtkhdf; expected vtkhdf = True"):
        simulation().run(out=tmp_path, device="cpu", vtkhdf=False, resume=True)
    simulation().run(out=tmp_path, device="cpu", usd=False, resume=True)
    assert not (tmp_path / "animation.usd").exists()
    simulation().run(out=tmp_path, device="cpu", usd=True, resume=True)
    assert (tmp_path / "animation.usd").is_file()


def test_the_summary_says_what_was_run(tmp_path):
    simulation().run(out=tmp_path, device="cpu", usd=False)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["material"] == "NeoHookean(mu=1000.0, bulk=100000.0)"
    assert summary["thickness"] == 1e-3 and summary["density"] == 1000.0
    page = (Path(__file__).parents[3] / "docs" / "versions.md").read_text("utf-8")
    promised = page.partition("```text\n")[2].partition("```")[0].split()
    assert set(promised) == set(summary), "keys that stay the same between versions"
    assert summary["commit"] is None or len(summary["commit"]) == 40


def test_a_long_frame_ends_soon_after_it_was_asked_to():
    sheet = square(7)
    # One frame of some ten million steps.
    scene = Simulation(sheet, BondAssociated(NEO), Explicit(5000.0, frames=1), [Fixed(sheet.edges())])
    scene.build("cpu").context.compile()
    threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    result = scene.run(device="cpu")
    assert result.status == "interrupted" and len(result.history) == 1


def test_a_result_is_one_line():
    result = simulation(outcomes=[Outcome("one", "m", lambda history: 1.0)]).run(device="cpu")
    assert repr(result) == "Result(simulation: finished, 3 frames; one = 1.0)"


def test_drawing_leaves_the_backend_alone(tmp_path):
    code = """
import pathlib, sys, matplotlib
matplotlib.use("svg")
from warp_pd.viewer import plots
rows = [{"time": 0.0, "a": 1.0}, {"time": 1.0, "a": 2.0}]
plots.curves(pathlib.Path(sys.argv[1]), rows, ["a"], ylabel="a")
assert matplotlib.get_backend() == "svg", matplotlib.get_backend()
"""
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.png")], check=True)
    assert (tmp_path / "a.png").stat().st_size > 5000


@pytest.mark.skipif(os.path.exists("/dev/nvidiactl"), reason="there is an NVIDIA device")
def test_a_machine_without_a_gpu_is_no_news():
    command = [sys.executable, "-m", "warp_pd.__main__", "plan", "pressure", "--points", "9"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stderr == ""
