"""The search for equilibrium of Newton's method: load steps, cutbacks, coarser lattices."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.fields import assign
from ..interfaces import FrameSink, System, Tangent
from .descent import COARSE_TOLERANCE, Descent, Sizes
from .level import OWNER, Level
from .linear import LinearSolver
from .multigrid import Hierarchy, coarse_points, coarser
from .newton_settings import NewtonSettings, Report
from .static_rupture import StaticRupture

# A wider family hardly feels a checkerboard, so no sweep over the points smooths it: the V-cycle fails at 3.15.
MAX_MULTIGRID_HORIZON = 2.5
FINISHED, NOT_CONVERGED = "finished", "not converged"
# A note tells of a load step that moves the sheet so many times as far as each of the last few. Towards a maximum of
# the load, where the displacement has a square root, equal load steps move it 2.4 times as far at most.
JUMP, COMPARED = 4.0, 3


class Search:
    """The search for equilibrium of one simulation.

    Attributes:
        levels: The sheet itself, then coarser lattices over it.
        good: Displacement of the last good load step [m], (N,) vec3.
        earlier: Displacement of the one before [m], (N,) vec3.
        sizes: How stiff and how loaded the sheet is.
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
        self.sizes, self._begin = Sizes(), 0.0
        self._size, self._cutbacks = 1.0 / settings.load_steps, 0
        self._earlier_factor: float | None = None
        self._kept_factor: float | None = None
        self._resumed = False
        # Lengths of the last load steps, and how far they moved the sheet [m]; load steps that moved it much farther.
        self._moved: list[tuple[float, float]] = []
        self.jumps: list[dict[str, float]] = []

    def _preconditioner(self, tangent: Tangent) -> str:
        wanted, context, law = self.settings.preconditioner, self.system.context, self.system.law
        sheet, held = context.sheet, context.held
        smooth = law.horizon_ratio <= MAX_MULTIGRID_HORIZON and not sheet.cuts and law.intact is None
        lattices = coarser(sheet.lattice) if sheet.lattice is not None and smooth else []
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
            **asdict(self.sizes), "size": self._size, "cutbacks": self._cutbacks, "moved": self._moved,
            "earlier_factor": self._earlier_factor, "kept_factor": self._kept_factor, "jumps": self.jumps,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `host_state` gave."""
        self.sizes = Sizes(state["modulus"], state["largest"])
        self._size, self._cutbacks = state["size"], state["cutbacks"]
        self._earlier_factor, self._kept_factor = state["earlier_factor"], state["kept_factor"]
        self._moved, self.jumps = state["moved"], state["jumps"]
        self._resumed = True

    # Load steps ----------------------------------------------------------------------------------------

    def settle(self, factor: float, sink: FrameSink, guess: np.ndarray | None = None) -> bool:
        """Equilibrium at a load factor, from a guess of the displacement [m], (N, 3), or from the present state."""
        if guess is None:
            return self._load_step(factor, sink)[0]
        self.set_loads(factor)
        assign(self.levels[0].displacement, guess)
        return bool(self._descend(0, factor, sink, self.tolerance)["converged"])

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
        broken = self._keep(reached)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            factor = goal if reached + self._size > goal - 1e-9 else reached + self._size
            converged, sink.residual = self._equilibrium(factor, sink)
            if converged:
                self._compare(reached, factor)
                reached = factor
                broken = self._keep(reached)
                if factor == goal:
                    self._record(sink, reached)
                continue
            wp.copy(finest.displacement, self.good)
            self._earlier_factor = self._kept_factor = None
            self.rupture.restore(broken)
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

    def _compare(self, before: float, reached: float) -> None:
        """Remember a load step that moved the sheet much farther than those before it, and than its supports moved."""
        here, good = (array.numpy().astype(np.float64) for array in (self.levels[0].displacement, self.good))
        moved, length = np.abs(here - good), reached - before
        far, prescribed = float(moved.max()), float(moved[self.levels[0].held].max(initial=0.0))
        usual = max((m * max(1.0, length / earlier) for earlier, m in self._moved), default=0.0)
        if 0.0 < usual < far / JUMP and prescribed < far / JUMP:
            self.jumps.append({"from": before, "to": reached, "moved": far, "times": far / usual})
        self._moved = [*self._moved, (length, far)][-COMPARED:]

    def _keep(self, reached: float) -> Sequence[np.ndarray]:
        """Remember the state as the last good load step; what rupture has left until then."""
        # A run that went on from a load step has that and the one before it already.
        known = self._resumed and self._kept_factor is not None
        self._resumed = False
        if self._kept_factor is not None and not known:
            wp.copy(self.earlier, self.good)
        wp.copy(self.good, self.levels[0].displacement)
        if not known:
            self._earlier_factor, self._kept_factor = self._kept_factor, reached
        return self.rupture.remember()

    def _equilibrium(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Equilibrium at a load factor in which nothing breaks; whether found, and the residual.

        With a damage field this is alternate minimisation of the energy by displacement and damage.
        """
        s0, s1 = self._earlier_factor, self._kept_factor
        if s0 is not None and s1 is not None and self.hierarchy is None:
            # On along the line through the last two load steps; what is held goes where it belongs all the same.
            u0, u1 = (array.numpy().astype(np.float64) for array in (self.earlier, self.good))
            assign(self.levels[0].displacement, u1 + (factor - s1) / (s1 - s0) * (u1 - u0))
        converged, residual = self._load_step(factor, sink)
        entry = self.report.load_steps[-1]
        while converged:
            breaks = self.rupture.breaks(entry["rounds"])
            if not breaks and residual <= self.tolerance:
                break
            if breaks:
                entry["rounds"] += 1
                self._kept_factor = None
            tolerance = max(self.tolerance, self.rupture.close_enough) if breaks else self.tolerance
            found, whole = self._descend(0, factor, sink, tolerance, entry["rounds"]), entry["lattices"][-1]
            for name in ("residuals", "shares", "products"):
                whole[name] += found[name]
            converged, residual = found["converged"] and not self.rupture.goes_on(entry), found["residuals"][-1]
            whole["converged"] = entry["converged"] = converged
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
        entry: dict[str, Any] = {"share": factor, "converged": False, "rounds": 0, "lattices": []}
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
            tolerance = self.tolerance if index == 0 else max(self.tolerance, COARSE_TOLERANCE)
            found = self._descend(index, factor, sink, tolerance)
            entry["lattices"].append(found)
            if not found["converged"] and index > 0:
                wp.copy(level.displacement, level.base)
        entry["converged"] = found["converged"]
        return found["converged"], found["residuals"][-1]

    def _descend(self, index: int, factor: float, sink: FrameSink, tolerance: float, rounds: int = 0) -> dict[str, Any]:
        """Newton steps on a lattice at a load factor, after some rounds of rupture, as an entry of the report."""

        def told(steps: int, residual: float) -> None:
            sink.progress(steps, residual, tolerance, rounds)

        return Descent(
            self.settings, self.levels[index], self.solvers[index], partial(self.linearise, index),
            self.target(index, factor), self.sizes, tolerance, told if index == 0 else None,
        ).run()  # fmt: skip

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
