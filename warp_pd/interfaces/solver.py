"""Solvers, and the system that they solve: the law, all parts and the sum of all loads."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.clock import Schedule
from ..device.fields import Array
from ..device.graph import LaunchSequence
from ..device.launches import Stage
from ..kernels.loads import begin_loads
from ..step import Phase
from .built_part import BuiltPart
from .law import BuiltLaw
from .part import BuiltLoad, BuiltRupture, Constraint


class ExternalForce(BuiltPart):
    """The sum of all loads: constant loads are summed once, the others by launches.

    Attributes:
        constant: Sum of the constant loads [N], shape (N, 3); None if there are none.
        changing: The other loads.
        following: Those of `changing` that depend on the displacement.
        contacts: Contact in static equilibrium, of those of `following` that are contact.
    """

    def __init__(self, context: Context, loads: Sequence[BuiltLoad]) -> None:
        self.context = context
        self.constant: np.ndarray | None = None
        self.changing: list[BuiltLoad] = []
        for load in loads:
            force = load.constant_force()
            if force is None:
                self.changing.append(load)
            else:
                # Start from zero, so that no sum is a negative zero.
                self.constant = (0.0 if self.constant is None else self.constant) + force
        self.following = [load for load in self.changing if load.follows_displacement]
        self.contacts = [load.at_rest for load in self.following if load.at_rest is not None]
        self._constant: Array | None = None
        # All processes must have the same fields.
        if self.changing and self.constant is not None and (self.constant.any() or context.partition is not None):
            self._constant = context.array("constant_loads", "loads", context.types.vec3, self.constant)
        self._dead: Array | None = None

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that recompute the external force; none if it is constant."""
        if phase is Phase.EXTERNAL_FORCE and self.context.state.external is not None:
            self.add_force(stage, self.context.state.displacement, self.context.state.external)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the external force [N]; none if it is constant."""
        if not self.changing:
            return
        if self._dead is None:
            self._add_begin(stage, self._constant, out)
            for load in self.changing:
                load.add_force(stage, displacement, out)
        else:
            self.add_dead(stage, self._dead)
            self._add_begin(stage, self._dead, out)
            self.add_following(stage, displacement, out)

    def keep_dead_apart(self) -> Array | None:
        """Let `add_force` also store the sum of the displacement-independent loads [N], (N,) vec3, and return it.

        None unless there are loads of both kinds.
        """
        if not self.following:
            return None
        if self._dead is None and len(self.following) < len(self.changing):
            context = self.context
            self._dead = context.array("dead_loads", "loads", context.types.vec3, shape=context.sheet.size)
        return self._constant if self._dead is None else self._dead

    def _add_begin(self, stage: Stage, constant: Array | None, out: Array) -> None:
        begin = begin_loads(self.context.bits, constant is not None)
        stage.pointwise("loads", begin, self.context.sheet.size, constant=constant, external=out)

    def add_dead(self, stage: Stage, out: Array) -> None:
        """Add the launches that fill `out` with the force of the displacement-independent loads [N]."""
        self._add_begin(stage, self._constant, out)
        for load in self.changing:
            if load not in self.following:
                load.add_force(stage, self.context.state.displacement, out)

    def add_following(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that add the force of the displacement-dependent loads to `out` [N]."""
        for load in self.following:
            load.add_force(stage, displacement, out)


# How a run ends: at its end, with a state that is not sound, without an equilibrium, on a path before its last load
# factor although Newton's method converges, by the user.
FINISHED, DIVERGED, NOT_CONVERGED, ENDED, STOPPED = (
    "finished", "diverged", "not converged", "ended early", "interrupted",
)  # fmt: skip


class DivergedError(RuntimeError):
    """The state became NaN or Inf, or moves impossibly fast; the message gives the place, time and likely cause."""


class UnbalancedError(DivergedError):
    """The energy balance changed more in a frame than by steps that are short enough."""


class FrameSink(Protocol):
    """Receives the frames of a solver, and provides the state of a resumed run; by default it does nothing.

    Attributes:
        frame_index: Index of the last frame.
        time: Its time [s].
        steps: Steps so far.
        stable_dt: Latest stable step [s], or None.
        residual: Latest relative residual of a sheet in static equilibrium, or None.
        solve: Report of a static solver, or None.
    """

    frame_index: int = 0
    time: float = 0.0
    steps: int = 0
    stable_dt: float | None = None
    residual: float | None = None
    solve: dict[str, Any] | None = None

    @property
    def restarts(self) -> bool:
        """Whether a restart file may follow a frame: what it does not hold must not matter to the next step."""
        return False

    def frame(self, index: int, now: float, steps: int, dt: float, strict: bool = False) -> None:
        """Record a frame at the time `now` [s], `steps` steps of dt [s] after the last one.

        Raises, and then records nothing of the frame:
            DivergedError: if the state is not sound.
            UnbalancedError: if `strict` and the energy balance changed much since the last frame.
        """
        return None

    def repeat(self) -> None:
        """Forget what came after the last recorded frame: the solver computes the frame again."""
        return None

    def row(self, now: float, dt: float) -> None:
        """Record a row of the history between frames, after a step of dt [s]; the host reads nothing."""
        return None

    def balance(self, now: float, dt: float) -> float | None:
        """Error of the energy balance at the time `now` [s], after a step of dt [s]; None where there is no balance."""
        return None

    def progress(self, steps: int, residual: float, tolerance: float, round_of: str = "") -> None:
        """Report the progress of a static solver between frames; `round_of` as in "round 2 of contact", or ""."""
        return None

    def say(self, line: str) -> None:
        """Tell the user at once what the notes of the run will say, too."""
        return None

    def stepped(self, now: float, dt: float, steps: int) -> None:
        """Report that a frame has taken `steps` steps, the last of dt [s], and is at the time `now` [s]."""
        return None

    def keep_going(self) -> None:
        """Raise KeyboardInterrupt if the user asked to stop some time ago and the frame is still not finished.

        Solvers call it between the steps of a frame.
        """
        return None


