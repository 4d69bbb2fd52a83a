"""Shapes from point clouds."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device import checks
from ..device.checks import InputError, corners, one_of, positions, positive
from .lines import region, ring
from .seams import notes_on_pieces, require_distinct, require_met
from .shape import Shape
from .topology import boundary_edges, ring_names
from .triangulation import (
    counter_clockwise,
    delaunay,
    local_spacings,
    point_areas,
    refuse_coincident,
    signed_areas,
    triangles_of,
)

# Places on a curve, and how far a triangle may reach beyond it, both over the spacing.
STEP, BEYOND = 0.05, 0.1


def cloud(
    points: np.ndarray,
    triangles: np.ndarray | None,
    areas: np.ndarray | None,
    spacing: float | None,
    outline: Any = None,
    graded: bool = False,
) -> Shape:
    """A cloud of points; arguments as for `Sheet.from_points`."""
    points = positions("points", points)
    one_of("graded", graded, (True, False))
    if graded and spacing is not None:
        raise InputError(f"graded = True and spacing = {spacing!r}: expected only one of them")
    spacing = None if spacing is None else positive("spacing", spacing)
    if triangles is None:
        refuse_coincident(points)
    if outline is not None and triangles is not None:
        raise InputError("outline and triangles: expected only one of them")
    if outline is not None:
        triangles = _triangles_inside(points, outline, spacing)
    elif triangles is None:
        triangles = delaunay(points, spacing)
    triangles = counter_clockwise(points, corners("triangles", triangles, len(points)))
    require_distinct("points", points, triangles)
    require_met("triangles", points, triangles)
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
        parts=ring_names(points, edges),
        notes=tuple(notes_on_pieces("triangles", points, triangles)),
        spacings=spacings,
    )


def _is_convex(points: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether the triangles fill the convex hull of the points, so that no bond can leave them."""
    from scipy.spatial import ConvexHull

    return bool(np.isclose(np.abs(signed_areas(points, triangles)).sum(), ConvexHull(points).volume, rtol=1e-9))


def _triangles_inside(points: np.ndarray, outline: Any, spacing: float | None) -> np.ndarray:
    """Delaunay triangles inside an outline. Raises InputError if a point belongs to no triangle."""
    import shapely

    boundary, holes = (outline.boundary, outline.holes) if hasattr(outline, "holes") else (outline, ())
    rough = spacing if spacing is not None else float(np.sqrt(np.ptp(points, axis=0).prod() / len(points)))

    def at(places: np.ndarray) -> np.ndarray:
        return np.full(len(places), STEP * rough)

    inner = [ring(f"hole {number}", curve, at) for number, curve in enumerate(holes, start=1)]
    sheet = region(ring("outline", boundary, at), inner, ())
    room = sheet.buffer(BEYOND * rough)
    shapely.prepare(room)
    shapely.prepare(sheet)
    triangles = triangles_of(points)
    middle = points[triangles].mean(axis=1)
    kept = shapely.contains_xy(sheet, *middle.T)
    for corner in range(3):
        sides = points[triangles[:, [corner, (corner + 1) % 3]]]
        kept &= shapely.covers(room, shapely.linestrings(sides))
    lone = np.setdiff1d(np.arange(len(points)), triangles[kept])
    if len(lone):
        raise InputError(
            f"points[{lone[0]}] at {points[lone[0]].tolist()} has no triangle inside the outline: expected points on "
            "and inside the outline, close enough to each other"
        )
    return np.asarray(triangles[kept])
