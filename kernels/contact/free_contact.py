"""Contact of a sheet with a free body, which yields to all points that touch it at once.

All contacts of one half step are solved together. Point i moves into the body with speed a_i along its normal n_i, at
the arm r_i. If every such point ends with the velocity of the body's surface, the change d of velocity and spin of the
body solves, with j_i = (n_i, r_i x n_i),
    [diag(M, I) + sum m_i j_i j_i^T] d = -sum m_i a_i j_i.
A second solution leaves out points that would have to be pulled, and adds friction according to the first solution:
sticking points move with the body, sliding points drag it by the friction coefficient times their impulse. The body
moves by the second solution. Then the points are projected, and the body loses the momentum that they gained.

The kernels work on a list of the points that may touch (kernels/contact/block_lists.py). The block that ends last
moves the body.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, Pointwise, kernel, pointwise
from ..integrate import StepOptions
from ..threads import synchronize
from .block_lists import entry_of, list_of_block, place_in_block, sum_of_blocks
from .body_contact import FOUND, MOVED, TAKEN, Given, PointContact, taking
from .body_motion import STEP, change_motion, spin_of, vec6d, wrench
from .body_search import REMEMBERED, BodySearch

mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
# Sums over points: the upper triangle of the matrix, and the right-hand side.
Equations = wp.types.vector(length=27, dtype=wp.float64)


@wp.func
def with_row(sums: Equations, m: wp.float64, j: vec6d, side: wp.float64):
    """Add m j j^T to the matrix, and `side` times j to the right-hand side."""
    found = sums
    row = int(0)  # noqa: RUF046
    for r in range(6):
        for c in range(r, 6):
            found[row] += m * j[r] * j[c]
            row += 1
        found[21 + r] += side * j[r]
    return found


@wp.struct
class FreeBody:
    """Numbers and arrays of a free body; see kernels/contact/body_motion.py.

    changes: change of velocity and spin in the last half step. given: sums since the last frame: momentum and angular
    momentum given to the sheet, energy lost in contact, and the part of it lost by friction [J]. equations, impulses,
    counts, arrived: for `sum_of_blocks`. entries, listed: the points that may touch, and their number in each block.
    """

    mass: wp.float64
    inertia: wp.mat33d
    inverse_inertia: wp.mat33d
    gravity: wp.vec3d
    place: wp.array(dtype=wp.vec3d)
    rotation: wp.array(dtype=wp.quatd)
    motion: wp.array(dtype=wp.vec3d)
    momenta: wp.array(dtype=wp.vec3d)
    changes: wp.array(dtype=vec6d)
    given: wp.array(dtype=wp.float64)
    equations: wp.array(dtype=Equations)
    impulses: wp.array(dtype=Given)
    counts: wp.array(dtype=wp.int32)
    entries: wp.array(dtype=wp.int32)
    listed: wp.array(dtype=wp.int32)
    arrived: wp.array(dtype=wp.int32)


@wp.func
def solved(totals: Equations, body: FreeBody):
    """Change of velocity and spin by an L D L^T decomposition; R I R^T is the inertia tensor in the sheet's frame."""
    A = mat66d()
    row = int(0)  # noqa: RUF046
    for r in range(6):
        for c in range(r, 6):
            A[r, c] = totals[row]
            row += 1
    q = body.rotation[0]
    for c in range(3):
        A[c, c] = A[c, c] + body.mass
        unit = wp.vec3d()
        unit[c] = wp.float64(1.0)
        column = wp.quat_rotate(q, body.inertia * wp.quat_rotate_inv(q, unit))
        for r in range(c + 1):
            A[3 + r, 3 + c] = A[3 + r, 3 + c] + column[r]
    x = vec6d()
    for r in range(6):
        x[r] = totals[21 + r]
    for k in range(6):
        # The diagonal stores its inverse, because a division takes as long as ten products.
        inverse = wp.float64(1.0) / A[k, k]
        for r in range(k + 1, 6):
            factor = A[k, r] * inverse
            for c in range(r, 6):
                A[r, c] = A[r, c] - factor * A[k, c]
            x[r] = x[r] - factor * x[k]
        A[k, k] = inverse
    for back in range(6):
        r = 5 - back
        x[r] = x[r] * A[r, r]
        for k in range(r):
            x[k] = x[k] - A[k, r] * x[r]
    return x


