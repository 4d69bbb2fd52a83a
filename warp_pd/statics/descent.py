"""Newton steps at one load factor: linear solve, secants of earlier steps, line search, and tension while slack."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device.fields import assign, copy, dot, doubles
from .level import Level
from .linear import LinearSolver
from .newton_settings import NewtonSettings
from .static_rounds import MIN_LOAD, UNIT_ROUND_OFF

# A step is accepted unless the work of the unbalanced force along it turned to less than minus this
# fraction of its start.
MAX_OVERSHOOT = 0.5
MAX_TRIALS = 12
# A step is at most this fraction of the one that turns a family inside out: equilibria beyond it have families upside
# down (after Smith and Schaefer, ACM Trans. Graph. 34, 2015).
UNTURNED = 0.5
# Nor may the unbalanced force grow by more than this factor: beyond an energy barrier that sign means nothing.
MAX_GROWTH = 10.0
# Added tension over the mean modulus: at a slack start, after a failed step, where it is given up and dropped.
SLACK_TENSION, FIRST_TENSION, MAX_TENSION, MIN_TENSION = 0.03, 1e-3, 100.0, 1e-7
# A linear solve reaches this fraction of the residual at most, and no further than the tolerance asks.
# Aggregates leave more of the soft motions across the sheet in a residual of the same size.
LOOSEST, LOOSEST_ALGEBRAIC, TIGHTEST = 0.05, 0.01, 1e-6
# Squared residual over the goal below which the next step may reach it.
NEAR = 10.0
# Residual over the last one up to which the tangents of coarser lattices are kept.
FALLS = 0.2
# A tangent taken at a residual below this one is kept.
KEPT = 1e-4
# Residual below which a kept tangent may take the contact that is here, and most steps in a row that do so.
FOLLOWED, MOST_FOLLOWED = 0.5, 3
# Residual over the last one from which it falls no more, and margin of the forces that come from round-off, for each of
# up to LONG such steps; after as many also shortened steps count. A residual above the last number is never round-off:
# a load that nothing bears is one.
STUCK, MARGIN, LONG, LARGEST_UNSEEN = 0.5, 4.0, 3, 1e-2
# Residual to which coarser lattices are solved: their discretisation error is larger.
COARSE_TOLERANCE = 2e-2


@dataclass
class Sizes:
    """Scales of stiffness and load found so far.

    Attributes:
        modulus: Mean modulus [Pa]; 0 before the first linearisation.
        largest: Largest norm of loads and reactions in equilibrium [N].
    """

    modulus: float = 0.0
    largest: float = 0.0

    def relative(self, norm: float, scale: float) -> float:
        """Unbalanced force divided by loads and reactions, which count as at least MIN_LOAD times `largest`."""
        return ratio(norm, max(scale, MIN_LOAD * self.largest))


class Descent:
    """Newton steps of one level at one load factor.

    Args:
        settings: Settings of the search.
        level: The lattice.
        solver: Its linear solver.
        linearise: Function that computes the tangent with an added tension [Pa], with the aggregates of the last
            tangent if they will do (bool), and returns whether factorisation succeeded.
        target: Displacement of held components [m], shape (N, 3); others are meaningless.
        sizes: Scales of stiffness and load of the sheet.
        tolerance: Relative residual at which the level is in equilibrium.
        report: Callback (number of steps, residual) for the finest lattice; None on coarser ones.
        slowest: Residual over the last one up to which the next step takes the same tangent; None for steps that may
            not begin with an earlier tangent.
        farthest: Relative residual above which it does not begin.
        secants: Those of the tangent; None for none.
    """

    def __init__(
        self, settings: NewtonSettings, level: Level, solver: LinearSolver, linearise: Callable[[float, bool], bool],
        target: np.ndarray, sizes: Sizes, tolerance: float, report: Callable[[int, float], None] | None,
        slowest: float | None = None, farthest: float = math.inf, secants: Secants | None = None,
    ) -> None:  # fmt: skip
        self.settings, self.level, self.solver, self.linearise = settings, level, solver, linearise
        self.sizes, self.tolerance, self.report = sizes, tolerance, report
        self.constant = settings.stiffness == "constant"
        held = self.level.held
        self.lift = np.zeros((self.level.points, 3))
        if held.any():
            here = doubles(self.level.displacement)
            self.lift = np.where(held, target - here, 0.0)
            self.lift[np.abs(self.lift) <= 1e-12 * np.abs(here).max()] = 0.0
        self.lifting = self._lifts = bool(self.lift.any())
        self.tension = 0.0
        # Whether the next step takes the tangent of the last one; whether there are aggregates of an earlier one.
        self._kept = self._aggregated = slowest is not None
        # Whether there is a tangent of this descent; how many steps in a row have changed the contact of a kept one.
        self._usable, self._followed = False, 0
        self._slowest, self._farthest, self._secants = slowest, farthest, secants
        if secants is not None:
            secants.begin()
        self.residuals: list[float] = []
        self.step_lengths: list[float] = []

    def run(self) -> dict[str, Any]:
        """Iterate until equilibrium or failure; return the entry of this level for the solver's report."""
        before = self.solver.products
        copy(self.level.base, self.level.displacement)
        norm, scale = self.level.evaluate()
        converged = round_off = False
        for iteration in range(self.settings.most_iterations + 1):
            relative = ratio(norm, scale) if self.report is None else self.sizes.relative(norm, scale)
            self.residuals.append(relative)
            if self.report is not None:
                self.report(len(self.step_lengths), relative)
            if not math.isfinite(norm) or (iteration == 0 and relative > self._farthest):
                break
            round_off = relative > self.tolerance and self._unseen(norm)
            converged = (round_off or relative <= self.tolerance) and not self.lifting
            if converged and self.report is not None:
                self.sizes.largest = max(self.sizes.largest, scale)
            if converged or iteration == self.settings.most_iterations:
                break
            advanced = self._step(relative, norm)
            if advanced is None:
                break
            norm, scale = advanced
        self.level.predicting = False
        return {
            "points": self.level.points,
            "converged": converged,
            "round_off": converged and round_off,
            "residuals": self.residuals,
            "shares": self.step_lengths,
            "products": self.solver.products - before,
        }

    def _unseen(self, norm: float) -> bool:
        """Whether an unbalanced force [N] that falls no more is the round-off of the displacement."""
        level, earlier = self.level, zip(self.residuals[-2::-1], self.residuals[:0:-1], strict=False)
        stuck = len(list(itertools.takewhile(lambda pair: STUCK * pair[0] <= pair[1], earlier)))
        # Round-off may also shorten steps, but one short step alone tells nothing.
        if stuck == 0 or self.residuals[-1] >= LARGEST_UNSEEN or (self.step_lengths[-1] < 1.0 and stuck < LONG):
            return False
        far = math.sqrt(dot(level.displacement, level.displacement))
        stiffness = self.sizes.modulus * float(np.mean(level.context.sheet.thickness))
        margin = MARGIN * min(stuck, LONG)
        return norm <= margin * UNIT_ROUND_OFF[level.context.bits] * stiffness * far

    def _step(self, relative: float, norm: float) -> tuple[float, float] | None:
        """Take one accepted step and return the new norms; None if no added tension helps."""
        level, sizes = self.level, self.sizes
        while True:
            least = level.tangent.min_tension(relative)
            again = self._kept or (self._usable and self.tension == 0.0 and self._suffices())
            # With the tangent of other points that touch, these would come and go without end.
            touched = again and level.touches_anew()
            again = again and (not touched or self._follow_contact(relative))
            self._followed = self._followed + 1 if touched else 0
            usable = self._usable = again or self._renew(max(self.tension, least))
            self._aggregated = usable
            self._kept = usable and self.tension == 0.0 and self._keeps(relative, touched)
            if not sizes.modulus:
                sizes.modulus = level.tangent.modulus()
                if sizes.modulus == 0.0 or not math.isfinite(sizes.modulus):
                    return None
                if not self.constant and level.inertia is None and level.tangent.is_slack():
                    self.tension = SLACK_TENSION * sizes.modulus
                    continue
            if usable:
                self._direct(relative)
                if self.constant:
                    return self._full_step()
                work = dot(level.direction, level.residual)
                if self.lifting or work > 0.0:
                    found = self._search_line(work, norm)
                    if found is not None:
                        return found
            if self.constant:
                return None
            self._kept = self._aggregated = self._usable = False
            if again:
                continue
            self.tension = max(10.0 * self.tension, FIRST_TENSION * sizes.modulus)
            if self.tension > MAX_TENSION * sizes.modulus:
                return None

    def _renew(self, tension: float) -> bool:
        """Compute the tangent; return whether it is of use."""
        if self._secants is not None:
            self._secants.clear()
        return self.linearise(tension, self._aggregated and self._falls())

    def _follow_contact(self, relative: float) -> bool:
        """Let the tangent have the contact that is here, with the sheet of before; return whether it is of use.

        Far from equilibrium, and with other points that touch in every step, the sheet of before is not.
        """
        if self._secants is not None:
            self._secants.clear()
        return relative < FOLLOWED and self._followed < MOST_FOLLOWED and self.solver.follow_contact()

    def _falls(self) -> bool:
        """Whether the last step reduced the residual so far that coarser lattices need no new tangents."""
        return self.solver.kind != "multigrid" or (
            len(self.residuals) > 1 and self.residuals[-1] < FALLS * self.residuals[-2]
        )

    def _suffices(self) -> bool:
        """Whether the last tangent, at full length, leads to the goal.

        Newton's residuals fall as r2 = c r1^2, those of a step with the tangent of r1 as 2 c r1 r2, with a margin here.
        """
        earlier, last = ([math.inf] * 2 + self.residuals)[-2:]
        whole = not self.lifting and bool(self.step_lengths) and self.step_lengths[-1] == 1.0
        return whole and not self.level.predicts and 10.0 * last**2 <= self.tolerance * earlier

    def _keeps(self, relative: float, touched: bool) -> bool:
        """Whether the next step takes this tangent: other points touch in it, or the last one reduced enough."""
        if self._slowest is not None:
            # The residual before supports move tells nothing.
            first = 1 + int(self._lifts)
            return touched or len(self.residuals) <= first or self.residuals[-1] < self._slowest * self.residuals[-2]
        return relative <= KEPT and len(self.residuals) > 1 and self.residuals[-1] < 0.1 * self.residuals[-2]

    def _direct(self, relative: float) -> None:
        """Compute Newton's direction, including prescribed components."""
        level = self.level
        right_side = doubles(level.residual)
        if self.lifting:
            assign(level.vector, self.lift)
            level.run("product")
            right_side = right_side - level.image.numpy()
        goal = self.tolerance
        accuracy = TIGHTEST
        if math.isfinite(relative) and relative > 0.0:
            loosest = LOOSEST_ALGEBRAIC if self.solver.kind == "algebraic" else LOOSEST
            # Where Newton's method just misses the goal, a closer solve is cheaper than a further step.
            near = min(relative, 0.3 * goal / relative) if relative**2 < NEAR * goal else relative
            accuracy = min(loosest, max(near, 0.03 * goal / relative, TIGHTEST))
        self.solver.solve(right_side, accuracy)
        if self.lifting:
            assign(level.direction, level.direction.numpy() + self.lift)
        elif self._secants is not None:
            raw = doubles(level.direction)
            better = self._secants.improved(raw)
            if np.einsum("ic,ic->", better, right_side) > 0.0:
                assign(level.direction, better)
            else:
                self._secants.begin()

    def _search_line(self, work: float, norm: float) -> tuple[float, float] | None:
        """Move by an accepted fraction of the direction; None, with the state reset, if none is accepted."""
        level = self.level
        step_length = min(1.0, UNTURNED * level.longest_step())
        for _ in range(MAX_TRIALS):
            level.step_to(step_length)
            new_norm, scale = level.evaluate()
            left = dot(level.direction, level.residual)
            settled = left >= -MAX_OVERSHOOT * work and new_norm < MAX_GROWTH * norm
            taken = level.predicts or self.lifting or settled or new_norm < norm
            if taken and math.isfinite(new_norm):
                self._accept(step_length, ratio(new_norm, scale))
                return new_norm, scale
            step_length *= shortening(work, left)
        level.step_to(0.0)
        level.evaluate()
        return None

    def _full_step(self) -> tuple[float, float]:
        """Take the full step without a line search."""
        self.level.step_to(1.0)
        norm, scale = self.level.evaluate()
        self._accept(1.0, ratio(norm, scale))
        return norm, scale

    def _accept(self, step_length: float, relative: float) -> None:
        self.level.accept(step_length < 1.0)
        self.step_lengths.append(step_length)
        if self._secants is not None and step_length < 1.0:
            self._secants.begin()
        if self.lifting:
            self.lift *= 1.0 - step_length
            self.lifting = bool(self.lift.any())
        if step_length == 1.0:
            self.tension = min(0.1 * self.tension, relative * self.sizes.modulus)
            if self.tension < MIN_TENSION * self.sizes.modulus:
                self.tension = 0.0


