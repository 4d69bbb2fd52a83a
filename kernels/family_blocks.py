"""The variational bond-associated force with two bonds per thread and a few families per block of threads.

It computes the same sums as kernels/reference_force.py, for any family. The threads of a block
exchange their results, between barriers, through the shared memory of the block:

    every thread (i, k)     c_k X_k and U_k of its members
    every thread (i, j)     A_ij = W_ij P_ij K_ij^-1 of its bonds, two columns, from those of the members of D_ij
    every thread (i, k)     t_ik = c_k [ sum over j with k in D_ij of A_ij ] X_ik

k belongs to D_ij if j belongs to D_ik, so both sums run over the members of one intersection. Loops over members are
unrolled. A thread uses what it reads of a member for both of its bonds, because reading takes as long as summing: one
is k, of the near half of the family, the other lies half a family further, in the far half. Adjacent threads have the
same bond of neighbouring points, and on a lattice they follow the same branches.
"""

import functools
from typing import Any

import warp as wp

from .bits import bit_in_word, bit_of, lowest_bit, without_lowest_bit
from .bond_associated import bond_associated
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory
from .families import WORD, family_functions, has_shares, is_curved, is_grid, is_lattice
from .kinematics import kinematics
from .numeric import numeric
from .rupture import Breaking, released_part

# Maximum threads per block, and the approximate number of threads that the registers of a multiprocessor must hold, by
# precision.
MAX_THREADS = 128
RESIDENT_THREADS = {32: 896, 64: 448}


