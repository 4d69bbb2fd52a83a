"""Rigid inclusions: points that move as one body under the sum of the forces on them.

The bodies are integrated with the kicks and drift of the sheet; the rotation follows R <- exp(dt omega x) R. One thread
works on one body, in float64: bodies are few, and their orientation must not drift. The points get the velocity that
takes them to their new positions, so the drift stage of the sheet moves them.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..integrate import StepOptions
from ..numeric import numeric


@dataclass(frozen=True)
class RigidInclusions:
    """Kernels of one configuration.

    Attributes:
        struct: Arrays of the bodies and of the sheet.
        move: First half kick and drift, before the drift of the sheet.
        kick: Second half kick, after the force.
        show: Internal force on each body [N], and its torque about the centre of mass [N m].
    """

    struct: Any
    move: Kernel
    kick: Kernel
    show: Kernel


@functools.cache
def rigid_inclusions(options: StepOptions) -> RigidInclusions:
    """Kernels of rigid inclusions."""
    types, loaded, damped = numeric(options.bits), options.loaded, options.damped
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Bodies:
        # The points of body b are the entries begins[b] to begins[b + 1] - 1 of `members`.
        begins: wp.array(dtype=wp.int32)
        members: wp.array(dtype=wp.int32)
        # Positions from the centre of mass in the clamped sheet, and those from which displacements count.
        arms: wp.array(dtype=wp.vec3d)
        origins: wp.array(dtype=wp.vec3d)
        # Along x, y and z; infinite where a guide holds the body.
        masses: wp.array(dtype=wp.vec3d)
        inverse_inertia: wp.array(dtype=wp.mat33d)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        place: wp.array(dtype=wp.vec3d)
        linear: wp.array(dtype=wp.vec3d)
        angular: wp.array(dtype=wp.vec3d)
        rotation: wp.array(dtype=wp.mat33d)
        velocity: wp.array(dtype=vec3)

    def declare_sums(name, all_forces):
        @wp.func(name=name)
        def sums(b: int, a: Bodies):
            """Sum of forces [N] and of torques about the centre of mass [N m]."""
            push = wp.vec3d()
            turn = wp.vec3d()
            for p in range(a.begins[b], a.begins[b + 1]):
                f = a.force[a.members[p]]
                if wp.static(all_forces):
                    f += a.external[a.members[p]]
                push += wp.vec3d(f)
                turn += wp.cross(a.rotation[b] * a.arms[p], wp.vec3d(f))
            return push, turn

        return sums

    total_force, internal_force = declare_sums("total_force", loaded), declare_sums("internal_force", False)

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

    @kernel(per="body", writes=("a.place", "a.linear", "a.angular", "a.rotation", "a.velocity"))
    def move_bodies(a: Bodies, first: int):
        b = wp.tid() + first
        dt = wp.float64(a.step[0])
        push, turn = total_force(b, a)
        keep = wp.float64(1.0)
        if wp.static(damped):
            keep = wp.float64(1.0) - wp.float64(0.5) * dt * wp.float64(a.damping[0])
        p = keep * a.linear[b] + wp.float64(0.5) * dt * push
        L = keep * a.angular[b] + wp.float64(0.5) * dt * turn
        d = a.place[b] + wp.cw_mul(wp.cw_div(wp.vec3d(dt, dt, dt), a.masses[b]), p)
        R = turned(a.rotation[b], spin(a.rotation[b], a.inverse_inertia[b], L), dt)
        a.linear[b] = p
        a.angular[b] = L
        a.place[b] = d
        a.rotation[b] = R
        for q in range(a.begins[b], a.begins[b + 1]):
            i = a.members[q]
            shift = d + R * a.arms[q] - a.origins[q] - wp.vec3d(a.displacement[i])
            a.velocity[i] = vec3(shift / dt)

    @kernel(per="body", writes=("a.linear", "a.angular", "a.velocity"))
    def kick_bodies(a: Bodies, first: int):
        b = wp.tid() + first
        dt = wp.float64(a.step[0])
        push, turn = total_force(b, a)
        p = a.linear[b] + wp.float64(0.5) * dt * push
        L = a.angular[b] + wp.float64(0.5) * dt * turn
        if wp.static(damped):
            slower = wp.float64(1.0) + wp.float64(0.5) * dt * wp.float64(a.damping[0])
            p = p / slower
            L = L / slower
        a.linear[b] = p
        a.angular[b] = L
        R = a.rotation[b]
        omega = spin(R, a.inverse_inertia[b], L)
        for q in range(a.begins[b], a.begins[b + 1]):
            a.velocity[a.members[q]] = vec3(wp.cw_div(p, a.masses[b]) + wp.cross(omega, R * a.arms[q]))

    @kernel(per="body")
    def show_forces(a: Bodies, first: int, push: wp.array(dtype=wp.vec3d), turn: wp.array(dtype=wp.vec3d)):
        b = wp.tid() + first
        pushed, turned_by = internal_force(b, a)
        push[b] = pushed
        turn[b] = turned_by

    return RigidInclusions(Bodies, move_bodies, kick_bodies, show_forces)


@functools.cache
def held_inclusions(bits: int) -> Kernel:
    """Kernel of bodies whose points are held or moved: their motion and the internal force on them, from the points.

    `moments` becomes sum m x X^T of the positions x and X about the centre, whose nearest rotation is that of the body.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @kernel(per="body")
    def show_held(
        begins: wp.array(dtype=wp.int32),
        members: wp.array(dtype=wp.int32),
        arms: wp.array(dtype=wp.vec3d),
        origins: wp.array(dtype=wp.vec3d),
        masses: wp.array(dtype=wp.vec3d),
        mass: wp.array(dtype=real),
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        first: int,
        place: wp.array(dtype=wp.vec3d),
        linear: wp.array(dtype=wp.vec3d),
        angular: wp.array(dtype=wp.vec3d),
        moments: wp.array(dtype=wp.mat33d),
        push: wp.array(dtype=wp.vec3d),
        turn: wp.array(dtype=wp.vec3d),
    ):
        b = wp.tid() + first
        centre = wp.vec3d()
        for p in range(begins[b], begins[b + 1]):
            i = members[p]
            centre += (wp.float64(mass[i]) / masses[b][0]) * (origins[p] + wp.vec3d(displacement[i]))
        pushed = wp.vec3d()
        turned = wp.vec3d()
        moving = wp.vec3d()
        spinning = wp.vec3d()
        sums = wp.mat33d()
        for p in range(begins[b], begins[b + 1]):
            i = members[p]
            m = wp.float64(mass[i])
            x = origins[p] + wp.vec3d(displacement[i]) - centre
            v = wp.vec3d(velocity[i])
            f = wp.vec3d(force[i])
            pushed += f
            turned += wp.cross(x, f)
            moving += m * v
            spinning += m * wp.cross(x, v)
            sums += m * wp.outer(x, arms[p])
        place[b] = centre
        linear[b] = moving
        angular[b] = spinning
        moments[b] = sums
        push[b] = pushed
        turn[b] = turned

    return show_held
