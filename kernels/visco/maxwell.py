"""Viscous branches: Maxwell elements at finite strain, which wrinkle together with the elastic network.

A branch is a transient network (Green and Tobolsky, J. Chem. Phys. 14, 1946; Lubliner, Mech. Res. Comm. 12, 1985): its
chains let go at the rate 1 / tau and form again free of stress. M is the mean of C^-1 over their times of birth:

    W = W_eq(C) + sum_p mu_p / 2 (C : M_p - 3 - ln det M_p),        dM_p/dt = (C^-1 - M_p) / tau_p

in three dimensions, with C33 = 1 / det C. M begins as I. The stress of a branch at constant C decays as exp(-t / tau),
and its dissipation is mu / (2 tau) sum_k (b_k + 1 / b_k - 2) >= 0 with the eigenvalues b_k of C M.

A step at constant C is exact: with k = 1 - exp(-dt / tau), M <- M + k (C^-1 - M), and the stress becomes 1 - k times
that before. So the stress at the end of a step is the derivative of an incremental potential (Ortiz and Stainier,
Comput. Methods Appl. Mech. Eng. 171, 1999),

    W_eq(C) + sum_p (1 - k_p) mu_p / 2 C : M_p + ...

A sheet with a tension field lengthens C by wrinkles to C* = C + A, A >= 0, of the smallest potential (Pipkin, IMA J.
Appl. Math. 36, 1986); elastic network and branches have the same C*, which also enters the M of the next step. C* then
minimises the energy W of the new M, too. The branches are anisotropic, but their energy with (q C^-1)-like terms of
the elastic network,

    (P : C + Q / det C) / 2,        P = S_eq + q C^-1 + sum_p mu_p M_p,     Q = q det C + sum_p mu_p M_p33,

is that of a neo-Hookean sheet in the coordinates in which P is I. Its tension field has a closed form: with the
eigenvalues c1 >= c2 of P C and K = Q det P, the sheet is slack if c1^3 <= K, and wrinkled if c2 < w = sqrt(K / c1):

    slack     C* = K^(1/3) P^-1            wrinkled      C* = C + (w - c2) / (c1 - c2) (c1 P^-1 - C)

For a neo-Hookean elastic network q is its modulus times C33, whatever C. For others P and Q are those at the last C*,
with the q that has the elastic network's stiffness across the wrinkles; the iteration then converges as Newton's.

`state` [branches * members, points] stores M - I (11, 22, 12, 33), half a step after the strain: the force has half of
the decay of its step. This splitting is of second order in the step, and what is lost balances the energy. All formulas
are written in G = C - I and M - I, so that no digits of a small strain are lost.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..bond_associated import energy_of_intersections
from ..families import Layout, family_functions
from ..materials import invariants, named
from ..numeric import FunctionFactory, PairFactory, constants_of, numeric
from ..tension_field import taut_strain
from .visco import relaxation_factors

# Maximum number of steps of the search for C*, and the relative change at which it ends.
STEPS = 24
ENOUGH = {32: 1e-6, 64: 1e-12}
# Below it u - ln(1 + u) is a quotient of polynomials, accurate to u^5 / 4000.
SMALL = {32: 0.2, 64: 0.01}


@dataclass(frozen=True)
class ElasticNetwork:
    """Factories of the material without branches.

    Attributes:
        functions: (stress, energy).
        response: Stress and moduli, for a tension field.
        width: Width in uniaxial tension; None without a tension field.
    """

    functions: PairFactory
    response: FunctionFactory | None = None
    width: FunctionFactory | None = None


@dataclass(frozen=True)
class MaxwellFunctions:
    """Warp functions of one intersection j of point i; arrays `branches` (modulus, time) and `state` as above.

    Attributes:
        respond: (G, constants, i, j, members, step, branches, state) -> S after a step, C* - I.
        advance: The same arguments -> S after a step, energy lost in it [J/m^3]; advances the state.
        stored: (C* - I, i, j, members, branches, state) -> energy of the branches [J/m^3].
    """

    respond: wp.Function
    advance: wp.Function
    stored: wp.Function


@functools.cache
def product_values(bits: int) -> wp.Function:
    """Function (A, B) -> larger and smaller eigenvalue of (I + A)(I + B) - I, for symmetric A and B."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def values(A: mat22, B: mat22):
        E = A + B + A * B
        mean = real(0.5) * (E[0, 0] + E[1, 1])
        half = real(0.5) * (E[0, 0] - E[1, 1])
        radius = wp.sqrt(wp.max(half * half + E[0, 1] * E[1, 0], real(0.0)))
        return mean + radius, mean - radius

    return values


