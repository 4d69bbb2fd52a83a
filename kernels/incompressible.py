"""Exactly incompressible materials in plane stress: C33 = 1 / det C, so nothing is iterated.

A material is one Warp function of the invariants and of its constants,

    energy(x, y, constants) -> vec6     Psi, Psi_1, Psi_2, Psi_11, Psi_12, Psi_22  [Pa]

with x = I1 - 3 and y = I2 - 3, and indices for derivatives by I1 and I2. From it `incompressible` builds the functions
that force laws, fast paths and Newton's method need (see kernels/materials.py). Ogden's material is written in
principal stretches and has separate functions.

With G = C - I, t = tr G, g = det G and d = det C - 1 = t + g, no differences of numbers near one remain:
    I1 - 3 = (t d - g) / (1 + d),     I2 - 3 = (d^2 - g) / (1 + d),
    S = 2 (Psi_1 I + Psi_2 adj C) (I - C33 C^-1).
"""

import functools
from collections.abc import Callable
from typing import Any

import warp as wp

from .materials import MaterialFunctions, invariants, named
from .numeric import FunctionFactory, constants_of, numeric


@functools.cache
def principal_tangent(bits: int) -> wp.Function:
    """Function (G, N11, N12, N22, h) -> T of the derivatives N_ij of the principal stresses S_i by C_j.

    h = (S1 - S2) / (C1 - C2) is the modulus for a shear of the principal axes. C1 is the larger.
    """
    types = numeric(bits)
    real, mat22, vec3, vec6 = types.real, types.mat22, types.vec3, types.vec6

    @wp.func
    def turned(G: mat22, N11: real, N12: real, N22: real, h: real):
        half = real(0.5) * (G[0, 0] - G[1, 1])
        radius = wp.sqrt(half * half + G[0, 1] * G[0, 1])
        cosine = real(1.0)
        sine = real(0.0)
        if radius > real(0.0):
            cosine = half / radius
            sine = G[0, 1] / radius
        plus = real(0.5) * (real(1.0) + cosine)
        minus = real(0.5) * (real(1.0) - cosine)
        # Change of the larger, the smaller and the mixed component in principal axes, by (C11, C22, C12).
        a = vec3(plus, minus, sine)
        b = vec3(minus, plus, -sine)
        c = vec3(-real(0.5) * sine, real(0.5) * sine, cosine)
        T = N11 * wp.outer(a, a) + N12 * (wp.outer(a, b) + wp.outer(b, a)) + N22 * wp.outer(b, b)
        T += real(2.0) * h * wp.outer(c, c)
        return vec6(T[0, 0], T[0, 1], T[0, 2], T[1, 1], T[1, 2], T[2, 2])

    return turned


@functools.cache
def principal_strains(bits: int) -> wp.Function:
    """Function G -> larger and smaller eigenvalue of G."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def eigenvalues(G: mat22):
        mean = real(0.5) * (G[0, 0] + G[1, 1])
        half = real(0.5) * (G[0, 0] - G[1, 1])
        radius = wp.sqrt(half * half + G[0, 1] * G[0, 1])
        return mean + radius, mean - radius

    return eigenvalues


@functools.cache
def no_volume_change(bits: int) -> wp.Function:
    """Function (G, constants) -> J^2 - 1 of an incompressible material: zero."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def unchanged(G: mat22, constants: Any):
        return real(0.0)

    return unchanged


@functools.cache
def incompressible_width(bits: int) -> wp.Function:
    """Function (g1, constants) -> g2 of incompressible isotropic materials: C22 = C33 = C11^(-1/2)."""
    real = numeric(bits).real

    @wp.func
    def width(g1: real, constants: Any):
        # s - 1 = g1 / (1 + s) with s = l1, so that no digits of a small strain are lost.
        s = wp.sqrt(real(1.0) + g1)
        return -g1 / (s * (real(1.0) + s))

    return width


