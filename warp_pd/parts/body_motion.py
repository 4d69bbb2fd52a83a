"""How rigid bodies move: along a path, or freely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..checks import InputError, numbers, positive, said, vector
from ..device.context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..kernels.body_motion import ROWS, free_motion, path_motion, vec6d
from ..phases import Phase
from ..schedules import Schedule
from .body_shapes import BodyShape

Vector = Sequence[float]
NOT_TURNED = (0.0, 0.0, 0.0, 1.0)
# Smallest least eigenvalue of an inertia over the largest.
LEAST_INERTIA = 1e-9


@runtime_checkable
class BodyMotion(Protocol):
    """How a rigid body moves.

    Attributes:
        free: Whether it feels the sheet.
    """

    free: ClassVar[bool]

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position of the centre of mass [m], shape (3,), and unit quaternion, shape (4,), at a time [s]."""
        ...

    def speed(self, radius: float) -> float:
        """Largest speed of a point at a distance [m] from the centre, as far as it is known [m/s]."""
        ...

    def check(self, shape: BodyShape) -> None:
        """Raise InputError for a shape that cannot move so."""
        ...

    def build(self, name: str, shape: BodyShape, context: Context) -> BuiltMotion:
        """The motion on a device."""
        ...


@dataclass(frozen=True, eq=False)
class Path(BodyMotion):
    """A motion that is prescribed, whatever the sheet does: linear in time between knots, still before and after them.

    Attributes:
        times: Knots [s], rising, shape (K,).
        positions: Of the centre of mass [m], shape (K, 3).
        rotations: Unit quaternions (x, y, z, w) from the frame of the body, shape (K, 4); between knots it turns
            uniformly, the shorter way. None: it does not turn.
    """

    times: Any
    positions: Any
    rotations: Any = None

    free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the knots.

        Raises:
            InputError: for times that do not rise, other shapes, numbers that are not finite, or no rotation.
        """
        times = numbers("Path.times", self.times)
        if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
            raise InputError(f"Path.times = {said(self.times)}: expected rising times, at least one")
        positions = numbers("Path.positions", self.positions)
        if positions.shape != (len(times), 3):
            raise InputError(f"Path.positions has shape {positions.shape}: expected ({len(times)}, 3)")
        given = np.tile(NOT_TURNED, (len(times), 1)) if self.rotations is None else self.rotations
        rotations = numbers("Path.rotations", given)
        if rotations.shape != (len(times), 4):
            raise InputError(f"Path.rotations has shape {rotations.shape}: expected ({len(times)}, 4)")
        rotations = np.array([unit_quaternion("Path.rotations", q) for q in rotations])
        # A quaternion and its opposite are one rotation: the closer one is the shorter way.
        signs = np.cumprod([1.0, *np.where(np.sum(rotations[1:] * rotations[:-1], axis=1) < 0.0, -1.0, 1.0)])
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "rotations", signs[:, None] * rotations)

    @staticmethod
    def still(position: Vector, rotation: Vector = NOT_TURNED) -> Path:
        """No motion at all, at a position [m]."""
        return Path([0.0], [position], [rotation])

    @staticmethod
    def straight(start: Vector, velocity: Vector, duration: float, rotation: Vector = NOT_TURNED) -> Path:
        """From a position [m] at a velocity [m/s] for a duration [s], which begins at 0."""
        begin, speed = (np.array(vector(f"Path {n}", v, 3)) for n, v in (("start", start), ("velocity", velocity)))
        end = positive("Path duration", duration)
        return Path([0.0, end], [begin, begin + end * speed], [rotation, rotation])

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m], shape (3,), and quaternion, shape (4,), at a time [s]."""
        place = np.array([np.interp(time, self.times, self.positions[:, c]) for c in range(3)])
        last = len(self.times) - 1
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, max(last - 1, 0)))
        if last == 0:
            return place, self.rotations[0]
        share = float(np.clip((time - self.times[k]) / (self.times[k + 1] - self.times[k]), 0.0, 1.0))
        begin, end = self.rotations[k], self.rotations[k + 1]
        angle = np.arccos(np.clip(begin @ end, -1.0, 1.0))
        if angle < 1e-9:
            return place, begin
        return place, (np.sin((1.0 - share) * angle) * begin + np.sin(share * angle) * end) / np.sin(angle)

    def speed(self, radius: float) -> float:
        """Largest speed of a point at a distance [m] from the centre [m/s]."""
        if len(self.times) == 1:
            return 0.0
        moved = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        cosines = np.abs(np.sum(self.rotations[1:] * self.rotations[:-1], axis=1))
        turned = np.where(cosines < 1.0 - 1e-15, 2.0 * np.arccos(np.minimum(cosines, 1.0)), 0.0)
        return float(((moved + radius * turned) / np.diff(self.times)).max())

    def check(self, shape: BodyShape) -> None:
        """Any shape can follow a path."""

    def build(self, name: str, shape: BodyShape, context: Context) -> BuiltMotion:
        """The motion on a device."""
        return OnPath(name, self, context)


