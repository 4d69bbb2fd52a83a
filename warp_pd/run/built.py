"""Builds a simulation: context, law, parts and solver of a scene on a device, and their launches by phase."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from ..communicator import Communicator
from ..context import BLOCK, SMALL, SMALL_BLOCK, Context, State, find_device, with_material
from ..device.checks import InputError, one_of
from ..device.clock import Clock
from ..device.fields import Array, FieldRegister, in_double
from ..families.partition import Partition
from ..interfaces import BuiltContact, BuiltSolver, Columns, Constraint, Part, System
from ..interfaces.solver import ExternalForce
from ..kernels.families import Layout
from ..kernels.integrate import StepOptions
from ..kernels.numeric import numeric
from ..parts.frame_checks import EnergyBalance, FrameChecks, Sums, Ticking, begin_loading_common
from ..parts.supports import MovedPoints, held_components
from ..step import Phase, begin
from . import COMMUNICATORS, PARTS
from .scene import Outcome, Scene

OWNER = "Simulation"


def scene_context(
    scene: Scene,
    parts: list[Part],
    constraints: Sequence[Constraint],
    device: wp.Device,
    bits: int,
    communicator: Communicator,
) -> Context:
    """Context in which the parts of a scene are built; with several processes, for the partition of this one."""
    sheet, solver = scene.sheet, scene.solver
    held = held_components(sheet, constraints)
    start, placement = scene.initial("initial_displacement"), sheet.placement()
    options = StepOptions(
        bits=bits,
        held=bool(held.any()),
        loaded=any(is_load(part, scene) for part in parts),
        damped=solver.mass_damping is not None,
        tracked=scene.track_energy and solver.dynamic,
    )
    stress_free = sheet.unstretched()
    layout = Layout(
        stress_free.layout, bits, curved=sheet.frames is not None, breakable=scene.damage is not None,
        softened=scene.damage is not None and scene.damage.is_field,
    )  # fmt: skip
    initial = start if placement is None else start + placement
    made = Context(
        sheet=stress_free, device=device, types=numeric(bits), options=options, layout=layout,
        dynamic=solver.dynamic, at_rest=acts_at_rest(scene), held=held,
        initial_displacement=initial, fields=FieldRegister(device),
        clock=Clock(solver.duration, solver.default_ramp), given=sheet, placement=placement, communicator=communicator,
        block_dim=SMALL_BLOCK if sheet.size < SMALL else BLOCK,
    )  # fmt: skip
    return made if communicator.partition is None else _context_here(made, communicator.partition)


def held_by_loads(scene: Scene) -> np.ndarray:
    """Bits of the components that the loads of a scene hold or move, of every point, uint8, shape (N,)."""
    return held_components(scene.sheet, [c for load in scene.loads for c in load.constraints(scene.sheet)])


def is_load(part: Part, scene: Scene) -> bool:
    """Whether a part adds to the external force in a scene."""
    return part.adds_force or (part.loads_at_rest and acts_at_rest(scene))


def acts_at_rest(scene: Scene) -> bool:
    """Whether contact and rupture act in equilibrium in a scene."""
    return not (scene.solver.dynamic and scene.solver.steps_explicitly)


def communicator_here(device: str | None) -> tuple[Communicator, str | None]:
    """The communicator of this process, and its device; "cuda" and None mean one GPU per process."""
    found = next((found for join in COMMUNICATORS if (found := join(device)) is not None), None)
    return (Communicator(), device) if found is None else found


def partition_of(scene: Scene, communicator: Communicator) -> Partition:
    """The part of the sheet that one of several processes owns."""
    scene.check()
    layers = 0 if scene.damage is None else scene.damage.layers
    return communicator.partition_sheet(scene.sheet.unstretched(), scene.force.horizon, layers)


def _context_here(whole: Context, partition: Partition) -> Context:
    """The context of one of several processes."""
    whole.communicator.register_fields(whole.fields.stored)
    placement = whole.placement
    return replace(
        whole, sheet=whole.communicator.sheet_here(whole.sheet, partition), undivided=whole.sheet, partition=partition,
        held=partition.rows(whole.held), initial_displacement=partition.rows(whole.initial_displacement),
        placement=None if placement is None else partition.rows(placement),
    )  # fmt: skip


def parts_here(parts: Sequence[Part], context: Context) -> list[Part]:
    """The parts, restricted to the points of this process."""
    partition = context.partition
    return list(parts) if partition is None else [part.on_partition(context.whole, partition) for part in parts]


def constraints_here(constraints: Sequence[Constraint], context: Context) -> tuple[Constraint, ...]:
    """The constraints, restricted to the points of this process."""
    partition = context.partition
    if partition is None:
        return tuple(constraints)
    return tuple(replace(constraint, points=partition.here(constraint.points)[1]) for constraint in constraints)


def shared_state(scene: Scene, context: Context, external: ExternalForce, energy: EnergyBalance) -> State:
    """Create the arrays that all parts share; `external` is the sum of all loads."""
    sheet, types, options, solver = context.sheet, context.types, context.options, scene.solver
    n, real, vec3 = sheet.size, types.real, types.vec3
    mass = sheet.areas * sheet.thickness * sheet.density
    stepping = solver.dynamic or solver.steps_explicitly
    u: np.ndarray | None = context.initial_displacement
    v = None if scene.initial_velocity is None else context.here(scene.initial("initial_velocity"))
    if scene.initial_displacement is None and context.placement is None:
        u = None
    return State(
        displacement=context.array(
            "displacement", OWNER, vec3, u, shape=n, restart=True, halo=True, output="displacement"
        ),
        velocity=context.array("velocity", OWNER, vec3, v, shape=n, restart=True, halo=True, output="velocity"),
        force=context.array("force", OWNER, vec3, shape=n, restart=solver.steps_explicitly),
        mass=context.array("mass", OWNER, real, mass),
        external=context.array(
            "external", "loads", vec3, external.constant, shape=n,
            restart=solver.steps_explicitly and bool(external.changing),
        ) if options.loaded else None,
        held_mask=context.array("held", "supports", wp.uint8, context.held) if options.held else None,
        step=context.array("step", "solver", real, shape=1, per="once") if stepping else None,
        damping=None if solver.mass_damping is None else context.array(
            "damping", "solver", real, np.array([solver.mass_damping]), per="once", restart=True
        ),
        work=energy.work,
        dissipated=energy.dissipated,
    )  # fmt: skip


@dataclass(eq=False, repr=False)
class Built(System):
    """A simulation on a device.

    Attributes:
        simulation: The scene that was built.
        solver: The solver on the device.
        checks: Checks made at every frame.
        energy: Energies, work and losses of the history.
        sums: Sums of the history.
        columns: What the energy balance and then each of the parts add to the history.
        contacts: Contacts on the device; `contact` is the first one, or None.
    """

    simulation: Scene
    solver: BuiltSolver
    checks: FrameChecks
    energy: EnergyBalance
    sums: Sums
    columns: tuple[Columns, ...]
    contact: BuiltContact | None
    contacts: tuple[BuiltContact, ...] = ()

    def __repr__(self) -> str:
        """Its size and device; `warp-pd plan` lists arrays and launches."""
        context, size = self.context, self.context.fields.nbytes
        return f"Built({context.sheet.size} points, float{context.bits}, on {context.device}, {size} bytes)"

    @property
    def state(self) -> State:
        """Shared arrays: displacement, velocity, force, ..."""
        return self.context.state

    @functools.cached_property
    def volume(self) -> np.ndarray:
        """Volume of each point [m^3], shape (N,)."""
        return self.context.whole.areas * self.context.whole.thickness

    def to_host(self, array: Array) -> np.ndarray:
        """A copy of a field on the host, in the precision of the device."""
        return self.context.whole_array(array)

    def to_numpy(self, array: Array) -> np.ndarray:
        """A copy on the host, as float64 if it holds real numbers."""
        return in_double(self.context.whole_array(array))


def compose(
    scene: Scene,
    device: str | None = None,
    precision: int | None = None,
    communicator: Communicator | None = None,
    runs: bool = False,
) -> Built:
    """Allocate the arrays and declare the kernels and launches of a scene, without compiling them.

    Args:
        scene: What to build.
        device: "cpu", "cuda", "cuda:0", ...; by default CUDA if available.
        precision: 32 or 64; by default the solver's.
        communicator: The processes that share the sheet; None for a single process.
        runs: Whether a run follows. Kernels that every run has are then compiled meanwhile.
    """
    scene.check()
    parts = parts_of(scene)
    bits = one_of("precision", precision or scene.solver.precision, (32, 64))
    constraints = tuple(c for part in parts for c in part.constraints(scene.sheet))
    context = scene_context(scene, parts, constraints, find_device(device), bits, communicator or Communicator())
    if runs:
        begin_loading_common(context)
    constraints = constraints_here(constraints, context)
    force = scene.force if scene.damage is None else scene.damage.law(scene.force, context)
    context.layout = with_material(context.layout, force.material)
    law, here = force.build(context), parts_here(parts, context)
    for part in here:
        law = part.around(law, context)
    built = [part.build(context, law) for part in here]
    of_part: dict[int, Any] = {id(part): on_device for part, on_device in zip(parts, built, strict=True)}
    if fields := scene.fields_besides(stored.field.output for stored in context.fields.shown()):
        law.request_fields(fields)
    external = ExternalForce(context, [of_part[id(part)] for part in parts if is_load(part, scene)])
    moved = MovedPoints(context, constraints)
    if not law.resists_bending:
        moved.refuse_held_slopes()
    if scene.solver.dynamic:
        moved.check_begin(law.families.horizon)
    does_work = context.options.held or context.options.loaded or any(part.does_work for part in parts)
    energy = EnergyBalance(context, law, does_work, any(part.unbalanced for part in parts))
    context.state = shared_state(scene, context, external, energy)
    solver = scene.solver.build(context, law)
    context.clock.allocate(context.fields, context.types)
    contacts: tuple[BuiltContact, ...] = tuple(of_part[id(part)] for part in scene.contacts)
    beside = [check for contact in contacts for check in contact.checks(contacts)]
    checks = FrameChecks(context, solver.has_inertia)
    acting = (law, solver, moved, Ticking(context), *built, external, *beside, checks)
    columns = energy.count(acting)
    made = Built(
        context, law, external, acting, constraints, of_part.get(id(scene.damage)),
        scene, solver, checks, energy, Sums(context, (*columns[1:], columns[0])), columns,
        contacts[0] if contacts else None, contacts,
    )  # fmt: skip
    _check_columns(scene, made)
    _require_divisible(made)
    _add_stages(made)
    context.communicator.add_exchanges(list(context.stages.values()), context.fields)
    return made


def parts_of(scene: Scene) -> list[Part]:
    """All parts of a scene in the order in which they act: those of its sheet, supports and loads, contact, rupture."""
    unnamed = [part for of in PARTS for part in of(scene)]
    parts = [part for part in (*unnamed, *scene.loads, *scene.contacts, scene.damage) if part is not None]
    for index, part in enumerate(parts):
        part.check([*parts[:index], *parts[index + 1 :]])
    return parts


def _require_divisible(built: Built) -> None:
    """Check that the solver supports several processes if the run has several. Raises InputError if it does not."""
    if built.context.partition is not None and not built.solver.divides:
        raise InputError(f"{built.solver.label}: not supported on several processes; expected Explicit or Relaxation")


def _check_columns(scene: Scene, built: Built) -> None:
    """Check that no measure has the name of another column of the history. Raises InputError for the first of them."""
    taken = {"time", "step", *(name for columns in built.columns for name in columns.names)}
    for name in [*(m.name for m in scene.measures), *(o.name for o in scene.outcomes)]:
        if name in taken:
            raise InputError(f"measures: {name!r} is already a column of the history: expected another name")
    measured = [m.name for m in scene.measures]
    for outcome in scene.outcomes:
        _check_outcome(outcome, [*sorted(taken), *([] if outcome.fine and scene.has_fine_history else measured)])


class _TrialRow(dict[str, float]):
    """A row of the history whose numbers mean nothing; a column that no row has raises InputError."""

    def __missing__(self, name: object) -> float:
        one_of("column", name, self)
        raise KeyError(name)


def _check_outcome(outcome: Outcome, columns: Sequence[str]) -> None:
    """Check that an outcome reads columns that the history will have.

    Raises:
        InputError: if it does not, with the columns that it may have meant.
    """
    rows = [_TrialRow(dict.fromkeys(columns, float(k))) for k in range(3)]
    try:
        outcome.value(rows)
    except InputError as error:
        if str(error).startswith("column = "):
            raise InputError(f"Outcome {outcome.name!r}: {error}") from None
    except Exception:
        # The numbers of the trial mean nothing: only what the history lacks is known before the run.
        pass


def _add_stages(built: Built) -> None:
    """Compose the stages common to all solvers and those of this solver."""
    context = built.context
    built.add(Phase.START, context.stage("start", "once at the start"))
    begin(built, context.stage("setup", "once at the start or a restart"))
    built.add(Phase.SCHEDULES, context.stage("clock", "whenever the host sets the time or the step"))
    built.solver.prepare(built)
    frame = context.stage("frame", "every frame")
    built.add(Phase.FRAME, frame)
    built.sums.add(frame)
