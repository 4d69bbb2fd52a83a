"""Air drag: a force against the velocity, 1/2 density coefficient |v| v per area."""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_pd.device.checks import positive
from warp_pd.interfaces import BuiltPart, Columns, Part
from warp_pd.kernels.effects import kernel
from warp_pd.kernels.numeric import numeric
from warp_pd.step import Phase


@functools.cache
def slow_down(bits):
    """Kernel that takes from the velocity what drag takes in a step."""
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel()
    def add_drag(
        drag: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        step: wp.array(dtype=real),
        first: int,
        velocity: wp.array(dtype=vec3),
        lost: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        v = velocity[i]
        # dv/dt = -b |v| v for a step, exactly: no coefficient is too large.
        slower = v / (real(1.0) + drag[i] * wp.length(v) * step[0] / mass[i])
        lost[i] = lost[i] + wp.float64(real(0.5) * mass[i] * wp.dot(v - slower, v + slower))
        velocity[i] = slower

    return add_drag


@dataclass(frozen=True)
class AirDrag(Part):
    """Drag of still air on both faces together; `density` of the air [kg/m^3], `coefficient` [-]. Only with Explicit.

    Points with a held component feel none.
    """

    density: float = 1.2
    coefficient: float = 1.0

    def __post_init__(self):
        positive("AirDrag.density", self.density)
        positive("AirDrag.coefficient", self.coefficient)

    def build(self, context, law):
        return BuiltDrag(0.5 * self.density * self.coefficient, context)


class BuiltDrag(BuiltPart):
    label = "loads: AirDrag"

    def __init__(self, pressure, context):
        self.context, size = context, context.sheet.size
        drag = np.where(context.held == 0, pressure * context.sheet.areas, 0.0)
        self.drag = context.array("drag", "AirDrag", context.types.real, drag)
        self.lost = context.array("lost_to_drag", "AirDrag", wp.float64, shape=size, restart=True)

    def add(self, phase, stage):
        if phase is Phase.SEPARATE:
            state, add_drag = self.context.state, slow_down(self.context.bits)
            stage.launch(
                "AirDrag", add_drag, self.context.sheet.size,
                drag=self.drag, mass=state.mass, step=state.step, velocity=state.velocity, lost=self.lost,
            )  # fmt: skip

    def columns(self):
        return Columns(lost={"drag": self.lost})
