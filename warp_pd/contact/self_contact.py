"""Contact of a sheet with itself, and of its pieces with each other, by triangles or by points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, not_negative, positive, show
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..interfaces import BuiltContact, BuiltLaw, Columns, Contact
from ..kernels.contact.self_contact import CROWDED, LISTED, STALE, TOUCHED, pair_functions, pair_lists, repulsion
from ..kernels.integrate import RIGID
from ..step import Phase


@dataclass(frozen=True)
class SelfContact(Contact):
    """Repulsion between points that share no bond, within a piece and between pieces.

    The energy of a pair is stiffness (d - r)^2 / 2 at a distance r below d. d is `distance`; within a piece it is
    limited to 0.7 times the reference distance of the pair, so there is no contact in the reference state. Pairs with a
    broken bond are included. Source: short-range forces of Silling and Askari (2005). Only with the solver Explicit.

    Attributes:
        distance: Contact distance [m]; by default 1.5 spacings. A point cannot pass through the sheet while its stretch
            is less than 1.4 distance / spacing.
        stiffness: Contact stiffness of two points that each represent one spacing squared [N/m]; by default a tenth of
            the thickness times the modulus in pure shear. A larger stiffness shortens the time step.
        friction: Coefficient of Coulomb friction. Sticking contacts creep: under a tangential force T they slip at
            about n T dt / m, with n contacts at a point.
        surface: Whether triangles have contact instead of points, by impulses in each step
            (kernels/contact/sheet_contact.py): apart from neighbours within about two spacings nothing passes, and the
            time step is not shortened. The default of `distance` is then a tenth of the spacing, and
            `stiffness` must be None.

    Raises:
        InputError: if distance or stiffness is not positive, friction is negative, or `surface` is not a bool or comes
            with a stiffness.
    """

    distance: float | None = None
    stiffness: float | None = None
    friction: float = 0.0
    surface: bool = False

    does_work: ClassVar[bool] = False
    only_one: ClassVar[str] = "SelfContact: expected at most one"

    def __post_init__(self) -> None:
        for name, value in (("distance", self.distance), ("stiffness", self.stiffness)):
            if value is not None:
                positive(f"SelfContact.{name}", value)
        not_negative("SelfContact.friction", self.friction)
        if not isinstance(self.surface, bool):
            raise InputError(f"SelfContact.surface = {show(self.surface)}: expected True or False")
        if self.surface and self.stiffness is not None:
            raise InputError(f"SelfContact.stiffness = {show(self.stiffness)}: expected None with surface = True")

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the contact on a device."""
        if self.surface:
            from .sheet_surface import SheetSurface

            return SheetSurface(context, law, self.distance, self.friction)

        return PointPairs(self, context, law)


OWNER = "SelfContact"
# Status at the start: there are no lists yet, none is full or holds a pair, and nothing touches.
_FRESH = np.array([1, 0, 0, 0], np.int32)
# Distance that points keep and skin of the lists, in spacings.
DISTANCE, SKIN = 1.5, 0.3
# Reach over the width of a cell, so that round-off of float32 sorts no pair within reach into cells that are apart.
NARROWER = 0.99
# Points of one piece keep no more than this fraction of their reference distance: rubber that tears at a stretch of 2
# is as narrow as that across.
KEPT_FRACTION = 0.7
# Stiffness of a pair over thickness times the modulus of pure shear.
STIFFNESS = 0.1
# Layers of sheet that may lie within the reach of a point.
LAYERS = 4


