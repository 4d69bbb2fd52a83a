"""The ball of the papers: a frictionless rigid sphere at constant velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ..context import Context
from ..device.checks import positive, resolved, vector
from ..geometry.sheet import Sheet
from ..interfaces import BuiltContact, BuiltLaw, Contact
from ..interfaces.scales import Scales
from .bodies import RigidBody, only_one_named
from .body_checks import MIN_DIAMETER
from .body_motion import BodyPath
from .body_shapes import Sphere

NAME = "ball"


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
