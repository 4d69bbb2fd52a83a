"""Tangent of the variational bond-associated law: the derivative of the force by the displacement.

For every intersection, `linearise` stores F_ij and, multiplied by the weight, the stress S_ij and the moduli T_ij
(kernels/materials.py). For a direction v, with dF_ij computed from v as F_ij is from u,

    dC = dF^T F + F^T dF,   (dS11, dS22, 2 dS12) = T (dC11, dC22, dC12),   dP = dF S + F dS,

and dP replaces P: the family of i pulls its member k with c_k [sum W_ij h dP_ij K_ij^-1] X_ik. The result is the change
of the internal force, minus the (symmetric) Hessian of the energy times v. An isotropic tension may be added to every
S_ij. Its tangent is that of a stretched soap film, a Laplacian. It gives a flat or slack sheet the out-of-plane
stiffness that it lacks. In a softened layout the stored values of a family are already reduced by the damage of its
point, see kernels/tearing/damage_field.py.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..bond_associated import family_mechanics
from ..damage import stiffness_left
from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..kinematics import kinematics
from ..numeric import FunctionFactory, constants_of, numeric

# Steps longer than this are not of interest.
FAR = 1e3
# Lower bound on the eigenvalues of a diagonal block, divided by its largest one.
MIN_STIFFNESS = 1e-6


@dataclass(frozen=True)
class TangentKernels:
    """Kernels of one configuration.

    Attributes:
        linearise: Fills gradient, stress, moduli [members, points] at a displacement.
        predict: Replaces stress by what `Prediction` of warp_pd/statics/tangent.py says.
        product: Fills bond_force [members, points] with its derivative along a direction; `gather` sums it.
        turning: Fills `longest` with the step along a direction at which the first intersection of a family turns
            inside out: its area is zero there, or its normal at a right angle to what it was; at most FAR.
        inverse_blocks: Inverse of the 3x3 diagonal block of the stiffness of each point, without its held
            components.
        assemble: Fills the 3x3 blocks of the stiffness, row by row, each row in ascending order of `columns`, from the
            diagonal on; `mirror` of kernels/statics/tangent_matrix.py fills the others.
    """

    linearise: Kernel
    predict: Kernel
    product: Kernel
    turning: Kernel
    inverse_blocks: Kernel
    assemble: Kernel


@functools.cache
def columns_of_gradient(bits: int) -> wp.Function:
    """Function F -> its two columns."""
    types = numeric(bits)
    vec3, mat32 = types.vec3, types.mat32

    @wp.func
    def columns_of(F: mat32):
        return vec3(F[0, 0], F[1, 0], F[2, 0]), vec3(F[0, 1], F[1, 1], F[2, 1])

    return columns_of


@functools.cache
def block_functions(bits: int) -> tuple[wp.Function, wp.Function]:
    """Warp functions `block_of`, the stiffness of an intersection, and `inverse_of`, of a 3x3 block."""
    types = numeric(bits)
    real, vec2, vec3, vec6, mat32, mat33 = types.real, types.vec2, types.vec3, types.vec6, types.mat32, types.mat33
    min_stiffness, columns_of = MIN_STIFFNESS, columns_of_gradient(bits)

    @wp.func
    def block_of(F: mat32, S: vec3, T: vec6, g: vec2):
        """Stiffness of an intersection when one point moves and contributes v (x) g to dF."""
        F1, F2 = columns_of(F)
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

    @wp.func
    def inverse_of(block: mat33, mask: wp.uint8):
        """Inverse of |block| on the free components, with eigenvalues kept away from zero."""
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
            value = wp.max(wp.abs(values[c]), real(min_stiffness) * largest)
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

    return block_of, inverse_of


@functools.cache
def bond_associated_tangent(
    layout: Layout, response: FunctionFactory, held: bool, remembers: bool = False
) -> TangentKernels:
    """Kernels of the tangent.

    Args:
        layout: Layout of the families.
        response: Factory of stress and moduli of the material.
        held: Whether any component is held.
        remembers: Whether `response` also takes (i, j, members, terms, state), the internal variables of a step.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, mat33 = types.mat32, types.mat33
    f = family_functions(layout)
    Family = f.struct
    law = family_mechanics(layout, "variational")
    visit = law.visit
    motion, curved = kinematics(bits, layout.curved), layout.curved
    level, times, columns = motion.level, motion.times, motion.columns
    response_of = response(bits)
    Constants = constants_of(response_of)
    word_size = WORD
    block_of, inverse_of = block_functions(bits)
    columns_of = columns_of_gradient(bits)
    far = wp.constant(real(FAR))
    left = stiffness_left(bits)

    @wp.func
    def first_zero(constant: real, linear: real, square: real):
        """Smallest s > 0 at which constant + linear s + square s^2 is zero, at most FAR; constant >= 0."""
        s = far
        discriminant = linear * linear - real(4.0) * square * constant
        if discriminant >= real(0.0):
            # The root without cancellation; a square of zero leaves one root.
            q = wp.sqrt(discriminant) - linear
            if q > real(0.0):
                s = wp.min(s, real(2.0) * constant / q)
        return s

    @wp.func
    def responded(
        family: Family,
        i: int,
        j: int,
        G: types.mat22,
        constants: Constants,
        terms: wp.array(dtype=types.parameters),
        state: wp.array2d(dtype=types.parameters),
    ):
        """Stress and moduli of intersection j of family i at a strain."""
        here = f.of_bond(family, i, j, constants)
        if wp.static(remembers):
            return response_of(G, here, i, j, family.members, terms, state)
        else:
            return response_of(G, here)

    @kernel(gathers=("displacement",))
    def linearise(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        tension: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        terms: wp.array(dtype=types.parameters),
        state: wp.array2d(dtype=types.parameters),
        first: int,
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            stress[j, i] = vec3(real(0.0), real(0.0), real(0.0))
            moduli[j, i] = vec6()
            there, H1, H2, _inverse, weight, tilt = visit(family, displacement, i, j, undamaged)
            if there:
                S, T = responded(family, i, j, motion.green(H1, H2, tilt), constants, terms, state)
                A1, A2 = motion.gradient(H1, H2, tilt)
                F1, F2 = f.from_frame(family, i, A1), f.from_frame(family, i, A2)
                gradient[j, i] = mat32(F1[0], F2[0], F1[1], F2[1], F1[2], F2[2])
                stress[j, i] = weight * vec3(S[0, 0] + tension[0], S[0, 1], S[1, 1] + tension[0])
                moduli[j, i] = weight * T
        if wp.static(layout.softened):
            scale = left(damage[i])
            for j in range(family.members):
                stress[j, i] = scale * stress[j, i]
                moduli[j, i] = scale * moduli[j, i]

    @wp.func
    def tensile_part(S: vec3):
        """S (11, 12, 22) without its negative principal stresses."""
        mean, half_difference = real(0.5) * (S[0] + S[2]), real(0.5) * (S[0] - S[2])
        radius = wp.sqrt(half_difference * half_difference + S[1] * S[1])
        result = S
        if mean + radius <= real(0.0):
            result = vec3(real(0.0), real(0.0), real(0.0))
        elif mean < radius:
            factor, less = real(0.5) * (mean + radius) / radius, radius - mean
            result = factor * vec3(S[0] + less, S[1], S[2] + less)
        return result

    @kernel(gathers=("base", "change"))
    def predict(
        family: Family,
        base: wp.array(dtype=vec3),
        change: wp.array(dtype=vec3),
        tensile: wp.array(dtype=real),
        constants: Constants,
        tension: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        terms: wp.array(dtype=types.parameters),
        state: wp.array2d(dtype=types.parameters),
        first: int,
        stress: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = visit(family, base, i, j, undamaged)
            if there:
                S, T = responded(family, i, j, motion.green(H1, H2, tilt), constants, terms, state)
                F1, F2 = motion.gradient(H1, H2, tilt)
                _there, D1, D2, _inverse, _weight, _tilt = visit(family, change, i, j, undamaged)
                c11 = real(2.0) * wp.dot(F1, D1)
                c22 = real(2.0) * wp.dot(F2, D2)
                c12 = wp.dot(F1, D2) + wp.dot(F2, D1)
                s11 = S[0, 0] + T[0] * c11 + T[1] * c22 + T[2] * c12
                s22 = S[1, 1] + T[1] * c11 + T[3] * c22 + T[4] * c12
                s12 = S[0, 1] + real(0.5) * (T[2] * c11 + T[4] * c22 + T[5] * c12)
                predicted = vec3(s11, s12, s22)
                if tensile[0] > real(0.0):
                    predicted = tensile_part(predicted)
                stress[j, i] = weight * (predicted + vec3(tension[0], real(0.0), tension[0]))
        if wp.static(layout.softened):
            scale = left(damage[i])
            for j in range(family.members):
                stress[j, i] = scale * stress[j, i]

    @kernel(gathers=("direction",))
    def product(
        family: Family,
        direction: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            there, H1, H2, inverse, _weight, tilt = visit(family, direction, i, j, undamaged)
            if there:
                D1, D2 = f.from_frame(family, i, H1), f.from_frame(family, i, H2)
                F1, F2 = columns_of(gradient[j, i])
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
                R1, R2 = level(P1, P2, tilt)
                A1, A2 = columns(R1, R2, inverse)
                law.add_to_members(family, i, j, A1, A2, bond_force)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                bond_force[k, i] = unit_force * c * bond_force[k, i]

    @kernel(gathers=("direction",))
    def turning(
        family: Family,
        direction: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        first: int,
        longest: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        shortest = far
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            there, H1, H2, _inverse, _weight, _tilt = visit(family, direction, i, j, undamaged)
            if there:
                D1, D2 = f.from_frame(family, i, H1), f.from_frame(family, i, H2)
                F1, F2 = columns_of(gradient[j, i])
                # The normal of the deformed sheet is (F1 + s D1) x (F2 + s D2); its component along that of s = 0 is
                # area + linear s + square s^2.
                normal = wp.cross(F1, F2)
                area = wp.dot(normal, normal)
                linear = wp.dot(normal, wp.cross(D1, F2) + wp.cross(F1, D2))
                square = wp.dot(normal, wp.cross(D1, D2))
                shortest = wp.min(shortest, first_zero(area, linear, square))
        longest[i] = shortest

    @wp.func
    def shape_of(
        family: Family,
        displacement: wp.array(dtype=vec3),
        i: int,
        j: int,
        undamaged: bool,
    ):
        """K_ij^-1, zero where the bond is broken or the intersection degenerate; tilt."""
        result = vec3(real(0.0), real(0.0), real(0.0))
        tilt = vec2(real(0.0), real(0.0))
        if f.is_intact(family, i, j):
            if undamaged:
                result = f.shape(family, i, j)
                tilt = f.tilt(family, i, j)
            else:
                _there, _H1, _H2, inverse, _weight, tilt_left = visit(family, displacement, i, j, undamaged)
                result = inverse
                tilt = tilt_left
        return result, tilt

    @wp.func
    def levelled(g: vec2, tilt: vec2):
        """R^-1 g."""
        if wp.static(curved):
            return g - wp.dot(tilt, g) * tilt
        else:
            return g

    @kernel(gathers=("displacement", "family.intact", "gradient", "stress", "moduli"))
    def inverse_blocks(
        family: Family,
        displacement: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        held_mask: wp.array(dtype=wp.uint8),
        inertia: wp.array(dtype=real),
        unit_stiffness: real,
        first: int,
        out: wp.array(dtype=mat33),
    ):
        i = wp.tid() + first
        block = mat33()
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            inverse, tilt = shape_of(family, displacement, i, j, undamaged)
            if inverse[0] > real(0.0):
                sum_of = vec2(real(0.0), real(0.0))
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                        sum_of += c * f.bond(family, i, k)
                g = levelled(times(inverse, sum_of), tilt)
                block += block_of(gradient[j, i], stress[j, i], moduli[j, i], g)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                back = f.reverse(family, i, k)
                c = f.influence(family, m, back) * f.area(family, i)
                xi = f.bond(family, m, back)
                word = back // word_size
                bit = wp.uint32(1) << wp.uint32(back - word * word_size)
                undamaged_there = f.is_undamaged(family, m)
                for j in range(family.members):
                    if (f.common(family, m, j, word) & bit) != wp.uint32(0):
                        inverse, tilt = shape_of(family, displacement, m, j, undamaged_there)
                        if inverse[0] > real(0.0):
                            g = levelled(c * times(inverse, xi), tilt)
                            block += block_of(gradient[j, m], stress[j, m], moduli[j, m], g)
        mask = wp.uint8(0)
        if wp.static(held):
            mask = held_mask[i]
        block = unit_stiffness * block
        if inertia:
            block += inertia[i] * wp.identity(n=3, dtype=real)
        out[i] = inverse_of(block, mask)

    @wp.func
    def entry_of(columns: wp.array(dtype=wp.int32), begin: int, end: int, m: int):
        """Entry of the column m among those of a row, which has it."""
        low = int(begin)
        high = int(end - 1)
        while low < high:
            middle = (low + high) // 2
            if columns[middle] < m:
                low = middle + 1
            else:
                high = middle
        return low

    @kernel(gathers=("displacement", "family.intact", "gradient", "stress", "moduli"))
    def assemble(
        family: Family,
        displacement: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        starts: wp.array(dtype=wp.int32),
        columns: wp.array(dtype=wp.int32),
        unit_stiffness: real,
        first: int,
        matrix: wp.array(dtype=mat33),
    ):
        i = wp.tid() + first
        begin = starts[i]
        end = starts[i + 1]
        for entry in range(begin, end):
            matrix[entry] = mat33()
        # Families that contain i: its own, where it is the centre (member index `members`), and its neighbours'.
        for s in range(family.members + 1):
            q = i
            mine = family.members
            belongs = bool(True)
            word = 0
            bit = wp.uint32(0)
            if s < family.members:
                belongs = f.is_intact(family, i, s)
                if belongs:
                    q = f.neighbour(family, i, s)
                    mine = f.reverse(family, i, s)
                    word = mine // word_size
                    bit = wp.uint32(1) << wp.uint32(mine - word * word_size)
            if belongs:
                undamaged = f.is_undamaged(family, q)
                own = entry_of(columns, begin, end, q)
                for j in range(family.members):
                    inverse = vec3(real(0.0), real(0.0), real(0.0))
                    tilt = vec2(real(0.0), real(0.0))
                    if mine == family.members or (f.common(family, q, j, word) & bit) != wp.uint32(0):
                        inverse, tilt = shape_of(family, displacement, q, j, undamaged)
                    if inverse[0] > real(0.0):
                        # First the sum over the members; its negative is the coefficient of the centre.
                        centre = vec2(real(0.0), real(0.0))
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.intact_members(family, q, w)
                            while members != wp.uint32(0):
                                k = w * word_size + lowest_bit(members)
                                members = without_lowest_bit(members)
                                c = f.influence(family, q, k) * f.area(family, f.neighbour(family, q, k))
                                centre -= c * f.bond(family, q, k)
                        raw = centre
                        if mine < family.members:
                            raw = (f.influence(family, q, mine) * f.area(family, i)) * f.bond(family, q, mine)
                        # Columns of R^-1 K^-1, so that the loop over members only needs c xi.
                        p = levelled(vec2(inverse[0], inverse[1]), tilt)
                        r = levelled(vec2(inverse[1], inverse[2]), tilt)
                        g = raw[0] * p + raw[1] * r
                        F = gradient[j, q]
                        S = stress[j, q]
                        T = moduli[j, q]
                        F1, F2 = columns_of(F)
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
                        Q1 = p[0] * R1 + p[1] * R2
                        Q2 = r[0] * R1 + r[1] * R2
                        if q >= i:
                            matrix[own] = matrix[own] + centre[0] * Q1 + centre[1] * Q2
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.intact_members(family, q, w)
                            while members != wp.uint32(0):
                                k = w * word_size + lowest_bit(members)
                                members = without_lowest_bit(members)
                                m = f.neighbour(family, q, k)
                                if m >= i:
                                    cxi = (f.influence(family, q, k) * f.area(family, m)) * f.bond(family, q, k)
                                    entry = entry_of(columns, begin, end, m)
                                    matrix[entry] = matrix[entry] + cxi[0] * Q1 + cxi[1] * Q2

    return TangentKernels(linearise, predict, product, turning, inverse_blocks, assemble)
