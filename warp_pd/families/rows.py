"""Tables of families with one row per point, computed by kernels on all cores of the host."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import warp as wp

from ..device.cores import available_cores, cores, load_kernel, start_warp
from ..kernels.families import WORD
from ..kernels.intersections import common_members, intersection_shapes

# Fewest rows that are worth a thread.
ROWS = 4096


def common_by_row(bonds: np.ndarray, exists: np.ndarray, tolerance: float, horizons: np.ndarray | None) -> np.ndarray:
    """Masks of the intersections, uint32, shape (R, n, words).

    Args:
        bonds: X / horizon, shape (R, n, 2) or (R, n, 3).
        exists: Mask of existing members, which come first in each row, shape (R, n).
        tolerance: Relative tolerance of the horizon.
        horizons: Horizons of the members divided by the horizon, shape (R, n), on graded sheets; otherwise None.
    """
    (rows, n), dimension = exists.shape, bonds.shape[2]
    common = np.zeros((rows, n, -(-n // WORD)), np.uint32)
    read = [
        _on_host(bonds, wp.types.vector(length=dimension, dtype=wp.float64)),
        None if horizons is None else _on_host(horizons, wp.float64),
        _sizes(exists),
        (1.0 + tolerance) ** 2,
    ]
    _run_on_host(common_members(dimension, horizons is not None), rows, read, [_on_host(common, wp.uint32)])
    return common


def shapes_by_row(
    bonds: np.ndarray, influence: np.ndarray, areas: np.ndarray, exists: np.ndarray, common: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse shape tensors, shape (R, n, 3), and sizes, shape (R, n), as for `Families.inverse_shapes`.

    Bonds are X / horizon, shape (R, n, 2), `common` the masks of the intersections, shape (R, n, words); influence,
    areas and `exists` of the members have shape (R, n). Existing members come first in each row.
    """
    rows, n = exists.shape
    inverse, size = np.empty((rows, n, 3)), np.empty((rows, n))
    read = [
        _on_host(bonds, wp.vec2d), _on_host(influence, wp.float64), _on_host(areas, wp.float64), _sizes(exists),
        _on_host(common, wp.uint32),
    ]  # fmt: skip
    _run_on_host(intersection_shapes(), rows, read, [_on_host(inverse, wp.vec3d), _on_host(size, wp.float64)])
    return inverse, size


def _sizes(exists: np.ndarray) -> Any:
    return _on_host(exists.sum(axis=1).astype(np.int32), wp.int32)


def _on_host(values: np.ndarray, dtype: Any) -> Any:
    """Wrap a NumPy array as a Warp array on the same memory."""
    start_warp()
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)


def _run_on_host(kernel: wp.Kernel, rows: int, read: list[Any], written: list[Any]) -> None:
    """Run a kernel with the given inputs and outputs for `rows` rows on all cores."""
    parts = min(available_cores(), max(1, rows // ROWS))
    bounds = np.linspace(0, rows, parts + 1).astype(int)
    load_kernel(kernel, wp.get_device("cpu"))
    commands: list[Any] = [
        wp.launch(kernel, dim=int(end - begin), inputs=[*read, int(begin), *written], device="cpu", record_cmd=True)
        for begin, end in itertools.pairwise(bounds)
    ]
    for _ in cores().map(lambda command: command.launch(), commands):
        pass
