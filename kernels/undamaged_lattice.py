"""Fast path of the variational bond-associated law: undamaged families inside a lattice or grid.

They are identical, so all data of their reference configuration are constants in the code. With
    F_ij = I + sum_k U_ik (x) b_jk,    b_jk = c_k K_ij^-1 X_ik,    t_ik = h sum_j W_ij P_ij b_jk
a member of an intersection costs twelve multiplications and additions. If an intersection contains more than
half of a large family, the sum runs over the members outside it and is subtracted from the sum over all.

A rotation by 90 degrees maps the stencil of a square lattice onto itself. The kernel therefore unrolls the bonds of one
quarter and repeats them four times, each time with displacements and forces in axes rotated by 90 degrees. The family
then stays in registers, and the code in the instruction cache of a GPU. Where the spacings along x and y differ, a
rotation by 180 degrees does the same with the bonds of one half. The material must be isotropic.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .effects import Kernel, kernel
from .factories import FunctionFactory
from .kinematics import kinematics
from .numeric import numeric

# Above this number of members, sums over the members outside an intersection are faster (measured on an H200).
LARGE = 16
# Maximum number of registers, of 255, that displacements and forces of a family may take together.
MAX_REGISTERS = 200


@dataclass(frozen=True)
class Stencil:
    """Undamaged family of a lattice, in units of the horizon and of the area of an inner point.

    Attributes:
        steps: Lattice steps to each member.
        turns: 4 if a rotation by 90 degrees maps the family onto itself, 2 if only one by 180 degrees does.
        turned: Member onto which that rotation maps each member.
        moments: w_ik X_ik of each member.
        part: Members of one quarter or half; rotations give all others.
        inside: Whether each member (second index) belongs to the intersection of each bond of the part.
        inverse: K_ij^-1 (11, 12, 22) of each bond of the part.
        weights: W_ij of each bond of the part.
    """

    steps: tuple[tuple[int, int], ...]
    turns: int
    turned: tuple[int, ...]
    moments: tuple[tuple[float, float], ...]
    part: tuple[int, ...]
    inside: tuple[tuple[bool, ...], ...]
    inverse: tuple[tuple[float, float, float], ...]
    weights: tuple[float, ...]


@functools.cache
def undamaged_lattice_force(
    bits: int, near: FunctionFactory, stencil: Stencil, gridded: bool, breakable: bool, module: str
) -> Kernel:
    """Kernel that fills bond_force [members, ring] and the own half of force [points] of undamaged inner families.

    It puts all other points on the list `others`, in any order.

    Point i has column i % ring of `bond_force`: the ring has a column for each point, or fewer that launches reuse.

    Args:
        bits: 32 or 64.
        near: Factory of stress_near, called with `bits`.
        stencil: Stencil.
        gridded: Whether the grid has gaps. `places` is then the table `centres` (see kernels/families.py); on a lattice
            it is the number of columns.
        breakable: Whether families may be damaged; those count as others.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    stress_near = near(bits)
    green = kinematics(bits).green
    n, bonds = len(stencil.steps), len(stencil.part)
    full = (1 << n) - 1
    right = [step[0] for step in stencil.steps]
    up = [step[1] for step in stencil.steps]
    turned, inside, half = stencil.turned, stencil.inside, stencil.turns == 2
    large = n > LARGE
    most = [large and 2 * sum(members) > n for members in inside]
    c1 = [real(moment[0]) for moment in stencil.moments]
    c2 = [real(moment[1]) for moment in stencil.moments]
    K11, K12, K22 = ([real(K[c]) for K in stencil.inverse] for c in range(3))
    b1 = [[real(K[0] * x + K[1] * y) for x, y in stencil.moments] for K in stencil.inverse]
    b2 = [[real(K[1] * x + K[2] * y) for x, y in stencil.moments] for K in stencil.inverse]
    weights = [real(w) for w in stencil.weights]
    Vectors = wp.types.matrix(shape=(n, 3), dtype=real)
    held = 6 * n * (bits // 32) <= MAX_REGISTERS
    reach = max(up)
    begins_line = [k == 0 or up[k] != up[k - 1] for k in range(n)]
    Places: Any = wp.array2d(dtype=wp.int32) if gridded else int

    @wp.func(module=module)
    def turn(v: vec3):
        """A vector in axes rotated by 90 or 180 degrees."""
        if wp.static(half):
            return vec3(-v[0], -v[1], v[2])
        else:
            return vec3(v[1], -v[0], v[2])

    @wp.func(module=module)
    def turn_moments(first: vec3, second: vec3):
        """Sums of c_k X_k1 v_k and c_k X_k2 v_k in those axes."""
        if wp.static(half):
            return -turn(first), -turn(second)
        else:
            return turn(second), -turn(first)

    @wp.func(module=module)
    def seen(v: vec3, cosine: int, sine: int):
        """A vector in axes rotated by a multiple of 90 degrees."""
        c = real(cosine)
        s = real(sine)
        return vec3(c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])

    @kernel(module, gathers=("displacement",))
    def undamaged_family_force(
        family_class: wp.array(dtype=wp.int32),
        inner: int,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        places: Places,
        turns: int,
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
        bond_force: wp.array2d(dtype=vec3),
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        undamaged = family_class[i] == inner
        if wp.static(breakable):
            if intact[0, i] != wp.uint32(wp.static(full)):
                undamaged = False
        if not undamaged:
            others[wp.atomic_add(other_count, 0, 1)] = i
            return
        origin = displacement[i]
        T = Vectors()
        U1 = vec3(real(0.0), real(0.0), real(0.0))
        U2 = vec3(real(0.0), real(0.0), real(0.0))
        T1 = vec3(real(0.0), real(0.0), real(0.0))
        T2 = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(held):
            U = Vectors()
        if wp.static(held or large):
            if wp.static(gridded):
                centre = int(i)
            for k in range(wp.static(n)):
                if wp.static(gridded):
                    if wp.static(begins_line[k]):
                        centre = places[wp.static(up[k] + reach), i]
                    u = inverse_horizon * (displacement[centre + wp.static(right[k])] - origin)
                else:
                    u = inverse_horizon * (displacement[i + wp.static(up[k]) * places + wp.static(right[k])] - origin)
                if wp.static(held):
                    U[k] = u
                if wp.static(large):
                    U1 += wp.static(c1[k]) * u
                    U2 += wp.static(c2[k]) * u
        guess = real(0.0)
        cosine = wp.int32(1)
        sine = wp.int32(0)
        for _turn in range(turns):
            for j in range(wp.static(bonds)):
                G1 = vec3(real(0.0), real(0.0), real(0.0))
                G2 = vec3(real(0.0), real(0.0), real(0.0))
                for k in range(wp.static(n)):
                    if wp.static(inside[j][k] != most[j]):
                        if wp.static(held):
                            u = U[k]
                        elif wp.static(gridded):
                            line = wp.static(reach) + cosine * wp.static(up[k]) + sine * wp.static(right[k])
                            across = cosine * wp.static(right[k]) - sine * wp.static(up[k])
                            u = inverse_horizon * (displacement[places[line, i] + across] - origin)
                        else:
                            ahead = wp.static(up[k]) * places + wp.static(right[k])
                            aside = wp.static(right[k]) * places - wp.static(up[k])
                            u = inverse_horizon * (displacement[i + cosine * ahead + sine * aside] - origin)
                        if wp.static(most[j]):
                            G1 -= wp.static(c1[k]) * u
                            G2 -= wp.static(c2[k]) * u
                        else:
                            G1 += wp.static(b1[j][k]) * u
                            G2 += wp.static(b2[j][k]) * u
                if wp.static(not held):
                    G1 = seen(G1, cosine, sine)
                    G2 = seen(G2, cosine, sine)
                H1 = G1
                H2 = G2
                if wp.static(most[j]):
                    G1 += U1
                    G2 += U2
                    H1 = wp.static(K11[j]) * G1 + wp.static(K12[j]) * G2
                    H2 = wp.static(K12[j]) * G1 + wp.static(K22[j]) * G2
                S, guess = stress_near(green(H1, H2), constants, guess)
                F1 = H1 + vec3(real(1.0), real(0.0), real(0.0))
                F2 = H2 + vec3(real(0.0), real(1.0), real(0.0))
                W = wp.static(weights[j])
                P1 = (W * S[0, 0]) * F1 + (W * S[1, 0]) * F2
                P2 = (W * S[0, 1]) * F1 + (W * S[1, 1]) * F2
                if wp.static(most[j]):
                    A1 = wp.static(K11[j]) * P1 + wp.static(K12[j]) * P2
                    A2 = wp.static(K12[j]) * P1 + wp.static(K22[j]) * P2
                    T1 += A1
                    T2 += A2
                    for k in range(wp.static(n)):
                        if wp.static(not inside[j][k]):
                            T[k] = T[k] - (wp.static(c1[k]) * A1 + wp.static(c2[k]) * A2)
                else:
                    for k in range(wp.static(n)):
                        if wp.static(inside[j][k]):
                            T[k] = T[k] + (wp.static(b1[j][k]) * P1 + wp.static(b2[j][k]) * P2)
            T_seen = Vectors()
            for k in range(wp.static(n)):
                T_seen[k] = turn(T[wp.static(turned[k])])
            T = T_seen
            if wp.static(held):
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
                U1, U2 = turn_moments(U1, U2)
                T1, T2 = turn_moments(T1, T2)
        slot = i % bond_force.shape[1]
        pull = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(wp.static(n)):
            t = T[k]
            if wp.static(large):
                t += wp.static(c1[k]) * T1 + wp.static(c2[k]) * T2
            t = unit_force * t
            bond_force[wp.static(k), slot] = t
            pull += t
        force[i] = pull

    return undamaged_family_force
