"""Selections of points: those of named edges, and indices that remember the points they were selected from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ..device.checks import one_of
from .shape import Shape

SIDES = ("left", "right", "bottom", "top")
# Functions of NumPy that give indices if they are given indices.
JOINING = frozenset(
    {np.concatenate, np.hstack, np.append, np.unique, np.union1d, np.intersect1d, np.setdiff1d, np.sort, np.ravel}
)


class Region(np.ndarray):
    """Point indices, int32, with the points they were selected from, to detect use with another sheet.

    Slicing, and joining with other regions of the same points, preserve the region. A plain array, such as
    `np.array(region)`, is never checked.

    Attributes:
        of: Positions of these points [m], shape (N, 2), or None.
    """

    of: Any

    def __array_finalize__(self, obj: Any) -> None:
        """Copy `of` to views and copies."""
        self.of = getattr(obj, "of", None)

    def __array_function__(
        self, func: Callable[..., Any], types: Iterable[type], args: Iterable[Any], kwargs: Any
    ) -> Any:
        """Return a plain array from NumPy functions, except when joining regions of the same points."""
        result = super().__array_function__(func, types, args, kwargs)
        if func not in JOINING or type(result) not in (np.ndarray, Region):
            return result
        given = _regions(args)
        same = all(region.of is given[0].of for region in given)
        return region_of(result, given[0].of) if given and same and given[0].of is not None else np.asarray(result)

    def fits(self, points: Any) -> bool:
        """Whether it was selected from these points, shape (N, 2), or from equal ones."""
        return self.of is None or self.of is points or bool(np.array_equal(self.of, points))


def region_of(indices: np.ndarray, points: Any) -> Region:
    """Make a region from indices of points, shape (N, 2)."""
    region = np.asarray(indices, np.int32).view(Region)
    region.of = points
    return region


def _regions(arguments: Iterable[Any]) -> list[Region]:
    found: list[Region] = []
    for argument in arguments:
        if isinstance(argument, Region):
            found.append(argument)
        elif isinstance(argument, list | tuple):
            found += _regions(argument)
    return found


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
