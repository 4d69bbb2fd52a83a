"""Contact of the triangles of a sheet with a rigid body that is thin or has edges.

A body has segments with a radius: the axis of a sphere or capsule, or the convex edges of a box or mesh with a thin
layer around them. kernels/contact/body_contact.py handles points of the sheet against faces of the body. This module
handles the other two pairs: an end of a segment and a triangle, and a segment and a side of a triangle. A triangle has
one constraint for each pair that is near at the beginning of a half step: its point nearest to the segment, with
barycentric weights b, stays at least the radius away along the initial normal n (the position constraint of RATTLE, as
in kernels/contact/body_contact.py). The impulse on the triangle is lambda n, and each corner gets b lambda n. So
action equals reaction, and the work of a corner is computed like that of any point. A free body yields to the sum of
all impulses in every iteration.

The impulses are found by the Jacobi method, projected onto lambda >= 0, with Nesterov momentum, because a thin tip in a
cone of triangles presses on all of them, and their impulses nearly cancel. Points, and a free body, divide their mass
among the constraints that press on them, so that none overshoots (Tonge, Benevolenski and Voroshilov, Mass splitting
for jitter-free parallel rigid body simulation, ACM Trans. Graph. 31, 2012). Points gather from their triangles in a
fixed order.

The distance of a pair has no sign; the normal at the beginning of the step tells whether a triangle has passed a
segment. A pair counts only if no other part of the body is nearer to that point of the triangle.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..integrate import StepOptions
from ..numeric import numeric
from .block_lists import place_in_block, sum_of_blocks
from .body_motion import change_motion, spin_of, vec6d, wrench
from .body_search import free_part, freedom, ignores, placed_at
from .distances import TINY, BodyShape
from .narrow_phase import Segments, box_around, nearest_pair, passes_through

# Fraction of the initial depth that a step removes; removing more would turn depth into velocity.
MENDED = wp.constant(wp.float64(0.2))
# Maximum number of constraints of a triangle; the nearest pairs are kept.
SLOTS = 4
# A segment is the nearest part of a body if the distance to the body is at least this fraction of that to the segment.
NEAREST = wp.constant(wp.float64(0.999))

# Force and torque of impulses on a body, and number of constraints that press on it.
Reaction = wp.types.vector(length=7, dtype=wp.float64)


@dataclass(frozen=True)
class SurfaceContact:
    """Structs and kernels of one configuration.

    Attributes:
        struct: Arrays and numbers of a sheet and a body.
        constraints: Arrays of the constraints of triangles, SLOTS for each.
        mark: Marks triangles that may come near the segments in a half step.
        find: Finds the constraints of these triangles at the beginning of the half step.
        press: Computes the impulses of the next iteration.
        react: Computes the change of velocity and spin of a free body by the impulses.
        move: Applies this change to the motion of the body and, during the step, to its position.
        spread: Computes the velocity changes of the corners of these triangles.
        clear: Resets the flag that any triangle is near, after the last launch that needs it.
    """

    struct: Any
    constraints: Any
    mark: Kernel
    find: Kernel
    press: Kernel
    react: Kernel
    move: Kernel
    spread: Kernel
    clear: Kernel


@functools.cache
def surface_contact(
    options: StepOptions, partly: bool, distance: wp.Function, moves_freely: bool, rubs: bool, curved: bool, torn: bool
) -> SurfaceContact:
    """Kernels of contact by triangles; arguments as for `point_contact` (kernels/contact/body_contact.py).

    `torn`: bonds can break; triangles cut by a crack have no contact.
    """
    bits, held, damped = options.bits, options.held, options.damped
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    placed = placed_at(bits, curved)
    sum_reaction = sum_of_blocks(Reaction)

    @wp.struct
    class Surface:
        reference: wp.array(dtype=vec3 if curved else types.vec2)
        origin: wp.vec3d
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        triangles: wp.array(dtype=wp.vec3i)
        intact_faces: wp.array(dtype=wp.uint8)
        segments: Segments
        body: BodyShape
        skin: wp.float64
        friction: wp.float64
        place: wp.array(dtype=wp.vec3d)
        rotation: wp.array(dtype=wp.quatd)
        motion: wp.array(dtype=wp.vec3d)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        inverse_mass: wp.float64
        inverse_inertia: wp.mat33d
        easiest_turn: wp.float64

    @wp.struct
    class Constraints:
        """Constraints of triangles, and the triangles of each point.

        near: number of constraints of each triangle. weights: weights of the corners, and the smallest allowed gap [m].
        normals: in the frame of the sheet. spots: points on the segments, in the frame of the body [m]. begins, sides:
        for point i, entries begins[i] to begins[i + 1] of sides are 3 f + k if the point is corner k of triangle f.
        """

        near: wp.array(dtype=wp.uint8)
        weights: wp.array(dtype=wp.vec4d)
        normals: wp.array(dtype=wp.vec3d)
        spots: wp.array(dtype=wp.vec3d)
        begins: wp.array(dtype=wp.int32)
        sides: wp.array(dtype=wp.int32)

    @wp.func
    def position(i: int, a: Surface):
        return placed(a.origin, a.reference[i], a.displacement[i])

    @wp.func
    def began(i: int, back: wp.float64, a: Surface):
        """Position of a point at the beginning of the half step [m]."""
        return position(i, a) - back * wp.vec3d(a.velocity[i])

    @wp.func
    def mobility(i: int, a: Surface):
        if wp.static(held):
            if ignores(a.held_mask[i]):
                return wp.float64(0.0)
        return wp.float64(1.0) / wp.float64(a.mass[i])

    @wp.func
    def freed(i: int, v: wp.vec3d, a: Surface):
        if wp.static(partly):
            return free_part(a.held_mask[i], v)
        else:
            return v

    @wp.func
    def freedom_along(i: int, n: wp.vec3d, a: Surface):
        if wp.static(partly):
            return freedom(a.held_mask[i], n)
        else:
            return wp.float64(1.0)

    @wp.func
    def in_reach(f: int, at_end: int, a: Surface):
        """Whether a triangle may come near the segments in a half step; its corners in the frame of the body when the
        half step begins, the rotation of the body then, and the distance within which a pair counts.
        """
        corners = a.triangles[f]
        # The half step began before the drift, or at the end of the step now.
        back = wp.where(at_end != 0, wp.float64(0.0), wp.float64(a.step[0]))
        when = wp.where(at_end != 0, 0, 1)
        centre = a.place[when]
        q = a.rotation[when]
        x = wp.mat33d()
        most = wp.float64(0.0)
        fast = wp.float64(0.0)
        for k in range(3):
            x[k] = wp.quat_rotate_inv(q, began(corners[k], back, a) - centre)
            most = wp.max(most, wp.length(x[k] - x[0]))
            fast = wp.max(fast, wp.length(wp.vec3d(a.velocity[corners[k]]) - a.motion[0]))
        turning = wp.length(a.motion[1]) * (a.segments.size + a.segments.radius)
        reach = a.segments.radius + a.skin + back * (fast + turning)
        return wp.length(x[0]) < reach + a.segments.size + most, x, q, reach

    @kernel(per="face")
    def mark_near(a: Surface, at_end: int, first: int, near: wp.array(dtype=wp.uint8)):
        f = wp.tid() + first
        whole = bool(True)
        if wp.static(torn):
            whole = a.intact_faces[f] != wp.uint8(0)
        if whole:
            whole, _x, _q, _reach = in_reach(f, at_end, a)
        near[f] = wp.where(whole, wp.uint8(1), wp.uint8(0))

    @kernel(per="block")
    def find_pressing(
        a: Surface, at_end: int, entries: wp.array(dtype=wp.int32), listed: wp.array(dtype=wp.int32), block: int,
        first: int, near: wp.array(dtype=wp.uint8), any_near: wp.array(dtype=wp.int32),
        weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec3d), spots: wp.array(dtype=wp.vec3d),
        pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
        gaps: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """`pushes`: the impulse of friction (three components) and that along the normal [N s]."""
        part, lane = place_in_block(wp.tid() + first)
        for number in range(lane, listed[part], wp.block_dim()):
            f = entries[part * block + number]
            count = wp.int32(0)
            _near, x, q, reach = in_reach(f, at_end, a)
            lower, upper = box_around(x, reach, a.segments)
            query = wp.bvh_query_aabb(a.segments.tree, lower, upper)
            entry = int(0)  # noqa: RUF046
            pairs = int(5)  # noqa: RUF046 - a variable, so that the loop is not unrolled
            while wp.bvh_query_next(query, entry):
                passes = passes_through(x, entry, a.segments)
                for pair in range(pairs):
                    w, spot, counts = nearest_pair(pair, x, entry, a.segments)
                    away = wp.transpose(x) * w - spot
                    gap = wp.length(away)
                    counts = counts and gap > TINY and gap < reach and not passes
                    if counts:
                        beside = distance(spot + away, wp.float64(2.0) * reach, a.body)
                        counts = beside[3] + a.segments.core >= NEAREST * gap
                    slot = count
                    if counts and count == wp.static(SLOTS):
                        slot = 0
                        for k in range(1, wp.static(SLOTS)):
                            if gaps[wp.static(SLOTS) * f + k] > gaps[wp.static(SLOTS) * f + slot]:
                                slot = k
                        counts = gap < gaps[wp.static(SLOTS) * f + slot]
                    if counts:
                        s = wp.static(SLOTS) * f + slot
                        left = (wp.float64(1.0) - MENDED) * (gap - a.segments.radius)
                        weights[s] = wp.vec4d(w[0], w[1], w[2], wp.min(left, wp.float64(0.0)))
                        normals[s] = wp.quat_rotate(q, away / gap)
                        spots[s] = spot
                        pushes[s] = wp.vec4d()
                        pressed[s] = wp.uint8(0)
                        earlier[s] = wp.float64(0.0)
                        gaps[s] = gap
                        count = wp.max(count, slot + 1)
            near[f] = wp.uint8(count)
            if count > 0:
                any_near[0] = 1

    # Not inlined, as two kernels call it for each corner.
    @wp.func(inline=False)
    def given_to(i: int, c: Constraints, pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8)):
        """Normal impulse on a point, friction impulse, and the number of constraints that press on it."""
        pushed = wp.vec3d()
        dragged = wp.vec3d()
        count = wp.int32(0)
        for at in range(c.begins[i], c.begins[i + 1]):
            f = c.sides[at] / 3
            corner = c.sides[at] - 3 * f
            for slot in range(wp.int32(c.near[f])):
                s = wp.static(SLOTS) * f + slot
                if pressed[s] != wp.uint8(0):
                    b = c.weights[s][corner]
                    push = pushes[s]
                    pushed += (b * push[3]) * c.normals[s]
                    if wp.static(rubs):
                        dragged += b * wp.vec3d(push[0], push[1], push[2])
                    if b > wp.float64(0.0):
                        count += 1
        return pushed, dragged, count

    @kernel(per="block")
    def press(
        a: Surface, at_end: int, c: Constraints, pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8),
        changes: wp.array(dtype=vec6d), splits: wp.array(dtype=wp.float64), momentum: wp.float64,
        entries: wp.array(dtype=wp.int32), listed: wp.array(dtype=wp.int32), block: int, first: int,
        pushes_after: wp.array(dtype=wp.vec4d), pressed_after: wp.array(dtype=wp.uint8),
        earlier: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """`pushes` has the impulse along the normal with its momentum, `earlier` that of the iteration without."""
        part, lane = place_in_block(wp.tid() + first)
        for number in range(lane, listed[part], wp.block_dim()):
            f = entries[part * block + number]
            if c.near[f] != wp.uint8(0):
                zero = wp.float64(0.0)
                dt = wp.float64(a.step[0])
                drift = wp.where(at_end != 0, zero, dt)
                corners = a.triangles[f]
                x = wp.mat33d()
                v = wp.mat33d()
                counts = wp.vec3i()
                for k in range(3):
                    i = corners[k]
                    pushed, dragged, count = given_to(i, c, pushes, pressed)
                    change = mobility(i, a) * freed(i, pushed + dragged, a)
                    x[k] = position(i, a) - a.place[0] + drift * change
                    v[k] = wp.vec3d(a.velocity[i]) + change
                    counts[k] = count
                for slot in range(wp.int32(c.near[f])):
                    s = wp.static(SLOTS) * f + slot
                    w = c.weights[s]
                    n = c.normals[s]
                    spot = wp.vec3d()
                    moving = wp.vec3d()
                    full = zero
                    full_slip = zero
                    sure = bool(True)
                    for k in range(3):
                        b = w[k]
                        spot += b * x[k]
                        moving += b * v[k]
                        ease = b * b * mobility(corners[k], a) * wp.float64(wp.max(counts[k], 1))
                        full += ease * freedom_along(corners[k], n, a)
                        full_slip += ease
                        sure = sure and (b == zero or counts[k] > 0)
                    on_body = wp.quat_rotate(a.rotation[0], c.spots[s])
                    relative = moving - (a.motion[0] + wp.cross(a.motion[1], spot))
                    if wp.static(moves_freely):
                        d = changes[0]
                        yielded = wp.vec3d(d[0], d[1], d[2]) + wp.cross(wp.vec3d(d[3], d[4], d[5]), on_body)
                        relative -= yielded
                        on_body += drift * yielded
                        split = wp.max(splits[0], wp.float64(1.0))
                        lever = wp.cross(on_body, n)
                        turned = wp.dot(lever, spin_of(a.rotation[0], a.inverse_inertia, lever))
                        full += split * (a.inverse_mass + turned)
                        full_slip += split * (a.inverse_mass + a.easiest_turn * wp.length_sq(on_body))
                    rate = (wp.dot(n, spot - on_body) - a.segments.radius - w[3]) / dt
                    if at_end != 0:
                        rate = wp.dot(relative, n)
                        if wp.length(spot - on_body) > a.segments.radius + a.skin:
                            rate = wp.max(rate, zero)
                    push = pushes[s]
                    much = push[3]
                    rub = wp.vec3d(push[0], push[1], push[2])
                    if sure and full > zero:
                        much = wp.max(much - rate / full, zero)
                        if wp.static(rubs):
                            rub -= (relative - wp.dot(relative, n) * n) / full_slip
                            size = wp.length(rub)
                            if size > a.friction * much:
                                rub = (a.friction * much / size) * rub
                    ahead = wp.max(much + momentum * (much - earlier[s]), zero)
                    earlier[s] = much
                    pushes_after[s] = wp.vec4d(rub[0], rub[1], rub[2], ahead)
                    pressed_after[s] = wp.where(much > zero or rate < zero, wp.uint8(1), wp.uint8(0))

    @kernel(per="block")
    def react(
        a: Surface, at_end: int, c: Constraints, pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8),
        entries: wp.array(dtype=wp.int32), listed: wp.array(dtype=wp.int32), block: int, first: int,
        sums: wp.array(dtype=Reaction), counts: wp.array(dtype=wp.int32), arrived: wp.array(dtype=wp.int32),
        changes: wp.array(dtype=vec6d), splits: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        part, lane = place_in_block(wp.tid() + first)
        number = wp.int32(0)
        total = Reaction()
        back = wp.where(at_end != 0, wp.float64(0.0), wp.float64(a.step[0]))
        centre = a.place[wp.where(at_end != 0, 0, 1)]
        for k in range(lane, listed[part], wp.block_dim()):
            f = entries[part * block + k]
            for slot in range(wp.int32(c.near[f])):
                s = wp.static(SLOTS) * f + slot
                if pressed[s] != wp.uint8(0):
                    push = pushes[s]
                    impulse = push[3] * c.normals[s] + wp.vec3d(push[0], push[1], push[2])
                    for corner in range(3):
                        i = a.triangles[f][corner]
                        if mobility(i, a) > wp.float64(0.0):
                            got = wrench(c.weights[s][corner] * impulse, began(i, back, a) - centre)
                            for r in range(6):
                                total[r] += got[r]
                    total[6] += wp.float64(1.0)
                    number += 1
        ends, total = sum_reaction(total, number, part, lane, sums, counts, arrived)
        if ends and lane == 0:
            number_pressing = total[6]
            m = a.inverse_mass
            if wp.static(damped):
                if at_end != 0:
                    # The second half kick has divided velocities by 1 + c dt / 2; impulses count before this division.
                    total *= wp.float64(1.0) + wp.float64(0.5) * wp.float64(a.step[0]) * wp.float64(a.damping[0])
            turn = spin_of(a.rotation[0], a.inverse_inertia, wp.vec3d(total[3], total[4], total[5]))
            changes[0] = -vec6d(m * total[0], m * total[1], m * total[2], turn[0], turn[1], turn[2])
            splits[0] = number_pressing

    @kernel(per="once")
    def move_body(
        at_end: int, changes: wp.array(dtype=vec6d), step: wp.array(dtype=real), first: int,
        place: wp.array(dtype=wp.vec3d), rotation: wp.array(dtype=wp.quatd), motion: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        change_motion(changes[0], at_end, wp.float64(step[0]), place, rotation, motion)

    @kernel(per="block")
    def spread(
        a: Surface, c: Constraints, pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8),
        entries: wp.array(dtype=wp.int32), listed: wp.array(dtype=wp.int32), block: int, first: int,
        changes: wp.array(dtype=wp.vec3d), rubbed: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        """Triangles that share a point write the same to it."""
        part, lane = place_in_block(wp.tid() + first)
        for k in range(lane, listed[part], wp.block_dim()):
            corners = a.triangles[entries[part * block + k]]
            for corner in range(3):
                i = corners[corner]
                pushed, dragged, _count = given_to(i, c, pushes, pressed)
                ease = mobility(i, a)
                changes[i] = ease * (pushed + dragged)
                if wp.static(rubs):
                    rubbed[i] = ease * dragged

    @kernel(per="once")
    def clear(first: int, any_near: wp.array(dtype=wp.int32), changes: wp.array(dtype=vec6d)):
        any_near[0] = 0
        if wp.static(moves_freely):
            changes[0] = vec6d()

    return SurfaceContact(Surface, Constraints, mark_near, find_pressing, press, react, move_body, spread, clear)
