"""Assembly of a shape from points, triangles and curves: opens cracks, computes areas, names parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..device.checks import InputError
from ..geometry.sheet import SIDES, Shape
from ..geometry.triangulation import boundary_edges, point_areas, split_along, voronoi_areas

# Names of other points: the sides of the bounding box, and the whole boundary.
RESERVED = (*SIDES, "all")


@dataclass(frozen=True, eq=False)
class Part:
    """Points of a curve or crack, in order.

    Attributes:
        side: Number of the side of a polygon that begins at or contains each point, shape (M,).
        points: Point indices, shape (M,).
    """

    name: str
    side: np.ndarray
    points: np.ndarray


def assembled(base: Shape, rings: Sequence[Part], rigid: Sequence[Part], cracks: Sequence[Part]) -> Shape:
    """The shape with areas, barriers and names.

    Rings (the outline and holes) and rigid inclusions are counter-clockwise; cracks run along edges of the triangles of
    `base`, whose areas are ignored.
    """
    parts: dict[str, np.ndarray] = {}
    for ring in rings:
        _add(parts, _ring_parts(ring))
    parts["all"] = np.unique(np.concatenate([ring.points for ring in rings]))
    opened, rims = base, tuple(parts)
    for crack in cracks:
        opened, sides, doubled = _opened(opened, crack)
        # At the mouth of a crack both of its faces lie on the ring.
        copies = dict(zip(doubled.tolist(), range(opened.size - len(doubled), opened.size), strict=True))
        for name in rims:
            mouths = [copies[point] for point in parts[name].tolist() if point in copies]
            parts[name] = np.append(parts[name], np.array(mouths, int))
        _add(parts, sides)
    middle = opened.points[opened.triangles].mean(axis=1)
    body, of_triangle = np.zeros(opened.size, np.int32), np.zeros(len(opened.triangles), np.int32)
    inclusions = []
    for number, ring in enumerate(rigid, start=1):
        inner = _inside(opened.points, opened.points[ring.points])
        inner[ring.points] = False
        body[inner] = number
        of_triangle[_inside(middle, opened.points[ring.points])] = number
        inclusions.append(np.union1d(ring.points, np.flatnonzero(inner)).astype(np.int32))
        _add(parts, {ring.name: np.sort(ring.points)})
    outside = opened.triangles[of_triangle == 0]
    barriers = boundary_edges(outside)
    return replace(
        opened,
        areas=_areas(opened, body, of_triangle),
        inclusions=tuple(inclusions),
        bodies=body if rigid else None,
        barriers=barriers,
        parts={name: np.asarray(points, np.int32) for name, points in parts.items()},
    )


def _add(parts: dict[str, np.ndarray], more: dict[str, np.ndarray]) -> None:
    """Add named points. Raises InputError if a name is already used."""
    for name in more:
        if name in parts or name in RESERVED:
            taken = ", ".join(repr(one) for one in (*RESERVED, *parts))
            raise InputError(f"two parts have the name {name!r}; expected a name not among {taken}")
    parts.update(more)


def _ring_parts(ring: Part) -> dict[str, np.ndarray]:
    """Points of the whole ring and of each side of a polygon, including both ends."""
    parts = {ring.name: np.sort(ring.points)}
    sides = int(ring.side.max()) + 1
    for number in range(sides if sides > 1 else 0):
        on = ring.side == number
        on |= np.roll(on, 1)
        parts[f"{ring.name} side {number + 1}"] = np.sort(ring.points[on])
    return parts


def _opened(shape: Shape, crack: Part) -> tuple[Shape, dict[str, np.ndarray], np.ndarray]:
    """The shape with a crack opened, its named faces, and the points that have copies at the end of the new shape.

    Tips belong to both faces.
    """
    triangles, doubled = split_along(shape.size, shape.triangles, crack.points)
    copies = shape.size + np.arange(len(doubled))
    grid = None
    if shape.grid is not None:
        grid = np.vstack([shape.grid, np.full((len(copies), 2), -1, np.int32)])
        grid[doubled] = -1
    opened = replace(
        shape,
        points=np.vstack([shape.points, shape.points[doubled]]),
        areas=np.zeros(shape.size + len(copies)),
        triangles=triangles.astype(np.int32),
        grid=grid,
        spacings=None if shape.spacings is None else np.concatenate([shape.spacings, shape.spacings[doubled]]),
    )
    tips = np.setdiff1d(crack.points, doubled)
    left, right = np.sort(crack.points), np.union1d(tips, copies)
    names = {crack.name: np.union1d(left, right), f"{crack.name} left": left, f"{crack.name} right": right}
    return opened, names if not len(tips) else {**names, f"{crack.name} tips": tips}, doubled


def _inside(points: np.ndarray, ring: np.ndarray) -> np.ndarray:
    import shapely

    polygon = shapely.Polygon(ring)
    shapely.prepare(polygon)
    return np.asarray(shapely.contains_xy(polygon, *points.T))


def _areas(shape: Shape, body: np.ndarray, of_triangle: np.ndarray) -> np.ndarray:
    """Areas of the points: Voronoi cells; the area of a rigid inclusion is divided equally among its points."""
    areas = voronoi_areas(shape.points, shape.triangles[of_triangle == 0])
    for number in range(1, int(body.max(initial=0)) + 1):
        inner = body == number
        thirds = point_areas(shape.points, shape.triangles[of_triangle == number])
        if inner.any():
            areas[inner] = thirds[inner] * (thirds.sum() / thirds[inner].sum())
    return areas
