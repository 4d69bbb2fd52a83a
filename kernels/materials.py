"""Hyperelastic materials in plane stress, without rotations.

A material is a pair of Warp functions of G = C - I, where C = F^T F is the right Cauchy-Green tensor of the sheet
(2x2), and of the material constants (`numeric(bits).parameters` for up to four, `numeric(bits).constants(count)` for
more):

    stress(G, constants) -> S        second Piola stress of the sheet [Pa]; the first Piola stress is F S
    energy(G, constants) -> Psi      stored energy per reference volume [J/m^3]

For the fast paths a material adds a factory for

    stress_near(G, constants, guess) -> S, d      the same stress, and the guess for a nearby state; 0 is no guess

and for Newton's method

    response(G, constants) -> S, T   also the derivative T of (S11, S22, 2 S12) by (C11, C22, C12), vec6 [Pa]

where C12 stands for both off-diagonal entries: T is then twice the Hessian of Psi, symmetric. It has a separate
factory, so that runs without Newton's method do not compile it.

The functions take G, not C, because 1 + strain loses digits of a small strain in float32. The squared thickness stretch
C33 follows from zero stress through the thickness. Newton's iteration solves for d = J^(2/3) - 1: the volume change z =
J^2 - 1 = d (3 + 3d + d^2) and the residual are polynomials of d, so an iteration takes no roots and one or two
divisions.

Written with the second Piola stress, the law needs no local frame and no rotation: F S is exactly what the
papers obtain by rotating to the tangent plane, taking the stress there and rotating back.

`by_region` combines several materials: one vector has the constants of all, one material after the other, and last the
index of the material, which `of_bond` of the families (kernels/families.py) sets for each bond.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import warp as wp

from .effects import unstaged
from .numeric import FunctionFactory, PairFactory, constants_of, numeric

T = TypeVar("T")

# Typical states take 2 or 3 steps; the worst state found below the lock of a Gent sheet takes 19 (K / mu near 1). After
# RESTART steps a guess that does not converge is replaced by zero.
NEWTON_STEPS = 36
RESTART = 12
# Change of d at which the iteration ends: it converges quadratically, so the next change is its square.
TOLERANCE = {32: 3e-4, 64: 1e-7}
# The same for the width in uniaxial tension, of which the relaxed energy has no second order error (tension_field.py).
WIDTH_TOLERANCE = {32: 1e-4, 64: 1e-8}
# Smallest factor on J^(2/3) in one step of the iteration.
SHRINK = 0.585


@dataclass(frozen=True)
class MaterialFunctions:
    """Cached factories (precision in bits -> Warp functions) of one material; None for functions it does not provide.

    Attributes:
        functions: (stress, energy).
        near: stress_near.
        response: Stress and moduli.
        volume: (G, constants) -> z = J^2 - 1.
        width: (g1, constants) -> g2 in uniaxial tension, see kernels/tension_field.py.
        membrane: (volume change, shear modulus), for the neural law.
    """

    functions: PairFactory
    near: FunctionFactory | None = None
    response: FunctionFactory | None = None
    volume: FunctionFactory | None = None
    width: FunctionFactory | None = None
    membrane: PairFactory | None = None


def named(factory: Callable[[int], T], energy: FunctionFactory, what: str) -> Callable[[int], T]:
    """Wrap a cached factory under a name unique to the material; Warp identifies compiled functions by name."""
    cached: Any = functools.cache(factory)
    cached.__module__, cached.__name__ = energy.__module__, f"{energy.__name__}_{what}"
    cached.__qualname__ = f"{energy.__qualname__}.{what}"
    return cached  # type: ignore[no-any-return]


@functools.cache
def invariants(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions of the strain common to all materials: area_change, excess_invariant, plane_stress."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def area_change(G: mat22):
        """Return det C - 1."""
        return G[0, 0] + G[1, 1] + wp.determinant(G)

    @wp.func
    def excess_invariant(trace: real, z: real):
        """I1b - 3 from tr C + C33 - 3 and z; J^(2/3) - 1 = z / (J^(4/3) + J^(2/3) + 1)."""
        root = wp.cbrt(real(1.0) + z)
        return (trace - real(3.0) * z / (root * root + root + real(1.0))) / root

    @wp.func
    def plane_stress(G: mat22, slope: real, thinning: real, g: real):
        """S = g (I - C33 C^-1), with slope = 1 / det C and C33 = 1 + thinning.

        I - C33 C^-1 = C^-1 (G - thinning I): no difference of numbers near one.
        """
        scale = g * slope
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
def condensation(bits: int) -> wp.Function:
    """Function that turns derivatives of an energy U1(I1b) + U2(ln q), q = J^2 = C33 det C, into moduli.

    With x = (C11, C22, C12, C33) and l = ln q, I1b = tau exp(-l/3), tau = tr C + C33:
        I_x = e (tau_x - tau l_x/3),   I_xy = e (-(tau_x l_y + l_x tau_y)/3 + tau l_x l_y/9 - tau l_xy/3),
        Psi_xy = U1'' I_x I_y + U1' I_xy + U2'' l_x l_y + U2' l_xy.
    sigma_33 = 0 makes C33 a function of the others; differentiating it implicitly gives the plane-stress
    Hessian Psi_xy - Psi_x3 Psi_3y / Psi_33.
    """
    types = numeric(bits)
    real, mat22, vec6 = types.real, types.mat22, types.vec6

    @wp.func
    def condensed(
        G: mat22,
        z: real,
        e: real,
        first: real,
        second: real,
        volume_first: real,
        volume_second: real,
    ):
        """T from the volume change z, e = (1 + z)^(-1/3), U1', U1'', and the derivatives U2', U2'' by ln q."""
        c11 = real(1.0) + G[0, 0]
        c22 = real(1.0) + G[1, 1]
        c12 = G[0, 1]
        det = c11 * c22 - c12 * c12
        inverse = real(1.0) / det
        c33 = (real(1.0) + z) * inverse
        l11, l22, l12, l33 = inverse * c22, inverse * c11, -real(2.0) * inverse * c12, det * e * e * e
        third = real(1.0) / real(3.0)
        tau = third * (c11 + c22 + c33)
        # Psi_xy = c tau_x tau_y + b (tau_x l_y + l_x tau_y) + a l_x l_y + bend l_xy
        c = second * e * e
        b = -(tau * c + third * e * first)
        a = volume_second - tau * b
        bend = volume_first - tau * e * first
        # l_xy is -l_x l_y, but for C11 with C22 and C12 with itself, and 0 for C33 with others.
        plane = a - bend
        m, n = a * l33 + b, b * l33 + c
        x11, x22, x12 = l11 * m + n, l22 * m + n, l12 * m
        m, n = plane * l11 + b, b * l11 + c
        h11, h12, h13 = l11 * m + n, l22 * m + n + bend * inverse, l12 * m
        m = plane * l22 + b
        h22, h23 = l22 * (m + b) + c, l12 * m
        h33 = plane * l12 * l12 - real(2.0) * bend * inverse
        r = real(1.0) / (l33 * (plane * l33 + real(2.0) * b) + c)
        return real(2.0) * vec6(
            h11 - r * x11 * x11, h12 - r * x11 * x22, h13 - r * x11 * x12,
            h22 - r * x22 * x22, h23 - r * x22 * x12, h33 - r * x12 * x12,
        )  # fmt: skip

    return condensed


@functools.cache
def volume(bits: int) -> wp.Function:
    """Function d -> z = J^2 - 1 of d = J^(2/3) - 1."""
    real = numeric(bits).real

    @wp.func
    def volume_of(d: real):
        return d * (real(3.0) + d * (real(3.0) + d))

    return volume_of


# (bits, type of all constants, function of a material, its own constants, index of the material, function of those
# after it) -> function.
Declare = Callable[[int, Any, wp.Function, wp.Function, int, wp.Function], wp.Function]


@functools.cache
def by_region(materials: tuple[MaterialFunctions, ...]) -> MaterialFunctions:
    """Functions that select the material by its index; a function that one material lacks is missing."""

    def joined(bits: int, functions: tuple[wp.Function, ...], declare: Declare) -> wp.Function:
        types = [constants_of(material.functions(bits)[0]) for material in materials]
        ends = [sum(each._length_ for each in types[:n]) for n in range(len(types) + 1)]
        Constants = numeric(bits).constants(ends[-1] + 1)
        found = None
        for n, function in reversed(list(enumerate(functions))):
            own = own_constants(Constants, types[n], ends[n], n)
            found = declare(bits, Constants, function, own, n, found)
        return found

    def functions(bits: int) -> tuple[wp.Function, wp.Function]:
        stress, energy = zip(*(material.functions(bits) for material in materials), strict=True)
        return joined(bits, stress, of_strain), joined(bits, energy, of_strain)

    def of(name: str, declare: Declare) -> Callable[[int], wp.Function] | None:
        factories = [getattr(material, name) for material in materials]
        if None in factories:
            return None
        return called(lambda bits: joined(bits, tuple(factory(bits) for factory in factories), declare), name)

    def called(factory: Callable[[int], Any], what: str) -> Callable[[int], Any]:
        names = "_".join(f"{one.functions.__module__}_{one.functions.__name__}" for one in materials)
        return named(factory, materials[0].functions, f"{what}_by_region_{names}")

    return MaterialFunctions(
        functions=called(functions, "functions"),
        near=of("near", with_guess),
        response=of("response", of_strain),
        volume=of("volume", of_strain),
    )


def own_constants(Constants: Any, Own: Any, begin: int, index: int) -> wp.Function:
    """Function (constants of all materials) -> constants of one material, which start at `begin`."""
    count = Own._length_

    @wp.func(name=f"constants_{index}")
    def own(constants: Constants):
        found = Own()
        for k in range(wp.static(count)):
            found[k] = constants[begin + k]
        return found

    return own


def of_strain(bits: int, Constants: Any, function: wp.Function, own: wp.Function, n: int, others: wp.Function) -> Any:
    """(G, constants) -> the values of `function`."""
    real, mat22, last = numeric(bits).real, numeric(bits).mat22, Constants._length_ - 1

    @wp.func(name=f"{function.func.__name__}_{n}")
    def values(G: mat22, constants: Constants):
        if wp.static(others is not None):
            if constants[last] != real(n):
                return others(G, constants)
        return function(G, own(constants))

    return values


def with_guess(bits: int, Constants: Any, function: wp.Function, own: wp.Function, n: int, others: wp.Function) -> Any:
    """(G, constants, guess) -> stress and the next guess."""
    real, mat22, last = numeric(bits).real, numeric(bits).mat22, Constants._length_ - 1

    @wp.func(name=f"{function.func.__name__}_{n}")
    def values(G: mat22, constants: Constants, guess: real):
        if wp.static(others is not None):
            if constants[last] != real(n):
                return others(G, constants, guess)
        return function(G, own(constants), guess)

    return values


@functools.cache
def energy_density(functions: PairFactory) -> wp.Kernel:
    """Kernel that fills `out` [n] with the energy density [J/m^3] of principal stretches [n], in float64."""
    types = numeric(64)
    mat22 = types.mat22
    _, energy = functions(64)
    Constants = constants_of(energy)

    def energy_at(
        first: wp.array(dtype=wp.float64),
        second: wp.array(dtype=wp.float64),
        constants: Constants,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        one = wp.float64(1.0)
        zero = wp.float64(0.0)
        G = mat22((first[i] - one) * (first[i] + one), zero, zero, (second[i] - one) * (second[i] + one))
        out[i] = energy(G, constants)

    return unstaged(energy_at)


@functools.cache
def stress_and_volume(functions: PairFactory, volume: FunctionFactory) -> wp.Kernel:
    """Kernel that fills S [Pa] and J^2 - 1 of strains G = C - I [n], in float64."""
    stress, _ = functions(64)
    volume_change = volume(64)
    Constants = constants_of(stress)

    def stress_at(
        strain: wp.array(dtype=wp.mat22d),
        constants: Constants,
        out: wp.array(dtype=wp.mat22d),
        change: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        G = strain[i]
        out[i] = stress(G, constants)
        change[i] = volume_change(G, constants)

    return unstaged(stress_at)
