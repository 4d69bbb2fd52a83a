"""One sheet on several GPUs, one a process: the same bits as on one."""

import os
from pathlib import Path

import numpy as np
import pytest
import shared_scenes
import warp as wp
from shared_scenes import SCENES, arrays_of, scene, started

from warp_pd import Frames

pytest.importorskip("torch.distributed")

FILE = Path(shared_scenes.__file__)


def differences(folder, other):
    """Names of what two runs have left and is not the same."""
    (arrays, history, size), (others, other_history, other_size) = arrays_of(folder), arrays_of(other)
    assert arrays.keys() == others.keys()
    found = [name for name, values in arrays.items() if not np.array_equal(values, others[name])]
    return found + ["history"] * (history != other_history) + ["frames"] * (size != other_size)


@pytest.mark.gpu
@pytest.mark.skipif(wp.get_cuda_device_count() < 2, reason="needs two GPUs")
def test_two_gpus_leave_the_same_bits(tmp_path):
    done = started(2, FILE, "cuda", tmp_path / "two", *SCENES)
    assert done.returncode == 0, done.stderr
    for name, precision in SCENES.items():
        scene(name).run(device="cuda:0", precision=precision, out=tmp_path / name, usd=False)
    for name in SCENES:
        assert not differences(tmp_path / name, tmp_path / "two" / name), name


# Every process writes its own points, as of a large sheet.
DIVIDED = """
import sys
from pathlib import Path
from shared_scenes import run_all
from warp_pd.run import files

files.GATHERED = 0

if __name__ == "__main__":
    run_all("cuda", Path(sys.argv[1]), ["torn", "body"])
"""


@pytest.mark.gpu
@pytest.mark.skipif(wp.get_cuda_device_count() < 2, reason="needs two GPUs")
def test_two_gpus_write_the_same_frames_in_parts(tmp_path, monkeypatch):
    script = tmp_path / "divided.py"
    script.write_text(DIVIDED)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(FILE.parent), os.environ.get("PYTHONPATH", "")]))
    done = started(2, script, tmp_path / "two")
    assert done.returncode == 0, done.stderr
    for name in ("torn", "body"):
        scene(name).run(device="cuda:0", precision=SCENES[name], out=tmp_path / name, usd=False)
        assert (tmp_path / "two" / name / "parts").is_dir()
        for one, other in zip(Frames(tmp_path / name), Frames(tmp_path / "two" / name), strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)
            np.testing.assert_array_equal(one.triangles, other.triangles)
            for field, values in one.fields.items():
                np.testing.assert_array_equal(values, other[field], err_msg=f"{name}: {field}")
