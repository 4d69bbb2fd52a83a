"""Second half of the force of the fast kernels: the forces that the families around a point exert on it."""

import functools

import warp as wp

from ..effects import Pointwise, pointwise
from ..families import WORD, Layout, bit_of, family_functions
from ..numeric import entry_of
from ..rupture import stiffness_left


@functools.cache
def gather_reverse_bonds(
    layout: Layout,
    members: int,
    steps: tuple[tuple[int, int], ...] | None,
    turns_over: bool,
    listed: bool,
    by_entry: bool,
) -> Pointwise:
    """Pointwise stage that subtracts from the own half of the force [points] the forces of the families around a point.

    In a softened layout the force of each family is reduced by the damage of its point, see
    kernels/tearing/damage_field.py. Points without damage in their family are summed as in an undamaged sheet; the
    others, in a second loop. Broken bonds have zero force, so the stage runs over all bonds of the undamaged sheet.
    The loop over members is unrolled and has no branches, so a thread has the loads of all members in flight.

    Args:
        layout: Layout of the families.
        members: Maximum number of members of a family.
        steps: Lattice steps to each member, as compile-time constants; on a grid those of its deep points; None on a
            cloud.
        turns_over: Whether `bond_force` is a ring buffer with fewer columns than points.
        listed: Whether a list of other points was used; the stage then empties it.
        by_entry: Whether `entries` [members, points] has the index of the reverse bond's entry in `bond_force`, which
            is half of what member and reverse bond take; nonexistent bonds have that of an entry that is zero.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    n, word_size = members, WORD
    right, up = zip(*steps, strict=True) if steps else ((), ())
    reverses = [steps.index((-x, -y)) for x, y in steps] if steps else []
    lattice, gridded = layout.kind == "lattice", layout.kind == "grid" and steps is not None
    left = stiffness_left(layout.bits)
    begins_line = [k == 0 or up[k] != up[k - 1] for k in range(len(up))]
    reach = max(up, default=0)
    pair_of, number_of = entry_of(vec3, 2), entry_of(wp.int32, 2)

    @wp.struct
    class GatherFromReverseBonds:
        family: Family
        columns: int
        bond_force: wp.array2d(dtype=vec3)
        damage: wp.array(dtype=real)
        near_damage: wp.array(dtype=wp.uint8)
        other_count: wp.array(dtype=wp.int32)
        entries: wp.array2d(dtype=wp.int32)
        first_point: int
        force: wp.array(dtype=vec3)

    @wp.func
    def in_ring(a: GatherFromReverseBonds, column: int):
        if wp.static(turns_over):
            ring = a.bond_force.shape[1]
            return column + wp.where(column < 0, ring, 0) - wp.where(column >= ring, ring, 0)
        return column

    @wp.func
    def softened_push(a: GatherFromReverseBonds, i: int, place: int):
        push = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(a.family.members):
            if bit_of(f.initial(a.family, i, k // word_size), k % word_size):
                m = f.neighbour(a.family, i, k)
                column = in_ring(a, place + m - i)
                push += left(a.damage[m]) * a.bond_force[f.reverse(a.family, i, k), column]
        return push

    @pointwise(GatherFromReverseBonds, writes=("force", "other_count"), gathers=("bond_force", "damage"))
    def gather_from_reverse_bonds(begin: int, end: int, a: GatherFromReverseBonds):
        for i in range(begin, end):
            if wp.static(listed):
                # The list has been used; the next launches start a new one.
                if i == a.first_point:
                    a.other_count[0] = 0
            place = i
            if wp.static(turns_over):
                place = i % a.bond_force.shape[1]
            push = vec3(real(0.0), real(0.0), real(0.0))
            deep = bool(False)
            if wp.static(gridded):
                deep = a.family.family_class[i] == 0
                if deep:
                    centre = place
                    for k in range(wp.static(len(right))):
                        if wp.static(begins_line[k]):
                            centre = place + a.family.centres[wp.static(up[k] + reach), i] - i
                        column = in_ring(a, centre + wp.static(right[k]))
                        push += a.bond_force[wp.static(reverses[k]), column]
            if wp.static(by_entry):
                for k in range(wp.static(n)):
                    push += pair_of(a.bond_force, number_of(a.entries, wp.static(k) * a.entries.shape[1] + i))
            elif not deep:
                for k in range(wp.static(n)):
                    if wp.static(lattice):
                        # A bond across an edge of the lattice leads to a point whose reverse bond is not there either
                        # and carries zero: no table is needed, for which the loads of all members would have to wait.
                        shift = wp.static(up[k]) * a.columns + wp.static(right[k])
                        there = i + shift >= 0 and i + shift < a.force.shape[0]
                        row = wp.static(reverses[k])
                        column = place + wp.where(there, shift, 0)
                    else:
                        members_here = f.initial(a.family, i, wp.static(k // word_size))
                        there = (members_here & wp.static(wp.uint32(1 << (k % word_size)))) != wp.uint32(0)
                        row = wp.where(there, f.reverse(a.family, i, wp.static(k)), 0)
                        column = place + wp.where(there, f.neighbour(a.family, i, wp.static(k)) - i, 0)
                    factor = wp.where(there, real(1.0), real(0.0))
                    push += factor * a.bond_force[row, in_ring(a, column)]
            own = a.force[i]
            if wp.static(layout.softened):
                if a.near_damage[i] != wp.uint8(0):
                    push = softened_push(a, i, place)
                    own = left(a.damage[i]) * own
            a.force[i] = own - push

    return gather_from_reverse_bonds
