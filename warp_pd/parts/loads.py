"""Loads: follower and dead pressure, body and point forces; values of points that a material takes, changed in time."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, finite, one_of, point_indices, vector
from ..device.clock import factor_schedule
from ..device.fields import Array, to_host
from ..device.graph import run_once
from ..device.launches import Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..geometry.surface import cells_of, pressed_areas, pressed_weights
from ..geometry.triangulation import boundary_sides, components, directed_edges
from ..interfaces import BuiltLaw, BuiltLoad, BuiltPart, History, Load, Part
from ..interfaces.scales import LIGHTEST, Scales, largest_factor
from ..kernels.loads import dead_load, follower_pressure, follower_pressure_tangent, scaled_values
from ..step import Phase

Ramp = Sequence[tuple[float, float]] | None
# Of the Earth [m/s^2].
GRAVITY = 9.81
# Error of the resultant of a pressure on points from which a note says so: over the resultant that the edge carries,
# and over pressure times area, for a closed surface, which it would move, and where the parts of the edge balance.
UNRESOLVED, UNBALANCED = 0.02, 1e-3


@dataclass(frozen=True)
class Pressure(Load):
    """Pressure on one side of the sheet, positive along +z, on a curved sheet positive outward.

    Attributes:
        value: Pressure [Pa].
        follower: Whether it acts along the current normal on the current area (F e1 x F e2); otherwise along the
            normal and on the area of the sheet as given by the scene, of a prestretched sheet as clamped (dead load). A
            damage field reduces a follower pressure by (1 - d)^2: nothing presses on the opening of a tear.
        ramp: Pairs (time [s], factor), or None for a constant pressure.
        on: Where a follower pressure acts. On "points", with the gradients of their families, its resultant is of
            second order in the spacing, but heights and stability are closer, as the law sees the same surface. On
            "triangles" the resultant is that of the edge, zero on a closed surface, and triangles cut by a crack carry
            none. On `Sheet.tube` and `Sheet.sphere` with an opening it is that of the edge times the smooth area over
            that of the chords: 1.6 % more on a sphere of points=8, 0.5 % at 16.
    """

    value: float
    follower: bool = True
    ramp: Ramp = None
    on: str = "points"

    divides: ClassVar[bool] = True

    def __post_init__(self) -> None:
        finite("Pressure.value", self.value)
        one_of("Pressure.follower", self.follower, (True, False))
        one_of("Pressure.on", self.on, ("points", "triangles"))
        if self.on == "triangles" and not self.follower:
            raise InputError("Pressure.on = 'triangles': expected 'points' with follower = False")

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether the sheet cannot carry it."""
        force = abs(self.value) * largest_factor(self.ramp) * scales.area
        return scales.of_force(f"Pressure({self.value:g}) is", force, "Pressures are in Pa")

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the pressure on a device."""
        if self.follower:
            ramp = factor_schedule("Pressure", self.ramp) or context.clock.default_ramp
            schedule = context.clock.register(ramp)
            if self.on == "points":
                return FollowerPressure(self.value, schedule, context, law)
            from .surface_pressure import TrianglePressure

            return TrianglePressure(self.value, schedule, context, law)
        force = (self.value * context.areas)[:, None] * context.sheet.normals
        return DeadLoad("Pressure", context, np.arange(context.sheet.size, dtype=np.int32), force, self.ramp)


@dataclass(frozen=True)
class BodyForce(Load):
    """A force per volume of the stress-free sheet, constant or ramped.

    Attributes:
        value: Force density [N/m^3]; for gravity, density times acceleration. Density and thickness of a prestretched
            sheet are those of the stress-free one, too, so gravity acts on all its mass.
        ramp: Pairs (time [s], factor), or None for a constant force.
    """

    value: tuple[float, float, float]
    ramp: Ramp = None

    divides: ClassVar[bool] = True

    def __post_init__(self) -> None:
        vector("BodyForce.value", self.value, 3)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it is an acceleration, or the sheet cannot carry it."""
        size = float(np.linalg.norm(self.value))
        if scales.density > LIGHTEST and abs(size - GRAVITY) < 0.01 * GRAVITY:
            return [
                f"BodyForce is {size:.3g} N/m^3; is it an acceleration? Gravity is the density times 9.81 m/s^2, "
                f"{scales.density * GRAVITY:.4g} N/m^3"
            ]
        force = size * largest_factor(self.ramp) * float((sheet.areas * sheet.thickness).sum())
        return scales.of_force(f"BodyForce of {size:.3g} N/m^3 is", force, "Body forces are in N/m^3")

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the force on a device."""
        sheet = context.sheet
        force = np.outer(sheet.areas * sheet.thickness, np.array(self.value, dtype=np.float64))
        return DeadLoad("BodyForce", context, np.arange(sheet.size, dtype=np.int32), force, self.ramp)


@dataclass(frozen=True, eq=False)
class PointForce(Load):
    """A force, constant or ramped, distributed over the given points in proportion to their areas.

    Attributes:
        points: Point indices.
        value: Total force [N].
        ramp: Pairs (time [s], factor), or None for a constant force.
    """

    points: Any
    value: tuple[float, float, float]
    ramp: Ramp = None

    def __post_init__(self) -> None:
        vector("PointForce.value", self.value, 3)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether the sheet cannot carry it."""
        size = float(np.linalg.norm(self.value)) * largest_factor(self.ramp)
        return scales.of_force(f"PointForce of {size:.3g} N is", size, "Forces are in N")

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the force on a device."""
        points, force = self.forces(context.sheet)
        return DeadLoad("PointForce", context, points, force, self.ramp)

    def forces(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Indices of its points, shape (P,), and the force on each [N], shape (P, 3)."""
        points = point_indices("PointForce.points", self.points, sheet.size)
        part = sheet.areas[points] / sheet.areas[points].sum()
        return points, np.outer(part, np.array(self.value, dtype=np.float64))

    def on_partition(self, sheet: Sheet, partition: Partition) -> Load:
        """The forces on the points of this process."""
        points, force = self.forces(sheet)
        at, here = partition.here(points)
        return ForcesHere(here, force[at], self.ramp)


