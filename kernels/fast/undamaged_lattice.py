"""Fast path of the variational bond-associated law: undamaged families inside a lattice or grid.

These families are identical, so all data of their reference configuration are compile-time constants. With
    F_ij = I + sum_k U_ik (x) b_jk,    b_jk = c_k K_ij^-1 X_ik,    t_ik = h sum_j W_ij P_ij b_jk
a member of an intersection costs twelve multiplications and additions. Neighbouring intersections of a large family
differ in a few members. The kernel therefore goes from bond to bond along a closed path and updates two sums: the
moments sum c_k U_k (x) X_k over the current intersection, and the sum R of W P K^-1 over all bonds so far. A member
that leaves the intersection gets c_k R X_k; one that enters gets minus that. The cost per intersection is then only
that of the members that enter or leave.

A rotation by 90 degrees maps the stencil of a square lattice onto itself. The kernel therefore unrolls the bonds of one
quarter and repeats them four times, each time with displacements and forces in axes rotated by 90 degrees. The family
then fits the registers and the code fits the instruction cache of a GPU. If the spacings along x and y differ, the
bonds of one half are repeated with a rotation by 180 degrees. The material must be isotropic.
"""

import functools
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..kinematics import kinematics
from ..numeric import FunctionFactory, constants_of, entry_of, numeric
from .stencil import LARGE, Stencil

# Maximum number of registers, of 255, that displacements and forces of a family may take together.
MAX_REGISTERS = 200


