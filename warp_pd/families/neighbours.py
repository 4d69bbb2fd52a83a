"""Neighbour lists, computed by a kernel on all cores of the host."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..kernels.neighbours import near_points, reverse_members
from .host_kernels import on_host, run_on_host

# Most cells for each point: the points may fill little of the box around them.
CELLS = 4.0


def near_by_row(points: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours within a distance [m], ascending (-1: none), and their reverse indices (0: none), int32, (N, n)."""
    size, low = len(points), points.min(axis=0)
    extent = np.maximum(np.ptp(points, axis=0), distance)
    edge = max(distance, float(np.sqrt(extent.prod() / (CELLS * size))))
    places = (points - low) / edge
    cells = places.astype(np.int64)
    columns, rows = (cells.max(axis=0) + 1).tolist()
    cell = cells[:, 1] * columns + cells[:, 0]
    starts = np.zeros(columns * rows + 1, np.int32)
    np.cumsum(np.bincount(cell, minlength=columns * rows), out=starts[1:])
    order = np.argsort(cell, kind="stable").astype(np.int32)
    read = [
        on_host(places, wp.vec2d), on_host(order, wp.int32), on_host(starts, wp.int32), columns, rows,
        (distance / edge) ** 2,
    ]  # fmt: skip
    sizes = np.empty(size, np.int32)
    run_on_host(near_points(True), size, read, [on_host(sizes, wp.int32), None])
    near = np.empty((size, int(sizes.max())), np.int32)
    run_on_host(near_points(False), size, read, [None, on_host(near, wp.int32)])
    reverses = np.empty_like(near)
    run_on_host(
        reverse_members(), size, [on_host(near, wp.int32), on_host(sizes, wp.int32)], [on_host(reverses, wp.int32)]
    )
    return near, reverses
