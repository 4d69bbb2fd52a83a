"""Gent material in plane stress; constants mu, K, Jm. Source: BA paper.

Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J), with K = 2/D.
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
def gent_root(bits: int) -> wp.Function:
    """Function (tr C - 2, det C - 1, constants, guess) -> d = J^(2/3) - 1 of the Gent material."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    volume_of = volume(bits)
    tolerance = TOLERANCE[bits]
    steps, restart, shrink = NEWTON_STEPS, RESTART, SHRINK

    @wp.func
    def root_change(trace: real, area: real, constants: parameters, guess: real):
        # Zero of (Jm - I1b + 3) J^(4/3) sigma_33, with room = (Jm - I1b + 3) J^(2/3).
        lock = constants[2]
        slope = real(1.0) / (real(1.0) + area)
        third = constants[0] * lock / real(3.0)
        half = real(0.5) * constants[1]
        d = guess
        doubt = real(0.0)
        trust = real(1.0)
        for step in range(steps):
            if step == restart:
                d = real(0.0)
            root = real(1.0) + d
            z = volume_of(d)
            rise = real(3.0) * root * root
            thinning = slope * (z - area)
            # Kept off the lock here so that an iterate beyond it can come back.
            room = wp.max(lock * root - trace - thinning + real(3.0) * d, real(1.0e-3) * lock)
            residual = third * (real(2.0) * thinning - trace) + half * z * room
            floor = real(2.0) * third * slope * rise + half * rise * room
            tangent = floor + half * z * (lock - slope * rise + real(3.0))
            new = wp.max(d - residual / wp.max(tangent, real(0.25) * floor), real(shrink) * root - real(1.0))
            change = wp.abs(new - d)
            d = new
            # The iteration converges quadratically only within a distance of the order of `room`, the room to the lock.
            doubt = change * lock
            trust = room
            if doubt <= real(tolerance) * trust:
                break
        if doubt > real(0.1) * trust:
            d = real(wp.nan)
        return d

    return root_change


@functools.cache
def gent_volume(bits: int) -> wp.Function:
    """Function (G, constants) -> z of the Gent material."""
    return volume_from(gent_root, bits)


