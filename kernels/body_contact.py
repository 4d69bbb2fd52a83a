"""Contact of a sheet with a rigid body of any shape, by projection, with Coulomb friction.

After the drift, points inside the body are moved out. So are points whose path relative to the body entered it during
the step, so no point passes through the body. A point already in contact loses the velocity component into the body; a
newly arrived point is moved by its impulse (the position constraint of RATTLE, as in kernels/contact.py). After the
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
"""

import functools
from dataclasses import dataclass

import warp as wp

from .body_motion import vec6d
from .body_search import body_search
from .integrate import half_step
from .numeric import numeric
from .pointwise import Pointwise, pointwise


@dataclass(frozen=True)
class BodyContactKernels:
    """Pointwise stages of one configuration.

    Attributes:
        project: Moves points out of the body, after the drift.
        separate: Removes the velocity into the body, after the second half kick.
        find_inside: Velocity changes that points need, before a free body moves and before `project`.
        find_touching: The same before `separate`.
        mark: Marks points that may touch during the step or at its end, for the stages of large sheets.
        mark_again: Marks them again after a free body has yielded.
        take_in_step: Applies the impulses found by kernels/surface_contact.py after the drift.
        take_at_end: Applies them after the second half kick.
    """

    project: Pointwise
    separate: Pointwise
    find_inside: Pointwise
    find_touching: Pointwise
    mark: Pointwise
    mark_again: Pointwise
    take_in_step: Pointwise
    take_at_end: Pointwise


