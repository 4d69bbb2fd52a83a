"""Contact of the triangles of a sheet with a rigid sphere or capsule, i.e. a point or segment with a radius.

Each nearby triangle has one constraint per half step. Take the point of the triangle nearest to the axis of the body at
the beginning of the half step, with barycentric weights b and normal n. Its distance along n must stay larger than the
radius (RATTLE, as in kernels/body_contact.py). The impulse is lambda n, and a corner gets b lambda n: action equals
reaction exactly, and the work at a corner is computed as for any point.

The impulses are found by projected Jacobi iteration (lambda >= 0) with Nesterov momentum, because convergence is slow
where a thin tip in a cone of triangles presses on all of them and their impulses nearly cancel. A point divides its
mass among the triangles that press on it, so that none overshoots (Tonge, Benevolenski and Voroshilov, Mass splitting
for jitter-free parallel rigid body simulation, ACM Trans. Graph. 31, 2012). Points gather from their triangles in a
fixed order.

The distance of a triangle has no sign. A triangle that passes the axis during a step is detected by its normal at the
beginning of the step.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .body_search import wide_places
from .distances import TINY, weights_of_nearest
from .effects import Kernel, kernel, unstaged
from .numeric import numeric

# Part of the depth at the beginning of a step that the step mends: more of it would become velocity.
MENDED = wp.constant(wp.float64(0.2))


@wp.struct
class Nearest:
    """Nearest point of a triangle to a segment: corner weights, vector from the segment, place on it (-1 to 1)."""

    weights: wp.vec3d
    away: wp.vec3d
    along: wp.float64


@wp.func
def between_segments(p: wp.vec3d, d: wp.vec3d, q: wp.vec3d, e: wp.vec3d):
    """Nearest points p + s d, |s| <= 1, and q + t e, 0 <= t <= 1: (s, t). Ericson, 2005, section 5.1.9."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    r = p - q
    dd = wp.dot(d, d)
    ee = wp.dot(e, e)
    de = wp.dot(d, e)
    dr = wp.dot(d, r)
    er = wp.dot(e, r)
    s = zero
    left = dd * ee - de * de
    if left > wp.float64(1e-12) * dd * ee:
        s = wp.clamp((de * er - dr * ee) / left, -one, one)
    t = wp.clamp((de * s + er) / ee, zero, one)
    s = wp.clamp((de * t - dr) / dd, -one, one)
    return s, t


@wp.func
def nearest_to_segment(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, axis: wp.vec3d):
    """Nearest point of a triangle to the segment from -axis to axis, or to the origin if `axis` is zero."""
    one = wp.float64(1.0)
    found = Nearest()
    if wp.length(axis) <= TINY:
        w = weights_of_nearest(wp.vec3d(), a, b, c)
        found.weights = w
        found.away = w[0] * a + w[1] * b + w[2] * c
        return found
    normal = wp.cross(b - a, c - a)
    over = wp.dot(normal, axis)
    if wp.abs(wp.dot(normal, a)) < wp.abs(over):
        s = wp.dot(normal, a) / over
        w = weights_of_nearest(s * axis, a, b, c)
        off = w[0] * a + w[1] * b + w[2] * c - s * axis
        if wp.length(off) <= wp.float64(1e-12) * (wp.length(axis) + wp.length(a)):
            found.weights = w
            found.along = s
            return found
    least = wp.float64(1e300)
    for end in range(2):
        s = wp.float64(2 * end - 1)
        w = weights_of_nearest(s * axis, a, b, c)
        away = w[0] * a + w[1] * b + w[2] * c - s * axis
        if wp.length_sq(away) < least:
            least = wp.length_sq(away)
            found.weights = w
            found.away = away
            found.along = s
    for k in range(3):
        q = a
        r = b
        if k == 1:
            q = b
            r = c
        elif k == 2:
            q = c
            r = a
        s, t = between_segments(wp.vec3d(), axis, q, r - q)
        away = q + t * (r - q) - s * axis
        if wp.length_sq(away) < least:
            least = wp.length_sq(away)
            w = wp.vec3d()
            w[k] = one - t
            w[(k + 1) % 3] = t
            found.weights = w
            found.away = away
            found.along = s
    return found


