"""Layers of points outside a sheet that mirror its displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, numbers, point_indices
from ..device.clock import factor_schedule
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltPart, Constraint, Part
from ..kernels.papers.mirror import mirror
from ..step import Phase

OWNER = "Mirror"
IN_PLANE = 3


@dataclass(frozen=True, eq=False)
class Mirror(Part):
    """Points outside the sheet that move as the mirror images of points in it (HE eqs. 98, 99).

    In each step, u_f(t + dt) = 2 U*(t + dt) - u(t) for a component that the edge prescribes, and u_f(t + dt) = u(t) for
    one along an edge on rollers. Out of plane they stay. With `Relaxation` and `Explicit`; no energy balance.

    Attributes:
        points: Indices of the points outside, shape (P,).
        images: Indices of their mirror images, shape (P,).
        edge: U* at the end of the ramp, x and y, shape (P, 2) [m].
        mirrored: Whether a component is prescribed at the edge, x and y, bool, shape (P, 2).
        ramp: Pairs (time [s], factor on U*).
    """

    unbalanced: ClassVar[bool] = True

    points: Any
    images: Any
    edge: Any
    mirrored: Any
    ramp: Any = ((0.0, 0.0), (1.0, 1.0))

    def constraints(self, sheet: Sheet) -> list[Constraint]:
        """The in-plane components of the points outside.

        Raises:
            InputError: for an image that is no point of the sheet, or one outside itself, or arrays of other shapes.
        """
        points = point_indices("Mirror.points", self.points, sheet.size)
        images = point_indices("Mirror.images", np.unique(self.images), sheet.size)
        if len(points) != np.size(self.points) or np.shape(self.images) != np.shape(self.points):
            raise InputError(f"Mirror.images: expected one for each of {len(points)} different points outside")
        if np.isin(images, points).any():
            raise InputError("Mirror.images: expected points of the sheet, none of those outside")
        for name, values in (("edge", self.edge), ("mirrored", self.mirrored)):
            if np.shape(values) != (len(points), 2):
                raise InputError(f"Mirror.{name}: expected shape ({len(points)}, 2), got {np.shape(values)}")
        numbers("Mirror.edge", np.ravel(self.edge))
        return [Constraint(OWNER, points, IN_PLANE)]

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the layers on a device."""
        return BuiltMirror(self, context)


class BuiltMirror(BuiltPart):
    """The layers on a device."""

    label = f"loads: {OWNER}"

    def __init__(self, part: Mirror, context: Context) -> None:
        self.context, n, vec3 = context, context.sheet.size, context.types.vec3
        points, mirrored = np.asarray(part.points), np.asarray(part.mirrored, bool)
        images, edge, signs = np.full(n, -1, np.int32), np.zeros((n, 3)), np.zeros((n, 3))
        images[points] = part.images
        edge[points, :2] = np.where(mirrored, 2.0 * np.asarray(part.edge), 0.0)
        signs[points, :2] = np.where(mirrored, -1.0, 1.0)
        self._arrays: dict[str, Any] = {
            "images": context.array("mirror_images", OWNER, wp.int32, images),
            "twice_edge": context.array("mirror_edge", OWNER, vec3, edge),
            "signs": context.array("mirror_signs", OWNER, vec3, signs),
        }
        self._schedule = context.clock.register(factor_schedule(OWNER, part.ramp))

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch before the points drift, so that static solvers that take no such phase refuse the part."""
        if phase in (Phase.RIGID_DRIFT, Phase.SCHEDULES):
            context = self.context
            assert self._schedule is not None
            now = phase is Phase.SCHEDULES
            stage.launch(
                OWNER, mirror(context.bits), context.sheet.size, **self._arrays, factors=context.clock.scheduled,
                schedule=self._schedule if now else context.clock.soon(self._schedule),
                displacement=context.state.displacement,
            )  # fmt: skip