@functools.cache
def body_contact(
    bits: int,
    distance: wp.Function,
    moves_freely: bool,
    rubs: bool,
    curved: bool,
    held: bool,
    loaded: bool,
    damped: bool,
    tracked: bool,
    half_steps: bool,
    searched: bool,
    marked: bool,
) -> BodyContactKernels:
    """Stages of contact with a body.

    Args:
        bits: 32 or 64.
        distance: Its signed distance, see kernels/distances.py.
        moves_freely: Whether the sheet moves the body; impulses are then stored for its motion, otherwise summed per
            point.
        rubs: Whether there is friction.
        curved: Whether the reference positions have a z.
        held: Whether any component is held; held points ignore the body.
        loaded: Whether external forces act.
        damped: Whether there is mass damping.
        tracked: Whether work and losses are summed.
        half_steps: Whether energies use half-step velocities.
        searched: Whether the distance needs a search (meshes); points then cache its result.
        marked: Whether the stages act only on marked points.
    """
    types = numeric(bits)
    real = types.real
    search = body_search(bits, distance, curved, held, searched, marked)
    BodyContact, wide, narrow, position = search.struct, search.wide, search.narrow, search.position
    surface_velocity, touch_in_step, touch_now = search.surface_velocity, search.touch_in_step, search.touch_now
    push_out = search.push_out
    plane, may_touch_in_step, may_touch_now = search.plane, search.may_touch_in_step, search.may_touch_now
    half_kick, half_loss = half_step(bits, loaded, damped)

    given = (
        "velocity", "work", "dissipated", "impulse", "turn", "loss", "rubbed", "push", "arms", "push_work", "rub",
        "rub_work",
    )  # fmt: skip

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
        after = before + narrow(change)
        a.velocity[i] = after
        got = wide(after) - wide(before)
        momentum = wp.float64(weight * a.mass[i]) * got
        gained = wp.float64(0.0)
        rub = wp.float64(weight * a.mass[i]) * arrested
        warmed = wp.float64(0.0)
        if wp.static(tracked):
            mean = start + wp.float64(0.5) * got
            gained = wp.dot(momentum, mean)
            warmed = wp.dot(rub, mean)
            a.work[i] = a.work[i] + gained
            if wp.static(damped and half_steps):
                lost = wp.float64(half_loss(a.step, a.damping) * a.mass[i]) * wp.dot(got, slowed)
                a.dissipated[i] = a.dissipated[i] + lost
        if wp.static(moves_freely):
            a.push[i] = momentum
            a.arms[i] = arm
            if wp.static(tracked):
                a.push_work[i] = gained
                if wp.static(rubs):
                    a.rub[i] = rub
                    a.rub_work[i] = warmed
        else:
            a.impulse[i] = a.impulse[i] + narrow(momentum)
            a.turn[i] = a.turn[i] + narrow(wp.cross(arm, momentum))
            if wp.static(tracked):
                passing = surface_velocity(arm, a)
                a.loss[i] = a.loss[i] + wp.dot(momentum, passing) - gained
                if wp.static(rubs):
                    a.rubbed[i] = a.rubbed[i] + wp.dot(rub, passing) - warmed

    @wp.func
    def strike_in_step(i: int, shift: wp.vec3d, change: wp.vec3d, arrested: wp.vec3d, arm: wp.vec3d, a: BodyContact):
        """`strike` after the drift; it also moves the point by `shift`, dt times the velocity change."""
        kick = half_kick(i, a.step, a.mass, a.force, a.external)
        start = wide((a.velocity[i] - kick) / (real(1.0) - half_loss(a.step, a.damping)))
        a.displacement[i] = a.displacement[i] + narrow(shift)
        strike(i, change, arrested, start, start, real(1.0), arm, a)
        if wp.static(tracked and loaded):
            # The work of the load in the drift included the distance by which the point is now moved back.
            a.work[i] = a.work[i] + wp.float64(0.5) * wp.float64(a.step[0]) * wp.dot(wide(a.external[i]), change)

    @wp.func
    def end_strike(i: int, change: wp.vec3d, arrested: wp.vec3d, arm: wp.vec3d, a: BodyContact):
        """`strike` after the second half kick; the impulse is taken before damping divides it by 1 + c dt / 2."""
        start = wide(a.velocity[i])
        slowed = start
        weight = real(1.0)
        if wp.static(damped):
            weight += half_loss(a.step, a.damping)
            slowed = wide(weight * a.velocity[i] - half_kick(i, a.step, a.mass, a.force, a.external))
            start -= wp.float64(real(0.5) * half_loss(a.step, a.damping)) * change
        strike(i, change, arrested, start, slowed, weight, arm, a)

    @wp.func
    def rubbed_of(i: int, a: BodyContact):
        if wp.static(rubs):
            return a.rubbing[i]
        else:
            return wp.vec3d()

    @wp.func
    def forget(i: int, a: BodyContact):
        if wp.static(moves_freely):
            a.push[i] = wp.vec3d()
            if wp.static(tracked):
                a.push_work[i] = wp.float64(0.0)
                if wp.static(rubs):
                    a.rub[i] = wp.vec3d()
                    a.rub_work[i] = wp.float64(0.0)

    @wp.func
    def slipping(v: wp.vec3d, arm: wp.vec3d, end: wp.vec3d, a: BodyContact):
        """Velocity relative to the body [m/s] of a point that moves from `arm` to `end` during the step."""
        return v - surface_velocity(wp.float64(0.5) * (arm + end), a)

    @pointwise(BodyContact, writes=("need", "rows", "arms", "slips", "seen"))
    def find_inside(begin: int, end: int, a: BodyContact):
        here = plane(a)
        for i in range(begin, end):
            near = may_touch_in_step(i, a, here)
            if wp.static(not marked):
                a.need[i] = wp.float64(-1.0)
            if near:
                needed = wp.float64(-1.0)
                touches, n, shift, _pressed, arm = touch_in_step(i, a)
                if touches:
                    needed = wp.length(shift) / wp.float64(a.step[0])
                    t = wp.cross(arm, n)
                    a.rows[i] = vec6d(n[0], n[1], n[2], t[0], t[1], t[2])
                    if wp.static(rubs):
                        a.arms[i] = arm
                        a.slips[i] = slipping(wide(a.velocity[i]), arm, position(i, a) + shift - a.place[0], a)
                a.need[i] = needed

    @pointwise(BodyContact, writes=("need", "rows", "arms", "slips"))
    def find_touching(begin: int, end: int, a: BodyContact):
        here = plane(a)
        for i in range(begin, end):
            near = may_touch_now(i, a, here)
            if wp.static(not marked):
                a.need[i] = wp.float64(-1.0)
            if near:
                needed = wp.float64(-1.0)
                x = position(i, a)
                touches, n = touch_now(x, a)
                if touches:
                    arm = x - a.place[0]
                    relative = slipping(wide(a.velocity[i]), arm, arm, a)
                    approach = -wp.dot(relative, n)
                    if approach > wp.float64(0.0):
                        needed = approach
                    t = wp.cross(arm, n)
                    a.rows[i] = vec6d(n[0], n[1], n[2], t[0], t[1], t[2])
                    if wp.static(rubs):
                        a.arms[i] = arm
                        a.slips[i] = relative
                a.need[i] = needed

    @pointwise(BodyContact, writes=("displacement", "seen", *given))
    def project_out(begin: int, end: int, a: BodyContact):
        here = plane(a)
        for i in range(begin, end):
            near = may_touch_in_step(i, a, here)
            if wp.static(not marked):
                forget(i, a)
            if near:
                if wp.static(marked):
                    forget(i, a)
                touches, n, shift, pressed, arm = touch_in_step(i, a)
                if touches:
                    dt = wp.float64(a.step[0])
                    lost = wp.vec3d()
                    if wp.static(rubs):
                        x = position(i, a) + shift
                        relative = slipping(wide(a.velocity[i]) + shift / dt, arm, x - a.place[0], a)
                        lost = arrest(relative, pressed / dt, n, a.friction)
                        reach = dt * wp.length(lost) + wp.float64(2.0) * a.skin
                        shift += dt * lost + push_out(x + dt * lost, n, reach, a)
                    strike_in_step(i, shift, shift / dt, lost, arm, a)

    @wp.func
    def take_change(i: int, a: BodyContact):
        """Return the velocity change of a point [m/s] and reset it, because it belongs to one half step."""
        change = a.changes[i]
        a.changes[i] = wp.vec3d()
        forget(i, a)
        if wp.static(moves_freely and marked):
            if wp.length_sq(change) > wp.float64(0.0):
                a.marks[i] = wp.uint8(1)
        return change

    @pointwise(BodyContact, writes=("displacement", "changes", "marks", *given))
    def take_in_step(begin: int, end: int, a: BodyContact):
        for i in range(begin, end):
            change = take_change(i, a)
            if wp.length_sq(change) > wp.float64(0.0):
                dt = wp.float64(a.step[0])
                arm = position(i, a) - dt * wide(a.velocity[i]) - a.place[1]
                strike_in_step(i, dt * change, change, rubbed_of(i, a), arm, a)

    @pointwise(BodyContact, writes=("changes", "marks", *given))
    def take_at_end(begin: int, end: int, a: BodyContact):
        for i in range(begin, end):
            change = take_change(i, a)
            if wp.length_sq(change) > wp.float64(0.0):
                end_strike(i, change, rubbed_of(i, a), position(i, a) - a.place[0], a)

    @pointwise(BodyContact, writes=given)
    def separate_from(begin: int, end: int, a: BodyContact):
        here = plane(a)
        for i in range(begin, end):
            near = may_touch_now(i, a, here)
            if wp.static(not marked):
                forget(i, a)
            if near:
                if wp.static(marked):
                    forget(i, a)
                x = position(i, a)
                touches, n = touch_now(x, a)
                if touches:
                    arm = x - a.place[0]
                    relative = slipping(wide(a.velocity[i]), arm, arm, a)
                    approach = -wp.dot(relative, n)
                    if approach > wp.float64(0.0):
                        change = approach * n
                        lost = wp.vec3d()
                        if wp.static(rubs):
                            lost = arrest(relative + change, approach, n, a.friction)
                            change += lost
                        end_strike(i, change, lost, arm, a)

    return BodyContactKernels(
        project_out,
        separate_from,
        find_inside,
        find_touching,
        search.mark,
        search.mark_again,
        take_in_step,
        take_at_end,
    )