@dataclass(frozen=True, eq=False)
class ForcesHere(Load):
    """The part of a PointForce on one of several processes.

    Attributes:
        points: Point indices, shape (P,).
        force: Force on each point [N], shape (P, 3).
    """

    points: np.ndarray
    force: np.ndarray
    ramp: Ramp = None

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the force on a device."""
        return DeadLoad("PointForce", context, self.points, self.force, self.ramp)


class DeadLoad(BuiltLoad):
    """A force that does not depend on the displacement, optionally times a schedule."""

    def __init__(self, owner: str, context: Context, points: np.ndarray, force: np.ndarray, ramp: Ramp) -> None:
        """Allocate the force on each point [N], shape (P, 3), on the device unless it is constant in time."""
        self.label, self.owner, self.context = f"loads: {owner}", owner, context
        self._points, self._force = points, force
        self._schedule = context.clock.register(factor_schedule(owner, ramp) or context.clock.default_ramp)
        if self._schedule is not None:
            vec3 = context.types.vec3
            self._loaded = context.array("loaded_points", owner, wp.int32, points, per="table")
            self._loaded_force = context.array("loaded_force", owner, vec3, force, per="table")

    def constant_force(self) -> np.ndarray | None:
        """The force [N], shape (N, 3), if it has no schedule; otherwise None."""
        if self._schedule is not None:
            return None
        total = np.zeros((self.context.sheet.size, 3))
        total[self._points] += self._force
        return total

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that adds the force times the factor of its schedule."""
        context = self.context
        stage.launch(
            self.owner, dead_load(context.bits), len(self._points),
            points=self._loaded, force=self._loaded_force, factors=context.clock.scheduled, schedule=self._schedule,
            external=out,
        )  # fmt: skip


