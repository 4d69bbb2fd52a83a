"""Hyperelastic materials in plane stress, free of rotations.

A material is a pair of Warp functions of G = C - I, where C = F^T F is the right Cauchy-Green tensor of
the sheet (2x2), and of at most four constants:

    stress(G, constants) -> S        second Piola stress of the sheet [Pa]; the first Piola stress is F S
    energy(G, constants) -> Psi      stored energy per reference volume [J/m^3]

G, not C, is passed because C - I holds the digits that 1 + strain loses in float32. The thickness stretch
C33 follows from a vanishing through-thickness stress; it is found as the volume change z = J^2 - 1, for
which the residual of both materials here is monotone, so Newton's iteration cannot leave its bracket.

Written with the second Piola stress, the law needs no local frame and no rotation: F S is exactly what the
papers obtain by rotating to the tangent plane, taking the stress there and rotating back.
"""

import functools

import warp as wp

from .numeric import numeric

NEWTON_STEPS = 12


@functools.cache
def invariants(bits):
    """Functions of the strain that the materials share: area_change, excess_invariant, plane_stress."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def area_change(G: mat22):
        """Det C - 1."""
        return G[0, 0] + G[1, 1] + wp.determinant(G)

    @wp.func
    def excess_invariant(trace: real, z: real):
        """I1b - 3 from tr C + C33 - 3 and z; J^(2/3) - 1 = z / (J^(4/3) + J^(2/3) + 1)."""
        root = wp.cbrt(real(1.0) + z)
        return (trace - real(3.0) * z / (root * root + root + real(1.0))) / root

    @wp.func
    def plane_stress(G: mat22, thinning: real, g: real):
        """S = g (I - C33 C^-1), with C33 = 1 + thinning.

        I - C33 C^-1 = C^-1 (G - thinning I): no difference of numbers near one.
        """
        scale = g / (real(1.0) + area_change(G))
        b = G[0, 1]
        shear = scale * b * (real(1.0) + thinning)
        return mat22(
            scale * ((real(1.0) + G[1, 1]) * (G[0, 0] - thinning) - b * b),
            shear,
            shear,
            scale * ((real(1.0) + G[0, 0]) * (G[1, 1] - thinning) - b * b),
        )

    return area_change, excess_invariant, plane_stress


@functools.cache
def neo_hookean(bits):
    """Slightly compressible neo-Hookean material; constants: mu [Pa], K [Pa].

    Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2), I1b = J^(-2/3) (tr C + C33), J^2 = C33 det C.
    Source: NN paper's neo-Hookean sheet.
    """
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, excess_invariant, plane_stress = invariants(bits)
    tolerance = 1e-6 if bits == 32 else 1e-13
    steps = NEWTON_STEPS

    @wp.func
    def volume_change(G: mat22, constants: parameters):
        # Zero of J^(2/3) sigma_33: the factor makes it rise strictly with z, whatever the state.
        trace = G[0, 0] + G[1, 1]
        area = area_change(G)
        mu = constants[0]
        bulk = constants[1]
        slope = real(2.0) / (real(3.0) * (real(1.0) + area))
        z = real(0.0)
        for _ in range(steps):
            thinning = (z - area) / (real(1.0) + area)
            root = wp.cbrt(real(1.0) + z)
            p = real(0.25) * bulk * z * (real(2.0) + z) / (real(1.0) + z)
            residual = mu * (real(2.0) * thinning - trace) / real(3.0) + root * p
            tangent = (
                mu * slope
                + root * bulk * real(0.25) * (real(1.0) + real(1.0) / ((real(1.0) + z) * (real(1.0) + z)))
                + p / (real(3.0) * root * root)
            )
            new = wp.max(z - residual / tangent, real(0.2) * (real(1.0) + z) - real(1.0))
            change = wp.abs(new - z)
            z = new
            if change <= real(tolerance) * (real(1.0) + z):
                break
        return z

    @wp.func
    def stress(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        thinning = (z - area) / (real(1.0) + area)
        g = constants[0] / wp.cbrt(real(1.0) + z)
        return plane_stress(G, thinning, g)

    @wp.func
    def energy(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        thinning = (z - area) / (real(1.0) + area)
        excess = excess_invariant(G[0, 0] + G[1, 1] + thinning, z)
        volume = z * z / (real(1.0) + z)
        return real(0.5) * constants[0] * excess + constants[1] / real(8.0) * volume

    return stress, energy


@functools.cache
def gent(bits):
    """Slightly compressible Gent material; constants: mu [Pa], K = 2/D [Pa], Jm [-].

    Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J).
    At and beyond the lock, I1b - 3 >= Jm, the material has no stress: the functions return NaN there, which
    the run reports as the lock reached. Source: BA paper's Gent sheet.
    """
    types = numeric(bits)
    real, mat22, parameters = types.real, types.mat22, types.parameters
    area_change, excess_invariant, plane_stress = invariants(bits)
    tolerance = 1e-6 if bits == 32 else 1e-13
    steps = NEWTON_STEPS

    @wp.func
    def volume_change(G: mat22, constants: parameters):
        trace = G[0, 0] + G[1, 1]
        area = area_change(G)
        mu = constants[0]
        inverse_d = real(0.5) * constants[1]
        lock = constants[2]
        slope = real(1.0) / (real(1.0) + area)
        z = real(0.0)
        for _ in range(steps):
            thinning = (z - area) * slope
            root = wp.cbrt(real(1.0) + z)
            excess = excess_invariant(trace + thinning, z)
            # Held off the lock here so that an iterate beyond it can come back.
            room = wp.max(lock - excess, real(1.0e-3) * lock)
            deviator = (real(2.0) * thinning - trace) / real(3.0)
            residual = mu * lock / room * deviator + root * inverse_d * z
            excess_slope = (slope - real(1.0) / (root * root)) / root - excess / (real(3.0) * (real(1.0) + z))
            tangent = (
                mu * lock / room * (real(2.0) / real(3.0) * slope)
                + mu * lock / (room * room) * excess_slope * deviator
                + inverse_d * (root + z / (real(3.0) * root * root))
            )
            floor = mu * lock / room * (real(2.0) / real(3.0) * slope) + inverse_d * real(0.5)
            new = wp.max(z - residual / wp.max(tangent, real(0.25) * floor), real(0.2) * (real(1.0) + z) - real(1.0))
            change = wp.abs(new - z)
            z = new
            if change <= real(tolerance) * (real(1.0) + z):
                break
        return z

    @wp.func
    def stress(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        thinning = (z - area) / (real(1.0) + area)
        excess = excess_invariant(G[0, 0] + G[1, 1] + thinning, z)
        room = constants[2] - excess
        if room <= real(0.0):
            room = real(wp.nan)
        g = constants[0] * constants[2] / (room * wp.cbrt(real(1.0) + z))
        return plane_stress(G, thinning, g)

    @wp.func
    def energy(G: mat22, constants: parameters):
        z = volume_change(G, constants)
        area = area_change(G)
        thinning = (z - area) / (real(1.0) + area)
        excess = excess_invariant(G[0, 0] + G[1, 1] + thinning, z)
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
