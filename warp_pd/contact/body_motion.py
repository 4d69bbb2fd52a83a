"""Motions of rigid bodies along a path, and what motions are on a device."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, numbers, positive, show, vector
from ..device.clock import Schedule
from ..device.fields import Array
from ..device.launches import Launch, Stage
from ..interfaces import History
from ..kernels.contact.body_contact import PointContact, body_contact, body_impulses
from ..kernels.contact.body_motion import COUNTS, MOVES, PREVIOUS, follow_path, turn_between
from ..kernels.effects import NEAR_BLOCK, Pointwise
from ..step import Phase
from .body_shapes import BodyShape

Vector = Sequence[float]
# Radius of a half space [m].
UNBOUNDED = 1e30
# Product of quaternions that are half a turn apart, with round-off.
HALF_TURN = 1e-9
NOT_TURNED = (0.0, 0.0, 0.0, 1.0)
# Jump of the velocity over the largest one, and error of the energy balance, from which a note says so.
ABRUPT, UNBALANCED = 0.5, 0.01
# Distance of a sheet from the origin, over its extent, from which positions are stored about its middle.
FAR = 10.0


@runtime_checkable
class BodyMotion(Protocol):
    """Motion of a rigid body (base class).

    Attributes:
        free: Whether the sheet moves the body.
        notes: What may be a mistake of the motion, for the notes of a run.
    """

    free: ClassVar[bool]
    notes: tuple[str, ...] = ()

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position of the centre of mass [m], shape (3,), and unit quaternion, shape (4,), at a time [s]."""
        ...

    def speed(self, radius: float) -> float:
        """Largest known speed [m/s] of a point of the body at the distance `radius` [m] from its centre."""
        ...

    def weight(self) -> float:
        """Weight of a free body [N]."""
        return 0.0

    def jump(self, end: float) -> tuple[float, float]:
        """Largest prescribed jump of its velocity [m/s] between time 0 and `end` [s], and its time [s]."""
        return 0.0, 0.0

    def check(self, shape: BodyShape) -> None:
        """Raise InputError if the shape cannot have this motion."""
        ...

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device; `friction` is the body's friction coefficient."""
        ...


