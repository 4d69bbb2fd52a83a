"""Tangent of the variational bond-associated law: how its force changes with the displacement.

`linearise` keeps of every intersection what the derivative needs: F_ij, and with its weight the stress S_ij
and the moduli T_ij (kernels/materials.py). For a direction v, with dF_ij from v as F_ij comes from u,

    dC = dF^T F + F^T dF,   (dS11, dS22, 2 dS12) = T (dC11, dC22, dC12),   dP = dF S + F dS,

and dP takes the way of P: the family of i pulls its member k with c_k [sum W_ij h dP_ij K_ij^-1] X_ik. The
result is the change of the internal force, minus the Hessian of the energy times v: symmetric.

An isotropic tension may be added to every S_ij. It alone is the tangent of a stretched soap film, a Laplacian,
which gives a flat or slack sheet the out-of-plane stiffness that it lacks.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .bond_associated import bond_associated
from .families import WORD, family_functions
from .kinematics import DEGENERATE
from .numeric import numeric


@dataclass(frozen=True)
class TangentKernels:
    """Kernels of one configuration.

    Attributes:
        linearise: Fills gradient, stress, moduli [members, points] at a displacement.
        product: Fills bond_force [members, points] with its change along a direction; `gather` sums it.
        inverse_blocks: Inverse of the 3x3 diagonal block of the stiffness of each point, its held
            components left out.
        assemble: Fills matrix [offsets, points] of an intact lattice: the 3x3 blocks of the stiffness by the
            lattice step from a point to the other one; the first offset is the point itself.
        matrix_product: The change of the force along a direction from that matrix.
        inverse_diagonal: inverse_blocks from that matrix.
    """

    linearise: Any
    product: Any
    inverse_blocks: Any
    assemble: Any
    matrix_product: Any
    inverse_diagonal: Any


@functools.cache
def bond_associated_tangent(layout, bits, material, response, breakable, held, module):
    """Kernels of the tangent; arguments as `bond_associated`, with the factory of stress and moduli.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        material: Factory of (stress, energy).
        response: Factory of the function that gives stress and moduli.
        breakable: None, "redistribute" or "drop".
        held: Whether any component is held.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, mat33, parameters = types.mat32, types.mat33, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    law = bond_associated(layout, bits, material, breakable, "variational", module).mechanics
    present, is_whole, has, intersection = law.present, law.is_whole, law.has, law.intersection
    green, area_weight, family_scale = law.green, law.area_weight, law.family_scale
    response_of = response(bits)
    word_size = WORD
    least_stiffness = 1e-6

    @wp.kernel(module=module, enable_backward=False)
    def linearise(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        tension: wp.array(dtype=real),
        first: int,
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
    ):
        i = wp.tid() + first
        whole = is_whole(family, alive, i)
        total = real(0.0)
        for j in range(family.members):
            stress[j, i] = vec3(real(0.0), real(0.0), real(0.0))
            moduli[j, i] = vec6()
            if has(family, alive, i, j):
                G1, G2, inverse, size = intersection(family, alive, displacement, displacement, real(0.0), i, j, whole)
                if inverse[0] > real(0.0):
                    H1 = inverse_horizon * G1
                    H2 = inverse_horizon * G2
                    G = green(H1, H2)
                    weight = area_weight(family, i, j, whole, size)
                    total += weight
                    S, T = response_of(G, constants)
                    gradient[j, i] = mat32(H1[0] + real(1.0), H2[0], H1[1], H2[1] + real(1.0), H1[2], H2[2])
                    stress[j, i] = weight * vec3(S[0, 0] + tension[0], S[0, 1], S[1, 1] + tension[0])
                    moduli[j, i] = weight * T
        scale = family_scale(family, i, whole, total)
        for j in range(family.members):
            stress[j, i] = scale * stress[j, i]
            moduli[j, i] = scale * moduli[j, i]

    @wp.kernel(module=module, enable_backward=False)
    def product(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        direction: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        whole = is_whole(family, alive, i)
        for j in range(family.members):
            if has(family, alive, i, j):
                G1, G2, inverse, _size = intersection(family, alive, direction, direction, real(0.0), i, j, whole)
                if inverse[0] > real(0.0):
                    D1 = inverse_horizon * G1
                    D2 = inverse_horizon * G2
                    F = gradient[j, i]
                    F1 = vec3(F[0, 0], F[1, 0], F[2, 0])
                    F2 = vec3(F[0, 1], F[1, 1], F[2, 1])
                    S = stress[j, i]
                    T = moduli[j, i]
                    c11 = real(2.0) * wp.dot(F1, D1)
                    c22 = real(2.0) * wp.dot(F2, D2)
                    c12 = wp.dot(F1, D2) + wp.dot(F2, D1)
                    s11 = T[0] * c11 + T[1] * c22 + T[2] * c12
                    s22 = T[1] * c11 + T[3] * c22 + T[4] * c12
                    s12 = real(0.5) * (T[2] * c11 + T[4] * c22 + T[5] * c12)
                    P1 = S[0] * D1 + S[1] * D2 + s11 * F1 + s12 * F2
                    P2 = S[1] * D1 + S[2] * D2 + s12 * F1 + s22 * F2
                    A1 = P1 * inverse[0] + P2 * inverse[1]
                    A2 = P1 * inverse[1] + P2 * inverse[2]
                    for word in range(family.words):
                        members = f.common(family, i, j, word) & present(family, alive, i, word)
                        k = word * word_size
                        while members != wp.uint32(0):
                            if (members & wp.uint32(1)) != wp.uint32(0):
                                xi = f.bond(family, i, k)
                                bond_force[k, i] = bond_force[k, i] + xi[0] * A1 + xi[1] * A2
                            members = members >> wp.uint32(1)
                            k += 1
        for k in range(family.members):
            if has(family, alive, i, k):
                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                bond_force[k, i] = unit_force * c * bond_force[k, i]

    @wp.func(module=module)
    def shape_of(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        i: int,
        j: int,
        whole: bool,
    ):
        """K_ij^-1, zero where the bond is broken or the intersection degenerate."""
        result = vec3(real(0.0), real(0.0), real(0.0))
        if has(family, alive, i, j):
            if whole:
                result = f.shape(family, i, j)
            else:
                _G1, _G2, inverse, _size = intersection(
                    family, alive, displacement, displacement, real(0.0), i, j, whole
                )
                result = inverse
        return result

    @wp.func(module=module)
    def block_of(F: mat32, S: vec3, T: vec6, g: vec2):
        """Stiffness of an intersection when one point moves, whose share in dF is v (x) g."""
        F1 = vec3(F[0, 0], F[1, 0], F[2, 0])
        F2 = vec3(F[0, 1], F[1, 1], F[2, 1])
        b1 = real(2.0) * g[0] * F1
        b2 = real(2.0) * g[1] * F2
        b3 = g[1] * F1 + g[0] * F2
        t1 = T[0] * b1 + T[1] * b2 + T[2] * b3
        t2 = T[1] * b1 + T[3] * b2 + T[4] * b3
        t3 = T[2] * b1 + T[4] * b2 + T[5] * b3
        tension = S[0] * g[0] * g[0] + real(2.0) * S[1] * g[0] * g[1] + S[2] * g[1] * g[1]
        return (
            tension * wp.identity(n=3, dtype=real)
            + real(0.5) * (wp.outer(b1, t1) + wp.outer(b2, t2) + wp.outer(b3, t3))
        )  # fmt: skip

    @wp.func(module=module)
    def inverse_of(block: mat33, mask: wp.uint8):
        """Inverse of |block| on the free components, with eigenvalues held away from zero."""
        reduced = block
        for c in range(3):
            if (wp.int32(mask) & (1 << c)) != 0:
                for d in range(3):
                    reduced[c, d] = real(0.0)
                    reduced[d, c] = real(0.0)
        Q, values = wp.eig3(reduced)
        largest = wp.max(wp.max(wp.abs(values[0]), wp.abs(values[1])), wp.abs(values[2]))
        scaled = Q
        for c in range(3):
            value = wp.max(wp.abs(values[c]), real(least_stiffness) * largest)
            for d in range(3):
                if value > real(0.0):
                    scaled[d, c] = Q[d, c] / value
                else:
                    scaled[d, c] = real(0.0)
        result = scaled * wp.transpose(Q)
        for c in range(3):
            if (wp.int32(mask) & (1 << c)) != 0:
                for d in range(3):
                    result[c, d] = real(0.0)
                    result[d, c] = real(0.0)
        return result

    @wp.kernel(module=module, enable_backward=False)
    def inverse_blocks(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        held_mask: wp.array(dtype=wp.uint8),
        unit_stiffness: real,
        first: int,
        out: wp.array(dtype=mat33),
    ):
        i = wp.tid() + first
        block = mat33()
        whole = is_whole(family, alive, i)
        for j in range(family.members):
            inverse = shape_of(family, alive, displacement, i, j, whole)
            if inverse[0] > real(0.0):
                sum_of = vec2(real(0.0), real(0.0))
                for word in range(family.words):
                    members = f.common(family, i, j, word) & present(family, alive, i, word)
                    k = word * word_size
                    while members != wp.uint32(0):
                        if (members & wp.uint32(1)) != wp.uint32(0):
                            c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                            sum_of += c * f.bond(family, i, k)
                        members = members >> wp.uint32(1)
                        k += 1
                g = vec2(
                    inverse[0] * sum_of[0] + inverse[1] * sum_of[1], inverse[1] * sum_of[0] + inverse[2] * sum_of[1]
                )
                block += block_of(gradient[j, i], stress[j, i], moduli[j, i], g)
        for k in range(family.members):
            if has(family, alive, i, k):
                m = f.neighbour(family, i, k)
                back = f.mate(family, i, k)
                c = f.influence(family, m, back) * f.area(family, i)
                xi = f.bond(family, m, back)
                word = back // word_size
                bit = wp.uint32(1) << wp.uint32(back - word * word_size)
                whole_there = is_whole(family, alive, m)
                for j in range(family.members):
                    if (f.common(family, m, j, word) & bit) != wp.uint32(0):
                        inverse = shape_of(family, alive, displacement, m, j, whole_there)
                        if inverse[0] > real(0.0):
                            g = c * vec2(
                                inverse[0] * xi[0] + inverse[1] * xi[1], inverse[1] * xi[0] + inverse[2] * xi[1]
                            )
                            block += block_of(gradient[j, m], stress[j, m], moduli[j, m], g)
        mask = wp.uint8(0)
        if wp.static(held):
            mask = held_mask[i]
        out[i] = inverse_of(unit_stiffness * block, mask)

    @wp.kernel(module=module, enable_backward=False)
    def assemble(
        family: Family,
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        pair_offset: wp.array2d(dtype=wp.int32),
        unit_stiffness: real,
        first: int,
        matrix: wp.array2d(dtype=mat33),
    ):
        i = wp.tid() + first
        for o in range(matrix.shape[0]):
            matrix[o, i] = mat33()
        # Families that hold i: its own, where it is the centre (member index `members`), and its neighbours'.
        for s in range(family.members + 1):
            q = i
            mine = family.members
            belongs = bool(True)
            word = 0
            bit = wp.uint32(0)
            if s < family.members:
                word = s // word_size
                belongs = ((f.whole(family, i, word) >> wp.uint32(s - word * word_size)) & wp.uint32(1)) != wp.uint32(0)
                if belongs:
                    q = f.neighbour(family, i, s)
                    mine = f.mate(family, i, s)
                    word = mine // word_size
                    bit = wp.uint32(1) << wp.uint32(mine - word * word_size)
            if belongs:
                for j in range(family.members):
                    inverse = f.shape(family, q, j)
                    if inverse[0] > real(0.0) and (
                        mine == family.members or (f.common(family, q, j, word) & bit) != wp.uint32(0)
                    ):
                        # First the sum over the members, whose negative is the coefficient of the centre.
                        centre = vec2(real(0.0), real(0.0))
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.whole(family, q, w)
                            k = w * word_size
                            while members != wp.uint32(0):
                                if (members & wp.uint32(1)) != wp.uint32(0):
                                    c = f.influence(family, q, k) * f.area(family, f.neighbour(family, q, k))
                                    centre -= c * f.bond(family, q, k)
                                members = members >> wp.uint32(1)
                                k += 1
                        raw = centre
                        if mine < family.members:
                            raw = (f.influence(family, q, mine) * f.area(family, i)) * f.bond(family, q, mine)
                        g = vec2(inverse[0] * raw[0] + inverse[1] * raw[1], inverse[1] * raw[0] + inverse[2] * raw[1])
                        F = gradient[j, q]
                        S = stress[j, q]
                        T = moduli[j, q]
                        F1 = vec3(F[0, 0], F[1, 0], F[2, 0])
                        F2 = vec3(F[0, 1], F[1, 1], F[2, 1])
                        b1 = real(2.0) * g[0] * F1
                        b2 = real(2.0) * g[1] * F2
                        b3 = g[1] * F1 + g[0] * F2
                        half = real(0.5) * unit_stiffness
                        t1 = half * (T[0] * b1 + T[1] * b2 + T[2] * b3)
                        t2 = half * (T[1] * b1 + T[3] * b2 + T[4] * b3)
                        t3 = half * (T[2] * b1 + T[4] * b2 + T[5] * b3)
                        one = wp.identity(n=3, dtype=real)
                        R1 = (
                            (unit_stiffness * (S[0] * g[0] + S[1] * g[1])) * one
                            + real(2.0) * wp.outer(t1, F1)
                            + wp.outer(t3, F2)
                        )
                        R2 = (
                            (unit_stiffness * (S[1] * g[0] + S[2] * g[1])) * one
                            + real(2.0) * wp.outer(t2, F2)
                            + wp.outer(t3, F1)
                        )
                        # Fold K^-1 in, so that the loop over members takes c xi as it is.
                        Q1 = inverse[0] * R1 + inverse[1] * R2
                        Q2 = inverse[1] * R1 + inverse[2] * R2
                        o = pair_offset[mine, family.members]
                        matrix[o, i] = matrix[o, i] + centre[0] * Q1 + centre[1] * Q2
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.whole(family, q, w)
                            k = w * word_size
                            while members != wp.uint32(0):
                                if (members & wp.uint32(1)) != wp.uint32(0):
                                    c = f.influence(family, q, k) * f.area(family, f.neighbour(family, q, k))
                                    cxi = c * f.bond(family, q, k)
                                    o = pair_offset[mine, k]
                                    matrix[o, i] = matrix[o, i] + cxi[0] * Q1 + cxi[1] * Q2
                                members = members >> wp.uint32(1)
                                k += 1

    @wp.kernel(module=module, enable_backward=False)
    def matrix_product(
        matrix: wp.array2d(dtype=mat33),
        shift: wp.array(dtype=wp.int32),
        direction: wp.array(dtype=vec3),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        total = vec3(real(0.0), real(0.0), real(0.0))
        last = direction.shape[0] - 1
        for o in range(matrix.shape[0]):
            # Steps that leave the sheet have a zero block.
            m = wp.clamp(i + shift[o], 0, last)
            total -= matrix[o, i] * direction[m]
        change[i] = total

    @wp.kernel(module=module, enable_backward=False)
    def inverse_diagonal(
        matrix: wp.array2d(dtype=mat33), held_mask: wp.array(dtype=wp.uint8), first: int, out: wp.array(dtype=mat33)
    ):
        i = wp.tid() + first
        mask = wp.uint8(0)
        if wp.static(held):
            mask = held_mask[i]
        out[i] = inverse_of(matrix[0, i], mask)

    return TangentKernels(linearise, product, inverse_blocks, assemble, matrix_product, inverse_diagonal)


@functools.cache
def follower_pressure_tangent(layout, bits, breakable, module):
    """Kernel that adds the change of follower pressure along a direction, p a_i (dF e1 x F e2 + F e1 x dF e2).

    Not symmetric: a pressure has a potential only where the edge of the sheet is held, and its normals here are
    averages over families.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD
    degenerate = DEGENERATE

    @wp.kernel(module=module, enable_backward=False)
    def add_follower_tangent(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        inverse_horizon: real,
        unit_area: real,
        pressure: wp.array(dtype=real),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        zero = vec3(real(0.0), real(0.0), real(0.0))
        G1 = zero
        G2 = zero
        D1 = zero
        D2 = zero
        shape = zero
        for word in range(family.words):
            members = f.whole(family, i, word)
            if wp.static(breakable):
                members = alive[word, i]
            k = word * word_size
            while members != wp.uint32(0):
                if (members & wp.uint32(1)) != wp.uint32(0):
                    m = f.neighbour(family, i, k)
                    xi = f.bond(family, i, k)
                    cxi = f.influence(family, i, k) * f.area(family, m) * xi
                    stretch = displacement[m] - displacement[i]
                    turn = direction[m] - direction[i]
                    G1 += cxi[0] * stretch
                    G2 += cxi[1] * stretch
                    D1 += cxi[0] * turn
                    D2 += cxi[1] * turn
                    shape += vec3(cxi[0] * xi[0], cxi[0] * xi[1], cxi[1] * xi[1])
                members = members >> wp.uint32(1)
                k += 1
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        half_trace = real(0.5) * (shape[0] + shape[2])
        if determinant > real(degenerate) * half_trace * half_trace:
            scale = inverse_horizon / determinant
            F1 = scale * (shape[2] * G1 - shape[1] * G2) + vec3(real(1.0), real(0.0), real(0.0))
            F2 = scale * (shape[0] * G2 - shape[1] * G1) + vec3(real(0.0), real(1.0), real(0.0))
            dF1 = scale * (shape[2] * D1 - shape[1] * D2)
            dF2 = scale * (shape[0] * D2 - shape[1] * D1)
            p = pressure[0] * unit_area * f.area(family, i)
            change[i] = change[i] + p * (wp.cross(dF1, F2) + wp.cross(F1, dF2))

    return add_follower_tangent
