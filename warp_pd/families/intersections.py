"""Intersections of families that have a row for each point, by kernels on all cores of the host."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import warp as wp

from ..cores import available_cores, cores, start_warp
from ..kernels.effects import Kernel
from ..kernels.families import WORD
from ..kernels.intersections import common_members, intersection_shapes

# Fewest rows that are worth a thread.
ROWS = 4096


def common_by_row(bonds: np.ndarray, exists: np.ndarray, tolerance: float, horizons: np.ndarray | None) -> np.ndarray:
    """Masks of the intersections, uint32, shape (R, n, words).

    Args:
        bonds: X / horizon, shape (R, n, 2) or (R, n, 3).
        exists: Which members exist, the first ones of each row, shape (R, n).
        tolerance: Relative tolerance of the horizon.
        horizons: Of the members over the horizon, shape (R, n), on graded sheets.
    """
    (rows, n), dimension = exists.shape, bonds.shape[2]
    common = np.zeros((rows, n, -(-n // WORD)), np.uint32)
    read = [
        _on_host(bonds, wp.types.vector(length=dimension, dtype=wp.float64)),
        None if horizons is None else _on_host(horizons, wp.float64),
        _sizes(exists),
        (1.0 + tolerance) ** 2,
    ]
    _run(common_members(dimension, horizons is not None), rows, read, [_on_host(common, wp.uint32)])
    return common


def shapes_by_row(
    bonds: np.ndarray, shares: np.ndarray, areas: np.ndarray, exists: np.ndarray, common: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse shape tensors, shape (R, n, 3), and sizes, shape (R, n), as of `Families.inverse_shapes`.

    Args:
        bonds: X / horizon, shape (R, n, 2).
        shares: c_k, shape (R, n).
        areas: Areas of the members, shape (R, n).
        exists: Which members exist, the first ones of each row, shape (R, n).
        common: Masks of the intersections, shape (R, n, words).
    """
    rows, n = exists.shape
    inverse, size = np.empty((rows, n, 3)), np.empty((rows, n))
    read = [
        _on_host(bonds, wp.vec2d), _on_host(shares, wp.float64), _on_host(areas, wp.float64), _sizes(exists),
        _on_host(common, wp.uint32),
    ]  # fmt: skip
    _run(intersection_shapes(), rows, read, [_on_host(inverse, wp.vec3d), _on_host(size, wp.float64)])
    return inverse, size


def _on_host(values: np.ndarray, dtype: Any) -> Any:
    """The same memory as a Warp array."""
    start_warp()
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)


def _sizes(exists: np.ndarray) -> Any:
    return _on_host(exists.sum(axis=1).astype(np.int32), wp.int32)


def _run(kernel: Kernel, rows: int, read: list[Any], written: list[Any]) -> None:
    parts = min(available_cores(), max(1, rows // ROWS))
    bounds = np.linspace(0, rows, parts + 1).astype(int)
    commands: list[Any] = [
        wp.launch(
            kernel.kernel, dim=int(end - begin), inputs=[*read, int(begin), *written], device="cpu", record_cmd=True
        )
        for begin, end in itertools.pairwise(bounds)
    ]
    for _ in cores().map(lambda command: command.launch(), commands):
        pass
