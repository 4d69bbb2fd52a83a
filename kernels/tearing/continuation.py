"""Energy beyond the strength of a sheet with a damage field, continued without stiffening.

Intact material never stores more than the energy density of its strength. What its energy does beyond only says how the
softened zone of a tear opens. Across that zone g(d) dPsi/dF is one stress. If Psi grows faster than the cube of F, the
gaps beside the crack open nearly as far as the crack itself, and the tear spreads over several rows of points: it takes
more than the tearing energy, the more the finer the spacing. So beyond the strength Psi goes on as that of a
neo-Hookean sheet, in proportion to I1 - 3. (That the energy of phase fields in stiffening rubber does not comply with
Gc: arXiv 2408.05162.)

For a material of I1 alone, with x = I1 - 3 and x_s at the strength,

    Psi*(x) = Psi(x),  x <= x_s,        Psi*(x) = Psi(x_s) + Psi'(x_s) (x - x_s)  beyond,

exactly (`continued_energy`; kernels/compressible.py for a compressible sheet). Any other energy is mapped by a function
of its own value,

    Psi* = phi(Psi),     S* = phi'(Psi) S,     phi'(Psi) = 1 up to the strength,

with the phi' that makes Psi* proportional to I1 - 3 in planar tension (`continued_functions`). phi' is linear between
knots at 1, 2, 4, ... times the strength.

An incompressible material that knows more than I1 is softer along a tear than across it: in planar tension l it opens
with Psi_1 + Psi_2, while a change of the opening along the tear takes Psi_1 + Psi_2 / l^2. Damage then reaches less far
ahead of the tip than beside it, and the band widens. So its energy goes over to that of the neo-Hookean sheet L that
it is in planar tension,

    Psi* = phi + (1 - strength / phi)^2 (L - phi),     L = strength + Psi'(x_s) (x - x_s)  in planar tension,

which grows with phi and with x wherever both are positive (`leading`). All have a continuous stress, which is the
derivative of the energy, and the width in uniaxial tension of the given material.
"""

import functools

import warp as wp

from ..incompressible import incompressible, mooney_rivlin
from ..materials import MaterialFunctions, named
from ..numeric import FunctionFactory, PairFactory, constants_of, numeric

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
def mapping(functions: PairFactory, leads: bool, bits: int) -> tuple[type, wp.Function, wp.Function, wp.Function]:
    """Type of the constants, and functions `own` (constants of the material), `is_below` and `mapped` of them."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    Given = constants_of(functions(bits)[0])
    count, knots = Given._length_, KNOTS
    planar = count + 1 + knots
    last = planar + 2 * int(leads)
    Constants = types.constants(last + 1)
    lead = leading(bits) if leads else None

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
        """phi, phi', phi''."""
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

    @wp.func
    def mapped(psi: real, G: mat22, c: Constants):
        """Psi*, its derivatives by Psi and x, and the second ones by Psi twice and by Psi and x."""
        value, slope, curve = phi(psi, c)
        by_x = real(0.0)
        mixed = real(0.0)
        if wp.static(leads):
            strength = c[wp.static(count)]
            if psi > strength:
                value, by_phi, by_x, bend, mixed = lead(
                    value, G, strength, c[wp.static(planar)], c[wp.static(planar + 1)]
                )
                curve = by_phi * curve + bend * slope * slope
                mixed = mixed * slope
                slope = by_phi * slope
        return value, slope, by_x, curve, mixed

    return Constants, own, is_below, mapped


@functools.cache
def leading(bits: int) -> wp.Function:
    """Function (phi, G, strength, modulus, x_s) -> Psi* of an incompressible sheet and its derivatives, see above.

    The derivatives are those by phi and x, and the second ones by phi twice and by phi and x.
    """
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def lead(value: real, G: mat22, strength: real, modulus: real, at_strength: real):
        t = G[0, 0] + G[1, 1]
        g = wp.determinant(G)
        d = t + g
        x = (t * d - g) / (real(1.0) + d)
        apart = strength + modulus * (x - at_strength) - value
        v = strength / value
        share = (real(1.0) - v) * (real(1.0) - v)
        first = real(2.0) * (real(1.0) - v) * v / value
        second = v * (real(6.0) * v - real(4.0)) / (value * value)
        return (
            value + share * apart, real(1.0) - share + first * apart, share * modulus,
            second * apart - real(2.0) * first, first * modulus,
        )  # fmt: skip

    return lead