class PointPairs(BuiltContact):
    """Self-contact on a device.

    Attributes:
        distance: Contact distance [m].
        stiffness: Contact stiffness of a pair [N/m].
        energy: Contact energy of each point (half of each pair's) at the last frame [J], (N,) float64.
    """

    label = "contact = SelfContact"

    def __init__(self, part: SelfContact, context: Context, law: BuiltLaw) -> None:
        self.part, self.context, self.law = part, context, law
        sheet = context.sheet
        if part.friction > 0.0 and (context.held & RIGID).any():
            raise InputError("SelfContact.friction: expected 0 with rigid inclusions, which do not support it")
        self.distance = DISTANCE * sheet.spacing if part.distance is None else part.distance
        self.stiffness = part.stiffness or membrane_stiffness("SelfContact.stiffness", STIFFNESS, law, sheet)
        self._skin = SKIN * sheet.spacing
        least = sheet.spacing if sheet.spacings is None else float(sheet.spacings.min())
        capacity = LAYERS * math.ceil(math.pi * ((self.distance + self._skin) / least) ** 2)
        pieces, rubbing = sheet.pieces is not None, part.friction > 0.0
        self._allocate_points(pieces)
        self._allocate_lists(capacity)
        self._allocate_friction(rubbing)
        self._lists = pair_lists(context.layout, pieces)
        self._kernels = repulsion(context.layout, context.options, pieces, rubbing)

    def _allocate_points(self, pieces: bool) -> None:
        """Allocate the point data for pairs: reference positions, areas and pieces."""
        context, sheet = self.context, self.context.sheet
        points = pair_functions(context.bits, pieces).Points()
        context.require_resolved(OWNER)
        points.reference = context.array("reference", OWNER, context.types.vec3, sheet.positions)
        if pieces:
            points.piece = context.array("pieces", OWNER, wp.int32, sheet.pieces)
        relative = sheet.areas / sheet.spacing**2
        points.area = context.array("relative_areas", OWNER, context.types.real, relative)
        points.distance, points.fraction, points.stiffness = self.distance, KEPT_FRACTION, self.stiffness
        self._points = points

    def _allocate_lists(self, capacity: int) -> None:
        """Allocate the cell buckets and, for each point, a list of at most `capacity` nearby points."""
        context, n = self.context, self.context.sheet.size
        self._buckets = 1 << (2 * n - 1).bit_length()
        self._status = context.array("status", OWNER, wp.int32, _FRESH, per="once")
        self._heads = context.array("buckets", OWNER, wp.int32, shape=self._buckets, per="table")
        self._following = context.array("following", OWNER, wp.int32, shape=n)
        self._cells = context.array("cells", OWNER, wp.vec3i, shape=n)
        self._listed_at = context.array("listed_at", OWNER, context.types.vec3, shape=n)
        self._counts = context.array("near_counts", OWNER, wp.int32, shape=n)
        self._near = context.array("near_points", OWNER, wp.int32, shape=(capacity, n), per="bond")
        self.energy = context.array("contact_energy", OWNER, wp.float64, shape=n)

    def _allocate_friction(self, rubbing: bool) -> None:
        """Allocate the arrays for friction, if there is any."""
        context, n = self.context, self.context.sheet.size
        self._touching = self._contact_force = self._impulse = self._rubbed = None
        if rubbing:
            self._touching = context.array("contacts", OWNER, wp.int32, shape=n)
            self._contact_force = context.array("contact_force", OWNER, context.types.vec3, shape=n)
            self._impulse = context.array("friction_impulse", OWNER, context.types.vec3, shape=n)
            if context.options.tracked:
                self._rubbed = context.array("rubbed", OWNER, wp.float64, shape=n, restart=True)

    def added_frequency(self) -> float:
        """Largest frequency of the contacts alone [rad/s], by Gershgorin's theorem.

        It is an upper bound if each point touches no more sheet than fits in a circle of radius `distance`.
        """
        sheet = self.context.sheet
        mass = float(np.min(sheet.spacing**2 * sheet.thickness * sheet.density))
        touched = math.pi * (self.distance / sheet.spacing) ** 2
        return math.sqrt(2.0 * touched * self.stiffness / mass)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the lists, the force, friction and the energy."""
        context = self.context
        n, displacement = context.sheet.size, context.state.displacement
        if phase in (Phase.PROJECT, Phase.SCHEDULES):
            stage.launch(
                OWNER, self._lists.look, n,
                displacement=displacement, listed_at=self._listed_at, limit=(0.5 * self._skin) ** 2,
                status=self._status,
            )  # fmt: skip
        elif phase is Phase.INTERNAL_FORCE:
            self._add_lists(stage, displacement)
            stage.launch(
                OWNER, self._kernels.add_force, n, **self._pairs(displacement), contacts=self._touching,
                contact_force=self._contact_force, force=context.state.force, status=self._status,
                # Bonds that broke come from the families.
                only_if=None if self.law.intact is not None else self._flag(LISTED),
            )  # fmt: skip
        elif phase is Phase.SEPARATE and self._impulse is not None:
            self._add_friction(stage, displacement, self._impulse)
        elif phase is Phase.FRAME:
            stage.launch(OWNER, self._kernels.energy, n, **self._pairs(displacement), energy=self.energy)

    def _pairs(self, displacement: Array) -> dict[str, Any]:
        return {
            "family": self.law.struct, "points": self._points,
            "displacement": displacement, "counts": self._counts, "near": self._near,
        }  # fmt: skip

    def _flag(self, index: int) -> Array:
        found: Array = self._status[index : index + 1]
        return found

    def _add_lists(self, stage: Stage, displacement: Array) -> None:
        lists, n, sheet = self._lists, self.context.sheet.size, self.context.sheet
        relative = 1.0 if sheet.spacings is None else float(sheet.spacings.max()) / sheet.spacing
        # Warp's atomic operations are not atomic between CPU threads, so one thread does all.
        threads = n if self.context.device.is_cuda else 1
        cells: dict[str, Any] = {
            "heads": self._heads,
            "following": self._following,
            "cells": self._cells,
            "status": self._status,
        }
        stale = self._flag(STALE)
        stage.launch(OWNER, lists.clear, self._buckets, heads=self._heads, status=self._status, only_if=stale)
        stage.launch(
            OWNER, lists.insert, threads, only_if=stale,
            points=self._points, displacement=displacement, inverse_cell=NARROWER / (self.distance + self._skin),
            stride=threads, listed_at=self._listed_at, **cells,
        )  # fmt: skip
        stage.launch(
            OWNER, lists.collect, n, only_if=stale,
            family=self.law.struct, points=self._points, displacement=displacement, skin=self._skin,
            family_reach=1.001 * relative * self.law.families.horizon, counts=self._counts, near=self._near, **cells,
        )  # fmt: skip
        stage.launch(OWNER, lists.finish, 1, status=self._status, only_if=stale)

    def _add_friction(self, stage: Stage, displacement: Array, impulse: Array) -> None:
        context, state = self.context, self.context.state
        stage.launch(
            OWNER, self._kernels.friction, context.sheet.size, **self._pairs(displacement), velocity=state.velocity,
            mass=state.mass, contacts=self._touching, contact_force=self._contact_force, step=state.step,
            coefficient=self.part.friction, impulse=impulse, only_if=self._flag(TOUCHED),
        )  # fmt: skip
        stage.pointwise(
            OWNER, self._kernels.rub, context.sheet.size,
            mass=state.mass, held_mask=state.held_mask, impulse=impulse, velocity=state.velocity, step=state.step,
            damping=state.damping, force=state.force, external=state.external, work=state.work,
            dissipated=state.dissipated, rubbed=self._rubbed, only_if=self._flag(TOUCHED),
        )  # fmt: skip

    def columns(self) -> Columns:
        """Contact energy, and energy dissipated by friction."""
        lost = {} if self._rubbed is None else {"sheet_friction": self._rubbed}
        return Columns(stored={"contact": self.energy}, lost=lost)

    def end_frame(self) -> None:
        """Check that no list of pairs has overflowed."""
        if self._status.numpy()[CROWDED]:
            raise InputError(
                f"SelfContact: more than {self._near.shape[0]} points without bonds came within "
                f"{self.distance + self._skin:.4g} m of one: expected a sheet that is not crushed; raise the stiffness "
                f"({self.stiffness:.4g} N/m) or lower the distance"
            )


def membrane_stiffness(name: str, factor: float, law: BuiltLaw, sheet: Sheet) -> float:
    """`factor` times the least modulus in pure shear and the least thickness, the default of the argument `name`."""
    step = 1e-3
    try:
        below, none, above = law.energy_density(np.array([1.0 - step, 1.0, 1.0 + step]))
    except InputError:
        kind = type(law).__name__.removesuffix("Force")
        raise InputError(f"{name} = None: expected a number, because the law {kind} has no default") from None
    modulus = float(below - 2.0 * none + above) / step**2
    if not modulus > 0.0:
        raise InputError(f"{name} = None: expected a number, because the material has no stiffness")
    softest = 1.0 if sheet.stiffness is None else float(sheet.stiffness.min())
    return factor * softest * modulus * float(np.min(sheet.thickness))
