"""Builds a simulation: law, parts and solver of a scene on a device, and their launches by phase."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..communicator import Communicator
from ..context import State, find_device, with_material
from ..device.checks import InputError, one_of
from ..device.fields import Array, in_double
from ..interfaces import BuiltContact, BuiltLoad, BuiltPart, BuiltRupture, BuiltSolver, Columns, Part, System
from ..interfaces.solver import ExternalForce
from ..parts.frame_checks import EnergyBalance, FrameChecks, Sums, Ticking, begin_loading_common
from ..parts.supports import MovedPoints
from ..step import Phase, begin
from . import PARTS
from .scene import Outcome, Scene
from .scene_context import constraints_here, is_load, parts_here, scene_context, shared_state


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
    law.request_fields(scene.fields_besides(stored.field.output for stored in context.fields.shown()))
    loads = [on_device for part, on_device in zip(parts, built, strict=True) if is_load(part, scene)]
    external = ExternalForce(context, cast(list[BuiltLoad], loads))
    moved = MovedPoints(context, constraints)
    if not law.resists_bending:
        moved.refuse_held_slopes()
    if scene.solver.dynamic:
        moved.check_begin(law.families.horizon)
    does_work = context.options.held or context.options.loaded or any(part.does_work for part in parts)
    energy = EnergyBalance(context, law, does_work, any(part.unbalanced for part in parts))
    context.state = shared_state(scene, context, external.constant, energy)
    solver = scene.solver.build(context, law)
    context.clock.allocate(context.fields, context.types)
    contacts = tuple(cast(BuiltContact, _built(part, parts, built)) for part in scene.contacts)
    beside = [check for contact in contacts for check in contact.checks(contacts)]
    checks = FrameChecks(context, solver.has_inertia)
    acting = (law, solver, moved, Ticking(context), *built, external, *beside, checks)
    columns = energy.count(acting)
    made = Built(
        context, law, external, acting, constraints, cast(BuiltRupture | None, _built(scene.damage, parts, built)),
        scene, solver, checks, energy, Sums(context, (*columns[1:], columns[0])), columns,
        contacts[0] if contacts else None, contacts,
    )  # fmt: skip
    _check_columns(scene, made)
    _require_divisible(made)
    _add_stages(made)
    context.communicator.add_exchanges(list(context.stages.values()), context.fields)
    return made


def _built(wanted: Part | None, parts: list[Part], built: list[BuiltPart]) -> BuiltPart | None:
    """The built counterpart of a part of the scene."""
    return next((on_device for part, on_device in zip(parts, built, strict=True) if part is wanted), None)


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
