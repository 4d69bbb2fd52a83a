"""A temperature that changes the modulus: the entropic elasticity of rubber, mu = mu0 T / T0.

Treloar, The Physics of Rubber Elasticity (1975), chapter 4. T / T0 is a value by point, which ValuesInTime changes.
"""

from dataclasses import dataclass, field
from typing import Any

import warp as wp

from warp_pd import MooneyRivlin
from warp_pd.kernels.incompressible import incompressible_sheet
from warp_pd.kernels.numeric import numeric


def warm_rubber(bits):
    types, rubber = numeric(bits), MooneyRivlin(1.0).on_device
    mat22, parameters = types.mat22, types.parameters
    (rubber_stress, rubber_energy), rubber_response = rubber.functions(bits), rubber.response(bits)

    @wp.func
    def stress(G: mat22, c: parameters):
        return c[3] * rubber_stress(G, c)

    @wp.func
    def energy(G: mat22, c: parameters):
        return c[3] * rubber_energy(G, c)

    @wp.func
    def response(G: mat22, c: parameters):
        S, T = rubber_response(G, c)
        return c[3] * S, c[3] * T

    return stress, energy, response


@dataclass(frozen=True)
class WarmRubber(MooneyRivlin):
    """A Mooney-Rivlin sheet with c10 and c01 [Pa] at a reference temperature.

    `by_point`: absolute temperature over that of reference, a number, shape (N,) or a function of the coordinates.
    """

    by_point: Any = field(default=1.0, kw_only=True)

    @property
    def on_device(self):
        return incompressible_sheet(warm_rubber)
