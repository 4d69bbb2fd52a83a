"""Lists of the points at which the damage of a damage field may change (kernels/tearing/damage_field.py).

These are points that are damaged, have a damaged neighbour, or exceed the energy limit. A GPU lists them in arbitrary
order, which affects no result. CPU threads have no atomics: each makes a separate list, and one thread concatenates
them.
"""

import functools
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, bit_of, family_functions
from ..numeric import numeric
from ..rupture import reference_and_deformed

# Points that a CPU thread looks at to list them.
TOGETHER = 256
# Value of `driving` at points that are not listed, for processes that have them as ghost points.
UNLISTED = -2.0


@functools.cache
def field_tables(bits: int) -> Any:
    """Struct of what a damage field does not change.

    spared_mask: Points that are excluded from damage, if there are any.
    members: Members whose bonds may be stretched so far that their points are damaged.
    shortest, longest: Range of their squared stretch in which the energy stays below the limit.
    shifts, x, y, least, most: On a lattice, of up to four members: difference of indices, components [m], and range of
        the squared length [m^2], here with some margin for round-off.
    scale: Factor that turns the energy of a family into y.
    fastest: m of the g in use, see kernels/tearing/damage_field.py.
    ahead: Points beyond the end of a cut.
    neighbours, couplings: Neighbours of a point and c_ik, [neighbours, points].
    relaxations: Factors of the sweeps.
    squared_reach: Squared distance from a severed point at which bonds break, in units of horizon^2.
    """
    types = numeric(bits)
    real, four = types.real, types.parameters

    @wp.struct
    class FieldTables:
        spared_mask: wp.array(dtype=wp.uint8)
        members: wp.array(dtype=wp.int32)
        shortest: real
        longest: real
        shifts: wp.vec4i
        x: four
        y: four
        least: four
        most: four
        scale: wp.array(dtype=real)
        fastest: real
        ahead: wp.array(dtype=wp.uint8)
        neighbours: wp.array2d(dtype=wp.int32)
        couplings: wp.array2d(dtype=real)
        relaxations: wp.array(dtype=real)
        squared_reach: wp.array(dtype=real)

    return FieldTables


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