def origin_of(points: np.ndarray) -> np.ndarray:
    """Origin of stored positions [m]: the middle of a sheet that is far away, whose round-off would move its points."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, extent = 0.5 * (low + high), float((high - low).max())
    return middle if np.abs(middle).max() > FAR * extent else np.zeros_like(middle)


def jump_notes(label: str, motion: BodyMotion, history: History) -> list[str]:
    """A note on a jump of the velocity of a body where the energy balance is off."""
    off = max((abs(row.get("balance_error", 0.0)) for row in history), default=0.0)
    jump, when = motion.jump(history[-1]["time"])
    if off < UNBALANCED or jump <= ABRUPT * motion.speed(0.0):
        return []
    return [
        f"{label}: its velocity jumps by {jump:.3g} m/s at {when:.6g} s and the energy balance is off: expected a "
        "change over several steps (more times)"
    ]


@dataclass(frozen=True, eq=False)
class BodyPath(BodyMotion):
    """A prescribed motion: linear in time between knots, at rest before the first and after the last.

    Attributes:
        times: Knots [s], increasing, shape (K,).
        positions: Positions of the centre of mass [m], shape (K, 3).
        rotations: Unit quaternions (x, y, z, w) from the frame of the body, shape (K, 4); between knots the body turns
            uniformly, the shorter way; a note tells where their signs mean the longer one. None for no rotation.
    """

    times: Any
    positions: Any
    rotations: Any = None
    notes: tuple[str, ...] = field(init=False, default=())

    free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        times = numbers("BodyPath.times", self.times)
        if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
            raise InputError(f"BodyPath.times = {show(self.times)}: expected one or more increasing times")
        positions = numbers("BodyPath.positions", self.positions)
        if positions.shape != (len(times), 3):
            raise InputError(f"BodyPath.positions: expected shape ({len(times)}, 3), got {positions.shape}")
        given = np.tile(NOT_TURNED, (len(times), 1)) if self.rotations is None else self.rotations
        rotations = numbers("BodyPath.rotations", given)
        if rotations.shape != (len(times), 4):
            raise InputError(f"BodyPath.rotations: expected shape ({len(times)}, 4), got {rotations.shape}")
        rotations = np.array([unit_quaternion("BodyPath.rotations", q) for q in rotations])
        # A quaternion and its opposite are one rotation: the closer one is the shorter way.
        cosines = np.clip(np.sum(rotations[1:] * rotations[:-1], axis=1), -1.0, 1.0)
        signs = np.cumprod([1.0, *np.where(cosines < 0.0, -1.0, 1.0)])
        if len(longer := np.flatnonzero(cosines < HALF_TURN)):
            k = int(longer[0])
            way, back = 2.0 * math.acos(cosines[k]), 2.0 * math.acos(abs(cosines[k]))
            note = (
                f"BodyPath.rotations[{k}] and [{k + 1}] are {way:.4g} rad apart by their signs: the body turns the "
                f"shorter way, by {back:.4g} rad; half a turn or more needs a key between"
            )
            object.__setattr__(self, "notes", (note,))
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "rotations", signs[:, None] * rotations)

    @staticmethod
    def still(position: Vector, rotation: Vector = NOT_TURNED) -> BodyPath:
        """Path of a body at rest at a position [m]."""
        return BodyPath([0.0], [position], [rotation])

    @staticmethod
    def straight(start: Vector, velocity: Vector, duration: float, rotation: Vector = NOT_TURNED) -> BodyPath:
        """Straight path from a position [m] at a velocity [m/s], from time 0 for a duration [s]."""
        begin, speed = (np.array(vector(f"BodyPath {n}", v, 3)) for n, v in (("start", start), ("velocity", velocity)))
        end = positive("BodyPath duration", duration)
        return BodyPath([0.0, end], [begin, begin + end * speed], [rotation, rotation])

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m], shape (3,), and quaternion, shape (4,), at a time [s]."""
        place = np.array([np.interp(time, self.times, self.positions[:, c]) for c in range(3)])
        last = len(self.times) - 1
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, max(last - 1, 0)))
        if last == 0:
            return place, self.rotations[0]
        fraction = float(np.clip((time - self.times[k]) / (self.times[k + 1] - self.times[k]), 0.0, 1.0))
        begin, end = self.rotations[k], self.rotations[k + 1]
        angle = np.arccos(np.clip(begin @ end, -1.0, 1.0))
        if angle < 1e-9:
            return place, begin
        return place, (np.sin((1.0 - fraction) * angle) * begin + np.sin(fraction * angle) * end) / np.sin(angle)

    def speed(self, radius: float) -> float:
        """Largest speed of a point at a distance [m] from the centre [m/s]."""
        if len(self.times) == 1:
            return 0.0
        moved = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        cosines = np.abs(np.sum(self.rotations[1:] * self.rotations[:-1], axis=1))
        turned = np.where(cosines < 1.0 - 1e-15, 2.0 * np.arccos(np.minimum(cosines, 1.0)), 0.0)
        return float(((moved + radius * turned) / np.diff(self.times)).max())

    def jump(self, end: float) -> tuple[float, float]:
        """The largest jump at a knot; the start, where a body may come from afar, is none."""
        return Schedule(self.times, self.positions, "BodyPath").largest_jump(end, from_rest=False)

    def check(self, shape: BodyShape) -> None:
        """Accept any shape."""

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device."""
        made = OnPath(name, self.pose(0.0), (self.times, self.positions, self.rotations), context)
        if not context.at_rest:
            made.motion.assign(np.tile(self._motion_at_start(), (2, 1)))
        return made

    def _motion_at_start(self) -> np.ndarray:
        """Velocity [m/s] and spin [1/s] from time 0 on, shape (2, 3)."""
        k = int(np.searchsorted(self.times, 0.0, side="right")) - 1
        if not 0 <= k < len(self.times) - 1:
            return np.zeros((2, 3))
        begin, end = (wp.quatd(*rotation) for rotation in self.rotations[k : k + 2])
        moved = [self.positions[k + 1] - self.positions[k], turn_between(begin, end)]
        return np.asarray(np.array(moved) / (self.times[k + 1] - self.times[k]))


def unit_quaternion(name: str, value: Any) -> np.ndarray:
    """Check and convert a unit quaternion, shape (4,)."""
    found = np.array(vector(name, value, 4))
    length = float(np.linalg.norm(found))
    if not abs(length - 1.0) < 1e-3:
        raise InputError(f"{name} = {show(value)}: expected a unit quaternion (x, y, z, w); its length is {length:.4g}")
    return np.asarray(found / length)


def moves_later(step: Stage, displacement: Array, owner: str) -> bool:
    """Whether anything but local stages and the launches of `owner` moves points after the first local stage."""
    looked = False
    for item in step:
        for piece in (item.pieces or (item,)) if isinstance(item, Launch) else (item,):
            local = isinstance(piece, Launch) and isinstance(piece.source, Pointwise) and piece.source.local
            if looked and not local and piece.owner != owner and int(displacement.ptr) in piece.touched.writes:
                return True
            looked = looked or local
    return False


class BuiltMotion:
    """A motion on a device; see kernels/contact/body_motion.py for its arrays.

    Attributes:
        marks: Whether each point may touch a free body, (N,) uint8; see kernels/contact/body_contact.py.
        counts: Numbers of steps, and whether other parts move points after the body has looked which are near,
            (COUNTS,) int32; see kernels/contact/body_motion.py.
        travelled: How far the body and one of those points may have come nearer since [m], (1,).
        around: For blocks of NEAR_BLOCK points, last step in which one of them was within the margin, int32.
        free: Whether the sheet moves the body.
        extent: Distance of its furthest point from the centre, margin in which points count as around it, and how far a
            free body may yield in a step before any point may touch it [m].
    """

    free: ClassVar[bool] = False
    extent: tuple[float, float, float]

    def __init__(self, name: str, pose: tuple[np.ndarray, np.ndarray], context: Context) -> None:
        """Allocate the arrays of the pose."""
        self.name, self.context = name, context
        points = context.sheet.size
        self.marks = context.array(f"{name}_marks", name, wp.uint8, shape=points) if self.free else None
        place, turned = pose
        self.place = self._array("place", wp.vec3d, np.tile(place, (2, 1)))
        self.rotation = self._array("rotation", wp.quatd, np.tile(turned, (2, 1)))
        self.motion = self._array("motion", wp.vec3d, np.zeros((2 if self.free else 4, 3)))
        self.counts = self._array("counts", wp.int32, np.zeros(COUNTS, np.int32), restart=False)
        self.travelled = self._array("travelled", wp.float64, np.array([UNBOUNDED]), restart=False)
        blocks = -(-points // NEAR_BLOCK)
        self.around = context.array(f"{name}_around", name, wp.int32, shape=blocks, per="table")

    def _array(self, name: str, dtype: Any, values: np.ndarray, restart: bool = True, per: str = "body") -> Array:
        return self.context.array(f"{self.name}_{name}", self.name, dtype, values, per=per, restart=restart)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that move the body."""

    def add_contact(
        self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any], pushed: Mapping[str, Any] | None
    ) -> None:
        """Add the launches of contact with points.

        Args:
            stage: Stage to which they are added.
            of: Functions of the contact.
            at_end: Whether this is the end of a step.
            values: Members of the struct of `of`.
            pushed: Options of the launch that applies the impulses of triangles; None if only points have contact.
        """
        points = self.context.sheet.size
        if pushed is not None:
            stage.pointwise(self.name, body_impulses(of, at_end), points, **pushed, **values)
        # Where the step is followed by the next one, the body has already moved on.
        before = {
            "place": self.place[1:], "rotation": self.rotation[1:], "motion": self.motion[2:],
            "counts": self.counts[PREVIOUS:],
        }  # fmt: skip
        stage.pointwise(self.name, body_contact(of, at_end), points, late=before if at_end else None, **values)

    def complete(self, step: Stage) -> None:
        """Note whether other parts move points, when the step is composed."""
        own = self.name if self.free else ""
        moves = self.context.partition is not None or moves_later(step, self.context.state.displacement, own)
        counts = self.counts.numpy().copy()
        counts[[MOVES, PREVIOUS + MOVES]] = int(moves)
        self.counts.assign(counts)

    def found(self) -> dict[str, Array | None]:
        """Arrays of the points in contact, by their name in the struct of `PointContact`."""
        of_free = ("need", "rows", "arms", "slips", "yielded", "any_near", "near")
        return {**dict.fromkeys(of_free), "counts": self.counts, "around": self.around}

    def free_inertia(self) -> tuple[float, np.ndarray] | None:
        """Mass [kg] and inertia in the body frame [kg m^2], (3, 3); None if the sheet does not move the body."""
        return None

    def sums(self) -> dict[str, Array]:
        """Momentum given to the sheet since the last frame, and losses, by name; empty if not computed here."""
        return {}

    def columns(self) -> dict[str, float]:
        """Columns of the history."""
        place, moving = self.place.numpy()[0], self.motion.numpy()
        row = {f"{self.name}_position_{c}": float(x) for c, x in zip("xyz", place, strict=True)}
        row |= {f"{self.name}_velocity_{c}": float(x) for c, x in zip("xyz", moving[0], strict=True)}
        return row | {f"{self.name}_spin_{c}": float(x) for c, x in zip("xyz", moving[1], strict=True)}

    def end_frame(self) -> None:
        """Reset the sums of a frame."""


