"""Slits in curved triangulated surfaces."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..device.checks import InputError
from .cracks import split_along
from .shape import Shape
from .topology import boundary_edges, directed_edges
from .triangulation import point_areas


def slit_surface(shape: Shape, path: np.ndarray, name: str) -> tuple[dict[str, Any], np.ndarray]:
    """Slit a curved shape along edges of triangles.

    Args:
        shape: A curved shape.
        path: Positions on it [m], shape (L, 3); the slit is the shortest path through the points nearest to them.
        name: Name of the slit in messages.

    Returns:
        Changed attributes of the shape, and for each new point the index of its original point.

    Raises:
        InputError: if a position is off the sheet, or if the slit meets itself, touches an edge of the sheet except at
            its ends, or is only one edge of a triangle long.
    """
    from scipy.spatial import cKDTree

    edges = np.unique(np.sort(directed_edges(shape.triangles), axis=1), axis=0)
    away, nearest = cKDTree(shape.points).query(path)
    # A place in a triangle is nearer to a corner than its longest edge is long.
    if (far := away > np.linalg.norm(np.diff(shape.points[edges], axis=1), axis=2).max()).any():
        k = int(np.argmax(far))
        raise InputError(
            f"slit: path[{k}] = {tuple(path[k].tolist())}: expected a place on the sheet; its nearest point is "
            f"{away[k]:.4g} m away"
        )
    stops = nearest.tolist()
    crack = np.array(stops[:1] + [p for a, b in pairwise(stops) for p in _way(shape, edges, a, b)])
    at_edge = np.isin(crack, boundary_edges(shape.triangles))
    if len(np.unique(crack)) < len(crack) or at_edge[1:-1].any():
        raise InputError(f"{name} meets itself or an edge: expected a path in the sheet with at most its ends on edges")
    if len(crack) < 3:
        raise InputError(f"{name} is shorter than two edges of triangles: expected a longer slit")
    split = split_along(shape.points, shape.triangles, crack, (bool(at_edge[0]), bool(at_edge[-1])), shape.frames)
    source = np.concatenate([np.arange(shape.size), split.doubled])
    number = next(k for k in range(1, len(shape.parts) + 2) if f"slit {k}" not in shape.parts)
    right = np.setdiff1d(np.union1d(crack, np.arange(shape.size, len(source))), split.doubled)
    parts = {part: np.flatnonzero(np.isin(source, points)) for part, points in shape.parts.items()}
    parts |= {f"slit {number} left": np.sort(crack), f"slit {number} right": right}
    parts[f"slit {number}"] = np.union1d(crack, right)
    triangles = split.triangles.astype(np.int32)
    share = point_areas(shape.points[source], triangles) / point_areas(shape.points, shape.triangles)[source]
    taken = {name: getattr(shape, name) for name in ("points", "frames", "spacings", "pieces")}
    return {
        **{name: None if values is None else values[source] for name, values in taken.items()},
        "areas": share * shape.areas[source],
        "triangles": triangles,
        "parts": {part: points.astype(np.int32) for part, points in parts.items()},
    }, source


def _way(shape: Shape, edges: np.ndarray, start: int, end: int) -> list[int]:
    """Points after `start` on the shortest path along edges to `end`; of equally short paths, the straightest."""
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra

    places = shape.points
    line = places[end] - places[start]
    middle = 0.5 * places[edges].sum(axis=1) - places[start]
    aside = np.linalg.norm(np.cross(middle, line), axis=1) / max(float(line @ line), 1e-300)
    length = np.linalg.norm(places[edges[:, 1]] - places[edges[:, 0]], axis=1) * (1.0 + 1e-3 * aside)
    graph = sparse.csr_array((length, edges.T), shape=(shape.size, shape.size))
    before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
    way = [end]
    while way[-1] != start:
        way.append(int(before[way[-1]]))
    return way[-2::-1]