@dataclass(eq=False)
class System:
    """A sheet with its law and parts on a device, as used by solvers.

    Attributes:
        context: Context with arrays, stages and shared state.
        law: The force law.
        external: The sum of all loads.
        parts: All parts that add launches, in the order in which they act within a phase.
        constraints: Prescribed components of points.
        rupture: The rupture criterion on the device, or None.
    """

    context: Context
    law: BuiltLaw
    external: ExternalForce
    parts: tuple[BuiltPart, ...]
    constraints: tuple[Constraint, ...]
    rupture: BuiltRupture | None
    _schedules: LaunchSequence | None = field(default=None, init=False, repr=False)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of all parts in a phase, in their order."""
        for part in self.parts:
            part.add(phase, stage)

    def refuse_phases(self, solver: str, phases: Iterable[Phase], besides: BuiltPart | None = None) -> None:
        """Check that no part, besides one, acts in phases that the solver does not have."""
        context = self.context
        for phase in phases:
            for part in (part for part in self.parts if part is not besides):
                trial = Stage("trial", "", context.device, context.block_dim, [])
                part.add(phase, trial)
                if len(trial):
                    raise InputError(f"{part.label}: not supported by the solver {solver}; expected Explicit")

    def set_clock(self, advance: float, end: float, now: float | None = None) -> None:
        """Set the time per step, the end time and optionally the current time [s]; evaluate the schedules."""
        if self._schedules is None:
            self._schedules = self.context.sequence("clock")
        self.context.clock.set(self._schedules, advance, end, now)

    def prescribed(self, time: float) -> np.ndarray:
        """Displacement of prescribed components at a time [m], shape (N, 3); free components have the initial one."""
        target = self.context.initial_displacement.copy()
        for constraint in self.constraints:
            if constraint.motion is not None:
                points = constraint.points
                moved = constraint.displacement(self.context.clamped_positions[points], time)
                if self.context.placement is not None:
                    moved += self.context.placement[points]
                for c in range(3):
                    if constraint.components & (1 << c):
                        target[points, c] = moved[:, c]
        return target


class BuiltSolver(BuiltPart, Protocol):
    """A solver on a device.

    Attributes:
        divides: Whether it supports several processes.
        turns: Whether the load factor may decrease from one frame to the next.
        has_inertia: Whether the sheet has inertia, and so kinetic energy.
    """

    divides: bool = False
    turns: bool = False
    has_inertia: bool = True

    def prepare(self, system: System) -> None:
        """Compose the stages of the solver from the launches of all parts."""
        ...

    def cause_of_step(self, dt: float) -> str:
        """Why a step of dt [s] is far shorter than waves need, as text of a message; "" if the sheet itself is why."""
        return ""

    def first_step(self, sink: FrameSink) -> float:
        """Set the first step and return it [s], for the energy at half steps of frame 0; 0 without steps in time."""
        return 0.0

    def run(self, sink: FrameSink) -> str:
        """Run to the end, passing every frame to the sink; return the final status."""
        ...

    def host_state(self) -> dict[str, Any]:
        """Data needed for a restart in addition to fields, as JSON-compatible values."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        return None


@runtime_checkable
class Solver(Protocol):
    """A solver: a frozen dataclass with a method `build`.

    Attributes:
        dynamic: Whether it integrates in time; work and losses are then summed.
    """

    dynamic: ClassVar[bool]

    @property
    def duration(self) -> float:
        """Simulated time, or load time at full load [s]."""
        ...

    @property
    def precision(self) -> int:
        """Default precision, 32 or 64."""
        ...

    @property
    def frame_count(self) -> int:
        """Number of frames after the first one."""
        ...

    @property
    def equal_frames(self) -> bool:
        """Whether the frames are equally spaced in time."""
        ...

    @property
    def mass_damping(self) -> float | None:
        """Initial mass damping [1/s]; None for none."""
        ...

    @property
    def steps_explicitly(self) -> bool:
        """Whether points are moved by explicit time steps."""
        ...

    @property
    def default_ramp(self) -> Schedule | None:
        """Schedule of the factor of loads without a schedule; None if these are constant."""
        ...

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        ...
