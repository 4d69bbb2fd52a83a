"""Fibres: two families in a rubber, with a direction that every point of a curved sheet carries.

Psi = c10 (I1 - 3) + sum k1 / (2 k2) (exp(k2 E^2) - 1), E = a.C.a - 1 of fibres in tension: Holzapfel, Gasser and Ogden,
J. Elasticity 61 (2000) 1. The families lie at plus and minus `angle` from the direction of the point.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warp_pd import MooneyRivlin
from warp_pd.device.checks import InputError, finite, numbers, positive
from warp_pd.kernels.incompressible import incompressible_sheet
from warp_pd.kernels.numeric import numeric
from warp_pd.materials import PlaneStress


def fibred_rubber(bits):
    types, rubber = numeric(bits), MooneyRivlin(1.0).on_device
    real, mat22, vec2, vec6, parameters = types.real, types.mat22, types.vec2, types.vec6, types.parameters
    Constants = types.constants(5)  # c10, k1, k2, angle, direction
    (rubber_stress, rubber_energy), rubber_response = rubber.functions(bits), rubber.response(bits)

    @wp.func
    def of_rubber(c: Constants):
        return parameters(c[0], real(0.0), real(0.0), real(0.0))

    @wp.func
    def fibre(G: mat22, c: Constants, sign: real):
        turn = c[4] + sign * c[3]
        a = vec2(wp.cos(turn), wp.sin(turn))
        return a, wp.max(wp.dot(a, G * a), real(0.0))

    @wp.func
    def stress(G: mat22, c: Constants):
        S = rubber_stress(G, of_rubber(c))
        for k in range(2):
            a, E = fibre(G, c, real(2 * k - 1))
            S += real(2.0) * c[1] * E * wp.exp(c[2] * E * E) * wp.outer(a, a)
        return S

    @wp.func
    def energy(G: mat22, c: Constants):
        total = rubber_energy(G, of_rubber(c))
        for k in range(2):
            _, E = fibre(G, c, real(2 * k - 1))
            total += real(0.5) * c[1] / c[2] * (wp.exp(c[2] * E * E) - real(1.0))
        return total

    @wp.func
    def response(G: mat22, c: Constants):
        _, T = rubber_response(G, of_rubber(c))
        for k in range(2):
            a, E = fibre(G, c, real(2 * k - 1))
            x, y, z = a[0] * a[0], a[1] * a[1], real(2.0) * a[0] * a[1]
            if E > real(0.0):
                h = real(2.0) * c[1] * (real(1.0) + real(2.0) * c[2] * E * E) * wp.exp(c[2] * E * E)
                T += h * vec6(x * x, x * y, x * z, y * y, y * z, z * z)
        return stress(G, c), T

    return stress, energy, response


@dataclass(frozen=True, eq=False)
class Fibres(PlaneStress):
    """`by_point`: angle from the first axis of the point's frame to its direction [rad], see `along`."""

    c10: float
    k1: float
    k2: float
    angle: float
    by_point: Any = 0.0

    isotropic: ClassVar = False
    on_device: ClassVar = incompressible_sheet(fibred_rubber)

    def __post_init__(self):
        for name in ("c10", "k1", "k2"):
            positive(f"Fibres.{name}", getattr(self, name))
        finite("Fibres.angle", self.angle)

    @property
    def constants(self):
        return self.c10, self.k1, self.k2, self.angle, 0.0


def along(sheet, directions):
    """Angles of directions in space [rad], (N, 3), in the frames of the points."""
    if np.shape(directions) != (sheet.size, 3):
        raise InputError(f"directions: expected shape ({sheet.size}, 3), got {np.shape(directions)}")
    directions = numbers("directions", directions)
    frames = np.eye(3)[None, :, :2] if sheet.frames is None else sheet.frames
    first, second = (np.sum(frames[:, :, k] * directions, axis=1) for k in range(2))
    return np.arctan2(second, first)