@dataclass(frozen=True)
class FreeContact:
    """Kernels of one configuration, on blocks of points; see the functions of `PointContact`.

    Attributes:
        struct: The struct `a`.
        find: Lists the points that may touch; before the free body yields: finds those in contact, and solves for its
            change of motion.
        give_way: The second solution; moves the body by it.
        strike: Gives the points their impulses, subtracts these from the momentum of the body.
        take: Gives them the impulses found by kernels/contact/surface_contact.py.
    """

    struct: Any
    find: Kernel
    give_way: Kernel
    strike: Kernel
    take: Kernel


@functools.cache
def marking(search: BodySearch) -> Pointwise:
    """Pointwise stage that marks points that may touch during the step or at its end."""
    BodyContact, plane, look, near_in_step = search.struct, search.plane, search.look, search.near_in_step

    written = ("marks", "any_near", "around", *REMEMBERED)

    @pointwise(BodyContact, writes=written, rare=search.searched, local=True)
    def mark(begin: int, end: int, a: BodyContact):
        here = plane(a)
        step = a.counts[STEP]
        for i in range(begin, end):
            near = bool(False)
            if look(i, step, a):
                near = near_in_step(i, a, here)
            a.marks[i] = wp.where(near, wp.uint8(1), wp.uint8(0))
            if near:
                a.any_near[0] = 1

    return mark


@functools.cache
def finding(of: PointContact) -> tuple[wp.Function, wp.Function]:
    """Functions of a point, in a step and at its end -> speed into the body that it has to lose; -1 for none."""
    BodyContact, position, slipping, rubs = of.search.struct, of.search.position, of.slipping, of.rubs
    touch_in_step, touch_now = of.search.touch_in_step, of.search.touch_now
    freed, freedom = of.search.freed, of.search.freedom

    @wp.func
    def find_inside(i: int, a: BodyContact):
        needed = wp.float64(-1.0)
        touches, n, shift, _pressed, arm = touch_in_step(i, a)
        if touches:
            needed = freedom(i, n, a) * wp.length(shift) / wp.float64(a.step[0])
            a.rows[i] = wrench(n, arm)
            if wp.static(rubs):
                a.arms[i] = arm
                a.slips[i] = slipping(wp.vec3d(a.velocity[i]), arm, position(i, a) + freed(i, shift, a) - a.place[0], a)
        a.need[i] = needed
        return needed

    @wp.func
    def find_touching(i: int, a: BodyContact):
        needed = wp.float64(-1.0)
        x = position(i, a)
        touches, n = touch_now(i, x, a)
        # A point that does not touch has no normal.
        row = vec6d()
        if touches:
            arm = x - a.place[0]
            relative = slipping(wp.vec3d(a.velocity[i]), arm, arm, a)
            approach = -wp.dot(relative, n)
            if approach > wp.float64(0.0):
                needed = approach
            row = wrench(n, arm)
            if wp.static(rubs):
                a.arms[i] = arm
                a.slips[i] = relative
        a.rows[i] = row
        a.need[i] = needed
        return needed

    return find_inside, find_touching