@functools.cache
def undamaged_lattice_force(
    bits: int,
    near: FunctionFactory,
    stencil: Stencil,
    gridded: bool,
    breakable: bool,
) -> Kernel:
    """Kernel that fills bond_force [members, ring] and the own half of the force [points] for undamaged inner families.

    Point i uses column i % ring of `bond_force`; `ring` is the number of points, or smaller if launches reuse columns.

    Args:
        bits: 32 or 64.
        near: Factory of stress_near, called with `bits`.
        stencil: The family, with its constants.
        gridded: Whether the grid has gaps. `places` is then the table `centres` (see kernels/families.py); on a lattice
            it is the number of columns.
        breakable: Whether families may be damaged. The points of those, and at edges, are then listed in `others`, in
            any order: they are left to another kernel.
    """
    types = numeric(bits)
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    stress_near = near(bits)
    Constants = constants_of(stress_near)
    green = kinematics(bits).green
    n, bonds = len(stencil.steps), len(stencil.part)
    full = (1 << n) - 1
    right = [step[0] for step in stencil.steps]
    up = [step[1] for step in stencil.steps]
    turned, inside, half = stencil.turned, stencil.inside, stencil.turns == 2
    large = n > LARGE
    ahead = [*inside[1:], tuple(inside[0][turned.index(k)] for k in range(n))]
    enters = [
        [late and not early for early, late in zip(*pair, strict=True)] for pair in zip(inside, ahead, strict=True)
    ]
    leaves = [
        [early and not late for early, late in zip(*pair, strict=True)] for pair in zip(inside, ahead, strict=True)
    ]
    summed = [[not large and here for here in members] for members in inside]
    c1 = [real(moment[0]) for moment in stencil.moments]
    c2 = [real(moment[1]) for moment in stencil.moments]
    K11, K12, K22 = ([real(K[c]) for K in stencil.inverse] for c in range(3))
    b1 = [[real(K[0] * x + K[1] * y) for x, y in stencil.moments] for K in stencil.inverse]
    b2 = [[real(K[1] * x + K[2] * y) for x, y in stencil.moments] for K in stencil.inverse]
    weights = [real(w) for w in stencil.weights]
    Vectors = wp.types.matrix(shape=(n, 3), dtype=real)
    in_registers = 6 * n * (bits // 32) <= MAX_REGISTERS
    reach = max(up)
    begins_line = [k == 0 or up[k] != up[k - 1] for k in range(n)]
    point_of = entry_of(vec3, 1)
    Places: Any = wp.array2d(dtype=wp.int32) if gridded else int

    @wp.func
    def turn(v: vec3):
        """Components of a vector in axes rotated by 90 or 180 degrees."""
        if wp.static(half):
            return vec3(-v[0], -v[1], v[2])
        else:
            return vec3(v[1], -v[0], v[2])

    @wp.func
    def turn_moments(first: vec3, second: vec3):
        """Sums of c_k X_k1 v_k and c_k X_k2 v_k with X_k in the rotated axes."""
        if wp.static(half):
            return -first, -second
        else:
            return second, -first

    @wp.func
    def seen(v: vec3, cosine: real, sine: real, scale: real):
        """Components of scale v in rotated axes, from the cosine and sine of the rotation, times scale."""
        return vec3(cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0], scale * v[2])

    @wp.func
    def member_at(displacement: wp.array(dtype=vec3), places: Places, i: int, x: int, y: int, cosine: int, sine: int):
        """Displacement of the member (x, y) steps away in axes rotated by a multiple of 90 degrees."""
        if wp.static(gridded):
            line = places[wp.static(reach) + cosine * y + sine * x, i]
            return point_of(displacement, line + cosine * x - sine * y)
        else:
            # Factors of x and y first: they are the same for all members.
            return point_of(displacement, i + (sine * places + cosine) * x + (cosine * places - sine) * y)

    @kernel(gathers=("displacement",), fast_math=bits == 32)
    def undamaged_family_force(
        family_class: wp.array(dtype=wp.int32),
        inner: int,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        places: Places,
        turns: int,
        constants: Constants,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        force: wp.array(dtype=vec3),
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        # One number of both, so that a compiler does not wait for the class before it reads the bits.
        other = wp.uint32(family_class[i] - inner)
        if wp.static(breakable):
            other = other | (wp.uint32(wp.static(full)) ^ intact[0, i])
        if other != wp.uint32(0):
            if wp.static(breakable):
                others[wp.atomic_add(other_count, 0, 1)] = i
            return
        origin = displacement[i]
        T = Vectors()
        M1 = vec3(real(0.0), real(0.0), real(0.0))
        M2 = vec3(real(0.0), real(0.0), real(0.0))
        R1 = vec3(real(0.0), real(0.0), real(0.0))
        R2 = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(in_registers):
            U = Vectors()
        if wp.static(in_registers or large):
            if wp.static(gridded):
                centre = int(i)
            for k in range(wp.static(n)):
                if wp.static(gridded):
                    if wp.static(begins_line[k]):
                        centre = places[wp.static(up[k] + reach), i]
                    u = displacement[centre + wp.static(right[k])] - origin
                else:
                    u = displacement[i + wp.static(up[k]) * places + wp.static(right[k])] - origin
                if wp.static(in_registers):
                    u = inverse_horizon * u
                    U[k] = u
                if wp.static(large and inside[0][k]):
                    M1 += wp.static(c1[k]) * u
                    M2 += wp.static(c2[k]) * u
        guess = real(0.0)
        cosine = wp.int32(1)
        sine = wp.int32(0)
        for _turn in range(turns):
            for j in range(wp.static(bonds)):
                G1 = vec3(real(0.0), real(0.0), real(0.0))
                G2 = vec3(real(0.0), real(0.0), real(0.0))
                for k in range(wp.static(n)):
                    if wp.static(summed[j][k]):
                        if wp.static(in_registers):
                            u = U[k]
                        else:
                            u = (
                                member_at(displacement, places, i, wp.static(right[k]), wp.static(up[k]), cosine, sine)
                                - origin
                            )
                        G1 += wp.static(b1[j][k]) * u
                        G2 += wp.static(b2[j][k]) * u
                if wp.static(large):
                    G1 = wp.static(K11[j]) * M1 + wp.static(K12[j]) * M2
                    G2 = wp.static(K12[j]) * M1 + wp.static(K22[j]) * M2
                if wp.static(not in_registers):
                    G1 = seen(G1, inverse_horizon * real(cosine), inverse_horizon * real(sine), inverse_horizon)
                    G2 = seen(G2, inverse_horizon * real(cosine), inverse_horizon * real(sine), inverse_horizon)
                S, guess = stress_near(green(G1, G2, vec2()), constants, guess)
                F1 = vec3(real(1.0) + G1[0], G1[1], G1[2])
                F2 = vec3(G2[0], real(1.0) + G2[1], G2[2])
                W = wp.static(weights[j])
                P1 = (W * S[0, 0]) * F1 + (W * S[1, 0]) * F2
                P2 = (W * S[0, 1]) * F1 + (W * S[1, 1]) * F2
                if wp.static(large):
                    R1 += wp.static(K11[j]) * P1 + wp.static(K12[j]) * P2
                    R2 += wp.static(K12[j]) * P1 + wp.static(K22[j]) * P2
                for k in range(wp.static(n)):
                    if wp.static(summed[j][k]):
                        T[k] = (T[k] + wp.static(b1[j][k]) * P1) + wp.static(b2[j][k]) * P2
                    if wp.static(large and (enters[j][k] or leaves[j][k])):
                        if wp.static(in_registers):
                            u = U[k]
                        else:
                            u = (
                                member_at(displacement, places, i, wp.static(right[k]), wp.static(up[k]), cosine, sine)
                                - origin
                            )
                        if wp.static(enters[j][k]):
                            M1 += wp.static(c1[k]) * u
                            M2 += wp.static(c2[k]) * u
                            T[k] = (T[k] - wp.static(c1[k]) * R1) - wp.static(c2[k]) * R2
                        else:
                            M1 -= wp.static(c1[k]) * u
                            M2 -= wp.static(c2[k]) * u
                            T[k] = (T[k] + wp.static(c1[k]) * R1) + wp.static(c2[k]) * R2
            T_seen = Vectors()
            for k in range(wp.static(n)):
                T_seen[k] = turn(T[wp.static(turned[k])])
            T = T_seen
            if wp.static(in_registers):
                U_seen = Vectors()
                for k in range(wp.static(n)):
                    U_seen[k] = turn(U[wp.static(turned[k])])
                U = U_seen
            else:
                before = cosine
                if wp.static(half):
                    cosine = -before
                else:
                    cosine = -sine
                    sine = before
            if wp.static(large):
                if wp.static(in_registers):
                    M1, M2 = turn_moments(turn(M1), turn(M2))
                else:
                    M1, M2 = turn_moments(M1, M2)
                R1, R2 = turn_moments(turn(R1), turn(R2))
        slot = i % bond_force.shape[1]
        pull = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(wp.static(n)):
            t = T[k]
            if wp.static(large and inside[0][k]):
                t = (t + wp.static(c1[k]) * R1) + wp.static(c2[k]) * R2
            t = unit_force * t
            bond_force[wp.static(k), slot] = t
            pull += t
        force[i] = pull

    return undamaged_family_force