@unstaged
def distances_of_faces(
    corners: wp.array2d(dtype=wp.vec3d), axis: wp.vec3d, first: int, out: wp.array(dtype=wp.float64)
):
    """Distances [m] of triangles with corners (F, 3) from the segment between -axis and axis."""
    f = wp.tid() + first
    out[f] = wp.length(nearest_to_segment(corners[f, 0], corners[f, 1], corners[f, 2], axis).away)


@dataclass(frozen=True)
class SurfaceContact:
    """Struct and kernels of one configuration.

    Attributes:
        struct: Arrays and numbers of a sheet and a body.
        find: Constraints of nearby triangles, at the beginning of a half step.
        press: Impulses of the triangles, after one more iteration.
        spread: Velocity changes of the points from these impulses, and the number of triangles that press on each
            point.
    """

    struct: Any
    find: Kernel
    press: Kernel
    spread: Kernel


@functools.cache
def surface_contact(bits: int, rubs: bool, curved: bool, held: bool, torn: bool) -> SurfaceContact:
    """Kernels of contact of triangles.

    Args:
        bits: 32 or 64.
        rubs: Whether there is friction.
        curved: Whether the reference positions have a z.
        held: Whether any component is held; held points ignore the body.
        torn: Whether bonds can break; triangles cut by a crack have no contact.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    wide, placed = wide_places(bits, curved)

    @wp.struct
    class Surface:
        reference: wp.array(dtype=vec3 if curved else types.vec2)
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        triangles: wp.array(dtype=wp.vec3i)
        intact_faces: wp.array(dtype=wp.uint8)
        half_length: wp.float64
        radius: wp.float64
        skin: wp.float64
        friction: wp.float64
        place: wp.array(dtype=wp.vec3d)
        rotation: wp.array(dtype=wp.quatd)
        motion: wp.array(dtype=wp.vec3d)
        step: wp.array(dtype=real)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)

    @wp.func
    def position(i: int, a: Surface):
        return placed(a.reference[i], a.displacement[i])

    @wp.func
    def mobility(i: int, a: Surface):
        if wp.static(held):
            if a.held_mask[i] != wp.uint8(0):
                return wp.float64(0.0)
        return wp.float64(1.0) / wp.float64(a.mass[i])

    @wp.func
    def axis_of(q: wp.quatd, a: Surface):
        return wp.quat_rotate(q, wp.vec3d(wp.float64(0.0), wp.float64(0.0), a.half_length))

    @kernel(per="face")
    def find_pressing(
        a: Surface, at_end: int, first: int,
        weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec4d), pushes: wp.array(dtype=wp.vec4d),
        pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """`normals`: normal and place on the axis; `pushes`: friction impulse and normal impulse."""
        f = wp.tid() + first
        weights[f] = wp.vec4d()
        pushes[f] = wp.vec4d()
        earlier[f] = wp.float64(0.0)
        pressed[f] = wp.uint8(0)
        whole = bool(True)
        if wp.static(torn):
            whole = a.intact_faces[f] != wp.uint8(0)
        if whole:
            corners = a.triangles[f]
            # Where the half began: before the drift, or now.
            back = wp.where(at_end != 0, wp.float64(0.0), wp.float64(a.step[0]))
            when = wp.where(at_end != 0, 0, 1)
            centre = a.place[when]
            xa = position(corners[0], a) - back * wide(a.velocity[corners[0]]) - centre
            xb = position(corners[1], a) - back * wide(a.velocity[corners[1]]) - centre
            xc = position(corners[2], a) - back * wide(a.velocity[corners[2]]) - centre
            most = wp.max(wp.length_sq(xb - xa), wp.length_sq(xc - xa))
            va = wide(a.velocity[corners[0]]) - a.motion[0]
            vb = wide(a.velocity[corners[1]]) - a.motion[0]
            vc = wide(a.velocity[corners[2]]) - a.motion[0]
            fast = wp.sqrt(wp.max(wp.length_sq(va), wp.max(wp.length_sq(vb), wp.length_sq(vc))))
            turning = wp.length(a.motion[1]) * (a.half_length + a.radius)
            reach = a.radius + a.skin + back * (fast + turning)
            if wp.length(xa) < reach + a.half_length + wp.sqrt(most):
                axis = axis_of(a.rotation[when], a)
                near = nearest_to_segment(xa, xb, xc, axis)
                gap = wp.length(near.away)
                if gap > TINY and gap < reach:
                    n = near.away / gap
                    w = near.weights
                    left = wp.min((wp.float64(1.0) - MENDED) * (gap - a.radius), wp.float64(0.0))
                    weights[f] = wp.vec4d(w[0], w[1], w[2], left)
                    normals[f] = wp.vec4d(n[0], n[1], n[2], near.along)

    @wp.func
    def surface_velocity(arm: wp.vec3d, a: Surface):
        return a.motion[0] + wp.cross(a.motion[1], arm)

    @kernel(per="face")
    def press(
        a: Surface, at_end: int, weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec4d),
        changes: wp.array(dtype=wp.vec3d), counts: wp.array(dtype=wp.int32), momentum: wp.float64, first: int,
        pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """`pushes` has the normal impulse with Nesterov momentum, `earlier` the last one without it."""
        f = wp.tid() + first
        b = wp.vec3d(weights[f][0], weights[f][1], weights[f][2])
        if wp.length_sq(b) > wp.float64(0.0):
            zero = wp.float64(0.0)
            dt = wp.float64(a.step[0])
            along = normals[f]
            n = wp.vec3d(along[0], along[1], along[2])
            corners = a.triangles[f]
            spot = wp.vec3d()
            moving = wp.vec3d()
            ease = wp.vec3d()
            sure = bool(True)
            for k in range(3):
                i = corners[k]
                x = position(i, a) - a.place[0]
                if at_end == 0:
                    x += dt * changes[i]
                spot += b[k] * x
                moving += b[k] * (wide(a.velocity[i]) + changes[i])
                ease[k] = mobility(i, a) * wp.float64(wp.max(counts[i], 1))
                sure = sure and (b[k] == zero or counts[i] > 0)
            axis = axis_of(a.rotation[0], a)
            full = ease[0] * b[0] * b[0] + ease[1] * b[1] * b[1] + ease[2] * b[2] * b[2]
            rate = zero
            relative = moving - surface_velocity(spot, a)
            if at_end != 0:
                rate = wp.dot(relative, n)
                if wp.length(spot - along[3] * axis) > a.radius + a.skin:
                    rate = wp.max(rate, zero)
            else:
                gap = wp.dot(n, spot - along[3] * axis) - a.radius
                rate = (gap - weights[f][3]) / dt
            push = pushes[f]
            much = push[3]
            rub = wp.vec3d(push[0], push[1], push[2])
            if sure and full > zero:
                much = wp.max(much - rate / full, zero)
                if wp.static(rubs):
                    rub -= (relative - wp.dot(relative, n) * n) / full
                    size = wp.length(rub)
                    if size > a.friction * much:
                        rub = (a.friction * much / size) * rub
            ahead = wp.max(much + momentum * (much - earlier[f]), zero)
            earlier[f] = much
            pushes[f] = wp.vec4d(rub[0], rub[1], rub[2], ahead)
            pressed[f] = wp.where(much > zero or rate < zero, wp.uint8(1), wp.uint8(0))

    @kernel(per="list")
    def spread(
        a: Surface, begins: wp.array(dtype=wp.int32), sides: wp.array(dtype=wp.int32),
        weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec4d), pushes: wp.array(dtype=wp.vec4d),
        pressed: wp.array(dtype=wp.uint8), first: int,
        changes: wp.array(dtype=wp.vec3d), rubbed: wp.array(dtype=wp.vec3d), counts: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """`sides`: 3 f + k for each triangle f of a point, where k is the point's corner index in f."""
        i = wp.tid() + first
        pushed = wp.vec3d()
        dragged = wp.vec3d()
        count = wp.int32(0)
        for at in range(begins[i], begins[i + 1]):
            f = sides[at] / 3
            if pressed[f] != wp.uint8(0):
                w = weights[f]
                b = w[sides[at] - 3 * f]
                along = normals[f]
                push = pushes[f]
                pushed += (b * push[3]) * wp.vec3d(along[0], along[1], along[2])
                if wp.static(rubs):
                    dragged += b * wp.vec3d(push[0], push[1], push[2])
                if b > wp.float64(0.0):
                    count += 1
        ease = mobility(i, a)
        changes[i] = ease * (pushed + dragged)
        if wp.static(rubs):
            rubbed[i] = ease * dragged
        counts[i] = count

    return SurfaceContact(Surface, find_pressing, press, spread)