@functools.cache
def of_given(functions: PairFactory, leads: bool, factory: FunctionFactory) -> FunctionFactory:
    """Factory of a function (anything, constants of the material) of the constants of `continued_functions`."""

    def wrapped(bits: int) -> wp.Function:
        Constants, own, _is_below, _mapped = mapping(functions, leads, bits)
        given = factory(bits)
        Argument = next(iter(given.input_types.values()))

        @wp.func
        def of_own(argument: Argument, constants: Constants):
            return given(argument, own(constants))

        return of_own

    return named(wrapped, functions, f"{factory.__qualname__}_continued")


@functools.cache
def continued_functions(
    functions: PairFactory, leads: bool, near: FunctionFactory | None, response: FunctionFactory | None,
    volume: FunctionFactory | None, width: FunctionFactory | None,
) -> MaterialFunctions:  # fmt: skip
    """Functions of any material, its energy mapped by phi and, if it `leads`, on to that of a neo-Hookean sheet.

    Constants: those of the material but the last; a number of x = tr C + 1 / det C - 3 below which the energy is
    certainly below the strength; the strength [Pa]; phi' at the knots; if it leads, dPsi/dx [Pa] and x at the strength
    in planar tension; the last constant of the material.
    """
    # Of Psi = x.
    sheet = incompressible(mooney_rivlin)

    def functions_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        Constants, own, is_below, mapped = mapping(functions, leads, bits)
        given_stress, given_energy = functions(bits)
        stress_of_x = sheet.functions(bits)[0]

        @wp.func
        def stress(G: mat22, constants: Constants):
            inner = own(constants)
            S = given_stress(G, inner)
            if not is_below(G, constants):
                _value, slope, by_x, _curve, _mixed = mapped(given_energy(G, inner), G, constants)
                S = slope * S
                if wp.static(leads):
                    S += by_x * stress_of_x(G, parameters(real(1.0), real(0.0), real(0.0), real(0.0)))
            return S

        @wp.func
        def energy(G: mat22, constants: Constants):
            value, _slope, _by_x, _curve, _mixed = mapped(given_energy(G, own(constants)), G, constants)
            return value

        return stress, energy

    def near_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        Constants, own, is_below, mapped = mapping(functions, leads, bits)
        given_near, given_energy = near(bits), functions(bits)[1]
        stress_of_x = sheet.functions(bits)[0]

        @wp.func
        def stress_near(G: mat22, constants: Constants, guess: real):
            inner = own(constants)
            S, found = given_near(G, inner, guess)
            if not is_below(G, constants):
                _value, slope, by_x, _curve, _mixed = mapped(given_energy(G, inner), G, constants)
                S = slope * S
                if wp.static(leads):
                    S += by_x * stress_of_x(G, parameters(real(1.0), real(0.0), real(0.0), real(0.0)))
            return S, found

        return stress_near

    def response_of(bits):
        types = numeric(bits)
        real, mat22, parameters, vec3, vec6 = types.real, types.mat22, types.parameters, types.vec3, types.vec6
        Constants, own, is_below, mapped = mapping(functions, leads, bits)
        given_response, given_energy = response(bits), functions(bits)[1]
        response_of_x = sheet.response(bits)

        @wp.func
        def gradient(S: mat22):
            """By (C11, C22, C12)."""
            return vec3(real(0.5) * S[0, 0], real(0.5) * S[1, 1], S[0, 1])

        @wp.func
        def doubled(a: vec3, b: vec3):
            """A b + b a, as T."""
            return vec6(
                real(2.0) * a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0],
                real(2.0) * a[1] * b[1], a[1] * b[2] + a[2] * b[1], real(2.0) * a[2] * b[2],
            )  # fmt: skip

        @wp.func
        def stress_and_moduli(G: mat22, constants: Constants):
            inner = own(constants)
            S, T = given_response(G, inner)
            if not is_below(G, constants):
                _value, slope, by_x, curve, mixed = mapped(given_energy(G, inner), G, constants)
                # T is twice the Hessian.
                a = gradient(S)
                T = slope * T + curve * doubled(a, a)
                S = slope * S
                if wp.static(leads):
                    S_x, T_x = response_of_x(G, parameters(real(1.0), real(0.0), real(0.0), real(0.0)))
                    T += by_x * T_x + real(2.0) * mixed * doubled(a, gradient(S_x))
                    S += by_x * S_x
            return S, T

        return stress_and_moduli

    return MaterialFunctions(
        named(functions_of, functions, "continued"),
        named(near_of, functions, "near_continued") if near is not None else None,
        named(response_of, functions, "response_continued") if response is not None else None,
        of_given(functions, leads, volume) if volume is not None else None,
        of_given(functions, leads, width) if width is not None else None,
    )
