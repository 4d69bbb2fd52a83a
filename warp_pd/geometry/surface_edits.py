"""Slits in curved triangulated surfaces: points near a slit are moved onto it, then doubled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..device.checks import InputError
from .cracks import split_along
from .shape import Shape
from .surfaces import tangents
from .topology import boundary_edges, directed_edges, undirected
from .triangulation import doubled_normals, voronoi_areas

# A level below this fraction of its largest difference along an edge is zero, and a place may be this fraction of the
# longest edge off the sheet. No triangle may shrink to less than the last fraction of its area.
ROUND_OFF, OFF, LEAST_SHARE, GOOD_SHARE = 1e-6, 0.5, 0.1, 0.3
# A point in a triangle or on an edge: the points around it, and their weights.
Mixture = tuple[np.ndarray, np.ndarray]


@dataclass(eq=False)
class Slit:
    """A slit to be opened.

    Attributes:
        points: Points along it, shape (L,); those of a closed one end with the first.
        moved: New places of some of them.
    """

    points: np.ndarray
    moved: dict[int, Mixture]


def slit_along(shape: Shape, path: np.ndarray) -> Slit:
    """A slit through places [m], shape (L, 3), straight between them.

    Between two places it lies in the plane that contains them and the mean of their normals. On an open edge of the
    shape its ends are at points of that edge.

    Raises:
        InputError: if a place is off the sheet, or the slit leaves the sheet between two places.
    """
    edges = _edges(shape)
    stops, moved = [], {}
    for k, place in enumerate(path):
        point, mixture = _stop(shape, place, edges, f"slit: path[{k}] = {tuple(place.tolist())}")
        stops.append(point)
        if mixture is not None:
            moved[point] = mixture
    crack = stops[:1]
    placed = _mixed(shape, moved)
    for k, (a, b) in enumerate(pairwise(stops)):
        along, up = placed.points[b] - placed.points[a], placed.normals[[a, b]].sum(axis=0)
        across = np.cross(up, along)
        size, longest = float(np.linalg.norm(across)), float(np.linalg.norm(along))
        if size < 1e-3 * longest or not longest:
            raise InputError(
                f"slit: path[{k}] and path[{k + 1}]: expected places apart on one side of the sheet; give more between"
            )
        # Points on the far side of a closed sheet are in the same plane.
        level = (placed.points - placed.points[a]) @ across / size
        level[[a, b]] = 0.0
        sides, snapped = _snapped(placed, edges, level, held=stops)
        way = _way(placed, sides, a, b)
        if way is None:
            raise InputError(f"slit: path[{k}] to path[{k + 1}] leaves the sheet: expected more places between them")
        crack += way
        moved |= {point: snapped[point] for point in way if point in snapped}
    return Slit(np.array(crack), moved)


def slits_at(shape: Shape, level: np.ndarray, inside: np.ndarray | None) -> list[Slit]:
    """The slits where a level, shape (N,), is zero, with positive values on their left.

    Args:
        shape: A curved shape.
        level: Values at the points.
        inside: Mask of the points at which there may be a slit, shape (N,); None for all.

    Raises:
        InputError: if the level has no zero there, or its zero line meets itself.
    """
    sides, snapped = _snapped(shape, _edges(shape), level.copy(), held=[])
    sides = sides if inside is None else sides[inside[sides].all(axis=1)]
    if not len(sides):
        raise InputError("slit: level(x, y, z) changes its sign nowhere inside the sheet: expected a line of zeros")
    if (np.bincount(sides[:, 0]) > 1).any() or (np.bincount(sides[:, 1]) > 1).any():
        raise InputError("slit: level(x, y, z): expected lines of zeros that do not meet")
    following = dict(sides.tolist())
    starts = [*np.setdiff1d(sides[:, 0], sides[:, 1]).tolist(), *sides[:, 0].tolist()]
    found = []
    for start in starts:
        line = [start]
        while line[-1] in following:
            line.append(following.pop(line[-1]))
        if len(line) > 1:
            found.append(Slit(np.array(line), {point: snapped[point] for point in line if point in snapped}))
    return found


def opened(shape: Shape, slits: Sequence[Slit], name: str) -> tuple[dict[str, Any], Callable[[np.ndarray], np.ndarray]]:
    """Open slits.

    Args:
        shape: A curved shape.
        slits: The slits.
        name: Of the slits in messages.

    Returns:
        Changed attributes of the shape, and what gives the values of its points from those of the points before.

    Raises:
        InputError: if a slit meets itself or another one, touches an edge of the sheet except at its ends, is only one
            edge of a triangle long, or distorts a triangle too much.
    """
    on_edge = np.unique(boundary_edges(shape.triangles))
    every = np.concatenate([slit.points[:-1] if _closed(slit) else slit.points for slit in slits])
    inner = np.concatenate([slit.points[1:-1] for slit in slits])
    if len(np.unique(every)) < len(every) or np.isin(inner, on_edge).any():
        raise InputError(f"{name} meets itself or an edge: expected a line in the sheet with at most its ends on edges")
    if min(len(slit.points) for slit in slits) < 3:
        raise InputError(f"{name} is shorter than two edges of triangles: expected a longer slit")
    moved = {point: mixture for slit in slits for point, mixture in slit.moved.items()}
    placed = _mixed(shape, moved)
    before, after = (doubled_normals(points, shape.triangles) for points in (shape.points, placed.points))
    share = (before * after).sum(axis=1) / (before**2).sum(axis=1)
    if (share < LEAST_SHARE).any():
        worst = placed.points[shape.triangles[np.argmin(share)]].mean(axis=0)
        raise InputError(
            f"{name} is too close to an edge or another slit near {tuple(np.round(worst, 6).tolist())}: expected room "
            "for triangles"
        )
    triangles, source, parts = shape.triangles, np.arange(shape.size), {}
    taken = set(shape.parts)
    for slit in slits:
        split = split_along(len(source), triangles, slit.points)
        copies = len(source) + np.arange(len(split.doubled))
        triangles, source = split.triangles, np.append(source, split.doubled)
        left, right = np.unique(slit.points), np.union1d(np.setdiff1d(slit.points, split.doubled), copies)
        number = next(k for k in range(1, len(taken) + 2) if f"slit {k}" not in taken)
        taken.add(f"slit {number}")
        parts |= {f"slit {number} left": left, f"slit {number} right": right, f"slit {number}": np.union1d(left, right)}
    kept = {part: np.flatnonzero(np.isin(source, points)) for part, points in shape.parts.items()}
    cells = voronoi_areas(placed.points[source], triangles) / voronoi_areas(shape.points, shape.triangles)[source]

    def values(before: np.ndarray) -> np.ndarray:
        found = before.astype(np.float64)
        for point, (corners, weights) in moved.items():
            found[point] = weights @ before[corners]
        return found[source]

    return {
        "points": placed.points[source],
        "frames": None if placed.frames is None else placed.frames[source],
        "spacings": None if shape.spacings is None else values(shape.spacings),
        "pieces": None if shape.pieces is None else shape.pieces[source],
        "areas": cells * shape.areas[source],
        "triangles": triangles.astype(np.int32),
        "parts": {part: points.astype(np.int32) for part, points in (kept | parts).items()},
        "inclusions": tuple(np.flatnonzero(np.isin(source, m)).astype(np.int32) for m in shape.inclusions),
    }, values


def _closed(slit: Slit) -> bool:
    return bool(slit.points[0] == slit.points[-1])


def _edges(shape: Shape) -> np.ndarray:
    """Every edge once, with those on the rim first, shape (E, 2)."""
    edges, rim = np.sort(directed_edges(shape.triangles), axis=1), np.sort(boundary_edges(shape.triangles), axis=1)
    unique, number = np.unique(np.concatenate([rim, edges]), axis=0, return_inverse=True)
    at_rim = np.zeros(len(unique), bool)
    at_rim[number.ravel()[: len(rim)]] = True
    return np.concatenate([unique[at_rim], unique[~at_rim]])


@dataclass(eq=False)
class Placed:
    """Points with their tangent vectors and normals, some of them moved."""

    points: np.ndarray
    frames: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray


def _mixed(shape: Shape | Placed, moved: dict[int, Mixture]) -> Placed:
    """The points of a shape with some at new places on the surface, which is curved between the points.

    A place is the mean of that in the plane of the triangle and its projections onto the tangent planes at the corners
    (Phong tessellation with alpha = 1/2, Boubekeur & Alexa 2008), which is exact to second order.
    """
    assert shape.frames is not None
    points, frames, normals = shape.points.copy(), shape.frames.copy(), shape.normals.copy()
    for point, (corners, weights) in moved.items():
        flat, around = weights @ shape.points[corners], shape.normals[corners]
        lift = ((shape.points[corners] - flat) * around).sum(axis=1)
        points[point] = flat + 0.5 * (weights * lift) @ around
        frames[point] = tangents((weights @ around)[None])[0]
        normals[point] = np.cross(frames[point, :, 0], frames[point, :, 1])
    return Placed(points, frames, normals, shape.triangles)


def _stop(shape: Shape, place: np.ndarray, edges: np.ndarray, name: str) -> tuple[int, Mixture | None]:
    """The point to be moved to a place, and the new place, None if it stays.

    The point is the corner of the triangle with the largest weight, so that its triangles keep a third of their areas.
    """
    nearest = int(np.argmin(((shape.points - place) ** 2).sum(axis=1)))
    around = shape.triangles[(shape.triangles == nearest).any(axis=1)]
    a, b, c = (shape.points[around[:, k]] for k in range(3))
    doubled = doubled_normals(shape.points, around)
    corner = [np.cross(e - d, place - d) for d, e in ((b, c), (c, a), (a, b))]
    weights = np.stack([(each * doubled).sum(axis=1) for each in corner], axis=1) / (doubled**2).sum(axis=1)[:, None]
    best = int(np.argmax(weights.min(axis=1)))
    inside = np.maximum(weights[best], 0.0)
    inside[inside < ROUND_OFF] = 0.0
    point, mixture = int(around[best][np.argmax(inside)]), (around[best], inside / inside.sum())
    found = _mixed(shape, {point: mixture}).points[point]
    away = float(np.linalg.norm(found - place))
    if away > OFF * np.linalg.norm(np.diff(shape.points[edges], axis=1), axis=2).max():
        raise InputError(f"{name}: expected a place on the sheet, which is {away:.4g} m away")
    stays = np.isin(point, boundary_edges(shape.triangles)) or np.count_nonzero(inside) == 1
    return point, None if stays else mixture


def _snapped(
    shape: Shape | Placed, edges: np.ndarray, level: np.ndarray, held: Sequence[int]
) -> tuple[np.ndarray, dict[int, Mixture]]:
    """Edges along the zero line of a level, shape (K, 2), with positive values on their left, and new places of points.

    On each edge that the zero line crosses, the nearer end is moved to the crossing, so that the line runs along edges
    (Labelle & Shewchuk 2007, section 3). Points of an open edge move along it.
    """
    difference = np.abs(np.diff(level[edges], axis=1))[:, 0]
    level[np.abs(level) < ROUND_OFF * difference.max(initial=0.0)] = 0.0
    given = level.copy()
    crossed = np.flatnonzero((level[edges] > 0.0).any(axis=1) & (level[edges] < 0.0).any(axis=1))
    rim = boundary_edges(shape.triangles)
    at_rim, fixed = len(rim), np.zeros(len(level), bool)
    fixed[list(held)] = True
    on_rim = np.isin(edges[crossed], rim)
    ends, first = edges[crossed], crossed < at_rim
    part = np.abs(level[ends]) / np.abs(level[ends]).sum(axis=1, keepdims=True)
    may = ~fixed[ends] & (first[:, None] | ~on_rim)
    nearest = np.round(np.where(may, part, 2.0).min(axis=1), 6)
    room = Room(shape, np.unique(ends))
    snapped: dict[int, Mixture] = {}
    for k in np.lexsort((nearest, ~first)).tolist():
        if (level[ends[k]] == 0.0).any() or not may[k].any():
            continue
        ways = part[k][:, None] * (shape.points[ends[k, ::-1]] - shape.points[ends[k]])
        least = [room.left(int(ends[k, e]), ways[e]) if may[k, e] else -np.inf for e in (0, 1)]
        near = int(np.argmax(may[k] * (1.0 - part[k])))
        chosen = near if least[near] > GOOD_SHARE else int(np.argmax(least))
        point, way, fraction = int(ends[k, chosen]), ways[chosen], 1.0
        while fraction and room.left(point, fraction * way) < GOOD_SHARE:
            fraction -= 0.25
        if fraction:
            moved = fraction * part[k, chosen]
            snapped[point] = ends[k, [chosen, 1 - chosen]], np.array([1.0 - moved, moved])
        level[point], room.points[point] = 0.0, shape.points[point] + fraction * way
    side = level[shape.triangles].sum(axis=1)
    # Of a triangle with three points on the line, most of it decides.
    side = np.where((level[shape.triangles] == 0.0).all(axis=1), given[shape.triangles].sum(axis=1), side)
    return _between(shape.triangles, side > 0.0), snapped


class Room:
    """What is left of the triangles around points that move.

    Attributes:
        points: Present places of all points, shape (N, 3).
    """

    def __init__(self, shape: Shape | Placed, moving: np.ndarray) -> None:
        self.points, self._before, self._triangles = shape.points.copy(), shape.points, shape.triangles
        face, corner = np.nonzero(np.isin(shape.triangles, moving))
        owner = shape.triangles[face, corner]
        order = np.argsort(owner, kind="stable")
        points, begins = np.unique(owner[order], return_index=True)
        self._around = dict(zip(points.tolist(), np.split(face[order], begins[1:])[: len(points)], strict=True))

    def left(self, point: int, way: np.ndarray) -> float:
        """The smallest fraction of its area that a triangle around a point keeps if the point moves by `way` [m]."""
        corners = self._triangles[self._around[point]]
        moved = np.where((corners == point)[..., None], self._before[point] + way, self.points[corners])
        before, after = (np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in (self._before[corners], moved))
        return float(((before * after).sum(axis=1) / (before**2).sum(axis=1)).min())


def _between(triangles: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """Directed edges with a triangle of a mask, shape (F,), on their left and another on their right, shape (K, 2)."""
    edges, own = directed_edges(triangles), np.tile(positive, 3)
    number = undirected(edges)
    apart = (np.bincount(number) == 2) & (np.bincount(number, own) == 1)
    return np.asarray(edges[apart[number] & own])


def _way(shape: Placed, edges: np.ndarray, start: int, end: int) -> list[int] | None:
    """Points after `start` on the shortest path along edges to `end`; None if there is none."""
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra

    size = len(shape.points)
    length = np.linalg.norm(shape.points[edges[:, 1]] - shape.points[edges[:, 0]], axis=1)
    graph = sparse.csr_array((length, edges.T), shape=(size, size))
    before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
    way = [end]
    while way[-1] != start:
        if before[way[-1]] < 0:
            return None
        way.append(int(before[way[-1]]))
    return way[-2::-1]
