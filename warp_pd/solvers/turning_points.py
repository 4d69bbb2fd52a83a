"""Limit points and bifurcations between two points of a path of equilibria."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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
    """

    step: int
    factor: float
    rate: float
    negative: int | None
    lowest: list[float]


def changes(before: Point, after: Point, length: float) -> list[dict[str, Any]]:
    """Limit points and bifurcations between two points at the distance `length` [m].

    At a limit point the load turns and one eigenvalue changes sign; if others change sign, there is a bifurcation.
    Positions are found on the cubic through both points with their slopes.

    Returns:
        An entry for each limit point and bifurcation: kind, load factor, steps before and after, and number of
        eigenvalues that change sign.
    """
    found: list[dict[str, Any]] = []
    # x runs from 0 to 1 between the points.
    a, b, da, db = before.factor, after.factor, before.rate * length, after.rate * length
    cubic = np.polynomial.Polynomial([a, da, 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db])

    def add(kind: str, x: float, crossing: int) -> None:
        steps = [before.step, after.step]
        found.append({"kind": kind, "load_factor": float(cubic(x)), "steps": steps, "eigenvalues": crossing})

    turns = before.step > 0 and da * db < 0.0
    if turns:
        roots = cubic.deriv().roots()
        add("maximum" if da > 0.0 else "minimum", float(min(roots.real, key=lambda x: abs(x - 0.5))), 1)
    if before.negative is None or after.negative is None:
        return found
    crossing = abs(after.negative - before.negative) - int(turns)
    if crossing > 0:
        add("bifurcation", _zero(before, after), crossing)
    return found


def _zero(before: Point, after: Point) -> float:
    """Fraction (0 to 1) at which the first eigenvalue that changes sign is zero, by linear interpolation."""
    k = min(before.negative or 0, after.negative or 0)
    if k < min(len(before.lowest), len(after.lowest)):
        a, b = before.lowest[k], after.lowest[k]
        if a * b < 0.0:
            return a / (a - b)
    return 0.5
