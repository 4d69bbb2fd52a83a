"""Energy beyond the strength of a sheet with a damage field, continued without stiffening.

Intact material never stores more than the energy density of its strength. What its energy does beyond only says how the
softened zone of a tear opens. Across that zone g(d) dPsi/dF is one stress. If Psi grows faster than the cube of F, the
gaps beside the crack open nearly as far as the crack itself, and the tear spreads over several rows of points: it takes
more than the tearing energy, the more the finer the spacing. So beyond the strength Psi goes on as that of a
neo-Hookean sheet, in proportion to I1 - 3. (That the energy of phase fields in stiffening rubber does not comply with
Gc: arXiv 2408.05162.)

For a material of I1 alone, with x = I1 - 3 and x_s at the strength,

    Psi*(x) = Psi(x),  x <= x_s,        Psi*(x) = Psi(x_s) + Psi'(x_s) (x - x_s)  beyond,

exactly (`continued_energy`; kernels/gent.py for a compressible sheet). Any other energy is mapped by a function of its
own value,

    Psi* = phi(Psi),     S* = phi'(Psi) S,     phi'(Psi) = 1 up to the strength,

with the phi' that makes Psi* proportional to I1 - 3 in planar tension (`continued_functions`). phi' is linear between
knots at 1, 2, 4, ... times the strength. Both have a continuous stress, which is the derivative of the energy, and the
width in uniaxial tension of the given material.
"""

import functools

import warp as wp

from ..factories import FunctionFactory, PairFactory, constants_of
from ..incompressible import named
from ..materials import MaterialFunctions
from ..numeric import numeric

# Knots of phi': the last lies at 2^KNOTS times the strength. Beyond it phi' is constant.
KNOTS = 12


@functools.cache
def continued_energy(energy_of: FunctionFactory) -> FunctionFactory:
    """Factory of the energy of a material of I1 alone, continued; see kernels/incompressible.py.

    Constants: the first three of the material, x_s [-], the fourth.
    """

    def continued(bits: int) -> wp.Function:
        types = numeric(bits)
        real, vec6, parameters, Constants = types.real, types.vec6, types.parameters, types.constants(5)
        given = energy_of(bits)

        @wp.func
        def energy(x: real, y: real, c: Constants):
            psi = given(wp.min(x, c[3]), y, parameters(c[0], c[1], c[2], c[4]))
            over = x - c[3]
            if over > real(0.0):
                psi = vec6(psi[0] + over * psi[1], psi[1], real(0.0), real(0.0), real(0.0), real(0.0))
            return psi

        return energy

    return named(continued, energy_of, "continued")


@functools.cache
def mapping(functions: PairFactory, bits: int) -> tuple[type, wp.Function, wp.Function, wp.Function]:
    """Type of the constants, and functions `own` (constants of the material), `is_below` and `phi` of them."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    Given = constants_of(functions(bits)[0])
    count = Given._length_
    Constants = types.constants(count + 2 + KNOTS)
    last, knots = count + 1 + KNOTS, KNOTS

    @wp.func
    def own(c: Constants):
        given = Given()
        for k in range(wp.static(count - 1)):
            given[k] = c[k]
        given[wp.static(count - 1)] = c[wp.static(last)]
        return given

    @wp.func
    def is_below(G: mat22, c: Constants):
        t = G[0, 0] + G[1, 1]
        g = wp.determinant(G)
        d = t + g
        return t * d - g < c[wp.static(count - 1)] * (real(1.0) + d)

    @wp.func
    def phi(psi: real, c: Constants):
        """Psi*, phi', phi''."""
        strength = c[wp.static(count)]
        value = psi
        slope = real(1.0)
        curve = real(0.0)
        if psi > strength:
            u = psi / strength
            value = real(1.0)
            begin = real(1.0)
            at_begin = real(1.0)
            for k in range(wp.static(knots)):
                at_end = c[wp.static(count + 1) + k]
                if u > begin:
                    part = wp.min(u, real(2.0) * begin) - begin
                    curve = (at_end - at_begin) / begin
                    slope = at_begin + curve * part
                    value += real(0.5) * (at_begin + slope) * part
                begin = real(2.0) * begin
                at_begin = at_end
            if u > begin:
                slope = at_begin
                curve = real(0.0)
                value += slope * (u - begin)
            value = strength * value
            curve = curve / strength
        return value, slope, curve

    return Constants, own, is_below, phi


