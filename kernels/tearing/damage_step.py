"""Kernels that find the damage of a step (damage_field.py) at the points whose damage may change.

A CPU has a kernel for each part, as has a GPU in static equilibrium, where several processes exchange damage between
them, and on a large lattice, where all but `finish` run beside the force of undamaged families. Otherwise one kernel of
a GPU does all, since a launch takes longer than the work on few points: its blocks wait for each other, so at most
RESIDENT of them may belong to a multiprocessor.

Listed are points that are damaged, have a damaged neighbour, or exceed the energy limit. A GPU lists them in arbitrary
order, which affects no result. CPU threads have no atomics: each makes a separate list, and one thread concatenates
them.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, bit_of, family_functions
from ..numeric import constants_of, numeric
from ..rupture import reference_and_deformed
from ..threads import wait_for_blocks
from .damage_field import OtherFamilies, driving, field_tables, finishing, sweeping

# Threads of a block whose threads wait for others, and number of such blocks that a multiprocessor holds, by precision.
WAITING_BLOCK, RESIDENT = 256, {32: 2, 64: 1}


@dataclass(frozen=True)
class DamageFieldKernels:
    """Kernels of one configuration.

    Attributes:
        empty: Empties the list, on a GPU.
        wake: Lists the points whose damage may change (a superset of them).
        pack: Concatenates the lists of all threads, on a CPU.
        drive: Fills `driving` with y of the listed points (-1 where damage cannot change) and `before` with their
            damage.
        sweep: Sweeps over the listed points.
        finish: Breaks bonds of listed points, wakes the neighbours of new damage, and sums the released energy.
        find: `drive`, `sweep`, `finish` and `empty` in one, with `looks` after what `wake` does.
        rouse: Marks points that are damaged or have a damaged neighbour as awake, and points with damage in their
            family.
        fracture_energy: Energy of the field at each point [J].
        shown: The damage of each point in float32, for frames.
    """

    empty: Kernel
    wake: Kernel
    pack: Kernel
    drive: Kernel
    sweep: Kernel
    finish: Kernel
    find: Kernel
    rouse: Kernel
    fracture_energy: Kernel
    shown: Kernel


@functools.cache
def of_frames(bits: int) -> tuple[Kernel, Kernel]:
    """Kernels `fracture_energy` and `shown`."""
    real, module = numeric(bits).real, f"damage_of_frames_{bits}"

    @kernel(gathers=("damage",), module=module)
    def fracture_energy(
        neighbours: wp.array2d(dtype=wp.int32),
        couplings: wp.array2d(dtype=real),
        limit: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        """`limit` is 3 Gc / (8 l) times the volume of the point [J]."""
        i = wp.tid() + first
        total = damage[i]
        for k in range(neighbours.shape[0]):
            apart = damage[i] - damage[neighbours[k, i]]
            total += real(0.25) * couplings[k, i] * apart * apart
        out[i] = wp.float64(limit[i] * total)

    @kernel(module=module)
    def shown(damage: wp.array(dtype=real), first: int, out: wp.array(dtype=wp.float32)):
        i = wp.tid() + first
        out[i] = wp.float32(damage[i])

    return fracture_energy, shown


@functools.cache
def damage_field(
    layout: Layout, atomics: bool, spared: bool, screened: bool, few: int, tracked: bool, weak: bool,
    earlier_energy: wp.Function, driving_energy: wp.Function, partial_energy: wp.Function | None, lanes: int, near: int,
    looks: bool, shared: bool,
) -> DamageFieldKernels:  # fmt: skip
    """Kernels of the field.

    Args:
        layout: Layout of the families.
        atomics: Whether the device has atomics: a GPU.
        spared: Whether some points are excluded from damage.
        screened: Whether points far from all damage are listed only if one of their bonds is stretched far enough;
            otherwise all points are listed.
        few: Number of members that the screen checks if it checks only some; otherwise 0.
        tracked: Whether to sum the released energy.
        weak: Whether the strength is less than 3 Gc / (16 l).
        earlier_energy: Warp function of the force law's energy of a family at an earlier time.
        driving_energy: The same for the part of it that drives damage.
        partial_energy: Warp function of what a thread adds to the driving energy, if several threads share a family
            in `drive`.
        lanes: Number of these threads, or 1.
        near: Number of neighbours in the tables of couplings.
        looks: Whether `find` lists points itself.
        shared: Whether other processes must know which points are listed.
    """
    types = layout.types
    real, vec3, Constants = types.real, types.vec3, constants_of(driving_energy)
    Family, Tables = family_functions(layout).struct, field_tables(layout.bits)
    wakes = waking(layout, spared, screened, few)
    drive_points = driving(layout, driving_energy, partial_energy, lanes)
    sweep_points = sweeping(layout, weak, near)
    finish_points = finishing(layout, spared, tracked, weak, earlier_energy)

    @kernel(per="list", gathers=("displacement",))
    def drive(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        tables: Tables,
        awake: wp.array(dtype=wp.uint8),
        damage: wp.array(dtype=real),
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        stride: int,
        first: int,
        severed_at: wp.array(dtype=real),
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
    ):
        drive_points(
            family, displacement, constants, tables, awake, damage, listed, wp.tid() + first, count[0], stride,
            severed_at, driving, before,
        )  # fmt: skip

    @kernel(per="list", gathers=("damage", "other"))
    def sweep(
        tables: Tables,
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
        sweep_begin: int,
        sweep_end: int,
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        stride: int,
        first: int,
        damage: wp.array(dtype=real),
        other: wp.array(dtype=real),
        arrived: wp.array(dtype=wp.int32),
    ):
        """Run the sweeps `sweep_begin` to `sweep_end` - 1: one, or those of one thread, on a CPU, where none waits."""
        thread = wp.tid() + first
        blocks = (wp.min(count[0], stride) + wp.block_dim() - 1) // wp.block_dim()
        if thread // wp.block_dim() < blocks:
            sweep_points(
                tables, driving, before, sweep_begin, sweep_end, listed, thread, count[0], stride, blocks, damage,
                other, arrived,
            )  # fmt: skip

    @kernel(
        per="list",
        gathers=("displacement", "velocity", "damage"),
        writes=("family.intact", "others.points", "others.count"),
    )
    def finish(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        tables: Tables,
        severed_at: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        before: wp.array(dtype=real),
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        stride: int,
        others: OtherFamilies,
        first: int,
        awake: wp.array(dtype=wp.uint8),
        near_damage: wp.array(dtype=wp.uint8),
        softening: wp.array(dtype=real),
        released: wp.array(dtype=wp.float64),
    ):
        finish_points(
            family, displacement, velocity, step, constants, unit_volume, tables, severed_at, damage, before, listed,
            wp.tid() + first, count[0], stride, others, awake, near_damage, softening, released,
        )  # fmt: skip

    @kernel(
        per="list",
        gathers=("displacement", "velocity", "damage", "other"),
        writes=("family.intact",),
        launch_bounds=(WAITING_BLOCK, RESIDENT[layout.bits]),
    )
    def find_damage(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        tables: Tables,
        sweeps: int,
        blocks: int,
        first: int,
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        arrived: wp.array(dtype=wp.int32),
        severed_at: wp.array(dtype=real),
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        other: wp.array(dtype=real),
        awake: wp.array(dtype=wp.uint8),
        near_damage: wp.array(dtype=wp.uint8),
        softening: wp.array(dtype=real),
        released: wp.array(dtype=wp.float64),
    ):
        """`blocks`: number of all blocks. Without sweeps it only fills `driving` and `before`."""
        thread = wp.tid() + first
        size = wp.block_dim()
        block = thread // size
        if wp.static(looks):
            for i in range(thread, damage.shape[0], blocks * size):
                if wakes(family, displacement, tables, awake, i):
                    listed[wp.atomic_add(count, 0, 1)] = i
            wait_for_blocks(arrived, blocks)
        end = count[0]
        # A block that the points do not need leaves, and may find the list empty already.
        needed = wp.min(blocks, (end * wp.static(lanes) + size - 1) // size)
        if block < needed:
            drive_points(
                family, displacement, constants, tables, awake, damage, listed, thread, end,
                needed * size // wp.static(lanes), severed_at, driving, before,
            )  # fmt: skip
            wait_for_blocks(arrived, needed)
            if thread == 0:
                count[0] = 0
            needed = wp.min(needed, (end + size - 1) // size)
            if block < needed and sweeps > 0:
                sweep_points(
                    tables, driving, before, 0, sweeps, listed, thread, end, needed * size, needed, damage, other,
                    arrived,
                )  # fmt: skip
                wait_for_blocks(arrived, needed)
                finish_points(
                    family, displacement, velocity, step, constants, unit_volume, tables, severed_at, damage, before,
                    listed, thread, end, needed * size, OtherFamilies(), awake, near_damage, softening, released,
                )  # fmt: skip

    fracture_energy, shown = of_frames(layout.bits)
    empty, wake, pack, rouse = listing(layout, atomics, spared, screened, few, shared)
    return DamageFieldKernels(empty, wake, pack, drive, sweep, finish, find_damage, rouse, fracture_energy, shown)


# Points that a CPU thread looks at to list them.
TOGETHER = 256
# Value of `driving` at points that are not listed, for processes that have them as ghost points.
UNLISTED = -2.0


@functools.cache
def waking(layout: Layout, spared: bool, screened: bool, few: int) -> wp.Function:
    """Function (family, displacement, tables, awake, i) -> whether to list a point.

    Arguments as for `damage_field`.
    """
    vec3 = layout.types.vec3
    f = family_functions(layout)
    Family, Tables, word_size = f.struct, field_tables(layout.bits), WORD
    bond_vectors = reference_and_deformed(layout)

    @wp.func
    def outside(family: Family, displacement: wp.array(dtype=vec3), tables: Tables, i: int, k: int):
        """Whether the squared stretch of a bond is outside the range of the tables."""
        X, Y = bond_vectors(family, displacement, i, k, f.neighbour(family, i, k))
        there = wp.dot(X, X)
        now = wp.dot(Y, Y)
        return now > tables.longest * there or now < tables.shortest * there

    @wp.func
    def stretched(
        family: Family,
        displacement: wp.array(dtype=vec3),
        tables: Tables,
        i: int,
    ):
        """Whether a checked bond's squared stretch leaves the range in which the energy stays below the limit."""
        if wp.static(few > 0):
            # Before it is known which bonds exist: a GPU then waits for all loads of a point at once.
            maybe = bool(False)
            own = displacement[i]
            for n in range(wp.static(few)):
                m = wp.clamp(i + tables.shifts[n], 0, displacement.shape[0] - 1)
                U = displacement[m] - own
                Y = vec3(tables.x[n] + U[0], tables.y[n] + U[1], U[2])
                now = wp.dot(Y, Y)
                maybe = now > tables.most[n] or now < tables.least[n] or maybe
            if not maybe:
                return False
        found = bool(False)
        for n in range(tables.members.shape[0]):
            k = tables.members[n]
            if bit_of(family.intact[k // word_size, i], k % word_size):
                found = outside(family, displacement, tables, i, k) or found
        return found

    @wp.func
    def wakes(
        family: Family,
        displacement: wp.array(dtype=vec3),
        tables: Tables,
        awake: wp.array(dtype=wp.uint8),
        i: int,
    ):
        found = bool(True)
        can_wake = bool(True)
        if wp.static(spared):
            can_wake = tables.spared_mask[i] == wp.uint8(0)
        if wp.static(screened):
            found = awake[i] != wp.uint8(0)
            found = stretched(family, displacement, tables, i) or found
        return found and can_wake

    return wakes


@functools.cache
def listing(
    layout: Layout, atomics: bool, spared: bool, screened: bool, few: int, shared: bool
) -> tuple[Kernel, Kernel, Kernel, Kernel]:
    """Kernels `empty`, `wake`, `pack` and `rouse`, which list points; arguments as for `damage_field`."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family, Tables, word_size = f.struct, field_tables(layout.bits), WORD
    wakes = waking(layout, spared, screened, few)
    together = 1 if atomics else TOGETHER

    @wp.func
    def most_damage(family: Family, damage: wp.array(dtype=real), i: int):
        """Largest damage of the undamaged family of a point."""
        most = damage[i]
        for k in range(family.members):
            if bit_of(f.initial(family, i, k // word_size), k % word_size):
                most = wp.max(most, damage[f.neighbour(family, i, k)])
        return most

    @wp.func
    def touches_damage(damage: wp.array(dtype=real), neighbours: wp.array2d(dtype=wp.int32), i: int):
        """Whether the point or a neighbour is damaged."""
        most = damage[i]
        for k in range(neighbours.shape[0]):
            most = wp.max(most, damage[neighbours[k, i]])
        return most > real(0.0)

    @kernel(gathers=("damage",))
    def rouse(
        family: Family,
        neighbours: wp.array2d(dtype=wp.int32),
        damage: wp.array(dtype=real),
        first: int,
        awake: wp.array(dtype=wp.uint8),
        near_damage: wp.array(dtype=wp.uint8),
    ):
        i = wp.tid() + first
        if most_damage(family, damage, i) > real(0.0):
            near_damage[i] = wp.uint8(1)
        awake[i] = wp.where(touches_damage(damage, neighbours, i), wp.uint8(1), wp.uint8(0))

    @kernel(per="once")
    def empty(first: int, count: wp.array(dtype=wp.int32)):
        count[0] = 0

    @kernel(per="list", gathers=("displacement",))
    def wake(
        family: Family,
        displacement: wp.array(dtype=vec3),
        tables: Tables,
        awake: wp.array(dtype=wp.uint8),
        start: int,
        stop: int,
        blocks: int,
        first: int,
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        found: wp.array(dtype=wp.int32),
        driving: wp.array(dtype=real),
    ):
        thread = wp.tid() + first
        place = thread * wp.static(together)
        # A CPU thread looks at adjacent points; those of a GPU, at points side by side.
        begin, end, step = start + place, wp.min(start + place + wp.static(together), stop), wp.int32(1)
        if wp.static(atomics):
            begin, end, step = start + thread, stop, blocks * wp.block_dim()
        for i in range(begin, end, step):
            if wp.static(shared):
                driving[i] = real(UNLISTED)
            if wakes(family, displacement, tables, awake, i):
                if wp.static(atomics):
                    listed[wp.atomic_add(count, 0, 1)] = i
                else:
                    listed[place] = i
                    place += 1
        if wp.static(not atomics):
            found[thread] = place - thread * wp.static(together)

    @kernel(per="once")
    def pack(
        found: wp.array(dtype=wp.int32), first: int, listed: wp.array(dtype=wp.int32), count: wp.array(dtype=wp.int32)
    ):
        total = wp.int32(0)
        for thread in range(found.shape[0]):
            for k in range(found[thread]):
                listed[total] = listed[thread * wp.static(together) + k]
                total += 1
        count[0] = total

    return empty, wake, pack, rouse


@functools.cache
def ghost_kernel(bits: int) -> Kernel:
    """Kernel of one of several processes, which sweeps over ghost points as their owners do.

    It (one CPU thread) lists ghost points like their owners, after `driving` and `damage` have been received from them.
    """
    real = numeric(bits).real

    @kernel(per="list")
    def list_ghosts(
        driving: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        own_begin: int,
        own_end: int,
        stride: int,
        first: int,
        other: wp.array(dtype=real),
        before: wp.array(dtype=real),
        listed: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
    ):
        for n in range(wp.tid() + first, damage.shape[0] - own_end + own_begin, stride):
            i = wp.where(n < own_begin, n, n + own_end - own_begin)
            other[i] = damage[i]
            before[i] = damage[i]
            if driving[i] != real(UNLISTED):
                listed[wp.atomic_add(count, 0, 1)] = i

    return list_ghosts
