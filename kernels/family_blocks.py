"""The variational bond-associated force with two bonds per thread and a few families per thread block.

It computes the same sums as kernels/reference_force.py, for any family. Threads of a block exchange results through
shared memory between barriers:

    every thread (i, k)     c_k X_k and U_k of its members
    every thread (i, j)     A_ij = W_ij P_ij K_ij^-1 of its bonds, two columns, from those of the members of D_ij
    every thread (i, k)     t_ik = c_k [ sum over j with k in D_ij of A_ij ] X_ik

k belongs to D_ij if j belongs to D_ik, so both sums run over the members of one intersection. Loops over members are
unrolled. A thread uses the data that it reads of a member for both of its bonds, because reading takes as long as
summing. One bond, k, is in the near half of the family; the other is half a family further, in the far half. Adjacent
threads have the same bond of neighbouring points, and on a lattice they follow the same branches. Members outside an
intersection are skipped by a predicate: selecting zero would take two more instructions, and a branch even more.
"""

import functools

import warp as wp

from .block_functions import block_functions, opaque, putting, synchronize
from .effects import Kernel, kernel
from .factories import FunctionFactory, constants_of
from .families import WORD, Layout, family_functions

# Maximum threads per block, and the approximate number of threads that the registers of a multiprocessor must hold, by
# precision.
MAX_THREADS, WARP = 128, 32
RESIDENT_THREADS = {32: 896, 64: 448}


