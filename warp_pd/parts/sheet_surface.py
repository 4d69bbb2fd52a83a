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
from ..kernels.face_tree import LEVELS, FaceTree, tree_kernels

OWNER = "SelfContact"
# Skin of the boxes in spacings; rounds of solution, iterations of each, and rounds of the fail-safe.
SKIN, ROUNDS, ITERATIONS, CHECKS = 0.2, 3, 24, 8


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
        entities, slots = points + faces + sides, kernels.SLOTS * (points + faces + sides)

        def room(what: str, dtype: Any, size: int, per: str = "table", **kind: Any) -> Array:
            return context.array(f"surface_{what}", OWNER, dtype, shape=size, per=per, **kind)

        real = context.types
        pieces = np.zeros(points, np.int32) if sheet.pieces is None else sheet.pieces
        leaves = 1 << (max(faces, points, 2) - 1).bit_length()
        tree: Any = FaceTree()
        tree.leaves = leaves
        tree.order = context.array("surface_order", OWNER, wp.int32, _order(sheet, pieces), per="table")
        self._boxes: dict[str, Any] = {what: room(what, wp.vec3, 2 * leaves) for what in ("lower", "upper")}
        self._spheres = room("spheres", wp.vec4, faces)
        with_values(tree, {**self._boxes, "spheres": self._spheres})
        dtypes = {
            "sides": wp.vec4i, "across": wp.vec3i, "owned": wp.int32, "of_face": wp.vec3i, "begins": wp.int32,
            "entities": wp.int32,
        }  # fmt: skip
        self._triangles = context.array("surface_triangles", OWNER, wp.vec3i, triangles, per="table")
        self._given = room("given", wp.vec3d, points, "point")
        self._stays = room("stays", wp.uint8, points, "point")
        self._close = room("close", wp.uint8, faces)
        self._intact = self._seen = None
        if law.intact is not None:
            self._intact, self._seen = room("intact", wp.uint8, faces), room("seen", wp.uint8, faces)
        values: dict[str, Any] = {
            name: context.array(f"surface_{name}", OWNER, dtype, tables[name], per="table")
            for name, dtype in dtypes.items()
        }
        values |= {
            "reference": context.array(
                "surface_reference", OWNER, real.vec2 if sheet.frames is None else real.vec3, sheet.points
            ),
            "piece": context.array("surface_pieces", OWNER, wp.int32, pieces),
            "given": self._given, "stays": self._stays,
            "triangles": self._triangles, "intact": self._intact, "close": self._close, "tree": tree, "kept": kept,
            "skin": SKIN * sheet.spacing, "friction": friction,
        }  # fmt: skip
        self._surface = with_values(made.Surface(), values)
        pairs: dict[str, Any] = {
            "points": wp.vec4i, "weights": wp.vec4d, "normals": wp.vec3d, "rooms": wp.float64,
            "others": wp.int32, "whens": wp.float64,
        }  # fmt: skip
        self._pairs: dict[str, Any] = {name: room(name, dtype, slots) for name, dtype in pairs.items()}
        self._pairs["count"] = room("count", wp.int32, entities)
        self._constraints = with_values(made.Pairs(), self._pairs)
        impulses = {"pushes": wp.vec4d, "pressed": wp.uint8, "earlier": wp.float64}
        self._impulses: dict[str, Any] = {name: room(name, dtype, slots) for name, dtype in impulses.items()}
        self._points: dict[str, Any] = {
            "pressing": room("pressing", wp.int32, points, "point"),
            "impulse": room("impulse", wp.vec3d, points, "point"),
            "dragged": room("dragged", wp.vec3d, points, "point") if rubs else None,
        }
        self._left_out = room("left_out", wp.float64, entities)
        self._passes = room("passes", wp.uint8, entities)
        self._listed_at = room("listed_at", wp.vec3d, points)
        fresh = np.zeros(kernels.ROUND + ROUNDS + CHECKS, np.int32)
        fresh[kernels.STALE] = 1
        self.status = context.array("surface_status", OWNER, wp.int32, fresh, per="once")
        self.lost = self.rubbed = None
        if f.tracked:
            self.lost = room("lost", wp.float64, points, "point", restart=True)
            self.rubbed = room("rubbed", wp.float64, points, "point", restart=True) if rubs else None
        self._sizes = points, faces, entities, leaves

    def _flag(self, index: int) -> dict[str, Any]:
        return {"only_if": self.status[index : index + 1], "grouped": True}

    def add(self, stage: Stage) -> None:
        """Add all launches, after the drift."""
        context, made, state = self.context, self._kernels, self.context.state
        names = ("mass", "held_mask", "displacement", "velocity", "step")
        a = with_values(self._surface, {name: getattr(state, name) for name in names})
        points, faces, entities, _ = self._sizes
        if self._intact is not None:
            stage.launch(
                OWNER, face_damage(context.layout), faces, family=self._law.struct, intact=self._law.intact,
                triangles=self._triangles, intact_faces=self._intact,
            )  # fmt: skip
            stage.launch(OWNER, made.watch, faces, intact=self._intact, seen=self._seen, status=self.status)
        needed: dict[str, Any] = {}
        impulses, last = self._impulses, {name: self._impulses[name] for name in ("pushes", "pressed")}
        for number in range(ROUNDS):
            self._add_boxes(stage, needed)
            stage.launch(
                OWNER, made.find, entities, a=a, number=number, **self._pairs, **impulses, status=self.status,
                left_out=self._left_out, **(needed or self._flag(kernels.CLOSE)),
            )  # fmt: skip
            needed = self._flag(kernels.ROUND + number)
            stage.launch(OWNER, made.agree, entities, left_out=self._left_out, **self._pairs, **needed)
            for iteration in range(1 + ITERATIONS):
                momentum = max(iteration - 1, 0) / (iteration + 2) if iteration < ITERATIONS else 0.0
                stage.launch(
                    OWNER, made.press, entities, a=a, c=self._constraints, pressing=self._points["pressing"],
                    momentum=momentum, **impulses, **needed,
                )  # fmt: skip
                stage.launch(
                    OWNER, made.gather, points, a=a, c=self._constraints, **last, given=self._given, **self._points,
                    **needed,
                )  # fmt: skip
        self._add_boxes(stage, needed)
        # With pairs in the lists, or without, sheets that are close may have come too near.
        needed = self._flag(kernels.CLOSE)
        for number in range(CHECKS):
            alarm = kernels.PASSED if number + 1 == CHECKS else kernels.ROUND + ROUNDS + number
            stage.launch(
                OWNER, made.check, entities, a=a, number=alarm, passes=self._passes, status=self.status, **needed
            )
            needed = self._flag(alarm)
            stage.launch(OWNER, made.stay, points, a=a, passes=self._passes, stays=self._stays, **needed)
        stage.pointwise(
            OWNER, made.take, points, mass=state.mass, held_mask=state.held_mask, step=state.step,
            damping=state.damping, force=state.force, external=state.external, displacement=state.displacement,
            velocity=state.velocity, given=self._given, stays=self._stays, work=state.work,
            dissipated=state.dissipated, lost=self.lost, rubbed=self.rubbed, **self._points,
            **self._flag(kernels.CLOSE),
        )  # fmt: skip
        self._add_clear(stage, kernels.ROUND, ROUNDS + CHECKS)

    def _add_boxes(self, stage: Stage, needed: dict[str, Any]) -> None:
        """Add the launches that make boxes anew if points have left them."""
        made, a = self._kernels, self._surface
        points, faces, _, leaves = self._sizes
        stage.launch(OWNER, made.look, points, a=a, listed_at=self._listed_at, status=self.status, **needed)
        stale = self._flag(kernels.STALE)
        stage.launch(
            OWNER, made.bound, leaves, a=a, listed_at=self._listed_at, **self._boxes, spheres=self._spheres, **stale
        )
        depth = leaves.bit_length() - 1
        while depth:
            levels = min(LEVELS, depth)
            depth -= levels
            stage.launch(
                OWNER, tree_kernels().merge, 1 << depth, begin=1 << depth, levels=levels, **self._boxes, **stale
            )
        self._add_clear(stage, kernels.CLOSE, **stale)
        stage.launch(OWNER, made.mark, faces, a=a, close=self._close, status=self.status, **stale)
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
    """Sides, neighbours, owners and entities of points, as in the struct `Surface`."""
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
    owned = np.zeros(faces, np.int64)
    corner = np.unique(triangles.ravel(), return_index=True)[1]
    np.add.at(owned, corner // 3, 1 << (corner % 3))
    side = np.unique(of_face.ravel(), return_index=True)[1]
    np.add.at(owned, side // 3, 8 << (side % 3))
    point = np.concatenate([triangles.ravel(), sides[:, :2].ravel()])
    entity = np.concatenate([np.repeat(np.arange(faces), 3), np.repeat(np.arange(len(sides)) + faces, 2)]) + points
    order = np.argsort(point, kind="stable")
    begins = np.searchsorted(point[order], np.arange(points + 1))
    found = {
        "sides": sides, "across": across, "owned": owned, "of_face": of_face, "begins": begins,
        "entities": entity[order],
    }  # fmt: skip
    return {name: np.ascontiguousarray(table, np.int32) for name, table in found.items()}
