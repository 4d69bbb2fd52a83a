"""Magnetised rubber, a load of your own: a dataclass, a built load, and a kernel (docs/write-your-own-part.md).

It pulls in proportion to the distance from x = 0, so its tangent is the same kernel without the places. At `share=1`
the pull grows faster than the strip resists, and no equilibrium is left.
"""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_pd import BondAssociated, Fixed, Measure, MooneyRivlin, Newton, Sheet, Simulation
from warp_pd.device.checks import positive
from warp_pd.interfaces import BuiltLoad, Load
from warp_pd.kernels.effects import kernel
from warp_pd.kernels.numeric import numeric


@functools.cache
def pull(bits):
    """Kernel that adds the force of the field, in proportion to the distance from x = 0."""
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel()
    def add_pull(
        strength: wp.array(dtype=real), places: wp.array(dtype=real), moved: wp.array(dtype=vec3), first: int,
        out: wp.array(dtype=vec3),
    ):  # fmt: skip
        i = wp.tid() + first
        out[i] = out[i] + vec3(strength[i] * (places[i] + moved[i][0]), real(0.0), real(0.0))

    return add_pull


@dataclass(frozen=True)
class MagneticPull(Load):
    """Magnetised rubber in a field whose gradient grows with x: a force per volume of `growth` [N/m^4] times x."""

    growth: float

    def __post_init__(self):
        positive("MagneticPull.growth", self.growth)

    def build(self, context, law):
        return BuiltPull(self.growth, context)


class BuiltPull(BuiltLoad):
    label = "loads: MagneticPull"
    follows_displacement = True

    def __init__(self, growth, context):
        self.context, sheet = context, context.sheet
        real = context.types.real
        strength = growth * sheet.areas * sheet.thickness
        self.strength = context.array("magnet_strength", "MagneticPull", real, strength)
        self.places = context.array("magnet_places", "MagneticPull", real, sheet.points[:, 0])
        self.origin = context.array("magnet_origin", "MagneticPull", real, np.zeros(sheet.size))

    def _add(self, stage, places, moved, out):
        size = self.context.sheet.size
        given = {"strength": self.strength, "places": places, "moved": moved, "out": out}
        stage.launch("MagneticPull", pull(self.context.bits), size, **given)

    def add_force(self, stage, displacement, out):
        self._add(stage, self.places, displacement, out)

    def add_tangent(self, stage, displacement, direction, out):
        self._add(stage, self.origin, direction, out)  # the force is linear
        return True


def build(points=41, share=0.03):
    """A wide strip, held at x = 0; `share` is the angle k L of its closed form over pi / 2, where it gives way."""
    length, mu = 0.1, 1e5
    sheet = Sheet.rectangle(length, 0.5 * length, thickness=1e-3, density=1000.0, points=points)
    k = 0.5 * np.pi * share / length
    middle, end = sheet.nearest(length, 0.25 * length), np.arange(sheet.size)
    # 4 mu (1 + ...) u'' + growth (x + u) = 0: x + u = sin(k x) / (k cos(k L)), k^2 = growth / (4 mu).
    exact = np.tan(k * length) / k - length
    return Simulation(
        sheet,
        BondAssociated(MooneyRivlin(0.5 * mu), horizon=2.015),
        Newton(),
        loads=[Fixed(sheet.edges("left")), Fixed(end, "yz"), MagneticPull(4.0 * mu * k**2)],
        measures=[Measure("stroke", "m", lambda built, frame: frame.displacement[middle, 0], exact, "sin(k x)")],
    )
