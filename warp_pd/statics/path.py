"""Arc-length continuation: paths of equilibria through load maxima and snap-backs, limit points, bifurcations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.clock import Schedule
from ..device.fields import assign, doubles
from ..interfaces import BuiltLaw, BuiltSolver, Columns, FrameSink, History, System
from ..interfaces.solver import FINISHED
from .corrector import Change, Origin, Point, changes, mean_product, norm
from .newton_settings import PathSettings
from .static_rounds import MAX_ROUNDS
from .tear_steps import TearSteps

# Desired number of corrector steps, and desired error of the predicted load, divided by the largest increment.
AIMED_STEPS, AIMED_MISS = 4.0, 0.25
LEAST_GROWTH, MOST_GROWTH = 0.5, 2.0
# The search for a limit point or bifurcation ends when the rate or eigenvalue is SHARP times that at the adjacent
# points, or after MOST_LANDINGS attempts.
SHARP, MOST_LANDINGS = 0.01, 10
# Cosine of the angle between the directions of two steps below which the second is on another branch.
SAME_BRANCH = 0.5
# Load factors up to which loads without a schedule go on in a straight line, either way.
FARTHEST = 10.0


@dataclass(frozen=True, kw_only=True)
class ArcLength(PathSettings):
    """Arc-length continuation of static equilibrium, also where the load must decrease.

    The load factor s is an unknown in addition to the displacement: schedules are evaluated at the time s * duration,
    and loads without a schedule are multiplied by s, also for s < 0. The path begins at s = 0 and ends at s = 1 or -1,
    or, with a note, after `most_steps`. Every point of the path is a frame with the time s * duration, so frame times
    decrease where the load does. In the history, the column `load_factor` is s, and `unstable` is the number of
    negative eigenvalues of the tangent.

    The first point is found by Newton's method. From there each step moves along the tangent of the path, and Newton's
    method corrects it in the normal plane (Riks, J. Appl. Mech. 39 (1972) 1060-1065; Keller 1977). The step length is
    the root mean square of the displacement of all points. It is adapted to the number of corrector steps and to the
    error of the predicted load factor; a step that fails, or turns by more than 60 degrees, is halved.

    Stability follows from the signs of the pivots of the factorised tangent and, with displacement-dependent loads,
    from the lowest eigenvalues of K x = mu K0 x, where K0 excludes these loads. The summary (`solve`: `found`) and the
    notes report limit points, where the load turns, and bifurcations, where another eigenvalue changes sign. Both
    are points of the path. At a bifurcation the path continues on the same branch, or along the eigenvector (`switch`),
    corrected in the plane normal to it.

    Attributes:
        increment: Maximum change of the load factor in a step, and the load factor of the first point.
        tolerance: As for `Newton`.
        most_steps: Maximum number of points of the path.
        most_iterations: Number of corrector steps after which a step counts as failed; those at a fixed load, as for
            `Newton`, are 30 or more.
        most_cuts: Maximum number of times that one step is halved.
        modes: Number of lowest eigenvalues to compute at every point; with 0 only limit points are found.
        switch: Number of the bifurcation, from 1, at which the path takes the other branch; 0 to stay on its branch.
        preconditioner: As for `Newton`; "auto" is a sparse factorisation on the host up to 20 000 points, because the
            tangent has negative eigenvalues beyond a limit point. Without a factorisation stability is unknown.
    """

    @property
    def frame_count(self) -> int:
        """Maximum number of frames after the first, one per point."""
        return self.most_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        ends = np.array([-FARTHEST, FARTHEST])
        return Schedule(ends * self.duration, np.repeat(ends[:, None], 3, axis=1))

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        return BuiltArcLength(self, context, law)


class BuiltArcLength(TearSteps):
    """Arc-length continuation on a device; it adds no launches to time steps."""

    turns = True
    ended = ""

    def prepare(self, system: System) -> None:
        """Add the stages of residual and tangent."""
        super().prepare(system)
        if system.rupture is not None and not system.rupture.tear_energy:
            raise InputError(f"{system.rupture.label}: expected TearingEnergy with ArcLength, or the solver Newton")
        if system.rupture is not None and self.rounds.contacts:
            raise InputError(
                f"{self.rounds.contacts[0].label}: expected no damage with ArcLength, or the solver Newton"
            )
        if self.settings.switch and self.preconditioner != "direct":
            raise InputError(
                f"switch = {self.settings.switch!r}: expected preconditioner = 'direct', whose factorisation finds "
                f"bifurcations, got {self.preconditioner!r}"
            )

    def run(self, sink: FrameSink) -> str:
        """Follow the path; return the final status."""
        self._start_report(sink)
        self.levels[0].scale.begin()
        self._set_contact_stiffness()
        state, finest = self.state, self.levels[0]
        while state.step < self.settings.most_steps and abs(state.factor) < 1.0:
            self.kept.keep()
            found = self._begin_path(sink) if state.step == 0 else self._advance(sink)
            if not found:
                self.kept.restore()
            # The direction of the path was taken from forces at another load factor.
            self.set_loads(state.factor)
            sink.residual = self.sizes.relative(*finest.evaluate())
            if not found:
                self.ended = self.failure
                sink.solve = self._summary(state.factor)
                return self.status
            self._record(sink, state.factor)
        return FINISHED

    def _summary(self, reached: float) -> dict[str, Any]:
        return {**super()._summary(reached), "found": self.state.found, "ended": self.ended}

    def _begin_path(self, sink: FrameSink) -> bool:
        """Find the first point by Newton's method at a fixed load factor; return whether it was found."""
        level, factor = self.levels[0], min(1.0, self.settings.increment)
        start = self.position()
        cuts = 0
        while cuts <= self.settings.most_cuts:
            converged, sink.residual = self._load_step(factor, sink)
            if converged and self.rounds.update_multipliers():
                found = self._equilibrium(factor, sink)
                self.report.load_steps[-1]["lattices"].append(found)
                converged, sink.residual = found["converged"], found["residuals"][-1]
            if not converged:
                self.fail_to_converge(sink.residual)
            elif self.rounds.passed():
                converged = self.fail("a body passed through the sheet")
            elif self.tear_energy:
                # As at a cut with the damage of a crack, damage may grow from the smallest load.
                here = self.position()
                arrived = self.alternate(here, (here - start) / factor, factor, factor, sink)
                converged, factor = arrived is not None, arrived or factor
            if converged:
                secant = self.position() - start
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
        state = self.state
        origin = Origin(self.position(), doubles(self.direction), state.factor, state.rate)
        for _ in range(self.settings.most_cuts + 1):
            if self.tear(origin, sink) if state.tears else self._step(origin, sink):
                return True
            self._return()
        return False

    def _return(self) -> None:
        """Return to the last point of the path; the next step is shorter."""
        self.kept.restore()
        self.state.length *= LEAST_GROWTH
        self.state.release *= LEAST_GROWTH

    def _step(self, origin: Origin, sink: FrameSink) -> bool:
        """Try one step of the current length; return whether it stayed on the path."""
        length, increment = self.state.length, self.settings.increment
        predicted = origin.factor + length * origin.rate
        entry = self._new_entry(predicted)
        if abs(predicted) >= 1.0:
            remaining = (math.copysign(1.0, predicted) - origin.factor) / origin.rate
            assign(self.levels[0].displacement, origin.displacement + remaining * origin.direction)
            factor, found = self._end(origin, LEAST_GROWTH * remaining, MOST_GROWTH * remaining, sink)
        else:
            factor, found = self.correct(origin, length, sink)
            if found["converged"] and abs(factor) > 1.0:
                # This happens where contact stiffens the sheet.
                factor, found = self._end(origin, 0.0, length, sink)
        entry |= {"share": factor, "lattices": [found]}
        miss = abs(factor - predicted)
        residual = sink.residual = found["residuals"][-1]
        if not found["converged"] and residual > self.tolerance:
            return self.fail_to_converge(residual)
        refused = ""
        if not found["converged"]:
            refused = "the equilibrium at the final load lies on another branch"
        elif abs(factor) > 1.0 or miss > increment:
            refused = f"the load factor missed its prediction by {miss:.2g}"
        elif self.rounds.passed():
            refused = "a body passed through the sheet"
        elif self.rounds.breaks(0):
            self.state.tears, refused = True, "the damage grows"
        if refused:
            return self.fail(refused)
        growth = math.sqrt(AIMED_STEPS / max(1, self.corrected))
        if miss > 0.0:
            growth = min(growth, math.sqrt(AIMED_MISS * increment / miss))
        growth = min(MOST_GROWTH, max(LEAST_GROWTH, growth))
        entry["converged"] = self._accept(origin, factor, growth * length, sink)
        if entry["converged"]:
            return True
        return self.fail(
            "the equilibrium found lies on another branch, or where the path turns by more than 60 degrees"
        )

    def _end(self, origin: Origin, least: float, most: float, sink: FrameSink) -> tuple[float, dict[str, Any]]:
        """Find equilibrium at the final load factor; reject it if the load turned before, or if it is far away.

        Its distance from the point before it is expected between `least` and `most` [m].
        """
        level, factor = self.levels[0], math.copysign(1.0, origin.factor)
        self.set_loads(factor)
        found = self._equilibrium(factor, sink)
        moved = mean_product(origin.direction, level.displacement.numpy() - origin.displacement)
        found["converged"] &= least < moved < most
        return factor, found

    def _equilibrium(self, factor: float, sink: FrameSink) -> dict[str, Any]:
        """Find equilibrium at a load factor, with the multipliers of contact; return a report entry."""
        found = self._descend(0, factor, sink, self.tolerance)
        for _ in range(MAX_ROUNDS):
            if not found["converged"] or not self.rounds.update_multipliers():
                return found
            further = self._descend(0, factor, sink, self.tolerance, "a round of contact")
            for name in ("residuals", "shares", "products"):
                further[name] = found[name] + further[name]
            found = further
        return {**found, "converged": False}

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
        self.move_to(here)
        if change is not None:
            if before.negative is not None and after.negative is not None:
                # Eigenvalues that are zero here count as those of the next point.
                gained = math.copysign(change.eigenvalues, after.negative - before.negative)
                state.negative = before.negative + int(gained)
            direction = self._pass(change, direction, here)
        state.length = min(length, self.settings.increment / abs(state.rate) if state.rate else math.inf)
        assign(self.direction, direction)
        return True

    def _look(self, origin: Origin, factor: float) -> tuple[np.ndarray, Point] | None:
        """Direction of the path at the current equilibrium, and the point; None on another branch."""
        along = self.tangent_at(factor, math.copysign(1.0, origin.rate))
        if along is None:
            return None
        size = norm(along)
        # The start may be no equilibrium, as with a constant load or of a prestretched sheet with a free edge: the path
        # begins at its first point, along a rising load.
        if self.state.step > 0:
            cosine = mean_product(along, origin.direction) / size
            if abs(cosine) < SAME_BRANCH:
                return None
            size = math.copysign(size, cosine)
        return along / size, self.point(factor, 1.0 / size)

    def _land(
        self, origin: Origin, before: Point, after: Point, direction: np.ndarray, sink: FrameSink
    ) -> tuple[Change | None, np.ndarray, Point]:
        """Find the first change before the current equilibrium and move there; return it, the direction and the point.

        Without a change, or if it cannot be found, the current equilibrium remains.
        """
        level, low, found, here = self.levels[0], 0.0, None, (direction, after)
        arrived = self.position()
        high = mean_product(origin.direction, arrived - origin.displacement)
        for attempt in range(MOST_LANDINGS):
            between = changes(before, after, high - low)
            if not between:
                break
            change = between[0]
            # Every second attempt bisects, because before the change another mode may have the lowest eigenvalue.
            place = low + (0.5 if attempt % 2 else change.place) * (high - low)
            factor, entry = self.correct(origin, place, sink)
            self.report.load_steps[-1]["lattices"].append(entry)
            ahead = self._look(origin, factor) if entry["converged"] else None
            if ahead is None:
                break
            sizes, (_, point) = (change.size(before), change.size(after)), ahead
            found, here, arrived = change, ahead, self.position()
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
        self.record(change.kind, here.factor, here.step, change.eigenvalues, switch)
        if switch or change.kind != "bifurcation":
            state.rate = 0.0
        if not switch or here.mode is None:
            return direction
        mode = here.mode - mean_product(here.mode, direction) * direction
        return np.asarray(mode / norm(mode))

    def columns(self) -> Columns:
        """Load factor, and number of negative eigenvalues if the tangent is factorised."""
        return Columns(("load_factor", "unstable"), self._row)

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Load factor and number of negative eigenvalues [-], NaN if unknown."""
        state = self.state
        row = {"load_factor": state.factor}
        if self.settings.modes and self.preconditioner == "direct":
            unknown = state.step > 0 and state.negative is None
            row["unstable"] = np.nan if unknown else float(state.negative or 0)
        return row

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on limit points, bifurcations, and a path that ended early."""
        state, said = self.state, []
        for found in state.found:
            where = f"at load factor {found['load_factor']:.5g}, step {found['step']}"
            if found["kind"] == "bifurcation":
                number = found["eigenvalues"]
                what = (
                    "an eigenvalue of the tangent changes its" if number == 1 else f"{number} eigenvalues change their"
                )
                then = "; the path continues on the other branch" if found["switched"] else ""
                said.append(f"ArcLength: a bifurcation {where}: {what} sign while the load does not turn{then}")
            else:
                said.append(f"ArcLength: a limit point {where}: a {found['kind']} of the load")
        if self.settings.switch and not any(found["switched"] for found in state.found):
            said.append(
                f"ArcLength: switch = {self.settings.switch}: the path met fewer bifurcations and did not switch"
            )
        if self.ended:
            said.append(
                f"ArcLength: the path ends at load factor {state.factor:.5g}, step {state.step}: even the shortest "
                f"step failed, as {self.ended}"
            )
        if state.step == self.settings.most_steps and abs(state.factor) < 1.0:
            said.append(
                f"ArcLength: the path is followed for most_steps = {state.step}, to load factor {state.factor:.4g}"
            )
        return said