@functools.cache
def incompressible_sheet(
    parts_of: Callable[[int], tuple[wp.Function, ...]], width: FunctionFactory | None = None
) -> MaterialFunctions:
    """Build the functions of any incompressible material from a factory of its stress, energy and response.

    Use it for materials that are anisotropic or have more than four constants; see kernels/materials.py. For an
    isotropic material, pass `incompressible_width` as `width`.
    """
    parts = functools.cache(parts_of)

    def near(bits):
        types, stress = numeric(bits), parts(bits)[0]
        real, mat22, Constants = types.real, types.mat22, constants_of(stress)

        @wp.func
        def stress_near(G: mat22, constants: Constants, guess: real):
            return stress(G, constants), guess

        return stress_near

    return MaterialFunctions(
        named(lambda bits: parts(bits)[:2], parts_of, "functions"),
        named(near, parts_of, "near"),
        named(lambda bits: parts(bits)[2], parts_of, "response"),
        no_volume_change,
        width,
    )


@functools.cache
def incompressible(energy_of: FunctionFactory) -> MaterialFunctions:
    """All functions of an isotropic material from the factory of its energy, see above."""

    def parts_of(bits):
        types = numeric(bits)
        real, mat22 = types.real, types.mat22
        _, _, plane_stress = invariants(bits)
        invariant_energy = energy_of(bits)
        parameters = list(invariant_energy.input_types.values())[2]
        eigenvalues, turned = principal_strains(bits), principal_tangent(bits)

        @wp.func
        def changes(G: mat22):
            """I1 - 3, I2 - 3, det C - 1."""
            t = G[0, 0] + G[1, 1]
            g = wp.determinant(G)
            d = t + g
            slope = real(1.0) / (real(1.0) + d)
            return slope * (t * d - g), slope * (d * d - g), d

        @wp.func
        def stress(G: mat22, constants: parameters):
            x, y, d = changes(G)
            psi = invariant_energy(x, y, constants)
            slope = real(1.0) / (real(1.0) + d)
            first = plane_stress(G, slope, -slope * d, real(2.0) * psi[1])
            M = plane_stress(G, slope, -slope * d, real(2.0) * psi[2])
            c11 = real(1.0) + G[0, 0]
            c22 = real(1.0) + G[1, 1]
            shear = c22 * M[0, 1] - G[0, 1] * M[1, 1]
            return first + mat22(c22 * M[0, 0] - G[0, 1] * M[0, 1], shear, shear, c11 * M[1, 1] - G[0, 1] * M[0, 1])

        @wp.func
        def energy(G: mat22, constants: parameters):
            x, y, _d = changes(G)
            return invariant_energy(x, y, constants)[0]

        @wp.func
        def stress_and_moduli(G: mat22, constants: parameters):
            x, y, _d = changes(G)
            psi = invariant_energy(x, y, constants)
            larger, smaller = eigenvalues(G)
            one = real(1.0)
            two = real(2.0)
            a = one + larger
            b = one + smaller
            r = one / (a * b)
            # I1 = a + b + 1/(a b), I2 = a b + 1/a + 1/b, and their derivatives by the principal values.
            first_a = one - r / a
            first_b = one - r / b
            second_a = b - one / (a * a)
            second_b = a - one / (b * b)
            N11 = psi[1] * two * r / (a * a) + psi[2] * two / (a * a * a)
            N11 += psi[3] * first_a * first_a + two * psi[4] * first_a * second_a + psi[5] * second_a * second_a
            N22 = psi[1] * two * r / (b * b) + psi[2] * two / (b * b * b)
            N22 += psi[3] * first_b * first_b + two * psi[4] * first_b * second_b + psi[5] * second_b * second_b
            N12 = psi[1] * r * r + psi[2] + psi[3] * first_a * first_b + psi[5] * second_a * second_b
            N12 += psi[4] * (first_a * second_b + first_b * second_a)
            h = psi[1] * r * r + psi[2] * ((a + b) * r * r - one)
            return stress(G, constants), turned(G, two * N11, two * N12, two * N22, two * h)

        return stress, energy, stress_and_moduli

    return incompressible_sheet(named(parts_of, energy_of, "parts"), incompressible_width)


