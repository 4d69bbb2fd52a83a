"""Selection of points of a shape by position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..device import checks
from ..device.checks import InputError, finite, positive, vector
from .edges import edge_points
from .regions import region_of
from .shape import Shape


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SelectableShape(Shape):
    """A shape whose points can be selected by position."""

    def __repr__(self) -> str:
        """One line."""
        extent = " x ".join(f"{length:.4g}" for length in self.extent)
        return f"{type(self).__name__}({extent} m, {self.size} points, spacing {self.spacing:.4g} m)"

    def as_cloud(self) -> Self:
        """Copy of the shape without its lattice or grid; bonds are then stored in a table."""
        return replace(self, lattice=None, grid=None)

    def _require_flat(self, what: str) -> None:
        if self.frames is not None:
            raise InputError(f"{what}: expected a flat sheet, got a curved one")

    def edges(self, *names: str) -> np.ndarray:
        """Indices of the points on named edges; "all" is the outline and all holes.

        Names are those in `parts` and, on a flat sheet, the sides of the bounding box: left, right, bottom, top. On a
        cloud, the points of a side are those within a quarter of a spacing.

        Raises:
            InputError: for any other name.
        """
        return region_of(edge_points(self, names), self.points)

    def nearest(self, x: float, y: float, z: float | None = None) -> int:
        """Index of the point nearest to (x, y), on a curved sheet to (x, y, z).

        Raises:
            InputError: if z is given on a flat sheet, or missing on a curved one.
        """
        if (z is None) != (self.frames is None):
            expected = "a number on a curved sheet" if z is None else "None on a flat sheet"
            raise InputError(f"z = {z!r}: expected {expected}")
        place = (finite("x", x), finite("y", y), *([] if z is None else [finite("z", z)]))
        return int(np.argmin(((self.points - place) ** 2).sum(axis=1)))

    def within(self, centre: tuple[float, ...], radius: float) -> np.ndarray:
        """Indices of the points no further than `radius` [m] from `centre`, (x, y), on a curved sheet (x, y, z)."""
        offset = self.points - vector("centre", centre, self.points.shape[1])
        reach = positive("radius", radius) * (1.0 + 1e-9)
        return region_of(np.flatnonzero(np.linalg.norm(offset, axis=1) <= reach), self.points)

    def where(self, condition: Callable[..., np.ndarray]) -> np.ndarray:
        """Indices of the points for which `condition(x, y)` holds, on a curved sheet `condition(x, y, z)`.

        Its arguments and its result have shape (N,).

        Raises:
            InputError: if `condition` is not a function, or does not return N booleans.
        """
        holds = checks.truth_values("condition", condition, *self.points.T)
        return region_of(np.flatnonzero(holds), self.points)
