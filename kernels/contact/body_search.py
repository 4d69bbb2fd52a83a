"""Rigid bodies for contact: the struct of their arrays, and the search for points near enough to touch.

Where computing the distance takes a search, points remember where the surface is (kernels/contact/mesh_distance.py),
and those that are clear of it are not near.

For free bodies a cheap stage, merged with others into one launch, marks the points that may touch; separate launches
project and separate the marked points.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import NEAR_BLOCK
from ..numeric import numeric
from .body_motion import MOVES, SEARCH, SLOW, vec6d
from .distances import BodyShape, of_any_point, plane_distance, ways_out
from .mesh_distance import is_clear, look_around

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
            which the body pushes the point.
        push_out: (i, x, n, reach, a) -> shift along n that brings a point at x to the surface.
        touch_now: (i, x, a) -> whether a point at x touches, and the normal.
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
    near_in_step: wp.Function
    searched: bool


@functools.cache
def placed_at(bits: int, curved: bool) -> wp.Function:
    """Function (reference position, displacement) -> position in float64 [m]; `curved`: the first has a z."""
    types = numeric(bits)
    vec3, reference = types.vec3, types.vec3 if curved else types.vec2

    @wp.func
    def placed(X: reference, u: vec3):
        if wp.static(curved):
            return wp.vec3d(u) + wp.vec3d(X)
        else:
            return wp.vec3d(u) + wp.vec3d(wp.float64(X[0]), wp.float64(X[1]), wp.float64(0.0))

    return placed


@functools.cache
def body_search(
    bits: int, shape: wp.Function, curved: bool, held: bool, remembering: wp.Function | None, marked: bool
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
        return placed(a.reference[i], a.displacement[i])

    @wp.func
    def feels(i: int, a: BodyContact):
        if wp.static(held):
            return a.held_mask[i] == wp.uint8(0)
        else:
            return bool(True)

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
    def touch_in_step(i: int, a: BodyContact):
        """`way_out` of a point after the drift and the arm at which the body pushes it, in the sheet's frame."""
        a1, a0 = way(i, a)
        reach = wp.length(a1 - a0) + wp.float64(2.0) * a.skin
        end = distance(i, a1, reach, a.body)
        q = a.rotation[0]
        turn = wp.quat_inverse(q) * a.rotation[1]
        touches, n, shift, pressed, of_start = way_out(i, a0, a1, end, turn, reach, a.body, a.skin)
        arm = wp.quat_rotate(q, a1 + shift)
        if of_start:
            arm = wp.quat_rotate(a.rotation[1], a0)
        return touches, wp.quat_rotate(q, n), wp.quat_rotate(q, shift), pressed, arm

    @wp.func
    def push_out(i: int, x: wp.vec3d, n: wp.vec3d, reach: wp.float64, a: BodyContact):
        """The shift along n that brings a point at x to the surface; zero for a point outside."""
        q = a.rotation[0]
        arm = wp.quat_rotate_inv(q, x - a.place[0])
        end = distance(i, arm, reach, a.body)
        return wp.quat_rotate(q, pushed_out(i, arm, wp.quat_rotate_inv(q, n), end, reach, a.body, a.skin))

    @wp.func
    def touch_now(i: int, x: wp.vec3d, a: BodyContact):
        """Whether a point touches, and the normal there."""
        q = a.rotation[0]
        found = distance(i, wp.quat_rotate_inv(q, x - a.place[0]), wp.float64(2.0) * a.skin, a.body)
        return found[3] < a.skin, wp.quat_rotate(q, wp.vec3d(found[0], found[1], found[2]))

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
        push_out, touch_now, near_in_step, searched,
    )  # fmt: skip