@functools.cache
def free_contact(of: PointContact, options: StepOptions, rubs: bool) -> FreeContact:
    """Kernels of a free body, after the drift or `at_end` of a step; `options` and `rubs` as for `of`.

    Both share kernels, whose compilation takes longest of all on a GPU.
    """
    damped, tracked = options.damped, options.tracked
    BodyContact, freedom = of.search.struct, of.search.freedom
    find_inside, find_touching = finding(of)
    project, separate, take_in_step, take_at_end = of.project, of.separate, taking(of, False), taking(of, True)
    sum_equations, sum_given = sum_of_blocks(Equations), sum_of_blocks(Given)
    solving = ("body.changes", "body.equations", "body.counts", "body.arrived")
    lost = ("body.motion", "body.momenta", "body.given", "body.impulses", "body.counts", "body.arrived")

    @wp.func
    def yields_far(a: BodyContact):
        """Whether a free body has yielded so far in a step that points without a mark may touch it."""
        d = a.yielded[0]
        # Place and way of the body have changed, and it has turned about a centre that is two radii away at most.
        turned = wp.float64(2.0) * a.radius * wp.length(wp.vec3d(d[3], d[4], d[5]))
        moved = wp.float64(a.step[0]) * (wp.length(wp.vec3d(d[0], d[1], d[2])) + turned)
        return wp.float64(2.0) * moved > a.slack

    @wp.func
    def weight(a: BodyContact, at_end: int):
        found = wp.float64(1.0)
        if wp.static(damped):
            if at_end != 0:
                # The second half kick has divided velocities by 1 + c dt / 2; impulses count before this division.
                found += wp.float64(0.5) * wp.float64(a.step[0]) * wp.float64(a.damping[0])
        return found

    @wp.func
    def give(totals: Given, body: FreeBody):
        """Subtract the impulses from the momentum of the body."""
        linear = wp.vec3d(totals[0], totals[1], totals[2])
        turn = wp.vec3d(totals[3], totals[4], totals[5])
        before = body.momenta[0]
        spin_before = spin_of(body.rotation[0], body.inverse_inertia, body.momenta[1])
        velocity = before - linear / body.mass
        angular = body.momenta[1] - turn
        spin = spin_of(body.rotation[0], body.inverse_inertia, angular)
        body.momenta[0] = velocity
        body.momenta[1] = angular
        body.motion[0] = velocity
        body.motion[1] = spin
        for c in range(6):
            body.given[c] = body.given[c] + totals[c]
        if wp.static(tracked):
            half = wp.float64(0.5)
            moved = body.momenta[2] + half * (velocity - before)
            turned = body.momenta[3] + half * (spin - spin_before)
            body.given[6] = body.given[6] + wp.dot(linear, moved) + wp.dot(turn, turned) - totals[6]
            if wp.static(rubs):
                rubbing = wp.vec3d(totals[7], totals[8], totals[9])
                twist = wp.vec3d(totals[10], totals[11], totals[12])
                body.given[7] = body.given[7] + wp.dot(rubbing, moved) + wp.dot(twist, turned) - totals[13]
        # Later contacts of this half step start from the changed velocities.
        body.momenta[2] = body.momenta[2] + velocity - before
        body.momenta[3] = body.momenta[3] + spin - spin_before

    @wp.func
    def find(part: int, lane: int, a: BodyContact, body: FreeBody, block: int, at_end: int):
        """Find what the points of a block must lose; their number, and the sums of the first solution."""
        count = wp.int32(0)
        sums = Equations()
        for k in range(lane, body.listed[part], wp.block_dim()):
            i = body.entries[part * block + k]
            needed = wp.float64(-1.0)
            if at_end != 0:
                needed = find_touching(i, a)
            else:
                needed = find_inside(i, a)
            if needed >= wp.float64(0.0):
                count += 1
                j = a.rows[i]
                m = weight(a, at_end) * wp.float64(a.mass[i]) / freedom(i, wp.vec3d(j[0], j[1], j[2]), a)
                sums = with_row(sums, m, j, -m * needed)
        return count, sums

    @wp.func
    def press(part: int, lane: int, a: BodyContact, body: FreeBody, block: int, at_end: int):
        """Number of points of a block, and the sums of the second solution."""
        count = wp.int32(0)
        sums = Equations()
        d = body.changes[0]
        for k in range(lane, body.listed[part], wp.block_dim()):
            i = body.entries[part * block + k]
            if a.need[i] >= wp.float64(0.0):
                j = a.rows[i]
                speed_left = a.need[i] + wp.dot(j, d)
                if speed_left > wp.float64(0.0):
                    count += 1
                    n = wp.vec3d(j[0], j[1], j[2])
                    free = freedom(i, n, a)
                    m = weight(a, at_end) * wp.float64(a.mass[i])
                    sums = with_row(sums, m / free, j, -m / free * a.need[i])
                    if wp.static(rubs):
                        arm = a.arms[i]
                        slip = a.slips[i] - wp.vec3d(d[0], d[1], d[2]) - wp.cross(wp.vec3d(d[3], d[4], d[5]), arm)
                        slip -= wp.dot(slip, n) * n
                        speed = wp.length(slip)
                        most = a.friction * speed_left / free
                        if speed > most:
                            sums = with_row(sums, wp.float64(0.0), wrench(slip, arm), m * most / speed)
                        else:
                            for c in range(3):
                                unit = wp.vec3d()
                                unit[c] = wp.float64(1.0)
                                unit -= n[c] * n
                                sums = with_row(sums, m, wrench(unit, arm), m * wp.dot(unit, a.slips[i]))
        return count, sums

    @wp.func
    def strike(part: int, lane: int, a: BodyContact, body: FreeBody, block: int, at_end: int):
        """Give the points of a block their impulses; their number, and the sums."""
        count = wp.int32(0)
        sums = Given()
        number = body.listed[part]
        everywhere = bool(False)
        if at_end == 0:
            everywhere = yields_far(a)
            if everywhere:
                number = block
        for k in range(lane, number, wp.block_dim()):
            i = body.entries[part * block + k]
            if everywhere:
                i = entry_of(part, k, body.listed.shape[0])
            if i < a.marks.shape[0]:
                body.entries[part * block + k] = i
                count += 1
                if at_end != 0:
                    sums += separate(i, a)
                else:
                    sums += project(i, a)
        if everywhere:
            # The last entries of a block may lie beyond the last point.
            number = wp.tile_sum(wp.tile(count))[0]
            if lane == 0:
                body.listed[part] = number
        return count, sums

    @wp.func
    def move(sums: Equations, a: BodyContact, body: FreeBody, at_end: int):
        change = solved(sums, body)
        body.changes[0] = change
        change_motion(change, at_end, wp.float64(a.step[0]), body.place, body.rotation, body.motion)

    @wp.func
    def kick(a: BodyContact, body: FreeBody):
        """The second half kick of the body; its force is known."""
        velocity = body.momenta[0] + (wp.float64(0.5) * wp.float64(a.step[0])) * body.gravity
        body.momenta[0] = velocity
        body.momenta[2] = velocity
        body.momenta[3] = body.motion[1]
        body.motion[0] = velocity

    found = tuple(f"a.{name}" for name in FOUND)
    placed = ("body.place", "body.rotation", "body.motion")
    struck = (*(f"a.{name}" for name in MOVED), "body.entries", "body.listed")

    @kernel(per="block", writes=(*found, *solving, "body.entries", "body.listed"))
    def find_contact(a: BodyContact, body: FreeBody, block: int, at_end: int, first: int):
        if a.any_near[0] != 0:
            part, lane = place_in_block(wp.tid() + first)
            if at_end == 0:
                list_of_block(a.marks, block, part, lane, body.entries, body.listed)
                synchronize()
            count, sums = find(part, lane, a, body, block, at_end)
            ends, sums = sum_equations(sums, count, part, lane, body.equations, body.counts, body.arrived)
            if ends and lane == 0:
                body.changes[0] = solved(sums, body)

    @kernel(per="block", writes=(*placed, *solving))
    def give_way(a: BodyContact, body: FreeBody, block: int, at_end: int, first: int):
        if a.any_near[0] != 0:
            part, lane = place_in_block(wp.tid() + first)
            count, sums = press(part, lane, a, body, block, at_end)
            ends, sums = sum_equations(sums, count, part, lane, body.equations, body.counts, body.arrived)
            if ends and lane == 0:
                move(sums, a, body, at_end)

    @kernel(per="block", writes=(*struck, *lost))
    def strike_points(a: BodyContact, body: FreeBody, block: int, at_end: int, first: int):
        part, lane = place_in_block(wp.tid() + first)
        ends = part == 0
        if a.any_near[0] != 0:
            count, sums = strike(part, lane, a, body, block, at_end)
            ends, sums = sum_given(sums, count, part, lane, body.impulses, body.counts, body.arrived)
            if ends and lane == 0:
                give(sums, body)
        if at_end == 0 and ends and lane == 0:
            kick(a, body)

    @kernel(per="block", writes=(*(f"a.{name}" for name in TAKEN), *lost))
    def take_impulses(a: BodyContact, body: FreeBody, block: int, at_end: int, first: int):
        part, lane = place_in_block(wp.tid() + first)
        count = wp.int32(0)
        sums = Given()
        for k in range(lane, block, wp.block_dim()):
            i = entry_of(part, k, body.listed.shape[0])
            if i < a.changes.shape[0]:
                got = Given()
                if at_end != 0:
                    got = take_at_end(i, a)
                else:
                    got = take_in_step(i, a)
                if wp.length_sq(got) > wp.float64(0.0):
                    count += 1
                    sums += got
        ends, sums = sum_given(sums, count, part, lane, body.impulses, body.counts, body.arrived)
        if ends and lane == 0:
            give(sums, body)

    return FreeContact(BodyContact, find_contact, give_way, strike_points, take_impulses)
