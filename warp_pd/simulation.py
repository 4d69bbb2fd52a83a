"""Simulation: gathers the parts, plans the arrays and launches, and runs them.

One step, in the order of its launches (those that no part asks for do not exist):

    prescribe, move_bodies            supports and rigid inclusions
    drift                             half kick, displacement
    project                           contact with the ball
    tick                              time
    break_bonds                       rupture
    update                            internal variables of the force law
    family_force, gather              internal force
    add_release                       energy that each bond has released
    begin_loads, add_...              external force
    kick, kick_bodies, separate       second half kick, contact again

Drift, project, gather, loads, kick and separate share a launch with the one before where nothing stands between; so do
the end of a step and the beginning of the next, where steps follow each other.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .checks import InputError, numbers, one_of, point_indices
from .contact import RigidBall
from .damage import CriticalEnergy, Rupture, crossing_bonds
from .forces import BondAssociated, ForceLaw, Visco, ViscoBondBased
from .forces.bond_based import BondBasedForce
from .forces.neural import NeuralForce
from .frame import Frame, Surface
from .launches import SMALL, SMALL_BLOCK, LaunchSequence, Workspace
from .loads import BodyForce, BoundaryForce, Fixed, Load, Motion, PointForce, Pressure, ScheduleTable
from .sheet import Sheet

if TYPE_CHECKING:
    from .runner import Result
    from .solvers import Solver
    from .solvers.newton import Search
    from .solvers.stable_step import StableStep

RIGID = 8
# Columns of the history that are not measures.
HISTORY = (
    "time", "step", "kinetic", "strain", "external", "damping", "rupture", "viscous", "balance_error",
    "bonds_outside_training", "ball_force_x", "ball_force_y", "ball_force_z", "largest_damage", "mean_damage",
)  # fmt: skip


@dataclass(frozen=True)
class Measure:
    """A number that a scene reports.

    Attributes:
        name: Key in summary.json.
        unit: SI unit.
        value: Function of the built simulation and of the newest frame.
        reference: What it is compared with, in the same unit, or None.
        source: Where the reference comes from.
    """

    name: str
    unit: str
    value: Callable[[Built, Frame], float]
    reference: float | None = None
    source: str = ""


@dataclass(frozen=True)
class Outcome:
    """A number that a scene reports of its whole run, such as a peak load.

    Attributes:
        name: Key in summary.json.
        unit: SI unit.
        value: Function of the history, one row a frame, in order; None where there is no such number yet.
        reference: What it is compared with, in the same unit, or None.
        source: Where the reference comes from.
    """

    name: str
    unit: str
    value: Callable[[list[dict[str, float]]], float | None]
    reference: float | None = None
    source: str = ""


@dataclass(eq=False)
class Simulation:
    """A sheet and everything that acts on it. Nothing is allocated before `build` or `run`.

    Attributes:
        sheet: The sheet.
        force: Force law.
        solver: Explicit, Relaxation or Newton.
        loads: Supports and loads.
        contact: A rigid ball, or None.
        damage: Rupture criterion, or None: nothing can break.
        measures: Numbers to report, at every frame; the summary has those of the last one.
        outcomes: Numbers to report of the whole run.
        fields: Names of further point fields of the frames, of those that the force law has.
        initial_displacement: [m], shape (N, 3), or None for zero. The sheet was brought there at once: nothing of a
            viscous law has relaxed.
        initial_velocity: [m/s], shape (N, 3), or None for zero.
        track_energy: Whether external work and dissipation are summed up for the energy balance.
        scene: Name of the scene.
        file: Python file of a scene that does not come with the package, or None.
        section: Part of the paper that it rebuilds.
        pictures: Function (history, folder) that draws the scene's pictures into the folder of the results,
            or None.
        notes: What a scene decided for the user, one line each; the summary and the command line repeat them.
    """

    sheet: Sheet
    force: ForceLaw
    solver: Solver
    loads: Sequence[Load] = ()
    contact: RigidBall | None = None
    damage: Rupture | None = None
    measures: Sequence[Measure] = ()
    outcomes: Sequence[Outcome] = ()
    fields: Sequence[str] = ()
    initial_displacement: np.ndarray | None = None
    initial_velocity: np.ndarray | None = None
    track_energy: bool = True
    scene: str = "simulation"
    file: str | None = None
    section: str = ""
    pictures: Callable[[list[dict[str, float]], Any], None] | None = None
    notes: Sequence[str] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    def build(self, device: str | None = None, precision: int | None = None) -> Built:
        """Allocate arrays and declare kernels and launches; compiles nothing yet.

        Args:
            device: "cpu", "cuda", "cuda:0", ...; by default CUDA where there is one.
            precision: 32 or 64; by default the solver's.

        Raises:
            InputError: for parts that do not fit together, or a device that is not there.
        """
        self._check_parts()
        return Built(self, find_device(device), one_of("precision", precision or self.solver.precision, (32, 64)))

    def _check_parts(self) -> None:
        """Raise InputError for a part that is none, or a measure whose name is taken."""
        from .solvers import Solver

        if not hasattr(self.force, "signature"):
            raise InputError(f"force = {self.force!r}: allowed is a force law, such as BondAssociated(material)")
        kinds = (
            ("sheet", self.sheet, Sheet, "a Sheet"),
            ("solver", self.solver, Solver, "Explicit, Relaxation or Newton"),
            ("contact", self.contact, RigidBall | None, "a RigidBall or None"),
            ("damage", self.damage, Rupture | None, "CriticalStretch, CriticalEnergy or None"),
        )
        for name, part, kind, allowed in kinds:
            if not isinstance(part, kind):
                raise InputError(f"{name} = {part!r}: allowed is {allowed}")
        lists: tuple[tuple[str, Any, Any], ...] = (
            ("loads", self.loads, Load), ("measures", self.measures, Measure), ("outcomes", self.outcomes, Outcome),
        )  # fmt: skip
        for name, parts, kind in lists:
            if not isinstance(parts, Sequence) or isinstance(parts, str):
                raise InputError(f"{name} = {parts!r}: allowed is a list of {name}")
            for index, part in enumerate(parts):
                if not isinstance(part, kind):
                    raise InputError(f"{name}[{index}] is of type {type(part).__name__}: allowed is a list of {name}")
        names = [m.name for m in self.measures] + [o.name for o in self.outcomes]
        for name in names:
            if not isinstance(name, str) or not name or not name.isprintable():
                raise InputError(f"name of a measure = {name!r}: allowed is text in one line")
            if names.count(name) > 1 or name in HISTORY:
                raise InputError(f"measures: two numbers of the run would be called {name!r}: allowed is one")

    def plan(self, device: str | None = None, precision: int | None = None) -> str:
        """Table of the arrays and launches of this simulation."""
        from .plan import describe

        return describe(self.build(device, precision))

    def run(self, **options: Any) -> Result:
        """Run to the end; see `warp_pd.runner.run` for the options."""
        from .runner import run

        return run(self, **options)


def find_device(name: str | None) -> Any:
    """The Warp device of that name.

    Raises:
        InputError: if it is not there; a CPU never stands in for a GPU that was asked for.
    """
    wp.config.log_level = wp.config.log_level if wp.config.log_level > wp.LOG_WARNING else wp.LOG_WARNING
    wp.init()
    present = [d.alias for d in wp.get_devices()]
    allowed = ", ".join(repr(alias) for alias in present)
    if name is None:
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    if name == "cuda" and not wp.is_cuda_available():
        raise InputError(f"device = {name!r}: no CUDA device was found; allowed here are {allowed}")
    if name != "cuda" and name not in present:
        raise InputError(f"device = {name!r}: allowed here are {allowed}")
    return wp.get_device(name)


@dataclass(eq=False)
class State:
    """What changes in time: arrays on the device, [points] unless said.

    Attributes:
        displacement: u [m], vec3.
        velocity: [m/s], vec3, at full steps.
        force: Internal force [N], vec3.
        external: External force [N], vec3, or None without loads.
        work: External work [J], float64, or None.
        dissipated: Energy lost to damping [J], float64, or None.
        released: Energy lost with broken bonds [J], float64, or None.
        energy_release: Energy release rate of every bond [N/m], (members, N), or None.
        impulse: What the ball gave each point since the last frame [N s], vec3, or None.
        time: [s], one float64, or None where nothing depends on time.
        bodies: Place [m], linear [kg m/s] and angular momentum [kg m^2/s], rotation of each rigid inclusion.
    """

    displacement: Any
    velocity: Any
    force: Any
    external: Any = None
    work: Any = None
    dissipated: Any = None
    released: Any = None
    energy_release: Any = None
    impulse: Any = None
    time: Any = None
    bodies: tuple[Any, ...] = ()


class Built:
    """A simulation on a device: its arrays, launches and state.

    Attributes:
        simulation: What was built.
        workspace: Arrays and launches.
        state: What changes in time.
        force: The force law on the device.
        step: The time step [s], one real number.
        held: Bits of held components, uint8 a point, on the host.
        stable_step: Estimate of the stable step, or None; the solver adds it.
        inertia: What resists acceleration in a step, shape (N,): the mass, or what the solver puts in its place.
        newton: Newton's search; the solver Newton adds it.
    """

    stable_step: StableStep | None = None
    newton: Search
    inertia: Any
    unbalanced: Any
    reaction: Any

    def __init__(self, simulation: Simulation, device: Any, precision: int) -> None:
        from .kernels.numeric import numeric

        simulation.solver.check(simulation)
        self.simulation = simulation
        self.types = numeric(precision)
        self.held, self._motions = _constraints(simulation)
        self.schedules = ScheduleTable()
        self._schedule_ids = self._collect_schedules()
        block = SMALL_BLOCK if simulation.sheet.size < SMALL else 256
        self.workspace = Workspace(device, precision, self._module_name(precision), block)
        self.force: Any = simulation.force.build(self.workspace, simulation.sheet, simulation.damage is not None)
        if self.force.internal and not simulation.solver.in_time:
            raise InputError(
                f"solver = {type(simulation.solver).__name__} with Prony terms: allowed is Explicit; without them "
                f"the law is what is left after a long time"
            )
        self._allocate()
        from .kernels.integrate import integration

        self.integration = integration(
            self.types.bits, self.has_held, self.has_loads, self.damped, self.tracked, self.workspace.module
        )
        if self.schedules.schedules:
            self._add_clock()
        if simulation.solver.steps_explicitly:
            self.inertia = simulation.solver.inertia(self)
            self._add_step()
        elif simulation.damage is not None:
            self._add_break("rupture", simulation.damage)
        self._add_setup()
        self._add_frame()
        simulation.solver.add(self)

    # What is there -------------------------------------------------------------------------------------

    @property
    def breakable(self) -> bool:
        """Whether bonds can break."""
        return self.simulation.damage is not None

    @property
    def has_held(self) -> bool:
        """Whether any component of any point is held."""
        return bool(self.held.any())

    @property
    def has_loads(self) -> bool:
        """Whether external forces act."""
        return any(not isinstance(load, Fixed | Motion) for load in self.simulation.loads)

    @property
    def damped(self) -> bool:
        """Whether there is mass damping."""
        solver = self.simulation.solver
        return solver.damping > 0.0 or solver.adaptive_damping

    @property
    def load_duration(self) -> float | None:
        """Load time of the whole load where the sheet is brought to rest [s]; None for a run in time."""
        solver = self.simulation.solver
        return None if solver.in_time else solver.duration

    @property
    def tracked(self) -> bool:
        """Whether work and dissipation are summed up."""
        return self.simulation.track_energy and self.simulation.solver.in_time

    def _collect_schedules(self) -> dict[int, int]:
        """Index in the schedule table of each part that changes in time, by the part's id."""
        ids: dict[int, int] = {}
        for load in self.simulation.loads:
            found = None if isinstance(load, Fixed) else load.schedule()
            if found is not None:
                ids[id(load)] = self.schedules.add(found)
        if self.simulation.contact is not None:
            ball = self.simulation.contact
            ids[id(ball)] = self.schedules.add(ball.schedule(self.simulation.solver.duration))
        return ids

    def _module_name(self, precision: int) -> str:
        """One Warp module a configuration, named by everything that decides its kernels."""
        s = self.simulation
        kinds = [
            type(load).__name__ + str(id(load) in self._schedule_ids) + getattr(load, "form", "") for load in s.loads
        ]
        layout = "lattice" if s.sheet.lattice is not None else "cloud"
        law = s.force.signature(layout, self.breakable)
        named = [getattr(part, "__module__", "") + "." + part.__qualname__ if callable(part) else part for part in law]
        key = (
            precision, named, getattr(s.force, "fast", False), self.has_held, self.has_loads, self.damped, self.tracked,
            type(s.solver).__name__, type(s.damage).__name__,
            sorted(set(kinds)), s.contact is not None, s.damage is not None and s.damage.spared is not None,
            bool(s.sheet.inclusions), bool(self.schedules.schedules),
        )  # fmt: skip
        return "warp_pd_" + hashlib.sha1(repr(key).encode()).hexdigest()[:12]

    # Arrays --------------------------------------------------------------------------------------------

    def _allocate(self) -> None:
        s, w, t = self.simulation, self.workspace, self.types
        n = s.sheet.size
        mass = s.sheet.areas * s.sheet.thickness * s.sheet.density
        self.mass = w.array("mass", "Simulation", t.real, mass)
        self.step: Any = w.array("step", "Simulation", t.real, shape=1) if s.solver.steps_explicitly else None
        self.damping = w.array("damping", "solver", t.real, np.array([s.solver.damping])) if self.damped else None
        self.held_mask = w.array("held", "loads", wp.uint8, self.held) if self.has_held else None
        self.state = State(
            displacement=w.array("displacement", "Simulation", t.vec3, self._initial("initial_displacement")),
            velocity=w.array("velocity", "Simulation", t.vec3, self._initial("initial_velocity")),
            force=w.array("force", "Simulation", t.vec3, shape=n),
        )
        if self.has_loads:
            self.state.external = w.array("external", "loads", t.vec3, self._constant_loads())
        if self.tracked and (self.has_loads or self.has_held or s.contact is not None):
            self.state.work = w.array("work", "energy balance", wp.float64, shape=n)
        if self.tracked and self.damped:
            self.state.dissipated = w.array("dissipated", "energy balance", wp.float64, shape=n)
        if self.tracked and self.breakable and self.force.has_energy:
            self.state.released = w.array("released", "energy balance", wp.float64, shape=n)
        self.scheduled = self.advance = None
        if self.schedules.schedules:
            begins, knots, values = self.schedules.tables()
            self._begins = w.array("schedule_begins", "schedules", wp.int32, begins)
            self._knots = w.array("schedule_knots", "schedules", wp.float64, knots)
            self._values = w.array("schedule_values", "schedules", wp.vec3d, values)
            self.scheduled = w.array("scheduled", "schedules", t.vec3, shape=2 * len(self.schedules.schedules))
            self.state.time = w.array("time", "schedules", wp.float64, shape=1)
            self.advance = w.array("advance", "schedules", wp.float64, np.array([0.0, s.solver.duration]))
        self.reference = None
        if s.contact is not None:
            self.reference = w.array("reference", "RigidBall", t.vec2, s.sheet.points)
            self.state.impulse = w.array("impulse", "RigidBall", t.vec3, shape=n)
        if s.sheet.inclusions:
            self._allocate_bodies(mass)

    def _initial(self, name: str) -> np.ndarray:
        values = getattr(self.simulation, name)
        n = self.simulation.sheet.size
        if values is None:
            return np.zeros((n, 3))
        values = numbers(name, values)
        if values.shape != (n, 3):
            raise InputError(f"{name} has shape {values.shape}: allowed is ({n}, 3)")
        return values

    def _constant_loads(self) -> np.ndarray:
        """Sum of the loads that never change [N], shape (N, 3)."""
        total = np.zeros((self.simulation.sheet.size, 3))
        for load in self.simulation.loads:
            if isinstance(load, Fixed | Motion | BoundaryForce) or id(load) in self._schedule_ids:
                continue
            if isinstance(load, Pressure) and load.follower:
                continue
            points, force = load.dead_forces(self.simulation.sheet)
            total[points] += force
        return total

    def _allocate_bodies(self, mass: np.ndarray) -> None:
        s, w = self.simulation, self.workspace
        groups = s.sheet.inclusions
        arms, masses, inertia = [], [], []
        for members in groups:
            m, X = mass[members], np.column_stack([s.sheet.points[members], np.zeros(len(members))])
            arm = X - m @ X / m.sum()
            arms.append(arm)
            masses.append(m.sum())
            inertia.append(np.linalg.inv(((arm**2).sum(axis=1) * m).sum() * np.eye(3) - (arm.T * m) @ arm))
        owner, b = "rigid inclusions", len(groups)
        begins = np.concatenate([[0], np.cumsum([len(g) for g in groups])])
        self._bodies = {
            "begins": w.array("body_begins", owner, wp.int32, begins),
            "members": w.array("body_members", owner, wp.int32, np.concatenate(groups)),
            "arms": w.array("body_arms", owner, wp.vec3d, np.vstack(arms)),
            "masses": w.array("body_masses", owner, wp.float64, np.array(masses)),
            "inverse_inertia": w.array("body_inverse_inertia", owner, wp.mat33d, np.array(inertia)),
        }
        self.state.bodies = (
            w.array("body_place", owner, wp.vec3d, shape=b),
            w.array("body_linear", owner, wp.vec3d, shape=b),
            w.array("body_angular", owner, wp.vec3d, shape=b),
            w.array("body_rotation", owner, wp.mat33d, np.repeat(np.eye(3)[None], b, axis=0)),
        )

    # Launches ------------------------------------------------------------------------------------------

    def _add_step(self) -> None:
        s, w, state = self.simulation, self.workspace, self.state
        n = s.sheet.size
        if self._motions:
            self._add_prescribe()
        if s.sheet.inclusions:
            self._add_move_bodies()
        motion = {
            "mass": self.inertia, "held_mask": self.held_mask, "step": self.step, "damping": self.damping,
            "force": state.force, "external": state.external, "displacement": state.displacement,
            "velocity": state.velocity, "work": state.work,
        }  # fmt: skip
        w.point("step", "solver", self.integration.drift, n, **motion, dissipated=state.dissipated)
        ball = {} if s.contact is None else {**motion, **self._ball(s.contact)}
        if s.contact is not None:
            w.point("step", "RigidBall", self._project, n, **{**ball, "schedule": self._soon(s.contact)})
        if self.schedules.schedules:
            # Between what moves and what is loaded: so the end of a step and the beginning of the next share a launch.
            self._add_tick("step", 1)
            self._add_tick("clock", 0)
        if s.damage is not None:
            self._add_break("step" if s.solver.in_time else "rupture", s.damage)
        self.force.add_update("step", state.displacement, self.step)
        self.force.add_force("step", state.displacement, state.force)
        if isinstance(s.damage, CriticalEnergy):
            self._add_release()
        self.add_loads("step")
        s.solver.add_before_kick(self)
        w.point("step", "solver", self.integration.kick, n, **motion, dissipated=state.dissipated)
        if s.sheet.inclusions:
            self._add_kick_bodies()
        if s.contact is not None:
            w.point("step", "RigidBall", self._separate, n, **ball)
        w.close("step")

    def _add_clock(self) -> None:
        from .kernels.integrate import clock

        self._tick, self._prescribe = clock(self.types.bits, self.workspace.module)

    def _add_tick(self, stage: str, steps: int) -> None:
        self.workspace.launch(
            stage, "schedules", self._tick, 1,
            advance=self.advance, begins=self._begins, knots=self._knots, values=self._values, steps=steps,
            time=self.state.time, scheduled=self.scheduled,
        ).beside = True  # fmt: skip

    def _add_prescribe(self) -> None:
        w = self.workspace
        if self.simulation.solver.in_time:
            self._check_begin()
        # One row a point, as edges that move in different directions share their corners.
        points = np.unique(np.concatenate([indices for _, indices in self._motions]))
        schedules = np.full((len(points), 3), -1, np.int32)
        for motion, indices in self._motions:
            moved = [c for c in range(3) if motion.mask() & (1 << c)]
            schedules[np.searchsorted(points, indices)[:, None], moved] = self._soon(motion)
        rows = np.full(self.simulation.sheet.size, -1, np.int32)
        rows[points] = np.arange(len(points))
        w.point(
            "step", "Motion", self._prescribe, len(rows),
            rows=w.array("moved_rows", "Motion", wp.int32, rows),
            schedules=w.array("moved_schedules", "Motion", wp.vec3i, schedules),
            scheduled=self.scheduled, step=self.step, displacement=self.state.displacement,
            velocity=self.state.velocity,
        )  # fmt: skip

    def _check_begin(self) -> None:
        """Look where motions begin.

        Raises:
            InputError: if that is further than a horizon from where their points are: no step can take them there.
        """
        there, horizon = self._initial("initial_displacement"), self.force.families.horizon
        for motion, points in self._motions:
            begin = self.schedules.schedules[self._schedule_ids[id(motion)]].at(0.0)
            for c in (c for c in range(3) if motion.mask() & (1 << c)):
                jump = float(np.abs(begin[c] - there[points, c]).max())
                if jump > horizon:
                    raise InputError(
                        f"Motion.{'xyz'[c]} is {begin[c]:.6g} m at t = 0, {jump:.3g} m from where its points are: "
                        f"allowed is at most the horizon, {horizon:.3g} m"
                    )

    def _soon(self, part: Any) -> int:
        """Index of what the schedule of a part gives a step later."""
        return len(self.schedules.schedules) + self._schedule_ids[id(part)]

    def _add_move_bodies(self) -> None:
        from .kernels.rigid import rigid_inclusions

        state = self.state
        self._move_bodies, self._kick_bodies = rigid_inclusions(
            self.types.bits, self.has_loads, self.damped, self.workspace.module
        )
        place, linear, angular, rotation = state.bodies
        self.workspace.launch(
            "step", "rigid inclusions", self._move_bodies, len(self.simulation.sheet.inclusions),
            **self._bodies, step=self.step, damping=self.damping, force=state.force,
            external=state.external, displacement=state.displacement, place=place, linear=linear,
            angular=angular, rotation=rotation, velocity=state.velocity,
        )  # fmt: skip

    def _add_kick_bodies(self) -> None:
        state = self.state
        _, linear, angular, rotation = state.bodies
        self.workspace.launch(
            "step", "rigid inclusions", self._kick_bodies, len(self.simulation.sheet.inclusions),
            **self._bodies, step=self.step, damping=self.damping, force=state.force, external=state.external,
            rotation=rotation, linear=linear, angular=angular, velocity=state.velocity,
        )  # fmt: skip

    def _ball(self, ball: RigidBall) -> dict[str, Any]:
        """What contact needs besides the motion; declares its point functions."""
        from .kernels.contact import ball_contact

        self._project, self._separate = ball_contact(
            self.types.bits, self.has_held, self.has_loads, self.damped, self.tracked, self.workspace.module
        )
        return {
            "reference": self.reference, "centre": self.scheduled, "schedule": self._schedule_ids[id(ball)],
            "ball_velocity": self.types.vec3(*ball.velocity), "radius": 0.5 * ball.diameter,
            "impulse": self.state.impulse,
        }  # fmt: skip

    def _add_break(self, stage: str, damage: Rupture) -> None:
        """Add the launch that breaks bonds."""
        from .kernels.damage import breaking, point_damage

        force, spared, owner = self.force, None, type(damage).__name__
        tracked = self.tracked and force.has_energy
        if damage.spared is not None:
            mask = np.zeros(self.simulation.sheet.size, np.uint8)
            mask[point_indices(f"{owner}.spared", damage.spared, len(mask))] = 1
            spared = self.workspace.array("spared", owner, wp.uint8, mask)
        by_energy = isinstance(damage, CriticalEnergy)
        kernel = breaking(
            force.families.layout, self.types.bits, by_energy, tracked, spared is not None,
            force.kernels.earlier_energy if tracked else None, self.workspace.module,
        )  # fmt: skip
        if isinstance(damage, CriticalEnergy):
            self.state.energy_release = self._energy_release()
            critical = damage.energy / crossing_bonds(self.simulation.force.horizon)
        else:
            critical = damage.stretch**2
        self._damage = point_damage(force.families.layout, self.types.bits, self.workspace.module)
        self.workspace.launch(
            stage, owner, kernel, self.simulation.sheet.size,
            family=force.struct, displacement=self.state.displacement, velocity=self.state.velocity,
            step=self.step, energy_release=self.state.energy_release, horizon=force.families.horizon,
            critical=critical, spared_mask=spared, constants=force.constants,
            inverse_horizon=force.inverse_horizon, unit_volume=force.unit_volume, alive=force.alive,
            released=self.state.released,
        )  # fmt: skip

    def _energy_release(self) -> Any:
        """Array of the energy release rate of every bond.

        Raises:
            InputError: for a law whose pairs of points do not stay apart, or a solver without time.
        """
        force = self.force
        if not self.simulation.solver.in_time:
            raise InputError("damage = CriticalEnergy: allowed with the solver Explicit alone")
        law = self.simulation.force
        plain = isinstance(law, BondAssociated) and not law.fast and law.weights != "published"
        if not plain and not isinstance(law, Visco | ViscoBondBased):
            raise InputError(
                f"damage = CriticalEnergy with {type(law).__name__}: allowed are Visco, "
                f"ViscoBondBased, and BondAssociated with fast = False and weights that conserve energy"
            )
        shape = (force.families.members, self.simulation.sheet.size)
        return self.workspace.array("energy_release", "CriticalEnergy", self.types.real, shape=shape)

    def _add_release(self) -> None:
        """Add the launch that sums up the work of every bond."""
        from .kernels.critical_energy import energy_release

        force, sheet = self.force, self.simulation.sheet
        kernel = energy_release(force.families.layout, self.types.bits, self.workspace.module)
        self.workspace.launch(
            "step", "CriticalEnergy", kernel, sheet.size,
            family=force.struct, alive=force.alive, velocity=self.state.velocity, step=self.step,
            bond_force=force.bond_force, inverse_surface=1.0 / (sheet.thickness * sheet.spacing),
            energy_release=self.state.energy_release,
        )  # fmt: skip

    def add_loads(self, stage: str) -> None:
        """Add the launches that renew the external force; none if it never changes."""
        from .kernels.loads import constant_loads, dead_load

        s, w, bits, module = self.simulation, self.workspace, self.types.bits, self.workspace.module
        follower = [p for p in s.loads if isinstance(p, Pressure) and p.follower]
        ramped = [
            p for p in s.loads
            if isinstance(p, Pressure | BodyForce | PointForce) and p not in follower and id(p) in self._schedule_ids
        ]  # fmt: skip
        boundary = [p for p in s.loads if isinstance(p, BoundaryForce)]
        if len(boundary) > 1:
            raise InputError(f"loads holds {len(boundary)} of BoundaryForce: allowed is one, with all its points")
        if not follower and not ramped and not boundary:
            return
        constant = self._constant_loads()
        if not hasattr(self, "_constant"):
            present = bool(constant.any())
            self._constant = w.array("constant_loads", "loads", self.types.vec3, constant) if present else None
            self._ramped_arrays = {}
            for load in ramped:
                points, force = load.dead_forces(s.sheet)
                self._ramped_arrays[id(load)] = (
                    w.array("loaded_points", type(load).__name__, wp.int32, points),
                    w.array("loaded_force", type(load).__name__, self.types.vec3, force),
                )
        begin = constant_loads(bits, self._constant is not None, module)
        w.point(stage, "loads", begin, s.sheet.size, constant=self._constant, external=self.state.external)
        for load in ramped:
            points, force = self._ramped_arrays[id(load)]
            w.launch(
                stage, type(load).__name__, dead_load(bits, module), len(points),
                points=points, force=force, factors=self.scheduled, schedule=self._schedule_ids[id(load)],
                external=self.state.external,
            )  # fmt: skip
        for load in follower:
            self._add_follower(stage, load)
        for law in boundary:
            self.add_boundary_force(stage, law, self.state.displacement, self.state.external)

    def _add_follower(self, stage: str, load: Pressure) -> None:
        from .kernels.loads import follower_pressure

        force, scheduled = self.force, id(load) in self._schedule_ids
        kernel = follower_pressure(
            force.families.layout, self.types.bits, self.breakable, scheduled, self.workspace.module
        )
        self.workspace.point(
            stage, "Pressure", kernel, self.simulation.sheet.size,
            family=force.struct, alive=force.alive, displacement=self.state.displacement,
            inverse_horizon=force.inverse_horizon, unit_pressure=load.value * force.families.reference_area,
            factors=self.scheduled, schedule=self._schedule_ids.get(id(load), 0), external=self.state.external,
        )  # fmt: skip

    def add_boundary_force(self, stage: str, load: BoundaryForce, displacement: Any, out: Any) -> None:
        """Add the launches that add the boundary force at a displacement [m] to `out` [N], both (N,) vec3."""
        from .kernels.boundary_force import boundary_force

        w, force, n = self.workspace, self.force, self.simulation.sheet.size
        if not hasattr(self, "_edges"):
            self._edges = self._edge_arrays(load)
        normals, points, reach, mask = self._edges
        find, push = boundary_force(force.families.layout, self.types.bits, self.breakable, load.form, w.module)
        w.launch(
            stage, "BoundaryForce", find, n if self.breakable else points.size,
            family=force.struct, alive=force.alive, displacement=displacement, points=points, marked=mask,
            inverse_horizon=force.inverse_horizon, normals=normals,
        )  # fmt: skip
        w.launch(
            stage, "BoundaryForce", push, n if self.breakable else reach.size,
            family=force.struct, alive=force.alive, displacement=displacement, normals=normals, points=reach,
            horizon=force.families.horizon, unit_force=load.value * force.unit_volume**2, external=out,
        )  # fmt: skip

    def _edge_arrays(self, load: BoundaryForce) -> tuple[Any, ...]:
        """Normals, the points that carry the force, those and their neighbours, mask; None where not needed."""
        from .off_plane import family_members

        w, n, families, owner = self.workspace, self.simulation.sheet.size, self.force.families, "BoundaryForce"
        carriers = load.carriers(self.simulation.sheet, families.horizon)
        normals = w.array("edge_normals", owner, self.types.vec3, shape=n)
        if self.breakable:
            mask = np.zeros(n, np.uint8)
            mask[carriers] = 1
            return normals, None, None, w.array("edge_mask", owner, wp.uint8, mask)
        reach = np.unique(np.append(family_members(families, carriers), carriers))
        return (
            normals,
            w.array("edge_points", owner, wp.int32, carriers),
            w.array("edge_reach", owner, wp.int32, reach[reach >= 0]),
            None,
        )

    def _add_setup(self) -> None:
        """What makes the state of the law fit the initial displacement, and the forces the displacement.

        The latter before the first step, or after a restart.
        """
        if self.simulation.initial_displacement is not None:
            self.force.add_start("start", self.state.displacement)
        if self.schedules.schedules:
            self._add_tick("setup", 0)
        self.force.add_force("setup", self.state.displacement, self.state.force)
        self.add_loads("setup")

    def _add_frame(self) -> None:
        from .kernels.checks import BLOCK, frame_checks

        w, n, state = self.workspace, self.simulation.sheet.size, self.state
        self.strain_energy = w.array("strain_energy", "frames", wp.float64, shape=n) if self.force.has_energy else None
        self.kinetic_energy = w.array("kinetic_energy", "frames", wp.float64, shape=n)
        if self.strain_energy is not None:
            self.force.add_energy("frame", state.displacement, self.strain_energy)
        if isinstance(self.force, NeuralForce):
            self.force.add_count("frame", state.displacement)
        self.fields = self._add_fields()
        w.launch(
            "frame", "frames", self.integration.kinetic_energy, n,
            mass=self.mass, held_mask=self.held_mask, velocity=state.velocity, out=self.kinetic_energy,
        )  # fmt: skip
        checks, blocks = frame_checks(self.types.bits, w.module), -(-n // BLOCK)
        self.not_finite = w.array("not_finite", "frames", wp.int32, shape=blocks)
        self.fastest = w.array("fastest", "frames", wp.float64, shape=blocks)
        w.launch(
            "frame", "frames", checks.watch_motion, blocks,
            displacement=state.displacement, velocity=state.velocity, not_finite=self.not_finite, fastest=self.fastest,
        )  # fmt: skip
        self._add_sums(checks, blocks)
        self.damage = self.intact = None
        if self.breakable:
            self._add_damage()

    def _add_sums(self, checks: Any, blocks: int) -> None:
        """Add the launches that sum up what the history holds."""
        w, state = self.workspace, self.state
        summed = {
            "kinetic": self.kinetic_energy,
            "strain": self.strain_energy,
            "external": state.work,
            "damping": state.dissipated,
            "rupture": state.released,
            "viscous": getattr(self.force, "viscous", None),
        }
        summed = {name: array for name, array in summed.items() if array is not None}
        vectors = [] if state.impulse is None else ["impulse_x", "impulse_y", "impulse_z"]
        self._summed = [*summed, *vectors]
        self._sums = w.array("sums_of_blocks", "frames", wp.float64, shape=(len(self._summed), blocks))
        for row, values in enumerate(summed.values()):
            w.launch("frame", "frames", checks.sum_blocks, blocks, values=values, row=row, sums=self._sums)
        if vectors:
            w.launch(
                "frame", "frames", checks.sum_vectors, blocks, values=state.impulse, row=len(summed), sums=self._sums
            )

    def _add_damage(self) -> None:
        """Add the launches that find the damage of the points and the triangles that are whole."""
        from .kernels.damage import face_damage

        w, sheet, owner = self.workspace, self.simulation.sheet, type(self.simulation.damage).__name__
        self.damage = w.array("damage", "frames", wp.float32, shape=sheet.size)
        self.intact = w.array("intact_faces", "frames", wp.uint8, shape=len(sheet.triangles))
        family = {"family": self.force.struct, "alive": self.force.alive}
        w.launch("frame", owner, self._damage, sheet.size, **family, out=self.damage)
        w.launch(
            "frame", owner, face_damage(self.force.families.layout, self.types.bits, w.module), len(sheet.triangles),
            **family, triangles=w.array("triangles", "frames", wp.vec3i, sheet.triangles), intact=self.intact,
        )  # fmt: skip

    def _add_fields(self) -> dict[str, Any]:
        """Further fields of the frames, by name: arrays on the device."""
        names, force = self.simulation.fields, self.force
        if not names:
            return {}
        if not isinstance(force, BondBasedForce):
            raise InputError(f"fields = {list(names)!r}: allowed is none with the law BondAssociated")
        return force.add_fields("frame", self.state.displacement, names)

    def set_clock(self, advance: float, end: float, now: float | None = None) -> None:
        """Let time advance by so much a step [s] until `end`, from `now` or where it is; nothing without schedules."""
        if self.advance is None:
            return
        self.advance.assign(np.array([advance, end]))
        if now is not None:
            self.state.time.assign(np.array([now]))
        self.clock.run()

    @functools.cached_property
    def clock(self) -> LaunchSequence:
        """Launches that evaluate every schedule anew, where the host moved the time or its advance."""
        return self.workspace.sequence("clock")

    # For the host --------------------------------------------------------------------------------------

    def surface(self) -> Surface:
        """The reference surface, as writers need it."""
        s = self.simulation
        points = np.column_stack([s.sheet.points, np.zeros(s.sheet.size)])
        at_rest = {} if self.load_duration is None else {"load_duration": self.load_duration}
        return Surface(
            points=points,
            faces=s.sheet.triangles,
            ball_diameter=s.contact.diameter if s.contact else None,
            title=s.scene,
            metadata={"scene": s.scene, "section": s.section, "units": "SI", **at_rest},
        )

    @functools.cached_property
    def volume(self) -> np.ndarray:
        """Volume of each point [m^3], shape (N,)."""
        return self.simulation.sheet.areas * self.simulation.sheet.thickness

    def totals(self) -> dict[str, float]:
        """Sums over all points as of the last frame, of those there are: energies [J] and the ball's impulse [N s].

        Keys: kinetic, strain, external, damping, rupture, viscous, impulse_x, impulse_y, impulse_z.
        """
        return dict(zip(self._summed, self._sums.numpy().sum(axis=1).tolist(), strict=True))

    def to_host(self, array: Any) -> np.ndarray:
        """A copy on the host, in the precision of the device."""
        # Of an array on a GPU, numpy() is a copy already.
        return array.numpy().copy() if array.device.is_cpu else array.numpy()

    def to_numpy(self, array: Any) -> np.ndarray:
        """A copy on the host, as float64 if it holds real numbers."""
        values = self.to_host(array)
        return values.astype(np.float64, copy=False) if values.dtype.kind == "f" else values


def _refuse_clash(name: str, sheet: Sheet, point: int, clash: int) -> None:
    """Say which point two parts would move or hold.

    Raises:
        InputError: always.
    """
    x, y = sheet.points[point]
    other = "a rigid inclusion" if clash & RIGID else "another support or motion"
    what = "" if clash & RIGID else f" its component {next(c for k, c in enumerate('xyz') if clash & 1 << k)} of"
    raise InputError(
        f"{name}.points holds point {point} at ({x:.4g}, {y:.4g}) m, where {other} has{what} it already: "
        f"allowed is one; leave shared points, such as corners, out with numpy.setdiff1d"
    )


def _constraints(simulation: Simulation) -> tuple[np.ndarray, list[tuple[Motion, np.ndarray]]]:
    """Bits of held components of every point, and the motions with their checked points.

    Raises:
        InputError: if two parts hold the same component of a point.
    """
    sheet = simulation.sheet
    held = np.zeros(sheet.size, np.uint8)
    motions = []
    for members in sheet.inclusions:
        if held[members].any():
            raise InputError("two rigid inclusions share a point: allowed are inclusions apart from each other")
        held[members] |= RIGID
    moved = held.copy()
    for load in simulation.loads:
        if not isinstance(load, Fixed | Motion):
            continue
        name = type(load).__name__
        points = point_indices(f"{name}.points", load.points, sheet.size)
        # Supports may share points; what moves must be alone.
        others = held if isinstance(load, Motion) else moved
        clash = others[points] & (load.mask() | RIGID)
        if clash.any():
            _refuse_clash(name, sheet, int(points[np.flatnonzero(clash)[0]]), int(clash[clash > 0][0]))
        held[points] |= load.mask()
        if isinstance(load, Motion):
            moved[points] |= load.mask()
            motions.append((load, points))
    return held, motions
