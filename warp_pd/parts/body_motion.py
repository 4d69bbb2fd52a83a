"""Motions of rigid bodies: along a path, or free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from ..device.checks import InputError, numbers, positive, said, vector
from ..interfaces.context import Context
from .body_shapes import BodyShape
from .built_motion import BuiltMotion, InFlight, OnPath

Vector = Sequence[float]
NOT_TURNED = (0.0, 0.0, 0.0, 1.0)
# Smallest least eigenvalue of an inertia over the largest.
LEAST_INERTIA = 1e-9


@runtime_checkable
class BodyMotion(Protocol):
    """Motion of a rigid body (base class).

    Attributes:
        free: Whether the sheet moves the body.
    """

    free: ClassVar[bool]

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position of the centre of mass [m], shape (3,), and unit quaternion, shape (4,), at a time [s]."""
        ...

    def speed(self, radius: float) -> float:
        """Largest known speed [m/s] of a point of the body at the distance `radius` [m] from its centre."""
        ...

    def check(self, shape: BodyShape) -> None:
        """Raise InputError if the shape cannot have this motion."""
        ...

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device; `friction` is the body's friction coefficient."""
        ...


@dataclass(frozen=True, eq=False)
class BodyPath(BodyMotion):
    """A prescribed motion: linear in time between knots, at rest before the first and after the last.

    Attributes:
        times: Knots [s], increasing, shape (K,).
        positions: Positions of the centre of mass [m], shape (K, 3).
        rotations: Unit quaternions (x, y, z, w) from the frame of the body, shape (K, 4); between knots the body turns
            uniformly, the shorter way. None for no rotation.
    """

    times: Any
    positions: Any
    rotations: Any = None

    free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the knots.

        Raises:
            InputError: if times do not increase, shapes differ, numbers are not finite, or quaternions are not unit.
        """
        times = numbers("BodyPath.times", self.times)
        if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
            raise InputError(f"BodyPath.times = {said(self.times)}: expected one or more increasing times")
        positions = numbers("BodyPath.positions", self.positions)
        if positions.shape != (len(times), 3):
            raise InputError(f"BodyPath.positions: expected shape ({len(times)}, 3), got {positions.shape}")
        given = np.tile(NOT_TURNED, (len(times), 1)) if self.rotations is None else self.rotations
        rotations = numbers("BodyPath.rotations", given)
        if rotations.shape != (len(times), 4):
            raise InputError(f"BodyPath.rotations: expected shape ({len(times)}, 4), got {rotations.shape}")
        rotations = np.array([unit_quaternion("BodyPath.rotations", q) for q in rotations])
        # A quaternion and its opposite are one rotation: the closer one is the shorter way.
        signs = np.cumprod([1.0, *np.where(np.sum(rotations[1:] * rotations[:-1], axis=1) < 0.0, -1.0, 1.0)])
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

    def check(self, shape: BodyShape) -> None:
        """Accept any shape."""

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device."""
        return OnPath(name, self.pose(0.0), (self.times, self.positions, self.rotations), context)


@dataclass(frozen=True)
class Free(BodyMotion):
    """Free motion under gravity and the forces of the sheet. Bodies do not interact with each other.

    Attributes:
        mass: Mass [kg].
        position: Position of the centre of mass at time 0 [m].
        rotation: Unit quaternion (x, y, z, w) at time 0, from the frame of the body.
        velocity: Velocity at time 0 [m/s].
        spin: Angular velocity at time 0 [1/s], in the coordinates of the sheet.
        inertia: Moments of inertia in the frame of the body [kg m^2], three numbers or a symmetric matrix; None for
            uniform density.
        gravity: Acceleration of gravity [m/s^2].
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
            InputError: if mass or inertia is not positive, or a vector is not finite.
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
        """Position [m] and quaternion at time 0; later poses are known only to the run."""
        return np.array(self.position, float), unit_quaternion("Free.rotation", self.rotation)

    def speed(self, radius: float) -> float:
        """Largest speed [m/s], at time 0, of a point of the body at the distance `radius` [m] from its centre."""
        return float(np.linalg.norm(self.velocity) + radius * np.linalg.norm(self.spin))

    def check(self, shape: BodyShape) -> None:
        """Check that the shape has a finite mass.

        Raises:
            InputError: if it has not, such as a plane.
        """
        if not shape.bounded:
            raise InputError(f"motion = Free: a {shape.kind} has no finite mass; expected a BodyPath")

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device."""
        inertia = self.mass * shape.inertia() if self.inertia is None else self._given_inertia()
        return InFlight(name, self.pose(0.0), self, inertia, context, friction)


def unit_quaternion(name: str, value: Any) -> np.ndarray:
    """Check and convert a unit quaternion, shape (4,).

    Raises:
        InputError: if the numbers are not finite or the length is not 1.
    """
    found = np.array(vector(name, value, 4))
    length = float(np.linalg.norm(found))
    if not abs(length - 1.0) < 1e-3:
        raise InputError(f"{name} = {said(value)}: expected a unit quaternion (x, y, z, w); its length is {length:.4g}")
    return np.asarray(found / length)
