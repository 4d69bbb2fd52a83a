"""A gas that leaves through a valve: an orifice that opens above a pressure."""

import functools
from dataclasses import dataclass

import warp as wp

from warp_pd import EnclosedGas
from warp_pd.device.checks import not_negative, positive
from warp_pd.gas import BuiltEnclosed
from warp_pd.kernels.effects import kernel
from warp_pd.kernels.numeric import numeric
from warp_pd.step import Phase


@functools.cache
def flow(bits):
    """Kernel that takes from the gas what flows out in a step."""
    real = numeric(bits).real

    @kernel(per="once")
    def let_out(
        enclosed: wp.array(dtype=wp.float64),
        step: wp.array(dtype=real),
        area: wp.float64,
        opens_at: wp.float64,
        mass: wp.float64,
        first: int,
        left: wp.array(dtype=wp.float64),
    ):
        if enclosed[0] > opens_at:
            # dm/dt = -area sqrt(2 p rho) with rho = m / V; `left` is m over the mass at the start.
            rate = area * wp.sqrt(wp.float64(2.0) * enclosed[0] * left[0] / (mass * enclosed[1]))
            left[0] = left[0] - wp.min(rate * wp.float64(step[0]), left[0])

    return let_out


@dataclass(frozen=True)
class GasWithValve(EnclosedGas):
    """An EnclosedGas with an orifice to the air.

    `opening`: area of the orifice times its discharge coefficient [m^2]; `opens_at`: pressure above ambient [Pa].
    """

    opening: float = 0.0
    opens_at: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        positive("GasWithValve.opening", self.opening)
        not_negative("GasWithValve.opens_at", self.opens_at)

    @property
    def loses(self):
        return True

    def build(self, context, law):
        return BuiltValve(self, context, law)


class BuiltValve(BuiltEnclosed):
    def __init__(self, gas, context, law):
        super().__init__(gas, context, law)
        self.gas = gas
        absolute, volume, ambient, exponent = (float(number) for number in self.constants)
        self.mass = gas.density * (absolute / ambient) ** (1.0 / exponent) * volume

    def add(self, phase, stage):
        super().add(phase, stage)
        if phase is Phase.INTERNAL_VARIABLES:
            state, gas = self.context.state, self.gas
            self.add_pressure(stage, state.displacement)
            stage.launch(
                self.owner, flow(self.context.bits), 1,
                enclosed=self.enclosed, step=state.step, area=gas.opening, opens_at=gas.opens_at, mass=self.mass,
                left=self.left,
            )  # fmt: skip
