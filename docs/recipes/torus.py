"""A ring as a rigid body: a shape is a signed distance, its numbers, its inertia and its outline."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from warp_pd.contact import BodyShape
from warp_pd.device.checks import InputError, positive
from warp_pd.kernels.contact import distances


@wp.func
def torus_distance(arm: wp.vec3d, reach: wp.float64, body: distances.BodyShape):
    """Signed distance and outward normal; sizes: radius of the circle in the middle of the tube, radius of the tube."""
    across = wp.vec3d(arm[0], arm[1], wp.float64(0.0))
    middle = wp.vec3d(body.size[0], wp.float64(0.0), wp.float64(0.0))
    if wp.length(across) > wp.float64(0.0):
        middle = (body.size[0] / wp.length(across)) * across
    return distances.from_point(arm - middle, body.size[1])


@dataclass(frozen=True)
class Torus(BodyShape):
    """A ring about z: a tube of the diameter `tube` [m] along a circle of the diameter `circle` [m]."""

    circle: float
    tube: float

    kind: ClassVar[str] = "torus"
    distance: ClassVar = torus_distance

    def __post_init__(self):
        if positive("Torus.tube", self.tube) >= positive("Torus.circle", self.circle):
            raise InputError(f"Torus.tube = {self.tube!r}: expected less than circle = {self.circle!r}")

    def sizes(self):
        return 0.5 * self.circle, 0.5 * self.tube

    def radius(self):
        return 0.5 * (self.circle + self.tube)

    def thinnest(self):
        return self.tube

    def inertia(self):
        R, r = self.sizes()
        return np.diag([0.5 * R**2 + 0.625 * r**2] * 2 + [R**2 + 0.75 * r**2])

    def outline(self, extent):
        around, here = 32, np.arange(32 * 32).reshape(32, 32)
        u, v = np.meshgrid(*[2.0 * np.pi / around * np.arange(around)] * 2, indexing="ij")
        R, r = self.sizes()
        vertices = np.stack([(R + r * np.cos(v)) * np.cos(u), (R + r * np.cos(v)) * np.sin(u), r * np.sin(v)], axis=2)
        beside, above = np.roll(here, -1, axis=0), np.roll(here, -1, axis=1)
        corner = np.roll(beside, -1, axis=1)
        triangles = np.stack([here, beside, corner, here, corner, above], axis=2)
        return vertices.reshape(-1, 3), triangles.reshape(-1, 3).astype(np.int32)
