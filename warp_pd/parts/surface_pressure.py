"""Pressure on the triangles of a sheet, on a device."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..geometry.surface import cells_at_points, cells_of, pressed_weights, pressure_matrix
from ..geometry.triangulation import numbers_of_ranges
from ..interfaces import BuiltLaw, BuiltLoad
from ..kernels.surface_pressure import CONSTANT, SCHEDULED, surface_pressure


class PressedSurface:
    """The triangles and rectangles of every point, and the launches of a pressure on them.

    Attributes:
        positions: Positions of the stress-free sheet about its middle [m], (N,) vec3d.
    """

    def __init__(
        self, owner: str, context: Context, law: BuiltLaw, cells: np.ndarray, weights: np.ndarray, source: str
    ) -> None:
        """Allocate the cells (`cells_of`) of the whole sheet around the points of this process.

        `weights` are those of `pressed_weights`, shape (N,); `source` is what multiplies the pressure
        (kernels/surface_pressure.py).
        """
        self.owner, self._context, self._law = owner, context, law
        whole = context.whole
        # Positions about the middle keep round-off small.
        middle = 0.5 * (whole.positions.min(axis=0) + whole.positions.max(axis=0))
        begins, corners = self._of_process(*cells_at_points(cells, whole.size))
        self.positions = context.array("positions", owner, wp.vec3d, context.sheet.positions - middle)
        even = float(weights[0]) if np.ptp(weights) == 0.0 else 0.0
        self._unit = (even or 1.0) / 12.0
        given = weights if context.partition is None else context.partition.rows(weights)
        self._table = {
            "begins": context.array("cells_begin", owner, wp.int32, begins, per="table"),
            "corners": context.array("cell_corners", owner, wp.vec3i, corners, per="table"),
            "positions": self.positions,
            "weights": None if even else context.array("weights", owner, context.types.real, given),
        }
        layout = context.layout
        torn = layout if law.intact is not None else None
        self._kernels = surface_pressure(context.bits, source, not even, torn, layout.softened)

    def _of_process(self, begins: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for the points of this process; its ghost points have no cells."""
        partition = self._context.partition
        if partition is None:
            return begins, corners
        own = partition.points[partition.owned]
        counts = np.zeros(len(partition.points), np.int64)
        counts[partition.owned] = begins[own + 1] - begins[own]
        _, wanted = numbers_of_ranges(begins[own], begins[own + 1])
        needed = corners[wanted].ravel()
        at, here = partition.here(needed)
        if len(at) != len(needed):
            raise InputError(
                f"loads: {self.owner}: triangles have sides beyond two horizons: expected shorter ones, or one process"
            )
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32), here.reshape(-1, 3)

    def _arguments(self, displacement: Array, pressure: float, source: Mapping[str, Any]) -> dict[str, Any]:
        found = dict.fromkeys(("enclosed", "factors", "schedule", "family"))
        if self._law.intact is not None:
            found["family"] = self._law.struct
        return {
            **found, **self._table, **source, "damage": self._law.damage, "displacement": displacement,
            "unit": self._unit * pressure,
        }  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, pressure: float, out: Array, **source: Any) -> None:
        """Add the stage that adds the force of a pressure [Pa], times its `source`, to `out`."""
        arguments = self._arguments(displacement, pressure, source)
        stage.pointwise(self.owner, self._kernels[0], self._context.sheet.size, **arguments, external=out)

    def add_tangent(
        self, stage: Stage, displacement: Array, direction: Array, pressure: float, out: Array, **source: Any
    ) -> None:
        """Add the launch that adds the derivative of this force along a direction to `out`."""
        force, tangent = self._kernels
        a = with_values(force.arguments(), self._arguments(displacement, pressure, source))
        stage.launch(self.owner, tangent, self._context.sheet.size, a=a, direction=direction, change=out)


class TrianglePressure(BuiltLoad):
    """Follower pressure on the triangles of a sheet, on a device."""

    follows_displacement = True
    coarsens = True

    def __init__(self, value: float, schedule: int | None, context: Context, law: BuiltLaw) -> None:
        """Allocate the triangles; a schedule, of that index on the clock, multiplies the pressure [Pa]."""
        self.label, self.context, self.law = "loads: Pressure", context, law
        self._value, self._schedule, whole = value, schedule, context.whole
        self._cells = cells_of(whole.positions, np.asarray(whole.triangles))
        self._weights = pressed_weights(whole, self._cells)
        source = CONSTANT if schedule is None else SCHEDULED
        self._surface = PressedSurface("Pressure", context, law, self._cells, self._weights, source)

    def _source(self) -> dict[str, Any]:
        """What multiplies the pressure."""
        return {} if self._schedule is None else {"factors": self.context.clock.scheduled, "schedule": self._schedule}

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the pointwise stage that adds the pressure's force."""
        self._surface.add_force(stage, displacement, self._value, out, **self._source())

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the launch that adds the derivative of the pressure's force along a direction."""
        self._surface.add_tangent(stage, displacement, direction, self._value, out, **self._source())
        return True

    def tangent_matrix(self, displacement: np.ndarray) -> Any:
        """Tangent matrix of a sheet without broken bonds, otherwise None."""
        if self.law.intact is not None:
            return None
        pressures = self.context.clock.factor(self._schedule) * self._value * self._weights
        return pressure_matrix(self.context.sheet.positions + displacement, self._cells, pressures)

    def on_coarser(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the same pressure on a coarser lattice."""
        return TrianglePressure(self._value, self._schedule, context, law)
