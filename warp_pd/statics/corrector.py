"""Newton's corrector of arc-length continuation: equilibrium in a plane normal to the path, and the path's tangent.

Limit points and bifurcations are found between two points of the path.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..context import Context
from ..device.fields import assign, doubles
from ..interfaces import BuiltLaw, FrameSink
from ..interfaces.solver import ENDED, NOT_CONVERGED
from .descent import UNTURNED
from .newton_settings import PathSettings
from .stability import stability
from .static_rounds import MAX_ROUNDS
from .static_system import StaticSystem

# Accuracy of the linear solves, and the fraction of the largest increment used to difference loads.
ACCURACY, DIFFERENCE = 1e-6, 0.1
# The same difference with contact, over that without: no further point should touch a body within it.
TOUCHING = 1e-3


@dataclass
class Progress:
    """State of the path.

    Attributes:
        step: Index of the last point; the start is 0.
        factor: Load factor.
        rate: Derivative of the load factor by the arc length [1/m].
        length: Next step length [m], the root mean square of the displacement.
        negative: Number of negative eigenvalues of the tangent, or None.
        lowest: Lowest eigenvalues, see `Stability`.
        found: Limit points and bifurcations: kind, load_factor, step, number of eigenvalues that change sign, and
            whether the path switched to the other branch there.
        tears: Whether the damage field grows, so that its energy controls the path.
        release: By how much the energy of the field grows in the next such step, over `BuiltRupture.tear_energy`.
        heading: Sign of the change of the load factor in the last step.
    """

    step: int = 0
    factor: float = 0.0
    rate: float = 0.0
    length: float = 0.0
    negative: int | None = None
    lowest: list[float] = field(default_factory=list)
    found: list[dict[str, Any]] = field(default_factory=list)
    tears: bool = False
    release: float = 1.0
    heading: float = 1.0


@dataclass(frozen=True)
class Origin:
    """The point that a step starts from.

    Attributes:
        displacement: Displacement [m], shape (N, 3).
        direction: Derivative of the displacement by the arc length [-], shape (N, 3).
        factor: Load factor.
        rate: Derivative of the load factor by the arc length [1/m].
    """

    displacement: np.ndarray
    direction: np.ndarray
    factor: float
    rate: float


class Corrector(StaticSystem):
    """Equilibria at a distance from a point of the path, and the direction of the path there.

    Attributes:
        state: State of the path.
        failure: Why the last step failed.
        status: Status of the run if the path ends with this step.
        corrected: Corrector steps of the last point before the first update of the multipliers of contact.
    """

    name = "ArcLength"
    definite = False
    factorised = 20_000
    settings: PathSettings

    def __init__(self, settings: PathSettings, context: Context, law: BuiltLaw) -> None:
        super().__init__(settings, context, law)
        self.state = Progress()
        self.failure, self.status, self.corrected = "", ENDED, 1

    def host_state(self) -> dict[str, Any]:
        """The state of the path, for a bitwise identical restart."""
        return {**super().host_state(), "path": asdict(self.state)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        super().restore(state)
        self.state = Progress(**state["path"])

    def fail(self, reason: str, status: str = ENDED) -> bool:
        """Record why a step failed, and the status of a run that ends with it; return False."""
        self.failure, self.status = reason, status
        return False

    def fail_to_converge(self, residual: float) -> bool:
        """Record that Newton's method ended at a residual; return False."""
        return self.fail(f"Newton's method ended at a residual of {residual:.2g}", NOT_CONVERGED)

    def position(self) -> np.ndarray:
        """The current displacement [m], shape (N, 3)."""
        return doubles(self.levels[0].displacement)

    def tangent_at(self, factor: float, sign: float) -> np.ndarray | None:
        """Derivative of the displacement by the load factor [m] at the current equilibrium; None if it is singular.

        `sign` is the direction in which loads are differenced, 1 or -1.
        """
        level = self.levels[0]
        self.set_loads(factor)
        level.evaluate()
        if not self.linearise(0, level.tangent.min_tension(self.tolerance)):
            return None
        along = self._along(factor, sign)
        size = norm(along)
        return along if math.isfinite(size) and size > 0.0 else None

    def point(self, factor: float, rate: float) -> Point:
        """The current equilibrium as the next point of the path, with its stability."""
        step, modes = self.state.step + 1, self.settings.modes
        found = stability(self.levels[0], self.solvers[0], modes) if modes else None
        if found is None:
            return Point(step, factor, rate, None, [])
        return Point(step, factor, rate, found.negative, found.lowest, found.mode)

    def move_to(self, point: Point) -> None:
        """Make a point the last one of the path."""
        state = self.state
        state.heading = math.copysign(1.0, point.factor - state.factor)
        state.step, state.factor, state.rate = point.step, point.factor, point.rate
        state.negative, state.lowest = point.negative, point.lowest

    def record(self, kind: str, factor: float, step: int, eigenvalues: int, switched: bool = False) -> None:
        """Record a limit point or bifurcation."""
        self.state.found.append(
            {"kind": kind, "load_factor": factor, "step": step, "eigenvalues": eigenvalues, "switched": switched}
        )

    def correct(self, origin: Origin, length: float, sink: FrameSink) -> tuple[float, dict[str, Any]]:
        """Find equilibrium in the normal plane at a distance; return the load factor and a report entry."""
        level, products = self.levels[0], self.solvers[0].products
        factor = origin.factor + length * origin.rate
        there = origin.displacement + length * origin.direction
        residuals: list[float] = []
        fractions: list[float] = []
        converged, begin, first, rounds = False, 0, 0, 0
        while True:
            iteration = len(residuals) - begin
            self.set_loads(factor)
            assign(level.displacement, np.where(level.held, self.target(0, factor), there))
            relative = self.sizes.relative(*(sums := level.evaluate()))
            residuals.append(relative)
            sink.progress(iteration, relative, self.tolerance)
            converged = relative <= self.tolerance
            if converged:
                self.sizes.largest = max(self.sizes.largest, sums[1])
                if self.rounds.update_multipliers():
                    begin, rounds = len(residuals), rounds + 1
                    first = first or begin
                    if rounds < MAX_ROUNDS:
                        continue
                    converged = False
                    break
            grows = iteration > 1 and residuals[-1] > residuals[-2] > residuals[-3]
            if converged or grows or not math.isfinite(relative) or iteration == self.settings.most_iterations:
                break
            if not self.linearise(0, level.tangent.min_tension(relative)):
                break
            rest = self._solve(doubles(level.residual))
            along = self._along(factor, math.copysign(1.0, origin.rate))
            across = mean_product(origin.direction, along)
            if across == 0.0:
                break
            gap = length - mean_product(origin.direction, there - origin.displacement)
            change = (gap - mean_product(origin.direction, rest)) / across
            step = rest + change * along
            assign(level.direction, step)
            fraction = min(1.0, UNTURNED * level.longest_step())
            there, factor = there + fraction * step, factor + fraction * change
            fractions.append(fraction)
        # Rounds of contact do not tell how curved the path is.
        self.corrected = (first or len(residuals)) - 1
        return factor, {
            "points": level.points, "converged": converged, "residuals": residuals,
            "shares": fractions, "products": self.solvers[0].products - products,
        }  # fmt: skip

    def _along(self, factor: float, sign: float) -> np.ndarray:
        """Derivative of the displacement by the load factor [m], shape (N, 3), at the current point."""
        level, ahead = self.levels[0], DIFFERENCE * self.settings.increment * sign
        if level.contacts:
            ahead *= TOUCHING
        # Schedules may end with the load.
        ahead = -ahead if abs(factor + ahead) > 1.0 else ahead
        here = doubles(level.residual)
        self.set_loads(factor + ahead)
        level.run("evaluate")
        load = (level.residual.numpy() - here) / ahead
        self.set_loads(factor)
        motion = np.zeros_like(load)
        held = level.held
        if held.any():
            motion[held] = ((self.target(0, factor + ahead) - self.target(0, factor)) / ahead)[held]
        if motion.any():
            assign(level.vector, motion)
            level.run("product")
            load -= level.image.numpy()
        return np.asarray(self._solve(load) + motion)

    def _solve(self, force: np.ndarray) -> np.ndarray:
        """Displacement x [m] with K x = force [N], both of shape (N, 3)."""
        self.solvers[0].solve(force, ACCURACY)
        return doubles(self.levels[0].direction)


def mean_product(a: np.ndarray, b: np.ndarray) -> float:
    """Mean over points of the scalar product of two fields of shape (N, 3)."""
    return float(np.einsum("ic,ic->", a, b)) / len(a)


def norm(a: np.ndarray) -> float:
    """Root mean square over points of a field of shape (N, 3)."""
    return math.sqrt(mean_product(a, a))


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
