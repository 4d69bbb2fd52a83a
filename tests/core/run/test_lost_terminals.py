"""What a run prints may go nowhere: a terminal, a pipe or a disk that is gone does not end it."""

import json
import os
import signal
import subprocess
import sys

import pytest

RUN = f"{sys.executable} -m warp_pd run pressure --points 7 --horizon 2.015 --solver relaxation --device cpu"
RUN += " --out out --no-usd --no-pictures --no-view"
pytestmark = pytest.mark.skipif(os.name != "posix", reason="shells of POSIX")


def shell(command, folder):
    return subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("where", ["2>&-", "<&- >&- 2>&-", "> /dev/full 2>&1", "> >(true) 2> >(true)"])
def test_a_run_ends_with_its_summary_wherever_its_lines_go(where, tmp_path):
    done = shell(f"{RUN} {where}", tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))["status"] == "finished"
    assert "Traceback" not in done.stdout + done.stderr


def test_a_list_on_a_full_disk_is_one_line(tmp_path):
    done = shell(f"{sys.executable} -m warp_pd list > /dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr.strip() == "warp-pd: [Errno 28] No space left on device"


def test_nohup_keeps_a_run_alive(tmp_path):
    """The signal of a lost terminal is ignored where the caller ignores it."""
    code = (
        "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN);"
        "from warp_pd import *; from helpers import NEO, square; sheet = square(7);"
        "hang_up = lambda built, frame: float(bool(os.kill(os.getpid(), signal.SIGHUP)));"
        "measures = [Measure('x', 'm', hang_up)];"
        "scene = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=2), measures=measures);"
        "print(scene.run(device='cpu').status)"
    )
    path = os.pathsep.join(sys.path)
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "finished" and signal.SIGHUP == 1
