"""Search for the points of a sheet that touch a rigid body, and their ways out of it.

The geometry is in float64. Where computing the distance takes a search, points remember where the surface is
(kernels/contact/mesh_distance.py), and those that are clear of it are not near.

A support may hold some components of a point, such as those normal to a plane of symmetry. The body then moves the
point along the part of its normal n in which the point is free, P n. The impulse is lambda n, as without friction it
must be: its free part moves the point, so that n yields by |P n|^2 lambda / m, and the support takes the rest. Points
that are nearly held along n, with |P n|^2 below `LEAST`, ignore the body, as do those without a free component.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import NEAR_BLOCK
from ..numeric import numeric
from .body_motion import MOVES, SEARCH, SLOW, vec6d
from .distances import TRIES, BodyShape, of_any_point, plane_distance, ways_out
from .mesh_distance import is_clear, look_around

# Least squared length of the free part of a normal, 5.7 degrees off a held direction.
LEAST = wp.constant(wp.float64(0.01))


@wp.func
def ignores(held: wp.uint8):
    """Whether a point with these held bits has no free component, or is in a rigid inclusion (kernels/integrate.py)."""
    return (wp.int32(held) & 15) >= 7


@wp.func
def free_part(held: wp.uint8, v: wp.vec3d):
    """A vector without its held components."""
    found = v
    for c in range(3):
        if (wp.int32(held) >> c) & 1 == 1:
            found[c] = wp.float64(0.0)
    return found


@wp.func
def freedom(held: wp.uint8, n: wp.vec3d):
    """Squared length of the free part of a unit vector; exactly 1 if nothing is held, 0 if too little is free."""
    found = wp.float64(1.0)
    if (wp.int32(held) & 7) != 0:
        found = wp.length_sq(free_part(held, n))
        if found < LEAST:
            found = wp.float64(0.0)
    return found


# Members of the struct in which points remember a mesh.
REMEMBERED = ("body.seen", "body.faces", "body.apart")


@dataclass(frozen=True)
class BodySearch:
    """Struct and Warp functions of one configuration; `a` is the struct.

    Attributes:
        struct: Arrays and numbers of a body.
        position: (i, a) -> position of a point [m].
        surface_velocity: (arm, a) -> velocity of the body at an arm from its centre [m/s].
        plane: a -> normal (components 1 to 3, in the coordinates of the sheet) and height (4) of a half space; zero for
            other shapes.
        look: (i, step, a) -> whether to look how near a point is in this step, after the drift.
        may_touch_in_step: (i, a, plane) -> whether a point may touch within the step, after the drift.
        may_touch_now: (i, a, plane) -> whether it may touch at the end of the step.
        touch_in_step: (i, x, a) -> results of `way_out` but the last, in the coordinates of the sheet, and the arm at
            which the body pushes the point. The free part of the shift brings it to the surface.
        push_out: (i, x, n, reach, a) -> shift along n whose free part brings a point at x to the surface.
        touch_now: (i, x, a) -> whether a point at x touches, and the normal.
        freed: (i, v, a) -> free part of a vector.
        freedom: (i, n, a) -> squared length of the free part of a normal.
        near_in_step: (i, a, plane) -> the same as `may_touch_in_step`, whether or not points are marked.
        searched: Whether the distance takes a search.
    """

    struct: Any
    position: wp.Function
    surface_velocity: wp.Function
    plane: wp.Function
    look: wp.Function
    may_touch_in_step: wp.Function
    may_touch_now: wp.Function
    touch_in_step: wp.Function
    push_out: wp.Function
    touch_now: wp.Function
    freed: wp.Function
    freedom: wp.Function
    near_in_step: wp.Function
    searched: bool


@functools.cache
def placed_at(bits: int, curved: bool) -> wp.Function:
    """Function (origin, reference position from there, displacement) -> position in float64 [m].

    `curved`: the reference position has a z.
    """
    types = numeric(bits)
    vec3, reference = types.vec3, types.vec3 if curved else types.vec2

    @wp.func
    def placed(origin: wp.vec3d, X: reference, u: vec3):
        if wp.static(curved):
            return wp.vec3d(u) + wp.vec3d(X) + origin
        else:
            return wp.vec3d(u) + wp.vec3d(wp.float64(X[0]), wp.float64(X[1]), wp.float64(0.0)) + origin

    return placed


@functools.cache
def body_search(
    bits: int, shape: wp.Function, curved: bool, held: bool, partly: bool, remembering: wp.Function | None, marked: bool
) -> BodySearch:  # fmt: skip
    """Struct and functions of a body; arguments as for `point_contact` (kernels/contact/body_contact.py)."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    searched = remembering is not None
    distance = remembering or of_any_point(shape)
    out = ways_out(distance)
    way_out, pushed_out = out.way_out, out.pushed_out
    flat = shape is plane_distance
    placed, size = placed_at(bits, curved), NEAR_BLOCK

    @wp.struct
    class BodyContact:
        reference: wp.array(dtype=vec3 if curved else types.vec2)
        origin: wp.vec3d
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        body: BodyShape
        radius: wp.float64
        skin: wp.float64
        slack: wp.float64
        friction: wp.float64
        place: wp.array(dtype=wp.vec3d)
        rotation: wp.array(dtype=wp.quatd)
        motion: wp.array(dtype=wp.vec3d)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        work: wp.array(dtype=wp.float64)
        dissipated: wp.array(dtype=wp.float64)
        impulse: wp.array(dtype=vec3)
        turn: wp.array(dtype=vec3)
        loss: wp.array(dtype=wp.float64)
        rubbed: wp.array(dtype=wp.float64)
        marks: wp.array(dtype=wp.uint8)
        need: wp.array(dtype=wp.float64)
        rows: wp.array(dtype=vec6d)
        arms: wp.array(dtype=wp.vec3d)
        slips: wp.array(dtype=wp.vec3d)
        yielded: wp.array(dtype=vec6d)
        any_near: wp.array(dtype=wp.int32)
        near: wp.array(dtype=wp.int32)
        counts: wp.array(dtype=wp.int32)
        around: wp.array(dtype=wp.int32)
        margin: wp.float64
        changes: wp.array(dtype=wp.vec3d)
        rubbing: wp.array(dtype=wp.vec3d)

    @wp.func
    def position(i: int, a: BodyContact):
        return placed(a.origin, a.reference[i], a.displacement[i])

    @wp.func
    def feels(i: int, a: BodyContact):
        if wp.static(partly):
            return not ignores(a.held_mask[i])
        elif wp.static(held):
            return a.held_mask[i] == wp.uint8(0)
        else:
            return bool(True)

    @wp.func
    def freed(i: int, v: wp.vec3d, a: BodyContact):
        if wp.static(partly):
            return free_part(a.held_mask[i], v)
        else:
            return v

    @wp.func
    def freedom_along(i: int, n: wp.vec3d, a: BodyContact):
        if wp.static(partly):
            return freedom(a.held_mask[i], n)
        else:
            return wp.float64(1.0)

    @wp.func
    def surface_velocity(arm: wp.vec3d, a: BodyContact):
        return a.motion[0] + wp.cross(a.motion[1], arm)

    @wp.func
    def way(i: int, a: BodyContact):
        """Positions of a point after and before the drift, in the frame of the body."""
        x = position(i, a)
        moved = wp.float64(a.step[0]) * wp.vec3d(a.velocity[i])
        a1 = wp.quat_rotate_inv(a.rotation[0], x - a.place[0])
        return a1, wp.quat_rotate_inv(a.rotation[1], x - moved - a.place[1])

    @wp.func
    def plane(a: BodyContact):
        found = wp.vec4d()
        if wp.static(flat):
            n = wp.quat_rotate(a.rotation[0], wp.vec3d(a.body.size[0], a.body.size[1], a.body.size[2]))
            found = wp.vec4d(n[0], n[1], n[2], wp.dot(n, a.place[0]))
        return found

    @wp.func
    def height(i: int, a: BodyContact, plane: wp.vec4d):
        return wp.dot(wp.vec3d(plane[0], plane[1], plane[2]), position(i, a)) - plane[3]

    @wp.func
    def in_margin(i: int, a: BodyContact):
        """Whether a point is so near a bounded body that it may touch it before the next search."""
        dt = wp.float64(a.step[0])
        reach = dt * wp.length(wp.vec3d(a.velocity[i])) + wp.length(a.place[0] - a.place[1]) + a.skin + a.margin
        reach += a.radius * dt * wp.length(a.motion[1])
        arm = position(i, a) - a.place[0]
        near = wp.length(arm) < a.radius + reach
        if wp.static(searched):
            if near:
                near = look_around(i, wp.quat_rotate_inv(a.rotation[0], arm), reach, a.body)
        return near

    @wp.func
    def near_in_step(i: int, a: BodyContact, plane: wp.vec4d):
        """Whether a point may touch during the step."""
        near = feels(i, a)
        if wp.static(flat):
            # A plane has no end: points far above it are told by their height, without roots.
            above = height(i, a, plane) - wp.length(a.place[0] - a.place[1]) - wp.float64(2.0) * a.skin
            v = wp.vec3d(a.velocity[i])
            moved = wp.float64(a.step[0]) * wp.float64(a.step[0]) * wp.dot(v, v)
            still = wp.dot(a.motion[1], a.motion[1]) == wp.float64(0.0)
            if still and above > wp.float64(0.0) and above * above > moved:
                near = False
        elif near:
            dt = wp.float64(a.step[0])
            reach = dt * wp.length(wp.vec3d(a.velocity[i])) + wp.length(a.place[0] - a.place[1]) + a.skin
            reach += a.slack
            reach += a.radius * (wp.float64(1.0) + dt * wp.length(a.motion[1]))
            near = wp.length(position(i, a) - a.place[0]) < reach
            if wp.static(searched):
                if near:
                    a1, a0 = way(i, a)
                    near = not is_clear(a.body.seen[i], a1, wp.length(a1 - a0) + wp.float64(2.0) * a.skin + a.slack)
        return near

    @wp.func
    def near_now(i: int, a: BodyContact, plane: wp.vec4d):
        """Whether a point may touch at the end of the step."""
        near = feels(i, a)
        if wp.static(flat):
            if height(i, a, plane) > wp.float64(2.0) * a.skin:
                near = False
        elif near:
            arm = position(i, a) - a.place[0]
            near = wp.length(arm) < a.radius + a.skin
            if wp.static(searched):
                if near:
                    here = wp.quat_rotate_inv(a.rotation[0], arm)
                    near = not is_clear(a.body.seen[i], here, wp.float64(2.0) * a.skin)
        return near

    @wp.func
    def may_touch_in_step(i: int, a: BodyContact, plane: wp.vec4d):
        if wp.static(marked):
            return a.marks[i] != wp.uint8(0)
        else:
            return near_in_step(i, a, plane)

    @wp.func
    def may_touch_now(i: int, a: BodyContact, plane: wp.vec4d):
        if wp.static(marked):
            return a.marks[i] != wp.uint8(0)
        else:
            return near_now(i, a, plane)

    @wp.func
    def slid(i: int, arm: wp.vec3d, along: wp.vec3d, begin: wp.float64, reach: wp.float64, a: BodyContact):
        """Way along a direction [m] from an arm to the surface by Newton's method, which begins with a guess."""
        far = begin
        again = wp.int32(0)
        while again < wp.static(TRIES):
            left = distance(i, arm + far * along, reach + far, a.body)
            steep = wp.dot(wp.vec3d(left[0], left[1], left[2]), along)
            again += 1
            if wp.abs(left[3]) < wp.float64(1e-3) * a.skin or steep * steep < LEAST:
                again = wp.static(TRIES)
            else:
                far = wp.max(far - left[3] / steep, wp.float64(0.0))
        return far

    @wp.func
    def touch_in_step(i: int, a: BodyContact):
        """`way_out` of a point after the drift and the arm at which the body pushes it, in the sheet's frame."""
        a1, a0 = way(i, a)
        reach = wp.length(a1 - a0) + wp.float64(2.0) * a.skin
        end = distance(i, a1, reach, a.body)
        q = a.rotation[0]
        turn = wp.quat_inverse(q) * a.rotation[1]
        touches, n, shift, pressed, of_start = way_out(i, a0, a1, end, turn, reach, a.body, a.skin)
        arm = wp.quat_rotate(q, a1 + shift)
        if wp.static(partly):
            if touches and a.held_mask[i] != wp.uint8(0):
                m = wp.quat_rotate(q, n)
                free = freedom(a.held_mask[i], m)
                touches = free > wp.float64(0.0)
                if touches:
                    root = wp.sqrt(free)
                    along = free_part(a.held_mask[i], m) / root
                    far = wp.dot(shift, n) / root
                    if far > wp.float64(0.0):
                        far = slid(i, a1, wp.quat_rotate_inv(q, along), far, reach, a)
                    shift = (far / root) * n
                    pressed = pressed / free
                    arm = wp.quat_rotate(q, a1) + far * along
        if of_start:
            arm = wp.quat_rotate(a.rotation[1], a0)
        return touches, wp.quat_rotate(q, n), wp.quat_rotate(q, shift), pressed, arm

    @wp.func
    def push_out(i: int, x: wp.vec3d, n: wp.vec3d, reach: wp.float64, a: BodyContact):
        """The shift along n whose free part brings a point at x to the surface; zero for a point outside."""
        q = a.rotation[0]
        arm = wp.quat_rotate_inv(q, x - a.place[0])
        end = distance(i, arm, reach, a.body)
        if wp.static(partly):
            if a.held_mask[i] != wp.uint8(0):
                far = wp.float64(0.0)
                root = wp.sqrt(freedom(a.held_mask[i], n))
                if end[3] < wp.float64(0.0):
                    along = wp.quat_rotate_inv(q, free_part(a.held_mask[i], n) / root)
                    far = slid(i, arm, along, far, reach, a)
                return (far / root) * n
        return wp.quat_rotate(q, pushed_out(i, arm, wp.quat_rotate_inv(q, n), end, reach, a.body, a.skin))

    @wp.func
    def touch_now(i: int, x: wp.vec3d, a: BodyContact):
        """Whether a point touches, and the normal there."""
        q = a.rotation[0]
        found = distance(i, wp.quat_rotate_inv(q, x - a.place[0]), wp.float64(2.0) * a.skin, a.body)
        n = wp.quat_rotate(q, wp.vec3d(found[0], found[1], found[2]))
        touches = found[3] < a.skin
        if wp.static(partly):
            touches = touches and freedom(a.held_mask[i], n) > wp.float64(0.0)
        return touches, n

    @wp.func
    def look(i: int, step: int, a: BodyContact):
        """Whether to look how near a point is in this step."""
        if a.margin == wp.float64(0.0):
            return True
        # All loads come first, as those behind a condition would wait for one another.
        last = a.counts[SEARCH]
        around = a.around[i / size]
        moves = a.counts[MOVES]
        v = wp.vec3(a.velocity[i])
        dt = wp.float32(a.step[0])
        slow = SLOW * a.margin
        looks = around >= last or moves != 0
        if last == step:
            if in_margin(i, a):
                a.around[i / size] = step
            looks = True
        elif not looks and dt * dt * wp.dot(v, v) > wp.float32(slow * slow):
            a.around[i / size] = step
            looks = True
        return looks

    return BodySearch(
        BodyContact, position, surface_velocity, plane, look, may_touch_in_step, may_touch_now, touch_in_step,
        push_out, touch_now, freed, freedom_along, near_in_step, searched,
    )  # fmt: skip
