"""Bond-associated visco-hyperelasticity: a long-term stress plus Prony terms for each intersection.

    S = S_inf(C) + sum_p H_p,        dH_p/dt + H_p / theta_p = d S_p(C) / dt,     theta_p = time_p rate^-exponent_p

S_inf is the long-term stress, S_inf + sum_p S_p the instantaneous stress. All are plane-stress second Piola stresses
and vanish in the undeformed sheet. If S_p changes linearly in time over a step, the update is exact (VE eq. 58):

    H_p <- H_p - x k H_p + k (S_p(new) - S_p(old)),        x = dt / theta_p,  k = (1 - exp(-x)) / x.

The relaxed stress q = S_p - H_p is then a mean of 0 and of all earlier S_p. The energy F_p of S_p is convex in C, so q
is the stress at some strain C_q, and the stored energy and the dissipation are

    Psi_p = F_p(C) - F_p(C_q) - q : (C - C_q) / 2 >= 0,      D_p = (S_p(C) - q) : (C - C_q) / (2 theta_p) >= 0

for any motion, both by convexity. Energies, which need a search for C_q, are computed in float64 and only at frames. At
a trial displacement, as in the estimate of the stable step, the force responds with the instantaneous stiffness.
`state` [(terms + 1) * members, points] stores (11, 22, 12) of H_p, and then C - I of the last step.
"""

import functools

import warp as wp

from ..bond_associated import family_mechanics
from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..incompressible import incompressible, yeoh
from ..kinematics import kinematics
from ..materials import invariants, named
from ..numeric import FunctionFactory, PairFactory, constants_of, numeric

# Maximum number of steps of the search for C_q, which is convex and takes a few, and its tolerance.
SEARCH, ENOUGH = 60, 1e-11


@functools.cache
def relaxation_factors(bits: int) -> wp.Function:
    """Function x -> (1 - exp(-x)) / x for x >= 0, accurate for small x."""
    real = numeric(bits).real

    @wp.func
    def retained(x: real):
        answer = real(0.0)
        if x < real(0.03125):
            third = real(1.0) / real(3.0)
            answer = real(1.0) - real(0.5) * x * (
                real(1.0) - third * x * (real(1.0) - real(0.25) * x * (real(1.0) - x / real(5.0)))
            )
        else:
            answer = (real(1.0) - wp.exp(-x)) / x
        return answer

    return retained


@functools.cache
def symmetric(bits: int) -> wp.Function:
    """Function (11, 22, 12) -> symmetric tensor."""
    types = numeric(bits)
    vec4, mat22 = types.parameters, types.mat22

    @wp.func
    def tensor(v: vec4):
        return mat22(v[0], v[2], v[2], v[1])

    return tensor


@functools.cache
def prony_response(material: PairFactory) -> FunctionFactory:
    """Factory of (G, constants, i, j, members, step, prony, state) -> S at the end of a step, viscous work [J/m^3].

    It advances `state`; a step of zero leaves it as it is, and the terms respond elastically. All terms have Yeoh's
    stress, S_p = 2 (c10 + 2 c20 (I1 - 3)) (I - C33 C^-1), so they share the tensor I - C33 C^-1.
    """

    def response_of(bits):
        types = numeric(bits)
        real, vec4, mat22 = types.real, types.parameters, types.mat22
        stress, _ = material(bits)
        Constants = constants_of(stress)
        area_change, _, plane_stress = invariants(bits)
        retained, tensor = relaxation_factors(bits), symmetric(bits)

        @wp.func
        def unit_stress(G: mat22, slope: real, d: real):
            """I1 - 3, and 2 (I - C33 C^-1) as 11, 22, 12; slope = 1 / det C, d = det C - 1."""
            t = G[0, 0] + G[1, 1]
            M = plane_stress(G, slope, -slope * d, real(2.0))
            return slope * (t * d - wp.determinant(G)), vec4(M[0, 0], M[1, 1], M[0, 1], real(0.0))

        @wp.func
        def advance(
            G: mat22,
            constants: Constants,
            i: int,
            j: int,
            members: int,
            step: real,
            prony: wp.array(dtype=vec4),
            state: wp.array2d(dtype=vec4),
        ):
            last = prony.shape[0] * members + j
            before = state[last, i]
            old = tensor(before)
            d = area_change(G)
            d_old = area_change(old)
            slope = real(1.0) / (real(1.0) + d)
            slope_old = real(1.0) / (real(1.0) + d_old)
            x, M = unit_stress(G, slope, d)
            x_old, M_old = unit_stress(old, slope_old, d_old)
            total = vec4()
            mean = vec4()
            now = vec4(G[0, 0], G[1, 1], G[0, 1], real(0.0))
            change = now - before
            for p in range(prony.shape[0]):
                term = prony[p]
                row = p * members + j
                H = state[row, i]
                more = real(2.0) * term[1]
                y = step / term[2]
                if term[3] != real(0.0) and step > real(0.0):
                    # Rate |dC/dt| of the three-dimensional C, with C33 = 1 / det C (VE eqs. 31 and 32).
                    thinning = (d - d_old) * slope * slope_old
                    squared = change[0] * change[0] + change[1] * change[1] + real(2.0) * change[2] * change[2]
                    y *= wp.pow(wp.sqrt(squared + thinning * thinning) / step, term[3])
                k = retained(y)
                after = H - (y * k) * H + k * ((term[0] + more * x) * M - (term[0] + more * x_old) * M_old)
                if step > real(0.0):
                    state[row, i] = after
                mean += H + after
                total += after
            if step > real(0.0):
                state[last, i] = now
            work = mean[0] * change[0] + mean[1] * change[1] + real(2.0) * mean[2] * change[2]
            return stress(G, constants) + tensor(total), real(0.25) * work

        return advance

    return named(response_of, material, "prony")


