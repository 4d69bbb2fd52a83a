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
from .damage_field import OtherFamilies, driving, field_struct, finishing, sweeping

# Threads of a block whose threads wait for others, and number of such blocks that a multiprocessor holds, by precision.
WAITING_BLOCK, RESIDENT = 256, {32: 2, 64: 1}
# Points that a CPU thread looks at to list them.
TOGETHER = wp.constant(256)
# Value of `driving` at points that are not listed, for processes that have them as ghost points.
UNLISTED = -2.0


@dataclass(frozen=True)
class FieldOptions:
    """What the kernels of a field are compiled for.

    Attributes:
        layout: Layout of the families.
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
    """

    layout: Layout
    spared: bool
    screened: bool
    few: int
    tracked: bool
    weak: bool
    earlier_energy: wp.Function
    driving_energy: wp.Function
    partial_energy: wp.Function | None
    lanes: int
    near: int

    def drive_points(self) -> wp.Function:
        """See `driving`."""
        return driving(self.layout, self.driving_energy, self.partial_energy, self.lanes)

    def sweep_points(self) -> wp.Function:
        """See `sweeping`."""
        return sweeping(self.layout, self.weak, self.near)

    def finish_points(self) -> wp.Function:
        """See `finishing`."""
        return finishing(self.layout, self.spared, self.tracked, self.weak, self.earlier_energy)


