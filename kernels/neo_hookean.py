"""Neo-Hookean material in plane stress; constants mu, K. Source: NN paper.

Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2).
"""

import functools

import warp as wp

from .materials import (
    NEWTON_STEPS,
    RESTART,
    SHRINK,
    TOLERANCE,
    WIDTH_TOLERANCE,
    condensation,
    invariants,
    volume,
    volume_from,
)
from .numeric import numeric


@functools.cache
def neo_hookean_root(bits: int) -> wp.Function:
    """Function (tr C - 2, det C - 1, constants, guess) -> d = J^(2/3) - 1 of the neo-Hookean material."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    volume_of = volume(bits)
    tolerance = TOLERANCE[bits]
    steps, restart, shrink = NEWTON_STEPS, RESTART, SHRINK

    @wp.func
    def root_change(trace: real, area: real, constants: parameters, guess: real):
        # Zero of J^(2/3) sigma_33: the factor makes it rise strictly with d, whatever the state.
        slope = real(1.0) / (real(1.0) + area)
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
            r = real(1.0) / q
            residual = third * (real(2.0) * thinning - trace) + quarter * root * z * (real(2.0) + z) * r
            tangent = real(6.0) * third * slope * root * root + quarter * (real(4.0) * q + real(2.0) * r)
            new = wp.max(d - residual / tangent, real(shrink) * root - real(1.0))
            change = wp.abs(new - d)
            d = new
            if change <= real(tolerance) * root:
                break
        return d

    return root_change


@functools.cache
def neo_hookean_volume(bits: int) -> wp.Function:
    """Function (G, constants) -> z of the neo-Hookean material."""
    return volume_from(neo_hookean_root, bits)


@functools.cache
def neo_hookean_near(bits: int) -> wp.Function:
    """Function (G, constants, guess) -> (S, d) of the neo-Hookean material, see kernels/materials.py."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    root_change = neo_hookean_root(bits)
    volume_of = volume(bits)

    @wp.func
    def stress_near(G: mat22, constants: parameters, guess: real):
        area = area_change(G)
        trace = G[0, 0] + G[1, 1]
        d = root_change(trace, area, constants, guess)
        slope = real(1.0) / (real(1.0) + area)
        thinning = slope * (volume_of(d) - area)
        return plane_stress(G, slope, thinning, constants[0] / (real(1.0) + d)), d

    return stress_near


@functools.cache
def neo_hookean(bits: int) -> tuple[wp.Function, wp.Function]:
    """Slightly compressible neo-Hookean material; constants: mu [Pa], K [Pa].

    Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2), I1b = J^(-2/3) (tr C + C33), J^2 = C33 det C.
    Source: NN paper's neo-Hookean sheet.
    """
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, _ = invariants(bits)
    root_change = neo_hookean_root(bits)
    volume_of = volume(bits)
    stress_near = neo_hookean_near(bits)

    @wp.func
    def stress(G: mat22, constants: parameters):
        S, _ = stress_near(G, constants, real(0.0))
        return S

    @wp.func
    def energy(G: mat22, constants: parameters):
        area = area_change(G)
        trace = G[0, 0] + G[1, 1]
        d = root_change(trace, area, constants, real(0.0))
        z = volume_of(d)
        thinning = (z - area) / (real(1.0) + area)
        excess = (trace + thinning - real(3.0) * d) / (real(1.0) + d)
        return real(0.5) * constants[0] * excess + constants[1] / real(8.0) * (z * z / (real(1.0) + z))

    return stress, energy


@functools.cache
def neo_hookean_response(bits: int) -> wp.Function:
    """Stress and moduli of the neo-Hookean material: U1 = mu/2 I1b, U2 = K/8 (q + 1/q)."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    volume_change = neo_hookean_volume(bits)
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


@functools.cache
def neo_hookean_membrane(bits: int) -> tuple[wp.Function, wp.Function]:
    """Functions z and g for force laws that write the first Piola stress as g (F - C33 F^-T).

    They are (G, constants) -> z = J^2 - 1 and (tr C - 2, C33 - 1, z, constants) -> g [Pa].
    """
    types = numeric(bits)
    real, parameters = types.real, types.parameters

    @wp.func
    def shear(trace: real, thinning: real, z: real, constants: parameters):
        return constants[0] / wp.cbrt(real(1.0) + z)

    return neo_hookean_volume(bits), shear


@functools.cache
def neo_hookean_width(bits: int) -> wp.Function:
    """Function (g1, constants) -> g2 of the neo-Hookean material in uniaxial tension, see kernels/tension_field.py."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    volume_of = volume(bits)
    tolerance = WIDTH_TOLERANCE[bits]
    steps, shrink = NEWTON_STEPS, SHRINK

    @wp.func
    def width(g1: real, constants: parameters):
        # Zero of J^(2/3) sigma_33 with C22 = C33 = J / l1, an unknown d = J^(2/3) - 1, as in `root_change`.
        third = constants[0] / real(3.0)
        quarter = real(0.25) * constants[1]
        s = wp.sqrt(real(1.0) + g1)
        inverse = real(1.0) / s
        d = real(0.0)
        thinning = real(0.0)
        for _step in range(steps):
            root = real(1.0) + d
            z = volume_of(d)
            q = root * root * root
            r = real(1.0) / q
            J = wp.sqrt(q)
            thinning = inverse * (z / (real(1.0) + J) - g1 / (real(1.0) + s))
            residual = third * (thinning - g1) + quarter * root * z * (real(2.0) + z) * r
            tangent = real(1.5) * third * inverse * J / root + quarter * (real(4.0) * q + real(2.0) * r)
            new = wp.max(d - residual / tangent, real(shrink) * root - real(1.0))
            change = wp.abs(new - d)
            d = new
            if change <= real(tolerance) * root:
                break
        z = volume_of(d)
        return inverse * (z / (real(1.0) + wp.sqrt(real(1.0) + z)) - g1 / (real(1.0) + s))

    return width
