"""A path of equilibria by pseudo-arclength: predictor along the tangent, Newton corrector in the normal plane.

Where a damage field grows, its energy controls the path instead; see _tear.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.fields import assign
from ..interfaces import FrameSink, System, Tangent
from .level import OWNER
from .newton_settings import PathSettings
from .stability import stability
from .static_rupture import Kept, put_back
from .static_system import FINISHED, NOT_CONVERGED, StaticSystem
from .tears import load_factor
from .turning_points import Change, Point, changes

# Accuracy of the linear solves, and the fraction of the largest increment used to difference loads.
ACCURACY, DIFFERENCE = 1e-6, 0.1
# The same difference with contact, over that without: no further point should touch a body within it.
TOUCHING = 1e-3
# Desired number of corrector steps, and desired error of the predicted load, divided by the largest increment.
AIMED_STEPS, AIMED_MISS = 4.0, 0.25
LEAST_GROWTH, MOST_GROWTH = 0.5, 2.0
# The search for a limit point or bifurcation ends when the rate or eigenvalue is SHARP times that at the adjacent
# points, or after MOST_LANDINGS attempts.
SHARP, MOST_LANDINGS = 0.01, 10
# Tears: relative change of the load factor at which a step has settled, and growth of the energy of the damage field,
# over what was wanted, below which the tear has stopped.
STILL, GROWS = 1e-4, 1e-3
# Rounds of alternate minimisation after which such a step counts as failed.
MOST_ROUNDS = 100
# Smallest growth, over `BuiltRupture.tear_energy`, down to which the last ligament of a falling load is followed.
LEAST_RELEASE = 1.0 / 16.0
# Cosine of the angle between the directions of two steps below which the second is on another branch.
SAME_BRANCH = 0.5


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


class Path(StaticSystem):
    """A path of equilibria of one simulation.

    Attributes:
        settings: Settings of the solver.
        direction: Derivative of the displacement by the arc length [-], (N,) vec3.
        state: State of the path.
    """

    name = "ArcLength"
    definite = False
    factorised = 20_000
    settings: PathSettings

    def __init__(self, settings: PathSettings, system: System, tangent: Tangent) -> None:
        """Add all stages.

        Raises:
            InputError: if the sheet or `switch` does not allow the preconditioner, or bonds can break without a
                damage field.
        """
        if system.rupture is not None and not system.rupture.tear_energy:
            raise InputError(f"{system.rupture.label}: expected TearingEnergy with ArcLength, or the solver Newton")
        super().__init__(settings, system, tangent)
        contacts = self.levels[0].contacts
        if system.rupture is not None and contacts:
            raise InputError(f"{contacts[0].label}: expected no damage with ArcLength, or the solver Newton")
        if settings.switch and self.preconditioner != "direct":
            raise InputError(
                f"switch = {settings.switch!r}: expected preconditioner = 'direct', whose factorisation finds "
                f"bifurcations, got {self.preconditioner!r}"
            )
        context = system.context
        self.direction = context.array(
            "path_direction", OWNER, context.types.vec3, shape=context.sheet.size, restart=True
        )
        self.state = Progress()
        self.tear_energy = 0.0 if system.rupture is None else system.rupture.tear_energy
        self.kept: Kept = []
        # Corrector steps of the last point, before contact settled.
        self.corrected = 1
        # Why the last step failed, and why the path ended early.
        self.failure, self.ended = "", ""

    def host_state(self) -> dict[str, Any]:
        """The state of the path, for a bitwise identical restart."""
        return {**super().host_state(), "path": asdict(self.state)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        super().restore(state)
        self.state = Progress(**state["path"])

    def run(self, sink: FrameSink) -> str:
        """Follow the path; return the final status."""
        self._start_report(sink)
        self._stiffen()
        state, finest = self.state, self.levels[0]
        while state.step < self.settings.most_steps and abs(state.factor) < 1.0:
            wp.copy(self.good, finest.displacement)
            self.kept = self.irreversible()
            if not (self._begin_path(sink) if state.step == 0 else self._advance(sink)):
                wp.copy(finest.displacement, self.good)
                self.set_loads(state.factor)
                sink.residual = self.sizes.relative(*finest.evaluate())
                self.ended = self.failure
                sink.solve = self._summary(state.factor)
                return NOT_CONVERGED
            self._record(sink, state.factor)
        return FINISHED

    def _summary(self, reached: float) -> dict[str, Any]:
        return {**super()._summary(reached), "found": self.state.found, "ended": self.ended}

    # Steps ---------------------------------------------------------------------------------------------

    def _begin_path(self, sink: FrameSink) -> bool:
        """Find the first point by Newton's method at a fixed load factor; return whether it was found."""
        level, factor = self.levels[0], min(1.0, self.settings.increment)
        start = level.displacement.numpy().astype(np.float64)
        cuts = 0
        while cuts <= self.settings.most_cuts:
            converged, sink.residual = self._load_step(factor, sink)
            if converged and self._unsettled():
                found = self._settle(factor, sink)
                self.report.load_steps[-1]["lattices"].append(found)
                converged, sink.residual = found["converged"], found["residuals"][-1]
            if not converged:
                self.failure = f"Newton's method ended at a residual of {sink.residual:.2g}"
            elif self.tear_energy:
                # As by a cut with the profile of a crack, damage may grow from the smallest load.
                here = level.displacement.numpy().astype(np.float64)
                arrived = self._alternate(here, (here - start) / factor, factor, factor, sink)
                converged, factor = arrived is not None, arrived or factor
            if converged:
                secant = level.displacement.numpy().astype(np.float64) - start
                length = norm(secant)
                if length == 0.0 and level.contacts and factor < 1.0:
                    # The body does not touch the sheet yet.
                    factor = min(1.0, factor + self.settings.increment)
                    continue
                if length == 0.0:
                    raise InputError(
                        "solver = ArcLength: expected a load or a motion that changes with the load factor"
                    )
                origin = Origin(start, secant / length, 0.0, factor / length)
                return self._accept(origin, factor, length, sink)
            self._return()
            factor, cuts = 0.5 * factor, cuts + 1
        return False

    def _advance(self, sink: FrameSink) -> bool:
        """Find the next point of the path; return whether it was found."""
        level, state = self.levels[0], self.state
        origin = Origin(
            level.displacement.numpy().astype(np.float64), self.direction.numpy().astype(np.float64), state.factor,
            state.rate,
        )  # fmt: skip
        for _ in range(self.settings.most_cuts + 1):
            if self._tear(origin, sink) if state.tears else self._step(origin, sink):
                return True
            self._return()
        return False

    def _return(self) -> None:
        """Return to the last point of the path; the next step is shorter."""
        wp.copy(self.levels[0].displacement, self.good)
        put_back(self.kept)
        self.state.length *= LEAST_GROWTH
        self.state.release *= LEAST_GROWTH

    def _step(self, origin: Origin, sink: FrameSink) -> bool:
        """Try one step of the current length; return whether it stayed on the path."""
        length, increment = self.state.length, self.settings.increment
        predicted = origin.factor + length * origin.rate
        entry: dict[str, Any] = {"share": predicted, "converged": False, "rounds": 0, "lattices": []}
        self.report.load_steps.append(entry)
        if abs(predicted) >= 1.0:
            remaining = (math.copysign(1.0, predicted) - origin.factor) / origin.rate
            assign(self.levels[0].displacement, origin.displacement + remaining * origin.direction)
            factor, found = self._end(origin, LEAST_GROWTH * remaining, MOST_GROWTH * remaining, sink)
        else:
            factor, found = self._correct(origin, length, sink)
            if found["converged"] and abs(factor) > 1.0:
                # As where contact stiffens the sheet.
                factor, found = self._end(origin, 0.0, length, sink)
        entry |= {"share": factor, "lattices": [found]}
        miss = abs(factor - predicted)
        if not found["converged"]:
            residual = found["residuals"][-1]
            self.failure = (
                "the equilibrium at the final load lies on another branch" if residual <= self.tolerance
                else f"Newton's method ended at a residual of {residual:.2g}"
            )  # fmt: skip
            return False
        if abs(factor) > 1.0 or miss > increment:
            self.failure = f"the load factor missed its prediction by {miss:.2g}"
            return False
        if sum(contact.passed() for contact in self.levels[0].contacts):
            self.failure = "a body passed through the sheet"
            return False
        if self.rupture.breaks(0):
            self.state.tears, self.failure = True, "the damage grows"
            return False
        sink.residual = found["residuals"][-1]
        growth = math.sqrt(AIMED_STEPS / max(1, self.corrected))
        if miss > 0.0:
            growth = min(growth, math.sqrt(AIMED_MISS * increment / miss))
        growth = min(MOST_GROWTH, max(LEAST_GROWTH, growth))
        entry["converged"] = self._accept(origin, factor, growth * length, sink)
        if not entry["converged"]:
            self.failure = (
                "the equilibrium found lies on another branch, or where the path turns by more than 60 degrees"
            )
        return bool(entry["converged"])

    def _end(self, origin: Origin, least: float, most: float, sink: FrameSink) -> tuple[float, dict[str, Any]]:
        """Find equilibrium at the final load factor; reject it if the load turned before, or if it is far away.

        Args:
            origin: The point before it.
            least: Smallest distance from there [m].
            most: Largest distance [m].
            sink: Where progress goes.
        """
        level, factor = self.levels[0], math.copysign(1.0, origin.factor)
        self.set_loads(factor)
        found = self._settle(factor, sink)
        moved = mean_product(origin.direction, level.displacement.numpy() - origin.displacement)
        found["converged"] &= least < moved < most
        return factor, found

    def _unsettled(self) -> bool:
        """Settle contact; return whether equilibrium must be found again."""
        return sum(contact.settle() for contact in self.levels[0].contacts) > 0

    def _settle(self, factor: float, sink: FrameSink) -> dict[str, Any]:
        """Find equilibrium with settled contact at a load factor; return a report entry."""
        found = self._descend(0, factor, sink, self.tolerance)
        while found["converged"] and self._unsettled():
            further = self._descend(0, factor, sink, self.tolerance, "a round of contact")
            for name in ("residuals", "shares", "products"):
                further[name] = found[name] + further[name]
            found = further
        return found

    def _accept(self, origin: Origin, factor: float, length: float, sink: FrameSink) -> bool:
        """Accept the current equilibrium as the next point unless it is on another branch; return whether it was.

        If there is a limit point or bifurcation before it, that becomes the next point. `length`: next step length [m].
        """
        state, ahead = self.state, self._look(origin, factor)
        if ahead is None:
            return False
        direction, after = ahead
        switched = bool(state.found) and state.found[-1]["switched"] and state.found[-1]["step"] == state.step
        before = Point(state.step, state.factor, origin.rate, None if switched else state.negative, state.lowest)
        change, direction, here = self._land(origin, before, after, direction, sink)
        state.step, state.factor, state.rate = here.step, here.factor, here.rate
        state.negative, state.lowest = here.negative, here.lowest
        if change is not None:
            if before.negative is not None and after.negative is not None:
                # Eigenvalues that are zero here count as those of the next point.
                gained = math.copysign(change.eigenvalues, after.negative - before.negative)
                state.negative = before.negative + int(gained)
            direction = self._pass(change, direction, here)
        state.length = min(length, self.settings.increment / abs(state.rate) if state.rate else math.inf)
        state.heading = math.copysign(1.0, state.factor - origin.factor)
        assign(self.direction, direction)
        return True

    def _look(self, origin: Origin, factor: float) -> tuple[np.ndarray, Point] | None:
        """Direction of the path at the current equilibrium, and the point; None on another branch."""
        ahead, state, settings = self._tangent(origin, factor), self.state, self.settings
        if ahead is None:
            return None
        found = stability(self.levels[0], self.solvers[0], settings.modes) if settings.modes else None
        if found is None:
            return ahead[0], Point(state.step + 1, factor, ahead[1], None, [])
        return ahead[0], Point(state.step + 1, factor, ahead[1], found.negative, found.lowest, found.mode)

    def _land(
        self, origin: Origin, before: Point, after: Point, direction: np.ndarray, sink: FrameSink
    ) -> tuple[Change | None, np.ndarray, Point]:
        """Find the first change before the current equilibrium and move there; return it, the direction and the point.

        Without a change, or if it cannot be found, the current equilibrium remains.
        """
        level, low, found, here = self.levels[0], 0.0, None, (direction, after)
        arrived = level.displacement.numpy().astype(np.float64)
        high = mean_product(origin.direction, arrived - origin.displacement)
        for attempt in range(MOST_LANDINGS):
            between = changes(before, after, high - low)
            if not between:
                break
            change = between[0]
            # Every second attempt bisects, because before the change another mode may have the lowest eigenvalue.
            place = low + (0.5 if attempt % 2 else change.place) * (high - low)
            factor, entry = self._correct(origin, place, sink)
            self.report.load_steps[-1]["lattices"].append(entry)
            ahead = self._look(origin, factor) if entry["converged"] else None
            if ahead is None:
                break
            sizes, (_, point) = (change.size(before), change.size(after)), ahead
            found, here, arrived = change, ahead, level.displacement.numpy().astype(np.float64)
            if change.size(point) <= SHARP * max(sizes):
                break
            if changes(before, point, place - low):
                after, high = point, place
            else:
                before, low = point, place
        assign(level.displacement, arrived)
        self.set_loads(here[1].factor)
        return found, *here

    def _pass(self, change: Change, direction: np.ndarray, here: Point) -> np.ndarray:
        """Record a limit point or bifurcation at the current point; return the direction on the branch to follow."""
        state = self.state
        number = 1 + sum(found["kind"] == "bifurcation" for found in state.found)
        switch = change.kind == "bifurcation" and number == self.settings.switch and here.mode is not None
        state.found.append({
            "kind": change.kind, "load_factor": here.factor, "step": here.step, "eigenvalues": change.eigenvalues,
            "switched": switch,
        })  # fmt: skip
        if switch or change.kind != "bifurcation":
            state.rate = 0.0
        if not switch or here.mode is None:
            return direction
        mode = here.mode - mean_product(here.mode, direction) * direction
        return np.asarray(mode / norm(mode))

    def _tangent(self, origin: Origin, factor: float) -> tuple[np.ndarray, float] | None:
        """Direction of the path at the current point and the rate of the load factor; None on another branch."""
        level = self.levels[0]
        self.set_loads(factor)
        level.evaluate()
        if not self.linearise(0, level.tangent.min_tension(self.tolerance)):
            return None
        along = self._along(factor, math.copysign(1.0, origin.rate))
        size = norm(along)
        if not (math.isfinite(size) and size > 0.0):
            return None
        # The start may be no equilibrium, as with a constant load or of a prestretched sheet with a free edge: the path
        # begins at its first point, along a rising load.
        if self.state.step > 0:
            cosine = mean_product(along, origin.direction) / size
            if abs(cosine) < SAME_BRANCH:
                return None
            size = math.copysign(size, cosine)
        return along / size, 1.0 / size

    # Tears ---------------------------------------------------------------------------------------------

    def _tear(self, origin: Origin, sink: FrameSink) -> bool:
        """Try one step in which the energy of the damage field grows by `release`; return whether it was found.

        The load factor changes by at most `increment`.
        """
        entry: dict[str, Any] = {"share": origin.factor, "converged": False, "rounds": 0, "lattices": []}
        self.report.load_steps.append(entry)
        stored, sign, begin = self.rupture.energy(), math.copysign(1.0, origin.factor), abs(origin.factor)
        most = min(1.0, begin + self.settings.increment)
        motion = sign * origin.direction / origin.rate
        factor = self._alternate(origin.displacement, motion, begin, most, sink, sign)
        if factor is None:
            return False
        if factor < begin - self.settings.increment:
            self.failure = f"the load falls by more than {self.settings.increment:g} while the damage grows"
            return False
        grown = (self.rupture.energy() - stored) / (self.state.release * self.tear_energy)
        if self.state.heading * sign < 0.0 and factor == most and GROWS < grown and self.state.release > LEAST_RELEASE:
            self.failure = "what is left tears at once"
            return False
        entry |= {"share": sign * factor, "converged": True}
        return self._accept_tear(origin, sign * factor, grown)

    def _alternate(
        self, there: np.ndarray, motion: np.ndarray, here: float, most: float, sink: FrameSink, sign: float = 1.0
    ) -> float | None:
        """Find damage and displacement in equilibrium by alternate minimisation; return the load factor.

        The energy of the damage field grows by `release`, or less if the load factor would exceed `most`. In every
        round it follows from that energy for displacements on a straight line.

        Args:
            there: Displacement at the start [m], shape (N, 3).
            motion: Derivative of the displacement by the load factor [m], shape (N, 3).
            here: Absolute load factor at the start.
            most: Largest absolute load factor.
            sink: Where progress goes.
            sign: Sign of the load factor.

        Returns:
            None if no equilibrium was found.
        """
        level, rupture, entry = self.levels[0], self.rupture, self.report.load_steps[-1]
        stored, unit = rupture.energy(), self.state.release * self.tear_energy
        least, stride = 1e-3 * self.settings.increment, 0.1 * self.settings.increment
        residual, tolerance = math.inf, max(self.tolerance, rupture.close_enough)
        for again in range(MOST_ROUNDS):

            def move(factor: float, there: np.ndarray = there, here: float = here) -> None:
                assign(level.displacement, there + (factor - here) * motion)

            def excess(factor: float, again: int = again, move: Callable[[float], None] = move) -> float:
                move(factor)
                return (rupture.energy(again) - stored) / unit - 1.0

            factor = load_factor(excess, here, stride, most)
            if factor is None:
                self.failure = "no load factor was found at which the damage grows as wanted"
                return None
            move(factor)
            if not rupture.breaks(again) and abs(factor - here) <= STILL * here:
                assign(level.displacement, there)
                if residual <= self.tolerance:
                    return here
                factor, tolerance = here, self.tolerance
            self.set_loads(sign * factor)
            found = self._descend(0, sign * factor, sink, tolerance, f"round {again + 1} of rupture")
            entry["lattices"].append(found)
            entry["rounds"] = again + 1
            residual = sink.residual = found["residuals"][-1]
            if not found["converged"]:
                self.failure = f"Newton's method ended at a residual of {residual:.2g}"
                return None
            there = level.displacement.numpy().astype(np.float64)
            here, stride = factor, max(abs(factor - here), least)
        self.failure = f"the damage still grew after {MOST_ROUNDS} rounds"
        return None

    def _accept_tear(self, origin: Origin, factor: float, grown: float) -> bool:
        """Accept the current equilibrium as the next point; return whether the tangent is of use.

        Args:
            origin: The point before it.
            factor: Load factor.
            grown: Growth of the energy of the damage field over what was wanted.
        """
        state, level = self.state, self.levels[0]
        self.set_loads(factor)
        level.evaluate()
        if not self.linearise(0, level.tangent.min_tension(self.tolerance)):
            self.failure = "the tangent cannot be factorised"
            return False
        sign = math.copysign(1.0, factor)
        along = self._along(factor, sign)
        heading, number = math.copysign(1.0, factor - origin.factor), self.settings.modes
        if heading != state.heading:
            kind = "maximum" if heading < 0.0 else "minimum"
            state.found.append(
                {"kind": kind, "load_factor": origin.factor, "step": state.step, "eigenvalues": 0, "switched": False}
            )
        found = stability(level, self.solvers[0], number) if number else None
        state.negative, state.lowest = (None, []) if found is None else (found.negative, found.lowest)
        state.step, state.factor, state.heading = state.step + 1, factor, heading
        state.rate = sign / norm(along)
        state.length = self.settings.increment / abs(state.rate)
        state.tears, state.release = grown > GROWS, min(1.0, 2.0 * state.release)
        assign(self.direction, sign * along / norm(along))
        return True

    # Newton's method -----------------------------------------------------------------------------------

    def _correct(self, origin: Origin, length: float, sink: FrameSink) -> tuple[float, dict[str, Any]]:
        """Find equilibrium in the normal plane at a distance; return the load factor and a report entry."""
        level, products = self.levels[0], self.solvers[0].products
        factor = origin.factor + length * origin.rate
        there = origin.displacement + length * origin.direction
        residuals: list[float] = []
        converged, begin, first = False, 0, 0
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
                if self._unsettled():
                    begin = len(residuals)
                    first = first or begin
                    continue
            grows = iteration > 1 and residuals[-1] > residuals[-2] > residuals[-3]
            if converged or grows or not math.isfinite(relative) or iteration == self.settings.most_iterations:
                break
            if not self.linearise(0, level.tangent.min_tension(relative)):
                break
            rest = self._solve(level.residual.numpy().astype(np.float64))
            along = self._along(factor, math.copysign(1.0, origin.rate))
            across = mean_product(origin.direction, along)
            if across == 0.0:
                break
            gap = length - mean_product(origin.direction, there - origin.displacement)
            change = (gap - mean_product(origin.direction, rest)) / across
            there, factor = there + rest + change * along, factor + change
        # Rounds of contact do not tell how curved the path is.
        self.corrected = (first or len(residuals)) - 1
        return factor, {
            "points": level.points, "converged": converged, "residuals": residuals,
            "shares": [1.0] * (len(residuals) - 1), "products": self.solvers[0].products - products,
        }  # fmt: skip

    def _along(self, factor: float, sign: float) -> np.ndarray:
        """Derivative of the displacement by the load factor [m], shape (N, 3), at the current point."""
        level, ahead = self.levels[0], DIFFERENCE * self.settings.increment * sign
        if level.contacts:
            ahead *= TOUCHING
        # Schedules may end with the load.
        ahead = -ahead if abs(factor + ahead) > 1.0 else ahead
        here = level.residual.numpy().astype(np.float64)
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
        return np.asarray(self.levels[0].direction.numpy().astype(np.float64))


def mean_product(a: np.ndarray, b: np.ndarray) -> float:
    """Mean over points of the scalar product of two fields of shape (N, 3)."""
    return float(np.einsum("ic,ic->", a, b)) / len(a)


def norm(a: np.ndarray) -> float:
    """Root mean square over points of a field of shape (N, 3)."""
    return math.sqrt(mean_product(a, a))
