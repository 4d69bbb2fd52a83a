"""One sheet on several GPUs, one a process: the same bits as on one, but for the energy of broken bonds."""

import csv
from pathlib import Path

import numpy as np
import pytest
import shared_scenes
import warp as wp
from shared_scenes import SCENES, arrays_of, scene, started

pytest.importorskip("torch.distributed")

FILE = Path(shared_scenes.__file__)
# One GPU breaks bonds in the kernel of the force, several in one of their own: the energy of what broke, a difference
# of energies of families, has other round-off.
ROUNDED = {32: 1e-4, 64: 1e-9}


def close(one, other, precision):
    """Whether two sets of numbers differ by round-off alone."""
    one, other = (np.asarray(values, np.float64) for values in (one, other))
    return np.abs(one - other).max() <= ROUNDED[precision] * np.abs(one).max()


def differences(folder, other, precision):
    """Names of what two runs have left and is not the same."""
    (arrays, _, size), (others, _, other_size) = arrays_of(folder), arrays_of(other)
    assert arrays.keys() == others.keys()
    found = [name for name, values in arrays.items() if name != "released" and not np.array_equal(values, others[name])]
    if "released" in arrays and not close(arrays["released"], others["released"], precision):
        found.append("released")
    for name in ("history.csv", "fine_history.csv"):
        if (folder / name).exists():
            rows, other_rows = (list(csv.DictReader((place / name).open())) for place in (folder, other))
            assert len(rows) == len(other_rows) and rows[0].keys() == other_rows[0].keys()
            work = max(abs(float(row["external"])) for row in rows)
            largest = {"rupture": work, "balance_error": 1.0}
            for column in rows[0]:
                pair = [[row[column] for row in table] for table in (rows, other_rows)]
                rounded = column in largest and np.allclose(
                    *(np.asarray(values, float) for values in pair), rtol=0.0, atol=ROUNDED[precision] * largest[column]
                )
                found += [f"{name}: {column}"] * (pair[0] != pair[1] and not rounded)
    return found + ["frames"] * (size != other_size)


@pytest.mark.gpu
@pytest.mark.skipif(wp.get_cuda_device_count() < 2, reason="needs two GPUs")
def test_two_gpus_leave_the_same_bits(tmp_path):
    done = started(2, FILE, "cuda", tmp_path / "two", *SCENES)
    assert done.returncode == 0, done.stderr
    for name, precision in SCENES.items():
        scene(name).run(device="cuda:0", precision=precision, out=tmp_path / name, usd=False)
    for name, precision in SCENES.items():
        assert not differences(tmp_path / name, tmp_path / "two" / name, precision), name
