"""Frames and restart files of which every process writes what it owns: the same bits, on any number of processes."""

import itertools
import json
import os
from pathlib import Path

import h5py
import numpy as np
import pytest
import shared_scenes
from shared_scenes import DURATION, scene, started

from warp_pd import Frames, InputError
from warp_pd.run import files, restart

pytest.importorskip("torch.distributed")

# Runs a scene up to some of its frames: FOLDER FRAMES STRIDE [resume]. With "kill" the second process dies in frame 3.
SCRIPT = """
import os
import signal
import sys
from dataclasses import replace
from shared_scenes import DURATION, scene
import warp_pd.run.files as files
from warp_pd.output.vtkhdf import VtkHdfSeries

files.GATHERED = 0
add = VtkHdfSeries._add

def die(series, file, frame, fields):
    if frame.index == 3:
        file["VTKHDF/Points"].resize(len(file["VTKHDF/Points"]) + 5, axis=0)
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)
    add(series, file, frame, fields)

if __name__ == "__main__":
    folder, frames, stride, *more = sys.argv[1:]
    if "kill" in more and os.environ["RANK"] == "1":
        VtkHdfSeries._add = die
    made = scene("torn")
    made.solver = replace(made.solver, duration=0.25 * DURATION * int(frames), frames=int(frames))
    made.run(device="cpu", out=folder, usd=False, stride=int(stride), resume="resume" in more)
"""


@pytest.fixture
def script(tmp_path, monkeypatch):
    path = tmp_path / "begun.py"
    path.write_text(SCRIPT)
    places = [str(Path(shared_scenes.__file__).parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(places))
    return path


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone") / "torn"
    assert scene("torn", frames=4).run(device="cpu", out=folder, usd=False).status == "finished"
    return folder


def require_same(folder, expected):
    found, wanted = Frames(folder), Frames(expected)
    assert found.fields == wanted.fields and found.points == wanted.points
    np.testing.assert_array_equal(found.times, wanted.times)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.triangles, other.triangles)
        assert one.triangles.dtype == other.triangles.dtype
        for name in wanted.fields:
            assert one[name].dtype == other[name].dtype
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    assert (folder / "history.csv").read_text() == (expected / "history.csv").read_text()


def state_of(folder):
    """All arrays of a restart file."""
    with np.load(folder / "restart.npz") as stored:
        found = {name: stored[name] for name in stored.files}
    numbers = json.loads(bytes(found.pop("numbers")))
    parts = [restart.Part(p["file"], tuple(p["points"]), tuple(p["faces"])) for p in numbers.get("files", ())]
    for name in numbers.get("divided", ()):
        rows = []
        for part in parts:
            with h5py.File(folder / part.file) as file:
                rows.append(file[name][:])
        found[name] = np.concatenate(rows, axis=int(rows[0].shape[0] < parts[0].points[1] - parts[0].points[0]))
    return found


def test_frames_and_restart_files_of_2_processes_one_killed_then_of_4_have_the_bits_of_one(script, alone, tmp_path):
    folder = tmp_path / "out"
    assert started(2, script, folder, 4, 1, "kill").returncode != 0
    # Half of frame 3 is on the disk; nobody sees it.
    begun, whole = Frames(folder), Frames(alone)
    assert len(begun) == 3
    np.testing.assert_array_equal(begun[2].positions, whole[2].positions)
    done = started(4, script, folder, 4, 1, "resume")
    assert done.returncode == 0, done.stderr
    # Both runs wrote their own files; those of earlier restarts are gone.
    names = sorted(path.name for path in (folder / "parts").iterdir())
    assert [name for name in names if name.startswith("restart")] == [f"restart.4.{rank}.h5" for rank in range(4)]
    assert sum(name.startswith("frames") for name in names) == 2 + 4
    require_same(folder, alone)
    found, expected = state_of(folder), state_of(alone)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(values, found[name], err_msg=name)
    assert np.abs(found["displacement"]).max() > 0.05 and Frames(folder)[-1]["damage"].max() > 0.0
    summary = json.loads((folder / "summary.json").read_text())
    assert any(note.startswith("pictures: not written for more than") for note in summary["notes"])
    # What lacks a part does not look whole.
    lost = folder / "parts" / names[0]
    lost.rename(tmp_path / "lost")
    with pytest.raises(InputError, match=r"a part of the points, is missing"):
        Frames(folder)


