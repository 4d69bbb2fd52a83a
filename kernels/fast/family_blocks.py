"""The variational bond-associated force with a few bonds per thread and a few families per thread block.

It computes the same sums as kernels/bond_associated.py, for any family. Threads of a block exchange results through
shared memory between barriers:

    every thread (i, k)     c_k X_k and U_k of its members
    every thread (i, j)     A_ij = W_ij P_ij K_ij^-1 of its bonds, two columns, from those of the members of D_ij
    every thread (i, k)     t_ik = c_k [ sum over j with k in D_ij of A_ij ] X_ik

k belongs to D_ij if j belongs to D_ik, so both sums run over the members of one intersection. Loops over members are
unrolled. A thread uses the data that it reads of a member for all of its bonds, because reading takes as long as
summing. Its bonds are evenly spread over the family: with two bonds one is in the near half, the other half a family
further. Adjacent threads have the same bonds of neighbouring points, and on a lattice they follow the same branches.
Members outside an intersection are skipped by a predicate: selecting zero would take two more instructions, and a
branch even more.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, bit_of, family_functions, lowest_bit, without_lowest_bit
from ..kinematics import kinematics
from ..numeric import FunctionFactory, constants_of, entry_of, put_entry
from ..threads import synchronize

# Maximum threads per block, and the approximate number of threads that the registers of a multiprocessor must hold, by
# precision and bonds per thread.
MAX_THREADS, WARP = 128, 32
RESIDENT_THREADS = {(32, 2): 896, (32, 4): 672, (64, 2): 448, (64, 4): 448}


# Code that adds one member to the sums of each bond of a thread if it is in the intersection of that bond.
_ADD_PRODUCTS = """
    constexpr int bonds = sizeof(sums.data) / sizeof(sums.data[0]);
    for (int b = 0; b < bonds; ++b) {
        auto& sum = sums.data[b];
        if (common.data[b][word] & bit) {
            for (int a = 0; a < 3; ++a) {
                sum[a] += w[3] * w[a];
                sum[3 + a] += y[0] * w[a];
            }
        }
    }
    return sums;
"""

_ADD_PARTS = """
    constexpr int bonds = sizeof(parts.data) / sizeof(parts.data[0]);
    for (int b = 0; b < bonds; ++b) {
        auto& sum = parts.data[b];
        if (common.data[b][word] & bit) {
            for (int a = 0; a < 4; ++a) sum[a] += part[a];
            for (int a = 0; a < 2; ++a) sum[4 + a] += rest[a];
        }
    }
    return parts;
"""

_OPAQUE = """
#if defined(__CUDA_ARCH__)
    asm("" : "+r"(mask));
#endif
    return mask;
