"""Tension field theory: wrinkles finer than the point spacing. Sources: Reissner 1938, Pipkin 1986, Steigmann 1990.

With principal stretches l1 >= l2 and the width n(l1) in uniaxial tension, the relaxed energy is

    taut       l2 >= n(l1)              Psi(l1, l2)
    wrinkled   l2 <  n(l1), l1 > 1      Psi(l1, n(l1))
    slack      l1 <= 1                  0

It is the infimum of the energy over fine wrinkles. It is continuously differentiable, no principal stress is negative,
and the stiffness never exceeds that of the taut sheet. Without relaxation, in contrast, a sheet resists in-plane
compression by growing thicker: Psi ~ 1 / (l1 l2)^2 and stiffness ~ 1 / l2^4, so no time step can follow a collapsing
sheet.

The relaxed energy is the original energy at the taut strain, which is G with l2 raised to n(l1). The same holds for the
stress, because the stress across the wrinkles vanishes at l2 = n(l1). A material therefore needs only one more
function,

    width(g1, constants) -> g2     smaller principal value of G = C - I in uniaxial tension, from the larger

which `incompressible_width` (kernels/incompressible.py) gives for any incompressible isotropic material, and
`width_from_stress` for any isotropic material from its stress. In uniaxial tension of an isotropic sheet, width and
thickness shrink by the same factor.

With a slack stiffness k the sheet has the energy k G : G / 4 and the stress k G in addition, whatever its state.
"""

import functools
from typing import Any

import warp as wp

from .incompressible import principal_strains, principal_tangent
from .materials import MaterialFunctions, named
from .numeric import FunctionFactory, PairFactory, constants_of, numeric

# Maximum number of steps of the search for the width, and the change of g2 over g1 at which it ends.
SEARCH = 60
TOLERANCE = {32: 2e-7, 64: 1e-14}
TAUT, WRINKLED, SLACK = 0, 1, 2


@functools.cache
def width_from_stress(functions: PairFactory) -> FunctionFactory:
    """Factory of (g1, constants) -> g2 of an isotropic material, from a factory of (stress, energy).

    It finds the zero of S22 by the bracketed secant method (Illinois).
    """

    def width_of(bits: int) -> wp.Function:
        types = numeric(bits)
        real, mat22 = types.real, types.mat22
        stress, _ = functions(bits)
        Constants = constants_of(stress)
        tolerance, search = TOLERANCE[bits], SEARCH

        @wp.func
        def stress_across(g1: real, g2: real, constants: Constants):
            S = stress(mat22(g1, real(0.0), real(0.0), g2), constants)
            return S[1, 1]

        @wp.func
        def width(g1: real, constants: Constants):
            # A sheet whose volume does not decrease in tension is at least as wide as an incompressible one.
            s = wp.sqrt(real(1.0) + g1)
            low = -g1 / (s * (real(1.0) + s))
            low_stress = stress_across(g1, low, constants)
            g2 = low
            if low_stress < real(0.0):
                high = real(0.0)
                high_stress = stress_across(g1, high, constants)
                if high_stress < real(0.0):
                    high = g1
                    high_stress = stress_across(g1, high, constants)
                last = wp.int32(0)
                for _step in range(search):
                    g2 = high - high_stress * (high - low) / (high_stress - low_stress)
                    found = stress_across(g1, g2, constants)
                    if found < real(0.0):
                        low = g2
                        low_stress = found
                        if last == -1:
                            high_stress *= real(0.5)
                        last = wp.int32(-1)
                    else:
                        high = g2
                        high_stress = found
                        if last == 1:
                            low_stress *= real(0.5)
                        last = wp.int32(1)
                    if high - low <= real(tolerance) * g1 or found == real(0.0):
                        break
            return g2

        return width

    return named(width_of, functions, "width")


@functools.cache
def taut_strain(width: FunctionFactory, bits: int) -> tuple[wp.Function, wp.Function]:
    """Functions of a material with that width: `state_of` and `taut`.

    state_of: (G, constants) -> TAUT, WRINKLED or SLACK; principal values g1 and g2 of G; g2 of the taut strain.
    taut: (G, constants) -> the taut strain.
    """
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    eigenvalues, width_of = principal_strains(bits), width(bits)
    is_taut, is_wrinkled, is_slack = TAUT, WRINKLED, SLACK

    @wp.func
    def state_of(G: mat22, constants: Any):
        larger, smaller = eigenvalues(G)
        state = wp.int32(is_taut)
        across = smaller
        if larger <= real(0.0):
            # The undeformed sheet is taut.
            if smaller < real(0.0):
                state = wp.int32(is_slack)
                across = real(0.0)
        elif smaller < larger:
            narrow = width_of(larger, constants)
            if smaller < narrow:
                state = wp.int32(is_wrinkled)
                across = narrow
        return state, larger, smaller, across

    @wp.func
    def taut(G: mat22, constants: Any):
        state, larger, smaller, across = state_of(G, constants)
        strain = G
        if state == wp.int32(is_slack):
            strain = mat22(real(0.0), real(0.0), real(0.0), real(0.0))
        elif state == wp.int32(is_wrinkled):
            # G turned into its principal axes, with g2 replaced: (G - g2 I) / (g1 - g2) projects on the larger.
            scale = (larger - across) / (larger - smaller)
            strain = mat22(
                across + scale * (G[0, 0] - smaller), scale * G[0, 1],
                scale * G[1, 0], across + scale * (G[1, 1] - smaller),
            )  # fmt: skip
        return strain

    return state_of, taut


