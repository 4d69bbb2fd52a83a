"""Pictures and pages that other processes prepare beside a run."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from warp_pd import InputError
from warp_pd.viewer import plots
from warp_pd.viewer.beside import (
    Processes,
    begun,
    number_beside,
    processes_beside,
    wait_for_pictures,
)
from warp_pd.viewer.pictures import Drawing, drawing

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are divided on Linux only")

HISTORY = [{"time": 0.1 * k, "kinetic": float(k**2)} for k in range(5)]


@contextlib.contextmanager
def without_matplotlib():
    """Where Matplotlib is loaded, pictures are drawn at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delitem(sys.modules, "matplotlib", raising=False)
        yield
        assert "matplotlib" not in sys.modules


def test_a_picture_drawn_beside_is_the_same(tmp_path):
    common = Drawing("scene", ("png", "svg"))
    with drawing(common):
        plots.curves(tmp_path / "here.png", HISTORY, ["kinetic"], "energy (J)")
        with without_matplotlib(), processes_beside(2):
            for name in ("a.png", "b.png", "c.png"):
                plots.curves(tmp_path / name, HISTORY, ["kinetic"], "energy (J)")
            wait_for_pictures()
    here = (tmp_path / "here.png").read_bytes()
    assert all((tmp_path / name).read_bytes() == here for name in ("a.png", "b.png", "c.png"))
    assert (tmp_path / "a.svg").is_file()


def test_an_error_of_a_picture_is_raised_once_the_others_are_drawn(tmp_path):
    missing = tmp_path / "no_folder" / "a.png"
    with without_matplotlib(), processes_beside(2):
        plots.curves(missing, HISTORY, ["kinetic"], "energy (J)")
        plots.curves(tmp_path / "b.png", HISTORY, ["kinetic"], "energy (J)")
        with pytest.raises(InputError, match=r"a\.png' cannot be written: No such file or directory"):
            wait_for_pictures()
        wait_for_pictures()
    assert (tmp_path / "b.png").is_file()


def test_an_error_keeps_its_kind():
    with processes_beside(1):
        result = begun(int, "a")
        with pytest.raises(ValueError, match="invalid literal"):
            result()


def test_arrays_come_back():
    values = np.linspace(0.0, 1.0, 100_000)
    with processes_beside(2):
        results = [begun(np.multiply, values, k) for k in range(4)]
        for k, result in enumerate(results):
            np.testing.assert_array_equal(result(), values * k)


def test_processes_are_not_this_one_and_end():
    with processes_beside(2):
        found = {begun(os.getpid)() for _ in range(4)}
        assert os.getpid() not in found
    for process in found:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_an_argument_of_this_process_only_stays_here():
    lock = threading.Lock()
    with processes_beside(1):
        assert begun(repr, lock)() == repr(lock)


def test_the_work_of_a_killed_process_is_done_here():
    processes = Processes(1)
    process = processes.begin(os.getpid)()
    os.kill(process, signal.SIGKILL)
    assert processes.begin(os.getpid)() == os.getpid()
    processes.close()


def test_without_processes_everything_happens_here(tmp_path):
    with processes_beside(0):
        plots.curves(tmp_path / "a.png", HISTORY, ["kinetic"], "energy (J)")
        assert (tmp_path / "a.png").is_file() and begun(os.getpid)() == os.getpid()
        wait_for_pictures()


def test_small_sheets_get_no_processes():
    assert number_beside(100) == 0 and number_beside(10**6) <= 4


def test_processes_die_with_the_one_that_started_them():
    program = """
import os, signal
from warp_pd.viewer.beside import Processes
print(Processes(1).begin(os.getpid)(), flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    stopped = time.monotonic() + 10.0
    while (
        Path(f"/proc/{done.stdout.strip()}/cmdline").exists()
        and Path(f"/proc/{done.stdout.strip()}/cmdline").read_bytes()
    ):
        assert time.monotonic() < stopped
        time.sleep(0.05)


def test_a_run_of_the_command_draws_the_same_pictures(tmp_path, monkeypatch):
    from small_runs import cli

    from warp_pd.viewer import beside

    def run(name: str) -> Path:
        command = (
            "run",
            "ball_penetration",
            "--points",
            "11",
            "--duration",
            "0.02",
            "--frames",
            "2",
            "--device",
            "cpu",
        )
        done = cli(*command, "--no-usd", "--out", str(tmp_path / name))
        assert done.exit_code == 0, done.output
        return tmp_path / name

    here = run("here")
    monkeypatch.setattr(beside, "MANY_POINTS", 1)
    with without_matplotlib():
        other = run("beside")
    pictures = sorted(path.name for path in here.glob("*.png"))
    assert pictures and pictures == sorted(path.name for path in other.glob("*.png"))
    assert all((here / name).read_bytes() == (other / name).read_bytes() for name in pictures)
    assert (here / "frames.vtkhdf").read_bytes() == (other / "frames.vtkhdf").read_bytes()
    assert (other / "view.html").is_file()