@dataclass(frozen=True)
class Free(BodyMotion):
    """A body that moves under gravity and what the sheet gives it. Bodies do not feel each other.

    Attributes:
        mass: [kg].
        position: Of the centre of mass at time 0 [m].
        rotation: Unit quaternion (x, y, z, w) at time 0, from the frame of the body.
        velocity: At time 0 [m/s].
        spin: Angular velocity at time 0 [1/s], in the coordinates of the sheet.
        inertia: Moments of inertia in the frame of the body [kg m^2], three or a symmetric matrix; None: those of a
            uniform density.
        gravity: [m/s^2].
    """

    mass: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = NOT_TURNED
    inertia: Any = None
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)

    free: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: for a mass or inertia that is not positive, or vectors that are not finite.
        """
        positive("Free.mass", self.mass)
        for name in ("position", "velocity", "spin", "gravity"):
            vector(f"Free.{name}", getattr(self, name), 3)
        unit_quaternion("Free.rotation", self.rotation)
        if self.inertia is not None:
            self._given_inertia()

    def _given_inertia(self) -> np.ndarray:
        found = numbers("Free.inertia", self.inertia)
        matrix = np.diag(found) if found.shape == (3,) else found
        if matrix.shape != (3, 3) or not np.allclose(matrix, matrix.T):
            raise InputError(f"Free.inertia = {said(self.inertia)}: expected three moments or a symmetric matrix")
        values = np.linalg.eigvalsh(matrix)
        if not values[0] > LEAST_INERTIA * max(values[-1], 0.0) or not values[0] > 0.0:
            raise InputError(f"Free.inertia = {said(self.inertia)}: expected positive moments")
        return matrix

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and quaternion at the start; later ones only the run knows."""
        return np.array(self.position, float), unit_quaternion("Free.rotation", self.rotation)

    def speed(self, radius: float) -> float:
        """Largest speed at the start of a point at a distance [m] from the centre [m/s]."""
        return float(np.linalg.norm(self.velocity) + radius * np.linalg.norm(self.spin))

    def check(self, shape: BodyShape) -> None:
        """Refuse a shape without a mass.

        Raises:
            InputError: for one.
        """
        if not shape.bounded:
            raise InputError(f"motion = Free: a {shape.kind} has no mass: expected a Path")

    def build(self, name: str, shape: BodyShape, context: Context) -> BuiltMotion:
        """The motion on a device."""
        inertia = self.mass * shape.inertia() if self.inertia is None else self._given_inertia()
        return InFlight(name, self, inertia, context)


def unit_quaternion(name: str, value: Any) -> np.ndarray:
    """A quaternion of length 1, shape (4,).

    Raises:
        InputError: for one that is not finite, or zero.
    """
    found = np.array(vector(name, value, 4))
    length = float(np.linalg.norm(found))
    if not abs(length - 1.0) < 1e-3:
        raise InputError(f"{name} = {said(value)}: expected a unit quaternion (x, y, z, w); its length is {length:.4g}")
    return np.asarray(found / length)


