"""Kernels that find the damage of a step (damage_field.py) at the points listed (damage_list.py).

A CPU has a kernel for each part, as has a GPU in static equilibrium, where several processes exchange damage between
them, and on a large lattice, where all but `finish` run beside the force of undamaged families. Otherwise one kernel of
a GPU does all, since a launch takes longer than the work on few points: its blocks wait for each other, so at most
RESIDENT of them may belong to a multiprocessor.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..numeric import constants_of, numeric
from ..threads import wait_for_blocks
from .damage_field import OtherFamilies, driving, finishing, sweeping
from .damage_list import field_tables, listing, waking

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
