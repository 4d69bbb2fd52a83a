"""Extended tube model in plane stress: crosslinks, of the first invariant, and a tube of chains, of the stretches.

Kaliske and Heinrich, Rubber Chem. Technol. 72 (1999) 602. The tube is a term of Ogden's material,

    2 ge / beta^2 (l1^-beta + l2^-beta + l3^-beta - 3),   so mu = -2 ge / beta, exponent -beta.

Incompressible sheets in plane stress have no pressure to find, so energies, stresses and moduli add.
"""

import functools

import warp as wp

from .incompressible import incompressible, incompressible_sheet, incompressible_width
from .materials import MaterialFunctions
from .numeric import numeric
from .ogden import log_one_plus, ogden

# Least beta: the energy of smaller ones differs by less than this, and its factors would leave the range of float32.
LEAST = 1e-6


@functools.cache
def crosslinks(bits: int) -> wp.Function:
    """The part of chemical crosslinks in the extended tube model; constants: gc [Pa], delta [-].

    Psi = gc / 2 ((1 - delta^2) (I1 - 3) / (1 - delta^2 (I1 - 3)) + ln(1 - delta^2 (I1 - 3))).
    """
    types = numeric(bits)
    real, vec6, parameters, log_of = types.real, types.vec6, types.parameters, log_one_plus(bits)

    @wp.func
    def energy(x: real, y: real, c: parameters):
        one = real(1.0)
        zero = real(0.0)
        s = c[1] * c[1]
        left = one - s * x
        if left <= zero:
            # Beyond the length of the chains there is no state.
            left = real(wp.nan)
        half = real(0.5) * c[0]
        ratio = (one - s) / left
        return vec6(
            half * (ratio * x + log_of(-s * x)), half * (ratio - s) / left, zero,
            half * s * (real(2.0) * ratio - s) / (left * left), zero, zero,
        )  # fmt: skip

    return energy


@functools.cache
def extended_tube_parts(bits: int) -> tuple[wp.Function, ...]:
    """Stress, energy and response; constants: gc [Pa], delta [-], ge [Pa], beta [-]."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    # Two terms share their kernels with Ogden's material, see `Ogden.on_device`; the second is zero.
    Terms, least = types.constants(4), LEAST
    links, tube = incompressible(crosslinks), ogden(2)
    (link_stress, link_energy), (tube_stress, tube_energy) = links.functions(bits), tube.functions(bits)
    assert links.response is not None and tube.response is not None
    link_response, tube_response = links.response(bits), tube.response(bits)

    @wp.func
    def term(c: parameters):
        beta = wp.max(c[3], real(least))
        return Terms(-real(2.0) * c[2] / beta, -beta, real(0.0), real(0.0))

    @wp.func
    def stress(G: mat22, constants: parameters):
        return link_stress(G, constants) + tube_stress(G, term(constants))

    @wp.func
    def energy(G: mat22, constants: parameters):
        return link_energy(G, constants) + tube_energy(G, term(constants))

    @wp.func
    def stress_and_moduli(G: mat22, constants: parameters):
        of_links, link_moduli = link_response(G, constants)
        of_tube, tube_moduli = tube_response(G, term(constants))
        return of_links + of_tube, link_moduli + tube_moduli

    return stress, energy, stress_and_moduli


def extended_tube() -> MaterialFunctions:
    """All functions of the model."""
    return incompressible_sheet(extended_tube_parts, incompressible_width)
