"""Short-range repulsion of points that share no bond, and friction between them.

Points i and j at a distance r < d_ij have the energy (after Silling and Askari 2005, section 4)

    E_ij = 1/2 k_ij (d_ij - r)^2,      force on i: -k_ij (d_ij - r) (x_j - x_i) / r,      k_ij = k a_i a_j / a^2,

with the areas a_i of the points and the reference area a, so the stiffness per area does not depend on the spacing.
d_ij is the contact distance; for points of the same piece it is limited to a fraction of their reference distance. Both
ends compute the same bits, so momentum is conserved to round-off.

Pairs outside the family are in a list [entries, points], sorted by index; broken bonds are found in the family. The
list has all pairs nearer than d_ij plus a skin; it is rebuilt when a point has moved by half the skin. Pairs that do
not touch add nothing, so forces do not depend on when the list was built.

Cells are found by a hash of their integer coordinates. The order of a bucket, a linked list, depends on thread timing;
the list of each point is sorted and does not.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, Pointwise, kernel, pointwise
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..integrate import RIGID, StepOptions, half_step
from ..numeric import numeric


@dataclass(frozen=True)
class RepulsionKernels:
    """Contact kernels for the pairs in the lists and for broken bonds.

    Attributes:
        add_force: Adds the force of contact to the internal force, and counts the contacts of each point.
        energy: Contact energy of each point [J], half of that of each pair.
        friction: Impulse of friction on each point over a step [N s].
        rub: Pointwise stage that applies that impulse to the points and sums the energy lost.
    """

    add_force: Kernel
    energy: Kernel
    friction: Kernel
    rub: Pointwise


@functools.cache
def repulsion(layout: Layout, options: StepOptions, pieces: bool, rubbing: bool) -> RepulsionKernels:
    """Kernels of contact; `pieces`: the sheet has several pieces; `rubbing`: there is friction."""
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    pairs = pair_functions(bits, pieces)
    Points, distance_kept, between = pairs.Points, pairs.distance_kept, pairs.between
    word_size, rigid, touched = WORD, RIGID, TOUCHED
    held, tracked, damped = options.held, options.tracked, options.damped
    half_kick, half_loss = half_step(options)

    @wp.func
    def push(points: Points, displacement: wp.array(dtype=vec3), i: int, j: int):
        """Depth d_ij - r (0 without contact), direction from i to j, and k_ij."""
        line = between(points, displacement, i, j)
        r = wp.length(line)
        depth = distance_kept(points, i, j) - r
        direction = vec3(real(0.0), real(0.0), real(0.0))
        if depth > real(0.0) and r > real(0.0):
            direction = line / r
        else:
            depth = real(0.0)
        return depth, direction, (points.area[i] * points.area[j]) * points.stiffness

    @wp.func
    def broken_members(family: Family, i: int, word: int):
        return f.initial(family, i, word) & (~f.intact_members(family, i, word))

    @wp.func
    def pressed(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        i: int,
    ):
        """Force of contact on a point [N], number of its contacts, and the sum of k_ij (d_ij - r)^2 over them [J]."""
        total = vec3(real(0.0), real(0.0), real(0.0))
        touching = wp.int32(0)
        stored = real(0.0)
        for c in range(counts[i]):
            depth, direction, stiffness = push(points, displacement, i, near[c, i])
            if depth > real(0.0):
                total -= (stiffness * depth) * direction
                touching = touching + 1
                stored += stiffness * depth * depth
        if wp.static(layout.breakable):
            for word in range(family.words):
                members = broken_members(family, i, word)
                while members != wp.uint32(0):
                    j = f.neighbour(family, i, word * word_size + lowest_bit(members))
                    members = without_lowest_bit(members)
                    depth, direction, stiffness = push(points, displacement, i, j)
                    if depth > real(0.0):
                        total -= (stiffness * depth) * direction
                        touching = touching + 1
                        stored += stiffness * depth * depth
        return total, touching, stored

    @kernel(gathers=("displacement", "points.reference", "points.area"))
    def add_contact_force(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        first: int,
        contacts: wp.array(dtype=wp.int32),
        contact_force: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        status: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        total, touching, _stored = pressed(family, points, displacement, counts, near, i)
        if wp.static(rubbing):
            contacts[i] = touching
            contact_force[i] = total
        if touching > 0:
            force[i] = force[i] + total
            if wp.static(rubbing):
                status[touched] = 1

    @kernel(gathers=("displacement", "points.reference", "points.area"))
    def contact_energy(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        first: int,
        energy: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        _total, _touching, stored = pressed(family, points, displacement, counts, near, i)
        energy[i] = wp.float64(real(0.25) * stored)

    @wp.func
    def drag(
        points: Points,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        mass: wp.array(dtype=real),
        contacts: wp.array(dtype=wp.int32),
        contact_force: wp.array(dtype=vec3),
        most: real,
        i: int,
        j: int,
    ):
        """Friction impulse of point j on point i [N s]; `most` is the friction coefficient times the time step."""
        impulse = vec3(real(0.0), real(0.0), real(0.0))
        depth, direction, stiffness = push(points, displacement, i, j)
        if depth > real(0.0):
            # Surfaces of points are bumpy; what two points feel in all is normal to the sheets between them.
            normal = contact_force[j] - contact_force[i]
            size = wp.length(normal)
            if size > real(0.0):
                normal = normal / size
            else:
                normal = direction
            slip = velocity[j] - velocity[i]
            slip -= wp.dot(slip, normal) * normal
            pressed = stiffness * depth * wp.max(wp.dot(direction, normal), real(0.0))
            speed = wp.length(slip)
            # With all its contacts, a point loses its slip at most once: this cannot gain energy.
            reduced = (mass[i] * mass[j]) / ((mass[i] + mass[j]) * real(wp.max(contacts[i], contacts[j])))
            if speed > real(0.0):
                impulse = wp.min(reduced, most * pressed / speed) * slip
        return impulse

    @kernel(
        gathers=("displacement", "velocity", "mass", "contacts", "contact_force", "points.reference", "points.area"),
    )
    def friction_impulse(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        mass: wp.array(dtype=real),
        contacts: wp.array(dtype=wp.int32),
        contact_force: wp.array(dtype=vec3),
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        step: wp.array(dtype=real),
        coefficient: real,
        first: int,
        impulse: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        total = vec3(real(0.0), real(0.0), real(0.0))
        if contacts[i] > 0:
            most = coefficient * step[0]
            for c in range(counts[i]):
                total += drag(points, displacement, velocity, mass, contacts, contact_force, most, i, near[c, i])
            if wp.static(layout.breakable):
                for word in range(family.words):
                    members = broken_members(family, i, word)
                    while members != wp.uint32(0):
                        j = f.neighbour(family, i, word * word_size + lowest_bit(members))
                        members = without_lowest_bit(members)
                        total += drag(points, displacement, velocity, mass, contacts, contact_force, most, i, j)
        impulse[i] = total

    @wp.struct
    class Rub:
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        impulse: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        work: wp.array(dtype=wp.float64)
        dissipated: wp.array(dtype=wp.float64)
        rubbed: wp.array(dtype=wp.float64)

    @pointwise(Rub, writes=("velocity", "work", "dissipated", "rubbed"))
    def rub(begin: int, end: int, a: Rub):
        for i in range(begin, end):
            before = a.velocity[i]
            change = a.impulse[i] / a.mass[i]
            loss = half_loss(a.step, a.damping)
            if wp.static(held):
                for c in range(3):
                    if (wp.int32(a.held_mask[i]) & ((1 << c) | rigid)) != 0:
                        if wp.static(tracked):
                            # The support balances the impulse.
                            a.work[i] = a.work[i] - wp.float64((real(1.0) + loss) * a.impulse[i][c] * before[c])
                        change[c] = real(0.0)
            a.velocity[i] = before + change
            if wp.static(tracked):
                mean = before + real(0.5) * (real(1.0) - loss) * change
                a.rubbed[i] = a.rubbed[i] - wp.float64((real(1.0) + loss) * wp.dot(a.impulse[i], mean))
                if wp.static(damped):
                    # `half_step` in kernels/integrate.py has the exact statement.
                    slowed = (real(1.0) + loss) * before - half_kick(i, a.step, a.mass, a.force, a.external)
                    a.dissipated[i] = a.dissipated[i] + wp.float64(loss * a.mass[i] * wp.dot(change, slowed))

    return RepulsionKernels(add_contact_force, contact_energy, friction_impulse, rub)


# What a status array holds: whether the lists are to be made, one was full, one holds a pair, and whether a pair has
# touched since they were made.
STALE, CROWDED, LISTED, TOUCHED = 0, 1, 2, 3


@dataclass(frozen=True)
class PairFunctions:
    """Functions and types of the pairs of one configuration.

    Attributes:
        Points: Struct: reference positions, pieces, areas divided by the reference area, contact distances.
        distance_kept: (points, i, j) -> contact distance d_ij [m].
        between: (points, displacement, i, j) -> x_j - x_i [m], vec3.
    """

    Points: Any
    distance_kept: wp.Function
    between: wp.Function


@functools.cache
def pair_functions(bits: int, pieces: bool) -> PairFunctions:
    """Functions of pairs of points.

    Args:
        bits: 32 or 64.
        pieces: Whether the sheet has several pieces.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Points:
        reference: wp.array(dtype=vec3)
        piece: wp.array(dtype=wp.int32)
        area: wp.array(dtype=real)
        distance: real
        fraction: real
        stiffness: real

    @wp.func
    def distance_kept(points: Points, i: int, j: int):
        kept = points.distance
        apart = bool(True)
        if wp.static(pieces):
            apart = points.piece[i] == points.piece[j]
        if apart:
            kept = wp.min(kept, points.fraction * wp.length(points.reference[j] - points.reference[i]))
        return kept

    @wp.func
    def between(points: Points, displacement: wp.array(dtype=vec3), i: int, j: int):
        # Far parts of a sheet touch: both differences are large and nearly cancel, to the round-off of displacements.
        return (points.reference[j] - points.reference[i]) + (displacement[j] - displacement[i])

    return PairFunctions(Points, distance_kept, between)


