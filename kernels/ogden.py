"""Incompressible Ogden material of any number of terms in plane stress, written in principal stretches."""

import functools

import warp as wp

from .incompressible import incompressible_sheet, incompressible_width, principal_tangent
from .materials import MaterialFunctions
from .numeric import numeric

# Exponents below this have large moduli, whose terms nearly cancel.
LOW = 0.25


@functools.cache
def log_one_plus(bits: int) -> wp.Function:
    """Function x -> log(1 + x), accurate for small x."""
    real = numeric(bits).real
    small = 1e-2 if bits == 32 else 1e-4

    @wp.func
    def log_one_plus(x: real):
        answer = real(0.0)
        if wp.abs(x) < real(small):
            answer = x * (
                real(1.0)
                - x * (real(0.5) - x * ((real(1.0) / real(3.0)) - x * (real(0.25) - x * real(1.0) / real(5.0))))
            )
        else:
            answer = wp.log(real(1.0) + x)
        return answer

    return log_one_plus


@functools.cache
def logarithmic_strains(bits: int) -> wp.Function:
    """Function G -> mean and half difference of the logarithmic principal strains, accurate for small G."""
    types = numeric(bits)
    real, mat22, log_of = types.real, types.mat22, log_one_plus(bits)

    @wp.func
    def strains(G: mat22):
        mean = real(0.5) * (G[0, 0] + G[1, 1])
        half = real(0.5) * (G[0, 0] - G[1, 1])
        radius = wp.sqrt(half * half + G[0, 1] * G[0, 1])
        middle = real(0.25) * log_of(real(2.0) * mean + wp.determinant(G))
        # atanh of radius / (1 + mean), whose argument keeps its digits.
        excess = real(2.0) * radius / (real(1.0) + mean - radius)
        return middle, real(0.25) * log_of(excess), mean, radius

    return strains


@functools.cache
def exponential(bits: int) -> wp.Function:
    """Function x -> exp(x) - 1, accurate for small x."""
    real = numeric(bits).real
    small = 2e-2 if bits == 32 else 1e-3

    @wp.func
    def exp_minus_one(x: real):
        answer = real(0.0)
        if wp.abs(x) < real(small):
            fourth = (real(1.0) / real(24.0)) + x * ((real(1.0) / real(120.0)) + x * (real(1.0) / real(720.0)))
            answer = x * (real(1.0) + x * (real(0.5) + x * ((real(1.0) / real(6.0)) + x * fourth)))
        else:
            answer = wp.exp(x) - real(1.0)
        return answer

    return exp_minus_one


@functools.cache
def exponential_beyond_line(bits: int) -> wp.Function:
    """Function x -> exp(x) - 1 - x, accurate for small x."""
    real = numeric(bits).real

    @wp.func
    def beyond_line(x: real):
        answer = real(0.0)
        if wp.abs(x) < real(0.5):
            series = real(1.0)
            for k in range(12):
                series = real(1.0) + x / real(14 - k) * series
            answer = real(0.5) * x * x * series
        else:
            answer = wp.exp(x) - real(1.0) - x
        return answer

    return beyond_line


