"""Points on the named edges of a shape."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..device.checks import one_of
from .shape import Shape

SIDES = ("left", "right", "bottom", "top")


def edge_points(shape: Shape, names: tuple[str, ...]) -> np.ndarray:
    """Indices of the points on the named edges; arguments as for `Sheet.edges`.

    They are ascending, except those of one part, which are in its order.
    """
    known = {**_sides(shape), **shape.parts} if shape.frames is None else dict(shape.parts)
    if len(names) == 1 and names[0] in shape.parts:
        return np.asarray(shape.parts[names[0]])
    chosen = np.zeros(shape.size, bool)
    for name in names or ("all",):
        if name == "all" and name not in known:
            known["all"] = whole_edge(shape, known)
        if name not in known:
            one_of("edge", name, {**known, "all": None})
        chosen[known[name]] = True
    return np.flatnonzero(chosen)


def whole_edge(shape: Shape, known: Mapping[str, np.ndarray]) -> np.ndarray:
    """Mask of the points on the outline and around all holes, shape (N,); cracks and cuts do not count."""
    outer = known if shape.frames is not None else [name for name in known if name.startswith("outline")] or SIDES
    chosen = np.zeros(shape.size, bool)
    for name in {*outer, *(name for name in known if name.startswith("hole "))}:
        chosen[known[name]] = True
    return chosen


def _sides(shape: Shape) -> dict[str, np.ndarray]:
    """Points within a quarter of a spacing of the sides of the bounding box; on a lattice exactly on the sides."""
    tolerance = shape.spacing * (1e-6 if shape.lattice else 0.25)
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    return {
        "left": shape.points[:, 0] < low[0] + tolerance,
        "right": shape.points[:, 0] > high[0] - tolerance,
        "bottom": shape.points[:, 1] < low[1] + tolerance,
        "top": shape.points[:, 1] > high[1] - tolerance,
    }
