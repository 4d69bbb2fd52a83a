"""Contact of the triangles of a sheet with each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..geometry.triangulation import directed_edges, undirected
from ..interfaces import BuiltContact, BuiltLaw, Columns
from ..kernels.contact import sheet_contact as kernels
from ..kernels.contact.distances import FaceTree, merge_boxes
from ..kernels.contact.sheet_pairs import Surface
from ..kernels.integrate import RIGID
from ..kernels.rupture import face_damage
from ..step import Phase
from .body_shapes import order_of_leaves

OWNER = "SelfContact"
# Skin of the boxes in spacings; rounds of solution, iterations of each, and rounds of the fail-safe.
SKIN, ROUNDS, ITERATIONS, CHECKS = 0.2, 3, 24, 8
# Distance that triangles keep, in spacings.
DISTANCE = 0.1
# Unit of the sums of impulses, over mass and spacing: contact can move a point by 8000 spacings in a step.
UNIT = 2.0**-50


class SheetSurface(BuiltContact):
    """Contact of triangles of one sheet; see kernels/contact/sheet_contact.py.

    Attributes:
        lost, rubbed: Energy lost at each point in impacts and by friction [J], (N,) float64, or None.
    """

    label = "contact = SelfContact"

    def __init__(self, context: Context, law: BuiltLaw, distance: float | None, friction: float) -> None:
        """Allocate the tables and lists; `distance` is to be kept [m], by default a tenth of the spacing."""
        if (context.held & RIGID).any():
            raise InputError(
                "SelfContact.surface = True: expected False with rigid inclusions, which do not support it"
            )
        self.context, self._law = context, law
        sheet, f = context.sheet, context.options
        triangles = np.asarray(sheet.triangles, np.int32)
        points, faces, rubs = sheet.size, len(triangles), friction > 0.0
        tables = _tables(triangles, points)
        sides = len(tables["sides"])
        slots = kernels.SLOTS * (points + sides)
        leaves = 1 << (max(faces, points, 2) - 1).bit_length()

        def room(shape: Any, per: str = "table", **types: Any) -> dict[str, Any]:
            return {
                name: context.array(f"surface_{name}", OWNER, dtype, shape=shape, per=per)
                for name, dtype in types.items()
            }

        def table(name: str, dtype: Any, values: np.ndarray) -> Array:
            return context.array(f"surface_{name}", OWNER, dtype, values, per="table")

        pieces = np.zeros(points, np.int32) if sheet.pieces is None else sheet.pieces
        order = np.pad(_order(sheet, pieces), (0, leaves - faces), constant_values=-1)
        tree = {"leaves": leaves, "order": table("order", wp.int32, order)}
        tree |= room(2 * leaves, lower=wp.vec3, upper=wp.vec3)
        dtypes = {"sides": wp.vec4i, "across": wp.vec3i, "of_face": wp.vec3i, "begins": wp.int32, "faces": wp.int32}
        torn = {} if law.intact is None else room(faces, intact=wp.uint8, seen=wp.uint8)
        self._surface = with_values(Surface(), {
            **{name: table(name, dtype, tables[name]) for name, dtype in dtypes.items()},
            **room(points, "point", begin=wp.vec3d, drift=wp.vec3d, ease=wp.vec3d, given=wp.vec3d, stays=wp.uint8),
            **room(points, listed_at=wp.vec3d), **room(points + sides, near=wp.uint8), **torn,
            "reference": table("reference", wp.vec3d, sheet.positions), "piece": table("pieces", wp.int32, pieces),
            "triangles": table("triangles", wp.vec3i, triangles), "tree": with_values(FaceTree(), tree),
            "skin": SKIN * sheet.spacing, "kept": DISTANCE * sheet.spacing if distance is None else distance,
        })  # fmt: skip
        fresh = np.zeros(kernels.ROUND + ROUNDS + CHECKS, np.int32)
        fresh[kernels.STALE] = 1
        self.status = context.array("surface_status", OWNER, wp.int32, fresh, per="once")
        self._crossed = context.array("surface_crossed", OWNER, wp.int64, shape=1, per="once")
        self._pairs = with_values(kernels.Pairs(), {
            **room(
                slots, points=wp.vec4i, weights=wp.vec4d, normals=wp.vec3d, rooms=wp.float64, others=wp.int32,
                whens=wp.float64, pushes=wp.vec4d, earlier=wp.float64, pressed=wp.uint8,
            ),
            **room(points + sides, count=wp.int32), **room((points, 7), "point", sums=wp.int64),
            **room(points, "point", impulse=wp.vec3d, pressing=wp.float64, halts=wp.uint8),
            **({**room(slots, turns=wp.vec3d), **room(points, "point", dragged=wp.vec3d)} if rubs else {}),
            "friction": friction, "unit": UNIT * sheet.spacing**3 * float(np.max(sheet.thickness * sheet.density)),
        })  # fmt: skip
        self._take = kernels.take_impulses(context.options, rubs)
        self.lost = self.rubbed = None
        if f.tracked:
            self.lost = context.array("surface_lost", OWNER, wp.float64, shape=points, restart=True)
            if rubs:
                self.rubbed = context.array("surface_rubbed", OWNER, wp.float64, shape=points, restart=True)
        self._sizes = points, faces, sides, leaves

    def columns(self) -> Columns:
        """Energy lost in impacts and by friction."""
        found = {"contact": self.lost, "sheet_friction": self.rubbed}
        return Columns(lost={name: array for name, array in found.items() if array is not None})

    def end_frame(self) -> None:
        """Check that no triangles cross at the start or passed through each other."""
        crossed = int(self._crossed.numpy()[0])
        if crossed:
            one, other = divmod(crossed - 1, self._sizes[1])
            raise InputError(
                f"SelfContact.surface = True: triangles {one} and {other} cross at the start: expected a sheet that "
                "does not cross itself"
            )
        if self.status.numpy()[kernels.PASSED]:
            raise InputError(
                "SelfContact.surface = True: triangles would pass through each other: expected a smaller step, or no "
                "prescribed motion through the sheet"
            )

    def _flag(self, index: int) -> dict[str, Any]:
        return {"only_if": self.status[index : index + 1], "grouped": True}

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches after the drift, and those that look for triangles that cross at the start."""
        if phase is Phase.START:
            self._add_boxes(stage, {})
            stage.launch(OWNER, kernels.cross, self._sizes[2], a=self._surface, crossed=self._crossed)
        elif phase is Phase.PROJECT:
            self._add_step(stage)

    def _add_step(self, stage: Stage) -> None:
        context, state, a, c = self.context, self.context.state, self._surface, self._pairs
        points, faces, sides, _ = self._sizes
        entities, both = points + sides, {"a": a, "c": c}
        if self._law.intact is not None:
            stage.launch(
                OWNER, face_damage(context.layout), faces, family=self._law.struct,
                triangles=a.triangles, intact_faces=a.intact,
            )  # fmt: skip
            stage.launch(OWNER, kernels.watch, faces, a=a, status=self.status)
        needed: dict[str, Any] = {}
        # Warp's atomic operations are not atomic between CPU threads, so one thread does all.
        threads = entities if context.device.is_cuda else 1
        for number in range(ROUNDS):
            self._add_boxes(stage, needed)
            needed = needed or self._flag(kernels.CLOSE)
            stage.launch(OWNER, kernels.find, entities, **both, number=number, status=self.status, **needed)
            needed = self._flag(kernels.ROUND + number)
            for iteration in range(1 + ITERATIONS):
                momentum = max(iteration - 1, 0) / (iteration + 2) if iteration < ITERATIONS else 0.0
                stage.launch(OWNER, kernels.press, entities, **both, momentum=momentum, **needed)
                stage.launch(OWNER, kernels.spread, threads, **both, stride=threads, **needed)
                stage.launch(OWNER, kernels.settle, points, **both, **needed)
        self._add_boxes(stage, needed)
        # With pairs in the lists, or without, sheets that are close may have come too near.
        needed = self._flag(kernels.CLOSE)
        for number in range(CHECKS):
            alarm = kernels.PASSED if number + 1 == CHECKS else kernels.ROUND + ROUNDS + number
            stage.launch(OWNER, kernels.check, entities, **both, number=alarm, status=self.status, **needed)
            needed = self._flag(alarm)
            stage.launch(OWNER, kernels.stay, points, **both, **needed)
        stage.pointwise(
            OWNER, self._take, points, mass=state.mass, held_mask=state.held_mask, step=state.step,
            damping=state.damping, force=state.force, external=state.external, displacement=state.displacement,
            velocity=state.velocity, work=state.work, dissipated=state.dissipated, lost=self.lost, rubbed=self.rubbed,
            given=a.given, stays=a.stays, impulse=c.impulse, dragged=c.dragged, pressing=c.pressing,
            **self._flag(kernels.CLOSE),
        )  # fmt: skip
        self._add_clear(stage, kernels.ROUND, ROUNDS + CHECKS)

    def _add_boxes(self, stage: Stage, needed: dict[str, Any]) -> None:
        """Add the launches that make boxes anew if points have left them."""
        context, state, a = self.context, self.context.state, self._surface
        points, _, sides, leaves = self._sizes
        stage.launch(
            OWNER, kernels.enter(context.bits, context.options.held), points, a=a, displacement=state.displacement,
            velocity=state.velocity, mass=state.mass, held_mask=state.held_mask, step=state.step, status=self.status,
            **needed,
        )  # fmt: skip
        stale = self._flag(kernels.STALE)
        stage.launch(OWNER, kernels.bound, leaves, a=a, **stale)
        for level in reversed(range(leaves.bit_length() - 1)):
            stage.launch(OWNER, merge_boxes, 1 << level, begin=1 << level, tree=a.tree, **stale)
        self._add_clear(stage, kernels.CLOSE, **stale)
        stage.launch(OWNER, kernels.mark, points + sides, a=a, status=self.status, **stale)
        self._add_clear(stage, kernels.STALE, **stale)

    def _add_clear(self, stage: Stage, start: int, size: int = 1, **needed: Any) -> None:
        stage.launch(OWNER, kernels.clear, 1, start=start, end=start + size, status=self.status, **needed)