@functools.cache
def waking(of: FieldOptions) -> wp.Function:
    """Function (family, displacement, a, i) -> whether to list a point."""
    layout, spared, screened, few = of.layout, of.spared, of.screened, of.few
    vec3 = layout.types.vec3
    f = family_functions(layout)
    Family, Field, word_size = f.struct, field_struct(layout.bits), WORD
    bond_vectors = reference_and_deformed(layout)

    @wp.func
    def outside(family: Family, displacement: wp.array(dtype=vec3), a: Field, i: int, k: int):
        """Whether the squared stretch of a bond is outside the range of the field."""
        X, Y = bond_vectors(family, displacement, i, k, f.neighbour(family, i, k))
        there = wp.dot(X, X)
        now = wp.dot(Y, Y)
        return now > a.longest * there or now < a.shortest * there

    @wp.func
    def stretched(family: Family, displacement: wp.array(dtype=vec3), a: Field, i: int):
        """Whether a checked bond's squared stretch leaves the range in which the energy stays below the limit."""
        if wp.static(few > 0):
            # Before it is known which bonds exist: a GPU then waits for all loads of a point at once.
            maybe = bool(False)
            own = displacement[i]
            for n in range(wp.static(few)):
                m = wp.clamp(i + a.shifts[n], 0, displacement.shape[0] - 1)
                U = displacement[m] - own
                Y = vec3(a.x[n] + U[0], a.y[n] + U[1], U[2])
                now = wp.dot(Y, Y)
                maybe = now > a.most[n] or now < a.least[n] or maybe
            if not maybe:
                return False
        found = bool(False)
        for n in range(a.members.shape[0]):
            k = a.members[n]
            if bit_of(family.intact[k // word_size, i], k % word_size):
                found = outside(family, displacement, a, i, k) or found
        return found

    @wp.func
    def wakes(family: Family, displacement: wp.array(dtype=vec3), a: Field, i: int):
        found = bool(True)
        can_wake = bool(True)
        if wp.static(spared):
            can_wake = a.spared_mask[i] == wp.uint8(0)
        if wp.static(screened):
            found = a.awake[i] != wp.uint8(0)
            found = stretched(family, displacement, a, i) or found
        return found and can_wake

    return wakes


@functools.cache
def wake_kernel(of: FieldOptions, atomics: bool, shared: bool) -> Kernel:
    """Kernel that lists the points whose damage may change (a superset of them).

    `atomics`: the device has them: a GPU. `shared`: other processes must know which points are listed.
    """
    real, vec3 = of.layout.types.real, of.layout.types.vec3
    Family, Field = family_functions(of.layout).struct, field_struct(of.layout.bits)
    wakes = waking(of)

    @kernel(
        per="list",
        gathers=("displacement",),
        writes=("a.listed", "a.count" if atomics else "a.found", *(("a.driving",) if shared else ())),
        name="wake",
    )
    def wake(
        family: Family, displacement: wp.array(dtype=vec3), a: Field, start: int, stop: int, blocks: int, first: int
    ):
        thread = wp.tid() + first
        place = thread * TOGETHER
        # A CPU thread looks at adjacent points; those of a GPU, at points side by side.
        begin, end, step = start + place, wp.min(start + place + TOGETHER, stop), wp.int32(1)
        if wp.static(atomics):
            begin, end, step = start + thread, stop, blocks * wp.block_dim()
        for i in range(begin, end, step):
            if wp.static(shared):
                a.driving[i] = real(UNLISTED)
            if wakes(family, displacement, a, i):
                if wp.static(atomics):
                    a.listed[wp.atomic_add(a.count, 0, 1)] = i
                else:
                    a.listed[place] = i
                    place += 1
        if wp.static(not atomics):
            a.found[thread] = place - thread * TOGETHER

    return wake


@kernel(per="once")
def empty(first: int, count: wp.array(dtype=wp.int32)):
    """Empty the list, on a GPU."""
    count[0] = 0


@kernel(per="once")
def pack(
    found: wp.array(dtype=wp.int32), first: int, listed: wp.array(dtype=wp.int32), count: wp.array(dtype=wp.int32)
):
    """Concatenate the lists of all threads, on a CPU."""
    total = wp.int32(0)
    for thread in range(found.shape[0]):
        for k in range(found[thread]):
            listed[total] = listed[thread * TOGETHER + k]
            total += 1
    count[0] = total


@functools.cache
def rouse_kernel(layout: Layout) -> Kernel:
    """Kernel that marks points that are damaged or have a damaged neighbour, and points with damage in their family."""
    real, f = layout.types.real, family_functions(layout)
    Family, Field, word_size = f.struct, field_struct(layout.bits), WORD

    @kernel(gathers=("a.damage",), writes=("a.awake", "a.near_damage"))
    def rouse(family: Family, a: Field, first: int):
        i = wp.tid() + first
        most = a.damage[i]
        for k in range(a.neighbours.shape[0]):
            most = wp.max(most, a.damage[a.neighbours[k, i]])
        a.awake[i] = wp.where(most > real(0.0), wp.uint8(1), wp.uint8(0))
        most = a.damage[i]
        for k in range(family.members):
            if bit_of(f.initial(family, i, k // word_size), k % word_size):
                most = wp.max(most, a.damage[f.neighbour(family, i, k)])
        if most > real(0.0):
            a.near_damage[i] = wp.uint8(1)

    return rouse


@functools.cache
def drive_kernel(of: FieldOptions) -> Kernel:
    """Kernel that fills `driving` with y of the listed points and `before` with their damage; see `driving`."""
    vec3, Constants = of.layout.types.vec3, constants_of(of.driving_energy)
    Family, Field = family_functions(of.layout).struct, field_struct(of.layout.bits)
    drive_points = of.drive_points()

    @kernel(per="list", gathers=("displacement",), writes=("a.severed_at", "a.driving", "a.before"))
    def drive(
        family: Family, displacement: wp.array(dtype=vec3), constants: Constants, a: Field, stride: int, first: int
    ):
        drive_points(family, displacement, constants, a, wp.tid() + first, a.count[0], stride)

    return drive


@functools.cache
def sweep_kernel(of: FieldOptions) -> Kernel:
    """Kernel of the sweeps `sweep_begin` to `sweep_end` - 1: on a CPU, where none waits, one, or all of one thread."""
    Field, sweep_points = field_struct(of.layout.bits), of.sweep_points()

    @kernel(per="list", gathers=("a.damage", "a.other"), writes=("a.damage", "a.other", "a.arrived"))
    def sweep(a: Field, sweep_begin: int, sweep_end: int, stride: int, first: int):
        thread = wp.tid() + first
        blocks = (wp.min(a.count[0], stride) + wp.block_dim() - 1) // wp.block_dim()
        if thread // wp.block_dim() < blocks:
            sweep_points(a, sweep_begin, sweep_end, thread, a.count[0], stride, blocks)

    return sweep


@functools.cache
def finish_kernel(of: FieldOptions) -> Kernel:
    """Kernel that breaks bonds of listed points, wakes the neighbours of new damage, and sums the released energy."""
    real, vec3, Constants = of.layout.types.real, of.layout.types.vec3, constants_of(of.driving_energy)
    Family, Field = family_functions(of.layout).struct, field_struct(of.layout.bits)
    finish_points = of.finish_points()

    @kernel(
        per="list",
        gathers=("displacement", "velocity", "a.damage"),
        writes=("family.intact", "others.points", "others.count", "a.awake", "a.near_damage", "a.softening"),
    )
    def finish(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        a: Field,
        stride: int,
        others: OtherFamilies,
        first: int,
        released: wp.array(dtype=wp.float64),
    ):
        finish_points(
            family, displacement, velocity, step, constants, unit_volume, a, wp.tid() + first, a.count[0], stride,
            others, released,
        )  # fmt: skip

    return finish


@functools.cache
def find_kernel(of: FieldOptions, looks: bool) -> Kernel:
    """Kernel of a GPU that drives, sweeps, finishes and empties the list; with `looks` it first lists points itself."""
    real, vec3, Constants = of.layout.types.real, of.layout.types.vec3, constants_of(of.driving_energy)
    Family, Field, lanes = family_functions(of.layout).struct, field_struct(of.layout.bits), of.lanes
    wakes, drive_points, sweep_points, finish_points = (
        waking(of), of.drive_points(), of.sweep_points(), of.finish_points()
    )  # fmt: skip

    @kernel(
        per="list",
        gathers=("displacement", "velocity", "a.damage", "a.other"),
        writes=(
            "family.intact", "a.listed", "a.count", "a.arrived", "a.severed_at", "a.driving", "a.before", "a.damage",
            "a.other", "a.awake", "a.near_damage", "a.softening",
        ),
        launch_bounds=(WAITING_BLOCK, RESIDENT[of.layout.bits]),
    )  # fmt: skip
    def find_damage(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        a: Field,
        sweeps: int,
        blocks: int,
        first: int,
        released: wp.array(dtype=wp.float64),
    ):
        """`blocks`: number of all blocks. Without sweeps it only fills `driving` and `before`."""
        thread = wp.tid() + first
        size = wp.block_dim()
        block = thread // size
        if wp.static(looks):
            for i in range(thread, a.damage.shape[0], blocks * size):
                if wakes(family, displacement, a, i):
                    a.listed[wp.atomic_add(a.count, 0, 1)] = i
            wait_for_blocks(a.arrived, blocks)
        end = a.count[0]
        # A block that the points do not need leaves, and may find the list empty already.
        needed = wp.min(blocks, (end * wp.static(lanes) + size - 1) // size)
        if block < needed:
            drive_points(family, displacement, constants, a, thread, end, needed * size // wp.static(lanes))
            wait_for_blocks(a.arrived, needed)
            if thread == 0:
                a.count[0] = 0
            needed = wp.min(needed, (end + size - 1) // size)
            if block < needed and sweeps > 0:
                sweep_points(a, 0, sweeps, thread, end, needed * size, needed)
                wait_for_blocks(a.arrived, needed)
                finish_points(
                    family, displacement, velocity, step, constants, unit_volume, a, thread, end, needed * size,
                    OtherFamilies(), released,
                )  # fmt: skip

    return find_damage


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
