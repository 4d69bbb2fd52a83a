"""One sheet on several GPUs, one a process: the same bits as on one."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import shared_scenes
import warp as wp
from shared_scenes import SCENES, arrays_of, run_all, started

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
    with ThreadPoolExecutor(1) as pool:
        # At once, since most of the time is compilation.
        two = pool.submit(started, 2, FILE, "cuda", tmp_path / "two", *SCENES)
        run_all("cuda:0", tmp_path, SCENES)
    done = two.result()
    assert done.returncode == 0, done.stderr
    for name in SCENES:
        assert not differences(tmp_path / name, tmp_path / "two" / name), name