@functools.cache
def slackened(bits: int) -> wp.Function:
    """Function (C - I, P - I, Q - 1) -> C* - I of the energy (P : C + Q / det C) / 2, see above."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    area_change = invariants(bits)[0]
    values = product_values(bits)

    @wp.func
    def slackened(G: mat22, P: mat22, Q: real):
        one = real(1.0)
        change = area_change(P)
        K = Q + change + Q * change
        scale = one / (one + change)
        # P^-1 - I.
        off = -scale * P[0, 1]
        inverse = mat22(scale * (P[1, 1] - change), off, off, scale * (P[0, 0] - change))
        unit = mat22(one, real(0.0), real(0.0), one)
        larger, smaller = values(P, G)
        root = wp.cbrt(one + K)
        even = K / (root * root + root + one)
        strain = G
        if larger <= even:
            strain = even * (unit + inverse) + inverse
        else:
            a = (K - larger) / (one + larger)
            width = a / (one + wp.sqrt(one + a))
            if smaller < width:
                part = (width - smaller) / (larger - smaller)
                strain = G + part * (larger * (unit + inverse) + inverse - G)
        return strain

    return slackened


@functools.cache
def maxwell(network: ElasticNetwork, bits: int) -> MaxwellFunctions:
    """Functions of a sheet with branches."""
    types = numeric(bits)
    real, vec3, vec4, mat22 = types.real, types.vec3, types.parameters, types.mat22
    stress, _ = network.functions(bits)
    Constants = constants_of(stress)
    area_change, _, plane_stress = invariants(bits)
    retained, values, slack = relaxation_factors(bits), product_values(bits), slackened(bits)
    wrinkles = network.width is not None and network.response is not None
    response = network.response(bits) if network.response is not None else None
    taut = taut_strain(network.width, bits)[1] if network.width is not None else None
    steps, enough, small = STEPS, ENOUGH[bits], SMALL[bits]

    @wp.func
    def total_stress(S: mat22, G: mat22, modulus: real, n: vec4):
        """Stress S of the elastic network plus that of the branches: sum mu_p (M_p - M_p33 C33 C^-1)."""
        d = area_change(G)
        slope = real(1.0) / (real(1.0) + d)
        push = n[3] * slope * slope
        shear = n[2] + push * G[0, 1]
        own = mat22(n[0] - push * (real(1.0) + G[1, 1]), shear, shear, n[1] - push * (real(1.0) + G[0, 0]))
        return S + own + plane_stress(G, slope, -slope * d, modulus)

    @wp.func
    def matching(S: mat22, R: mat22, T: types.vec6, G: mat22):
        """Return q that gives (P : C + Q / det C) / 2 the stiffness of the elastic network across the wrinkles.

        S is the stress of all, R and T stress and moduli of the elastic network at G.
        """
        half = real(0.5) * (S[0, 0] - S[1, 1])
        radius = wp.sqrt(half * half + S[0, 1] * S[0, 1])
        v = vec3(real(0.0), real(1.0), real(0.0))
        if radius > real(0.0):
            cosine = real(0.5) * half / radius
            v = vec3(real(0.5) - cosine, real(0.5) + cosine, -real(0.5) * S[0, 1] / radius)
        k = v[0] * (T[0] * v[0] + real(2.0) * (T[1] * v[1] + T[2] * v[2]))
        k += v[1] * (T[3] * v[1] + real(2.0) * T[4] * v[2]) + T[5] * v[2] * v[2]
        area = real(1.0) + area_change(G)
        z = (v[0] * (real(1.0) + G[1, 1]) + v[1] * (real(1.0) + G[0, 0]) - real(2.0) * v[2] * G[0, 1]) / area
        across = v[0] * R[0, 0] + v[1] * R[1, 1] + real(2.0) * v[2] * R[0, 1]
        # P must stay positive definite.
        return wp.max(real(0.5) * k / (z * z), wp.max(-real(2.0) * across / z, real(0.0)))

    @wp.func
    def respond(
        G: mat22,
        constants: Constants,
        i: int,
        j: int,
        members: int,
        step: real,
        branches: wp.array(dtype=vec4),
        state: wp.array2d(dtype=vec4),
    ):
        modulus = real(0.0)
        n = vec4()
        for p in range(branches.shape[0]):
            x = step / branches[p][1]
            left = branches[p][0] * (real(1.0) - x * retained(x))
            modulus += left
            n += left * state[p * members + j, i]
        S = total_stress(stress(G, constants), G, modulus, n)
        strain = G
        if wp.static(wrinkles):
            is_taut = S[0, 0] + S[1, 1] >= real(0.0) and wp.determinant(S) >= real(0.0)
            if not is_taut:
                strain = taut(G, constants)
                for _step in range(steps):
                    R, T = response(strain, constants)
                    q = matching(total_stress(R, strain, modulus, n), R, T, strain)
                    d = area_change(strain)
                    slope = q / (real(1.0) + d)
                    unit = real(1.0) / (q + modulus)
                    shear = unit * (R[0, 1] + n[2] - slope * strain[0, 1])
                    P = mat22(
                        unit * (R[0, 0] + n[0] + slope * (strain[1, 1] - d)), shear,
                        shear, unit * (R[1, 1] + n[1] + slope * (strain[0, 0] - d)),
                    )  # fmt: skip
                    new = slack(G, P, unit * (q * d + n[3]))
                    move = new - strain
                    strain = new
                    size = real(0.01) + wp.abs(new[0, 0]) + wp.abs(new[1, 1])
                    if wp.ddot(move, move) <= real(enough * enough) * size * size:
                        break
                S = total_stress(stress(strain, constants), strain, modulus, n)
        return S, strain

    @wp.func
    def bulge(u: real):
        """Return u - ln(1 + u), accurate for small u."""
        answer = real(0.0)
        if wp.abs(u) < real(small):
            answer = u * u * (real(15.0) + real(8.0) * u) / (real(30.0) + u * (real(36.0) + real(9.0) * u))
        else:
            answer = u - wp.log(real(1.0) + u)
        return answer

    @wp.func
    def excess(strain: mat22, m: vec4):
        """Eigenvalues of C M, minus 1."""
        first, second = values(strain, mat22(m[0], m[2], m[2], m[1]))
        d = area_change(strain)
        return vec3(first, second, (m[3] - d) / (real(1.0) + d))

    @wp.func
    def advance(
        G: mat22,
        constants: Constants,
        i: int,
        j: int,
        members: int,
        step: real,
        branches: wp.array(dtype=vec4),
        state: wp.array2d(dtype=vec4),
    ):
        S, strain = respond(G, constants, i, j, members, real(0.5) * step, branches, state)
        lost = real(0.0)
        if step > real(0.0):
            d = area_change(strain)
            slope = real(1.0) / (real(1.0) + d)
            inverse = vec4(slope * (strain[1, 1] - d), slope * (strain[0, 0] - d), -slope * strain[0, 1], d)
            for p in range(branches.shape[0]):
                x = step / branches[p][1]
                k = x * retained(x)
                row = p * members + j
                m = state[row, i]
                e = excess(strain, m)
                for c in range(3):
                    kept = (real(1.0) - k) * e[c]
                    u = k * e[c] / (real(1.0) + kept)
                    lost += real(0.5) * branches[p][0] * (kept * u + bulge(u))
                state[row, i] = m + k * (inverse - m)
        return S, lost

    @wp.func
    def stored(
        strain: mat22, i: int, j: int, members: int, branches: wp.array(dtype=vec4), state: wp.array2d(dtype=vec4)
    ):
        total = real(0.0)
        for p in range(branches.shape[0]):
            e = excess(strain, state[p * members + j, i])
            total += real(0.5) * branches[p][0] * (bulge(e[0]) + bulge(e[1]) + bulge(e[2]))
        return total

    return MaxwellFunctions(respond, advance, stored)


@functools.cache
def branched_constants(network: ElasticNetwork, bits: int) -> type:
    """Struct of what the energy of a family depends on besides the displacement."""
    vec4, Constants = numeric(bits).parameters, constants_of(network.functions(bits)[0])

    @wp.struct
    class Branched:
        elastic: Constants
        branches: wp.array(dtype=vec4)
        state: wp.array2d(dtype=vec4)

    return Branched


@functools.cache
def branched_energy(layout: Layout, network: ElasticNetwork, drives: bool) -> wp.Function:
    """Warp function of the energy of a family at an earlier time, as for `energy_of_families`.

    Args:
        layout: Layout of the families.
        network: The material without branches.
        drives: Whether it is the energy that drives tears, that of the elastic network alone (Shrimali and
            Lopez-Pamies, Extreme Mech. Lett. 58, 2023).
    """
    types, bits = layout.types, layout.bits
    real, mat22 = types.real, types.mat22
    Family, Branched = family_functions(layout).struct, branched_constants(network, bits)
    _, energy = network.functions(bits)
    functions = maxwell(network, bits)
    respond, stored_in = functions.respond, functions.stored

    @wp.func(name="driving_density" if drives else "branched_density")
    def density(family: Family, constants: Branched, i: int, j: int, G: mat22):
        _S, strain = respond(
            G, constants.elastic, i, j, family.members, real(0.0), constants.branches, constants.state
        )  # fmt: skip
        stored = energy(strain, constants.elastic)
        if wp.static(not drives):
            stored += stored_in(strain, i, j, family.members, constants.branches, constants.state)
        return stored

    return energy_of_intersections(layout, "variational", density)


@functools.cache
def maxwell_response(network: ElasticNetwork) -> FunctionFactory:
    """Factory of `MaxwellFunctions.advance`."""
    return named(lambda bits: maxwell(network, bits).advance, network.functions, "maxwell")
