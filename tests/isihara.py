"""A user's own material, as docs/materials.md shows it; the docs are checked against this file."""

import functools
from dataclasses import dataclass

import warp as wp

from warp_pd import Incompressible
from warp_pd.kernels.numeric import numeric


@functools.cache
def isihara_energy(bits):
    types = numeric(bits)
    real, vec6, parameters = types.real, types.vec6, types.parameters

    @wp.func
    def energy(x: real, y: real, c: parameters):
        zero = real(0.0)
        two = real(2.0)
        return vec6(
            c[0] * x + c[1] * x * x + c[2] * y,  # Psi
            c[0] + two * c[1] * x, c[2],  # by I1 and I2
            two * c[1], zero, zero,  # by I1 twice, by both, by I2 twice
        )  # fmt: skip

    return energy


@dataclass(frozen=True)
class Isihara(Incompressible):
    """Psi = c10 (I1 - 3) + c20 (I1 - 3)^2 + c01 (I2 - 3)."""

    c10: float
    c20: float
    c01: float

    @property
    def constants(self):
        return (self.c10, self.c20, self.c01)

    @property
    def energy(self):
        return isihara_energy