@functools.cache
def gent_near(bits: int) -> wp.Function:
    """Function (G, constants, guess) -> (S, d) of the Gent material, see kernels/materials.py."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    root_change = gent_root(bits)
    volume_of = volume(bits)

    @wp.func
    def stress_near(G: mat22, constants: parameters, guess: real):
        area = area_change(G)
        trace = G[0, 0] + G[1, 1]
        d = root_change(trace, area, constants, guess)
        slope = real(1.0) / (real(1.0) + area)
        thinning = slope * (volume_of(d) - area)
        room = constants[2] * (real(1.0) + d) - trace - thinning + real(3.0) * d
        if room <= real(0.0):
            room = real(wp.nan)
        return plane_stress(G, slope, thinning, constants[0] * constants[2] / room), d

    return stress_near


@functools.cache
def gent(bits: int) -> tuple[wp.Function, wp.Function]:
    """Slightly compressible Gent material; constants: mu [Pa], K = 2/D [Pa], Jm [-].

    Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J).
    Beyond the lock, I1b - 3 >= Jm at constant volume, the sheet can only swell. Where no stress is found the
    functions return NaN, and the run reports that the lock was reached. Source: BA paper's Gent sheet.
    """
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, _ = invariants(bits)
    root_change = gent_root(bits)
    volume_of = volume(bits)
    stress_near = gent_near(bits)

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
        share = excess / constants[2]
        logarithm = real(0.0)
        if share >= real(1.0):
            logarithm = real(wp.nan)
        elif wp.abs(share) < real(1.0e-3):
            logarithm = -share * (
                real(1.0) + share * (real(0.5) + share * (real(1.0) / real(3.0) + real(0.25) * share))
            )
        else:
            logarithm = wp.log(real(1.0) - share)
        volume = real(0.0)
        if wp.abs(z) < real(1.0e-2):
            volume = (
                z
                * z
                * (real(0.25) - z * (real(1.0) / real(6.0) - z * (real(0.125) - z * (real(0.1) - z / real(12.0)))))
            )
        else:
            volume = real(0.5) * (z - wp.log(real(1.0) + z))
        return -real(0.5) * constants[0] * constants[2] * logarithm + real(0.5) * constants[1] * volume

    return stress, energy


@functools.cache
def gent_response(bits: int) -> wp.Function:
    """Stress and moduli of the Gent material: U1 = -(mu Jm/2) ln(1 - (I1b - 3)/Jm), U2 = (K/4) (q - ln q)."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, excess_invariant, plane_stress = invariants(bits)
    volume_change = gent_volume(bits)
    condensed = condensation(bits)

    @wp.func
    def response(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        thinning = (z - area) / (real(1.0) + area)
        room = constants[2] - excess_invariant(G[0, 0] + G[1, 1] + thinning, z)
        if room <= real(0.0):
            room = real(wp.nan)
        first = real(0.5) * constants[0] * constants[2] / room
        S = plane_stress(G, real(1.0) / (real(1.0) + area), thinning, real(2.0) * first / wp.cbrt(real(1.0) + z))
        quarter = real(0.25) * constants[1]
        return S, condensed(G, z, first, first / room, quarter * z, quarter * (real(1.0) + z))

    return response


@functools.cache
def gent_membrane(bits: int) -> tuple[wp.Function, wp.Function]:
    """The same two functions as `neo_hookean_membrane`, for the Gent material; NaN at and beyond its lock."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    _, excess_invariant, _ = invariants(bits)

    @wp.func
    def shear(trace: real, thinning: real, z: real, constants: parameters):
        room = constants[2] - excess_invariant(trace + thinning, z)
        if room <= real(0.0):
            room = real(wp.nan)
        return constants[0] * constants[2] / (room * wp.cbrt(real(1.0) + z))

    return gent_volume(bits), shear


@functools.cache
def gent_width(bits: int) -> wp.Function:
    """Function (g1, constants) -> g2 of the Gent material in uniaxial tension, see kernels/tension_field.py.

    Beyond the lock it gives the width at which the iteration ends; the stress is then NaN.
    """
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    volume_of = volume(bits)
    tolerance = WIDTH_TOLERANCE[bits]
    steps, shrink = NEWTON_STEPS, SHRINK

    @wp.func
    def width(g1: real, constants: parameters):
        # Zero of (Jm - I1b + 3) J^(4/3) sigma_33 with C22 = C33 = J / l1, as in `root_change`.
        lock = constants[2]
        third = constants[0] * lock / real(3.0)
        half = real(0.5) * constants[1]
        s = wp.sqrt(real(1.0) + g1)
        inverse = real(1.0) / s
        d = real(0.0)
        for _step in range(steps):
            root = real(1.0) + d
            z = volume_of(d)
            rise = real(3.0) * root * root
            J = wp.sqrt(real(1.0) + z)
            thinning = inverse * (z / (real(1.0) + J) - g1 / (real(1.0) + s))
            thinning_rise = real(1.5) * inverse * J / root
            room = wp.max(lock * root - g1 - real(2.0) * thinning + real(3.0) * d, real(1.0e-3) * lock)
            residual = third * (thinning - g1) + half * z * room
            floor = third * thinning_rise + half * rise * room
            tangent = floor + half * z * (lock - real(2.0) * thinning_rise + real(3.0))
            new = wp.max(d - residual / wp.max(tangent, real(0.25) * floor), real(shrink) * root - real(1.0))
            change = wp.abs(new - d)
            d = new
            if change * lock <= real(tolerance) * room:
                break
        z = volume_of(d)
        return inverse * (z / (real(1.0) + wp.sqrt(real(1.0) + z)) - g1 / (real(1.0) + s))

    return width
