"""Closed curves, for the outlines of sheets, holes and inclusions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..device.checks import InputError, numbers, positions, positive, show, vector

# Spacing [m] at points of shape (P, 2), shape (P,).
Spacing = Callable[[np.ndarray], np.ndarray]
# Places at which a smooth curve is sampled to measure its length.
DENSE = 2048
# Most points between two corners.
MAX_PIECES = 10_000_000


class Curve(Protocol):
    """A closed curve (interface)."""

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Sample points along the curve, about one spacing apart.

        Returns:
            Points [m], shape (M, 2), and the index of the side that begins at or contains each point, shape (M,).
        """
        ...


@dataclass(frozen=True, eq=False)
class Polygon:
    """A polygon; every corner becomes a point.

    Attributes:
        corners: Corners [m], shape (C, 2) with C >= 3, in either orientation; the last is connected to the first.
    """

    corners: Any

    def __post_init__(self) -> None:
        corners = positions("corners", self.corners)
        if len(corners) > 1 and np.array_equal(corners[0], corners[-1]):
            corners = corners[:-1]
        if len(corners) < 3:
            raise InputError(f"corners has {len(corners)} distinct points: expected 3 or more")
        object.__setattr__(self, "corners", corners)

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Points on the sides, see `Curve`."""
        found, side = [], []
        for number, (start, end) in enumerate(zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True)):
            points = spread_on_segment(start, end, spacing)[:-1]
            found.append(points)
            side.append(np.full(len(points), number))
        return np.concatenate(found), np.concatenate(side)


@dataclass(frozen=True)
class Circle:
    """A circle.

    Attributes:
        centre: Centre [m].
        radius: Radius [m].
    """

    centre: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        vector("centre", self.centre, 2)
        positive("radius", self.radius)

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Evenly spaced points on the circle, a multiple of four, see `Curve`."""

        def at(t: np.ndarray) -> np.ndarray:
            angle = 2.0 * np.pi * t
            return np.asarray(self.centre) + self.radius * np.column_stack([np.cos(angle), np.sin(angle)])

        return spread_on_curve(at, spacing, multiple=4)


@dataclass(frozen=True, eq=False)
class Spline:
    """A smooth closed curve through points: a periodic cubic spline parametrised by chord length.

    Attributes:
        through: Points [m], shape (C, 2) with C >= 3.
    """

    through: Any

    def __post_init__(self) -> None:
        through = Polygon(self.through).corners
        object.__setattr__(self, "through", through)

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Points on the curve, see `Curve`."""
        from scipy.interpolate import CubicSpline

        closed = np.vstack([self.through, self.through[:1]])
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
        spline = CubicSpline(length / length[-1], closed, bc_type="periodic")
        return spread_on_curve(lambda t: np.asarray(spline(t)), spacing)


@dataclass(frozen=True, eq=False)
class ParametricCurve:
    """A smooth closed curve given by a function.

    Attributes:
        function: Function from t in [0, 1], shape (T,), to points [m], shape (T, 2), equal at t = 0 and t = 1.
    """

    function: Callable[[np.ndarray], np.ndarray]

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Points on the curve, see `Curve`."""
        points = self._at(np.linspace(0.0, 1.0, 5))
        if np.linalg.norm(points[-1] - points[0]) > 1e-9 * np.ptp(points, axis=0).max():
            raise InputError(
                f"boundary function begins at {points[0].tolist()} and ends at {points[-1].tolist()}: "
                "expected a closed curve"
            )
        return spread_on_curve(self._at, spacing)

    def _at(self, t: np.ndarray) -> np.ndarray:
        points = numbers("boundary function", self.function(t))
        if points.shape != (len(t), 2):
            raise InputError(
                f"boundary function returned shape {points.shape} for {len(t)} numbers; expected shape ({len(t)}, 2)"
            )
        return points


def as_curve(name: str, given: Any) -> Curve:
    """Convert a user's argument (a curve, a function of t, or corners) to a curve."""
    if isinstance(given, type | str) or given is None:
        raise InputError(
            f"{name} = {show(given)}: expected a Polygon, Circle or Spline, a function of t, or corners of shape (C, 2)"
        )
    if hasattr(given, "sampled"):
        return given  # type: ignore[no-any-return]
    return ParametricCurve(given) if callable(given) else Polygon(given)


def spread_on_segment(start: np.ndarray, end: np.ndarray, spacing: Spacing) -> np.ndarray:
    """Points from start to end, both included, about a spacing apart [m], shape (M, 2), M of 2 or more."""

    def at(t: np.ndarray) -> np.ndarray:
        return np.asarray(start + t[:, None] * (np.asarray(end) - start))

    # The last is the end itself, without round-off.
    return np.vstack([at(spread_evenly(at, spacing, 1)[:-1]), end])


def spread_on_curve(
    at: Callable[[np.ndarray], np.ndarray], spacing: Spacing, multiple: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Points of a smooth closed curve, and zeros, the index of its single side."""
    t = spread_evenly(at, spacing, multiple)[:-1]
    if len(t) < 4:
        raise InputError(f"it has {len(t)} points at this spacing: expected 4 or more; reduce the spacing")
    return at(t), np.zeros(len(t), np.int64)


def spread_evenly(at: Callable[[np.ndarray], np.ndarray], spacing: Spacing, multiple: int) -> np.ndarray:
    """Parameters in [0, 1] of points about a spacing apart, with a multiple of `multiple` intervals."""
    dense = np.linspace(0.0, 1.0, DENSE + 1)
    points = at(dense)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    middle = spacing(0.5 * (points[1:] + points[:-1]))
    count = np.concatenate([[0.0], np.cumsum(step / middle)])
    if not count[-1] < MAX_PIECES:
        raise InputError(
            f"spacing: a curve gets {count[-1]:.3g} points: expected {MAX_PIECES} or fewer; take a coarser spacing"
        )
    pieces = max(1, round(float(count[-1]) / multiple)) * multiple
    return np.interp(np.linspace(0.0, count[-1], pieces + 1), count, dense)
