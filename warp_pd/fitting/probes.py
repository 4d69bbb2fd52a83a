"""Measures with a known derivative by the displacement, for which one adjoint solve gives all derivatives.

Each is a function of the built simulation and a frame, as for `Measure.value`, with a method `gradient`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..device.checks import InputError, one_of, point_indices
from ..geometry.sheet import Sheet
from ..geometry.triangulation import places_on_triangles
from ..interfaces.frame import Frame
from ..run.built import Built
from .equilibrium import Equilibrium

AXES = "xyz"


@runtime_checkable
class Probe(Protocol):
    """A measure with a derivative."""

    def __call__(self, built: Built, frame: Frame) -> float:
        """The value; only displacement and time of the frame are used."""
        ...

    def gradient(self, state: Equilibrium) -> np.ndarray:
        """Derivative by the displacement of free components, shape (N, 3); other components are ignored."""
        ...


@dataclass(frozen=True, eq=False)
class Deflection:
    """Mean displacement of points along an axis [m].

    Attributes:
        points: Point index or indices.
        axis: "x", "y" or "z".
    """

    points: Any
    axis: str = "z"

    def __post_init__(self) -> None:
        one_of("Deflection.axis", self.axis, AXES)

    def __call__(self, built: Built, frame: Frame) -> float:
        """The displacement [m]."""
        return float(frame.displacement[self._indices(len(frame.displacement)), AXES.index(self.axis)].mean())

    def gradient(self, state: Equilibrium) -> np.ndarray:
        """Derivative of the mean by each displacement: 1 / n along the axis at each of the n points, else 0."""
        out = np.zeros(state.free.shape)
        points = self._indices(len(out))
        out[points, AXES.index(self.axis)] = 1.0 / len(points)
        return out

    def _indices(self, size: int) -> np.ndarray:
        return point_indices("Deflection.points", np.atleast_1d(self.points), size)


@dataclass(frozen=True, eq=False)
class SupportForce:
    """Force of a support on its points, along an axis [N].

    Attributes:
        points: Indices of points held along the axis.
        axis: "x", "y" or "z".
    """

    points: Any
    axis: str = "x"

    def __post_init__(self) -> None:
        one_of("SupportForce.axis", self.axis, AXES)

    def __call__(self, built: Built, frame: Frame) -> float:
        """The force [N] at the last evaluation of the forces."""
        points = point_indices("SupportForce.points", self.points, built.context.sheet.size)
        return float(-built.to_numpy(built.state.force)[points, AXES.index(self.axis)].sum())

    def gradient(self, state: Equilibrium) -> np.ndarray:
        """The gradient: rows of the (symmetric) stiffness at these points."""
        unit = np.zeros(state.free.shape)
        points = point_indices("SupportForce.points", self.points, len(unit))
        unit[points, AXES.index(self.axis)] = 1.0
        if (state.free & (unit > 0.0)).any():
            raise InputError(f"SupportForce.points: expected points that are supported along {self.axis}")
        return state.internal_product(unit)


@dataclass(frozen=True, eq=False)
class PointField:
    """Displacements at positions on the undeformed sheet, linear on its triangles, for camera measurements.

    Attributes:
        weights: Sparse interpolation matrix, shape (M, N).
        inside: Mask of the requested places that are on the sheet.
    """

    weights: Any
    inside: np.ndarray = field(repr=False)

    @staticmethod
    def at(sheet: Sheet, places: np.ndarray, tolerance: float = 0.02) -> PointField:
        """Create the probe for places [m], shape (M, 2) or (M, 3), on the clamped, undeformed sheet.

        Places more than `tolerance` spacings outside the sheet are dropped. Raises InputError if none is on it.
        """
        from scipy import sparse

        if len(sheet.triangles) == 0:
            raise InputError("PointField: expected a sheet with triangles")
        where = np.zeros((len(places), 3))
        where[:, : places.shape[1]] = places
        triangle, fraction, _ = places_on_triangles(sheet.positions[sheet.triangles], where)
        gap = np.maximum(0.0, -fraction.min(axis=1)) * np.sqrt(2.0)
        inside = gap <= tolerance
        if not inside.any():
            raise InputError(f"places: none of {len(places)} is on the sheet: expected m, from its origin")
        points = sheet.triangles[triangle[inside]]
        kept = int(inside.sum())
        entries = fraction[inside].ravel(), (np.repeat(np.arange(kept), 3), points.ravel())
        return PointField(sparse.csr_matrix(entries, shape=(kept, sheet.size)), inside)

    def values(self, frame: Frame) -> np.ndarray:
        """Displacements [m], shape (M, 3)."""
        return np.asarray(self.weights @ frame.displacement)