@functools.cache
def visco_energy(layout: Layout, material: PairFactory) -> Kernel:
    """Kernel `stored_energy`: stored energy and dissipated energy of each family [points], J."""
    types, bits = layout.types, layout.bits
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    prony_stress = incompressible(yeoh).functions(bits)[0]
    law = family_mechanics(layout, "variational")
    visit, green = law.visit, kinematics(bits, layout.curved).green
    tensor = symmetric(bits)
    conjugate, energies = prony_energy(), material(64)[1]
    Constants, Wide = constants_of(material(bits)[1]), constants_of(energies)

    @kernel(gathers=("displacement",))
    def stored_energy(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_volume: real,
        prony: wp.array(dtype=parameters),
        state: wp.array2d(dtype=parameters),
        viscous_work: wp.array(dtype=wp.float64),
        first: int,
        out: wp.array(dtype=wp.float64),
        dissipated: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        elastic = wp.float64(0.0)
        viscous = wp.float64(0.0)
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = visit(family, displacement, i, j, undamaged)
            if there:
                G = green(H1, H2, tilt)
                wide = wp.mat22d(wp.float64(G[0, 0]), wp.float64(G[0, 1]), wp.float64(G[1, 0]), wp.float64(G[1, 1]))
                c = Wide()
                for n in range(wp.static(len(Wide()))):
                    c[n] = wp.float64(constants[n])
                elastic += wp.float64(weight) * energies(wide, c)
                for p in range(prony.shape[0]):
                    term = prony[p]
                    # H belongs to the strain of the last step; add the same difference as the force does.
                    now = parameters(term[0], term[1], real(0.0), real(0.0))
                    H = state[p * family.members + j, i]
                    old = tensor(state[prony.shape[0] * family.members + j, i])
                    ahead = prony_stress(G, now) - prony_stress(old, now)
                    viscous += wp.float64(weight) * conjugate(
                        wide,
                        wp.vec3d(
                            wp.float64(H[0] + ahead[0, 0]), wp.float64(H[1] + ahead[1, 1]),
                            wp.float64(H[2] + ahead[0, 1]),
                        ),
                        wp.vec4d(wp.float64(term[0]), wp.float64(term[1]), wp.float64(0.0), wp.float64(0.0)),
                    )  # fmt: skip
        scale = wp.float64(unit_volume)
        out[i] = scale * (elastic + viscous)
        dissipated[i] = viscous_work[i] - scale * viscous

    return stored_energy


@functools.cache
def prony_energy() -> wp.Function:
    """Function (G, H, constants) -> stored energy of a Prony term [J/m^3], in float64."""
    made = incompressible(yeoh)
    _, energy = made.functions(64)
    response = made.response(64)
    search, enough = SEARCH, ENOUGH

    @wp.func
    def potential(G: wp.mat22d, q: wp.vec3d, c: wp.vec4d):
        """F(C) - q : (C - I) / 2, infinite where det C <= 0."""
        value = wp.float64(wp.inf)
        area = wp.float64(1.0) + G[0, 0] + G[1, 1] + wp.determinant(G)
        if area > wp.float64(0.0) and wp.float64(1.0) + G[0, 0] > wp.float64(0.0):
            value = energy(G, c) - wp.float64(0.5) * (
                q[0] * G[0, 0] + q[1] * G[1, 1] + wp.float64(2.0) * q[2] * G[0, 1]
            )
        return value

    @wp.func
    def stored(G: wp.mat22d, H: wp.vec3d, c: wp.vec4d):
        """Psi = F(C) - q : (C - I) / 2 minus the minimum of the potential, which is at C_q."""
        S, T = response(G, c)
        q = wp.vec3d(S[0, 0] - H[0], S[1, 1] - H[1], S[0, 1] - H[2])
        value = potential(G, q, c)
        least = value
        Q = G
        for _ in range(search):
            S, T = response(Q, c)
            tangent = wp.mat33d(T[0], T[1], T[2], T[1], T[3], T[4], T[2], T[4], T[5])
            move = wp.inverse(tangent) * wp.vec3d(q[0] - S[0, 0], q[1] - S[1, 1], wp.float64(2.0) * (q[2] - S[0, 1]))
            fraction = wp.float64(1.0)
            trial = Q
            now = least
            for _half in range(40):
                trial = Q + fraction * wp.mat22d(move[0], move[2], move[2], move[1])
                now = potential(trial, q, c)
                if now <= least:
                    break
                fraction *= wp.float64(0.5)
            if now <= least:
                Q = trial
                least = now
            if wp.length(move) <= wp.float64(enough):
                break
        return value - least

    return stored