class FollowerPressure(BuiltLoad):
    """Follower pressure on the points of a sheet, on a device."""

    follows_displacement = True
    coarsens = True

    def __init__(self, value: float, schedule: int | None, context: Context, law: BuiltLaw) -> None:
        self.label, self.context, self.law = "loads: Pressure", context, law
        self._value, self._schedule = value, schedule
        self._unit_pressure = value * law.families.reference_area
        self._key = (context.layout, schedule is not None)

    def _arguments(self, displacement: Array) -> dict[str, Any]:
        law = self.law
        return {
            "family": law.struct, "displacement": displacement, "damage": law.damage,
            "unit_pressure": self._unit_pressure,
            "factors": self.context.clock.scheduled, "schedule": self._schedule or 0,
        }  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the pointwise stage that adds the pressure's force."""
        kernel, points = follower_pressure(*self._key), self.context.sheet.size
        stage.pointwise("Pressure", kernel, points, **self._arguments(displacement), external=out)

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the launch that adds the derivative of the pressure's force along a direction."""
        kernel, points = follower_pressure_tangent(*self._key), self.context.sheet.size
        stage.launch("Pressure", kernel, points, **self._arguments(displacement), direction=direction, change=out)
        return True

    def tangent_matrix(self, displacement: np.ndarray) -> Any:
        """Tangent matrix for a flat sheet without broken bonds, otherwise None."""
        if self.context.sheet.frames is not None or self.law.intact is not None:
            return None
        families = self.law.families
        pressure = (
            self.context.clock.factor(self._schedule) * self._unit_pressure * families.rows_of_points(families.areas)
        )
        from ..families.point_gradient import surface_vector_matrix

        return surface_vector_matrix(self._gradient, displacement, pressure)

    @functools.cached_property
    def _gradient(self) -> tuple[Any, Any]:
        from ..families.point_gradient import point_gradient

        return point_gradient(self.law.families)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """A note if the families do not resolve the surface, so that the force is not that of a pressure.

        The resultant over a piece of the sheet follows from its edge alone. That on points has it only if the normals
        of families are those of the surface. Of a piece with several edges nothing is known of each: how they share the
        resultant depends on the stresses.
        """
        context, sheet = self.context, self.context.sheet
        factor = context.clock.factor(self._schedule)
        torn = self.law.intact is not None or context.layout.softened
        no_edge = len(np.unique(sheet.triangles)) < sheet.size
        if torn or no_edge or context.partition is not None or factor == 0.0:
            return []
        # Points that triangles connect.
        piece = components(sheet.size, directed_edges(sheet.triangles))
        edges, missed = self._area_vectors(factor, piece)
        areas = np.bincount(piece, sheet.areas)
        worst = int(np.argmax(missed / np.maximum(UNRESOLVED * edges, UNBALANCED * areas)))
        edge, off, area = float(edges[worst]), float(missed[worst]), float(areas[worst])
        if not off > max(UNRESOLVED * edge, UNBALANCED * area):
            return []
        which = f" of piece {worst + 1}" if len(areas) > 1 else ""
        if edge <= UNBALANCED * area:
            own = sheet.triangles[piece[sheet.triangles[:, 0]] == worst]
            where = "between edges that balance" if len(boundary_sides(own)) else "in the closed surface"
            return [
                f"Pressure({self._value:g}): its resultant {where}{which} is {off / area:.2g} times pressure times "
                "area instead of 0: expected more points, or on='triangles'"
            ]
        pressure = abs(factor * self._value)
        return [
            f"Pressure({self._value:g}): its resultant on the points{which} is off by {pressure * off:.3g} N, "
            f"{100.0 * off / edge:.2g} % of the {pressure * edge:.3g} N that the edge carries: "
            "the families do not resolve the surface, and supports are wrong; expected on='triangles', or more points"
        ]

    def _area_vectors(self, factor: float, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lengths of the vector areas that the edges of each piece span, and of the errors of the resultants [m^2].

        Points of a flat sheet may represent an area beyond its triangles, which the edge then carries as well.
        """
        context, sheet = self.context, self.context.sheet
        out: Any = wp.zeros(sheet.size, dtype=context.types.vec3, device=context.device)
        stage = Stage("resultant of the pressure", "", context.device, context.block_dim, [])
        arguments = {
            **self._arguments(context.state.displacement), "unit_pressure": self.law.families.reference_area / factor
        }  # fmt: skip
        stage.pointwise("Pressure", follower_pressure(*self._key), sheet.size, **arguments, external=out)
        run_once(context.device, stage)
        cells = cells_of(sheet.positions, np.asarray(sheet.triangles))
        weights = pressed_weights(sheet, cells) if sheet.frames is None else np.ones(sheet.size)
        places = sheet.positions + to_host(context.state.displacement).astype(float)
        exact = pressed_areas(places, cells, weights)
        forces = (exact, to_host(out).astype(float) - exact)
        of_pieces = (np.column_stack([np.bincount(piece, force[:, c]) for c in range(3)]) for force in forces)
        edges, missed = (np.linalg.norm(each, axis=1) for each in of_pieces)
        return edges, missed

    def on_coarser(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the same pressure on a coarser lattice."""
        return FollowerPressure(self._value, self._schedule, context, law)


@dataclass(frozen=True)
class ValuesInTime(Part):
    """Multiplies the values by point of the material (`Material.by_point`) by a factor in time, such as a temperature.

    Their change does work that nothing counts, so there is no energy balance.

    Attributes:
        ramp: Pairs (time [s], factor).
    """

    ramp: Ramp
    unbalanced: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the factor on a device."""
        schedule = factor_schedule("ValuesInTime", self.ramp)
        if schedule is None:
            raise InputError("ValuesInTime.ramp = None: expected pairs (time, factor)")
        if law.point_values is None:
            raise InputError("loads: ValuesInTime: expected a material with values by point (`by_point`)")
        return ScaledValues(context, law, context.clock.register(schedule))


class ScaledValues(BuiltPart):
    """The values on a device."""

    label = "loads: ValuesInTime"

    def __init__(self, context: Context, law: BuiltLaw, schedule: int | None) -> None:
        assert law.point_values is not None
        self.context, self.values, self.schedule = context, law.point_values, schedule
        given = to_host(self.values)
        self.unit = context.array("unit_values", "ValuesInTime", context.types.real, given)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that sets the values when the schedules change."""
        if phase in (Phase.SCHEDULES, Phase.CLOCK):
            context = self.context
            stage.launch(
                "ValuesInTime", scaled_values(context.bits), context.sheet.size, unit=self.unit,
                factors=context.clock.scheduled, schedule=self.schedule, values=self.values,
            )  # fmt: skip