def test_one_process_goes_on_where_several_stopped(script, alone, tmp_path, monkeypatch):
    folder = tmp_path / "out"
    done = started(2, script, folder, 2, 1)
    assert done.returncode == 0, done.stderr
    monkeypatch.setattr(files, "GATHERED", 0)
    made = scene("torn", frames=4)
    assert made.solver.duration == DURATION
    made.run(device="cpu", out=folder, usd=False, resume=True)
    require_same(folder, alone)
    for name, values in state_of(alone).items():
        np.testing.assert_array_equal(values, state_of(folder)[name], err_msg=name)
    assert not list((folder / "parts").glob("restart.*"))
    # A new run leaves nothing of this one.
    scene("torn", frames=1).run(device="cpu", out=folder, usd=False, overwrite=True)
    assert not (folder / "parts").exists() and len(Frames(folder)) == 2


def test_a_frame_that_not_all_processes_wrote_is_not_seen(script, alone, tmp_path):
    folder = tmp_path / "out"
    assert started(2, script, folder, 2, 1).returncode == 0
    # As if the processes had been killed while the second of them wrote a frame.
    with h5py.File(folder / "parts" / "frames.0.1.vtkhdf", "r+") as part:
        steps = part["VTKHDF/Steps"]
        steps["Values"].resize(2, axis=0)
        steps.attrs.modify("NSteps", 2)
    with pytest.raises(InputError, match="less than 3 frames"):
        Frames(folder)


def test_frames_of_every_fifth_column_and_row(script, alone, tmp_path):
    folder = tmp_path / "out"
    done = started(2, script, folder, 2, 5)
    assert done.returncode == 0, done.stderr
    resumed = [scene("torn", frames=4).run(device="cpu", out=folder, usd=False, resume=True, stride=5)]
    found, whole = Frames(folder), Frames(alone)
    places = np.append(np.arange(0, 33, 5), 32)
    kept = (33 * places[:, None] + places).ravel()
    assert found.points == len(kept) and len(found) == 5 and resumed[0].frame.displacement.shape == (len(kept), 3)
    for some, every in zip(found, whole, strict=True):
        np.testing.assert_array_equal(some.positions, every.positions[kept])
        for name in whole.fields:
            np.testing.assert_array_equal(some[name], every[name][kept], err_msg=name)
        require_torn_where_the_sheet_is(some.triangles, every.triangles, places)
    assert len(found[-1].triangles) < len(found[0].triangles) < 2 * (len(places) - 1) ** 2
    # Measures see all points.
    assert (folder / "history.csv").read_text() == (alone / "history.csv").read_text()
    with pytest.raises(InputError, match="stride = 4: expected 5"):
        scene("torn", frames=4).run(device="cpu", out=folder, usd=False, resume=True, stride=4)


def require_torn_where_the_sheet_is(coarse, fine, places):
    """Cells of the coarser lattice have both triangles where all triangles of the sheet in them are intact, or none."""
    intact = np.zeros((32, 32), int)
    row, column = np.divmod(fine, 33)
    np.add.at(intact, (row.min(axis=1), column.min(axis=1)), 1)
    there = np.zeros((len(places) - 1,) * 2, int)
    row, column = np.divmod(coarse, len(places))
    np.add.at(there, (row.min(axis=1), column.min(axis=1)), 1)
    for k, (low, high) in enumerate(itertools.pairwise(places)):
        for j, (left, right) in enumerate(itertools.pairwise(places)):
            assert there[k, j] == (2 if (intact[low:high, left:right] == 2).all() else 0)


def test_a_cloud_has_whole_frames():
    with pytest.raises(InputError, match="stride = 2: expected 1 for a sheet that is not a lattice"):
        scene("cloud").run(device="cpu", stride=2)
