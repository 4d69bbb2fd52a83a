"""Tangent of the variational bond-associated law: the derivative of the force by the displacement.

For every intersection, `linearise` stores F_ij and, multiplied by the weight, the stress S_ij and the moduli T_ij
(kernels/materials.py). For a direction v, with dF_ij computed from v as F_ij is from u,

    dC = dF^T F + F^T dF,   (dS11, dS22, 2 dS12) = T (dC11, dC22, dC12),   dP = dF S + F dS,

and dP replaces P: the family of i pulls its member k with c_k [sum W_ij h dP_ij K_ij^-1] X_ik. The result is the change
of the internal force, minus the (symmetric) Hessian of the energy times v. An isotropic tension may be added to every
S_ij. Its tangent is that of a stretched soap film, a Laplacian. It gives a flat or slack sheet the out-of-plane
stiffness that it lacks. In a softened layout the stored values of a family are already reduced by the damage of its
point, see kernels/tearing/damage_field.py.

A stored stiffness has the blocks of pairs of points. Within the family of i the displacement of k adds
v (x) R^-1 K_ij^-1 c_k X_ik to dF_ij, so the block of its members k and m is

    c_k c_m sum over a, b of X_ik,a X_im,b [sum over j with k and m in D_ij of E_ij,ab],

with four 3x3 blocks E_ij,ab of each intersection, 21 numbers by symmetry. The inner sum adds them as rows of a table,
with vector instructions of a CPU (as in kernels/family_rows.py).
"""

import functools

import warp as wp

from ..bond_associated import family_mechanics, forces_on_members
from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..kinematics import kinematics
from ..numeric import FunctionFactory, constants_of
from ..rupture import stiffness_left
from .blocks import ROW, block_functions, columns_of_gradient, pair_adder

# Steps longer than this are not of interest.
FAR = 1e3


@functools.cache
def linearisation(
    layout: Layout, response: FunctionFactory, remembers: bool = False, words: int = 0
) -> tuple[Kernel, Kernel]:
    """Kernels `linearise`, which fills gradient, stress, moduli [members, points] at a displacement, and `predict`.

    `predict` replaces stress by what `Prediction` of warp_pd/statics/tangent.py says.

    Args:
        layout: Layout of the families.
        response: Factory of stress and moduli of the material.
        remembers: Whether `response` also takes (i, j, members, terms, state), the internal variables of a step.
        words: Words of a family's masks on a CPU, whose threads have tables of their family; 0 for none.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, word_size = types.mat32, WORD
    f, law, motion = family_functions(layout), family_mechanics(layout, "variational"), kinematics(bits, layout.curved)
    Family, visit = f.struct, law.visit
    response_of = response(bits)
    Constants = constants_of(response_of)
    left = stiffness_left(bits)
    Part = wp.types.vector(length=8, dtype=real)
    Moments = wp.types.matrix(shape=(WORD * max(words, 1), 8), dtype=real)

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

    @wp.func
    def moment(family: Family, i: int, k: int):
        """Return c_k xi_k."""
        return (f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))) * f.bond(family, i, k)

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
        if wp.static(words > 0):
            # On a CPU as in kernels/family_rows.py: what a member adds to each intersection is computed once.
            rows = Moments()
            if undamaged:
                for k in range(family.members):
                    if f.is_intact(family, i, k):
                        m = f.neighbour(family, i, k)
                        arm = moment(family, i, k)
                        u = displacement[m] - displacement[i]
                        row = Part()
                        for c in range(3):
                            row[c] = arm[0] * u[c]
                            row[3 + c] = arm[1] * u[c]
                        rows[k] = row
        for j in range(family.members):
            stress[j, i] = vec3(real(0.0), real(0.0), real(0.0))
            moduli[j, i] = vec6()
            if wp.static(words > 0):
                there = bool(False)
                H1 = vec3(real(0.0), real(0.0), real(0.0))
                H2 = vec3(real(0.0), real(0.0), real(0.0))
                weight = real(0.0)
                tilt = vec2(real(0.0), real(0.0))
                if undamaged:
                    if f.is_intact(family, i, j):
                        sums = Part()
                        for word in range(wp.static(words)):
                            members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                            while members != wp.uint32(0):
                                sums += rows[word * word_size + lowest_bit(members)]
                                members = without_lowest_bit(members)
                        zero = vec3(real(0.0), real(0.0), real(0.0))
                        G1, G2, _shape, tilt_here = law.gradient_over(
                            family, i, j, undamaged, vec3(sums[0], sums[1], sums[2]), vec3(sums[3], sums[4], sums[5]),
                            zero, tilt,
                        )  # fmt: skip
                        tilt = tilt_here
                        if _shape[0] > real(0.0):
                            there = True
                            H1 = family.inverse_horizon * G1
                            H2 = family.inverse_horizon * G2
                            weight = f.weight(family, i, j)
                else:
                    there, H1, H2, _inverse, weight, tilt = visit(family, displacement, i, j, undamaged)
            else:
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

    return linearise, predict


@functools.cache
def shape_functions(layout: Layout) -> tuple[wp.Function, wp.Function]:
    """Functions of K_ij^-1, and (g, tilt) -> R^-1 g."""
    types = layout.types
    real, vec2, vec3, curved = types.real, types.vec2, types.vec3, layout.curved
    f, visit = family_functions(layout), family_mechanics(layout, "variational").visit
    Family = f.struct

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

    return shape_of, levelled


@functools.cache
def matrix_free(layout: Layout, held: bool) -> tuple[Kernel, Kernel]:
    """Kernels of a device that stores no stiffness; `held`: whether any component is.

    `product` fills bond_force [members, points] with its derivative along a direction, which `gather` sums;
    `inverse_blocks` inverts the 3x3 diagonal block of the stiffness of each point, without its held components.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, mat33, word_size = types.mat32, types.mat33, WORD
    f, law, motion = family_functions(layout), family_mechanics(layout, "variational"), kinematics(bits, layout.curved)
    Family, visit, level, times, columns = f.struct, law.visit, motion.level, motion.times, motion.columns
    add_to_members, _ = forces_on_members(layout)
    block_of, inverse_of = block_functions(bits)
    columns_of = columns_of_gradient(bits)
    shape_of, levelled = shape_functions(layout)

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
                add_to_members(family, i, j, A1, A2, bond_force)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                bond_force[k, i] = unit_force * c * bond_force[k, i]

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
                block += block_of(gradient[j, i], stress[j, i], moduli[j, i], g, g)
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
                            block += block_of(gradient[j, m], stress[j, m], moduli[j, m], g, g)
        mask = wp.uint8(0)
        if wp.static(held):
            mask = held_mask[i]
        block = unit_stiffness * block
        if inertia:
            block += inertia[i] * wp.identity(n=3, dtype=real)
        out[i] = inverse_of(block, mask)

    return product, inverse_blocks


