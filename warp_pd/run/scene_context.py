"""The context of a scene: the arrays shared by its parts, and the partition of each process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ..communicator import Communicator
from ..context import BLOCK, SMALL, SMALL_BLOCK, Context, State
from ..device.clock import Clock
from ..device.fields import FieldRegister
from ..families.partition import Partition
from ..interfaces import Constraint, Part
from ..kernels.families import Layout
from ..kernels.integrate import StepOptions
from ..kernels.numeric import numeric
from ..parts.frame_checks import EnergyBalance
from ..parts.supports import held_components
from . import COMMUNICATORS
from .scene import Scene

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


def shared_state(scene: Scene, context: Context, constant: np.ndarray | None, energy: EnergyBalance) -> State:
    """Create the arrays that all parts share; `constant` is the sum of the constant loads [N], (N, 3), or None."""
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
        force=context.array("force", OWNER, vec3, shape=n),
        mass=context.array("mass", OWNER, real, mass),
        external=context.array("external", "loads", vec3, constant, shape=n) if options.loaded else None,
        held_mask=context.array("held", "supports", wp.uint8, context.held) if options.held else None,
        step=context.array("step", "solver", real, shape=1, per="once") if stepping else None,
        damping=None if solver.mass_damping is None else context.array(
            "damping", "solver", real, np.array([solver.mass_damping]), per="once", restart=True
        ),
        work=energy.work,
        dissipated=energy.dissipated,
    )  # fmt: skip