def threads_of_family(members: int) -> int:
    """Number of threads that work on one family."""
    return -(-members // 2)


def families_together(members: int) -> int:
    """Number of families that share a block, a power of two; doubled if that leaves fewer threads of a warp idle."""
    threads = threads_of_family(members)
    together = 1 << ((MAX_THREADS // threads).bit_length() - 1)
    return 2 * together if threads * together % WARP else together


@functools.cache
def block_force(layout: Layout, near: FunctionFactory, members: int, listed: bool) -> Kernel:
    """Kernel that fills bond_force [members, ring] and adds the own half of the force to force [points].

    A launch has `blocks` blocks of threads_of_family(members) x families_together(members) threads; each block loops
    over families until all are done. Point i uses column i % ring of `bond_force`. `moments` [members, rows] stores
    (c_k X_k, 1 / c_k) of each row of the families, with lengths divided by the horizon.

    Args:
        layout: Layout of the families.
        near: Factory of stress_near, called with `bits`.
        members: Maximum number of members of a family.
        listed: Whether `start` to `stop` - 1 are entries of the list `others` (of length `other_count`) instead of
            point indices.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    breakable, curved = layout.breakable, layout.curved
    n, half, word_size, words = members, threads_of_family(members), WORD, -(-members // WORD)
    together = families_together(n)
    threads = half * together
    resident = RESIDENT_THREADS[bits] // threads
    vec4 = wp.types.vector(length=4, dtype=real)
    functions = block_functions(layout, near, members)
    Constants = constants_of(near(layout.bits))
    by_missing, missing_shapes = functions.by_missing, functions.missing_shapes
    arrive, answer = functions.arrive, functions.answer
    vec6, Sums, add_products, add_parts = functions.vec6, functions.Sums, functions.add_products, functions.add_parts
    compact, Arm = functions.compact, functions.Arm
    put_vec2, put_vec3, put_vec4, put_arm = (putting(kind) for kind in (vec2, vec3, vec4, Arm))

    @kernel(per="list", gathers=("displacement",), launch_bounds=(threads, resident), fast_math=bits == 32)
    def family_block_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
        start: int,
        stop: int,
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_force: real,
        blocks: int,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        force: wp.array(dtype=vec3),
    ):
        thread = wp.tid() + first
        block = thread // threads
        lane = thread - block * threads
        k = lane // together
        far_k = k + half
        slot = lane & (together - 1)
        count = stop - start
        if wp.static(listed):
            count = wp.min(count, other_count[0])
        # What the threads of a family tell each other: of near members first.
        stretches = wp.tile_empty(shape=wp.static(2 * threads), dtype=vec4, storage="shared")
        arms = wp.tile_empty(shape=wp.static(2 * threads), dtype=Arm, storage="shared")
        firsts = wp.tile_empty(shape=wp.static(2 * threads), dtype=vec4, storage="shared")
        seconds = wp.tile_empty(shape=wp.static(2 * threads), dtype=vec2, storage="shared")
        pulls = wp.tile_empty(shape=wp.static(threads), dtype=vec3, storage="shared")
        while block * together < count:
            place = block * together + slot
            here = place < count
            i = start + wp.min(place, count - 1)
            if wp.static(listed):
                i = others[start + wp.min(place, count - 1)]
            undamaged = bool(True)
            if wp.static(breakable):
                for word in range(wp.static(words)):
                    undamaged = undamaged and intact[word, i] == f.initial(family, i, word)
            intact_here, u, m, common, inverse, weight = arrive(
                family, intact, moments, displacement, inverse_horizon, i, k, here
            )
            far_intact_here, far_u, far_m, far_common, far_inverse, far_weight = arrive(
                family, intact, moments, displacement, inverse_horizon, i, far_k, here
            )
            put_vec4(stretches, lane, u)
            put_vec4(stretches, lane + wp.static(threads), far_u)
            put_arm(arms, lane, m)
            put_arm(arms, lane + wp.static(threads), far_m)
            synchronize()
            for word in range(wp.static(words)):
                common[word] = opaque(common[word])
                far_common[word] = opaque(far_common[word])
            near_sums = Sums()
            far_sums = Sums()
            for other in range(wp.static(n)):
                w = stretches[wp.static(other * together) + slot]
                y = arms[wp.static(other * together) + slot]
                bit = wp.static(wp.uint32(1 << (other % word_size)))
                near_sums = add_products(near_sums, common[wp.static(other // word_size)] & bit, w, y)
                far_sums = add_products(far_sums, far_common[wp.static(other // word_size)] & bit, w, y)
            G1 = vec3(near_sums[0], near_sums[1], near_sums[2])
            G2 = vec3(near_sums[3], near_sums[4], near_sums[5])
            far_G1 = vec3(far_sums[0], far_sums[1], far_sums[2])
            far_G2 = vec3(far_sums[3], far_sums[4], far_sums[5])
            shape = vec3(real(0.0), real(0.0), real(0.0))
            far_shape = vec3(real(0.0), real(0.0), real(0.0))
            rises = vec2(real(0.0), real(0.0))
            far_rises = vec2(real(0.0), real(0.0))
            if wp.static(compact):
                shape = vec3(near_sums[6], near_sums[7], near_sums[8])
                far_shape = vec3(far_sums[6], far_sums[7], far_sums[8])
            elif wp.static(breakable):
                if not undamaged:
                    # Not unrolled: few families are damaged, and unrolling would take registers from the others.
                    if wp.static(by_missing):
                        shape, far_shape = missing_shapes(family, intact, moments, i, k, far_k)
                    else:
                        for word in range(wp.static(words)):
                            for at in range(wp.min(word_size, family.members - wp.static(word * word_size))):
                                other = wp.static(word * word_size) + at
                                x = stretches[other * together + slot][3]
                                arm = arms[other * together + slot]
                                part = arm[1] * vec3(x * x, x * arm[0], arm[0] * arm[0])
                                near_bit = (common[wp.static(word)] >> wp.uint32(at)) & wp.uint32(1)
                                far_bit = (far_common[wp.static(word)] >> wp.uint32(at)) & wp.uint32(1)
                                moment = vec2(real(0.0), real(0.0))
                                if wp.static(curved):
                                    if (near_bit | far_bit) != wp.uint32(0):
                                        moment = f.rise(family, i, other) * vec2(x, arm[0])
                                if near_bit != wp.uint32(0):
                                    shape += part
                                    rises += moment
                                if far_bit != wp.uint32(0):
                                    far_shape += part
                                    far_rises += moment
            A1, A2, guess = answer(
                family, constants, i, k, intact_here, undamaged, inverse, weight, shape, rises, G1, G2, real(0.0)
            )
            far_A1, far_A2, _guess = answer(
                family, constants, i, far_k, far_intact_here, undamaged, far_inverse, far_weight, far_shape,
                far_rises, far_G1, far_G2, guess,
            )  # fmt: skip
            put_vec4(firsts, lane, vec4(A1[0], A1[1], A1[2], A2[0]))
            put_vec4(firsts, lane + wp.static(threads), vec4(far_A1[0], far_A1[1], far_A1[2], far_A2[0]))
            put_vec2(seconds, lane, vec2(A2[1], A2[2]))
            put_vec2(seconds, lane + wp.static(threads), vec2(far_A2[1], far_A2[2]))
            synchronize()
            near_parts = vec6()
            far_parts = vec6()
            for other in range(wp.static(n)):
                a = firsts[wp.static(other * together) + slot]
                b = seconds[wp.static(other * together) + slot]
                bit = wp.static(wp.uint32(1 << (other % word_size)))
                near_parts = add_parts(near_parts, common[wp.static(other // word_size)] & bit, a, b)
                far_parts = add_parts(far_parts, far_common[wp.static(other // word_size)] & bit, a, b)
            T1 = vec3(near_parts[0], near_parts[1], near_parts[2])
            T2 = vec3(near_parts[3], near_parts[4], near_parts[5])
            far_T1 = vec3(far_parts[0], far_parts[1], far_parts[2])
            far_T2 = vec3(far_parts[3], far_parts[4], far_parts[5])
            pull = f.from_frame(family, i, unit_force * (u[3] * T1 + m[0] * T2))
            far_pull = f.from_frame(family, i, unit_force * (far_u[3] * far_T1 + far_m[0] * far_T2))
            put_vec3(pulls, lane, pull + far_pull)
            synchronize()
            if here:
                column = i % bond_force.shape[1]
                bond_force[k, column] = pull
                if far_k < wp.static(n):
                    bond_force[far_k, column] = far_pull
                if k == 0:
                    total_pull = vec3(real(0.0), real(0.0), real(0.0))
                    for other in range(half):
                        total_pull += pulls[other * together + slot]
                    force[i] = total_pull
            block += blocks

    return family_block_force
