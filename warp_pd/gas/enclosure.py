"""Surfaces that enclose a volume: edge rings, caps that close them, and triangles at each point."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import boundary_edges, boundary_rings, require_one_side

# How far four points may be from a rectangle, over its diagonal.
SKEW = 1e-6


def edge_rings(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed rings of boundary edges (edges of only one triangle), in the direction of the triangles."""
    require_one_side(triangles)
    free = boundary_edges(triangles)
    begins, times = np.unique(free[:, 0], return_counts=True)
    if (times > 1).any():
        raise InputError(
            f"triangles: two boundaries of the sheet meet at point {begins[times > 1][0]}: expected separate boundaries"
        )
    # In order of their first points, so that the rings, and the caps on them, do not depend on that of the triangles.
    return [ring.astype(np.int32) for ring in boundary_rings(free[np.argsort(free[:, 0])])]


def cap_of(ring: np.ndarray) -> np.ndarray:
    """Triangle fan that closes a ring, int32, shape (R - 2, 3); flat if the ring is."""
    return np.column_stack([np.full(len(ring) - 2, ring[0]), ring[2:], ring[1:-1]]).astype(np.int32)


def other_diagonals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangulation with the other diagonal in every rectangle (two triangles with a common hypotenuse).

    Pressure on a rectangle loads the ends of its diagonal more than the other corners; the mean of both triangulations
    is even. Without any rectangle the same array is returned.
    """
    size = int(triangles.max()) + 1
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
    if len(one) == 0:
        return triangles
    turned = triangles.copy()
    turned[one // 3] = np.column_stack([tail[one], apex[other], apex[one]])
    turned[other // 3] = np.column_stack([apex[other], head[one], apex[one]])
    return turned


def volume_of(positions: np.ndarray, triangles: np.ndarray) -> float:
    """Volume enclosed by a surface [m^3], positive if its triangles are counter-clockwise seen from outside."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return float(np.einsum("fc,fc->", a, np.cross(b, c)) / 6.0)


def triangles_at_points(triangles: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The triangles of every point.

    Returns:
        Where the entries of each point begin, shape (N + 1,); the other two corners, in order, shape (3 F, 2); and
        the triangle, shape (3 F,); all int32.
    """
    own = triangles.ravel()
    others = np.column_stack([triangles[:, [1, 2, 0]].ravel(), triangles[:, [2, 0, 1]].ravel()])
    order = np.argsort(own, kind="stable")
    begins = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=points))])
    faces = np.repeat(np.arange(len(triangles)), 3)[order]
    return begins.astype(np.int32), others[order].astype(np.int32), faces.astype(np.int32)
