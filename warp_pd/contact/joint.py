"""Joints: glue that holds, or breaks by peel and shear, and seams at any angle, welded point by point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, by_point, of_kind, point_indices, positive, show
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import ByPoint
from ..geometry.triangulation import doubled_normals, places_on_triangles
from ..interfaces import BuiltLaw, BuiltLoad, BuiltPart, Columns, History, Load, Part
from ..kernels.contact.joint import joint, weld
from ..shapes.clouds import cloud
from ..shapes.pieces import Place
from ..shapes.sheet import Sheet
from ..shapes.together import placed, together
from ..step import Phase
from .self_contact import membrane_stiffness

OWNER = "Joint"
# Default stiffness over thickness times modulus in pure shear over squared spacing, largest initial gap in spacings,
# and the default strength: energy over strength, in spacings.
STIFFNESS, REACH, ENERGY_LENGTH = 1.0, 0.5, 6.0
# Length of the zone that breaks in a peel, times strength over energy: 2 tension = energy at 180 degrees, and a
# membrane under the strength bends from 0 to the separation 2 energy / strength. Spacings below which a note says so.
ZONE, RESOLVED = math.sqrt(2.0), 5.5
# Stiffness over the default that shortens steps about tenfold, so that a note says so, and that is refused.
STIFF, TOO_STIFF = 1e2, 1e6
# Cosine of the angle of two sheets from which their mean normal tells peel from shear.
ALIKE = 0.5


@dataclass(frozen=True, eq=False)
class Joint(Part):
    """Glue between points and the triangles that they lie on, with a traction that breaks, or holds.

    Each point of `first` sticks to the nearest place on a triangle whose corners are in `second`; points that lie on
    none are not joined. The grids need not match. The traction per area of the points grows linearly with the
    separation to the strength, then decreases linearly to zero, and the joint has taken the energy; it never heals.
    Between peel and shear strength and energy are those of Camanho and Davila (kernels/contact/joint.py). Joined edges
    are joined by the areas of their points. A broken joint resists no contact: add `SelfContact` for that.

    Only with the solver Explicit, in one process. A scene has one Joint, which may have the points of many, and an
    energy that varies.

    Attributes:
        first: Indices of the points that stick.
        second: Indices of the corners of the triangles to which they stick; must not contain points of `first`.
        energy: Energy per area to peel the joint [J/m^2]: a number, an array, shape (N,), or a function of the
            coordinates as for `Sheet`. None for glue that holds.
        strength: Largest traction in peel [Pa]; by default the energy over six spacings, for which eight spacings of a
            peeled membrane are breaking. The steady force of a peel does not depend on it.
        shear_energy: Energy in shear [J/m^2], like `energy`, the default.
        shear_strength: Largest traction in shear [Pa]; by default the strength times the shear energy over the energy.
            With this proportion both break at the same separation, and a joint takes an energy between both however it
            opens. With others it takes less if it turns from one to the other while it breaks.
        stiffness: Traction per separation of the intact joint [N/m^3]; by default the thickness times the modulus in
            pure shear over the squared spacing. A hundred times as much shortens the steps about ten times; more than a
            million times as much is refused.
        reach: Largest distance from a point to its triangle at the start [m]; by default half a spacing. The distance
            stays, as the thickness of the glue.

    Raises:
        InputError: if a number is not positive, or one for breaking is given without an energy.
    """

    first: Any
    second: Any
    energy: ByPoint | None = None
    strength: float | None = None
    shear_energy: ByPoint | None = None
    shear_strength: float | None = None
    stiffness: float | None = None
    reach: float | None = None

    only_one: ClassVar[str] = "Joint: expected one with the points of all"

    def __post_init__(self) -> None:
        for name in ("strength", "shear_strength", "stiffness", "reach"):
            if getattr(self, name) is not None:
                positive(f"Joint.{name}", getattr(self, name))
        for name in ("energy", "shear_energy"):
            value = getattr(self, name)
            if isinstance(value, bool):
                raise InputError(f"Joint.{name} = {value}: expected a positive number, or None")
            if value is not None and not callable(value):
                by_point(f"Joint.{name}", value, np.zeros((np.size(value), 2)))
        for name in ("strength", "shear_energy", "shear_strength"):
            if self.energy is None and (value := getattr(self, name)) is not None:
                raise InputError(f"Joint.{name} = {show(value)}: expected None for glue that holds (energy = None)")

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the joint on a device."""
        return BuiltJoint(self, context, law)


