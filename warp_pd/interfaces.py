"""Where parts meet: what a simulation asks of supports, loads, contact, rupture, force laws, solvers and writers.

A scene names parts: small frozen dataclasses. Each is built on a device and then adds its own launches, phase by phase
(phases.py). To write a part of your own, inherit from the protocol: optional methods have defaults. See
docs/write-your-own-part.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import warp as wp

from .checks import InputError
from .device.context import Context
from .device.fields import Array
from .device.graph import LaunchSequence
from .device.launches import Stage
from .families import Families
from .frame import Frame
from .phases import Phase
from .schedules import Schedule
from .sheet import Sheet

History = list[dict[str, float]]


@dataclass(frozen=True, eq=False)
class Constraint:
    """Components of points that a part holds or moves.

    Attributes:
        owner: Name of the part, for messages.
        points: Point indices, int32.
        components: Bits: 1, 2, 4 for x, y, z; 8 for points that a rigid body moves.
        motion: Schedule of the displacement [m], or None for points that stay where they start.
    """

    owner: str
    points: np.ndarray
    components: int
    motion: Schedule | None = None


@dataclass(frozen=True)
class StepLimit:
    """A longest step [s] and, for messages, why: "in which the ball moves 0.25 spacings"."""

    seconds: float
    reason: str


class BuiltPart(Protocol):
    """A part on a device.

    Attributes:
        label: What messages call it, such as "contact = RigidBall".
    """

    label: str = "part"

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase to a stage; nothing where the part has none."""
        return None

    def begin(self) -> None:
        """Work on the host once, at the start of a run that does not resume another."""
        return None

    def sums(self) -> Mapping[str, Array]:
        """Arrays of the points, float64 or vec3, to be summed up at every frame, by name."""
        return {}

    def column_names(self) -> Sequence[str]:
        """Names of the columns that it adds to the history; no measure may take them."""
        return ()

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Columns of the history at a frame, under the names of `column_names`.

        Args:
            totals: Sums of what all parts gave in `sums`; of a vec3 array under name_x, name_y, name_z.
            elapsed: Time since the last frame [s].
        """
        return {}

    def end_frame(self) -> None:
        """Work on the host after a frame has been recorded."""
        return None

    def step_limit(self) -> StepLimit | None:
        """Longest step that the part allows, or None."""
        return None

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """What a user should know of a run that is over, one line each.

        Args:
            history: One row per frame.
            load_duration: Load time of the whole load in static runs [s]; None in dynamics.
        """
        return []


@runtime_checkable
class Part(Protocol):
    """What a scene names. A frozen dataclass whose `build` puts it on a device.

    Attributes:
        argument: Argument of a scene that takes it: "loads", "contact" or "damage".
        adds_force: Whether it adds to the external force.
        does_work: Whether it does work on the sheet, for the energy balance.
    """

    argument: ClassVar[str] = "loads"
    adds_force: ClassVar[bool] = False
    does_work: ClassVar[bool] = False

    def compile_key(self) -> tuple[object, ...]:
        """What decides which kernels are compiled, besides the type."""
        return ()

    def check(self, others: Sequence[Part]) -> None:
        """Raise InputError for parts that do not go with this one."""
        return None

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """Components of points that it holds or moves."""
        return ()

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """The part on a device: allocate arrays, register schedules; launches come later."""
        ...


class BuiltLoad(BuiltPart, Protocol):
    """A load on a device. Every solver calls the same `add_force`.

    Attributes:
        follows_displacement: Whether the force depends on the displacement.
        coarsens: Whether a load that follows the displacement exists on coarser sheets, for multigrid.
    """

    follows_displacement: bool = False
    coarsens: bool = False

    def constant_force(self) -> np.ndarray | None:
        """The force [N], shape (N, 3), if it never changes: then `add_force` is not called. Else None."""
        return None

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that add the force at a displacement [m] to `out` [N], both (N,) vec3."""
        ...

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the launches that add the change of the force along a direction [m] to `out` [N].

        Asked of loads that follow the displacement.

        Returns:
            False if there is no tangent: then Newton's method refuses the load.
        """
        return False

    def on_coarser(self, context: Context, law: BuiltLaw) -> BuiltLoad | None:
        """The same load on a coarser sheet, for multigrid; None if there is none.

        Asked of loads that follow the displacement. Schedules are those of this load.
        """
        return None


class External(BuiltPart, Protocol):
    """The sum of all loads.

    Attributes:
        following: Loads that follow the displacement.
    """

    following: Sequence[BuiltLoad]

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the external force [N]; none if it never changes."""
        ...

    def add_dead(self, stage: Stage, out: Array) -> None:
        """Add the launches that fill `out` with the force of the loads that do not follow the displacement [N]."""
        ...

    def add_following(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that add to `out` the force of the loads that follow the displacement [N]."""
        ...


class Load(Part, Protocol):
    """A part that adds to the external force."""

    adds_force: ClassVar[bool] = True
    does_work: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """The load on a device."""
        ...


class BuiltContact(BuiltPart, Protocol):
    """Contact on a device."""

    def ball_diameter(self) -> float | None:
        """Diameter of a ball to be drawn [m], or None."""
        return None

    def centre(self, time: float) -> np.ndarray | None:
        """Its centre at a time [m], shape (3,), or None."""
        return None


@runtime_checkable
class Contact(Part, Protocol):
    """Contact with a body."""

    argument: ClassVar[str] = "contact"
    does_work: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """The contact on a device."""
        ...


class BuiltRupture(BuiltPart, Protocol):
    """Rupture on a device.

    Attributes:
        damage: Broken share of each point's bonds as of the last frame, 0 to 1, (N,) float32.
        intact_faces: Which triangles no crack has cut as of the last frame, (F,) uint8.
    """

    damage: Array
    intact_faces: Array


@runtime_checkable
class Rupture(Part, Protocol):
    """A rupture criterion.

    Attributes:
        spared: Points whose bonds never break, such as those in a clamp; None spares none.
    """

    argument: ClassVar[str] = "damage"
    spared: Any

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """The criterion on a device."""
        ...


class SparseTangent(Protocol):
    """A tangent as a sparse matrix on the host, for a direct factorisation."""

    def factorise(self) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3); None if K is singular."""
        ...


class Solve(Protocol):
    """Solves K x = b."""

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """X of b, both of shape (N, 3)."""
        ...


class Tangent(Protocol):
    """How the internal force changes with the displacement, for Newton's method.

    Attributes:
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
        direct_points: Up to so many points a factorisation on the host beats iterations on a GPU.
    """

    inverse_blocks: Array
    direct_points: int

    def add_linearise(self, stage: Stage, displacement: Array, tension: Array) -> None:
        """Add the launches that take the tangent at a displacement, with an isotropic tension [Pa] added."""
        ...

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the change of the force along a direction [m]."""
        ...

    def is_slack(self) -> bool:
        """Whether the state just linearised has no stiffness against some displacement."""
        ...

    def modulus(self) -> float:
        """How stiff the sheet is [Pa], at the last linearisation."""
        ...

    def min_tension(self, relative: float) -> float:
        """Isotropic tension [Pa] that the tangent needs at least, at a relative residual."""
        ...

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix."""
        ...


class BuiltLaw(BuiltPart, Protocol):
    """A force law on a device.

    Attributes:
        weights: Weights in use, for the summary.
        has_energy: Whether its force is minus the gradient of an energy, or at least reports one.
        horizon: Horizon over the spacing of the sheet [-].
        families: The families on the host.
        struct: The families on the device, a Warp struct (kernels/families.py).
        intact: Bits of the intact bonds, (words, N) uint32, or None if nothing can break.
        constants: Constants of the material.
        inverse_horizon: [1/m].
        unit_volume: Thickness times reference area [m^3].
        correction: What a correction of the weights did, for the summary, or None.
        earlier_energy: Warp function of the energy of a family a moment ago; of laws with an energy.
        breaks_at_rest: Whether bonds of a sheet in static equilibrium may break under Newton's method.
        coarsens: Whether there is a law on coarser sheets.
    """

    weights: str
    has_energy: bool
    horizon: float
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    inverse_horizon: float
    unit_volume: float
    correction: dict[str, float] | None
    earlier_energy: wp.Function | None
    breaks_at_rest: bool
    coarsens: bool

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family [J] as of the last frame, (N,) float64; None without an energy."""
        ...

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        ...

    def bond_force(self) -> Array:
        """What the family of a point does to each of its pairs [N], (members, N) vec3, renewed with every force.

        Raises:
            InputError: for a law that does not keep it.
        """
        ...

    def fictitious_mass(self, stage: Stage) -> Array | None:
        """Add the launches that fill an array (N,) with a fictitious mass from the stiffness; None if it has none."""
        ...

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """The tangent for Newton's method.

        Args:
            context: Where to put arrays.
            geometric: Whether the tension of the sheet has its part in the stiffness.

        Raises:
            InputError: for a law without one.
        """
        ...

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """The law on a coarser sheet, with a horizon over its spacing, for multigrid; None if there is none."""
        return None

    def request_fields(self, names: Sequence[str]) -> None:
        """Let frames show further fields of the law.

        Raises:
            InputError: for names that it does not offer.
        """
        ...

    def likely_cause(self) -> str:
        """What to suspect where a run in time diverged."""
        ...


@runtime_checkable
class Law(Protocol):
    """A force law: how displacements turn into forces. A frozen dataclass."""

    @property
    def material(self) -> Any:
        """The material."""
        ...

    @property
    def horizon(self) -> float:
        """Horizon over the spacing of the sheet [-]."""
        ...

    def compile_key(self, layout: str, breakable: bool) -> tuple[object, ...]:
        """What decides which kernels are compiled."""
        ...

    def build(self, context: Context) -> BuiltLaw:
        """Families, tables and kernels on a device."""
        ...


class FrameSink(Protocol):
    """What a solver reports to: takes frames, knows where a resumed run stands.

    Attributes:
        frame_index: Index of the last frame.
        time: Its time [s].
        steps: Steps so far.
        stable_dt: Newest stable step [s], or None.
        residual: Newest relative residual of a sheet in static equilibrium, or None.
        solve: Report of a static solver, or None.
    """

    frame_index: int
    time: float
    steps: int
    stable_dt: float | None
    residual: float | None
    solve: dict[str, Any] | None

    def frame(self, index: int, now: float, steps: int, dt: float) -> None:
        """Record a frame at a time [s], so many steps of dt [s] after the last one."""
        ...

    def progress(self, steps: int, residual: float, tolerance: float) -> None:
        """Report a static solver on its way."""
        ...


@dataclass(eq=False)
class System:
    """A sheet with its law and parts on a device: what solvers work on.

    Attributes:
        context: Arrays, stages, shared state.
        law: The force law.
        external: The sum of all loads.
        parts: All parts that add launches, in the order in which they act within a phase.
        constraints: Held and moved components of points.
    """

    context: Context
    law: BuiltLaw
    external: External
    parts: tuple[BuiltPart, ...]
    constraints: tuple[Constraint, ...]
    _schedules: LaunchSequence | None = field(default=None, init=False, repr=False)

    def add(self, phases: Iterable[Phase], stage: Stage) -> None:
        """Add the launches of all parts in some phases, in order."""
        for phase in phases:
            for part in self.parts:
                part.add(phase, stage)

    def refuse_phases(self, solver: str, phases: Iterable[Phase]) -> None:
        """Refuse parts that act in phases that a solver does not have.

        Raises:
            InputError: for the first of them.
        """
        context = self.context
        for phase in phases:
            for part in self.parts:
                trial = Stage("trial", "", context.device, context.module, context.block_dim, [])
                part.add(phase, trial)
                if len(trial):
                    raise InputError(
                        f"{part.label}: the solver {solver} does not do this ({phase.value}); take Explicit"
                    )

    def set_clock(self, advance: float, end: float, now: float | None = None) -> None:
        """Let time advance by so much per step [s] until `end`, from `now` or where it is, and evaluate schedules."""
        if self._schedules is None:
            self._schedules = self.context.sequence("clock")
        self.context.clock.set(self._schedules, advance, end, now)

    def prescribed(self, time: float) -> np.ndarray:
        """Displacement of held components at a time [m], shape (N, 3); free components keep the initial one."""
        target = self.context.initial_displacement.copy()
        for constraint in self.constraints:
            if constraint.motion is not None:
                for c in range(3):
                    if constraint.components & (1 << c):
                        knots = constraint.motion
                        target[constraint.points, c] = np.interp(time, knots.times, knots.values[:, c])
        return target


class BuiltSolver(BuiltPart, Protocol):
    """A solver on a device."""

    def prepare(self, system: System) -> None:
        """Compose the stages of the solver from the launches of all parts."""
        ...

    def run(self, sink: FrameSink) -> str:
        """Run to the end, handing every frame to the sink; returns the final status."""
        ...

    def host_state(self) -> dict[str, Any]:
        """Numbers that a restart needs, besides fields; anything that JSON takes."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `host_state` gave."""
        return None


@runtime_checkable
class Solver(Protocol):
    """How displacements follow from forces. A frozen dataclass.

    Attributes:
        dynamic: Whether it steps in time: then work and losses are summed up.
    """

    dynamic: ClassVar[bool]

    @property
    def duration(self) -> float:
        """Time to simulate, or load time of the whole load [s]."""
        ...

    @property
    def precision(self) -> int:
        """32 or 64, where the run does not say."""
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
        """Mass damping at the start [1/s]; None without any."""
        ...

    @property
    def steps_explicitly(self) -> bool:
        """Whether points move by explicit steps."""
        ...

    @property
    def default_ramp(self) -> Schedule | None:
        """Schedule of the factor of loads that have none of their own; None if those are constant."""
        ...

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """The solver on a device."""
        ...


class Writer(Protocol):
    """Looks at frames from outside; the simulation does not know what becomes of them."""

    def write(self, frame: Frame) -> None:
        """Take one frame."""
        ...

    def save(self) -> None:
        """Bring everything written so far to the disk, so that a restart can go on from here."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


@dataclass(frozen=True)
class FrameReport:
    """What a reporter is told at a frame.

    Attributes:
        when: Words for when it is, such as "t = 0.5 s".
        share: Part of the run that is done, 0 to 1.
        steps_per_second: Rate of the steps so far.
        frames: Number of frames of the run.
        row: Row of the history.
    """

    when: str
    share: float
    steps_per_second: float
    frames: int
    row: Mapping[str, float]


class Reporter(Protocol):
    """Shows the progress of a run."""

    def begin(self, headline: str) -> None:
        """The simulation is built; `headline` says what runs where."""
        ...

    def compiled(self, seconds: float) -> None:
        """Its kernels are compiled."""
        ...

    def frame(self, report: FrameReport) -> None:
        """A frame has been recorded."""
        ...

    def residual(self, steps: int, residual: float, tolerance: float) -> None:
        """A static solver on its way."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...
