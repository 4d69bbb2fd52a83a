"""The triangles and rectangles of a sheet around each point, for pressure on its surface."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device.checks import InputError
from ..device.result_cache import ResultCache
from .sheet import Shape
from .triangulation import corner_sums, doubled_normals, vector_sums, voronoi_areas

# How far four points may be from a rectangle, over its diagonal.
SKEW = 1e-6
# Relative difference of areas that counts as none.
SAME = 1e-6


def rectangles(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of triangles with a common hypotenuse that are rectangles: their indices (Q, 2), and corners (Q, 4).

    Corners are in order; the first and third are the ends of the hypotenuse, the second belongs to the other triangle.
    """
    size = int(triangles.max(initial=0)) + 1
    corners = triangles.astype(np.int64)
    tail, head, apex = (np.roll(corners, -k, axis=1).ravel() for k in range(3))
    key, reverse = tail * size + head, head * size + tail
    order = np.argsort(key)
    at = order[np.searchsorted(key[order], reverse).clip(max=len(key) - 1)]
    # Each pair once.
    one = np.flatnonzero((key[at] == reverse) & (tail < head))
    other = at[one]
    a, b, c, d = (positions[k] for k in (tail[one], head[one], apex[one], apex[other]))
    diagonal = np.linalg.norm(b - a, axis=1)
    skew = np.linalg.norm(a + b - c - d, axis=1) + np.abs(np.linalg.norm(d - c, axis=1) - diagonal)
    one, other = one[skew < SKEW * diagonal], other[skew < SKEW * diagonal]
    return np.column_stack([one, other]) // 3, np.column_stack([tail[one], apex[other], head[one], apex[one]])


def other_diagonals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangulation with the other diagonal in every rectangle; without any rectangle the same array."""
    pairs, corners = rectangles(positions, triangles)
    if len(pairs) == 0:
        return triangles
    turned = triangles.copy()
    turned[pairs[:, 0]] = corners[:, [0, 1, 3]]
    turned[pairs[:, 1]] = corners[:, [1, 2, 3]]
    return turned


# Cells of equal sheets, from run to run.
CELLS = ResultCache()


def cells_of(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Rectangles and the other triangles, whose last corner comes twice, int32, shape (C, 4)."""
    return CELLS.result(_cells_of, positions, triangles)


