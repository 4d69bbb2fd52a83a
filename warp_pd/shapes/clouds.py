"""Shapes from bare points."""

from __future__ import annotations

import numpy as np

from .. import checks
from ..checks import corners, positions, positive
from .shape import Shape
from .triangulation import counter_clockwise, delaunay, point_areas, refuse_coincident


def cloud(points: np.ndarray, triangles: np.ndarray | None, areas: np.ndarray | None, spacing: float | None) -> Shape:
    """A cloud of points; arguments as for `Sheet.from_points`."""
    points = positions("points", points)
    spacing = None if spacing is None else positive("spacing", spacing)
    refuse_coincident(points)
    if triangles is None:
        triangles = delaunay(points, spacing)
    triangles = counter_clockwise(points, corners("triangles", triangles, len(points)))
    areas = checks.one_each("areas", point_areas(points, triangles) if areas is None else areas, len(points))
    return Shape(
        points=points,
        areas=areas,
        triangles=triangles,
        spacing=spacing if spacing is not None else float(np.sqrt(areas.mean())),
    )
