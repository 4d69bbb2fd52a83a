"""Rectangles and bars with regular, rotated or jittered grids."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError, count, counts, finite, one_of, positive, vector
from .clouds import cloud
from .shape import Shape
from .triangulation import Lattice, lattice_triangles, turned_grid

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


def filled(
    width: float,
    height: float,
    points: int | tuple[int, int],
    origin: tuple[float, float],
    layers: tuple[int, int],
    *,
    turn: float,
    jitter: float,
    seed: int,
) -> Shape:
    """A rectangle with a turned or jittered grid inside; arguments as for `Sheet.filled`."""
    count("seed", seed, 0)
    square = rectangle(width, height, points, origin, layers, False)
    if not 0.0 <= finite("jitter", jitter) < 0.5:
        raise InputError(f"jitter = {jitter!r}: expected a fraction of the spacing, at least 0 and less than 0.5")
    if finite("turn", turn) % 90.0 == 0.0 and jitter == 0.0:
        return square
    assert square.lattice is not None
    dx, dy = square.lattice.dx, square.lattice.dy
    low, high = square.points.min(axis=0), square.points.max(axis=0)
    # The middle of the sheet is a point of the grid, or the middle of a cell, as it is without a turn.
    half = 0.5 * (np.array([square.lattice.columns, square.lattice.rows]) - 1) % 1.0
    inside = turned_grid((dx, dy), half, float(np.hypot(*(high - low))), turn)
    inside += np.random.default_rng(seed).uniform(-jitter, jitter, inside.shape) * (dx, dy)
    inside += 0.5 * (low + high)
    # Points lie on the outer edges, and on those of the rectangle where layers continue it: what is held beyond them
    # would otherwise end up to half a spacing away.
    beyond = np.array(layers) * (dx, dy)
    on_line = np.zeros(square.size, bool)
    for line in (low, high, low + beyond, high - beyond):
        on_line |= (np.abs(square.points - line) < 1e-6 * square.spacing).any(axis=1)
        inside = inside[(np.abs(inside - line) > 0.55 * np.array([dx, dy])).all(axis=1)]
    inside = inside[((inside > low) & (inside < high)).all(axis=1)]
    return cloud(np.vstack([square.points[on_line], inside]), None, None, square.spacing)