def relaxed_response(
    bits: int, response: FunctionFactory, width: FunctionFactory, slack_stiffness: float
) -> wp.Function:
    """Function of stress and moduli of the relaxed energy, from that of the original material."""
    stiff = slack_stiffness > 0.0
    types = numeric(bits)
    real, mat22, vec6 = types.real, types.mat22, types.vec6
    response_of, turned = response(bits), principal_tangent(bits)
    Constants = constants_of(response_of)
    state_of, _ = taut_strain(width, bits)
    is_taut, is_wrinkled = TAUT, WRINKLED

    @wp.func
    def relaxed_stress_and_moduli(G: mat22, constants: Constants):
        state, larger, smaller, across = state_of(G, constants)
        S = mat22()
        T = vec6()
        if state == wp.int32(is_taut):
            S, T = response_of(G, constants)
        elif state == wp.int32(is_wrinkled):
            # Along the wrinkles, with S22 = 0; the direction of the wrinkles turns with that of G.
            along, moduli = response_of(mat22(larger, real(0.0), real(0.0), across), constants)
            slope = moduli[0] - moduli[1] * moduli[1] / moduli[3]
            turn = along[0, 0] / (larger - smaller)
            S = mat22(
                turn * (G[0, 0] - smaller), turn * G[0, 1], turn * G[1, 0], turn * (G[1, 1] - smaller)
            )  # fmt: skip
            T = turned(G, slope, real(0.0), real(0.0), turn)
        if wp.static(stiff):
            k = real(slack_stiffness)
            S += k * G
            T += vec6(k, real(0.0), real(0.0), k, real(0.0), real(2.0) * k)
        return S, T

    return relaxed_stress_and_moduli


@functools.cache
def tension_field(
    functions: PairFactory, near: FunctionFactory | None, response: FunctionFactory | None,
    volume: FunctionFactory | None, width: FunctionFactory, slack_stiffness: float,
) -> MaterialFunctions:  # fmt: skip
    """Functions of the relaxed energy from those of the original material and a slack stiffness [Pa], see above."""
    stiff = slack_stiffness > 0.0

    def at_taut_strain(bits, function):
        mat22, Constants = numeric(bits).mat22, constants_of(function)
        _, taut = taut_strain(width, bits)

        @wp.func(name=f"relaxed_{function.func.__name__}")
        def relaxed(G: mat22, constants: Constants):
            return function(taut(G, constants), constants)

        return relaxed

    def relaxed_functions(bits):
        stress, energy = (at_taut_strain(bits, function) for function in functions(bits))
        if not stiff:
            return stress, energy
        types = numeric(bits)
        real, mat22, Constants = types.real, types.mat22, constants_of(stress)

        @wp.func
        def stiffened_stress(G: mat22, constants: Constants):
            return stress(G, constants) + real(slack_stiffness) * G

        @wp.func
        def stiffened_energy(G: mat22, constants: Constants):
            return energy(G, constants) + real(wp.static(0.25 * slack_stiffness)) * wp.ddot(G, G)

        return stiffened_stress, stiffened_energy

    def relaxed_near(bits):
        types = numeric(bits)
        real, mat22 = types.real, types.mat22
        stress_near, eigenvalues = near(bits), principal_strains(bits)
        Constants = constants_of(stress_near)
        _, taut = taut_strain(width, bits)

        @wp.func
        def relaxed_stress_near(G: mat22, constants: Constants, guess: real):
            # Most sheets are taut: their own stress tells, if none of its principal values is negative. The search for
            # the width takes as long as all else. No sheet narrower than an incompressible one is taut.
            S = mat22()
            found = guess
            is_taut = bool(False)
            larger, smaller = eigenvalues(G)
            if larger > real(0.0):
                s = wp.sqrt(real(1.0) + larger)
                if smaller * s * (real(1.0) + s) >= -larger:
                    S, found = stress_near(G, constants, guess)
                    is_taut = S[0, 0] + S[1, 1] >= real(0.0) and wp.determinant(S) >= real(0.0)
            if not is_taut:
                S, found = stress_near(taut(G, constants), constants, guess)
            if wp.static(stiff):
                S += real(slack_stiffness) * G
            return S, found

        return relaxed_stress_near

    def response_of(bits):
        return relaxed_response(bits, response, width, slack_stiffness)

    def relaxed_volume(bits):
        return at_taut_strain(bits, volume(bits))

    what = f"relaxed_by_{width.__name__}_and_{slack_stiffness!r}"
    return MaterialFunctions(
        named(relaxed_functions, functions, what),
        named(relaxed_near, near, what) if near is not None else None,
        named(response_of, response, what) if response is not None else None,
        named(relaxed_volume, volume, what) if volume is not None else None,
    )
