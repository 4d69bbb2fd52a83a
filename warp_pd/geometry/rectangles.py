"""Rectangles and bars with regular, rotated or jittered grids."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError, count, counts, one_of, positive, vector
from .shape import Shape
from .triangulation import Lattice, lattice_triangles

# Points are counted in 32 bits.
MAX_POINTS = 2**31 - 1


def rectangle(
    width: float,
    height: float,
    points: int | tuple[int, int],
    origin: tuple[float, float],
    layers: tuple[int, int],
    centred: bool,
    areas: str = "shared",
) -> Shape:
    """A rectangle on a regular grid; arguments as for `Sheet.rectangle`."""
    width, height = positive("width", width), positive("height", height)
    one_of("centred", centred, (True, False))
    one_of("areas", areas, ("shared", "whole"))
    if not 1.0 / MAX_POINTS < height / width < MAX_POINTS:
        raise InputError(f"width = {width:g}, height = {height:g}: expected sides that the points can both resolve")
    x0, y0 = vector("origin", origin, 2)
    if isinstance(points, tuple | list):
        columns, rows = counts("points", points, 3)
    else:
        columns = count("points", points, 3)
        rows = max(3, round(height / width * (columns - 1)) + 1)
    if centred:
        dx = width / columns
        rows = rows if isinstance(points, tuple | list) else max(3, round(height / dx))
        dy = height / rows
        x0, y0 = x0 + 0.5 * dx, y0 + 0.5 * dy
    else:
        dx, dy = width / (columns - 1), height / (rows - 1)
    across, along = counts("layers", layers, 0)
    columns, rows, x0, y0 = columns + 2 * across, rows + 2 * along, x0 - across * dx, y0 - along * dy
    if columns * rows > MAX_POINTS:
        raise InputError(
            f"points = {points!r} with layers = {layers!r}, {columns} x {rows} in all: expected at most {MAX_POINTS}"
        )
    x, y = x0 + dx * np.arange(columns), y0 + dy * np.arange(rows)
    width_x, width_y = np.full(columns, dx), np.full(rows, dy)
    if not centred and areas == "shared":
        width_x[[0, -1]] *= 0.5
        width_y[[0, -1]] *= 0.5
    return Shape(
        points=np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1).reshape(-1, 2),
        areas=(width_y[:, None] * width_x).ravel(),
        triangles=lattice_triangles(columns, rows),
        spacing=float(np.sqrt(dx * dy)),
        lattice=Lattice(columns, rows, dx, dy),
    )


def line(length: float, points: int) -> Shape:
    """One row of points; arguments as for `Sheet.line`."""
    spacing = positive("length", length) / count("points", points, 3)
    if points > MAX_POINTS:
        raise InputError(f"points = {points!r}: expected at most {MAX_POINTS}")
    return Shape(
        points=np.column_stack([spacing * (np.arange(points) + 0.5), np.zeros(points)]),
        areas=np.full(points, spacing),
        triangles=np.zeros((0, 3), np.int32),
        spacing=spacing,
        lattice=Lattice(points, 1, spacing, spacing),
    )
