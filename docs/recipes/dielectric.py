"""A dielectric elastomer: compliant electrodes on both faces at a voltage, and the stress of Maxwell between them.

Psi - v/2 det C with v = permittivity (voltage / thickness)^2 [Pa] at constant volume: Suo, Acta Mech. Solida Sin. 23
(2010) 549. v is a value by point, which ValuesInTime changes.
"""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import warp as wp

from warp_pd import MooneyRivlin
from warp_pd.device.checks import finite, positive
from warp_pd.kernels.incompressible import incompressible_sheet
from warp_pd.kernels.numeric import numeric


def charged_rubber(bits):
    types, rubber = numeric(bits), MooneyRivlin(1.0).on_device
    real, mat22, vec6, parameters = types.real, types.mat22, types.vec6, types.parameters
    (rubber_stress, rubber_energy), rubber_response = rubber.functions(bits), rubber.response(bits)

    @wp.func
    def maxwell(G: mat22, v: real):
        return -v * mat22(real(1.0) + G[1, 1], -G[0, 1], -G[0, 1], real(1.0) + G[0, 0])

    @wp.func
    def stress(G: mat22, c: parameters):
        return rubber_stress(G, c) + maxwell(G, c[3])

    @wp.func
    def energy(G: mat22, c: parameters):
        return rubber_energy(G, c) - real(0.5) * c[3] * (G[0, 0] + G[1, 1] + wp.determinant(G))

    @wp.func
    def response(G: mat22, c: parameters):
        S, T = rubber_response(G, c)
        zero, one = real(0.0), real(1.0)
        return S + maxwell(G, c[3]), T + c[3] * vec6(zero, -one, zero, zero, zero, real(2.0))

    return stress, energy, response


@dataclass(frozen=True)
class DielectricSheet(MooneyRivlin):
    """A neo-Hookean sheet whose electrodes carry a voltage; `c10` is half its shear modulus [Pa].

    `by_point`: permittivity (voltage / thickness)^2 [Pa], a number, shape (N,) or a function.
    """

    by_point: Any = field(default=0.0, kw_only=True)
    on_device: ClassVar = incompressible_sheet(charged_rubber)


def charge(permittivity, voltage, thickness):
    """`by_point` of a voltage [V]; ValuesInTime then has the square of what the voltage is multiplied by."""
    return positive("permittivity", permittivity) * (finite("voltage", voltage) / positive("thickness", thickness)) ** 2