@functools.cache
def ogden_parts(terms: int, bits: int) -> tuple[wp.Function, ...]:
    """Functions of the Ogden material: strains, principal stresses, and the shear modulus h = (S1 - S2) / (C1 - C2)."""
    types = numeric(bits)
    real, Constants = types.real, types.constants(2 * terms)
    strains, exp_minus_one = logarithmic_strains(bits), exponential(bits)
    low = LOW

    @wp.func
    def ratio(k: real, spread: real):
        """Return sinh(k spread) / sinh(spread)."""
        answer = k
        if spread > real(0.0):
            answer = (exp_minus_one(k * spread) - exp_minus_one(-k * spread)) / (
                exp_minus_one(spread) - exp_minus_one(-spread)
            )
        return answer

    @wp.func
    def principal_stress(strain: real, middle: real, c: Constants):
        """S of a principal direction: sum_p mu_p (l^a - (l1 l2)^-a) / l^2."""
        total = real(0.0)
        for p in range(terms):
            a = c[2 * p + 1]
            total += c[2 * p] * (exp_minus_one(a * strain) - exp_minus_one(-real(2.0) * a * middle))
        return total * wp.exp(-real(2.0) * strain)

    @wp.func
    def shear(middle: real, half: real, c: Constants):
        """(S1 - S2) / (C1 - C2)."""
        spread = real(2.0) * half
        total = real(0.0)
        for p in range(terms):
            a = c[2 * p + 1]
            if wp.abs(a) < real(low):
                # In sinh((a / 2 - 1) s) = sinh(a s / 2) cosh(s) - cosh(a s / 2) sinh(s) the last term is large.
                along = exp_minus_one(a * (middle + half)) + exp_minus_one(a * (middle - half))
                term = wp.exp(a * middle) * wp.cosh(spread) * ratio(real(0.5) * a, spread)
                term += exp_minus_one(-real(2.0) * a * middle) - real(0.5) * along
                total += c[2 * p] * wp.exp(-real(4.0) * middle) * term
            else:
                term = wp.exp((a - real(4.0)) * middle) * ratio(real(0.5) * a - real(1.0), spread)
                total += c[2 * p] * (term + wp.exp(-real(4.0) * middle - real(2.0) * a * middle))
        return total

    return strains, exp_minus_one, principal_stress, shear


@functools.cache
def ogden(terms: int) -> MaterialFunctions:
    """Functions of Ogden's material with `terms` terms; constants: mu_1 [Pa], a_1, mu_2 [Pa], a_2, ...

    Psi = sum_p mu_p / a_p (l1^a_p + l2^a_p + (l1 l2)^-a_p - 3), l the principal stretches.
    """

    def parts_of(bits):
        types = numeric(bits)
        real, mat22, Constants = types.real, types.mat22, types.constants(2 * terms)
        strains, exp_minus_one, principal_stress, shear = ogden_parts(terms, bits)
        turned, beyond_line, low = principal_tangent(bits), exponential_beyond_line(bits), LOW

        @wp.func
        def stress(G: mat22, constants: Constants):
            middle, half, mean, _radius = strains(G)
            h = shear(middle, half, constants)
            # The mean of the principal stresses, and the deviation from it, which is coaxial with G.
            centre = real(0.5) * (
                principal_stress(middle + half, middle, constants) + principal_stress(middle - half, middle, constants)
            )
            across = h * G[0, 1]
            return mat22(centre + h * (G[0, 0] - mean), across, across, centre + h * (G[1, 1] - mean))

        @wp.func
        def energy(G: mat22, constants: Constants):
            middle, half, _mean, _radius = strains(G)
            total = real(0.0)
            for p in range(terms):
                a = constants[2 * p + 1]
                if a != real(0.0):
                    # The parts that are linear in the strains add up to zero.
                    total += (constants[2 * p] / a) * (
                        beyond_line(a * (middle + half))
                        + beyond_line(a * (middle - half))
                        + beyond_line(-real(2.0) * a * middle)
                    )
            return total

        @wp.func
        def own(strain: real, middle: real, c: Constants):
            """Derivative of a principal stress by its own principal value of C."""
            total = real(0.0)
            for p in range(terms):
                a = c[2 * p + 1]
                if wp.abs(a) < real(low):
                    along, across = exp_minus_one(a * strain), exp_minus_one(-real(2.0) * a * middle)
                    total += c[2 * p] * (a + real(0.5) * a * (along + across) - along + across)
                else:
                    total += c[2 * p] * (
                        (real(0.5) * a - real(1.0)) * wp.exp(a * strain)
                        + (real(0.5) * a + real(1.0)) * wp.exp(-real(2.0) * a * middle)
                    )
            return total * wp.exp(-real(4.0) * strain)

        @wp.func
        def stress_and_moduli(G: mat22, constants: Constants):
            middle, half, _mean, _radius = strains(G)
            N12 = real(0.0)
            for p in range(terms):
                a = constants[2 * p + 1]
                N12 += constants[2 * p] * real(0.5) * a * wp.exp(-real(2.0) * (a + real(2.0)) * middle)
            return stress(G, constants), turned(
                G, own(middle + half, middle, constants), N12, own(middle - half, middle, constants),
                shear(middle, half, constants),
            )  # fmt: skip

        return stress, energy, stress_and_moduli

    return incompressible_sheet(parts_of, incompressible_width)
