"""Limit points and bifurcations between two points of a path of equilibria."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Point:
    """A point of a path.

    Attributes:
        step: Index of the point.
        factor: Load factor.
        rate: Derivative of the load factor by the arc length [1/m].
        negative: Number of negative eigenvalues of the tangent, or None if unknown.
        lowest: Lowest eigenvalues, in ascending order.
        mode: Eigenvector of the one nearest to zero, shape (N, 3), if known.
    """

    step: int
    factor: float
    rate: float
    negative: int | None
    lowest: list[float]
    mode: np.ndarray | None = None

    def eigenvalue(self, index: int) -> float:
        """Eigenvalue with a given index, lowest first; if fewer are known, the one nearest to zero, or NaN."""
        return self.lowest[index] if index < len(self.lowest) else min(self.lowest, key=abs, default=math.nan)


@dataclass(frozen=True)
class Change:
    """A limit point or bifurcation between two points of a path.

    Attributes:
        place: Estimated position between the points, from 0 to 1.
        kind: "maximum" or "minimum" of the load, or "bifurcation".
        eigenvalues: Number of eigenvalues that change sign.
        first: Index of the first of them.
    """

    place: float
    kind: str
    eigenvalues: int
    first: int = 0

    def size(self, point: Point) -> float:
        """Absolute value at a point of the quantity that is zero at the change: rate or eigenvalue."""
        return abs(point.eigenvalue(self.first) if self.kind == "bifurcation" else point.rate)


def changes(before: Point, after: Point, length: float) -> list[Change]:
    """Limit points and bifurcations between two points that are `length` [m] apart, in order.

    At a limit point the load has an extremum and one eigenvalue changes sign; if others change sign, there is a
    bifurcation. A limit point is found from the cubic through both points with their slopes, a bifurcation by linear
    interpolation of an eigenvalue.
    """
    found = []
    # x goes from 0 to 1 between the points.
    a, b, da, db = before.factor, after.factor, before.rate * length, after.rate * length
    turns = before.step > 0 and da * db < 0.0
    if turns:
        cubic = np.polynomial.Polynomial([a, da, 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db])
        place = float(min(cubic.deriv().roots().real, key=lambda x: abs(x - 0.5)))
        found.append(Change(place, "maximum" if da > 0.0 else "minimum", 1))
    if before.negative is not None and after.negative is not None:
        crossing = abs(after.negative - before.negative) - int(turns)
        if crossing > 0:
            first = min(before.negative, after.negative)
            a, b = before.eigenvalue(first), after.eigenvalue(first)
            found.append(Change(a / (a - b) if a * b < 0.0 else 0.5, "bifurcation", crossing, first))
    return sorted(found, key=lambda change: change.place)
