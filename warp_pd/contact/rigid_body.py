"""Rigid bodies of a scene: any shape, moving on a path or freely, with friction; the ball of the papers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, not_negative, positive, resolved, show, vector
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..interfaces import BuiltContact, BuiltLaw, Contact
from ..interfaces.scales import Scales
from .bodies import BodySettings, BuiltBody
from .body_checks import MIN_DIAMETER
from .body_motion import BodyMotion, BodyPath
from .body_shapes import BodyShape, Sphere

NAME = "ball"


@dataclass(frozen=True)
class RigidBody(BodySettings):
    """A rigid body of any shape that moves along a path, or freely.

    Points inside it are moved out and lose the velocity component into the body; with friction they also lose
    tangential velocity. See kernels/contact/body_contact.py. Points of rigid inclusions, and those that supports hold,
    ignore the body; it moves points that are held in some components along the others. Bodies do not interact with each
    other.

    Attributes:
        shape: Sphere, Plane, Capsule, Cylinder, Box or TriangleMesh.
        motion: BodyPath or Free.
        friction: Coefficient of Coulomb friction; 0 for none.
        name: Prefix of its columns of the history; bodies of one scene need different names.
        surface: Whether triangles of the sheet have contact with it, not only points, so that it may be thinner than
            the spacing. Only for Sphere, Capsule, Box and TriangleMesh. Triangles cut by a crack have no contact.

    Raises:
        InputError: for a wrong shape or motion, negative friction, or `surface` with another shape.
    """

    loads_at_rest: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if isinstance(self.shape, type) or not isinstance(self.shape, BodyShape):
            raise InputError(f"RigidBody.shape = {show(self.shape)}: expected a shape, such as Sphere(0.1)")
        if isinstance(self.motion, type) or not isinstance(self.motion, BodyMotion):
            raise InputError(f"RigidBody.motion = {show(self.motion)}: expected BodyPath or Free")
        not_negative("RigidBody.friction", self.friction)
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError(f"RigidBody.name = {show(self.name)}: expected letters, digits and _, such as 'needle'")
        self.motion.check(self.shape)
        if not isinstance(self.surface, bool):
            raise InputError(f"RigidBody.surface = {show(self.surface)}: expected True or False")
        if self.surface and self.shape.segments() is None:
            raise InputError(
                f"{self.title}: surface = True: expected a Sphere, Capsule, Box or TriangleMesh, got a "
                f"{self.shape.kind}"
            )

    @property
    def only_one(self) -> str:
        """Its name."""
        return only_one_named(self.name)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it is very large, far, fast or heavy."""
        if not self.shape.bounded:
            return ()
        radius, (place, _) = self.shape.radius(), self.motion.pose(0.0)
        away = float(np.linalg.norm(sheet.positions - place, axis=1).min()) - radius
        weight = self.motion.weight()
        return [
            *scales.of_length(f"{self.title} has a size of", 2.0 * radius),
            *scales.of_length(f"{self.title} starts at a distance of", away),
            *scales.of_speed(f"{self.title} moves at", self.motion.speed(radius)),
            *scales.of_force(f"{self.title}: its weight of {weight:.3g} N is", weight, "Masses are in kg"),
        ]

    def remarks(self) -> Sequence[str]:
        """The notes of its shape and motion."""
        return [f"{self.title}: {note}" for note in (*self.shape.notes, *self.motion.notes)]

    def on_partition(self, sheet: Sheet, partition: Partition) -> Contact:
        """The same part: it refers to no points of the sheet."""
        if self.motion.free:
            raise InputError(f"{self.title}: motion = Free: expected BodyPath, or a run in one process")
        if self.surface:
            raise InputError(f"{self.title}: surface = True: expected False, or a run in one process")
        return self

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the body on a device."""
        if self.loads_at_rest and context.at_rest:
            from .body_at_rest import BodyAtRest

            return BodyAtRest(self, context, law)
        return BuiltBody(self, context, law)


def only_one_named(name: str) -> str:
    """What `RigidBody.only_one` says of a name."""
    return f"bodies with the name {name!r}: expected different names: give each a name=..."


@dataclass(frozen=True)
class RigidBall(Contact):
    """A rigid, frictionless ball that moves at a prescribed constant velocity: a `RigidBody` with the name "ball".

    Source: NN paper, section 6.4.

    Attributes:
        diameter: Diameter [m].
        start: Position of the centre at time 0 [m].
        velocity: Velocity [m/s].

    Raises:
        InputError: if the diameter is not positive, or a vector does not have three finite components.
    """

    diameter: float
    start: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    loads_at_rest: ClassVar[bool] = True
    divides: ClassVar[bool] = True
    only_one: ClassVar[str] = only_one_named(NAME)

    def __post_init__(self) -> None:
        positive("RigidBall.diameter", self.diameter)
        vector("RigidBall.start", self.start, 3)
        vector("RigidBall.velocity", self.velocity, 3)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it is very large, far, fast or heavy."""
        return self._body(1.0).doubts(sheet, scales)

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the body on a device."""
        # A smaller ball passes between points.
        resolved("RigidBall.diameter", self.diameter, context.whole.widest_spacing, MIN_DIAMETER)
        return self._body(context.clock.duration).build(context, law)

    def _body(self, duration: float) -> RigidBody:
        path = BodyPath.straight(self.start, self.velocity, duration)
        return _Ball(Sphere(self.diameter), path, name=NAME)


class _Ball(RigidBody):
    """The body, with its name in messages."""

    @property
    def title(self) -> str:
        """Name of the part of the scene, for messages."""
        return "RigidBall"
