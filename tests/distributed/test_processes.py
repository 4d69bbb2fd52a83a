"""One sheet on several processes of torchrun: the same bits, errors in one line, killed processes."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import shared_scenes
from helpers import refused
from shared_scenes import arrays_of, run_all, scene, started

from warp_pd import Frames
from warp_pd.distributed.launch import launch

pytest.importorskip("torch.distributed")

FILE = Path(shared_scenes.__file__)
# More kinds are in `shared_scenes`.
COMPARED = (
    "torn", "cloud", "field hole", "loads", "scattered", "energy", "field", "field cloud", "field relaxed", "taut",
)  # fmt: skip


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Folder of a scene run by one process."""
    folder = tmp_path_factory.mktemp("alone")
    made = {}

    def run(name):
        if name not in made:
            made[name] = folder / name
            run_all("cpu", folder, [name])
        return made[name]

    return run


def require_same_run(folder, other):
    """Arrays of the restart file and history of two runs, bit for bit; the arrays."""
    (arrays, history, _), (others, other_history, _) = map(arrays_of, (folder, other))
    assert arrays.keys() == others.keys() >= {"displacement", "velocity", "direction"}
    for field, values in arrays.items():
        np.testing.assert_array_equal(values, others[field], err_msg=f"{folder.name}: {field}")
    assert history == other_history, folder.name
    return arrays


def test_three_processes_leave_the_same_bits(alone, tmp_path):
    expected = {name: alone(name) for name in COMPARED}
    done = started(3, FILE, "cpu", tmp_path, *COMPARED)
    assert done.returncode == 0, done.stderr
    for name, folder in expected.items():
        arrays = require_same_run(folder, tmp_path / name)
        assert np.abs(arrays["displacement"]).max() > 0.05
        assert arrays_of(folder)[2] == arrays_of(tmp_path / name)[2], name
    # Every fifth column and row of both, gathered from three processes.
    for one, other in zip(Frames(expected["torn"]), Frames(tmp_path / "torn"), strict=True):
        assert len(one.positions) == 8 * 8
        np.testing.assert_array_equal(one.triangles, other.triangles)
        for field in ("displacement", "damage"):
            np.testing.assert_array_equal(one[field], other[field])


@pytest.mark.parametrize("name", ["torn", "field"])
def test_the_scenes_that_are_compared_tear(name, alone):
    names, *rows = (line.split(",") for line in arrays_of(alone(name))[1].splitlines())
    assert float(rows[-1][names.index("mean_damage")]) - float(rows[0][names.index("mean_damage")]) > 0.01


def test_a_frame_of_the_scenes_that_are_compared_is_computed_again(alone):
    assert json.loads((alone("taut") / "summary.json").read_text())["repeated"] > 0


def command(processes, folder, *more):
    """The command warp-pd run of a sheet that tears for a while."""
    settings = ["--set", "name=field", "--set", "frames=10", "--no-usd", "--no-pictures", "--quiet"]
    arguments = ["run", FILE, "--device", "cpu", "--out", folder, "--processes", processes, *settings, *more]
    return [sys.executable, "-m", "warp_pd", *map(str, arguments)]


def rows(folder):
    """Number of frames in a history that is being written."""
    try:
        return len((folder / "history.csv").read_text().splitlines()) - 1
    except FileNotFoundError:
        return 0


def workers(launcher):
    """The processes that a process started."""
    listed = Path(f"/proc/{launcher}/task/{launcher}/children").read_text(encoding="utf-8")
    return sorted(map(int, listed.split()))


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the processes in /proc")
def test_a_killed_process_ends_all_and_another_number_of_processes_goes_on(tmp_path, joined_stages):
    """In the middle of a tear; what two processes began and three ended is what one gives, with joined stages."""
    killed, complete = tmp_path / "killed", tmp_path / "complete"
    shared_scenes.build("field", frames=10).run(device="cpu", out=complete, usd=False, pictures=False)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    running = subprocess.Popen(command(2, killed), stderr=subprocess.PIPE, text=True, env=environment)
    until = time.monotonic() + 120.0
    while rows(killed) < 4:
        assert running.poll() is None and time.monotonic() < until, running.stderr.read()
        time.sleep(0.05)
    os.kill(workers(running.pid)[1], signal.SIGKILL)
    _, said = running.communicate(timeout=60.0)
    assert running.returncode == 4
    assert re.fullmatch(r"warp-pd: process [01] was ended by SIGKILL; continue with --resume\n", said)
    assert not (killed / "summary.json").exists()
    with h5py.File(killed / "frames.vtkhdf") as frames:
        assert len(frames["VTKHDF/Steps/Values"]) >= 4
    before = arrays_of(killed)[0]["damage_field"]
    again = subprocess.run(command(3, killed, "--resume"), capture_output=True, text=True, check=False, env=environment)
    assert again.returncode == 0, again.stderr
    after = require_same_run(complete, killed)["damage_field"]
    assert json.loads((killed / "summary.json").read_text())["status"] == "finished"
    assert ((before > 0.1) & (before < 0.7)).any() and (after > before).sum() > 20


BROKEN = """
from dataclasses import dataclass
from shared_scenes import scene
from warp_pd import InputError
from warp_pd.interfaces import BuiltPart, Columns, Part

class BuiltFailing(BuiltPart):
    # The first process alone asks for columns of the history.
    def columns(self):
        return Columns(at_frame=self.fail)

    def fail(self, totals, elapsed):
        if elapsed > 0.0:
            raise InputError("failing: expected no second frame")
        return {}

@dataclass(frozen=True)
class Failing(Part):
    divides = True

    def build(self, context, law):
        return BuiltFailing()

def build():
    made = scene("torn")
    made.loads = [*made.loads, Failing()]
    return made
"""


def test_an_error_in_one_process_ends_all_with_its_line(tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN)
    arguments = ["run", tmp_path / "broken.py", "--device", "cpu", "--out", tmp_path / "out", "--quiet"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(FILE.parent), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        [sys.executable, "-m", "warp_pd", *map(str, arguments), "--processes", "2"],
        capture_output=True, text=True, check=False, env=environment, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    lines = done.stderr.strip().splitlines()
    assert lines == ["warp-pd: failing: expected no second frame"]


ALONE = """
import sys
from shared_scenes import scene
scene("torn", points=9, frames=1).run(device="cpu")
assert not [name for name in sys.modules if name.split(".")[0] == "torch"]
"""


@pytest.mark.parametrize(
    ("gpus", "processes", "device", "text"),
    [
        (1, 10**6, "cpu", "processes = 1000000: expected at most"),
        (10**6, 1, None, "gpus = 1000000: expected at most"),
        (2, 2, None, "gpus = 2, processes = 2: expected only one of them"),
        (2, 1, "cpu", "gpus = 2, device = 'cpu': expected only one of them"),
    ],
)
def test_more_than_the_machine_has_is_refused_before_anything_starts(gpus, processes, device, text):
    with refused(text):
        launch(gpus, processes, device, [])


def test_a_refused_run_leaves_no_folder_but_one_that_was_there(tmp_path):
    new, old = tmp_path / "new", tmp_path / "old"
    old.mkdir()
    for folder in (new, old):
        with refused(match="device = 'foo'"):
            scene("torn", points=9).run(device="foo", out=folder)
    assert not new.exists() and list(old.iterdir()) == []


def test_one_process_imports_no_torch():
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(FILE.parent), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        [sys.executable, "-c", ALONE], capture_output=True, text=True, check=False, env=environment, timeout=120
    )
    assert done.returncode == 0, done.stderr
