"""Pairwise laws: the force of a bond as a function of its strain.

A law is a cached factory, precision in bits -> Warp functions (force, slope, energy) of (strain, constants), all
in Pa: the force f(s) at the strain s = |Y|/|X| - 1, its derivative by s, and its integral from 0 to s. The force law
(kernels/papers/bond_based.py) multiplies them by the weight of the bond.
"""

import functools

import warp as wp

from ..numeric import numeric


@functools.cache
def bimodular(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Bimodular law (IM, section 4): f = E+ s in tension, E- s in compression; constants E+, E-."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters

    @wp.func
    def slope(strain: real, constants: parameters):
        modulus = constants[0]
        if strain < real(0.0):
            modulus = constants[1]
        return modulus

    @wp.func
    def force(strain: real, constants: parameters):
        return slope(strain, constants) * strain

    @wp.func
    def energy(strain: real, constants: parameters):
        return real(0.5) * force(strain, constants) * strain

    return force, slope, energy
