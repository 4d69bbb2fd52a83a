"""Contact with a rigid ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .checks import finite, positive, vector
from .loads import Schedule


@dataclass(frozen=True)
class RigidBall:
    """A rigid, frictionless ball that moves at constant velocity, whatever the sheet does.

    Points inside it are put on the nearest point of its surface and lose the part of their velocity that
    points into it. The momentum this takes is the ball's reaction. Points held by a support or in a rigid
    inclusion do not feel the ball. Source: NN paper, section 6.4.

    Attributes:
        diameter: [m].
        start: Position of the centre at time 0 [m].
        velocity: [m/s].

    Raises:
        InputError: for a diameter that is not above zero, or vectors that are not three finite numbers.
    """

    diameter: float
    start: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        positive("RigidBall.diameter", self.diameter)
        vector("RigidBall.start", self.start, 3)
        vector("RigidBall.velocity", self.velocity, 3)

    def schedule(self, end: float) -> Schedule:
        """Position of the centre from time 0 to `end` [s]."""
        start, velocity = np.array(self.start, float), np.array(self.velocity, float)
        last = max(finite("end", end), 1e-300)
        return Schedule(np.array([0.0, last]), np.vstack([start, start + last * velocity]))