class OnPath(BuiltMotion):
    """A prescribed motion on a device."""

    def __init__(
        self,
        name: str,
        pose: tuple[np.ndarray, np.ndarray],
        knots: tuple[np.ndarray, ...],
        context: Context,
        led: bool = False,
    ) -> None:
        """Allocate the knots; `led`: another simulation writes new ones during the run."""
        super().__init__(name, pose, context)
        times, positions, rotations = knots
        per = "body" if led else "table"
        self.knots = self._array("times", wp.float64, times, led, per)
        self.places = self._array("places", wp.vec3d, positions, led, per)
        self.rotations = self._array("rotations", wp.quatd, rotations, led, per)
        # Bodies on paths share it: at the end of a step one acts where another has moved points.
        blocks = -(-context.sheet.size // NEAR_BLOCK)
        self._near = context.shared_array("blocks_near", name, wp.int32, shape=blocks, per="table")
        context.clock.keep_time(name)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that follows the path; relaxation takes load steps in steps of its clock."""
        phases = (Phase.SCHEDULES, Phase.CLOCK) if self.context.at_rest else (Phase.FOLLOW,)
        if phase in phases:
            context, clock = self.context, self.context.clock
            stage.launch(
                self.name, follow_path, 1, times=self.knots, places=self.places,
                rotations=self.rotations, time=clock.time, advance=clock.advance, place=self.place,
                counts_time=int(not context.at_rest and clock.counted_by == self.name), radius=self.extent[0],
                margin=self.extent[1], counts=self.counts, travelled=self.travelled,
                rotation=self.rotation, motion=self.motion,
            )  # fmt: skip

    def found(self) -> dict[str, Array | None]:
        """Arrays in which points near the body are noted, also those near the end of a step."""
        return super().found() | {"near": self._near}
