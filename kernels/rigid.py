"""Rigid inclusions: points that move as one body under the sum of the forces on them.

The bodies are integrated with the kicks and drift of the sheet; the rotation follows R <- exp(dt omega x) R. One thread
works on one body, in float64: bodies are few, and their orientation must not drift. The points get the velocity that
takes them to their new positions, so the drift stage of the sheet moves them.
"""

import functools

import warp as wp

from .effects import Kernel, kernel
from .integrate import StepOptions
from .numeric import numeric


@functools.cache
def rigid_inclusions(options: StepOptions) -> tuple[Kernel, Kernel]:
    """Kernels `move_bodies` (before the drift) and `kick_bodies` (after the force)."""
    types, loaded, damped = numeric(options.bits), options.loaded, options.damped
    real, vec3 = types.real, types.vec3

    @wp.func
    def total_force(
        begin: int,
        end: int,
        members: wp.array(dtype=wp.int32),
        arms: wp.array(dtype=wp.vec3d),
        rotation: wp.mat33d,
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
    ):
        """Sum of forces [N] and of torques about the centre of mass [N m]."""
        push = wp.vec3d()
        turn = wp.vec3d()
        for p in range(begin, end):
            f = force[members[p]]
            if wp.static(loaded):
                f += external[members[p]]
            push += wp.vec3d(f)
            turn += wp.cross(rotation * arms[p], wp.vec3d(f))
        return push, turn

    @wp.func
    def spin(rotation: wp.mat33d, inverse_inertia: wp.mat33d, angular: wp.vec3d):
        """Angular velocity [1/s]."""
        return rotation * (inverse_inertia * (wp.transpose(rotation) * angular))

    @wp.func
    def turned(rotation: wp.mat33d, omega: wp.vec3d, dt: wp.float64):
        """exp(dt omega x) applied to the rotation, by Rodrigues' formula."""
        angle = dt * wp.length(omega)
        a = wp.float64(1.0)
        b = wp.float64(0.5)
        if angle > wp.float64(1e-8):
            a = wp.sin(angle) / angle
            b = (wp.float64(1.0) - wp.cos(angle)) / (angle * angle)
        w = wp.skew(dt * omega)
        return rotation + a * (w * rotation) + b * (w * (w * rotation))

    @kernel(per="body")
    def move_bodies(
        begins: wp.array(dtype=wp.int32),
        members: wp.array(dtype=wp.int32),
        arms: wp.array(dtype=wp.vec3d),
        masses: wp.array(dtype=wp.float64),
        inverse_inertia: wp.array(dtype=wp.mat33d),
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        first: int,
        place: wp.array(dtype=wp.vec3d),
        linear: wp.array(dtype=wp.vec3d),
        angular: wp.array(dtype=wp.vec3d),
        rotation: wp.array(dtype=wp.mat33d),
        velocity: wp.array(dtype=vec3),
    ):
        b = wp.tid() + first
        dt = wp.float64(step[0])
        R = rotation[b]
        push, turn = total_force(begins[b], begins[b + 1], members, arms, R, force, external)
        keep = wp.float64(1.0)
        if wp.static(damped):
            keep = wp.float64(1.0) - wp.float64(0.5) * dt * wp.float64(damping[0])
        p = keep * linear[b] + wp.float64(0.5) * dt * push
        L = keep * angular[b] + wp.float64(0.5) * dt * turn
        d = place[b] + (dt / masses[b]) * p
        R = turned(R, spin(R, inverse_inertia[b], L), dt)
        linear[b] = p
        angular[b] = L
        place[b] = d
        rotation[b] = R
        for q in range(begins[b], begins[b + 1]):
            i = members[q]
            u = displacement[i]
            shift = d + R * arms[q] - arms[q] - wp.vec3d(u)
            v = shift / dt
            velocity[i] = vec3(v)

    @kernel(per="body")
    def kick_bodies(
        begins: wp.array(dtype=wp.int32),
        members: wp.array(dtype=wp.int32),
        arms: wp.array(dtype=wp.vec3d),
        masses: wp.array(dtype=wp.float64),
        inverse_inertia: wp.array(dtype=wp.mat33d),
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        rotation: wp.array(dtype=wp.mat33d),
        first: int,
        linear: wp.array(dtype=wp.vec3d),
        angular: wp.array(dtype=wp.vec3d),
        velocity: wp.array(dtype=vec3),
    ):
        b = wp.tid() + first
        dt = wp.float64(step[0])
        R = rotation[b]
        push, turn = total_force(begins[b], begins[b + 1], members, arms, R, force, external)
        p = linear[b] + wp.float64(0.5) * dt * push
        L = angular[b] + wp.float64(0.5) * dt * turn
        if wp.static(damped):
            slower = wp.float64(1.0) + wp.float64(0.5) * dt * wp.float64(damping[0])
            p = p / slower
            L = L / slower
        linear[b] = p
        angular[b] = L
        omega = spin(R, inverse_inertia[b], L)
        for q in range(begins[b], begins[b + 1]):
            v = p / masses[b] + wp.cross(omega, R * arms[q])
            velocity[members[q]] = vec3(v)

    return move_bodies, kick_bodies
