"""Slightly compressible neo-Hookean material in plane stress; constants: mu [Pa], K [Pa]. Source: NN paper.

Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2), I1b = J^(-2/3) (tr C + C33), J^2 = C33 det C.
"""

import functools

import warp as wp

from .compressible import Equations, compressible
from .division import division
from .materials import NEWTON_STEPS, RESTART, SHRINK, TOLERANCE, condensation, invariants, volume
from .numeric import numeric


@functools.cache
def neo_hookean_equations(bits: int) -> Equations:
    """The equations of the material."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    volume_of, quotient = volume(bits), division(bits)
    tolerance = TOLERANCE[bits]
    steps, restart, shrink = NEWTON_STEPS, RESTART, SHRINK

    @wp.func
    def root_change(trace: real, area: real, slope: real, constants: parameters, guess: real):
        # Zero of J^(2/3) sigma_33: the factor makes it rise strictly with d, whatever the state.
        third = constants[0] / real(3.0)
        quarter = real(0.25) * constants[1]
        d = guess
        for step in range(steps):
            if step == restart:
                d = real(0.0)
            root = real(1.0) + d
            z = volume_of(d)
            q = root * root * root
            thinning = slope * (z - area)
            r = quotient(real(1.0), q)
            residual = third * (real(2.0) * thinning - trace) + quarter * root * z * (real(2.0) + z) * r
            tangent = real(6.0) * third * slope * root * root + quarter * (real(4.0) * q + real(2.0) * r)
            new = wp.max(d - quotient(residual, tangent), real(shrink) * root - real(1.0))
            change = wp.abs(new - d)
            d = new
            if change <= real(tolerance) * root:
                break
        return d

    @wp.func
    def shear_of(trace: real, thinning: real, d: real, constants: parameters):
        return quotient(constants[0], real(1.0) + d)

    @wp.func
    def stored(excess: real, z: real, constants: parameters):
        return real(0.5) * constants[0] * excess + constants[1] / real(8.0) * (z * z / (real(1.0) + z))

    @wp.func
    def balance(d: real, z: real, g1: real, s: real, constants: parameters):
        # J^(2/3) sigma_33, as in `root_change`.
        third = constants[0] / real(3.0)
        quarter = real(0.25) * constants[1]
        inverse = real(1.0) / s
        root = real(1.0) + d
        q = root * root * root
        r = real(1.0) / q
        J = wp.sqrt(q)
        thinning = inverse * (z / (real(1.0) + J) - g1 / (real(1.0) + s))
        residual = third * (thinning - g1) + quarter * root * z * (real(2.0) + z) * r
        tangent = real(1.5) * third * inverse * J / root + quarter * (real(4.0) * q + real(2.0) * r)
        return residual, tangent, real(1.0), root

    @wp.func
    def membrane_shear(trace: real, thinning: real, z: real, constants: parameters):
        return constants[0] / wp.cbrt(real(1.0) + z)

    return Equations(root_change, shear_of, stored, balance, membrane_shear)


@functools.cache
def neo_hookean_response(bits: int) -> wp.Function:
    """Stress and moduli of the neo-Hookean material: U1 = mu/2 I1b, U2 = K/8 (q + 1/q)."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    volume_change = neo_hookean.volume(bits)
    condensed = condensation(bits)

    @wp.func
    def response(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        inverse_area = real(1.0) / (real(1.0) + area)
        S = plane_stress(G, inverse_area, inverse_area * (z - area), constants[0] / wp.cbrt(real(1.0) + z))
        q = real(1.0) + z
        eighth = constants[1] / real(8.0)
        slope = eighth * (z + z / q)
        return S, condensed(G, z, real(0.5) * constants[0], real(0.0), slope, eighth * (q + real(1.0) / q))

    return response


neo_hookean = compressible(neo_hookean_equations, neo_hookean_response)