class BuiltJoint(BuiltPart):
    """A joint on a device.

    Attributes:
        points: Points of `first` that are joined, shape (P,).
        stiffness: Traction per separation of the intact joint [N/m^3].
        damage: Damage of the joint at each point, 0 to 1, NaN at points that are not joined, (N,); None if it holds.
        energy: Energy stored in the joint at each point at the last frame [J], (N,) float64.
        released: Energy that breaking took at each point [J], (N,) float64; None if it holds or is not tracked.
    """

    label = "loads: Joint"

    def __init__(self, part: Joint, context: Context, law: BuiltLaw) -> None:
        if not context.dynamic:
            raise InputError(f"{self.label}: not supported by static solvers; expected Explicit")
        self.part, self.context = part, context
        sheet = context.sheet
        unit = STIFFNESS / sheet.spacing**2
        self.stiffness, self._excess = part.stiffness or 0.0, 1.0
        if part.stiffness is None or law.has_energy:
            usual = membrane_stiffness("Joint.stiffness", unit, law, sheet)
            self.stiffness = part.stiffness or usual
            self._excess = self.stiffness / usual
        if self._excess > TOO_STIFF:
            raise InputError(
                f"Joint.stiffness = {self.stiffness:.4g} N/m^3: expected at most {TOO_STIFF * usual:.4g}, a million "
                "times the default: it would shorten the time step more than a thousand times"
            )
        self._here = here = sheet.positions + context.initial_displacement
        self.points, self._corners, self._weights, self._gap = self._places(here)
        self._areas = context.areas[self.points]
        self._allocate()

    def _places(self, here: np.ndarray) -> tuple[np.ndarray, ...]:
        """Joined points, corners and weights of their places, and gaps [m]; `here` are the initial positions."""
        sheet, part = self.context.sheet, self.part
        first = point_indices("Joint.first", part.first, sheet.size)
        second = point_indices("Joint.second", part.second, sheet.size)
        if len(shared := np.intersect1d(first, second)):
            raise InputError(f"Joint.first and Joint.second both contain point {shared[0]}: expected disjoint points")
        faces = sheet.triangles[np.isin(sheet.triangles, second).all(axis=1)]
        if len(faces) == 0:
            raise InputError(
                f"Joint.second contains {len(second)} points but all corners of no triangle: expected the points of an "
                "area"
            )
        reach = REACH * sheet.spacing if part.reach is None else part.reach
        face, weights, gap = places_on_triangles(here[faces], here[first])
        on = (np.abs(gap) <= reach) & (weights.min(axis=1) >= -1e-6)
        if not on.any():
            raise InputError(
                f"Joint.first: none of its {len(first)} points lies on a triangle of Joint.second within {reach:.3g} m "
                "at the start: expected sheets placed on each other, or a larger reach"
            )
        return first[on], faces[face[on]], weights[on], np.where(np.abs(gap) > 1e-6 * reach, gap, 0.0)[on]

    def _allocate(self) -> None:
        context, sheet, n = self.context, self.context.sheet, self.context.sheet.size
        breaks = self.part.energy is not None
        self._kernels = joint(context.bits, breaks)
        own, alike = self._own_triangles()
        pairs = self._kernels.Pairs()
        values: dict[str, tuple[Any, Any]] = {
            "points": (wp.int32, self.points),
            "corners": (wp.vec3i, self._corners),
            "weights": (wp.vec3d, self._weights),
            "own": (wp.vec3i, own),
            "alike": (wp.float64, alike),
            "reference": (wp.vec3d, sheet.positions),
            "gap": (wp.float64, self._gap),
            "area": (wp.float64, self._areas),
        }
        if breaks:
            values["limits"] = (wp.vec4d, self._limits())
        for name, (dtype, value) in values.items():
            setattr(pairs, name, context.array(f"joint_{name}", OWNER, dtype, value, per="table"))
        pairs.stiffness = self.stiffness
        self._pairs = pairs
        self._pulls: dict[str, Any] = {
            name: context.array(f"joint_{name}", OWNER, wp.vec3d, shape=len(self.points), per="table")
            for name in ("pull", "turn_first", "turn_second")
        }
        members = np.column_stack([self.points, self._corners]).ravel()
        order = np.argsort(members, kind="stable")
        joined, begins = np.unique(members[order], return_index=True)
        entries = np.column_stack([order // 4, order % 4 - 1])
        self._touched: dict[str, Any] = {
            "joined": context.array("joined_points", OWNER, wp.int32, joined, per="table"),
            "begins": context.array("joined_begins", OWNER, wp.int32, np.append(begins, len(order)), per="table"),
            "entries": context.array("joined_entries", OWNER, wp.vec2i, entries, per="table"),
        }
        self.energy = context.array("joint_energy", OWNER, wp.float64, shape=n)
        self.damage: Array | None = None
        self.released: Array | None = None
        if breaks:
            damage = np.full(n, np.nan)
            damage[self.points] = 0.0
            self.damage = context.array(
                "joint_damage", OWNER, context.types.real, damage, restart=True, output="joint_damage"
            )
            if context.options.tracked:
                self.released = context.array("joint_released", OWNER, wp.float64, shape=n, restart=True)

    def _own_triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """A triangle of each joined point, shape (P, 3), and 1 or -1 for a normal along or against that of the place.

        It is 0 for sheets at an angle, as in a T-joint, where the normal at the place alone tells peel from shear.
        """
        triangles, here = self.context.sheet.triangles, self._here
        last = np.zeros(self.context.sheet.size, np.int64)
        last[triangles] = np.arange(len(triangles))[:, None]
        own = triangles[last[self.points]]
        ours, theirs = (doubled_normals(here, corners) for corners in (own, self._corners))
        cosine = (ours * theirs).sum(axis=1) / np.linalg.norm(ours, axis=1) / np.linalg.norm(theirs, axis=1)
        return own, np.where(np.abs(cosine) > ALIKE, np.sign(cosine), 0.0)

    def _limits(self) -> np.ndarray:
        """1 / strength^2 and 1 / energy of each pair, in peel and in shear, shape (P, 4)."""
        part, context = self.part, self.context
        found = []
        for name in ("energy", "shear_energy"):
            given = getattr(part, name) if getattr(part, name) is not None else part.energy
            values = by_point(f"Joint.{name}", given, context.given.points)
            found.append(np.broadcast_to(values, context.sheet.size)[self.points])
        peel, shear = found
        strength = peel / (ENERGY_LENGTH * context.sheet.spacing)
        if part.strength is not None:
            strength = np.full(len(peel), part.strength)
        shear_strength = strength * shear / peel
        if part.shear_strength is not None:
            shear_strength = np.full(len(peel), part.shear_strength)
        self._zone = float((ZONE * peel / strength).min())
        for name, force, energy in (("strength", strength, peel), ("shear_strength", shear_strength, shear)):
            least = float((force**2 / (2.0 * energy)).max())
            if self.stiffness <= least:
                raise InputError(
                    f"Joint.{name} = {force.max():.4g} Pa: expected less than sqrt(2 stiffness energy), here "
                    f"{float(np.sqrt(2.0 * self.stiffness * energy).min()):.4g} Pa, or a stiffness of more than "
                    f"{least:.4g} N/m^3"
                )
        return np.column_stack([strength**-2.0, shear_strength**-2.0, 1.0 / peel, 1.0 / shear])

    def added_frequency(self) -> float:
        """Bound of the frequency of the intact joint [rad/s], by Gershgorin's theorem."""
        sheet = self.context.sheet
        # A corner also turns the normal, by one over its height in the triangle.
        first, second = (self._here[self._corners[:, k]] - self._here[self._corners[:, 0]] for k in (1, 2))
        sides = np.linalg.norm(np.stack([second - first, second, first], axis=1), axis=-1)
        heights = np.linalg.norm(np.cross(first, second), axis=1)[:, None] / sides
        arms = np.abs(self._weights) + np.abs(self._gap)[:, None] / heights
        stiffness = self.stiffness * self._areas * (1.0 + arms.sum(axis=1))
        rows = np.zeros(sheet.size)
        rows[self.points] = stiffness
        np.add.at(rows, self._corners, stiffness[:, None] * arms)
        return float(np.sqrt((rows / (sheet.areas * sheet.thickness * sheet.density)).max()))

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the damage, the force and the energy."""
        kernels, displacement, number = self._kernels, self.context.state.displacement, len(self.points)
        given: dict[str, Any] = {"pairs": self._pairs, "displacement": displacement, "damage": self.damage}
        if phase is Phase.INTERNAL_VARIABLES and self.damage is not None:
            stage.launch(OWNER, kernels.damage, number, **given, released=self.released)
        elif phase is Phase.INTERNAL_FORCE:
            stage.launch(OWNER, kernels.pull, number, **given, **self._pulls)
            stage.launch(
                OWNER, kernels.add, self._touched["joined"].shape[0], pairs=self._pairs, **self._pulls, **self._touched,
                force=self.context.state.force,
            )  # fmt: skip
        elif phase is Phase.FRAME:
            stage.launch(OWNER, kernels.energy, number, **given, energy=self.energy)

    def columns(self) -> Columns:
        """Energy stored in the joint, energy lost to breaking it, and its mean damage."""
        stored = {"joint": self.energy}
        lost = {} if self.released is None else {"joint_released": self.released}
        if self.damage is None:
            return Columns(stored=stored, lost=lost)
        return Columns(("joint_damage",), self._mean_damage, stored=stored, lost=lost)

    def _mean_damage(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Mean damage over the joined area [-]."""
        assert self.damage is not None
        damage = self.damage.numpy()[self.points].astype(np.float64)
        # Sums of one kind, so that the mean of ones is 1.
        return {"joint_damage": float((damage * self._areas).sum() / self._areas.sum())}

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on a stiffness that shortens the steps, and on a spacing that does not resolve the zone that breaks."""
        spacing, said = self.context.sheet.spacing, []
        if self._excess > STIFF:
            said.append(
                f"joint: its stiffness is {self._excess:.3g} times the default, which shortens the time step up to "
                f"{math.sqrt(self._excess):.3g} times"
            )
        if self.damage is not None and self._zone < RESOLVED * spacing:
            said.append(
                f"joint: about {self._zone:.3g} m of it break at a time in a peel, {self._zone / spacing:.2g} "
                f"spacings; expected {RESOLVED:g} or more, from a strength of at most "
                f"{self._zone / spacing / RESOLVED:.2g} times that given, or a finer sheet: otherwise forces oscillate "
                "and their mean is too large"
            )
        return said


WELD = "Weld"
# Default stiffness of a pair over thickness times modulus in pure shear, and largest gap at the start, in spacings.
WELD_STIFFNESS, COINCIDENT = 10.0, 1e-3


@dataclass(frozen=True, eq=False)
class Weld(Load):
    """A seam that holds: each point of one edge is tied to one of another edge, at which it lies at the start.

    Sheets may meet at any angle, also folded back by 180 degrees, since no family spans the seam. Several seams may
    meet at one edge, as in a T-joint: each is a Weld of its own. The ties are stiff springs, so the seam opens a
    little: with the default by a tenth of what a spacing of the sheet stretches. With all solvers, in one process.

    Attributes:
        first: Indices of points.
        second: As many others; each is tied to the nearest of `first`, which must lie within a thousandth of a spacing.
        stiffness: Force over separation of a pair [N/m]; by default ten times the thickness times the modulus in pure
            shear.

    Raises:
        InputError: if the stiffness is not positive.
    """

    first: Any
    second: Any
    stiffness: float | None = None

    def __post_init__(self) -> None:
        if self.stiffness is not None:
            positive("Weld.stiffness", self.stiffness)

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the weld on a device. Raises InputError for points that do not coincide."""
        return BuiltWeld(self, context, law)


class BuiltWeld(BuiltLoad):
    """A weld on a device."""

    label = "loads: Weld"
    follows_displacement = True
    symmetric = True

    def __init__(self, given: Weld, context: Context, law: BuiltLaw) -> None:
        self.context, sheet, size = context, context.sheet, context.sheet.size
        place = sheet.positions + context.initial_displacement
        first, second = _pairs(given, place, sheet.spacing)
        partner, apart = np.full(size, -1), np.zeros((size, 3))
        partner[first], partner[second] = second, first
        apart[first] = sheet.positions[second] - sheet.positions[first]
        apart[second] = -apart[first]
        self.stiffness = given.stiffness or membrane_stiffness("Weld.stiffness", WELD_STIFFNESS, law, sheet)
        self.ties = np.where(partner >= 0, self.stiffness, 0.0)
        self.partner = context.array("weld_partner", WELD, wp.int32, partner)
        self.apart = context.array("weld_apart", WELD, context.types.vec3, apart)
        self.joined = context.array("weld_joined", WELD, context.types.vec3, shape=size)

    def _add(self, stage: Stage, apart: Array, moved: Array, out: Array) -> None:
        stage.launch(
            WELD, weld(self.context.bits), self.context.sheet.size, partner=self.partner, stiffness=self.stiffness,
            apart=apart, moved=moved, out=out,
        )  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the force of the ties."""
        self._add(stage, self.apart, displacement, out)

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the derivative of the force, which is linear."""
        self._add(stage, self.joined, direction, out)
        return True


def _pairs(given: Weld, place: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points that are tied one to one, each of shape (P,), at the places [m] of all points, (N, 3).

    Raises:
        InputError: for groups of different size or with points in common, and for pairs that do not coincide.
    """
    first, second = (
        np.unique(point_indices(f"Weld.{name}", points, len(place)))
        for name, points in (("first", given.first), ("second", given.second))
    )
    if len(first) != len(second) or np.intersect1d(first, second).size:
        raise InputError(
            f"Weld: {len(first)} points of first and {len(second)} of second: expected as many, and none in common"
        )
    from scipy.spatial import cKDTree

    gap, nearest = cKDTree(place[first]).query(place[second])
    if (gap > COINCIDENT * spacing).any() or len(np.unique(nearest)) < len(first):
        raise InputError(
            f"Weld: points are up to {gap.max():.3g} m apart at the start: expected edges that coincide point by "
            "point, or Joint"
        )
    return first[nearest], second


def pillow(half: Sheet) -> tuple[Sheet, np.ndarray, Weld]:
    """Two equal flat sheets, one on the other with their upper sides outward, welded along all edges.

    Args:
        half: A flat sheet in one piece; the result is two of it, as clouds.

    Returns:
        The sheet of both, whose parts are "sheet 1" above and "sheet 2" below; the displacement that lays one on the
        other [m], shape (N, 3), for `initial_displacement`; and the weld, for `loads`.

    Raises:
        InputError: for a sheet that is curved, prestretched or cut, or has rigid inclusions or pieces.
    """
    of_kind("pillow: half", half, Sheet)
    plain = half.frames is None and half.stretch is None and half.pieces is None and half.spacings is None
    if not plain or half.cuts or half.inclusions or not len(half.triangles):
        raise InputError("pillow: half: expected a flat sheet of uniform spacing without cuts, inclusions and pieces")
    upper = Sheet.of(
        cloud(half.points, half.triangles, None, half.spacing), thickness=half.thickness, density=half.density
    )
    mirrored = cloud(half.points * (1.0, -1.0), half.triangles[:, ::-1], None, half.spacing)
    both = together(upper, Sheet.of(mirrored, thickness=half.thickness, density=half.density))
    start = placed(both, Place(), Place(axis=(1.0, 0.0, 0.0), degrees=180.0))
    rim = np.asarray(half.edges("all"))
    return both, start, Weld(rim, half.size + rim)
