"""Contact of the triangles of a sheet with each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from scipy.spatial import cKDTree

from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..geometry.topology import directed_edges, undirected
from ..interfaces import BuiltLaw
from ..interfaces.context import Context
from ..kernels import sheet_contact as kernels
from ..kernels.damage import face_damage
from ..kernels.face_tree import FaceTree, merge_boxes

OWNER = "SelfContact"
# Skin of the boxes in spacings; rounds of solution, iterations of each, and rounds of the fail-safe.
SKIN, ROUNDS, ITERATIONS, CHECKS = 0.2, 3, 24, 8
# Unit of the sums of impulses over mass, spacing and 1 / step: a point may be moved by 8000 spacings in a step.
UNIT = 2.0**-50


class SheetSurface:
    """Contact of triangles of one sheet; see kernels/sheet_contact.py.

    Attributes:
        lost, rubbed: Energy lost at each point in impacts and by friction [J], (N,) float64, or None.
    """

    def __init__(self, context: Context, law: BuiltLaw, kept: float, friction: float) -> None:
        self.context, self._law = context, law
        sheet, f = context.sheet, context.features
        triangles = np.asarray(sheet.triangles, np.int32)
        points, faces, rubs = sheet.size, len(triangles), friction > 0.0
        made = self._kernels = kernels.sheet_contact(
            context.bits, sheet.frames is not None, f.held, f.loaded, f.damped and f.half_steps, f.tracked,
            law.intact is not None, rubs,
        )  # fmt: skip
        tables = _tables(triangles, points)
        sides = len(tables["sides"])
        slots = kernels.SLOTS * (points + sides)

        def room(what: str, dtype: Any, shape: Any, per: str = "table", **kind: Any) -> Array:
            return context.array(f"surface_{what}", OWNER, dtype, shape=shape, per=per, **kind)

        def table(what: str, dtype: Any, values: np.ndarray) -> Array:
            return context.array(f"surface_{what}", OWNER, dtype, values, per="table")

        pieces = np.zeros(points, np.int32) if sheet.pieces is None else sheet.pieces
        leaves = 1 << (max(faces, points, 2) - 1).bit_length()
        tree: Any = FaceTree()
        tree.leaves = leaves
        tree.order = table("order", wp.int32, np.pad(_order(sheet, pieces), (0, leaves - faces), constant_values=-1))
        self._boxes: dict[str, Any] = {what: room(what, wp.vec3, 2 * leaves) for what in ("lower", "upper")}
        with_values(tree, self._boxes)
        dtypes = {"sides": wp.vec4i, "across": wp.vec3i, "owned": wp.int32, "of_face": wp.vec3i, "begins": wp.int32}
        self._triangles = table("triangles", wp.vec3i, triangles)
        self._near = room("near", wp.uint8, points + sides)
        self._intact = self._seen = None
        if law.intact is not None:
            self._intact, self._seen = room("intact", wp.uint8, faces), room("seen", wp.uint8, faces)
        places = sheet.points if sheet.frames is None else sheet.positions
        self._points: dict[str, Any] = {
            "given": room("given", wp.vec3d, points, "point"),
            "impulse": room("impulse", wp.vec3d, points, "point"),
            "dragged": room("dragged", wp.vec3d, points, "point") if rubs else None,
            "pressing": room("pressing", wp.int32, points, "point"),
        }
        self._sums = room("sums", wp.int64, (points, 7), "point")
        self._stays, self._halts = (room(what, wp.uint8, points, "point") for what in ("stays", "halts"))
        real = context.types
        self._surface = with_values(made.Surface(), {
            **{name: table(name, dtype, tables[name]) for name, dtype in dtypes.items()},
            "faces": table("faces", wp.int32, tables["faces"]),
            "reference": table("reference", real.vec2 if sheet.frames is None else real.vec3, places),
            "piece": table("pieces", wp.int32, pieces), "given": self._points["given"], "stays": self._stays,
            "triangles": self._triangles, "intact": self._intact, "near": self._near, "tree": tree, "kept": kept,
            "skin": SKIN * sheet.spacing, "friction": friction,
            "unit": UNIT * sheet.spacing**3 * float(np.max(sheet.thickness * sheet.density)),
        })  # fmt: skip
        pairs: dict[str, Any] = {
            "points": wp.vec4i, "weights": wp.vec4d, "normals": wp.vec3d, "rooms": wp.float64,
            "others": wp.int32, "whens": wp.float64,
        }  # fmt: skip
        self._pairs: dict[str, Any] = {name: room(name, dtype, slots) for name, dtype in pairs.items()}
        self._pairs["count"] = room("count", wp.int32, points + sides)
        self._constraints = with_values(made.Pairs(), self._pairs)
        impulses = {"pushes": wp.vec4d, "turns": wp.vec3d, "pressed": wp.uint8, "earlier": wp.float64}
        self._impulses: dict[str, Any] = {name: room(name, dtype, slots) for name, dtype in impulses.items()}
        self._listed_at = room("listed_at", wp.vec3d, points)
        fresh = np.zeros(kernels.ROUND + ROUNDS + CHECKS, np.int32)
        fresh[kernels.STALE] = 1
        self.status = context.array("surface_status", OWNER, wp.int32, fresh, per="once")
        self._crossed = room("crossed", wp.int64, 1, "once")
        self.lost = self.rubbed = None
        if f.tracked:
            self.lost = room("lost", wp.float64, points, "point", restart=True)
            self.rubbed = room("rubbed", wp.float64, points, "point", restart=True) if rubs else None
        self._sizes = points, faces, sides, leaves

    def problem(self) -> str:
        """What is wrong, or an empty string."""
        crossed = int(self._crossed.numpy()[0])
        if crossed:
            one, other = divmod(crossed - 1, self._sizes[1])
            return f"triangles {one} and {other} cross at the start: expected a sheet that does not cross itself"
        if self.status.numpy()[kernels.PASSED]:
            return (
                "triangles would pass through each other: expected a smaller step, or no prescribed motion through the "
                "sheet"
            )
        return ""

    def _flag(self, index: int) -> dict[str, Any]:
        return {"only_if": self.status[index : index + 1], "grouped": True}

    def add_start(self, stage: Stage) -> None:
        """Add the launches that look for triangles that cross."""
        self._bind()
        self._add_boxes(stage, {})
        stage.launch(OWNER, self._kernels.cross, self._sizes[2], a=self._surface, crossed=self._crossed)

    def add(self, stage: Stage) -> None:
        """Add the launches of a step, after the drift."""
        self._bind()
        context, made, state, a = self.context, self._kernels, self.context.state, self._surface
        points, faces, sides, _ = self._sizes
        entities = points + sides
        if self._intact is not None:
            stage.launch(
                OWNER, face_damage(context.layout), faces, family=self._law.struct, intact=self._law.intact,
                triangles=self._triangles, intact_faces=self._intact,
            )  # fmt: skip
            stage.launch(OWNER, made.watch, faces, intact=self._intact, seen=self._seen, status=self.status)
        needed: dict[str, Any] = {}
        both: dict[str, Any] = {"a": a, "c": self._constraints}
        last = {name: self._impulses[name] for name in ("pushes", "turns", "pressed")}
        # Warp's atomics are none between the threads of a CPU.
        threads = entities if context.device.is_cuda else 1
        for number in range(ROUNDS):
            self._add_boxes(stage, needed)
            stage.launch(
                OWNER, made.find, entities, a=a, number=number, **self._pairs, **self._impulses, status=self.status,
                **(needed or self._flag(kernels.CLOSE)),
            )  # fmt: skip
            needed = self._flag(kernels.ROUND + number)
            for iteration in range(1 + ITERATIONS):
                momentum = max(iteration - 1, 0) / (iteration + 2) if iteration < ITERATIONS else 0.0
                stage.launch(
                    OWNER, made.press, entities, **both, pressing=self._points["pressing"], momentum=momentum,
                    **self._impulses, **needed,
                )  # fmt: skip
                stage.launch(OWNER, made.spread, threads, **both, **last, stride=threads, sums=self._sums, **needed)
                stage.launch(
                    OWNER, made.settle, points, a=a, sums=self._sums, **self._points, **needed
                )
        self._add_boxes(stage, needed)
        # With pairs in the lists, or without, sheets that are close may have come too near.
        needed = self._flag(kernels.CLOSE)
        for number in range(CHECKS):
            alarm = kernels.PASSED if number + 1 == CHECKS else kernels.ROUND + ROUNDS + number
            stage.launch(OWNER, made.check, entities, a=a, number=alarm, halts=self._halts, status=self.status, **needed)
            needed = self._flag(alarm)
            stage.launch(OWNER, made.stay, points, halts=self._halts, stays=self._stays, **needed)
        stage.pointwise(
            OWNER, made.take, points, mass=state.mass, held_mask=state.held_mask, step=state.step,
            damping=state.damping, force=state.force, external=state.external, displacement=state.displacement,
            velocity=state.velocity, stays=self._stays, work=state.work, dissipated=state.dissipated, lost=self.lost,
            rubbed=self.rubbed, **self._points, **self._flag(kernels.CLOSE),
        )  # fmt: skip
        self._add_clear(stage, kernels.ROUND, ROUNDS + CHECKS)

    def _bind(self) -> None:
        """Enter the arrays of the state, which is made after the parts."""
        names = ("mass", "held_mask", "displacement", "velocity", "step")
        with_values(self._surface, {name: getattr(self.context.state, name) for name in names})

    def _add_boxes(self, stage: Stage, needed: dict[str, Any]) -> None:
        """Add the launches that make boxes anew if points have left them."""
        made, a = self._kernels, self._surface
        points, _, sides, leaves = self._sizes
        stage.launch(OWNER, made.look, points, a=a, listed_at=self._listed_at, status=self.status, **needed)
        stale = self._flag(kernels.STALE)
        stage.launch(OWNER, made.bound, leaves, a=a, listed_at=self._listed_at, **self._boxes, **stale)
        for level in reversed(range(leaves.bit_length() - 1)):
            stage.launch(OWNER, merge_boxes, 1 << level, begin=1 << level, **self._boxes, **stale)
        self._add_clear(stage, kernels.CLOSE, **stale)
        stage.launch(OWNER, made.mark, points + sides, a=a, near=self._near, status=self.status, **stale)
        self._add_clear(stage, kernels.STALE, **stale)

    def _add_clear(self, stage: Stage, start: int, size: int = 1, **needed: Any) -> None:
        stage.launch(OWNER, self._kernels.clear, 1, start=start, end=start + size, status=self.status, **needed)


def _order(sheet: Any, pieces: np.ndarray) -> np.ndarray:
    """Triangles in an order that keeps neighbours of a piece together, (F,) int32."""
    triangles = sheet.triangles
    apart = 10.0 * np.ptp(sheet.positions, axis=0).max() * pieces[triangles[:, 0]]
    centres = np.column_stack([sheet.positions[triangles].mean(axis=1), apart])
    return np.asarray(cKDTree(centres, leafsize=1).indices, np.int32)


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
    owned = (sides[of_face, 2] == np.arange(faces)[:, None]) @ [1, 2, 4]
    order = np.argsort(triangles.ravel(), kind="stable")
    begins = np.searchsorted(triangles.ravel()[order], np.arange(points + 1))
    found = {
        "sides": sides, "across": across, "owned": owned, "of_face": of_face, "begins": begins, "faces": order // 3,
    }  # fmt: skip
    return {name: np.ascontiguousarray(values, np.int32) for name, values in found.items()}
