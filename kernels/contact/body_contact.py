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

The search, and what happens to points that a support holds in some components, are in kernels/contact/body_search.py.
Velocity changes are applied in the precision of the sheet.

For free bodies a cheap stage marks the points that may touch (kernels/contact/free_contact.py).
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import NEAR_BLOCK, Pointwise, pointwise
from ..integrate import StepOptions, half_step
from ..numeric import numeric
from .body_motion import MOVES, STEP
from .body_search import REMEMBERED, BodySearch, body_search

# Largest friction of points that a support holds in some components, over their velocity of sliding and mass.
HEAVY = wp.constant(wp.float64(1e3))
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
    partly: bool,
    distance: wp.Function,
    moves_freely: bool,
    rubs: bool,
    curved: bool,
    remembering: wp.Function | None,
    marked: bool,
) -> PointContact:
    """Contact of single points with a body.

    Args:
        options: Options of the step; points without a free component ignore the body.
        partly: Whether any point has held and free components.
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
    search = body_search(options.bits, distance, curved, options.held, partly, remembering, marked)
    BodyContact, position = search.struct, search.position
    surface_velocity, touch_in_step, touch_now = search.surface_velocity, search.touch_in_step, search.touch_now
    push_out, freed, freedom = search.push_out, search.freed, search.freedom
    half_kick, half_loss = half_step(options)

    @wp.func
    def sliding(free: wp.float64, held: wp.float64, most: wp.float64):
        """Friction over the sliding velocity after it, for speeds of sliding before [m/s]: that along held components
        stays. Zero if there is none. By bisection.
        """
        low = wp.float64(0.0)
        if held > wp.float64(0.0) and most > wp.float64(0.0):
            # Round-off of what sticks is no sliding.
            high = wp.min(most / held, HEAVY)
            halving = wp.int32(0)
            while halving < 40:
                b = wp.float64(0.5) * (low + high)
                left = free / (wp.float64(1.0) + b)
                if b * b * (left * left + held * held) < most * most:
                    low = b
                else:
                    high = b
                halving += 1
        return low

    @wp.func
    def arrest(i: int, relative: wp.vec3d, pressed: wp.float64, n: wp.vec3d, a: BodyContact):
        """Change of a point's velocity by friction [m/s]; at most, sliding stops where the point is free.

        relative: velocity of the point relative to the body [m/s]. pressed: change of velocity along the normal n
        by the contact [m/s].
        """
        slip = relative - wp.dot(relative, n) * n
        speed = wp.length(slip)
        least = wp.min(a.friction * pressed, speed)
        lost = wp.vec3d()
        if speed > wp.float64(0.0):
            lost = (-least / speed) * slip
            if wp.static(partly):
                free = freed(i, slip, a)
                # What friction adds to the pressure where its free part points into the body.
                ease = freedom(i, n, a)
                left = ease - a.friction * wp.max(wp.dot(free, n), wp.float64(0.0)) / speed
                most = a.friction * pressed * ease / wp.max(left, wp.float64(0.1) * ease)
                b = sliding(wp.length(free), wp.length(slip - free), most)
                if b > wp.float64(0.0):
                    lost = b * (free - slip) - (b / (wp.float64(1.0) + b)) * free
        return lost

    @wp.func
    def strike(
        i: int, change: wp.vec3d, arrested: wp.vec3d, start: wp.vec3d, slowed: wp.vec3d, weight: real, arm: wp.vec3d,
        a: BodyContact,
    ):  # fmt: skip
        """Record the work and losses of an impulse, which is `weight` m times the velocity change of a free point.

        It does work along `start` plus half the change; damping dissipates c dt / 2 times m change . `slowed`. Friction
        is the part `arrested` of the change. Supports take the impulse, and its work, in held components.
        """
        before = a.velocity[i]
        after = before + vec3(freed(i, change, a))
        a.velocity[i] = after
        got = wp.vec3d(after) - wp.vec3d(before)
        momentum = wp.float64(weight * a.mass[i]) * got
        taken = wp.vec3d()
        if wp.static(partly):
            taken = wp.float64(weight * a.mass[i]) * (change - freed(i, change, a))
            momentum += taken
        gained = wp.float64(0.0)
        rub = wp.float64(weight * a.mass[i]) * arrested
        warmed = wp.float64(0.0)
        if wp.static(tracked):
            mean = start + wp.float64(0.5) * got
            if wp.static(partly):
                # Held components keep their velocity.
                given_motion = wp.vec3d(before)
                mean = freed(i, mean, a) + given_motion - freed(i, given_motion, a)
            gained = wp.dot(momentum, mean)
            warmed = wp.dot(rub, mean)
            a.work[i] = a.work[i] + gained
            if wp.static(partly):
                a.work[i] = a.work[i] - wp.dot(taken, mean)
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
        """`strike` after the drift; it also moves the point by `shift`, dt times the change, where it is free."""
        kick = half_kick(i, a.step, a.mass, a.force, a.external)
        start = wp.vec3d((a.velocity[i] - kick) / (real(1.0) - half_loss(a.step, a.damping)))
        a.displacement[i] = a.displacement[i] + vec3(freed(i, shift, a))
        given = strike(i, change, arrested, start, start, real(1.0), arm, a)
        if wp.static(tracked and loaded):
            # The work of the load in the drift included the distance by which the point is now moved back.
            a.work[i] = a.work[i] + wp.float64(0.5) * wp.float64(a.step[0]) * wp.dot(
                wp.vec3d(a.external[i]), freed(i, change, a)
            )
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
                moved = freed(i, shift, a)
                x = position(i, a) + moved
                relative = slipping(wp.vec3d(a.velocity[i]) + moved / dt, arm, x - a.place[0], a)
                lost = arrest(i, relative, pressed / dt, n, a)
                reach = dt * wp.length(lost) + wp.float64(2.0) * a.skin
                shift += dt * lost + push_out(i, x + dt * freed(i, lost, a), n, reach, a)
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
                approach = approach / freedom(i, n, a)
                change = approach * n
                lost = wp.vec3d()
                if wp.static(rubs):
                    lost = arrest(i, relative + freed(i, change, a), approach, n, a)
                    change += lost
                    if wp.static(partly):
                        # The free part of friction may point into the body.
                        left = -wp.dot(relative + freed(i, change, a), n)
                        change += (wp.max(left, wp.float64(0.0)) / freedom(i, n, a)) * n
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