@functools.cache
def turning(layout: Layout) -> Kernel:
    """Kernel that fills `longest` with the step along a direction at which a family turns inside out, at most FAR.

    The area of its first intersection is zero there, or its normal at a right angle to what it was.
    """
    types, bits = layout.types, layout.bits
    real, vec3, mat32 = types.real, types.vec3, types.mat32
    f, visit = family_functions(layout), family_mechanics(layout, "variational").visit
    Family, columns_of, far = f.struct, columns_of_gradient(bits), wp.constant(real(FAR))

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

    return turning


@functools.cache
def assembly(layout: Layout) -> tuple[Kernel, Kernel]:
    """Kernels of a device that stores the stiffness.

    `stiffen` fills `moments` [points, members] with c_k xi_k, `stiffness` [points, members] with E_ij of every
    intersection (see the head of this file), and `of_centre` [points, members + 1] with the blocks that couple members
    and centre of every family. `assemble` sums these to the 3x3 blocks of the stiffness, row by row, each row in
    ascending order of `columns`, from the diagonal on; `mirror` of kernels/statics/tangent_matrix.py fills the others.
    """
    types = layout.types
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, mat33, word_size = types.mat32, types.mat33, WORD
    f, columns_of = family_functions(layout), columns_of_gradient(layout.bits)
    Family, (shape_of, levelled) = f.struct, shape_functions(layout)
    Row, Half = wp.types.vector(length=ROW, dtype=real), wp.types.vector(length=8, dtype=real)
    add_pair = pair_adder(layout.bits)

    @wp.func
    def moment(family: Family, i: int, k: int):
        """Return c_k xi_k."""
        return (f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))) * f.bond(family, i, k)

    @wp.func
    def whole(part: Half, skew: vec3):
        """The block with a symmetric part (11, 22, 33, 12, 23, 31) and a skew part, whose (23, 31, 12) are given."""
        return mat33(
            part[0], part[3] + skew[2], part[5] - skew[1],
            part[3] - skew[2], part[1], part[4] + skew[0],
            part[5] + skew[1], part[4] - skew[0], part[2],
        )  # fmt: skip

    @kernel(gathers=("displacement",))
    def stiffen(
        family: Family,
        displacement: wp.array(dtype=vec3),
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        unit_stiffness: real,
        first: int,
        moments: wp.array2d(dtype=vec2),
        stiffness: wp.array2d(dtype=Row),
        of_centre: wp.array2d(dtype=mat33),
    ):
        i = wp.tid() + first
        of_centre[i, family.members] = mat33()
        for k in range(family.members):
            of_centre[i, k] = mat33()
            if f.is_intact(family, i, k):
                moments[i, k] = moment(family, i, k)
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            row = Row()
            inverse, tilt = shape_of(family, displacement, i, j, undamaged)
            if inverse[0] > real(0.0):
                S = unit_stiffness * stress[j, i]
                T = unit_stiffness * moduli[j, i]
                # Columns of R^-1 K^-1.
                p = levelled(vec2(inverse[0], inverse[1]), tilt)
                r = levelled(vec2(inverse[1], inverse[2]), tilt)
                F1, F2 = columns_of(gradient[j, i])
                outer11, outer12, outer22 = Half(), Half(), Half()
                for a in range(3):
                    b = (a + 1) % 3
                    outer11[a] = F1[a] * F1[a]
                    outer11[3 + a] = F1[a] * F1[b]
                    outer12[a] = real(2.0) * F1[a] * F2[a]
                    outer12[3 + a] = F1[a] * F2[b] + F2[a] * F1[b]
                    outer22[a] = F2[a] * F2[a]
                    outer22[3 + a] = F2[a] * F2[b]
                # Symmetric parts of the blocks for unit vectors, and the skew part, along the normal.
                two, half = real(2.0), real(0.5)
                M11 = two * T[0] * outer11 + T[2] * outer12 + half * T[5] * outer22
                M12 = T[2] * outer11 + (T[1] + real(0.25) * T[5]) * outer12 + T[4] * outer22
                M22 = half * T[5] * outer11 + T[4] * outer12 + two * T[3] * outer22
                for a in range(3):
                    M11[a] = M11[a] + S[0]
                    M12[a] = M12[a] + S[1]
                    M22[a] = M22[a] + S[2]
                skew = (p[0] * r[1] - p[1] * r[0]) * (T[1] - real(0.25) * T[5]) * wp.cross(F1, F2)
                E11 = p[0] * p[0] * M11 + two * p[0] * p[1] * M12 + p[1] * p[1] * M22
                E22 = r[0] * r[0] * M11 + two * r[0] * r[1] * M12 + r[1] * r[1] * M22
                E12 = p[0] * r[0] * M11 + (p[0] * r[1] + p[1] * r[0]) * M12 + p[1] * r[1] * M22
                for c in range(6):
                    row[c] = E11[c]
                    row[8 + c] = E22[c]
                    row[16 + c] = E12[c]
                row[6] = skew[2]
                row[7] = skew[0]
                row[14] = skew[1]
                # The centre moves against all members.
                centre = vec2(real(0.0), real(0.0))
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        centre -= moments[i, word * word_size + lowest_bit(members)]
                        members = without_lowest_bit(members)
                C1 = whole(centre[0] * E11 + centre[1] * E12, centre[1] * skew)
                C2 = whole(centre[0] * E12 + centre[1] * E22, -centre[0] * skew)
                of_centre[i, family.members] = of_centre[i, family.members] + centre[0] * C1 + centre[1] * C2
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        arm = moments[i, k]
                        of_centre[i, k] = of_centre[i, k] + arm[0] * C1 + arm[1] * C2
            stiffness[i, j] = row

    @wp.func
    def entry_of(columns: wp.array(dtype=wp.int32), begin: int, own: int, m: int):
        """Entry of the column m of a row, from the one of the last m on; `own` is the first one that counts."""
        entry = int(begin)
        if columns[entry] > m:
            entry = own
        while columns[entry] < m:
            entry += 1
        return entry

    @kernel(gathers=("family.intact", "moments", "stiffness", "of_centre"))
    def assemble(
        family: Family,
        moments: wp.array2d(dtype=vec2),
        stiffness: wp.array2d(dtype=Row),
        of_centre: wp.array2d(dtype=mat33),
        starts: wp.array(dtype=wp.int32),
        columns: wp.array(dtype=wp.int32),
        first: int,
        matrix: wp.array(dtype=mat33),
    ):
        i = wp.tid() + first
        own = entry_of(columns, starts[i], starts[i], i)
        for entry in range(own, starts[i + 1]):
            matrix[entry] = mat33()
        # Its own family, where it is the centre.
        matrix[own] = of_centre[i, family.members]
        entry = int(own)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                if m > i:
                    entry = entry_of(columns, entry, own, m)
                    # At an interface of materials m may be a member twice.
                    matrix[entry] = matrix[entry] + wp.transpose(of_centre[i, k])
        # Those of its neighbours.
        for s in range(family.members):
            if f.is_intact(family, i, s):
                q = f.neighbour(family, i, s)
                mine = f.reverse(family, i, s)
                entry = own
                if q > i:
                    entry = entry_of(columns, entry, own, q)
                    matrix[entry] = matrix[entry] + of_centre[q, mine]
                arm = moments[q, mine]
                for word in range(family.words):
                    members = f.intact_members(family, q, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        m = f.neighbour(family, q, k)
                        if m >= i:
                            entry = entry_of(columns, entry, own, m)
                            for w in range(family.words):
                                both = f.common(family, q, mine, w) & f.common(family, q, k, w)
                                both = both & f.intact_members(family, q, w)
                                if both != wp.uint32(0):
                                    add_pair(stiffness, q, w * word_size, both, arm, moments[q, k], matrix, entry)

    return stiffen, assemble