def threads_of_family(members: int) -> int:
    """Number of threads that share a family."""
    return -(-members // 2)


def families_together(members: int) -> int:
    """Number of families that share a block, a power of two."""
    return 1 << ((MAX_THREADS // threads_of_family(members)).bit_length() - 1)


@functools.cache
def block_force(
    layout: str,
    bits: int,
    material: PairFactory,
    near: FunctionFactory,
    breakable: str | None,
    breaking: Breaking | None,
    members: int,
    listed: bool,
    module: str,
    fast_module: str,
) -> Kernel:
    """Kernel that fills bond_force [members, ring] and force [points] by the families' own half; variational form.

    It takes `blocks` blocks of threads_of_family(members) x families_together(members) threads, each of which works
    until all families are done. Point i has column i % ring of `bond_force`. `moments` [members, rows] holds
    (c_k X_k, 1 / c_k) of each row of the families, with lengths divided by the horizon.

    Args:
        layout: "lattice", "grid" or "cloud".
        bits: 32 or 64.
        material: Factory of (stress, energy), called with `bits`.
        near: Factory of stress_near, called with `bits`.
        breakable: None, "redistribute" or "drop".
        breaking: What breaks bonds before the forces are found, or None. Each family is told by its own bonds alone.
        members: Maximum number of members of a family.
        listed: Whether the points are those on the list `others`, instead of `start` to `stop` - 1.
        module: Name of the Warp module of the law.
        fast_module: Name of the Warp module of this kernel alone, which is compiled for its own block size.
    """
    types = numeric(bits)
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    law = bond_associated(layout, bits, material, breakable, "variational", module).mechanics
    intact_members, is_undamaged, is_intact = law.intact_members, law.is_undamaged, law.is_intact
    green, damaged_inverse = law.green, law.damaged_inverse
    tilt_of, level = kinematics(bits).tilt_of, kinematics(bits).level
    area_weight, family_scale = law.area_weight, law.family_scale
    stress_near, stress_on_members = near(bits), law.stress_on_members
    damaged, redistribute = breakable is not None, breakable == "redistribute"
    by_row, gradual, curved = is_lattice(layout) or is_grid(layout), has_shares(layout), is_curved(layout)
    # The shape tensor of what is left is that of the whole intersection without the few members that are missing.
    by_missing = not (redistribute or gradual or curved)
    n, half, word_size = members, threads_of_family(members), WORD
    together = families_together(n)
    threads = half * together
    resident = RESIDENT_THREADS[bits] // threads
    words = -(-n // WORD)
    Words = wp.types.vector(length=words, dtype=wp.uint32)
    vec4 = wp.types.vector(length=4, dtype=real)
    breaks = breaking is not None
    Constants: Any = breaking.criterion.struct if breaking else int
    exceeds = breaking.criterion.exceeds if breaking else None
    gathered = tuple(f"criterion.{name}" for name in breaking.criterion.gathers) if breaking else ()
    spared = breaking is not None and breaking.spared
    earlier_energy = breaking.earlier_energy if breaking else None
    tracked = earlier_energy is not None
    if tracked:
        assert breaking is not None and earlier_energy is not None
        part_of_released = released_part(layout, bits, earlier_energy, module)

    @wp.func(module=fast_module)
    def arrive(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        inverse_horizon: real,
        breaks_now: int,
        criterion: Constants,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        k: int,
        here: bool,
    ):
        """Whether the bond is intact; its (U_k, c_k X_k) in the parts that threads exchange, and the bits of D_ik.

        Last, whether it breaks now; it then is not intact. On a curved sheet U_k is in the frame of the point.
        """
        intact_here = bool(False)
        breaks_here = bool(False)
        stretch = vec3(real(0.0), real(0.0), real(0.0))
        moment = vec3(real(0.0), real(0.0), real(0.0))
        common = Words()
        if here and k < wp.static(n):
            intact_here = is_intact(family, intact, i, k)
            if wp.static(breaks):
                if intact_here and breaks_now != 0:
                    m = f.neighbour(family, i, k)
                    breaks_here = exceeds(family, displacement, criterion, horizon, i, k, m)
                    if wp.static(spared):
                        if spared_mask[i] != wp.uint8(0) or spared_mask[m] != wp.uint8(0):
                            breaks_here = False
                    if breaks_here:
                        intact_here = False
            if intact_here:
                row = i
                if wp.static(by_row):
                    row = family.family_class[i]
                moment = moments[k, row]
                if wp.static(gradual):
                    share = f.share(family, i, k)
                    moment = vec3(share * moment[0], share * moment[1], moment[2] / share)
                stretch = f.to_frame(
                    family, i, inverse_horizon * (displacement[f.neighbour(family, i, k)] - displacement[i])
                )
                for word in range(wp.static(words)):
                    common[word] = f.common(family, i, k, wp.static(word)) & intact_members(
                        family, intact, i, wp.static(word)
                    )
        exchanged = vec4(stretch[0], stretch[1], stretch[2], moment[0])
        return intact_here, exchanged, vec2(moment[1], moment[2]), common, breaks_here

    @wp.func(module=fast_module)
    def shape_of(family: Family, moments: wp.array2d(dtype=vec3), i: int, k: int):
        """c_k X_k (x) X_k (11, 12, 22)."""
        row = i
        if wp.static(by_row):
            row = family.family_class[i]
        m = moments[k, row]
        return m[2] * vec3(m[0] * m[0], m[0] * m[1], m[1] * m[1])

    @wp.func(module=fast_module)
    def without_missing(missing: vec3, undamaged_inverse: vec3):
        """Inverse of what is left of a shape tensor after `missing` is taken from it, or zero, as `damaged_inverse`."""
        inverse = undamaged_inverse
        if missing[0] + missing[2] > real(0.0) and inverse[0] > real(0.0):
            det = inverse[0] * inverse[2] - inverse[1] * inverse[1]
            whole = vec3(inverse[2] / det, -inverse[1] / det, inverse[0] / det)
            inverse, _size = damaged_inverse(whole - missing, undamaged_inverse, real(0.0))
        return inverse

    @wp.func(module=fast_module)
    def answer(
        family: Family,
        constants: parameters,
        i: int,
        k: int,
        intact_here: bool,
        undamaged: bool,
        shape: vec3,
        size: real,
        rises: vec2,
        G1: vec3,
        G2: vec3,
    ):
        """A_ik of a bond and its weight, from the sums over D_ik; `shape`, `size`, `rises` are of a damaged family.

        If `by_missing`, `shape` is of the members that are missing.
        """
        A1 = vec3(real(0.0), real(0.0), real(0.0))
        A2 = vec3(real(0.0), real(0.0), real(0.0))
        weight = real(0.0)
        if intact_here:
            inverse = f.shape(family, i, k)
            tilt = f.tilt(family, i, k)
            if wp.static(damaged):
                if not undamaged:
                    if wp.static(by_missing):
                        inverse = without_missing(shape, inverse)
                    else:
                        inverse, size = damaged_inverse(shape, inverse, size)
                    if wp.static(curved):
                        slope = vec2(
                            inverse[0] * rises[0] + inverse[1] * rises[1], inverse[1] * rises[0] + inverse[2] * rises[1]
                        )
                        tilt = tilt_of(slope)
            if inverse[0] > real(0.0):
                H1 = G1 * inverse[0] + G2 * inverse[1]
                H2 = G1 * inverse[1] + G2 * inverse[2]
                if wp.static(curved):
                    H1, H2 = level(H1, H2, tilt)
                S, _guess = stress_near(green(H1, H2, tilt), constants, real(0.0))
                weight = area_weight(family, i, k, undamaged, size)
                A1, A2 = stress_on_members(H1, H2, S, weight, inverse, tilt)
        return A1, A2, weight

    @kernel(
        fast_module, per="list", gathers=("displacement", "velocity", *gathered), launch_bounds=(threads, resident)
    )  # fmt: skip
    def family_block_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
        start: int,
        stop: int,
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        blocks: int,
        breaks_now: int,
        criterion: Constants,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        unit_volume: real,
        first: int,
        remaining: wp.array2d(dtype=wp.uint32),
        released: wp.array(dtype=wp.float64),
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
            count = other_count[0]
        while block * together < count:
            place = block * together + slot
            here = place < count
            i = start + wp.min(place, count - 1)
            if wp.static(listed):
                i = others[wp.min(place, count - 1)]
            undamaged = is_undamaged(family, intact, i)
            intact_here, u, m, common, breaks_here = arrive(
                family,
                intact,
                moments,
                displacement,
                inverse_horizon,
                breaks_now,
                criterion,
                horizon,
                spared_mask,
                i,
                k,
                here,
            )
            far_intact_here, far_u, far_m, far_common, far_breaks_here = arrive(
                family,
                intact,
                moments,
                displacement,
                inverse_horizon,
                breaks_now,
                criterion,
                horizon,
                spared_mask,
                i,
                far_k,
                here,
            )
            stretches = wp.tile(u, preserve_type=True)
            far_stretches = wp.tile(far_u, preserve_type=True)
            arms = wp.tile(m, preserve_type=True)
            far_arms = wp.tile(far_m, preserve_type=True)
            if wp.static(breaks):
                gone_here = Words()
                for word in range(wp.static(words)):
                    gone_here[word] = wp.where(breaks_here, bit_in_word(k, word), wp.uint32(0)) | wp.where(
                        far_breaks_here, bit_in_word(far_k, word), wp.uint32(0)
                    )
                parts = wp.tile(gone_here, preserve_type=True)
                gone = Words()
                any_gone = wp.uint32(0)
                for other in range(wp.static(half)):
                    lost_bits = parts[wp.static(other * together) + slot]
                    for word in range(wp.static(words)):
                        gone[word] = gone[word] | lost_bits[word]
                        any_gone = any_gone | lost_bits[word]
                if any_gone != wp.uint32(0):
                    undamaged = False
                    for word in range(wp.static(words)):
                        common[word] = common[word] & ~gone[word]
                        far_common[word] = far_common[word] & ~gone[word]
                    if k == 0 and here:
                        lost = real(0.0)
                        stage = wp.int32(0)
                        # Not unrolled, as few families ever come here.
                        while stage < 6:
                            if stage == 3:
                                for word in range(wp.static(words)):
                                    remaining[word, i] = remaining[word, i] & ~gone[word]
                            if wp.static(tracked):
                                lost += part_of_released(
                                    family,
                                    intact,
                                    displacement,
                                    velocity,
                                    step[0],
                                    constants,
                                    inverse_horizon,
                                    i,
                                    stage,
                                )
                            stage += 1
                        if wp.static(tracked):
                            released[i] = released[i] + wp.float64(unit_volume * lost)
            G1 = vec3(real(0.0), real(0.0), real(0.0))
            G2 = vec3(real(0.0), real(0.0), real(0.0))
            far_G1 = vec3(real(0.0), real(0.0), real(0.0))
            far_G2 = vec3(real(0.0), real(0.0), real(0.0))
            for other in range(wp.static(n)):
                bit = wp.static(wp.uint32(1 << (other % word_size)))
                if wp.static(other < half):
                    w = stretches[wp.static(other * together) + slot]
                    y = arms[wp.static(other * together) + slot][0]
                else:
                    w = far_stretches[wp.static((other - half) * together) + slot]
                    y = far_arms[wp.static((other - half) * together) + slot][0]
                on = (common[wp.static(other // word_size)] & bit) != wp.uint32(0)
                G1 += wp.where(on, w[3], real(0.0)) * vec3(w[0], w[1], w[2])
                G2 += wp.where(on, y, real(0.0)) * vec3(w[0], w[1], w[2])
                on = (far_common[wp.static(other // word_size)] & bit) != wp.uint32(0)
                far_G1 += wp.where(on, w[3], real(0.0)) * vec3(w[0], w[1], w[2])
                far_G2 += wp.where(on, y, real(0.0)) * vec3(w[0], w[1], w[2])
            shape = vec3(real(0.0), real(0.0), real(0.0))
            far_shape = vec3(real(0.0), real(0.0), real(0.0))
            size = real(0.0)
            far_size = real(0.0)
            rises = vec2(real(0.0), real(0.0))
            far_rises = vec2(real(0.0), real(0.0))
            if wp.static(damaged):
                if not undamaged:
                    # Not unrolled: few families are damaged, and unrolling would take registers from the others.
                    if wp.static(by_missing):
                        for word in range(wp.static(words)):
                            missing = f.initial(family, i, word) & ~intact_members(family, intact, i, word)
                            if wp.static(breaks):
                                missing = missing | gone[word]
                            near_bits = f.common(family, i, wp.min(k, wp.static(n - 1)), word)
                            far_bits = f.common(family, i, wp.min(far_k, wp.static(n - 1)), word)
                            while missing != wp.uint32(0):
                                at = lowest_bit(missing)
                                missing = without_lowest_bit(missing)
                                lost_part = shape_of(family, moments, i, wp.static(word * word_size) + at)
                                shape += wp.where(bit_of(near_bits, at), real(1.0), real(0.0)) * lost_part
                                far_shape += wp.where(bit_of(far_bits, at), real(1.0), real(0.0)) * lost_part
                    else:
                        for word in range(wp.static(words)):
                            for at in range(wp.min(word_size, family.members - wp.static(word * word_size))):
                                other = wp.static(word * word_size) + at
                                x = real(0.0)
                                arm = vec2(real(0.0), real(0.0))
                                if other < half:
                                    x = stretches[other * together + slot][3]
                                    arm = arms[other * together + slot]
                                else:
                                    x = far_stretches[(other - half) * together + slot][3]
                                    arm = far_arms[(other - half) * together + slot]
                                part = arm[1] * vec3(x * x, x * arm[0], arm[0] * arm[0])
                                area = real(0.0)
                                near_bit = (common[wp.static(word)] >> wp.uint32(at)) & wp.uint32(1)
                                far_bit = (far_common[wp.static(word)] >> wp.uint32(at)) & wp.uint32(1)
                                if wp.static(redistribute):
                                    if (near_bit | far_bit) != wp.uint32(0):
                                        area = f.area(family, f.neighbour(family, i, other))
                                moment = vec2(real(0.0), real(0.0))
                                if wp.static(curved):
                                    if (near_bit | far_bit) != wp.uint32(0):
                                        moment = f.rise(family, i, other) * vec2(x, arm[0])
                                if near_bit != wp.uint32(0):
                                    shape += part
                                    size += area
                                    rises += moment
                                if far_bit != wp.uint32(0):
                                    far_shape += part
                                    far_size += area
                                    far_rises += moment
            A1, A2, weight = answer(family, constants, i, k, intact_here, undamaged, shape, size, rises, G1, G2)
            far_A1, far_A2, far_weight = answer(
                family, constants, i, far_k, far_intact_here, undamaged, far_shape, far_size, far_rises, far_G1, far_G2
            )
            firsts = wp.tile(vec4(A1[0], A1[1], A1[2], A2[0]), preserve_type=True)
            far_firsts = wp.tile(vec4(far_A1[0], far_A1[1], far_A1[2], far_A2[0]), preserve_type=True)
            seconds = wp.tile(vec2(A2[1], A2[2]), preserve_type=True)
            far_seconds = wp.tile(vec2(far_A2[1], far_A2[2]), preserve_type=True)
            scale = unit_force
            if wp.static(redistribute):
                weights = wp.tile(weight + far_weight)
                total = real(0.0)
                for other in range(half):
                    total += weights[other * together + slot]
                scale = unit_force * family_scale(family, i, undamaged, total)
            T1 = vec3(real(0.0), real(0.0), real(0.0))
            T2 = vec3(real(0.0), real(0.0), real(0.0))
            far_T1 = vec3(real(0.0), real(0.0), real(0.0))
            far_T2 = vec3(real(0.0), real(0.0), real(0.0))
            for other in range(wp.static(n)):
                bit = wp.static(wp.uint32(1 << (other % word_size)))
                if wp.static(other < half):
                    a = firsts[wp.static(other * together) + slot]
                    b = seconds[wp.static(other * together) + slot]
                else:
                    a = far_firsts[wp.static((other - half) * together) + slot]
                    b = far_seconds[wp.static((other - half) * together) + slot]
                share = wp.where((common[wp.static(other // word_size)] & bit) != wp.uint32(0), real(1.0), real(0.0))
                T1 += share * vec3(a[0], a[1], a[2])
                T2 += share * vec3(a[3], b[0], b[1])
                share = wp.where(
                    (far_common[wp.static(other // word_size)] & bit) != wp.uint32(0), real(1.0), real(0.0)
                )
                far_T1 += share * vec3(a[0], a[1], a[2])
                far_T2 += share * vec3(a[3], b[0], b[1])
            pull = f.from_frame(family, i, scale * (u[3] * T1 + m[0] * T2))
            far_pull = f.from_frame(family, i, scale * (far_u[3] * far_T1 + far_m[0] * far_T2))
            pulls = wp.tile(pull + far_pull, preserve_type=True)
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
