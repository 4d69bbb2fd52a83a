"""Contact of triangles of the sheet with a rigid body."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.launches import Stage, with_values
from ..interfaces import BuiltLaw
from ..interfaces.context import Context
from ..kernels.damage import face_damage
from ..kernels.surface_contact import distances_of_faces, surface_contact
from .body_shapes import BodyShape

# Iterations of a half step, and the layer around the body in which triangles are held away, over the smaller of its
# thickness and the spacing: more than iterations leave.
ITERATIONS, LAYER = 32, 0.02


class BodySurface:
    """Contact of triangles with one body; see kernels/surface_contact.py.

    Attributes:
        changes: Velocity change of each point by the contact in a half step [m/s], (N,) vec3d.
        rubbing: The part of `changes` caused by friction [m/s], (N,) vec3d, or None.
    """

    def __init__(self, name: str, context: Context, law: BuiltLaw, shape: BodyShape, rubs: bool) -> None:
        self.name, self.context, self._law = name, context, law
        sheet, f = context.sheet, context.features
        axis = shape.axis()
        assert axis is not None
        self._layer = LAYER * min(sheet.spacing, shape.thinnest())
        self._radius, self._half_length = axis[0] + self._layer, axis[1]
        corners = np.asarray(sheet.triangles, np.int32)
        order = np.argsort(corners.ravel(), kind="stable").astype(np.int32)
        begins = np.searchsorted(corners.ravel()[order], np.arange(sheet.size + 1)).astype(np.int32)

        def table(what: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(f"{name}_{what}", name, dtype, values, per="table")

        def room(what: str, dtype: Any, per: str, size: int) -> Any:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self._triangles = table("triangles", wp.vec3i, corners)
        self._begins, self._sides = table("begins", wp.int32, begins), table("sides", wp.int32, order)
        self._faces = len(corners)
        self._intact = None if law.intact is None else room("pressing_faces", wp.uint8, "face", self._faces)
        self._weights = room("weights", wp.vec4d, "face", self._faces)
        self._normals = room("normals", wp.vec4d, "face", self._faces)
        self._pushes = room("pushes", wp.vec4d, "face", self._faces)
        self._earlier = room("earlier", wp.float64, "face", self._faces)
        self._pressed = room("pressed", wp.uint8, "face", self._faces)
        self.changes = room("changes", wp.vec3d, "point", sheet.size)
        self.rubbing = room("rubbing", wp.vec3d, "point", sheet.size) if rubs else None
        self._counts = room("counts", wp.int32, "point", sheet.size)
        curved = sheet.frames is not None
        self._kernels = surface_contact(context.bits, rubs, curved, f.held, self._intact is not None)

    def check_apart(self, name: str, place: np.ndarray, rotation: np.ndarray) -> None:
        """Check that the body starts further from the sheet than the contact layer.

        Raises:
            InputError: with the nearest triangle.
        """
        context, sheet = self.context, self.context.sheet
        corners = (sheet.positions + context.initial_displacement - place)[sheet.triangles]
        found = wp.empty(self._faces, dtype=wp.float64, device=context.device)
        given: Any = wp.array(np.ascontiguousarray(corners, np.float64), dtype=wp.vec3d, device=context.device)
        turned: Any = wp.quatd(*rotation.tolist())
        along: Any = wp.vec3d(0.0, 0.0, self._half_length)
        axis = wp.quat_rotate(turned, along)
        wp.launch(distances_of_faces, self._faces, inputs=[given, axis, 0], outputs=[found], device=context.device)
        gap = found.numpy() - self._radius + self._layer
        if gap.min() < self._layer:
            raise InputError(
                f"{name}: surface = True: expected a body at least {self._layer:.3g} m from the sheet at the start; "
                f"triangle {int(gap.argmin())} is {gap.min():.3g} m away"
            )

    def add(self, stage: Stage, at_end: bool, **body: Any) -> None:
        """Add the launches that fill `changes` and `rubbing`; `body` has the body's members of the kernel struct."""
        name, context, made, state = self.name, self.context, self._kernels, self.context.state
        if self._intact is not None and not at_end:
            stage.launch(
                name, face_damage(context.layout), self._faces, family=self._law.struct, intact=self._law.intact,
                triangles=self._triangles, intact_faces=self._intact,
            )  # fmt: skip
        values = {
            "mass": state.mass, "held_mask": state.held_mask, "triangles": self._triangles, "step": state.step,
            "intact_faces": self._intact, "displacement": state.displacement, "velocity": state.velocity,
            "radius": self._radius, "half_length": self._half_length, **body,
        }  # fmt: skip
        shared = {"a": with_values(made.struct(), values), "weights": self._weights, "normals": self._normals}
        pushed = {"pushes": self._pushes, "pressed": self._pressed}
        spread = {
            "begins": self._begins, "sides": self._sides, "changes": self.changes, "rubbed": self.rubbing,
            "counts": self._counts,
        }  # fmt: skip
        size = context.sheet.size
        stage.launch(name, made.find, self._faces, at_end=int(at_end), earlier=self._earlier, **shared, **pushed)
        stage.launch(name, made.spread, size, **shared, **pushed, **spread)
        for iteration in range(1 + ITERATIONS):
            # The first iteration only tells which triangles press; the last one ends where it is.
            momentum = max(iteration - 1, 0) / (iteration + 2) if iteration < ITERATIONS else 0.0
            stage.launch(
                name, made.press, self._faces, at_end=int(at_end), changes=self.changes, counts=self._counts,
                momentum=momentum, earlier=self._earlier, **shared, **pushed,
            )  # fmt: skip
            stage.launch(name, made.spread, size, **shared, **pushed, **spread)