class BuiltMotion:
    """A motion on a device; see kernels/body_motion.py for its arrays."""

    def __init__(self, name: str, motion: BodyMotion, context: Context) -> None:
        """Allocate its pose."""
        self.name, self.context = name, context
        place, turned = motion.pose(0.0)
        self.place = self._array("place", wp.vec3d, np.tile(place, (2, 1)))
        self.rotation = self._array("rotation", wp.quatd, np.tile(turned, (2, 1)))
        self.motion = self._array("motion", wp.vec3d, np.zeros((2, 3)))

    def _array(self, name: str, dtype: Any, values: np.ndarray, restart: bool = True, per: str = "body") -> Array:
        return self.context.array(f"{self.name}_{name}", self.name, dtype, values, per=per, restart=restart)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that move the body."""

    def before_projection(self, stage: Stage) -> None:
        """Add launches after points have been found inside, before they are moved out."""

    def before_separation(self, stage: Stage) -> None:
        """Add launches after touching points have been found, before they are separated."""

    def after(self, stage: Stage) -> None:
        """Add launches after points have got their impulses."""

    def taken(self) -> dict[str, float]:
        """Momentum that the sheet was given since the last frame, and the loss; by name, if the motion knows them."""
        return {}

    def columns(self) -> dict[str, float]:
        """Columns of the history."""
        place, moving = self.place.numpy()[0], self.motion.numpy()
        row = {f"{self.name}_position_{c}": float(x) for c, x in zip("xyz", place, strict=True)}
        row |= {f"{self.name}_velocity_{c}": float(x) for c, x in zip("xyz", moving[0], strict=True)}
        return row | {f"{self.name}_spin_{c}": float(x) for c, x in zip("xyz", moving[1], strict=True)}

    def end_frame(self) -> None:
        """Begin to sum up anew."""


class OnPath(BuiltMotion):
    """A prescribed motion on a device."""

    def __init__(self, name: str, path: Path, context: Context) -> None:
        super().__init__(name, path, context)
        self.knots = self._array("times", wp.float64, path.times, False, "table")
        self.places = self._array("places", wp.vec3d, path.positions, False, "table")
        self.rotations = self._array("rotations", wp.quatd, path.rotations, False, "table")
        # The clock runs where there are schedules.
        context.clock.register(Schedule(np.array([0.0]), path.positions[:1]))

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that follows the path."""
        if phase is Phase.RIGID_DRIFT:
            clock = self.context.clock
            stage.launch(
                self.name, path_motion(self.context.module), 1, times=self.knots, places=self.places,
                rotations=self.rotations, time=clock.time, advance=clock.advance, place=self.place,
                rotation=self.rotation, motion=self.motion,
            )  # fmt: skip


