"""Slits in curved triangulated surfaces: points near a slit are moved onto it, then doubled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..geometry.sheet import Shape, edge_names
from ..geometry.triangulation import (
    boundary_edges,
    directed_edges,
    doubled_normals,
    split_along,
    undirected,
    voronoi_areas,
)
from .surfaces import tangents

# A level below this fraction of its largest difference along an edge is zero, and a place may be this fraction of the
# longest edge off the sheet. No triangle may shrink to less than the third fraction of its area, and a point moves only
# as far as its triangles keep the fourth.
ROUND_OFF, OFF, LEAST_AREA, GOOD_AREA = 1e-6, 0.5, 0.1, 0.3
# Least distance from another slit in spacings: half of one, less round-off.
ROOM = 0.495
PER_POINT = ("frames", "spacings", "pieces")
# A point in a triangle or on an edge: the points around it, and their weights.
Mixture = tuple[np.ndarray, np.ndarray]
# Points along a slit, the first again at the end of a closed one, and the new places of some of them.
Slit = tuple[np.ndarray, dict[int, Mixture]]


def slit_along(shape: Shape, path: np.ndarray) -> Slit:
    """A slit through places [m], shape (L, 3), straight between them.

    Between two places it lies in the plane that contains them and the mean of their normals. On an open edge of the
    shape its ends are at points of that edge.

    Raises:
        InputError: if a place is off the sheet, or the slit leaves the sheet or crosses another one between two places.
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
                f"slit: path[{k}] = {tuple(path[k].tolist())} and path[{k + 1}] = {tuple(path[k + 1].tolist())}: "
                "expected places apart on one side of the sheet; give more between"
            )
        # Points on the far side of a closed sheet are in the same plane.
        level = (placed.points - placed.points[a]) @ across / size
        level[[a, b]] = 0.0
        sides, snapped = _snapped(placed, edges, level, held=stops)
        way = _way(placed, sides, a, b)
        if (name := _crossed(placed, sides, a, b)) is not None:
            raise InputError(f"slit: path[{k}] to path[{k + 1}] crosses {name!r}: expected slits that do not cross")
        if way is None:
            raise InputError(f"slit: path[{k}] to path[{k + 1}] leaves the sheet: expected more places between them")
        crack += way
        moved |= {point: snapped[point] for point in way if point in snapped}
    return np.array(crack), moved