def shortening(work: float, left: float) -> float:
    """Factor of the next trial of a line search [-].

    Args:
        work: Force along the direction at the start [N m], positive.
        left: That at the refused trial; may be infinite or NaN.

    Returns:
        The zero of the secant, from 0.1 to 0.5; 0.1 where the force did not fall, 0.25 where it is not finite.
    """
    if not math.isfinite(left):
        return 0.25
    return min(0.5, max(0.1, work / (work - left))) if left < work else 0.1


def ratio(norm: float, scale: float) -> float:
    """Norm of the unbalanced force divided by that of the loads [-]; infinite without loads."""
    return 0.0 if norm == 0.0 else norm / scale if scale > 0.0 else math.inf


# Secants that are remembered, and the smallest singular value over the largest that counts.
REMEMBERED, INDEPENDENT = 4, 1e-6


class Secants:
    """Pairs of a step s and w = K^-1 (r before - r after), which would be s with the tangent along it.

    The direction K^-1 r gets sum g (s - w), with g from the least squares of K^-1 r - sum g w (Anderson, J. ACM 12,
    1965; Fang and Saad, Numer. Linear Algebra Appl. 16, 2009). Pairs stay from one time step to the next, as the
    tangent does.
    """

    def __init__(self) -> None:
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def clear(self) -> None:
        """Forget all, for a new tangent."""
        self._pairs, self._last = [], None

    def begin(self) -> None:
        """Let the next direction follow no earlier one."""
        self._last = None

    def improved(self, direction: np.ndarray) -> np.ndarray:
        """The direction that takes the place of K^-1 r, shape (N, 3), for a full step."""
        if self._last is not None:
            step, before = self._last
            self._pairs = [*self._pairs, (step, before - direction)][-REMEMBERED:]
        better = direction
        if self._pairs:
            w = np.stack([change for _, change in self._pairs])
            gram = np.einsum("aic,bic->ab", w, w)
            weights = np.linalg.lstsq(gram, np.einsum("aic,ic->a", w, direction), rcond=INDEPENDENT**2)[0]
            better = direction + sum(g * (s - c) for g, (s, c) in zip(weights, self._pairs, strict=True))
        self._last = better, direction
        return better
