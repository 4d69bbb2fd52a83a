"""Common basis of Newton and ArcLength: levels, linear solvers, loads at a load factor, report."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array, assign, copy
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltSolver, FrameSink, System
from ..solvers.stepping import Snapshot
from ..step import NOT_IN_EQUILIBRIUM, Phase
from .aggregates import MAX_COARSEST, Aggregates
from .descent import COARSE_TOLERANCE, Descent, Secants, Sizes
from .level import OWNER, Level
from .linear import LinearSolver
from .multigrid import Hierarchy, coarse_points, coarser
from .newton_settings import NewtonSettings, Report
from .static_rounds import StaticRounds
from .tangent import Tangent, tangent_of

# A wider family hardly feels a checkerboard, so no sweep over the points smooths it: the V-cycle fails at 3.15.
MAX_MULTIGRID_HORIZON = 2.5
# Number of points from which aggregates are faster than a factorisation.
ALGEBRAIC_FROM = 2000
# Residual over the last one up to which rounds of contact and of a damage field keep a factorised tangent.
SLOWEST = 0.5


class StaticSystem(BuiltSolver):
    """Base class of solvers that find a displacement by iteration: at given loads, along a path, or of a time step.

    Attributes:
        at_fixed_load: Settings of Newton's steps at a fixed load factor.
        levels: The sheet, followed by coarser lattices over it.
        solvers: Linear solvers of the levels.
        kept: State of the last good load step.
        sizes: Scales of stiffness and load of the sheet.
        moves: Whether the sheet has inertia or damping.
        moved: Displacement since the begin of a time step [m], (N,) vec3, if what rupture releases is summed.
        rounds: Contact and rupture.
    """

    name: ClassVar[str]
    # Phases in which no part may act.
    without: ClassVar[Sequence[Phase]] = NOT_IN_EQUILIBRIUM
    # Whether the tangent has no negative eigenvalues, so that conjugate gradients solve with it.
    definite: ClassVar[bool]
    # Whether the tangent of the force law may be unsymmetric.
    takes_unsymmetric: ClassVar[bool] = False
    # Number of points up to which the tangent is factorised on the host before anything else.
    factorised: int = 0
    system: System
    levels: Sequence[Level]
    hierarchy: Hierarchy | None
    rounds: StaticRounds
    kept: Snapshot
    has_inertia: bool = False
    moves: bool = False
    moved: Array | None = None

    def __init__(self, settings: NewtonSettings, context: Context, law: BuiltLaw) -> None:
        self.label = f"solver = {self.name}"
        self.settings, self.at_fixed_load, self.context = settings, settings.at_fixed_load, context
        self.tangent: Tangent = tangent_of(law, context, settings.stiffness == "tangent")
        if not (self.tangent.symmetric or self.takes_unsymmetric):
            raise InputError(f"{law.label}: its tangent is not symmetric; expected the solver Newton or Explicit")
        self.tolerance = settings.tolerance or (1e-8 if context.bits == 64 else 1e-4)
        self.sizes, self._begin = Sizes(), 0.0

    def prepare(self, system: System) -> None:
        """Add the stages of residual and tangent."""
        system.refuse_phases(self.name, self.without)
        # Which has the solver.
        self.system = weakref.proxy(system)
        context, state = self.context, self.context.state
        loads = system.external
        finest = Level(context, system.law, self.tangent, loads.following, loads.contacts, self.tolerance, self.moves)
        dead = system.external.keep_dead_apart()
        stage = context.stage("evaluate", "every residual of Newton")
        with stage.one_launch():
            system.law.add_force(stage, state.displacement, state.force)
            if state.external is not None:
                system.external.add_force(stage, state.displacement, state.external)
        finest.add_residual(stage, dead)
        self.add_inertia(stage, finest)
        finest.add_turning()
        self.preconditioner = self._preconditioner()
        self.hierarchy = Hierarchy(finest, system) if self.preconditioner == "multigrid" else None
        self.levels = self.hierarchy.levels if self.hierarchy else [finest]
        cycle = Aggregates(finest) if self.preconditioner == "algebraic" else self.hierarchy
        self.solvers = [
            LinearSolver(level, index, self.preconditioner, cycle, self.definite)
            for index, level in enumerate(self.levels)
        ]
        self.report = Report(self.name, self.preconditioner)
        self.rounds = StaticRounds(system, self.moved)
        self.kept = Snapshot(context, OWNER)

    def add_inertia(self, stage: Stage, finest: Level) -> None:
        """Add inertia to the unbalanced force; there is none in equilibrium."""
        return None

    def host_state(self) -> dict[str, Any]:
        """The scales, for a bitwise identical restart."""
        return {"sizes": asdict(self.sizes)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        self.sizes = Sizes(**state["sizes"])

    def _set_contact_stiffness(self) -> None:
        """Give contact a stiffness like that of the sheet."""
        level = self.levels[0]
        if level.contacts:
            level.linearise(0.0)
            sheet = level.context.sheet
            stiffness = level.tangent.modulus() * float(np.mean(sheet.thickness)) / sheet.spacing**2
            for contact in level.contacts:
                contact.set_stiffness(stiffness)

    def _preconditioner(self) -> str:
        wanted, context = self.settings.preconditioner, self.context
        for contact in self.system.external.contacts:
            if wanted not in ("auto", "direct"):
                raise InputError(f"preconditioner = {wanted!r}: expected 'auto' or 'direct' with {contact.label}")
            return "direct"
        sheet, no_aggregates = context.sheet, self._no_aggregates()
        no_lattices = no_aggregates or self._no_lattices()
        if wanted == "multigrid" and no_lattices:
            others = "'direct'" if no_aggregates else "'algebraic' or 'direct'"
            raise InputError(f"preconditioner = 'multigrid': {no_lattices}; use {others}")
        if wanted == "algebraic" and no_aggregates:
            raise InputError(f"preconditioner = 'algebraic': {no_aggregates}; use 'direct'")
        if wanted != "auto":
            return wanted
        if sheet.size <= self.factorised:
            return "direct"
        if not no_lattices:
            return "multigrid"
        if context.device.is_cpu:
            return "algebraic" if not no_aggregates and sheet.size > ALGEBRAIC_FROM else "direct"
        return "direct" if sheet.size <= self.tangent.direct_points else "jacobi"

    def _no_aggregates(self) -> str:
        """Why the preconditioner cannot be algebraic, as text of a message, or ""."""
        law, size = self.system.law, self.context.sheet.size
        if law.horizon_ratio > MAX_MULTIGRID_HORIZON:
            return f"horizon = {law.horizon_ratio:.6g}: expected at most {MAX_MULTIGRID_HORIZON}"
        if law.intact is not None:
            return "damage: expected None, because bonds must not break"
        if law.needs_finest:
            return law.needs_finest
        for load in self.system.external.following:
            if load.ties is not None:
                return f"{load.label}: it holds parts of the sheet that are loose without it"
        return f"sheet of {size} points: expected more than {MAX_COARSEST} points" if size <= MAX_COARSEST else ""

    def _no_lattices(self) -> str:
        """Why the preconditioner cannot be multigrid though it can be algebraic, as text of a message, or ""."""
        sheet, held = self.context.sheet, self.context.held
        if sheet.lattice is None or sheet.cuts:
            return "sheet: expected an uncut rectangle"
        lattices = coarser(sheet.lattice)
        if not lattices:
            return f"sheet of {sheet.lattice.columns} x {sheet.lattice.rows} points: expected more on each side"
        nearest = coarse_points(lattices[-1], sheet.lattice)
        if np.bitwise_or.reduce(held) & ~np.bitwise_or.reduce(held[nearest]):
            return "supports: expected each on a point of the coarsest lattice too, or the coarse sheet would be loose"
        for load in self.system.external.following:
            if not load.coarsens:
                return f"{load.label}: expected loads that can be built on coarser lattices"
        return ""

    def _start_report(self, sink: FrameSink) -> None:
        """Begin the report; for a resumed run it includes the earlier load steps."""
        self._begin = perf_counter()
        if sink.solve is not None:
            self._begin -= sink.solve["seconds"]
            self.report.load_steps += sink.solve["load_steps"]

    def _summary(self, reached: float) -> dict[str, Any]:
        self.report.seconds = perf_counter() - self._begin
        return self.report.summary(self.levels[0].points, reached)

    def _record(self, sink: FrameSink, reached: float) -> None:
        """Pass the state to the sink as the next frame."""
        before = sink.steps
        sink.solve = self._summary(reached)
        now = reached * self.settings.duration
        sink.frame(sink.frame_index + 1, now, sink.solve["iterations"] - before, 0.0)

    def _new_entry(self, factor: float) -> dict[str, Any]:
        """A new entry of the report for an attempt at a load factor."""
        self.report.load_steps.append({"share": factor, "converged": False, "rounds": 0, "lattices": []})
        return self.report.load_steps[-1]

    def _load_step(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Find equilibrium at a load factor from the last good load step; return whether found, and the residual."""
        entry = self._new_entry(factor)
        last = len(self.levels) - 1
        if self.hierarchy:
            self.hierarchy.sample()
        for index in reversed(range(last + 1)):
            level = self.levels[index]
            self.set_loads(factor, index)
            copy(level.base, level.displacement)
            if index < last and self.hierarchy and entry["lattices"][-1]["converged"]:
                self.hierarchy.start(index)
                self._prescribe(index, factor)
            tolerance = self.tolerance if index == 0 else max(self.tolerance, COARSE_TOLERANCE)
            found = self._descend(index, factor, sink, tolerance)
            entry["lattices"].append(found)
            if not found["converged"] and index > 0:
                copy(level.displacement, level.base)
        entry["converged"] = found["converged"]
        return found["converged"], found["residuals"][-1]

    def _descend(
        self, index: int, factor: float, sink: FrameSink, tolerance: float, round_of: str = "",
        secants: Secants | None = None,
    ) -> dict[str, Any]:  # fmt: skip
        """Run Newton steps on a lattice at a load factor, and return the report entry.

        With `secants`, those of the tangent, they begin with the tangent that is there: it has changed little.
        """

        def report(steps: int, residual: float) -> None:
            sink.progress(steps, residual, tolerance, round_of)

        solver = self.solvers[index]
        if solver.kind != "direct" or self.levels[index].following or solver.factors is None:
            secants = None
        return Descent(
            self.at_fixed_load, self.levels[index], solver, partial(self.linearise, index),
            self.target(index, factor), self.sizes, tolerance, report if index == 0 else None,
            None if secants is None else SLOWEST, secants=secants,
        ).run()  # fmt: skip

    def _settled(self, found: dict[str, Any]) -> bool:
        """Whether an equilibrium, as `Descent` reports it, is one to the solver's tolerance or to round-off."""
        return bool(found["round_off"] or found["residuals"][-1] <= self.tolerance)

    def set_loads(self, factor: float, index: int = 0) -> None:
        """Set the loads of a level to a load factor."""
        duration = self.settings.duration
        self.system.set_clock(0.0, max(1.0, factor) * duration, factor * duration)
        if index > 0 and self.hierarchy:
            self.hierarchy.set_loads(index)

    def target(self, index: int, factor: float) -> np.ndarray:
        """Displacement of prescribed components at a load factor [m], shape (N, 3); other entries are meaningless."""
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

    def linearise(self, index: int, tension: float, keep: bool = False) -> bool:
        """Compute the tangent and preconditioner of a level with an added tension [Pa]; return whether it is of use.

        It is not at a slack start. With `keep` the aggregates of an earlier tangent will do, and
        the tangents of coarser lattices.
        """
        level = self.levels[index]
        if self.hierarchy:
            self.hierarchy.linearise(index, tension, keep)
        else:
            level.linearise(tension)
        if tension == 0.0 and not self.sizes.modulus and level.tangent.is_slack():
            return False
        return self.solvers[index].prepare(keep)
