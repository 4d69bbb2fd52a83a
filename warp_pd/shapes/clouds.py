"""Shapes from point clouds, and rectangles filled with turned or jittered grids."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from ..device import checks
from ..device.checks import InputError, corners, one_of, positions, positive
from ..geometry.sheet import Shape, rectangle
from ..geometry.triangulation import (
    boundary_edges,
    boundary_rings,
    counter_clockwise,
    delaunay,
    directed_edges,
    local_spacings,
    point_areas,
    refuse_coincident,
    ring_names,
    signed_areas,
    triangles_of,
    turned_grid,
)
from .lines import Named, named, polygon, region, ring
from .seams import require_distinct, seam_notes

# Places on a curve, and how far a triangle may reach beyond it, both over the spacing.
STEP, BEYOND = 0.05, 0.1
# A triangle so much longer than the edges around it is noted.
LONG = 2.5


def cloud(
    points: np.ndarray,
    triangles: np.ndarray | None,
    areas: np.ndarray | None,
    spacing: float | None,
    outline: Any = None,
    graded: bool = False,
    holes: Named = (),
) -> Shape:
    """A cloud of points; arguments as for `Sheet.from_points`."""
    points = positions("points", points)
    one_of("graded", graded, (True, False))
    if graded and spacing is not None:
        raise InputError(f"graded = True and spacing = {spacing!r}: expected only one of them")
    spacing = None if spacing is None else positive("spacing", spacing)
    if triangles is None:
        refuse_coincident(points)
    curves, polygons, made = _hole_curves(outline, holes), dict[str, Any](), triangles is None
    if not made and (outline is not None or curves):
        raise InputError(f"{'holes' if outline is None else 'outline'} and triangles: expected only one of them")
    if outline is not None or curves:
        triangles, polygons = _triangles_inside(points, outline, curves, spacing)
    elif triangles is None:
        triangles = delaunay(points, spacing)
    triangles = counter_clockwise(points, corners("triangles", triangles, len(points)))
    require_distinct("points", points, triangles)
    notes = seam_notes("triangles", points, triangles)
    areas = checks.one_each("areas", point_areas(points, triangles) if areas is None else areas, len(points))
    edges = boundary_edges(triangles)
    spacings = local_spacings(points, triangles) if graded else None
    if spacings is not None:
        spacing = float(spacings.min())
    return Shape(
        points=points,
        areas=areas,
        triangles=triangles,
        spacing=spacing if spacing is not None else float(np.sqrt(areas.mean())),
        barriers=None if _is_convex(points, triangles) else edges,
        parts=_with_holes(points, edges, polygons),
        notes=(
            *notes,
            *(_notes_on_long(points, triangles) if made else []),
        ),
        spacings=spacings,
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
    areas: str,
) -> Shape:
    """A rectangle with a turned or jittered grid inside; arguments as for `Sheet.filled`."""
    square = rectangle(width, height, points, origin, layers, False, areas)
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
    found = np.vstack([square.points[on_line], inside])
    each = None if areas == "shared" else np.full(len(found), dx * dy)
    return cloud(found, None, each, square.spacing)


def _is_convex(points: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether the triangles fill the convex hull of the points, so that no bond can leave them."""
    from scipy.spatial import ConvexHull

    return bool(np.isclose(np.abs(signed_areas(points, triangles)).sum(), ConvexHull(points).volume, rtol=1e-9))


def _hole_curves(outline: Any, holes: Named) -> list[tuple[str, Any]]:
    """Named curves of holes, those of a result of `read_outline` first."""
    own = list(outline.holes) if hasattr(outline, "holes") else []
    if own and len(holes):
        raise InputError("holes and an outline with holes: expected only one of them")
    return named("hole", own or holes)


