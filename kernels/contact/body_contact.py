"""Contact of a sheet with a rigid body of any shape, by projection, with Coulomb friction.

After the drift, points inside the body are moved out. So are points whose path relative to the body entered it during
the step, so no point passes through the body. A point already in contact loses the velocity component into the body; a
newly arrived point is moved by its impulse (the position constraint of RATTLE). After the
second half kick, touching points lose the remaining velocity component into the body.

Friction reduces the tangential velocity relative to the surface. Its impulse is at most the friction coefficient times
the normal impulse; a point that needs less than that to stop sticks.

Work. In one step a point gets the impulses P before the drift and Q at the end. With velocities at full steps and
forces F, kinetic energy and strain energy together change by P (v + P / 2m) + Q (v' - Q / 2m), where v is the velocity
before the half kick and v' that at the end of the step; all other terms are those of central differences without
contact. Mass damping dissipates part of the impulses: `half_step` in kernels/integrate.py has the exact statement. It
holds only if the motion of a point is dt times its half-step velocity, so `project` shifts a point by dt times the
change of its velocity. Both statements are linear in the last impulse, so the loss from friction is an exact part of
the loss from contact, computed with the same velocities.

The geometry is in float64; velocity changes are applied in the precision of the sheet.

Where computing the distance takes a search, points remember where the surface is (kernels/contact/mesh_distance.py),
and those that are clear of it are not near.

For free bodies a cheap stage marks the points that may touch (kernels/contact/free_contact.py).
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import NEAR_BLOCK, Pointwise, pointwise
from ..integrate import StepOptions, half_step
from ..numeric import numeric
from .body_motion import MOVES, SEARCH, SLOW, STEP, vec6d
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


# Impulse that a point got [N s], its moment about the centre of the body, its work [J]; the same of the friction in it.
Given = wp.types.vector(length=14, dtype=wp.float64)


@dataclass(frozen=True)
class PointContact:
    """Warp functions (i, a) of a point, with the struct `a`; most return what a free body loses.

    Attributes:
        search: The struct and the search.
        project: -> Given; moves a point out of the body, after the drift.
        separate: -> Given; removes the velocity into the body, after the second half kick.
        slipping: (v, arm, end, a) -> velocity relative to the body of a point that moves from `arm` to `end`.
        strike_in_step, end_strike: -> Given; apply an impulse after the drift, and after the second half kick.
        rubs: Whether there is friction.
    """

    search: BodySearch
    project: wp.Function
    separate: wp.Function
    slipping: wp.Function
    strike_in_step: wp.Function
    end_strike: wp.Function
    rubs: bool


# Members of the struct that the functions of a `PointContact` write.
FOUND = ("need", "rows", "arms", "slips", *REMEMBERED)
STRUCK = ("velocity", "work", "dissipated", "impulse", "turn", "loss", "rubbed")
MOVED = ("displacement", *REMEMBERED, *STRUCK)
TAKEN = ("displacement", "changes", *STRUCK)


@functools.cache
def point_contact(
    options: StepOptions,
    distance: wp.Function,
    moves_freely: bool,
    rubs: bool,
    curved: bool,
    remembering: wp.Function | None,
    marked: bool,
) -> PointContact:
    """Contact of single points with a body.

    Args:
        options: Options of the step; points with a held component ignore the body.
        distance: Its signed distance, see kernels/contact/distances.py.
        moves_freely: Whether the sheet moves the body; impulses are then returned, otherwise summed per point.
        rubs: Whether there is friction.
        curved: Whether the reference positions have a z.
        remembering: Distance of points that remember the surface, for meshes.
        marked: Whether the stages act only on marked points.
    """
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    loaded, damped, tracked = options.loaded, options.damped, options.tracked
    search = body_search(options.bits, distance, curved, options.held, remembering, marked)
    BodyContact, position = search.struct, search.position
    surface_velocity, touch_in_step, touch_now = search.surface_velocity, search.touch_in_step, search.touch_now
    push_out = search.push_out
    half_kick, half_loss = half_step(options)

    @wp.func
    def arrest(relative: wp.vec3d, pressed: wp.float64, n: wp.vec3d, friction: wp.float64):
        """Change of a point's velocity by friction [m/s]; at most, sliding stops.

        relative: velocity of the point relative to the body [m/s]. pressed: change of velocity along the normal n
        by the contact [m/s].
        """
        slip = relative - wp.dot(relative, n) * n
        speed = wp.length(slip)
        least = wp.min(friction * pressed, speed)
        lost = wp.vec3d()
        if speed > wp.float64(0.0):
            lost = (-least / speed) * slip
        return lost

    @wp.func
    def strike(
        i: int, change: wp.vec3d, arrested: wp.vec3d, start: wp.vec3d, slowed: wp.vec3d, weight: real, arm: wp.vec3d,
        a: BodyContact,
    ):  # fmt: skip
        """Record the work and losses of an impulse, which is `weight` m times the velocity change.

        It does work along `start` plus half the change; damping dissipates c dt / 2 times m change . `slowed`. Friction
        is the part `arrested` of the change.
        """
        before = a.velocity[i]
        after = before + vec3(change)
        a.velocity[i] = after
        got = wp.vec3d(after) - wp.vec3d(before)
        momentum = wp.float64(weight * a.mass[i]) * got
        gained = wp.float64(0.0)
        rub = wp.float64(weight * a.mass[i]) * arrested
        warmed = wp.float64(0.0)
        if wp.static(tracked):
            mean = start + wp.float64(0.5) * got
            gained = wp.dot(momentum, mean)
            warmed = wp.dot(rub, mean)
            a.work[i] = a.work[i] + gained
            if wp.static(damped):
                lost = wp.float64(half_loss(a.step, a.damping) * a.mass[i]) * wp.dot(got, slowed)
                a.dissipated[i] = a.dissipated[i] + lost
        given = Given()
        if wp.static(moves_freely):
            moment = wp.cross(arm, momentum)
            twist = wp.cross(arm, rub)
            for c in range(3):
                given[c] = momentum[c]
                given[3 + c] = moment[c]
                given[7 + c] = rub[c]
                given[10 + c] = twist[c]
            given[6] = gained
            given[13] = warmed
        else:
            a.impulse[i] = a.impulse[i] + vec3(momentum)
            a.turn[i] = a.turn[i] + vec3(wp.cross(arm, momentum))
            if wp.static(tracked):
                passing = surface_velocity(arm, a)
                a.loss[i] = a.loss[i] + wp.dot(momentum, passing) - gained
                if wp.static(rubs):
                    a.rubbed[i] = a.rubbed[i] + wp.dot(rub, passing) - warmed
        return given

    @wp.func
    def strike_in_step(i: int, shift: wp.vec3d, change: wp.vec3d, arrested: wp.vec3d, arm: wp.vec3d, a: BodyContact):
        """`strike` after the drift; it also moves the point by `shift`, dt times the velocity change."""
        kick = half_kick(i, a.step, a.mass, a.force, a.external)
        start = wp.vec3d((a.velocity[i] - kick) / (real(1.0) - half_loss(a.step, a.damping)))
        a.displacement[i] = a.displacement[i] + vec3(shift)
        given = strike(i, change, arrested, start, start, real(1.0), arm, a)
        if wp.static(tracked and loaded):
            # The work of the load in the drift included the distance by which the point is now moved back.
            a.work[i] = a.work[i] + wp.float64(0.5) * wp.float64(a.step[0]) * wp.dot(wp.vec3d(a.external[i]), change)
        return given

    @wp.func
    def end_strike(i: int, change: wp.vec3d, arrested: wp.vec3d, arm: wp.vec3d, a: BodyContact):
        """`strike` after the second half kick; the impulse is taken before damping divides it by 1 + c dt / 2."""
        start = wp.vec3d(a.velocity[i])
        slowed = start
        weight = real(1.0)
        if wp.static(damped):
            weight += half_loss(a.step, a.damping)
            slowed = wp.vec3d(weight * a.velocity[i] - half_kick(i, a.step, a.mass, a.force, a.external))
            start -= wp.float64(real(0.5) * half_loss(a.step, a.damping)) * change
        return strike(i, change, arrested, start, slowed, weight, arm, a)

    @wp.func
    def slipping(v: wp.vec3d, arm: wp.vec3d, end: wp.vec3d, a: BodyContact):
        """Velocity relative to the body [m/s] of a point that moves from `arm` to `end` during the step."""
        return v - surface_velocity(wp.float64(0.5) * (arm + end), a)

    @wp.func
    def project(i: int, a: BodyContact):
        given = Given()
        touches, n, shift, pressed, arm = touch_in_step(i, a)
        if touches:
            dt = wp.float64(a.step[0])
            lost = wp.vec3d()
            if wp.static(rubs):
                x = position(i, a) + shift
                relative = slipping(wp.vec3d(a.velocity[i]) + shift / dt, arm, x - a.place[0], a)
                lost = arrest(relative, pressed / dt, n, a.friction)
                reach = dt * wp.length(lost) + wp.float64(2.0) * a.skin
                shift += dt * lost + push_out(i, x + dt * lost, n, reach, a)
            given = strike_in_step(i, shift, shift / dt, lost, arm, a)
        return given

    @wp.func
    def touching(i: int, x: wp.vec3d, a: BodyContact):
        """Whether a point at x touches at the end of the step, and the normal, as `find_touching` has found them."""
        if wp.static(moves_freely):
            j = a.rows[i]
            n = wp.vec3d(j[0], j[1], j[2])
            return wp.length_sq(n) > wp.float64(0.0), n
        else:
            return touch_now(i, x, a)

    @wp.func
    def separate(i: int, a: BodyContact):
        given = Given()
        x = position(i, a)
        touches, n = touching(i, x, a)
        if touches:
            arm = x - a.place[0]
            relative = slipping(wp.vec3d(a.velocity[i]), arm, arm, a)
            approach = -wp.dot(relative, n)
            if approach > wp.float64(0.0):
                change = approach * n
                lost = wp.vec3d()
                if wp.static(rubs):
                    lost = arrest(relative + change, approach, n, a.friction)
                    change += lost
                given = end_strike(i, change, lost, arm, a)
        return given

    return PointContact(search, project, separate, slipping, strike_in_step, end_strike, rubs)


@functools.cache
def body_contact(of: PointContact, at_end: bool) -> Pointwise:
    """Pointwise stage of contact with a body on a path, in a step or at its end.

    A point can touch at the end of a step only if it was near after the drift. That is noted for blocks of points, so
    that all others read nothing at the end; unless something else moves points in between. After the drift, points of
    blocks that were further away than a margin are told by their velocity until they or the body may have come nearer.
    """
    BodyContact, plane = of.search.struct, of.search.plane
    may_touch = of.search.may_touch_now if at_end else of.search.may_touch_in_step
    act_on = of.separate if at_end else of.project
    size, look = NEAR_BLOCK, of.search.look

    @pointwise(
        BodyContact,
        writes=(*STRUCK, *REMEMBERED) if at_end else (*MOVED, "near", "around"),
        rare=True,
        local=not at_end,
    )
    def strike_points(begin: int, end: int, a: BodyContact):
        here = plane(a)
        step = a.counts[STEP]
        for i in range(begin, end):
            if wp.static(at_end):
                near = a.near[i / size]
                moves = a.counts[MOVES]
                if near >= step or moves != 0:
                    if may_touch(i, a, here):
                        act_on(i, a)
            elif look(i, step, a):
                if may_touch(i, a, here):
                    a.near[i / size] = step
                    act_on(i, a)

    return strike_points


@functools.cache
def taking(of: PointContact, at_end: bool) -> wp.Function:
    """Function of a point -> Given; it applies the impulse of triangles (kernels/contact/surface_contact.py)."""
    BodyContact, position, rubs = of.search.struct, of.search.position, of.rubs
    strike_in_step, end_strike = of.strike_in_step, of.end_strike

    @wp.func
    def rubbed_of(i: int, a: BodyContact):
        if wp.static(rubs):
            return a.rubbing[i]
        else:
            return wp.vec3d()

    @wp.func
    def take_in_step(i: int, a: BodyContact):
        given = Given()
        change = a.changes[i]
        if wp.length_sq(change) > wp.float64(0.0):
            # It belongs to one half step.
            a.changes[i] = wp.vec3d()
            dt = wp.float64(a.step[0])
            arm = position(i, a) - dt * wp.vec3d(a.velocity[i]) - a.place[1]
            given = strike_in_step(i, dt * change, change, rubbed_of(i, a), arm, a)
        return given

    @wp.func
    def take_at_end(i: int, a: BodyContact):
        given = Given()
        change = a.changes[i]
        if wp.length_sq(change) > wp.float64(0.0):
            a.changes[i] = wp.vec3d()
            given = end_strike(i, change, rubbed_of(i, a), position(i, a) - a.place[0], a)
        return given

    return take_at_end if at_end else take_in_step


@functools.cache
def body_impulses(of: PointContact, at_end: bool) -> Pointwise:
    """Pointwise stage of the impulses of triangles that touch a body on a path, in a step or at its end."""
    BodyContact, take_on = of.search.struct, taking(of, at_end)

    @pointwise(BodyContact, writes=TAKEN)
    def take_impulses(begin: int, end: int, a: BodyContact):
        for i in range(begin, end):
            take_on(i, a)

    return take_impulses