def _order(sheet: Any, pieces: np.ndarray) -> np.ndarray:
    """Triangles in an order that keeps neighbours of a piece together, (F,) int32."""
    triangles = sheet.triangles
    apart = 10.0 * np.ptp(sheet.positions, axis=0).max() * pieces[triangles[:, 0]]
    return order_of_leaves(np.column_stack([sheet.positions[triangles].mean(axis=1), apart]))


def _tables(triangles: np.ndarray, points: int) -> dict[str, np.ndarray]:
    """Sides, neighbours and triangles of points, as in the struct `Surface`."""
    faces = len(triangles)
    # Side k of `edges` joins corners k and k + 1, so it lies across from corner k + 2.
    edges = directed_edges(triangles)
    number = undirected(edges)
    _, first, uses = np.unique(number, return_index=True, return_counts=True)
    face = np.tile(np.arange(faces), 3)
    final = len(number) - 1 - np.unique(number[::-1], return_index=True)[1]
    sides = np.column_stack([edges[first], face[first], np.where(uses > 1, face[final], -1)])
    of_face = np.roll(number.reshape(3, faces).T, -1, axis=1)
    across = np.where(sides[of_face, 2] == np.arange(faces)[:, None], sides[of_face, 3], sides[of_face, 2])
    order = np.argsort(triangles.ravel(), kind="stable")
    begins = np.searchsorted(triangles.ravel()[order], np.arange(points + 1))
    found = {"sides": sides, "across": across, "of_face": of_face, "begins": begins, "faces": order // 3}
    return {name: np.ascontiguousarray(values, np.int32) for name, values in found.items()}
