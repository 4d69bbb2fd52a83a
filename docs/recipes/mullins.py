"""Mullins softening: rubber that was stretched is softer until it is stretched further.

S = eta S0, eta = 1 - erf((Wm - W) / (m + b Wm)) / r, with the energy W of the virgin rubber and the largest one so far,
Wm: Ogden and Roxburgh, Proc. R. Soc. A 455 (1999) 2861. Each intersection of two families remembers its own Wm. The
strain energy includes what softening has dissipated.
"""

import functools
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from warp_pd import MooneyRivlin
from warp_pd.device.checks import InputError, not_negative, positive
from warp_pd.kernels.incompressible import incompressible_sheet
from warp_pd.kernels.numeric import numeric
from warp_pd.materials import PlaneStress


@functools.cache
def softened_rubber(bits):
    types, rubber = numeric(bits), MooneyRivlin(1.0).on_device
    real, mat22, vec6, parameters = types.real, types.mat22, types.vec6, types.parameters
    Constants = types.constants(5)  # c10, r, m, b, Wm
    (rubber_stress, rubber_energy), rubber_response = rubber.functions(bits), rubber.response(bits)
    root_pi = float(np.sqrt(np.pi))

    @wp.func
    def of_rubber(c: Constants):
        return parameters(c[0], real(0.0), real(0.0), real(0.0))

    @wp.func
    def virgin(G: mat22, c: Constants):
        return rubber_energy(G, of_rubber(c))

    @wp.func
    def unloaded(G: mat22, c: Constants):
        width = c[2] + c[3] * c[4]
        return wp.max(c[4] - virgin(G, c), real(0.0)) / width, width

    @wp.func
    def stress(G: mat22, c: Constants):
        z, _ = unloaded(G, c)
        return (real(1.0) - wp.erf(z) / c[1]) * rubber_stress(G, of_rubber(c))

    @wp.func
    def energy(G: mat22, c: Constants):
        z, width = unloaded(G, c)
        return virgin(G, c) + width / c[1] * (z * wp.erf(z) + (wp.exp(-z * z) - real(1.0)) / real(root_pi))

    @wp.func
    def response(G: mat22, c: Constants):
        S, T = rubber_response(G, of_rubber(c))
        z, width = unloaded(G, c)
        eta = real(1.0) - wp.erf(z) / c[1]
        T = eta * T
        if z > real(0.0):
            s = types.vec3(S[0, 0], S[1, 1], real(2.0) * S[0, 1])
            h = wp.exp(-z * z) / (real(root_pi) * c[1] * width)
            T += h * vec6(s[0] * s[0], s[0] * s[1], s[0] * s[2], s[1] * s[1], s[1] * s[2], s[2] * s[2])
        return eta * S, T

    return stress, energy, response, virgin


@dataclass(frozen=True)
class Mullins(PlaneStress):
    """A neo-Hookean sheet that softens: c10 and m [Pa], r and b [-]."""

    c10: float
    r: float
    m: float
    b: float = 0.0

    isotropic: ClassVar = True
    on_device: ClassVar = incompressible_sheet(softened_rubber)

    def __post_init__(self):
        for name in ("c10", "r", "m"):
            positive(f"Mullins.{name}", getattr(self, name))
        not_negative("Mullins.b", self.b)
        if self.r <= 1.0:
            raise InputError(f"Mullins.r = {self.r!r}: expected more than 1, or rubber softens to nothing")

    @property
    def constants(self):
        return self.c10, self.r, self.m, self.b, 0.0

    @staticmethod
    def remembers(bits):
        return softened_rubber(bits)[3]