@functools.cache
def mooney_rivlin(bits: int) -> wp.Function:
    """Psi = c10 (I1 - 3) + c01 (I2 - 3); constants: c10, c01 [Pa]."""
    types = numeric(bits)
    real, vec6, parameters = types.real, types.vec6, types.parameters

    @wp.func
    def energy(x: real, y: real, c: parameters):
        zero = real(0.0)
        return vec6(c[0] * x + c[1] * y, c[0], c[1], zero, zero, zero)

    return energy


@functools.cache
def yeoh(bits: int) -> wp.Function:
    """Psi = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3; constants: c10, c20, c30 [Pa]."""
    types = numeric(bits)
    real, vec6, parameters = types.real, types.vec6, types.parameters

    @wp.func
    def energy(x: real, y: real, c: parameters):
        zero = real(0.0)
        two = real(2.0)
        three = real(3.0)
        return vec6(
            x * (c[0] + x * (c[1] + x * c[2])), c[0] + x * (two * c[1] + three * c[2] * x), zero,
            two * (c[1] + three * c[2] * x), zero, zero,
        )  # fmt: skip

    return energy


@functools.cache
def arruda_boyce(bits: int) -> wp.Function:
    """Five terms of the eight-chain model; constants: mu [Pa], locking stretch lm [-].

    Psi = mu sum_k a_k / lm^(2k-2) (I1^k - 3^k), a = 1/2, 1/20, 11/1050, 19/7000, 519/673750; I1^k - 3^k is a
    polynomial of I1 - 3 without a constant.
    """
    types = numeric(bits)
    real, vec6, parameters = types.real, types.vec6, types.parameters

    @wp.func
    def energy(x: real, y: real, c: parameters):
        s = real(1.0) / (c[1] * c[1])
        a1 = real(1.0) / real(2.0)
        a2 = s * (real(1.0) / real(20.0))
        a3 = s * s * (real(11.0) / real(1050.0))
        a4 = s * s * s * (real(19.0) / real(7000.0))
        a5 = s * s * s * s * (real(519.0) / real(673750.0))
        i = real(3.0) + x
        value = a2 * (x + real(6.0)) + a3 * (real(27.0) + x * (real(9.0) + x))
        value += a4 * (real(108.0) + x * (real(54.0) + x * (real(12.0) + x)))
        value += a5 * (real(405.0) + x * (real(270.0) + x * (real(90.0) + x * (real(15.0) + x))))
        two = real(2.0)
        slope = i * (two * a2 + i * (real(3.0) * a3 + i * (real(4.0) * a4 + i * real(5.0) * a5)))
        curve = two * a2 + i * (real(6.0) * a3 + i * (real(12.0) * a4 + i * real(20.0) * a5))
        zero = real(0.0)
        return vec6(c[0] * x * (a1 + value), c[0] * (a1 + slope), zero, c[0] * curve, zero, zero)

    return energy


@functools.cache
def carroll(bits: int) -> wp.Function:
    """Psi = a (I1 - 3) + b (I1^4 - 81) + c (sqrt(I2) - sqrt(3)); constants: a, b, c [Pa]."""
    types = numeric(bits)
    real, vec6, parameters = types.real, types.vec6, types.parameters

    @wp.func
    def energy(x: real, y: real, c: parameters):
        i = real(3.0) + x
        root = wp.sqrt(real(3.0) + y)
        half = real(0.5) * c[2] / root
        value = c[0] * x + c[1] * x * (i + real(3.0)) * (i * i + real(9.0))
        return vec6(
            value + c[2] * y / (root + wp.sqrt(real(3.0))), c[0] + real(4.0) * c[1] * i * i * i, half,
            real(12.0) * c[1] * i * i, real(0.0), -real(0.5) * half / (root * root),
        )  # fmt: skip

    return energy
