"""Contact with a rigid ball, frictionless, by projection.

After the drift, a point inside the ball is put on the nearest point of its surface, and its velocity at the
half step takes the displacement along (the position constraint of RATTLE). After the second half kick, a
touching point that still moves into the ball loses its normal velocity relative to it. Both are impulses
along the normal: their sum, with the sign turned, is what the ball feels.
"""

import functools

import warp as wp

from .numeric import numeric
from .points import PointFunction


@functools.cache
def ball_contact(bits, held, loaded, damped, tracked, module):
    """Point functions `project` (positions) and `separate` (velocities)."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @functools.partial(wp.struct, module=module)
    class Contact:
        reference: wp.array(dtype=types.vec2)
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        centre: wp.array(dtype=vec3)
        ball_velocity: vec3
        schedule: int
        radius: real
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        impulse: wp.array(dtype=vec3)
        work: wp.array(dtype=wp.float64)

    @wp.func(module=module)
    def strike(i: int, change: vec3, start: vec3, a: Contact):
        before = a.velocity[i]
        momentum = a.mass[i] * change
        a.velocity[i] = before + change
        a.impulse[i] = a.impulse[i] + momentum
        if wp.static(tracked):
            # The half kick belongs to the same instant: the velocity before it counts, and the one after both.
            a.work[i] = a.work[i] + wp.float64(real(0.5) * wp.dot(momentum, start + before + change))

    @wp.func(module=module)
    def half_kick(i: int, a: Contact):
        """Change of velocity by half a step of the forces."""
        total = a.force[i]
        if wp.static(loaded):
            total += a.external[i]
        return (real(0.5) * a.step[0] / a.mass[i]) * total

    @wp.func(module=module)
    def half_loss(a: Contact):
        """C dt / 2."""
        loss = real(0.0)
        if wp.static(damped):
            loss = real(0.5) * a.step[0] * a.damping[0]
        return loss

    @wp.func(module=module)
    def arm(i: int, a: Contact):
        """From the centre of the ball to the point; reference minus centre first, as both are small near contact."""
        X = a.reference[i]
        c = a.centre[a.schedule]
        return vec3(X[0] - c[0], X[1] - c[1], -c[2]) + a.displacement[i]

    @wp.func(module=module)
    def free(i: int, a: Contact):
        if wp.static(held):
            return a.held_mask[i] == wp.uint8(0)
        else:
            return bool(True)

    @wp.func(module=module)
    def project(begin: int, end: int, a: Contact):
        for i in range(begin, end):
            away = arm(i, a)
            distance = wp.length(away)
            if free(i, a) and distance < a.radius and distance > real(0.0):
                shift = ((a.radius - distance) / distance) * away
                a.displacement[i] = a.displacement[i] + shift
                start = (a.velocity[i] - half_kick(i, a)) / (real(1.0) - half_loss(a))
                strike(i, shift / a.step[0], start, a)

    @wp.func(module=module)
    def separate(begin: int, end: int, a: Contact):
        touching = real(1.0) + real(wp.static(1e-5 if bits == 32 else 1e-10))
        for i in range(begin, end):
            away = arm(i, a)
            distance = wp.length(away)
            if free(i, a) and distance < a.radius * touching and distance > real(0.0):
                normal = away / distance
                approach = wp.dot(a.velocity[i] - a.ball_velocity, normal)
                if approach < real(0.0):
                    start = (real(1.0) + half_loss(a)) * a.velocity[i] - half_kick(i, a)
                    strike(i, -approach * normal, start, a)

    return PointFunction(project, Contact, "project"), PointFunction(separate, Contact, "separate")
