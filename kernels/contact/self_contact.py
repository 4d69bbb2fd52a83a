"""Short-range repulsion of points that share no bond, and friction between them.

Points i and j at a distance r < d_ij have the energy (after Silling and Askari 2005, section 4)

    E_ij = 1/2 k_ij (d_ij - r)^2,      force on i: -k_ij (d_ij - r) (x_j - x_i) / r,      k_ij = k a_i a_j / a^2,

with the areas a_i of the points and the reference area a, so the stiffness per area does not depend on the spacing.
d_ij is the contact distance; for points of the same piece it is limited to a fraction of their reference distance. Both
ends compute the same bits, so momentum is conserved to round-off.

Pairs outside the family are in a list [entries, points], sorted by index; broken bonds are found in the family. The
list has all pairs nearer than d_ij plus a skin; it is rebuilt when a point has moved by half the skin. Pairs that do
not touch add nothing, so forces do not depend on when the list was built.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import Kernel, Pointwise, kernel, pointwise
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..integrate import RIGID, StepOptions, half_step
from .near_pairs import TOUCHED, pair_functions


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
