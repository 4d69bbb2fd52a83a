"""Contact with rigid bodies of any shape, moving on a path or freely, with friction; the ball of the papers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, resolved
from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import BuiltContact, BuiltLaw, BuiltPart, Columns, Contact, History, StepLimit
from ..interfaces.frame import Body
from ..kernels.contact.body_contact import point_contact
from ..step import Phase
from .body_checks import MIN_DIAMETER, BodyChecks, ignoring
from .body_motion import UNBOUNDED, BodyMotion, jump_notes, origin_of
from .body_shapes import BodyShape, in_frame, on_device, signed_distances
from .held_push import HeldPush

if TYPE_CHECKING:
    from .body_surface import BodySurface

# Maximum motion of a body in a step, over the spacing or half its thickness: beyond it the body can pass points
# unnoticed. If bonds can break it is half of that, so that a bond opens in several steps.
MAX_TRAVEL = 0.25
# Depth over the spacing or the thickness at which a point counts as inside at the start.
TOUCHING = 1e-6
# Layer on the surface in which a point counts as touching [spacings]; it exceeds the rounding of positions.
SKIN = 1e-4
# Maximum motion in a step of a body with edges that triangles touch [spacings]; at twice that its edges cut in.
EDGE_TRAVEL = 0.05
# Least radius of edges that a sheet slides along as it would in nature [spacings].
ROUNDED = 0.25
# Distance by which a free body may yield in a step before any point may touch it [spacings].
SLACK = 0.05
# Distance from a body on a path within which points are looked at in every step [spacings].
MARGIN = 1.0


def partly_held(held: np.ndarray) -> bool:
    """Whether any point has held and free components."""
    return bool(((held != 0) & ~ignoring(held)).any())


@dataclass(frozen=True)
class BodySettings(Contact):
    """What a rigid body is; attributes as for `RigidBody`."""

    shape: BodyShape
    motion: BodyMotion
    friction: float = 0.0
    name: str = "body"
    surface: bool = False

    meets_others: ClassVar[bool] = False

    @property
    def title(self) -> str:
        """What messages call it."""
        return f"RigidBody {self.name!r}"


class BuiltBody(BuiltContact):
    """A body on a device.

    Attributes:
        motion: The built motion.
    """

    def __init__(self, part: BodySettings, context: Context, law: BuiltLaw) -> None:
        self.part, self.context, self.law, self.label = part, context, law, f"contact = {part.title}"
        self.meets_others, self.between_points = part.meets_others, not part.surface
        self.thickness = part.shape.thinnest() if part.shape.bounded else None
        name, sheet, types = part.name, context.sheet, context.types
        # A thinner body would pass between points.
        if part.shape.bounded and not part.surface:
            what = f"{part.title}: surface = {part.surface}: smallest extent"
            resolved(what, part.shape.thinnest(), sheet.spacing, MIN_DIAMETER)
        remembered = {}
        if part.shape.remembering is not None:
            starts = {"seen": (wp.vec4, 0.0), "faces": (wp.vec4i, -1), "apart": (wp.vec4, 0.0)}
            for what, (kind, start) in starts.items():
                values = np.full((sheet.size, 4), start)
                remembered[what] = context.array(f"{name}_{what}", name, kind, values)
        self._body, self._mesh = on_device(part.shape, context.device, sheet.spacing, remembered)
        self._rubs = part.friction > 0.0
        # Sum of impulses and unit of each column of a mean force or torque.
        of = (("force", "impulse", "N"), ("torque", "turn", "N m"))
        self._forces = {f"{name}_{what}_{c}": (f"{name}_{sum_}_{c}", unit) for what, sum_, unit in of for c in "xyz"}
        self.motion = part.motion.build(name, part.shape, context, float(part.friction))
        # A half space has no margin: a search in every step.
        bounded = part.shape.bounded
        self.motion.extent = (UNBOUNDED, 0.0, 0.0)
        if bounded:
            slack = SLACK if part.motion.free else 0.0
            self.motion.extent = (part.shape.radius(), MARGIN * sheet.spacing, slack * sheet.spacing)
        self._surface: BodySurface | None = None
        if part.surface:
            from .body_surface import BodySurface

            self._surface = BodySurface(
                name, context, law, part.shape, self._body, self.motion, self._rubs, partly_held(context.held)
            )
        context.require_resolved(part.title)
        self._check_apart()
        curved, origin = sheet.frames is not None, origin_of(context.whole.points)
        self._origin = wp.vec3d(*np.resize([*origin, 0.0], 3))
        self._reference = context.array(
            f"{name}_reference", name, types.vec3 if curved else types.vec2, sheet.points - origin
        )
        self._curved, tracked = curved, context.options.tracked
        self.impulse: Array | None = None
        self.turn: Array | None = None
        self.loss: Array | None = None
        self.rubbed: Array | None = None
        if self._rubs and tracked and not part.motion.free:
            self.rubbed = context.array(f"{name}_rubbed", name, wp.float64, shape=sheet.size, restart=True)
        if not part.motion.free:
            self.impulse, self.turn = (
                context.array(f"{name}_{what}", name, types.vec3, shape=sheet.size, restart=True)
                for what in ("impulse", "turn")
            )
            if tracked:
                self.loss = context.array(f"{name}_loss", name, wp.float64, shape=sheet.size, restart=True)
        self._held_push: HeldPush | None = None
        if partly_held(context.held) and not context.at_rest:
            self._held_push = HeldPush(name, self.label, context, self.impulse)

    def _check_apart(self) -> None:
        """Check that the body does not touch the sheet at the start."""
        part, context = self.part, self.context
        if self._surface is not None:
            self._surface.check_apart(part.title, *part.motion.pose(0.0))
        depth = -self._distances(context.sheet.positions + context.initial_displacement, *part.motion.pose(0.0))
        deepest = int(depth.argmax())
        if depth[deepest] > TOUCHING * min(part.shape.thinnest(), context.sheet.spacing):
            raise InputError(
                f"{part.title}: expected a body outside the sheet at the start; point "
                f"{context.number(deepest)} is {depth[deepest]:.3g} m inside it"
            )

    def _distances(self, points: np.ndarray, place: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Signed distances [m] of points from the body at a given position and unit quaternion."""
        arms = in_frame(points, place, rotation)
        return signed_distances(self.part.shape, arms, self.context.device, (self._body, self._mesh))[:, 3]

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the motion, and the pointwise stages of contact."""
        self.motion.add(phase, stage)
        if phase not in (Phase.PROJECT, Phase.SEPARATE):
            return
        context, part, motion = self.context, self.part, self.motion
        of = point_contact(
            context.options, partly_held(context.held), part.shape.distance, part.motion.free, self._rubs, self._curved,
            part.shape.remembering, motion.marks is not None,
        )  # fmt: skip
        at_end, values = phase is Phase.SEPARATE, self._arguments()
        if self._surface is not None:
            self._surface.add(
                stage, at_end, reference=self._reference, origin=self._origin, skin=SKIN * context.sheet.spacing,
                friction=float(part.friction), place=motion.place, rotation=motion.rotation, motion=motion.motion,
            )  # fmt: skip
        motion.add_contact(stage, of, at_end, values, None if self._surface is None else self._surface.when)
        if self._surface is not None:
            self._surface.add_end(stage)

    def checks(self, contacts: Sequence[BuiltContact]) -> Sequence[BuiltPart]:
        """The checks of all bodies, of the first body."""
        bodies = [contact for contact in contacts if isinstance(contact, BuiltBody)]
        return [BodyChecks(self.context, self.law, bodies)] if bodies[0] is self else []

    def complete(self, step: Stage) -> None:
        """Note whether other parts move points that the body may touch."""
        self.motion.complete(step)

    def _arguments(self) -> dict[str, Any]:
        context, state, part, motion = self.context, self.context.state, self.part, self.motion
        radius = part.shape.radius()
        return {
            "reference": self._reference, "origin": self._origin, "mass": state.mass,
            "held_mask": state.held_mask, "body": self._body,
            "radius": radius if np.isfinite(radius) else UNBOUNDED,
            "skin": SKIN * context.sheet.spacing, "margin": motion.extent[1],
            "slack": motion.extent[2], "marks": motion.marks, "friction": float(part.friction),
            "place": motion.place, "rotation": motion.rotation, "motion": motion.motion, "step": state.step,
            "damping": state.damping, "force": state.force, "external": state.external,
            "displacement": state.displacement, "velocity": state.velocity, "work": state.work,
            "dissipated": state.dissipated,
            "changes": None if self._surface is None else self._surface.changes,
            "rubbing": None if self._surface is None else self._surface.rubbing,
            "impulse": self.impulse, "turn": self.turn, "loss": self.loss, "rubbed": self.rubbed, **motion.found(),
        }  # fmt: skip

    def columns(self) -> Columns:
        """Force, torque, position and motion, contact losses, and the energies of a free body.

        Impulses given to the points are summed; for a free body the built motion has summed them.
        """
        found = {"impulse": self.impulse, "turn": self.turn, "loss": self.loss, "rubbed": self.rubbed}
        own = {f"{self.part.name}_{name}": array for name, array in found.items() if array is not None}
        return Columns(
            names=[*self._forces, *self.motion.columns(), *self._losses()],
            at_frame=self._row,
            between=self._mean_forces,
            units={column: unit for column, (_, unit) in self._forces.items()},
            sums=own | self.motion.sums(),
        )

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Mean force [N] and torque about the centre [N m] since the last frame; position and motion of the body."""
        row = self._mean_forces({}, totals, elapsed) | self.motion.columns()
        return row | {name: totals[name] for name in self._losses()}

    def _mean_forces(
        self, before: Mapping[str, float], totals: Mapping[str, float], elapsed: float
    ) -> dict[str, float]:
        """Mean forces and torques since the previous row."""
        return {
            column: -(totals[name] - before.get(name, 0.0)) / elapsed if elapsed > 0.0 else 0.0
            for column, (name, _) in self._forces.items()
        }

    def _losses(self) -> list[str]:
        lost = ["loss", "rubbed"] if self._rubs else ["loss"]
        return [f"{self.part.name}_{what}" for what in lost] if self.context.options.tracked else []

    def end_frame(self) -> None:
        """Set the sums of a frame to zero."""
        if self._held_push is not None:
            self._held_push.end_frame()
        for array in (self.impulse, self.turn):
            if array is not None:
                array.zero_()
        self.motion.end_frame()

    def step_limit(self) -> StepLimit | None:
        """Time in which the body moves a quarter (an eighth if bonds can break) of a spacing or of half its thickness.

        With friction, the initial speed of the sheet is added to that of the body: if friction stopped a point while
        its neighbours moved half a spacing, the sheet would be overstretched.
        """
        shape, sheet, context = self.part.shape, self.context.whole, self.context
        reach = float(np.linalg.norm(sheet.positions - self.part.motion.pose(0.0)[0], axis=1).max())
        speed = self.part.motion.speed(min(shape.radius(), reach))
        if self._rubs:
            thrown = float(np.linalg.norm(context.state.velocity.numpy().astype(np.float64), axis=1).max())
            speed -= context.communicator.minimum(-thrown)
        if speed <= 0.0:
            return None
        travel = 0.5 * MAX_TRAVEL if self.context.layout.breakable else MAX_TRAVEL
        furthest = travel * min(sheet.spacing, 0.5 * shape.thinnest())
        if self._surface is not None and self._surface.edged:
            furthest = min(furthest, EDGE_TRAVEL * sheet.spacing)
        return StepLimit(furthest / speed, f"in which {self.part.name!r} and the sheet move {furthest:.3g} m")

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on a body that never touched the sheet, pushed where supports hold, or rubs with sharp edges."""
        if untouched := self._untouched(history):
            return [untouched]
        jumps = jump_notes(self.label, self.part.motion, history)
        pushed = [] if self._held_push is None else self._held_push.notes()
        return [*jumps, *pushed, *(self._caught(history) if self._rubs else [])]

    def _caught(self, history: History) -> list[str]:
        """A note if a body with friction slid with edges that the spacing cannot resolve."""
        part, least = self.part, ROUNDED * self.context.whole.spacing
        slid = history[-1].get(f"{part.name}_rubbed", 1.0) > 0.0
        if not slid or part.shape.edge_radius() >= least:
            return []
        return [
            f"{self.label} slid with sharp edges: a point in its way is caught by one face or goes under the other, so "
            "friction depends on the grid and on round-off by some per cent: expected edges with a radius of a quarter "
            f"of a spacing, {least:.3g} m, or more; Box and Cylinder have `rounding`"
        ]

    def _untouched(self, history: History) -> str:
        """A note if the body met no point of the sheet until the end of the run; otherwise ""."""
        over = history[-1]["time"] >= self.context.clock.duration * (1.0 - 1e-9)
        if not over or any(row.get(name) for row in history for name in self._forces):
            return ""
        return f"{self.label} did not touch the sheet"

    @cached_property
    def _outline(self) -> Body:
        shape = self.part.shape
        vertices, triangles = shape.outline(float(np.ptp(self.context.whole.positions, axis=0).max()))
        return Body(self.part.name, shape.kind, shape.sizes(), vertices, triangles)

    def outline(self) -> Body:
        """Surface for drawing."""
        return self._outline

    def pose(self) -> np.ndarray:
        """Position of its centre [m] and quaternion (x, y, z, w), shape (7,)."""
        return np.concatenate([self.motion.place.numpy()[0], self.motion.rotation.numpy()[0]])

    def distance_from(self, points: np.ndarray) -> np.ndarray:
        """Signed distances [m], shape (N,), of points, shape (N, 3), from its surface at a frame."""
        pose = self.pose()
        return self._distances(points, pose[:3], pose[3:])
