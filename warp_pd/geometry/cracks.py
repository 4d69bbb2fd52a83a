"""Cracks in a triangulation: every point of a crack except its tips is doubled, one copy per side."""

from __future__ import annotations

import numpy as np

from .topology import components, directed_edges, shared_sides, undirected


def split_along(points: int, triangles: np.ndarray, crack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Open a triangulation of `points` points along a crack.

    The corners at a point are divided into groups that are connected through triangles without crossing the crack. At a
    tip there is one group; an end on the edge of the sheet has two. The crack runs along edges of the counter-clockwise
    triangles, shape (F, 3); its points have shape (L,), and those of a closed one end with the first.

    Returns the triangles, those on the right side of the crack with the new points, shape (F, 3), and the points that
    have a copy, in order along the crack. The copies come after all other points.
    """
    edges, steps = directed_edges(triangles).astype(np.int64), np.column_stack([crack[:-1], crack[1:]])
    number = undirected(np.concatenate([edges, steps]))
    whole, on_crack = number[: len(edges)], np.isin(number[: len(edges)], number[len(edges) :])
    sides = shared_sides(whole)
    one, other = sides[~on_crack[sides[:, 1]]].T
    # Edge e starts at corner e and ends at the next corner of its triangle.
    after = np.roll(np.arange(len(edges)), -len(triangles))
    group = components(len(edges), np.column_stack([np.append(one, after[one]), np.append(after[other], other)]))
    keys = edges @ [points, 1]
    left, right = (np.flatnonzero(np.isin(keys, steps[:, way] @ [points, 1])) for way in ([0, 1], [1, 0]))
    left, right = (group[np.append(side, after[side])] for side in (left, right))
    corner = np.isin(group, np.setdiff1d(right, left))
    doubled = np.unique(crack, return_index=True)[1]
    doubled = crack[np.sort(doubled)]
    doubled = doubled[np.isin(doubled, edges[corner, 0])]
    copy = np.arange(points)
    copy[doubled] = points + np.arange(len(doubled))
    found = np.where(corner, copy[edges[:, 0]], edges[:, 0])
    return found.reshape(3, -1).T.astype(triangles.dtype), doubled