def _cells_of(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    pairs, corners = rectangles(positions, triangles)
    alone = np.delete(triangles, pairs.ravel(), axis=0)
    return np.concatenate([corners.astype(np.int32), alone[:, [0, 1, 2, 2]].astype(np.int32)])


def cells_at_points(cells: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The cells (`cells_of`) of every point.

    Returns:
        Where the entries of each point begin, shape (N + 1,), and the other three corners, in order, shape (E, 3); of a
        triangle the last comes twice; both int32.
    """
    around = np.stack([np.roll(cells, -k, axis=1) for k in range(4)], axis=1)
    lone = cells[:, 2] == cells[:, 3]
    # From the corners of a triangle a b c: b c c, c a a, a b b.
    around[lone, 1] = cells[lone][:, [1, 2, 0, 0]]
    around[lone, 2] = cells[lone][:, [2, 0, 1, 1]]
    there = np.ones((len(cells), 4), bool)
    there[lone, 3] = False
    entries = around[there]
    order = np.argsort(entries[:, 0], kind="stable")
    begins = np.concatenate([[0], np.cumsum(np.bincount(entries[:, 0], minlength=points))])
    return begins.astype(np.int32), np.ascontiguousarray(entries[order, 1:])


def pressed_weights(shape: Shape, cells: np.ndarray) -> np.ndarray:
    """Area that a pressure acts on at each point over that of its cells, shape (N,).

    It is 1 where the cells cover the sheet. Points beside a cut, and of a rectangle whose areas go beyond its outermost
    points, represent more. A tube or a sphere has the areas of the smooth surface, of which its triangles are chords:
    each piece has one factor, so that the net force on a closed surface vanishes with any.

    Raises:
        InputError: if a point has no cell.
    """
    positions, lone = shape.positions, cells[:, 2] == cells[:, 3]
    halves = cells[:, [0, 1, 2]], cells[~lone][:, [0, 2, 3]]
    first, second = (0.5 * doubled_normals(positions, half) for half in halves)
    area = np.linalg.norm(first, axis=1)
    area[~lone] += np.linalg.norm(second, axis=1)
    share = np.where(lone[:, None], [1 / 3, 1 / 3, 1 / 3, 0.0], 0.25)
    own = corner_sums(area[:, None] * share, cells, shape.size)
    if len(bare := np.flatnonzero((own == 0.0) & (shape.areas > 0.0))):
        raise InputError(f"a pressure on triangles: point {bare[0]} has no triangle: expected Pressure(on='points')")
    if abs(own.sum() / shape.areas.sum() - 1.0) < SAME:
        return np.ones(shape.size)
    if shape.frames is None:
        ratio = shape.areas / np.where(own > 0.0, own, 1.0)
        covered = np.abs(ratio - 1.0) < SAME
        if 2 * covered.sum() < shape.size:
            covered |= np.abs(voronoi_areas(shape.points, np.concatenate(halves)) / shape.areas - 1.0) < SAME
        return np.where(covered, 1.0, ratio)
    first[~lone] += second
    vectors = np.column_stack([corner_sums(first[:, c, None] * share, cells, shape.size) for c in range(3)])
    upward = (vectors * shape.normals).sum(axis=1)
    piece = np.zeros(shape.size, int) if shape.pieces is None else shape.pieces
    factors = np.bincount(piece, shape.areas) / np.maximum(np.bincount(piece, upward), 1e-300)
    flat = np.bincount(piece, own) / np.maximum(np.bincount(piece, shape.areas), 1e-300)
    return np.asarray(np.where(np.abs(flat - 1.0) < SAME, 1.0, factors)[piece])


def pressed_faces(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the cells, shape (T, 3), and the part of their doubled normals that presses on each corner, (T,)."""
    lone = cells[:, 2] == cells[:, 3]
    a, b, c, d = cells[~lone].T
    halves = [np.column_stack(half) for half in ((a, b, c), (a, c, d), (a, b, d), (b, c, d))]
    return np.concatenate([*halves, cells[lone, :3]]), np.repeat([1.0 / 12.0, 1.0 / 6.0], [4 * len(a), lone.sum()])


def pressed_areas(places: np.ndarray, cells: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Force on points at places [m], (N, 3), with `pressed_weights`, (N,), over the pressure: [m^2], (N, 3)."""
    faces, share = pressed_faces(cells)
    normals = share[:, None] * doubled_normals(places, faces)
    return np.asarray(weights[:, None] * vector_sums(normals, faces, len(places)))


def pressure_matrix(places: np.ndarray, cells: np.ndarray, pressures: np.ndarray) -> Any:
    """Derivative of the force of pressures [Pa], shape (N,), by the places of points [m], shape (N, 3).

    Sparse, shape (3 N, 3 N). The force on a corner is a sixth of its pressure times N = (b - a) x (c - a) of each
    triangle, and dN = da x (b - c) + db x (c - a) + dc x (a - b).
    """
    from scipy import sparse

    n = len(places)
    faces, share = pressed_faces(cells)
    rows, columns, values = [], [], []
    for moved in range(3):
        x, y, z = (share[:, None] * (places[faces[:, (moved + 1) % 3]] - places[faces[:, (moved + 2) % 3]])).T
        zero = np.zeros_like(x)
        # da x v = -[v] da.
        cross = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]])
        for corner in range(3):
            for row, column in np.ndindex(3, 3):
                rows.append(3 * faces[:, corner] + row)
                columns.append(3 * faces[:, moved] + column)
                values.append(pressures[faces[:, corner]] * cross[row, column])
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix(entries, shape=(3 * n, 3 * n))
