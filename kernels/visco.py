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
`strain` [members, points] stores C - I of the last step (11, 22, 12), `overstress` [terms * members, points] stores
H_p.
"""

import functools

import warp as wp

from .bond_associated import bond_associated
from .effects import Kernel, kernel
from .factories import PairFactory, constants_of
from .families import Layout, family_functions
from .incompressible import incompressible, yeoh
from .numeric import numeric

# Steps of the search for C_q, and its tolerance; the search is convex and takes a few steps.
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
def conversions(bits: int) -> tuple[wp.Function, wp.Function]:
    """Functions Prony term -> constants of its Yeoh stress, and (11, 22, 12) -> symmetric tensor."""
    types = numeric(bits)
    real, vec3, mat22, parameters = types.real, types.vec3, types.mat22, types.parameters

    @wp.func
    def term_constants(term: parameters):
        return parameters(term[0], term[1], real(0.0), real(0.0))

    @wp.func
    def tensor(v: vec3):
        return mat22(v[0], v[2], v[2], v[1])

    return term_constants, tensor


@functools.cache
def overstressed(bits: int) -> wp.Function:
    """Function (S, G, i, j, members, prony, strain, overstress) -> S plus the stresses of all Prony terms [Pa]."""
    types = numeric(bits)
    vec3, mat22, parameters = types.vec3, types.mat22, types.parameters
    prony_stress = incompressible(yeoh).functions(bits)[0]
    term_constants, tensor = conversions(bits)

    @wp.func
    def with_overstress(
        S: mat22,
        G: mat22,
        i: int,
        j: int,
        members: int,
        prony: wp.array(dtype=parameters),
        strain: wp.array2d(dtype=vec3),
        overstress: wp.array2d(dtype=vec3),
    ):
        total = S
        old = tensor(strain[j, i])
        for p in range(prony.shape[0]):
            own = term_constants(prony[p])
            total += tensor(overstress[p * members + j, i])
            total += prony_stress(G, own) - prony_stress(old, own)
        return total

    return with_overstress


@functools.cache
def viscous_update(layout: Layout, material: PairFactory) -> Kernel:
    """Reference kernel `update`: advances strain and overstress to the end of a step and adds the viscous work [J].

    kernels/family_rows.py combines the update with the force. Arguments as for `bond_associated`.
    """
    types, bits = layout.types, layout.bits
    real, vec3, mat22, parameters = types.real, types.vec3, types.mat22, types.parameters
    f = family_functions(layout)
    Family = f.struct
    prony_stress = incompressible(yeoh).functions(bits)[0]
    law = bond_associated(layout, material, "variational").mechanics
    is_undamaged, visit, green, family_scale = law.is_undamaged, law.visit, law.green, law.family_scale
    retained = relaxation_factors(bits)
    term_constants, tensor = conversions(bits)

    @wp.func
    def rate_of(G: mat22, old: mat22, step: real):
        """Rate |dC/dt| of the three-dimensional C, with C33 = 1 / det C (VE eqs. 31 and 32)."""
        change = G - old
        area = real(1.0) + G[0, 0] + G[1, 1] + wp.determinant(G)
        old_area = real(1.0) + old[0, 0] + old[1, 1] + wp.determinant(old)
        thinning = (change[0, 0] + change[1, 1] + wp.determinant(G) - wp.determinant(old)) / (area * old_area)
        return wp.sqrt(wp.ddot(change, change) + thinning * thinning) / step

    @kernel(gathers=("displacement",))
    def update(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        inverse_horizon: real,
        step: wp.array(dtype=real),
        prony: wp.array(dtype=parameters),
        unit_volume: real,
        first: int,
        strain: wp.array2d(dtype=vec3),
        overstress: wp.array2d(dtype=vec3),
        viscous_work: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        undamaged = is_undamaged(family, intact, i)
        dt = step[0]
        total = real(0.0)
        work = wp.float64(0.0)
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = visit(
                family, intact, displacement, inverse_horizon, i, j, undamaged
            )
            if there:
                G = green(H1, H2, tilt)
                old = tensor(strain[j, i])
                total += weight
                rate = rate_of(G, old, dt)
                for p in range(prony.shape[0]):
                    term = prony[p]
                    c = term_constants(term)
                    x = dt / term[2]
                    if term[3] != real(0.0):
                        x *= wp.pow(rate, term[3])
                    k = retained(x)
                    row = p * family.members + j
                    before = overstress[row, i]
                    jump = prony_stress(G, c) - prony_stress(old, c)
                    after = before - (x * k) * before + k * vec3(jump[0, 0], jump[1, 1], jump[0, 1])
                    overstress[row, i] = after
                    mean = before + after
                    power = mean[0] * (G[0, 0] - old[0, 0]) + mean[1] * (G[1, 1] - old[1, 1])
                    power += real(2.0) * mean[2] * (G[0, 1] - old[0, 1])
                    work += wp.float64(real(0.25) * weight * power)
                strain[j, i] = vec3(G[0, 0], G[1, 1], G[0, 1])
        viscous_work[i] = viscous_work[i] + wp.float64(unit_volume * family_scale(family, i, undamaged, total)) * work

    return update


@functools.cache
def visco_energy(layout: Layout, material: PairFactory) -> Kernel:
    """Kernel `stored_energy`: stored energy and dissipated energy of each family [points], J."""
    types, bits = layout.types, layout.bits
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    prony_stress = incompressible(yeoh).functions(bits)[0]
    law = bond_associated(layout, material, "variational").mechanics
    is_undamaged, visit, green, family_scale = law.is_undamaged, law.visit, law.green, law.family_scale
    term_constants, tensor = conversions(bits)
    conjugate, energies = prony_energy(), material(64)[1]
    Constants, Wide = constants_of(material(bits)[1]), constants_of(energies)

    @kernel(gathers=("displacement",))
    def stored_energy(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_volume: real,
        prony: wp.array(dtype=parameters),
        strain: wp.array2d(dtype=vec3),
        overstress: wp.array2d(dtype=vec3),
        viscous_work: wp.array(dtype=wp.float64),
        first: int,
        out: wp.array(dtype=wp.float64),
        dissipated: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        undamaged = is_undamaged(family, intact, i)
        elastic = wp.float64(0.0)
        viscous = wp.float64(0.0)
        total = real(0.0)
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = visit(
                family, intact, displacement, inverse_horizon, i, j, undamaged
            )
            if there:
                G = green(H1, H2, tilt)
                total += weight
                wide = wp.mat22d(wp.float64(G[0, 0]), wp.float64(G[0, 1]), wp.float64(G[1, 0]), wp.float64(G[1, 1]))
                c = Wide()
                for n in range(wp.static(len(Wide()))):
                    c[n] = wp.float64(constants[n])
                elastic += wp.float64(weight) * energies(wide, c)
                for p in range(prony.shape[0]):
                    term = prony[p]
                    # H belongs to the strain of the last step; add the same difference as the force does.
                    now = term_constants(term)
                    H = overstress[p * family.members + j, i]
                    ahead = prony_stress(G, now) - prony_stress(tensor(strain[j, i]), now)
                    viscous += wp.float64(weight) * conjugate(
                        wide,
                        wp.vec3d(
                            wp.float64(H[0] + ahead[0, 0]), wp.float64(H[1] + ahead[1, 1]),
                            wp.float64(H[2] + ahead[0, 1]),
                        ),
                        wp.vec4d(wp.float64(term[0]), wp.float64(term[1]), wp.float64(0.0), wp.float64(0.0)),
                    )  # fmt: skip
        scale = wp.float64(unit_volume * family_scale(family, i, undamaged, total))
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
