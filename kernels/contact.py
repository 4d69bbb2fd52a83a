"""Contact with a rigid ball, frictionless, by projection.

After the drift, a point inside the ball is put on the nearest point of its surface, and its velocity at the
half step takes the displacement along (the position constraint of RATTLE). After the second half kick, a
touching point that still moves into the ball loses its normal velocity relative to it. Both are impulses
along the normal: their sum, with the sign turned, is what the ball feels.
"""

import functools

import warp as wp

from .numeric import numeric


@functools.cache
def ball_contact(bits, held, loaded, damped, tracked, module):
    """Kernels `project` (positions) and `separate` (velocities)."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.func(module=module)
    def strike(
        i: int,
        change: vec3,
        start: vec3,
        mass: wp.array(dtype=real),
        velocity: wp.array(dtype=vec3),
        impulse: wp.array(dtype=vec3),
        work: wp.array(dtype=wp.float64),
    ):
        before = velocity[i]
        momentum = mass[i] * change
        velocity[i] = before + change
        impulse[i] = impulse[i] + momentum
        if wp.static(tracked):
            # The half kick belongs to the same instant: the velocity before it counts, and the one after both.
            work[i] = work[i] + wp.float64(real(0.5) * wp.dot(momentum, start + before + change))

    @wp.func(module=module)
    def half_kick(
        i: int,
        mass: wp.array(dtype=real),
        step: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
    ):
        """Change of velocity by half a step of the forces."""
        total = force[i]
        if wp.static(loaded):
            total += external[i]
        return (real(0.5) * step[0] / mass[i]) * total

    @wp.func(module=module)
    def half_loss(step: wp.array(dtype=real), damping: wp.array(dtype=real)):
        """C dt / 2."""
        loss = real(0.0)
        if wp.static(damped):
            loss = real(0.5) * step[0] * damping[0]
        return loss

    @wp.kernel(module=module, enable_backward=False)
    def project(
        reference: wp.array(dtype=types.vec2),
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        centre: wp.array(dtype=vec3),
        schedule: int,
        radius: real,
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        impulse: wp.array(dtype=vec3),
        work: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        free = bool(True)
        if wp.static(held):
            free = held_mask[i] == wp.uint8(0)
        X = reference[i]
        c = centre[schedule]
        # Reference minus centre first: both are small where contact can be.
        arm = vec3(X[0] - c[0], X[1] - c[1], -c[2]) + displacement[i]
        distance = wp.length(arm)
        if free and distance < radius and distance > real(0.0):
            shift = ((radius - distance) / distance) * arm
            displacement[i] = displacement[i] + shift
            start = (velocity[i] - half_kick(i, mass, step, force, external)) / (real(1.0) - half_loss(step, damping))
            strike(i, shift / step[0], start, mass, velocity, impulse, work)

    @wp.kernel(module=module, enable_backward=False)
    def separate(
        reference: wp.array(dtype=types.vec2),
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        centre: wp.array(dtype=vec3),
        ball_velocity: vec3,
        schedule: int,
        radius: real,
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        first: int,
        velocity: wp.array(dtype=vec3),
        impulse: wp.array(dtype=vec3),
        work: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        free = bool(True)
        if wp.static(held):
            free = held_mask[i] == wp.uint8(0)
        X = reference[i]
        c = centre[schedule]
        arm = vec3(X[0] - c[0], X[1] - c[1], -c[2]) + displacement[i]
        distance = wp.length(arm)
        touching = real(1.0) + real(wp.static(1e-5 if bits == 32 else 1e-10))
        if free and distance < radius * touching and distance > real(0.0):
            normal = arm / distance
            approach = wp.dot(velocity[i] - ball_velocity, normal)
            if approach < real(0.0):
                start = (real(1.0) + half_loss(step, damping)) * velocity[i] - half_kick(i, mass, step, force, external)
                strike(i, -approach * normal, start, mass, velocity, impulse, work)

    return project, separate
