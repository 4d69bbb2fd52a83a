"""Builds a simulation: law, parts and solver of a scene on a device, and their launches by phase."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import cast

import numpy as np
import warp as wp

from ._renamed import RenamedAttributes
from .checks import InputError, one_of
from .compile_key import module_name
from .device.clock import Clock
from .device.context import BLOCK, SMALL, SMALL_BLOCK, Context, Features, State, find_device
from .device.fields import Array, FieldRegister, to_float64, to_host
from .interfaces import BuiltContact, BuiltLoad, BuiltPart, BuiltRupture, BuiltSolver, Constraint, Part, System
from .kernels.numeric import numeric
from .parts.clock import Ticking
from .parts.frame_checks import EnergyBalance, FrameChecks, Sums
from .parts.loads import ExternalForce
from .parts.rigid_inclusions import RigidInclusions
from .parts.supports import MovedPoints, held_components
from .phases import SETUP, Phase
from .scene import Scene

OWNER = "Simulation"


@dataclass(eq=False)
class Built(RenamedAttributes, System):
    """A simulation on a device.

    Attributes:
        simulation: The scene that was built.
        solver: The solver on the device.
        checks: Checks of every frame.
        energy: Energies, work and losses of the history.
        sums: Sums of the history.
        contacts: Contacts on the device; `contact` is the first one, or None.
        rupture: The rupture criterion on the device, or None.
    """

    simulation: Scene
    solver: BuiltSolver
    checks: FrameChecks
    energy: EnergyBalance
    sums: Sums
    contact: BuiltContact | None
    rupture: BuiltRupture | None
    contacts: tuple[BuiltContact, ...] = ()

    @property
    def state(self) -> State:
        """Shared arrays: displacement, velocity, force, ..."""
        return self.context.state

    @functools.cached_property
    def volume(self) -> np.ndarray:
        """Volume of each point [m^3], shape (N,)."""
        return self.context.sheet.areas * self.context.sheet.thickness

    def to_host(self, array: Array) -> np.ndarray:
        """A copy on the host, in the precision of the device."""
        return to_host(array)

    def to_numpy(self, array: Array) -> np.ndarray:
        """A copy on the host, as float64 if it holds real numbers."""
        return to_float64(array)


def compose(scene: Scene, device: str | None = None, precision: int | None = None) -> Built:
    """Allocate arrays and declare kernels and launches of a scene; compiles nothing yet.

    Args:
        scene: What to build.
        device: "cpu", "cuda", "cuda:0", ...; by default CUDA if available.
        precision: 32 or 64; by default the solver's.

    Raises:
        InputError: for parts that do not fit together, or a device that does not exist.
    """
    scene.check()
    parts = parts_of(scene)
    bits = one_of("precision", precision or scene.solver.precision, (32, 64))
    constraints = tuple(c for part in parts for c in part.constraints(scene.sheet))
    context = _context(scene, parts, constraints, find_device(device), bits)
    law = scene.force.build(context)
    law.request_fields(scene.fields_of_law())
    built = [part.build(context, law) for part in parts]
    loads = [on_device for part, on_device in zip(parts, built, strict=True) if part.adds_force]
    external = ExternalForce(context, cast(list[BuiltLoad], loads))
    moved = MovedPoints(context, constraints)
    if scene.solver.dynamic:
        moved.check_begin(law.families.horizon)
    does_work = context.features.held or context.features.loaded or any(part.does_work for part in parts)
    energy = EnergyBalance(context, law, does_work)
    context.state = _state(scene, context, external, energy)
    solver = scene.solver.build(context, law)
    context.clock.allocate(context.fields, context.types, context.module)
    acting = (law, solver, moved, Ticking(context), *built, external, checks := FrameChecks(context))
    contacts = tuple(cast(BuiltContact, _built(part, parts, built)) for part in scene.contacts)
    made = Built(
        context, law, external, acting, constraints, scene, solver, checks, energy, Sums(context, (*acting, energy)),
        contacts[0] if contacts else None, cast(BuiltRupture | None, _built(scene.damage, parts, built)), contacts,
    )  # fmt: skip
    _check_columns(scene, made)
    _add_stages(made)
    return made


def _built(wanted: Part | None, parts: list[Part], built: list[BuiltPart]) -> BuiltPart | None:
    """The built counterpart of a part of the scene."""
    return next((on_device for part, on_device in zip(parts, built, strict=True) if part is wanted), None)


def parts_of(scene: Scene) -> list[Part]:
    """All parts in the order in which they act: rigid inclusions, supports and loads, contact, rupture.

    Raises:
        InputError: for parts that cannot be combined.
    """
    inclusions: list[Part] = [RigidInclusions(scene.sheet.inclusions)] if scene.sheet.inclusions else []
    parts = [part for part in (*inclusions, *scene.loads, *scene.contacts, scene.damage) if part is not None]
    for index, part in enumerate(parts):
        part.check([*parts[:index], *parts[index + 1 :]])
    return parts


def _context(
    scene: Scene, parts: list[Part], constraints: tuple[Constraint, ...], device: wp.Device, bits: int
) -> Context:
    sheet, solver = scene.sheet, scene.solver
    held = held_components(sheet, constraints)
    start, placement = scene.initial("initial_displacement"), sheet.placement()
    features = Features(
        held=bool(held.any()),
        loaded=any(part.adds_force for part in parts),
        damped=solver.mass_damping is not None,
        tracked=scene.track_energy and solver.dynamic,
        breakable=scene.damage is not None,
        gradual=scene.damage is not None and scene.damage.gradual and solver.dynamic and scene.force.softens,
        contact=any(part.changes_velocities for part in scene.contacts),
        half_steps=all(c.half_steps for c in scene.contacts),
    )
    return Context(
        sheet=sheet.unstretched(), device=device, types=numeric(bits), module=module_name(scene, parts, features, bits),
        features=features, held=held, initial_displacement=start if placement is None else start + placement,
        fields=FieldRegister(device), clock=Clock(solver.duration, solver.default_ramp),
        placement=placement, block_dim=SMALL_BLOCK if sheet.size < SMALL else BLOCK,
    )  # fmt: skip


def _state(scene: Scene, context: Context, external: ExternalForce, energy: EnergyBalance) -> State:
    sheet, types, features, solver = context.sheet, context.types, context.features, scene.solver
    n, real, vec3 = sheet.size, types.real, types.vec3
    mass = sheet.areas * sheet.thickness * sheet.density
    u, v = context.initial_displacement, scene.initial("initial_velocity")
    return State(
        displacement=context.array(
            "displacement", OWNER, vec3, u, restart=True, halo=True, output="displacement"
        ),
        velocity=context.array("velocity", OWNER, vec3, v, restart=True, halo=True, output="velocity"),
        force=context.array("force", OWNER, vec3, shape=n),
        mass=context.array("mass", OWNER, real, mass),
        external=context.array("external", "loads", vec3, external.constant) if features.loaded else None,
        held_mask=context.array("held", "supports", wp.uint8, context.held) if features.held else None,
        step=context.array("step", "solver", real, shape=1, per="once") if solver.steps_explicitly else None,
        damping=None if solver.mass_damping is None else context.array(
            "damping", "solver", real, np.array([solver.mass_damping]), per="once", restart=True
        ),
        work=energy.work,
        dissipated=energy.dissipated,
    )  # fmt: skip


def _check_columns(scene: Scene, built: Built) -> None:
    """Refuse measures with the names of other columns of the history.

    Raises:
        InputError: for the first of them.
    """
    taken = {"time", "step", *(column for part in (built.energy, *built.parts) for column in part.column_names())}
    for name in [*(m.name for m in scene.measures), *(o.name for o in scene.outcomes)]:
        if name in taken:
            raise InputError(f"measures: {name!r} is already a column of the history: expected another name")


def _add_stages(built: Built) -> None:
    """Compose the stages common to all solvers, and those of this one."""
    context = built.context
    built.add([Phase.START], context.stage("start", "once at the start"))
    built.add(SETUP, context.stage("setup", "once at the start or a restart"))
    built.add([Phase.SCHEDULES], context.stage("clock", "whenever the host sets the time or the step"))
    built.solver.prepare(built)
    frame = context.stage("frame", "every frame")
    built.add([Phase.FRAME], frame)
    built.sums.add(frame)