"""


@functools.cache
def putting(kind: Any) -> wp.Function:
    """Function (tile, index, value) that writes an element of type `kind` to a shared tile without a barrier.

    `wp.tile` takes two barriers per tile; with this function one barrier serves all tiles.
    """

    @wp.func_native("tile.data(wp::tile_coord(index)) = value;")
    def put(tile: Any, index: int, value: kind): ...

    return put


@wp.func_native(_OPAQUE)
def opaque(mask: wp.uint32) -> wp.uint32:
    """Return the mask unchanged, but opaque to the compiler, which would otherwise recompute it for each bit."""
    ...


@dataclass(frozen=True)
class FamilyBlock:
    """Division of the bonds of a few families among the threads of a block.

    Attributes:
        members: Maximum number of members of a family.
        bonds: Number of bonds of a thread.
    """

    members: int
    bonds: int

    @property
    def lanes(self) -> int:
        """Number of threads that work on one family."""
        return -(-self.members // self.bonds)

    @property
    def together(self) -> int:
        """Number of families that share a block: a power of two, doubled if that leaves fewer threads idle."""
        together = 1 << ((MAX_THREADS // self.lanes).bit_length() - 1)
        return 2 * together if self.lanes * together % WARP else together

    @property
    def threads(self) -> int:
        """Number of threads of the block."""
        return self.lanes * self.together


@functools.cache
def block_force(
    layout: Layout, near: FunctionFactory, family_block: FamilyBlock, listed: bool, turns_over: bool
) -> Kernel:
    """Kernel that fills bond_force [members, ring] and adds the own half of the force to force [points].

    A launch has `blocks` blocks of `family_block.threads` threads; each block loops over families until all are done.
    Point i uses column i % ring of `bond_force`. `moments` [members, rows] stores (c_k X_k, 1 / c_k) of each row of the
    families, with lengths divided by the horizon.

    Args:
        layout: Layout of the families.
        near: Factory of stress_near, called with `bits`.
        family_block: How threads share families.
        listed: Whether `start` to `stop` - 1 are entries of the list `others` (of length `other_count`) instead of
            point indices.
        turns_over: Whether `bond_force` is a ring buffer with fewer columns than points.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    breakable, curved = layout.breakable, layout.curved
    # Whether the shape tensor of a damaged intersection is the undamaged one less its missing members, which are few.
    by_missing = not curved
    motion, stress_near = kinematics(bits, curved), near(bits)
    Constants = constants_of(stress_near)
    n, bonds, lanes = family_block.members, family_block.bonds, family_block.lanes
    together, threads = family_block.together, family_block.threads
    word_size, words = WORD, -(-n // WORD)
    resident = RESIDENT_THREADS[bits, bonds] // threads
    vec4 = wp.types.vector(length=4, dtype=real)
    # Bits of members, and of D_ik of each bond of a thread (first index).
    Words = wp.types.vector(length=words, dtype=wp.uint32)
    Masks = wp.types.matrix(shape=(bonds, words), dtype=wp.uint32)
    # Sums over the intersection of each bond of a thread: c_k X_k1 U_k, c_k X_k2 U_k; then the two columns of A.
    Sums = wp.types.matrix(shape=(bonds, 6), dtype=real)
    Parts = wp.types.matrix(shape=(bonds, 6), dtype=real)
    Inverses = wp.types.matrix(shape=(bonds, 3), dtype=real)
    Weights = wp.types.vector(length=bonds, dtype=real)
    put_vec2, put_vec3, put_vec4 = (putting(kind) for kind in (vec2, vec3, vec4))
    put_pair = put_entry(vec3, 2, wp.int64)
    vector_of, moment_of = entry_of(vec3, 1), entry_of(vec3, 2, wp.uint32)

    @wp.func
    def arrive(
        family: Family,
        present: Words,
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        i: int,
        k: int,
    ):
        """Data of a bond: (U_k, c_k X_k) in two parts, bits of D_ik, undamaged K_ik^-1, W_ik.

        `present` has the bits of the intact members. On a curved sheet U_k is in the frame of the point. There are no
        branches, so loads do not wait for each other; values read for nonexistent members are discarded.
        """
        member = wp.min(k, wp.static(n - 1))
        m = wp.clamp(f.neighbour(family, i, member), 0, displacement.shape[0] - 1)
        moment = moment_of(moments, f.entry(family, i, member))
        stretch = f.to_frame(
            family, i, family.inverse_horizon * (vector_of(displacement, m) - vector_of(displacement, i))
        )
        inverse = f.shape(family, i, member)
        weight = f.weight(family, i, member)
        mask = present[0]
        for word in range(1, wp.static(words)):
            mask = wp.where(member // word_size == word, present[word], mask)
        intact_here = wp.where(k < wp.static(n), bit_of(mask, member & wp.static(word_size - 1)), bool(False))
        none = vec3(real(0.0), real(0.0), real(0.0))
        moment = wp.where(intact_here, moment, none)
        common = Words()
        for word in range(wp.static(words)):
            together = f.common(family, i, member, wp.static(word)) & present[word]
            common[word] = wp.where(intact_here, together, wp.uint32(0))
        exchanged = vec4(stretch[0], stretch[1], stretch[2], moment[0])
        arm = vec2(moment[1], real(0.0))
        if wp.static(breakable):
            arm[1] = moment[2]
        return exchanged, arm, common, inverse, weight

    @wp.func
    def shape_of(family: Family, moments: wp.array2d(dtype=vec3), i: int, k: int):
        """c_k X_k (x) X_k (11, 12, 22)."""
        m = moment_of(moments, f.entry(family, i, k))
        return m[2] * vec3(m[0] * m[0], m[0] * m[1], m[1] * m[1])

    @wp.func
    def missing_shape(
        family: Family,
        moments: wp.array2d(dtype=vec3),
        i: int,
        k: int,
    ):
        """Sum of c_m X_m (x) X_m over the missing members of D_ik."""
        shape = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(wp.static(words)):
            missing = f.initial(family, i, word) & ~f.intact_members(family, i, word)
            missing = missing & f.common(family, i, wp.min(k, wp.static(n - 1)), word)
            while missing != wp.uint32(0):
                at = lowest_bit(missing)
                missing = without_lowest_bit(missing)
                shape += shape_of(family, moments, i, wp.static(word * word_size) + at)
        return shape

    @wp.func
    def without_missing(missing: vec3, undamaged_inverse: vec3):
        """Inverse of a shape tensor minus `missing`, or zero where `remaining_inverse` would be zero."""
        inverse = undamaged_inverse
        if missing[0] + missing[2] > real(0.0) and inverse[0] > real(0.0):
            det = inverse[0] * inverse[2] - inverse[1] * inverse[1]
            whole = vec3(inverse[2] / det, -inverse[1] / det, inverse[0] / det)
            inverse = motion.remaining_inverse(whole - missing, undamaged_inverse)
        return inverse

    @wp.func
    def answer(
        family: Family,
        constants: Constants,
        i: int,
        k: int,
        undamaged: bool,
        inverse: vec3,
        table_weight: real,
        shape: vec3,
        rises: vec2,
        G1: vec3,
        G2: vec3,
        guess: real,
    ):
        """A_ik of a bond and the initial guess for the next stress, from the sums over D_ik.

        `shape` and `rises` are used for damaged families only; if `by_missing`, `shape` is the sum over the lost
        members. There is no branch for broken and nonexistent bonds, whose A no thread reads, nor for intersections
        that determine no gradient: with K^-1 = 0 their A vanishes.
        """
        member = wp.min(k, wp.static(n - 1))
        tilt = f.tilt(family, i, member)
        undamaged_inverse = inverse
        if wp.static(breakable):
            if not undamaged:
                if wp.static(by_missing):
                    inverse = without_missing(shape, undamaged_inverse)
                else:
                    inverse = motion.remaining_inverse(shape, undamaged_inverse)
                if wp.static(curved):
                    tilt = motion.tilt_of(motion.times(inverse, rises))
        C1, C2 = motion.columns(G1, G2, inverse)
        H1, H2 = motion.level(C1, C2, tilt)
        S, next_guess = stress_near(motion.green(H1, H2, tilt), f.of_bond(family, i, member, constants), guess)
        A1, A2 = motion.stress_on_members(H1, H2, S, table_weight, inverse, tilt)
        return A1, A2, next_guess

    @wp.func_native(_ADD_PRODUCTS)
    def add_products(sums: Sums, common: Masks, word: int, bit: wp.uint32, w: vec4, y: vec2) -> Sums:
        """Add a member, given by its `word` and `bit`, to c_k X_k1 U_k and c_k X_k2 U_k of intersections it is in."""
        ...

    @wp.func_native(_ADD_PARTS)
    def add_parts(parts: Parts, common: Masks, word: int, bit: wp.uint32, part: vec4, rest: vec2) -> Parts:
        """Add the columns of A of a bond, given by its `word` and `bit`, to the sums of intersections it is in."""
        ...

    @kernel(per="list", gathers=("displacement",), launch_bounds=(threads, resident), fast_math=bits == 32)
    def family_block_force(
        family: Family,
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
        start: int,
        stop: int,
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_force: real,
        blocks: int,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        force: wp.array(dtype=vec3),
    ):
        thread = wp.tid() + first
        block = thread // threads
        lane = thread - block * threads
        slot = lane & (together - 1)
        count = stop - start
        if wp.static(listed):
            count = wp.min(count, other_count[0])
        # What the threads of a family tell each other, by member.
        stretches = wp.tile_empty(shape=wp.static(bonds * threads), dtype=vec4, storage="shared")
        arms = wp.tile_empty(shape=wp.static(bonds * threads), dtype=vec2, storage="shared")
        firsts = wp.tile_empty(shape=wp.static(bonds * threads), dtype=vec4, storage="shared")
        seconds = wp.tile_empty(shape=wp.static(bonds * threads), dtype=vec2, storage="shared")
        pulls = wp.tile_empty(shape=wp.static(threads), dtype=vec3, storage="shared")
        while block * together < count:
            place = block * together + slot
            here = place < count
            # Opaque: else the compiler computes places in all tables before the loop, and they spill.
            k = int(opaque(wp.uint32(lane // together)))
            i = start + wp.min(place, count - 1)
            if wp.static(listed):
                i = others[start + wp.min(place, count - 1)]
            undamaged = bool(True)
            present = Words()
            for word in range(wp.static(words)):
                intact_here = f.intact_members(family, i, wp.static(word))
                if wp.static(breakable):
                    undamaged = undamaged and intact_here == f.initial(family, i, word)
                present[word] = wp.where(here, intact_here, wp.uint32(0))
            common = Masks()
            inverses = Inverses()
            weights = Weights()
            for b in range(wp.static(bonds)):
                place_of_bond = lane + wp.static(b * threads)
                u, m, mask, inverse, weight = arrive(
                    family, present, moments, displacement, i, k + wp.static(b * lanes)
                )
                put_vec4(stretches, place_of_bond, u)
                put_vec2(arms, place_of_bond, m)
                for word in range(wp.static(words)):
                    common[b, word] = mask[word]
                inverses[b] = inverse
                weights[b] = weight
            synchronize()
            for b in range(wp.static(bonds)):
                for word in range(wp.static(words)):
                    common[b, word] = opaque(common[b, word])
            sums = Sums()
            for other in range(wp.static(n)):
                sums = add_products(
                    sums, common, wp.static(other // word_size), wp.static(wp.uint32(1 << (other % word_size))),
                    stretches[wp.static(other * together) + slot], arms[wp.static(other * together) + slot],
                )  # fmt: skip
            guess = real(0.0)
            for b in range(wp.static(bonds)):
                place_of_bond = lane + wp.static(b * threads)
                mask = Words()
                for word in range(wp.static(words)):
                    mask[word] = common[b, word]
                shape = vec3(real(0.0), real(0.0), real(0.0))
                rises = vec2(real(0.0), real(0.0))
                if wp.static(breakable):
                    if not undamaged:
                        # Not unrolled: few families are damaged, and unrolling would take registers from the others.
                        if wp.static(by_missing):
                            shape = missing_shape(family, moments, i, k + wp.static(b * lanes))
                        else:
                            for word in range(wp.static(words)):
                                for at in range(wp.min(word_size, family.members - wp.static(word * word_size))):
                                    if bit_of(mask[word], at):
                                        other = wp.static(word * word_size) + at
                                        x = stretches[other * together + slot][3]
                                        arm = arms[other * together + slot]
                                        shape += arm[1] * vec3(x * x, x * arm[0], arm[0] * arm[0])
                                        if wp.static(curved):
                                            rises += f.rise(family, i, other) * vec2(x, arm[0])
                A1, A2, guess = answer(
                    family, constants, i, k + wp.static(b * lanes), undamaged, inverses[b], weights[b], shape, rises,
                    vec3(sums[b, 0], sums[b, 1], sums[b, 2]), vec3(sums[b, 3], sums[b, 4], sums[b, 5]), guess,
                )  # fmt: skip
                put_vec4(firsts, place_of_bond, vec4(A1[0], A1[1], A1[2], A2[0]))
                put_vec2(seconds, place_of_bond, vec2(A2[1], A2[2]))
            synchronize()
            parts = Parts()
            for other in range(wp.static(n)):
                parts = add_parts(
                    parts, common, wp.static(other // word_size), wp.static(wp.uint32(1 << (other % word_size))),
                    firsts[wp.static(other * together) + slot], seconds[wp.static(other * together) + slot],
                )  # fmt: skip
            columns = bond_force.shape[1]
            column = i
            if wp.static(turns_over):
                column = i % columns
            own_pull = vec3(real(0.0), real(0.0), real(0.0))
            for b in range(wp.static(bonds)):
                place_of_bond = lane + wp.static(b * threads)
                T1 = vec3(parts[b, 0], parts[b, 1], parts[b, 2])
                T2 = vec3(parts[b, 3], parts[b, 4], parts[b, 5])
                moment = vec2(stretches[place_of_bond][3], arms[place_of_bond][0])
                pull = f.from_frame(family, i, unit_force * (moment[0] * T1 + moment[1] * T2))
                own_pull += pull
                member = k + wp.static(b * lanes)
                if here and member < wp.static(n):
                    put_pair(bond_force, wp.int64(member) * wp.int64(columns) + wp.int64(column), pull)
            put_vec3(pulls, lane, own_pull)
            synchronize()
            if here and k == 0:
                total_pull = vec3(real(0.0), real(0.0), real(0.0))
                for other in range(wp.static(lanes)):
                    total_pull += pulls[other * together + slot]
                force[i] = total_pull
            block += blocks

    return family_block_force