def _triangles_inside(
    points: np.ndarray, outline: Any, holes: list[tuple[str, Any]], spacing: float | None
) -> tuple[np.ndarray, dict[str, Any]]:
    """Delaunay triangles inside an outline, or all but those of wide circles, and outside holes; the holes as polygons.

    Raises InputError if a point belongs to no triangle.
    """
    import shapely

    rough = spacing if spacing is not None else float(np.sqrt(np.ptp(points, axis=0).prod() / len(points)))

    def at(places: np.ndarray) -> np.ndarray:
        return np.full(len(places), STEP * rough)

    inner = [ring(name, curve, at) for name, curve in holes]
    polygons = {line.name: polygon(line) for line in inner}
    if outline is None:
        hull = shapely.MultiPoint(points).convex_hull.buffer(rough)
        sheet, triangles = hull.difference(shapely.union_all(list(polygons.values()))), delaunay(points, spacing)
    else:
        boundary = outline.boundary if hasattr(outline, "boundary") else outline
        sheet, triangles = region(ring("outline", boundary, at), inner, ()), triangles_of(points)
    room = sheet.buffer(BEYOND * rough)
    shapely.prepare(room)
    shapely.prepare(sheet)
    middle = points[triangles].mean(axis=1)
    kept = shapely.contains_xy(sheet, *middle.T)
    for corner in range(3):
        sides = points[triangles[:, [corner, (corner + 1) % 3]]]
        kept &= shapely.covers(room, shapely.linestrings(sides))
    lone = np.setdiff1d(np.arange(len(points)), triangles[kept])
    if len(lone):
        raise InputError(
            f"points[{lone[0]}] at {points[lone[0]].tolist()} has no triangle inside the outline or outside holes: "
            "expected points on and inside the sheet, close enough to each other"
        )
    return np.asarray(triangles[kept]), polygons


def _with_holes(points: np.ndarray, edges: np.ndarray, holes: dict[str, Any]) -> dict[str, np.ndarray]:
    """Rings by name, with the names of given holes; other rings have the numbers after these."""
    import shapely

    parts = ring_names(points, edges)
    if not holes:
        return parts
    outer = {name: ring for name, ring in parts.items() if not name.startswith("hole ")}
    rings = [ring for ring in boundary_rings(edges) if not any(np.isin(ring, each).all() for each in outer.values())]
    shapes = [shapely.Polygon(points[ring]) for ring in rings]
    found: dict[str, np.ndarray] = {}
    for name, hole in holes.items():
        around = [k for k, shape in enumerate(shapes) if shape.contains(hole.representative_point())]
        if not around:
            raise InputError(f"{name}: no triangle of the points lies in it: expected a hole wider than their spacing")
        found[name] = np.unique(rings[around[0]]).astype(np.int32)
    others = [ring for ring in rings if not any(np.isin(ring, each).all() for each in found.values())]
    numbers = (f"hole {k}" for k in itertools.count(1) if f"hole {k}" not in found)
    return {**outer, **found, **{next(numbers): np.unique(ring).astype(np.int32) for ring in others}}


def _notes_on_long(points: np.ndarray, triangles: np.ndarray) -> list[str]:
    """A note on triangles that are much longer than the edges around them, as where they cover a hole of the points."""
    edges = np.unique(np.sort(directed_edges(triangles), axis=1), axis=0)
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    ends = edges.ravel()
    order = np.lexsort((np.repeat(length, 2), ends))
    counts = np.bincount(ends, minlength=len(points))
    # Two of three edges at a point are shorter: at the edge of a lattice of long cells half of them are short.
    longer = np.cumsum(counts) - counts + 2 * counts // 3
    typical = np.repeat(length, 2)[order][np.minimum(longer, len(order) - 1)]
    sides = np.linalg.norm(points[triangles] - points[np.roll(triangles, -1, axis=1)], axis=2).max(axis=1)
    # One corner of a fan has long edges only.
    ratio = sides / np.median(typical[triangles], axis=1)
    if not (ratio > LONG).any():
        return []
    worst = int(np.argmax(ratio))
    place = ", ".join(f"{x:.4g}" for x in points[triangles[worst]].mean(axis=0))
    return [
        f"points: {int((ratio > LONG).sum())} triangles between them are up to {ratio[worst]:.2g} times as long as the "
        f"edges around, most at ({place}) m: a hole or notch of the points is covered; name it by holes= or outline="
    ]
