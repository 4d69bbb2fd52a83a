"""The search for equilibrium of Newton's method: load steps, cutbacks, line search."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

from ..checks import InputError
from ..device.fields import assign
from ..interfaces import FrameSink, System, Tangent
from .level import OWNER, Level, dot
from .linear import LinearSolver
from .multigrid import Hierarchy, coarse_points, coarser
from .newton_settings import NewtonSettings, Report
from .static_rupture import MAX_ROUNDS, MIN_LOAD, StaticRupture

# A step is accepted unless the work of the unbalanced force along it turned to less than minus this share.
MAX_OVERSHOOT = 0.5
MAX_TRIALS = 12
# Nor may the unbalanced force become so many times larger: beyond an energy barrier that work has no sign to trust.
MAX_GROWTH = 10.0
# Added tension over the mean modulus: at a slack start, after a failed step, where it is given up and dropped.
SLACK_TENSION, FIRST_TENSION, MAX_TENSION, MIN_TENSION = 0.1, 1e-3, 100.0, 1e-7
# A linear solve reaches this share of the residual at most, and no further than the tolerance asks.
LOOSEST, TIGHTEST = 0.05, 1e-6
# A wider family hardly feels a checkerboard, so no sweep over the points smooths it: the V-cycle fails at 3.15.
MAX_MULTIGRID_HORIZON = 2.5
# A tangent taken at a residual below this one is kept.
KEPT = 1e-4
# Residual to which coarser lattices are solved: their discretisation error is larger.
COARSE_TOLERANCE = 1e-3
FINISHED, NOT_CONVERGED = "finished", "not converged"


class Search:
    """The search for equilibrium of one simulation.

    Attributes:
        levels: The sheet itself, then coarser lattices over it.
        good: Displacement of the last good load step [m], (N,) vec3.
        earlier: Displacement of the one before [m], (N,) vec3.
        modulus: How stiff the sheet is [Pa]; 0 before the first linearisation.
        largest: Largest norm of loads and reactions in equilibrium so far [N].
    """

    def __init__(self, settings: NewtonSettings, system: System, tangent: Tangent) -> None:
        """Add all stages.

        Raises:
            InputError: for a preconditioner that the sheet does not allow.
        """
        self.settings, self.system = settings, system
        context, state = system.context, system.context.state
        vec3, n = context.types.vec3, context.sheet.size
        self.good = context.array("last_load_step", OWNER, vec3, shape=n)
        self.earlier = context.array("earlier_load_step", OWNER, vec3, shape=n, restart=True)
        finest = Level(context, system.law, tangent, system.external.following)
        dead = system.external.keep_dead_apart()
        stage = context.stage("evaluate", "every residual of Newton")
        system.law.add_force(stage, state.displacement, state.force)
        if state.external is not None:
            system.external.add_force(stage, state.displacement, state.external)
        finest.add_residual(stage, dead)
        self.rupture = StaticRupture(system)
        self.preconditioner = self._preconditioner(tangent)
        self.hierarchy = Hierarchy(finest, system) if self.preconditioner == "multigrid" else None
        self.levels: Sequence[Level] = self.hierarchy.levels if self.hierarchy else [finest]
        self.solvers = [
            LinearSolver(level, index, self.preconditioner, self.hierarchy) for index, level in enumerate(self.levels)
        ]
        self.report = Report(self.preconditioner)
        self.tolerance = settings.tolerance or (1e-8 if context.bits == 64 else 1e-4)
        self.modulus = self.largest = self._begin = 0.0
        self._size, self._cutbacks = 1.0 / settings.load_steps, 0
        self._earlier_factor: float | None = None
        self._kept_factor: float | None = None
        self._resumed = False

    def _preconditioner(self, tangent: Tangent) -> str:
        wanted, context, law = self.settings.preconditioner, self.system.context, self.system.law
        sheet, held = context.sheet, context.held
        narrow = law.horizon <= MAX_MULTIGRID_HORIZON
        lattices = coarser(sheet.lattice) if sheet.lattice is not None and not sheet.cuts and narrow else []
        possible = bool(lattices) and law.coarsens
        if sheet.lattice is not None and possible:
            nearest = coarse_points(lattices[-1], sheet.lattice)
            # A support that no coarse point sees would leave the coarse sheet loose.
            possible = bool((np.bitwise_or.reduce(held) & ~np.bitwise_or.reduce(held[nearest])) == 0)
        if possible:
            possible = all(load.coarsens for load in self.system.external.following)
        if wanted == "multigrid" and not possible:
            raise InputError(
                "preconditioner = 'multigrid': expected an uncut rectangle of more than 300 points, a horizon up to "
                f"{MAX_MULTIGRID_HORIZON}, a law and loads that exist on coarser lattices; take 'direct' or 'jacobi'"
            )
        if wanted != "auto":
            return wanted
        direct = context.device.is_cpu or sheet.size <= tangent.direct_points
        return "multigrid" if possible else "direct" if direct else "jacobi"

    def host_state(self) -> dict[str, Any]:
        """Where the search stands, for a restart that goes on bit for bit."""
        return {
            "modulus": self.modulus, "largest": self.largest, "size": self._size, "cutbacks": self._cutbacks,
            "earlier_factor": self._earlier_factor, "kept_factor": self._kept_factor,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `host_state` gave."""
        self.modulus, self.largest = state["modulus"], state["largest"]
        self._size, self._cutbacks = state["size"], state["cutbacks"]
        self._earlier_factor, self._kept_factor = state["earlier_factor"], state["kept_factor"]
        self._resumed = True

    # Load steps ----------------------------------------------------------------------------------------

    def settle(self, factor: float, sink: FrameSink, guess: np.ndarray | None = None) -> bool:
        """Equilibrium at a load factor, from a guess of the displacement [m], (N, 3), or from the present state."""
        if guess is None:
            return self._load_step(factor, sink)[0]
        self.set_loads(factor)
        assign(self.levels[0].displacement, guess)
        return bool(Descent(self, 0, factor, sink).run()["converged"])

    def set_loads(self, factor: float) -> None:
        """Set the loads of the sheet itself to a load factor."""
        self._set_loads(0, factor)

    def run(self, sink: FrameSink) -> str:
        """Follow the load path; returns the final status."""
        finest, planned = self.levels[0], self.settings.load_steps
        self._begin = perf_counter()
        if sink.solve is not None:
            # A resumed run reports the load steps before it, too.
            self._begin -= sink.solve["seconds"]
            self.report.load_steps += sink.solve["load_steps"]
        reached = sink.time / self.settings.duration
        intact = self._keep(reached)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            factor = goal if reached + self._size > goal - 1e-9 else reached + self._size
            converged, sink.residual = self._equilibrium(factor, sink)
            if converged:
                reached = factor
                intact = self._keep(reached)
                if factor == goal:
                    self._record(sink, reached)
                continue
            wp.copy(finest.displacement, self.good)
            self._earlier_factor = self._kept_factor = None
            if self.rupture.intact is not None:
                self.rupture.intact.assign(intact)
            self._cutbacks += 1
            self._size *= 0.5
            if self._cutbacks > self.settings.most_cuts:
                self._set_loads(0, reached)
                finest.evaluate()
                if reached > sink.time / self.settings.duration + 1e-9:
                    self._record(sink, reached)
                sink.solve = self._summary(reached)
                return NOT_CONVERGED
        return FINISHED

    def _keep(self, reached: float) -> np.ndarray | None:
        """Remember the state as the last good load step; its intact bonds, if any can break."""
        # A run that went on from a load step has that and the one before it already.
        known = self._resumed and self._kept_factor is not None
        self._resumed = False
        if self._kept_factor is not None and not known:
            wp.copy(self.earlier, self.good)
        wp.copy(self.good, self.levels[0].displacement)
        if not known:
            self._earlier_factor, self._kept_factor = self._kept_factor, reached
        return None if self.rupture.intact is None else self.rupture.intact.numpy().copy()

    def _equilibrium(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Equilibrium at a load factor in which nothing breaks; whether found, and the residual."""
        s0, s1 = self._earlier_factor, self._kept_factor
        if s0 is not None and s1 is not None and self.hierarchy is None:
            # On along the line through the last two load steps; what is held goes where it belongs all the same.
            u0, u1 = (array.numpy().astype(np.float64) for array in (self.earlier, self.good))
            assign(self.levels[0].displacement, u1 + (factor - s1) / (s1 - s0) * (u1 - u0))
        converged, residual = self._load_step(factor, sink)
        rounds = 0
        while converged and self.rupture.breaks():
            rounds += 1
            self._kept_factor = None
            converged, residual = self._load_step(factor, sink)
            converged = converged and rounds < MAX_ROUNDS
        return converged, residual

    def _summary(self, reached: float) -> dict[str, Any]:
        self.report.seconds = perf_counter() - self._begin
        return self.report.summary(self.levels[0].points, reached)

    def _record(self, sink: FrameSink, reached: float) -> None:
        """Hand the state to the sink as the next frame."""
        before = sink.steps
        sink.solve = self._summary(reached)
        now = reached * self.settings.duration
        sink.frame(sink.frame_index + 1, now, sink.solve["iterations"] - before, 0.0)

    def _load_step(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Equilibrium at a load factor, from the last good load step; whether found, and the residual."""
        entry: dict[str, Any] = {"share": factor, "converged": False, "lattices": []}
        self.report.load_steps.append(entry)
        last = len(self.levels) - 1
        if self.hierarchy:
            self.hierarchy.sample()
        for index in reversed(range(last + 1)):
            level = self.levels[index]
            self._set_loads(index, factor)
            wp.copy(level.base, level.displacement)
            if index < last and self.hierarchy and entry["lattices"][-1]["converged"]:
                self.hierarchy.start(index)
                self._prescribe(index, factor)
            found = Descent(self, index, factor, sink).run()
            entry["lattices"].append(found)
            if not found["converged"] and index > 0:
                wp.copy(level.displacement, level.base)
        entry["converged"] = found["converged"]
        return found["converged"], found["residuals"][-1]

    def _set_loads(self, index: int, factor: float) -> None:
        duration = self.settings.duration
        self.system.set_clock(0.0, duration, factor * duration)
        if index > 0 and self.hierarchy:
            self.hierarchy.set_loads(index)

    def target(self, index: int, factor: float) -> np.ndarray:
        """Displacement of held components at a load factor [m], shape (N, 3); others are meaningless."""
        target = self.system.prescribed(factor * self.settings.duration)
        if index > 0 and self.hierarchy:
            lattices = self.hierarchy.lattices
            return np.asarray(target[coarse_points(lattices[index], lattices[0])])
        return target

    def _prescribe(self, index: int, factor: float) -> None:
        level = self.levels[index]
        held = level.held
        if held.any():
            u = level.displacement.numpy()
            assign(level.displacement, np.where(held, self.target(index, factor), u))

    def linearise(self, index: int, tension: float) -> bool:
        """Take the tangent of a level and of what preconditions it; whether it could be factorised."""
        if self.hierarchy:
            self.hierarchy.linearise(index, tension)
            return self.hierarchy.usable
        self.levels[0].linearise(tension)
        return self.solvers[0].prepare()

    def relative(self, norm: float, scale: float) -> float:
        """Unbalanced force over loads and reactions, these at least MIN_LOAD of the largest in equilibrium so far."""
        scale = max(scale, MIN_LOAD * self.largest)
        return _ratio(norm, scale)


class Descent:
    """Newton steps of one level at one load factor."""

    def __init__(self, search: Search, index: int, factor: float, sink: FrameSink) -> None:
        self.search, self.index, self.sink = search, index, sink
        self.level, self.solver = search.levels[index], search.solvers[index]
        self.constant = search.settings.stiffness == "constant"
        held = self.level.held
        self.lift = np.zeros((self.level.points, 3))
        if held.any():
            here = self.level.displacement.numpy().astype(np.float64)
            self.lift = np.where(held, search.target(index, factor) - here, 0.0)
            self.lift[np.abs(self.lift) <= 1e-12 * np.abs(here).max()] = 0.0
        self.lifting = bool(self.lift.any())
        self.tension = 0.0
        self._kept = False
        self.tolerance = search.tolerance if index == 0 else max(search.tolerance, COARSE_TOLERANCE)
        self.residuals: list[float] = []
        self.shares: list[float] = []

    def run(self) -> dict[str, Any]:
        """Steps until equilibrium or failure, as an entry of the report."""
        before = self.solver.products
        wp.copy(self.level.base, self.level.displacement)
        norm, scale = self.level.evaluate()
        converged = False
        for iteration in range(self.search.settings.most_iterations + 1):
            relative = self.search.relative(norm, scale) if self.index == 0 else _ratio(norm, scale)
            self.residuals.append(relative)
            if self.index == 0:
                self.sink.progress(len(self.shares), relative, self.search.tolerance)
            if not math.isfinite(norm):
                break
            converged = relative <= self.tolerance and not self.lifting
            if converged and self.index == 0:
                self.search.largest = max(self.search.largest, scale)
            if converged or iteration == self.search.settings.most_iterations:
                break
            advanced = self._step(relative, norm)
            if advanced is None:
                break
            norm, scale = advanced
        return {
            "points": self.level.points,
            "converged": converged,
            "residuals": self.residuals,
            "shares": self.shares,
            "products": self.solver.products - before,
        }

    def _step(self, relative: float, norm: float) -> tuple[float, float] | None:
        """One accepted step: the new norms; None if no tension helps."""
        level, search = self.level, self.search
        while True:
            least = level.tangent.min_tension(relative)
            usable = self._kept or search.linearise(self.index, max(self.tension, least))
            self._kept = usable and relative <= KEPT and self.tension == 0.0 and self._shrinks()
            if not search.modulus:
                search.modulus = level.tangent.modulus()
                if not self.constant and level.tangent.is_slack():
                    self.tension = SLACK_TENSION * search.modulus
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
            self._kept = False
            self.tension = max(10.0 * self.tension, FIRST_TENSION * search.modulus)
            if self.tension > MAX_TENSION * search.modulus:
                return None

    def _shrinks(self) -> bool:
        """Whether the last step left less than a tenth of the residual: bonds that go slack ask for a new tangent."""
        return len(self.residuals) > 1 and self.residuals[-1] < 0.1 * self.residuals[-2]

    def _direct(self, relative: float) -> None:
        """Newton's direction, held components included."""
        level = self.level
        right_side = level.residual.numpy().astype(np.float64)
        if self.lifting:
            assign(level.vector, self.lift)
            level.run("product")
            right_side = right_side - level.image.numpy()
        goal = self.tolerance
        accuracy = TIGHTEST
        if math.isfinite(relative) and relative > 0.0:
            accuracy = min(LOOSEST, max(relative, 0.03 * goal / relative, TIGHTEST))
        self.solver.solve(right_side, accuracy)
        if self.lifting:
            assign(level.direction, level.direction.numpy() + self.lift)

    def _search_line(self, work: float, norm: float) -> tuple[float, float] | None:
        """Accept a share of the direction; None, and back to the base, if there is none."""
        level, share = self.level, 1.0
        for _ in range(MAX_TRIALS):
            level.step_to(share)
            new_norm, scale = level.evaluate()
            left = dot(level.direction, level.residual)
            settled = left >= -MAX_OVERSHOOT * work and new_norm < MAX_GROWTH * norm
            if math.isfinite(new_norm) and (self.lifting or settled or new_norm < norm):
                self._accept(share, _ratio(new_norm, scale))
                return new_norm, scale
            share *= min(0.5, max(0.1, work / (work - left))) if math.isfinite(left) else 0.25
        level.step_to(0.0)
        level.evaluate()
        return None

    def _full_step(self) -> tuple[float, float]:
        """Take the whole direction, whatever comes of it."""
        self.level.step_to(1.0)
        norm, scale = self.level.evaluate()
        self._accept(1.0, _ratio(norm, scale))
        return norm, scale

    def _accept(self, share: float, relative: float) -> None:
        wp.copy(self.level.base, self.level.displacement)
        self.shares.append(share)
        if self.lifting:
            self.lift *= 1.0 - share
            self.lifting = bool(self.lift.any())
        if share == 1.0:
            self.tension = min(0.1 * self.tension, relative * self.search.modulus)
            if self.tension < MIN_TENSION * self.search.modulus:
                self.tension = 0.0


def _ratio(norm: float, scale: float) -> float:
    return 0.0 if norm == 0.0 else norm / scale if scale > 0.0 else math.inf