@dataclass(frozen=True)
class ListKernels:
    """Kernels that build the lists of pairs; all but `look` return immediately unless the lists are stale.

    Attributes:
        look: Marks the lists as stale if a point has moved by more than half the skin.
        clear: Empties the buckets.
        insert: Puts points into buckets.
        collect: Lists the pairs of each point.
        finish: Marks the lists as fresh.
    """

    look: Kernel
    clear: Kernel
    insert: Kernel
    collect: Kernel
    finish: Kernel


@functools.cache
def pair_lists(layout: Layout, pieces: bool) -> ListKernels:
    """Kernels that build the lists of pairs.

    Args:
        layout: Layout of the families.
        pieces: Whether the sheet has several pieces.
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    pairs = pair_functions(bits, pieces)
    Points, distance_kept, between = pairs.Points, pairs.distance_kept, pairs.between
    word_size, stale, crowded, listed, touched = WORD, STALE, CROWDED, LISTED, TOUCHED

    @wp.func
    def bucket_of(cell: wp.vec3i, buckets: int):
        mixed = wp.uint32(cell[0]) * wp.uint32(73856093)
        mixed = mixed ^ (wp.uint32(cell[1]) * wp.uint32(19349663))
        mixed = mixed ^ (wp.uint32(cell[2]) * wp.uint32(83492791))
        return wp.int32(mixed & wp.uint32(buckets - 1))

    @wp.func
    def is_member(family: Family, i: int, j: int):
        found = bool(False)
        for k in range(family.members):
            word = k // word_size
            if (f.initial(family, i, word) >> wp.uint32(k - word * word_size)) & wp.uint32(1) != wp.uint32(0):
                if f.neighbour(family, i, k) == j:
                    found = True
        return found

    @kernel(per="list")
    def look(
        displacement: wp.array(dtype=vec3),
        listed_at: wp.array(dtype=vec3),
        limit: real,
        first: int,
        status: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        # All threads that write here write the same. A displacement that is not finite counts as moved.
        if not wp.length_sq(displacement[i] - listed_at[i]) < limit:
            status[stale] = 1

    @kernel(per="list")
    def clear(first: int, heads: wp.array(dtype=wp.int32), status: wp.array(dtype=wp.int32)):
        b = wp.tid() + first
        if status[stale] != 0:
            heads[b] = -1
            if b == 0:
                status[listed] = 0
                status[touched] = 0

    @kernel(per="list")
    def insert(
        points: Points,
        displacement: wp.array(dtype=vec3),
        inverse_cell: real,
        stride: int,
        first: int,
        heads: wp.array(dtype=wp.int32),
        following: wp.array(dtype=wp.int32),
        cells: wp.array(dtype=wp.vec3i),
        listed_at: wp.array(dtype=vec3),
        status: wp.array(dtype=wp.int32),
    ):
        begin = wp.tid() + first
        if status[stale] != 0:
            for i in range(begin, displacement.shape[0], stride):
                u = displacement[i]
                x = inverse_cell * (points.reference[i] + u)
                cell = wp.vec3i(wp.int32(wp.floor(x[0])), wp.int32(wp.floor(x[1])), wp.int32(wp.floor(x[2])))
                cells[i] = cell
                listed_at[i] = u
                following[i] = wp.atomic_exch(heads, bucket_of(cell, heads.shape[0]), i)

    @kernel(per="list")
    def collect(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        cells: wp.array(dtype=wp.vec3i),
        heads: wp.array(dtype=wp.int32),
        following: wp.array(dtype=wp.int32),
        skin: real,
        family_reach: real,
        first: int,
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        status: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        if status[stale] == 0:
            return
        home = cells[i]
        found = wp.int32(0)
        for place in range(27):
            cell = home + wp.vec3i(place % 3 - 1, (place // 3) % 3 - 1, place // 9 - 1)
            j = heads[bucket_of(cell, heads.shape[0])]
            while j >= 0:
                if j != i and cells[j] == cell:
                    reach = distance_kept(points, i, j) + skin
                    if wp.length_sq(between(points, displacement, i, j)) < reach * reach:
                        bonded = bool(False)
                        if wp.length(points.reference[j] - points.reference[i]) < family_reach:
                            bonded = is_member(family, i, j)
                        if not bonded:
                            if found < near.shape[0]:
                                at = wp.int32(found)
                                while at > 0 and near[wp.max(at - 1, 0), i] > j:
                                    near[at, i] = near[at - 1, i]
                                    at = at - 1
                                near[at, i] = j
                            found = found + 1
                j = following[j]
        if found > near.shape[0]:
            status[crowded] = 1
        if found > 0:
            status[listed] = 1
        counts[i] = wp.min(found, near.shape[0])

    @kernel(per="once")
    def finish(first: int, status: wp.array(dtype=wp.int32)):
        status[stale] = 0

    return ListKernels(look, clear, insert, collect, finish)