def slits_at(shape: Shape, level: np.ndarray, inside: np.ndarray | None) -> list[Slit]:
    """The slits where a level, shape (N,), is zero, with positive values on their left.

    They lie where the mask `inside`, shape (N,), allows; None allows all points. Raises InputError if the level has no
    zero there, or its zero line meets itself.
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
            found.append((np.array(line), {point: snapped[point] for point in line if point in snapped}))
    return found


def opened(shape: Shape, slits: Sequence[Slit], name: str) -> tuple[dict[str, Any], Callable[[np.ndarray], np.ndarray]]:
    """Open slits in a curved shape; messages call them `name`.

    Returns the changed attributes of the shape, and a function from values at its points to those at the new ones.

    Raises:
        InputError: if a slit meets itself or another one, touches an edge of the sheet except at its ends, passes
            through a rigid body, is only one edge of a triangle long, or distorts a triangle too much.
    """
    on_edge = np.unique(boundary_edges(shape.triangles))
    lines = [line for line, _ in slits]
    every = np.concatenate([line[int(line[0] == line[-1]) :] for line in lines])
    inner = np.concatenate([line[1:-1] for line in lines])
    if len(np.unique(every)) < len(every) or np.isin(inner, on_edge).any():
        raise InputError(f"{name} meets itself or an edge: expected a line in the sheet with at most its ends on edges")
    shape.require_beside_bodies(name, inner, inner)
    if min(map(len, lines)) < 3:
        raise InputError(f"{name} is shorter than two edges of triangles: expected a longer slit")
    moved = {point: mixture for _, places in slits for point, mixture in places.items()}
    placed = _mixed(shape, moved)
    before, after = (doubled_normals(points, shape.triangles) for points in (shape.points, placed.points))
    kept = _areas_kept(before, after)
    if (kept < LEAST_AREA).any():
        worst = placed.points[shape.triangles[np.argmin(kept)]].mean(axis=0)
        raise InputError(f"{name} is too close to an edge or another slit {_near(worst)}: expected room for triangles")
    spacing = np.full(shape.size, shape.spacing) if shape.spacings is None else shape.spacings
    for other in _slits(shape):
        apart = np.linalg.norm(placed.points[inner, None] - placed.points[shape.parts[other]], axis=2).min(axis=1)
        close = apart < ROOM * spacing[inner]
        if close.any():
            place = _near(placed.points[inner[close][0]])
            raise InputError(
                f"{name} is {apart[close][0]:.3g} m from {other!r} {place}: expected half a spacing or more"
            )
    triangles, source = shape.triangles, np.arange(shape.size)
    parts = dict(shape.parts)
    for line in lines:
        triangles, doubled = split_along(len(source), triangles, line)
        copies = len(source) + np.arange(len(doubled))
        source = np.append(source, doubled)
        left, right = np.unique(line), np.union1d(np.setdiff1d(line, doubled), copies)
        number = next(k for k in range(1, len(parts) + 2) if f"slit {k}" not in parts)
        parts |= {f"slit {number} left": left, f"slit {number} right": right, f"slit {number}": np.union1d(left, right)}
    parts |= {part: np.flatnonzero(np.isin(source, points)) for part, points in edge_names(shape).items()}
    cells = voronoi_areas(placed.points[source], triangles) / voronoi_areas(shape.points, shape.triangles)[source]

    def values(before: np.ndarray) -> np.ndarray:
        found = before.astype(np.float64)
        for point, (corners, weights) in moved.items():
            found[point] = weights @ before[corners]
        return found[source]

    return {
        "points": placed.points[source],
        **{name: None if (each := getattr(placed, name)) is None else each[source] for name in PER_POINT},
        "areas": cells * shape.areas[source],
        "triangles": triangles.astype(np.int32),
        "parts": {part: points.astype(np.int32) for part, points in parts.items()},
        "inclusions": tuple(np.flatnonzero(np.isin(source, m)).astype(np.int32) for m in shape.inclusions),
    }, values


def _near(place: np.ndarray) -> str:
    return f"near {tuple(np.round(place, 6).tolist())}"


def _slits(shape: Shape) -> list[str]:
    """Names of the slits of a shape."""
    parts = shape.parts
    both = [name for name in parts if f"{name} left" in parts and f"{name} right" in parts]
    # A flat sheet that was glued into this one has a left and a right side, too.
    return [n for n in both if np.array_equal(parts[n], np.union1d(parts[f"{n} left"], parts[f"{n} right"]))]


def _crossed(shape: Shape, edges: np.ndarray, start: int, end: int) -> str | None:
    """Name of the slit that the path from `start` to `end` would cross if that slit were closed, or None.

    On a closed surface there is often a longer path, round the back.
    """
    on_path = np.unique(edges)
    for name in _slits(shape):
        left, right = (np.intersect1d(on_path, shape.parts[f"{name} {side}"]) for side in ("left", "right"))
        left, right = np.setdiff1d(left, right), np.setdiff1d(right, left)
        if len(left) and len(right):
            apart = np.linalg.norm(shape.points[left, None] - shape.points[right], axis=2)
            bridges = np.argwhere(apart < shape.spacing)
            bridges = np.column_stack([left[bridges[:, 0]], right[bridges[:, 1]]])
            across = {frozenset(pair) for pair in bridges.tolist()}
            way = [start, *(_way(shape, np.concatenate([edges, bridges]), start, end) or [])]
            if any(frozenset(step) in across for step in pairwise(way)):
                return name
    return None


def _edges(shape: Shape) -> np.ndarray:
    """Every edge once, with those on the rim first, shape (E, 2)."""
    edges, rim = np.sort(directed_edges(shape.triangles), axis=1), np.sort(boundary_edges(shape.triangles), axis=1)
    unique, number = np.unique(np.concatenate([rim, edges]), axis=0, return_inverse=True)
    at_rim = np.zeros(len(unique), bool)
    at_rim[number.ravel()[: len(rim)]] = True
    return np.concatenate([unique[at_rim], unique[~at_rim]])


def _mixed(shape: Shape, moved: dict[int, Mixture]) -> Shape:
    """The points of a shape with some at new places on the surface, which is curved between the points.

    A place is the mean of that in the plane of the triangle and its projections onto the tangent planes at the corners
    (Phong tessellation with alpha = 1/2, Boubekeur & Alexa 2008), which is exact to second order.
    """
    assert shape.frames is not None
    points, frames, normals = shape.points.copy(), shape.frames.copy(), shape.normals
    for point, (corners, weights) in moved.items():
        flat, around = weights @ shape.points[corners], normals[corners]
        lift = ((shape.points[corners] - flat) * around).sum(axis=1)
        points[point] = flat + 0.5 * (weights * lift) @ around
        frames[point] = tangents((weights @ around)[None])[0]
    return replace(shape, points=points, frames=frames)


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
        raise InputError(f"{name} is {away:.4g} m away from the sheet: expected a place on it")
    stays = np.isin(point, boundary_edges(shape.triangles)) or np.count_nonzero(inside) == 1
    return point, None if stays else mixture


def _snapped(
    shape: Shape, edges: np.ndarray, level: np.ndarray, held: Sequence[int]
) -> tuple[np.ndarray, dict[int, Mixture]]:
    """Edges along the zero line of a level, shape (K, 2), with positive values on their left, and new places of points.

    On each edge that the zero line crosses, one end is moved to the crossing, so that the line runs along edges
    (Labelle & Shewchuk 2007, section 3): the end whose triangles keep more of their areas, and only as far as they keep
    enough of them. Points of an open edge move along it.
    """
    difference = np.abs(np.diff(level[edges], axis=1))[:, 0]
    level[np.abs(level) < ROUND_OFF * difference.max(initial=0.0)] = 0.0
    given = level.copy()
    crossed = np.flatnonzero(level[edges].prod(axis=1) < 0.0)
    rim = boundary_edges(shape.triangles)
    ends, first = edges[crossed], crossed < len(rim)
    part = np.abs(level[ends]) / np.abs(level[ends]).sum(axis=1, keepdims=True)
    may = ~np.isin(ends, held) & (first[:, None] | ~np.isin(ends, rim))
    nearest = np.round(np.where(may, part, 2.0).min(axis=1), 6)
    near, places = shape.triangles[np.isin(shape.triangles, ends).any(axis=1)], shape.points.copy()
    snapped: dict[int, Mixture] = {}

    def left(point: int, way: np.ndarray) -> float:
        """The smallest fraction of its area that a triangle around a point keeps if the point moves by `way` [m]."""
        around = near[(near == point).any(axis=1)]
        moved = np.where((around == point)[..., None], shape.points[point] + way, places[around])
        after = np.cross(moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0])
        return float(_areas_kept(doubled_normals(shape.points, around), after).min())

    for k in np.lexsort((nearest, ~first)).tolist():
        if (level[ends[k]] == 0.0).any() or not may[k].any():
            continue
        ways = part[k][:, None] * (shape.points[ends[k, ::-1]] - shape.points[ends[k]])
        least = [left(int(ends[k, e]), ways[e]) if may[k, e] else -np.inf for e in (0, 1)]
        chosen = int(np.argmax(least))
        point, way, fraction = int(ends[k, chosen]), ways[chosen], 1.0
        while fraction and left(point, fraction * way) < GOOD_AREA:
            fraction -= 0.25
        if fraction:
            moved = fraction * part[k, chosen]
            snapped[point] = ends[k, [chosen, 1 - chosen]], np.array([1.0 - moved, moved])
        level[point], places[point] = 0.0, shape.points[point] + fraction * way
    side = level[shape.triangles].sum(axis=1)
    # Of a triangle with three points on the line, most of it decides.
    side = np.where((level[shape.triangles] == 0.0).all(axis=1), given[shape.triangles].sum(axis=1), side)
    return _between(shape.triangles, side > 0.0), snapped


def _areas_kept(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Fractions of their areas that triangles keep, from their normals before and after, shape (F,)."""
    return np.asarray((before * after).sum(axis=1) / (before**2).sum(axis=1))


def _between(triangles: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """Directed edges with a triangle of a mask, shape (F,), on their left and another on their right, shape (K, 2)."""
    edges, own = directed_edges(triangles), np.tile(positive, 3)
    number = undirected(edges)
    apart = (np.bincount(number) == 2) & (np.bincount(number, own) == 1)
    return np.asarray(edges[apart[number] & own])


def _way(shape: Shape, edges: np.ndarray, start: int, end: int) -> list[int] | None:
    """Points after `start` on the shortest path along edges to `end`; None if there is none."""
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra

    size = len(shape.points)
    length = np.linalg.norm(shape.points[edges[:, 1]] - shape.points[edges[:, 0]], axis=1)
    graph = sparse.csr_array((length, edges.T), shape=(size, size))
    before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
    way = [end]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way[-2::-1] if way[-1] == start else None
