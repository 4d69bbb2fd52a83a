"""Results that are there are kept, runs do not meet in one folder, and what a disk cannot take ends in one line."""

import json
import os
import signal
import subprocess
import sys
import threading

import pytest
from helpers import NEO, refused, square
from small_runs import cli

from warp_pd import BondAssociated, Explicit, Fixed, InputError, Outcome, Simulation
from warp_pd.device.checks import OutputError
from warp_pd.run import folder as run_folder
from warp_pd.run.folder import free_folder, newest_folder, require_room, sole_use

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
    assert free_folder(tmp_path / "runs" / "pressure").name == "pressure-4"
    assert free_folder(tmp_path / "runs" / "other") == newest_folder(tmp_path / "runs" / "other")
    done = cli(*SMALL, "--resume")
    assert done.exit_code == 0 and "results in runs/pressure-3" in done.output
    assert "the run had already finished" in done.output
    done = cli(*SMALL, "--overwrite")
    assert done.exit_code == 0 and "results in runs/pressure\n" in done.output


@pytest.mark.skipif(os.name != "posix", reason="locks are those of POSIX")
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
    monkeypatch.setattr(run_folder.shutil, "disk_usage", lambda path: type("Usage", (), {"free": 1000}))
    with pytest.raises(OutputError, match=r"0\.001 MB are free"):
        simulation().run(out=tmp_path, device="cpu")
    assert not (tmp_path / "frames.vtkhdf").exists()


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
    assert {"version", "commit", "date", "machine", "spacing"} <= set(summary)
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
from warp_pd.output import plots
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
