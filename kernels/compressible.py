"""Slightly compressible materials in plane stress: Newton's iteration finds the thickness stretch.

A material is defined by a few Warp functions, `Equations`. From them `compressible` builds the functions that force
laws, fast paths and tension field theory need (see kernels/materials.py). The stress is S = g (I - C33 C^-1).

Neo-Hookean; constants: mu [Pa], K [Pa]. Source: NN paper.

Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2), I1b = J^(-2/3) (tr C + C33), J^2 = C33 det C.

Gent; constants: mu [Pa], K = 2/D [Pa], Jm [-]. Source: BA paper.

Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J).
Beyond the locking stretch, I1b - 3 >= Jm at constant volume, the sheet can only swell. If no stress is found, the
functions return NaN, and the run reports that the locking stretch was reached; the width is then the last iterate.

`continued_gent` has a fourth constant x_s < Jm: from I1b - 3 = x_s on the logarithm goes on as its tangent
(kernels/tearing/continuation.py), so there is no lock.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from .materials import (
    NEWTON_STEPS,
    RESTART,
    SHRINK,
    TOLERANCE,
    WIDTH_TOLERANCE,
    MaterialFunctions,
    condensation,
    invariants,
    named,
    volume,
)
from .numeric import FunctionFactory, division, numeric


@dataclass(frozen=True)
class Equations:
    """Warp functions of a material in one precision, with d = J^(2/3) - 1 and z = J^2 - 1.

    Attributes:
        root_change: (tr C - 2, det C - 1, 1 / det C, constants, guess) -> d.
        shear_of: (tr C - 2, C33 - 1, d, constants) -> g [Pa].
        stored: (I1b - 3, z, constants) -> Psi [J/m^3].
        balance: (d, z, C11 - 1, sqrt(C11), constants) -> four numbers for uniaxial tension: a residual that vanishes
            with sigma_33, its derivative by d, and two scales: the iteration ends when its step times the third number
            is small compared with the fourth.
        membrane_shear: (tr C - 2, C33 - 1, z, constants) -> g [Pa], for laws that write the first Piola stress as
            g (F - C33 F^-T).
    """

    root_change: wp.Function
    shear_of: wp.Function
    stored: wp.Function
    balance: wp.Function
    membrane_shear: wp.Function


@functools.cache
def compressible(equations: Callable[[int], Equations], response: FunctionFactory) -> MaterialFunctions:
    """Build all functions of a material from the cached factories of its equations and of its response."""

    def near_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, plane_stress = invariants(bits)
        root_change, shear_of, volume_of = equations(bits).root_change, equations(bits).shear_of, volume(bits)
        quotient = division(bits)

        @wp.func
        def stress_near(G: mat22, constants: parameters, guess: real):
            area = area_change(G)
            trace = G[0, 0] + G[1, 1]
            slope = quotient(real(1.0), real(1.0) + area)
            d = root_change(trace, area, slope, constants, guess)
            thinning = slope * (volume_of(d) - area)
            return plane_stress(G, slope, thinning, shear_of(trace, thinning, d, constants)), d

        return stress_near

    near = named(near_of, equations, "near")

    def functions_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, _ = invariants(bits)
        root_change, stored, volume_of = equations(bits).root_change, equations(bits).stored, volume(bits)
        stress_near, quotient = near(bits), division(bits)

        @wp.func
        def stress(G: mat22, constants: parameters):
            S, _ = stress_near(G, constants, real(0.0))
            return S

        @wp.func
        def energy(G: mat22, constants: parameters):
            area = area_change(G)
            trace = G[0, 0] + G[1, 1]
            slope = quotient(real(1.0), real(1.0) + area)
            d = root_change(trace, area, slope, constants, real(0.0))
            z = volume_of(d)
            thinning = slope * (z - area)
            return stored((trace + thinning - real(3.0) * d) / (real(1.0) + d), z, constants)

        return stress, energy

    def change_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, _ = invariants(bits)
        root_change, volume_of, quotient = equations(bits).root_change, volume(bits), division(bits)

        @wp.func
        def volume_change(G: mat22, constants: parameters):
            area = area_change(G)
            slope = quotient(real(1.0), real(1.0) + area)
            return volume_of(root_change(G[0, 0] + G[1, 1], area, slope, constants, real(0.0)))

        return volume_change

    def width_of(bits):
        types = numeric(bits)
        real, parameters = types.real, types.parameters
        balance, volume_of = equations(bits).balance, volume(bits)
        steps, shrink, tolerance = NEWTON_STEPS, SHRINK, WIDTH_TOLERANCE[bits]

        @wp.func
        def width(g1: real, constants: parameters):
            # C22 = C33 = J / l1.
            s = wp.sqrt(real(1.0) + g1)
            d = real(0.0)
            for _step in range(steps):
                residual, slope, factor, scale = balance(d, volume_of(d), g1, s, constants)
                new = wp.max(d - residual / slope, real(shrink) * (real(1.0) + d) - real(1.0))
                change = wp.abs(new - d)
                d = new
                if change * factor <= real(tolerance) * scale:
                    break
            z = volume_of(d)
            inverse = real(1.0) / s
            return inverse * (z / (real(1.0) + wp.sqrt(real(1.0) + z)) - g1 / (real(1.0) + s))

        return width

    change = named(change_of, equations, "volume")
    return MaterialFunctions(
        named(functions_of, equations, "functions"),
        near,
        response,
        change,
        named(width_of, equations, "width"),
        named(lambda bits: (change(bits), equations(bits).membrane_shear), equations, "membrane"),
    )


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
    root_change, volume_of, condensed = neo_hookean_equations(bits).root_change, volume(bits), condensation(bits)

    @wp.func
    def response(G: mat22, constants: parameters):
        area = area_change(G)
        inverse_area = real(1.0) / (real(1.0) + area)
        d = root_change(G[0, 0] + G[1, 1], area, inverse_area, constants, real(0.0))
        z = volume_of(d)
        e = real(1.0) / (real(1.0) + d)
        S = plane_stress(G, inverse_area, inverse_area * (z - area), constants[0] * e)
        q = real(1.0) + z
        r = e * e * e
        eighth = constants[1] / real(8.0)
        return S, condensed(
            G, z, e, real(0.5) * constants[0], real(0.0), eighth * z * (real(1.0) + r), eighth * (q + r)
        )

    return response


neo_hookean = compressible(neo_hookean_equations, neo_hookean_response)


@functools.cache
def locking_equations(bits: int, continued: bool) -> Equations:
    """The equations of the material, `continued` beyond x_s or not."""
    types = numeric(bits)
    real, parameters = types.real, types.parameters
    _, excess_invariant, _ = invariants(bits)
    volume_of, quotient = volume(bits), division(bits)
    tolerance = TOLERANCE[bits]
    steps, restart, shrink = NEWTON_STEPS, RESTART, SHRINK

    @wp.func
    def least_room(constants: parameters):
        """Jm - I1b + 3 is no less than this where the energy goes on as its tangent."""
        room = real(0.0)
        if wp.static(continued):
            room = constants[2] - constants[3]
        return room

    @wp.func
    def root_change(trace: real, area: real, slope: real, constants: parameters, guess: real):
        # Zero of (Jm - I1b + 3) J^(4/3) sigma_33, with room = (Jm - I1b + 3) J^(2/3).
        lock = constants[2]
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
            room = lock * root - trace - thinning + real(3.0) * d
            growth = lock - slope * rise + real(3.0)
            if wp.static(continued):
                if room < least_room(constants) * root:
                    growth = least_room(constants)
                    room = growth * root
            else:
                room = wp.max(room, real(1.0e-3) * lock)
            residual = third * (real(2.0) * thinning - trace) + half * z * room
            floor = real(2.0) * third * slope * rise + half * rise * room
            tangent = floor + half * z * growth
            new = wp.max(d - quotient(residual, wp.max(tangent, real(0.25) * floor)), real(shrink) * root - real(1.0))
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

    @wp.func
    def shear_of(trace: real, thinning: real, d: real, constants: parameters):
        room = constants[2] * (real(1.0) + d) - trace - thinning + real(3.0) * d
        if wp.static(continued):
            room = wp.max(room, least_room(constants) * (real(1.0) + d))
        if room <= real(0.0):
            room = real(wp.nan)
        return quotient(constants[0] * constants[2], room)

    @wp.func
    def stored(excess: real, z: real, constants: parameters):
        over = real(0.0)
        if wp.static(continued):
            over = wp.max(excess - constants[3], real(0.0))
        ratio = (excess - over) / constants[2]
        logarithm = real(0.0)
        if ratio >= real(1.0):
            logarithm = real(wp.nan)
        elif wp.abs(ratio) < real(1.0e-3):
            logarithm = -ratio * (
                real(1.0) + ratio * (real(0.5) + ratio * (real(1.0) / real(3.0) + real(0.25) * ratio))
            )
        else:
            logarithm = wp.log(real(1.0) - ratio)
        volume = real(0.0)
        if wp.abs(z) < real(1.0e-2):
            volume = (
                z
                * z
                * (real(0.25) - z * (real(1.0) / real(6.0) - z * (real(0.125) - z * (real(0.1) - z / real(12.0)))))
            )
        else:
            volume = real(0.5) * (z - wp.log(real(1.0) + z))
        stored = -real(0.5) * constants[0] * constants[2] * logarithm + real(0.5) * constants[1] * volume
        if wp.static(continued):
            stored += real(0.5) * constants[0] * constants[2] / least_room(constants) * over
        return stored

    @wp.func
    def balance(d: real, z: real, g1: real, s: real, constants: parameters):
        # (Jm - I1b + 3) J^(4/3) sigma_33, as in `root_change`.
        lock = constants[2]
        third = constants[0] * lock / real(3.0)
        half = real(0.5) * constants[1]
        inverse = real(1.0) / s
        root = real(1.0) + d
        rise = real(3.0) * root * root
        J = wp.sqrt(real(1.0) + z)
        thinning = inverse * (z / (real(1.0) + J) - g1 / (real(1.0) + s))
        thinning_rise = real(1.5) * inverse * J / root
        room = lock * root - g1 - real(2.0) * thinning + real(3.0) * d
        growth = lock - real(2.0) * thinning_rise + real(3.0)
        if wp.static(continued):
            if room < least_room(constants) * root:
                growth = least_room(constants)
                room = growth * root
        else:
            room = wp.max(room, real(1.0e-3) * lock)
        residual = third * (thinning - g1) + half * z * room
        floor = third * thinning_rise + half * rise * room
        tangent = floor + half * z * growth
        return residual, wp.max(tangent, real(0.25) * floor), lock, room

    @wp.func
    def membrane_shear(trace: real, thinning: real, z: real, constants: parameters):
        room = wp.max(constants[2] - excess_invariant(trace + thinning, z), least_room(constants))
        if room <= real(0.0):
            room = real(wp.nan)
        return constants[0] * constants[2] / (room * wp.cbrt(real(1.0) + z))

    return Equations(root_change, shear_of, stored, balance, membrane_shear)


@functools.cache
def locking_response(bits: int, continued: bool) -> wp.Function:
    """Stress and moduli of the Gent material: U1 = -(mu Jm/2) ln(1 - (I1b - 3)/Jm), U2 = (K/4) (q - ln q)."""
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    root_change, volume_of, condensed = locking_equations(bits, continued).root_change, volume(bits), condensation(bits)

    @wp.func
    def response(G: mat22, constants: parameters):
        area = area_change(G)
        inverse_area = real(1.0) / (real(1.0) + area)
        trace = G[0, 0] + G[1, 1]
        d = root_change(trace, area, inverse_area, constants, real(0.0))
        z = volume_of(d)
        thinning = inverse_area * (z - area)
        e = real(1.0) / (real(1.0) + d)
        room = constants[2] - e * (trace + thinning - real(3.0) * d)
        grows = real(1.0)
        if wp.static(continued):
            if room < constants[2] - constants[3]:
                room = constants[2] - constants[3]
                grows = real(0.0)
        if room <= real(0.0):
            room = real(wp.nan)
        first = real(0.5) * constants[0] * constants[2] / room
        S = plane_stress(G, inverse_area, thinning, real(2.0) * first * e)
        quarter = real(0.25) * constants[1]
        return S, condensed(G, z, e, first, grows * first / room, quarter * z, quarter * (real(1.0) + z))

    return response


@functools.cache
def gent_equations(bits: int) -> Equations:
    """The equations of the material."""
    return locking_equations(bits, False)


@functools.cache
def gent_response(bits: int) -> wp.Function:
    """Stress and moduli of the material."""
    return locking_response(bits, False)


@functools.cache
def continued_gent_equations(bits: int) -> Equations:
    """The equations of the Gent material whose logarithm goes on as its tangent from I1b - 3 = x_s on."""
    return locking_equations(bits, True)


@functools.cache
def continued_gent_response(bits: int) -> wp.Function:
    """Stress and moduli of the Gent material whose logarithm goes on as its tangent from I1b - 3 = x_s on."""
    return locking_response(bits, True)


gent = compressible(gent_equations, gent_response)
continued_gent = compressible(continued_gent_equations, continued_gent_response)