@functools.cache
def of_given(functions: PairFactory, factory: FunctionFactory) -> FunctionFactory:
    """Factory of a function (anything, constants of the material) of the constants of `continued_functions`."""

    def wrapped(bits: int) -> wp.Function:
        Constants, own, _is_below, _phi = mapping(functions, bits)
        given = factory(bits)
        Argument = next(iter(given.input_types.values()))

        @wp.func
        def of_own(argument: Argument, constants: Constants):
            return given(argument, own(constants))

        return of_own

    return named(wrapped, functions, f"{factory.__qualname__}_continued")


@functools.cache
def continued_functions(
    functions: PairFactory, near: FunctionFactory | None, response: FunctionFactory | None,
    volume: FunctionFactory | None, width: FunctionFactory | None,
) -> MaterialFunctions:  # fmt: skip
    """Functions of any material, its energy mapped by phi.

    Constants: those of the material but the last; a number of x = tr C + 1 / det C - 3 below which the energy is
    certainly below the strength; the strength [Pa]; phi' at the knots; the last constant of the material.
    """

    def functions_of(bits):
        types = numeric(bits)
        mat22 = types.mat22
        Constants, own, is_below, phi = mapping(functions, bits)
        given_stress, given_energy = functions(bits)

        @wp.func
        def stress(G: mat22, constants: Constants):
            inner = own(constants)
            S = given_stress(G, inner)
            if not is_below(G, constants):
                _value, slope, _curve = phi(given_energy(G, inner), constants)
                S = slope * S
            return S

        @wp.func
        def energy(G: mat22, constants: Constants):
            value, _slope, _curve = phi(given_energy(G, own(constants)), constants)
            return value

        return stress, energy

    def near_of(bits):
        types = numeric(bits)
        real, mat22 = types.real, types.mat22
        Constants, own, is_below, phi = mapping(functions, bits)
        given_near, given_energy = near(bits), functions(bits)[1]

        @wp.func
        def stress_near(G: mat22, constants: Constants, guess: real):
            inner = own(constants)
            S, found = given_near(G, inner, guess)
            if not is_below(G, constants):
                _value, slope, _curve = phi(given_energy(G, inner), constants)
                S = slope * S
            return S, found

        return stress_near

    def response_of(bits):
        types = numeric(bits)
        real, mat22, vec6 = types.real, types.mat22, types.vec6
        Constants, own, is_below, phi = mapping(functions, bits)
        given_response, given_energy = response(bits), functions(bits)[1]

        @wp.func
        def stress_and_moduli(G: mat22, constants: Constants):
            inner = own(constants)
            S, T = given_response(G, inner)
            if not is_below(G, constants):
                _value, slope, curve = phi(given_energy(G, inner), constants)
                # T is twice the Hessian by (C11, C22, C12), by which (S11 / 2, S22 / 2, S12) is the gradient.
                a = real(0.5) * S[0, 0]
                b = real(0.5) * S[1, 1]
                c = S[0, 1]
                T = slope * T + real(2.0) * curve * vec6(a * a, a * b, a * c, b * b, b * c, c * c)
                S = slope * S
            return S, T

        return stress_and_moduli

    return MaterialFunctions(
        named(functions_of, functions, "continued"),
        named(near_of, functions, "near_continued") if near is not None else None,
        named(response_of, functions, "response_continued") if response is not None else None,
        of_given(functions, volume) if volume is not None else None,
        of_given(functions, width) if width is not None else None,
    )
