"""Intersections of families with one row per point, computed by kernels on all cores of the host."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..kernels.families import WORD
from ..kernels.intersections import common_members, intersection_shapes
from .host_kernels import on_host, run_on_host


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
        on_host(bonds, wp.types.vector(length=dimension, dtype=wp.float64)),
        None if horizons is None else on_host(horizons, wp.float64),
        _sizes(exists),
        (1.0 + tolerance) ** 2,
    ]
    run_on_host(common_members(dimension, horizons is not None), rows, read, [on_host(common, wp.uint32)])
    return common


def shapes_by_row(
    bonds: np.ndarray, influence: np.ndarray, areas: np.ndarray, exists: np.ndarray, common: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse shape tensors, shape (R, n, 3), and sizes, shape (R, n), as for `Families.inverse_shapes`.

    Args:
        bonds: X / horizon, shape (R, n, 2).
        influence: w, shape (R, n).
        areas: Areas of the members, shape (R, n).
        exists: Mask of existing members, which come first in each row, shape (R, n).
        common: Masks of the intersections, shape (R, n, words).
    """
    rows, n = exists.shape
    inverse, size = np.empty((rows, n, 3)), np.empty((rows, n))
    read = [
        on_host(bonds, wp.vec2d), on_host(influence, wp.float64), on_host(areas, wp.float64), _sizes(exists),
        on_host(common, wp.uint32),
    ]  # fmt: skip
    run_on_host(intersection_shapes(), rows, read, [on_host(inverse, wp.vec3d), on_host(size, wp.float64)])
    return inverse, size


def _sizes(exists: np.ndarray) -> Any:
    return on_host(exists.sum(axis=1).astype(np.int32), wp.int32)
