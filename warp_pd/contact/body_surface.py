"""Contact of triangles of the sheet with a rigid body."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.cores import load_kernel
from ..device.launches import Stage, with_values
from ..interfaces import BuiltLaw
from ..kernels.contact import narrow_phase
from ..kernels.contact import surface_contact as kernels
from ..kernels.contact.body_motion import vec6d
from ..kernels.rupture import face_damage
from .block_list import BlockList
from .body_motion import BuiltMotion
from .body_shapes import BodyShape, in_frame

# Iterations per half step, and thickness of the layer around the segments of the body that triangles stay outside,
# divided by the smaller of body thickness and spacing; the layer is thicker than the error left by the iterations.
ITERATIONS, LAYER = 32, 0.02


class BodySurface:
    """Contact of triangles with one body; see kernels/contact/surface_contact.py.

    Attributes:
        changes: Velocity change of each point by the contact in a half step [m/s], (N,) vec3d.
        rubbing: The part of `changes` caused by friction [m/s], (N,) vec3d, or None.
        when: Arguments of launches that are skipped while no triangle is near.
        edged: Whether the body has edges without a radius.
    """

    def __init__(
        self, name: str, context: Context, law: BuiltLaw, shape: BodyShape, body: Any, motion: BuiltMotion, rubs: bool,
        partly: bool,
    ) -> None:  # fmt: skip
        self.name, self.context, self._law, self._shape, self._body = name, context, law, shape, body
        sheet = context.sheet
        self._layer = LAYER * min(sheet.spacing, shape.thinnest())
        self._segments, self._tree = segments_on_device(shape, self._layer, context.device)
        self.edged = self._segments.core == 0.0
        corners = np.asarray(sheet.triangles, np.int32)
        order = np.argsort(corners.ravel(), kind="stable").astype(np.int32)
        begins = np.searchsorted(corners.ravel()[order], np.arange(sheet.size + 1)).astype(np.int32)
        free = motion.free_inertia()
        made = self._kernels = kernels.surface_contact(
            context.options, partly, shape.distance, free is not None, rubs, sheet.frames is not None,
            law.intact is not None,
        )  # fmt: skip

        def table(what: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(f"{name}_{what}", name, dtype, values, per="table")

        def room(what: str, dtype: Any, per: str, size: int) -> Any:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self._triangles = table("triangles", wp.vec3i, corners)
        faces = self._faces = len(corners)
        self._intact = None if law.intact is None else room("pressing_faces", wp.uint8, "face", faces)
        self._any = room("any_near", wp.int32, "once", 1)
        self.when = {"only_if": self._any, "grouped": True}
        size = kernels.SLOTS * faces
        self._found = {
            "near": room("near", wp.uint8, "face", faces),
            "weights": room("weights", wp.vec4d, "table", size),
            "normals": room("normals", wp.vec3d, "table", size),
            "spots": room("spots", wp.vec3d, "table", size),
        }
        self._near = BlockList(f"{name}_near_faces", name, self._found["near"], context)
        sides = {"begins": table("begins", wp.int32, begins), "sides": table("sides", wp.int32, order)}
        self._constraints = with_values(made.constraints(), {**self._found, **sides})
        self._earlier = room("earlier", wp.float64, "table", size)
        self._gaps = room("gaps", wp.float64, "table", size)
        # An iteration reads one of these and writes the other.
        kinds = {"pushes": wp.vec4d, "pressed": wp.uint8}
        self._given = [
            {what: room(what + later, dtype, "table", size) for what, dtype in kinds.items()}
            for later in ("", "_after")
        ]  # fmt: skip
        self.changes = room("changes_by_faces", wp.vec3d, "point", sheet.size)
        self.rubbing = room("rubbing_by_faces", wp.vec3d, "point", sheet.size) if rubs else None
        self._yielded: dict[str, Any] = {"changes": None, "splits": None}
        self._sums: dict[str, Any] = {}
        self._numbers: dict[str, Any] = {}
        if free is not None:
            mass, inertia = free
            near = self._near
            self._sums = {
                "counts": near.counts,
                "arrived": near.arrived,
                "sums": near.room("reactions", kernels.Reaction),
            }
            self._yielded = {"changes": room("yielded", vec6d, "once", 1)}
            self._yielded["splits"] = room("splits", wp.float64, "once", 1)
            inverse = np.linalg.inv(inertia)
            self._numbers = {
                "inverse_mass": 1.0 / mass, "inverse_inertia": wp.mat33d(*inverse.ravel().tolist()),
                "easiest_turn": float(np.linalg.eigvalsh(inverse)[-1]),
            }  # fmt: skip

    def check_apart(self, name: str, place: np.ndarray, rotation: np.ndarray) -> None:
        """Check that the body starts further from the sheet than the layer, and that it crosses no triangle."""
        context, sheet = self.context, self.context.sheet
        corners = in_frame(sheet.positions + context.initial_displacement, place, rotation)[sheet.triangles]
        found = wp.empty(self._faces, dtype=wp.float64, device=context.device)
        given: Any = wp.array(np.ascontiguousarray(corners, np.float64), dtype=wp.vec3d, device=context.device)
        kernel = narrow_phase.clearances(self._shape.distance)
        load_kernel(kernel, context.device)
        wp.launch(
            kernel, self._faces, device=context.device, outputs=[found],
            inputs=[given, 2.0 * self._segments.radius, self._segments, self._body, 0],
        )  # fmt: skip
        gap = found.numpy() - self._segments.radius + self._layer
        if gap.min() < self._layer:
            raise InputError(
                f"{name}: surface = True: expected a body at least {self._layer:.3g} m from the sheet at the start; "
                f"triangle {int(gap.argmin())} is {max(float(gap.min()), 0.0):.3g} m away"
            )

    def add(self, stage: Stage, at_end: bool, **body: Any) -> None:
        """Add the launches that fill `changes` and `rubbing`; `body`: values of the kernel struct for the body."""
        name, context, made, state = self.name, self.context, self._kernels, self.context.state
        if self._intact is not None and not at_end:
            stage.launch(
                name, face_damage(context.layout), self._faces, family=self._law.struct,
                triangles=self._triangles, intact_faces=self._intact,
            )  # fmt: skip
        values = {
            "mass": state.mass, "held_mask": state.held_mask, "triangles": self._triangles, "step": state.step,
            "damping": state.damping, "intact_faces": self._intact, "displacement": state.displacement,
            "velocity": state.velocity, "segments": self._segments, "body": self._body, **self._numbers, **body,
        }  # fmt: skip
        half: dict[str, Any] = {"a": with_values(made.struct(), values), "at_end": int(at_end)}
        constraints = {"c": self._constraints}
        before, after = self._given
        near, found = self._near, {**self._found, "any_near": self._any, "earlier": self._earlier, "gaps": self._gaps}
        lists = {"entries": near.entries, "listed": near.listed}
        stage.launch(name, made.mark, self._faces, near=found["near"], **half)
        near.add(stage)
        near.launch(stage, made.find, **found, **lists, **before, **half)
        for iteration in range(1 + ITERATIONS):
            # The first iteration only finds which triangles press; the last one has no momentum.
            momentum = max(iteration - 1, 0) / (iteration + 2) if iteration < ITERATIONS else 0.0
            near.launch(
                stage, made.press, momentum=momentum, earlier=self._earlier, **self._yielded,
                pushes_after=after["pushes"], pressed_after=after["pressed"], **lists, **before, **half, **constraints,
                **self.when,
            )  # fmt: skip
            before, after = after, before
            if self._sums:
                near.launch(
                    stage, made.react, **lists, **before, **half, **constraints, **self._sums, **self._yielded,
                    **self.when,
                )  # fmt: skip
        if self._sums:
            moved = {name: body[name] for name in ("place", "rotation", "motion")}
            stage.launch(
                name, made.move, 1, at_end=int(at_end), changes=self._yielded["changes"], step=state.step, **moved,
                **self.when,
            )  # fmt: skip
        near.launch(
            stage, made.spread, a=half["a"], changes=self.changes, rubbed=self.rubbing, **lists, **before,
            **constraints, **self.when,
        )  # fmt: skip

    def add_end(self, stage: Stage) -> None:
        """Add the launch that resets the flag of `when`; call it after all launches that use `when`."""
        stage.launch(
            self.name, self._kernels.clear, 1, any_near=self._any, changes=self._yielded["changes"], **self.when
        )


def segments_on_device(shape: BodyShape, layer: float, device: wp.Device) -> tuple[Any, wp.Bvh]:
    """Segments of a body for the kernels, and their Warp tree, which must stay alive with them."""
    found = shape.segments()
    assert found is not None
    vertices, pairs, radius = found
    # Each vertex belongs to the first segment that has it.
    first = np.unique(pairs.ravel(), return_index=True)[1]
    own = np.isin(np.arange(pairs.size), first).reshape(-1, 2) @ [1, 2]
    ends, rounding = vertices[pairs], 1e-6 * np.abs(vertices).max(initial=0.0)
    boxes: list[Any] = [
        wp.array(corner.astype(np.float32), dtype=wp.vec3, device=device)
        for corner in (ends.min(axis=1) - rounding, ends.max(axis=1) + rounding)
    ]
    made: Any = narrow_phase.Segments()
    made.vertices = wp.array(vertices, dtype=wp.vec3d, device=device)
    made.ends = wp.array(np.column_stack([pairs, own]).astype(np.int32), dtype=wp.vec3i, device=device)
    tree = wp.Bvh(*boxes)
    made.tree, made.core, made.radius = tree.id, radius, radius + layer
    made.size = float(np.linalg.norm(vertices, axis=1).max(initial=0.0))
    return made, tree