class InFlight(BuiltMotion):
    """A free body on a device.

    Attributes:
        need: Speed into the body that each point must lose [m/s], or -1, (N,) float64.
        rows: Normal, and arm times normal, of the points that must, (N,) vec6d.
        push: What each point got in the last half step [N s], (N,) vec3d.
        arms: From the centre to the point [m], (N,) vec3d.
        push_work: Its work [J], (N,) float64, or None.
    """

    def __init__(self, name: str, body: Free, inertia: np.ndarray, context: Context) -> None:
        super().__init__(name, body, context)
        points, tracked = context.sheet.size, context.features.tracked
        self.body, self.inertia = body, inertia
        _, q = body.pose(0.0)
        turn = _matrix(q)
        angular = turn @ inertia @ turn.T @ np.array(body.spin, float)
        start = [body.velocity, angular, body.velocity, body.spin]
        self.motion.assign(np.array([body.velocity, body.spin], float))
        self.momenta = self._array("momenta", wp.vec3d, np.array(start, float))
        self.given = self._array("given", wp.float64, np.zeros(7))
        self.block = max(64, int(np.sqrt(points)))
        self.blocks = -(-points // self.block)

        def room(what: str, dtype: Any, size: Any, per: str = "point") -> Array:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self.need, self.rows = room("need", wp.float64, points), room("rows", vec6d, points)
        self.push, self.arms = room("push", wp.vec3d, points), room("arms", wp.vec3d, points)
        self.push_work = room("push_work", wp.float64, points) if tracked else None
        self._sums = room("sums", wp.float64, (ROWS, self.blocks), "block")
        self._totals = room("totals", wp.float64, ROWS, "once")
        self._changes = room("changes", vec6d, 1, "once")
        self._inertia = wp.mat33d(*inertia.ravel().tolist())
        self._inverse = wp.mat33d(*np.linalg.inv(inertia).ravel().tolist())
        self._gravity = wp.vec3d(*map(float, body.gravity))
        self._kernels = free_motion(context.bits, tracked, context.module)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that kick and drift the body."""
        step = self.context.state.step
        if phase is Phase.RIGID_DRIFT:
            stage.launch(
                self.name, self._kernels.move, 1, inverse_inertia=self._inverse, gravity=self._gravity, step=step,
                place=self.place, rotation=self.rotation, motion=self.motion, momenta=self.momenta,
            )  # fmt: skip
        elif phase is Phase.RIGID_KICK:
            stage.launch(
                self.name, self._kernels.kick, 1, gravity=self._gravity, step=step, motion=self.motion,
                momenta=self.momenta,
            )  # fmt: skip

    def before_projection(self, stage: Stage) -> None:
        """Find how the body yields to the points inside it, and move it so."""
        self._solve(stage)
        stage.launch(
            self.name, self._kernels.yield_to, 1, changes=self._changes, step=self.context.state.step,
            place=self.place, rotation=self.rotation, motion=self.motion,
        )  # fmt: skip

    def before_separation(self, stage: Stage) -> None:
        """Find how the body yields to the points that touch it."""
        self._solve(stage)
        stage.launch(self.name, self._kernels.foresee, 1, changes=self._changes, motion=self.motion)

    def _solve(self, stage: Stage) -> None:
        # The second time without the points that would have to be pulled.
        for again in (0, 1):
            stage.launch(
                self.name, self._kernels.gather, self.blocks, mass=self.context.state.mass, need=self.need,
                rows=self.rows, changes=self._changes, use_changes=again, block=self.block, sums=self._sums,
            )  # fmt: skip
            stage.launch(self.name, self._kernels.reduce, ROWS, sums=self._sums, totals=self._totals)
            stage.launch(
                self.name, self._kernels.solve, 1, totals=self._totals, mass=float(self.body.mass),
                inertia=self._inertia, rotation=self.rotation, changes=self._changes,
            )  # fmt: skip

    def after(self, stage: Stage) -> None:
        """Take from the body what the points got."""
        stage.launch(
            self.name, self._kernels.gather_given, self.blocks, push=self.push, arms=self.arms,
            push_work=self.push_work, block=self.block, sums=self._sums,
        )  # fmt: skip
        stage.launch(self.name, self._kernels.reduce, 7, sums=self._sums, totals=self._totals)
        stage.launch(
            self.name, self._kernels.give, 1, totals=self._totals, mass=float(self.body.mass),
            inverse_inertia=self._inverse, rotation=self.rotation, motion=self.motion, momenta=self.momenta,
            given=self.given,
        )  # fmt: skip

    def taken(self) -> dict[str, float]:
        """Momentum and angular momentum given to the sheet since the last frame, and what contact lost so far."""
        names = [*(f"impulse_{c}" for c in "xyz"), *(f"turn_{c}" for c in "xyz"), "loss"]
        return {f"{self.name}_{n}": float(x) for n, x in zip(names, self.given.numpy(), strict=True)}

    def columns(self) -> dict[str, float]:
        """Columns of the history, with the energies [J]."""
        row = super().columns()
        velocity, spin = self.motion.numpy()
        turn = _matrix(self.rotation.numpy()[0])
        angular = turn @ self.inertia @ turn.T @ spin
        kinetic = 0.5 * (self.body.mass * velocity @ velocity + spin @ angular)
        height = -self.body.mass * np.array(self.body.gravity, float) @ self.place.numpy()[0]
        return {**row, f"{self.name}_kinetic": float(kinetic), f"{self.name}_potential": float(height)}

    def end_frame(self) -> None:
        """Begin to sum up anew; the loss goes on."""
        given = self.given.numpy().copy()
        given[:6] = 0.0
        self.given.assign(given)


def _matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion (x, y, z, w)."""
    axis, w = q[:3], q[3]
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * (w * cross + cross @ cross))
