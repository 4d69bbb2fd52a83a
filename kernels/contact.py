"""Frictionless contact with a rigid body on a prescribed path, by projection.

After the drift, a point inside the body is moved to the nearest point of its surface, and its velocity at the half
step is corrected by that shift (the position constraint of RATTLE). After the second half kick, a touching point that
still moves into the body loses its normal velocity relative to it. Both are impulses along the normal; the impulse on
the body is minus their sum.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from .integrate import StepOptions, half_step
from .numeric import numeric
from .pointwise import Pointwise, pointwise


@dataclass(frozen=True)
class Shape:
    """Warp functions of the shape of a rigid body; `arm` is the vector from its centre to a point [m], vec3.

    Attributes:
        project: (arm, constants) -> whether the point is inside, and the shift to the nearest point of the surface [m].
        touch: (arm, constants, tolerance) -> whether the point is inside or touches, within a relative tolerance, and
            the outward normal there.
    """

    project: wp.Function
    touch: wp.Function


ShapeFactory = Callable[[int], Shape]


@functools.cache
def ball(bits: int) -> Shape:
    """Ball; constants (radius [m],)."""
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters

    @wp.func
    def project_ball(arm: vec3, constants: parameters):
        distance = wp.length(arm)
        radius = constants[0]
        inside = distance < radius and distance > real(0.0)
        shift = vec3(real(0.0), real(0.0), real(0.0))
        if inside:
            shift = ((radius - distance) / distance) * arm
        return inside, shift

    @wp.func
    def touch_ball(arm: vec3, constants: parameters, tolerance: real):
        distance = wp.length(arm)
        touching = distance < constants[0] * (real(1.0) + tolerance) and distance > real(0.0)
        normal = vec3(real(0.0), real(0.0), real(0.0))
        if touching:
            normal = arm / distance
        return touching, normal

    return Shape(project_ball, touch_ball)


@dataclass(frozen=True)
class ContactKernels:
    """Pointwise stages of one configuration.

    Attributes:
        project: Moves points inside the body to its surface, after the drift.
        separate: Removes the velocity into the body, after the second half kick.
    """

    project: Pointwise
    separate: Pointwise


@functools.cache
def rigid_contact(options: StepOptions, shape: ShapeFactory, curved: bool) -> ContactKernels:
    """Stages of contact with a body, which points with a held component ignore.

    `shape` is the factory of its shape, called with the precision; `curved`: the reference positions have a z.
    """
    bits, held, loaded, damped = options.bits, options.held, options.loaded, options.damped
    tracked = options.tracked
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    half_kick, half_loss = half_step(options)
    project_out, touch = shape(bits).project, shape(bits).touch

    @wp.struct
    class Contact:
        reference: wp.array(dtype=vec3 if curved else types.vec2)
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        centre: wp.array(dtype=vec3)
        body_velocity: vec3
        schedule: int
        constants: types.parameters
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        impulse: wp.array(dtype=vec3)
        work: wp.array(dtype=wp.float64)
        dissipated: wp.array(dtype=wp.float64)

    @wp.func
    def strike(i: int, change: vec3, a: Contact):
        momentum = a.mass[i] * change
        a.velocity[i] = a.velocity[i] + change
        a.impulse[i] = a.impulse[i] + momentum

    @wp.func
    def works(i: int, change: vec3, start: vec3, slowed: vec3, weight: real, a: Contact):
        # As in kernels/body_contact.py.
        a.work[i] = a.work[i] + wp.float64(weight * a.mass[i] * wp.dot(change, start + real(0.5) * change))
        if wp.static(damped):
            lost = half_loss(a.step, a.damping) * a.mass[i] * wp.dot(change, slowed)
            a.dissipated[i] = a.dissipated[i] + wp.float64(lost)

    @wp.func
    def arm(i: int, a: Contact):
        """Vector from the body's centre to the point, summed in the order that keeps precision near contact."""
        X = a.reference[i]
        c = a.centre[a.schedule]
        if wp.static(curved):
            return X - c + a.displacement[i]
        else:
            return vec3(X[0] - c[0], X[1] - c[1], -c[2]) + a.displacement[i]

    @wp.func
    def free(i: int, a: Contact):
        if wp.static(held):
            return a.held_mask[i] == wp.uint8(0)
        else:
            return bool(True)

    @pointwise(Contact, writes=("displacement", "velocity", "impulse", "work", "dissipated"))
    def project(begin: int, end: int, a: Contact):
        for i in range(begin, end):
            inside, shift = project_out(arm(i, a), a.constants)
            if inside and free(i, a):
                a.displacement[i] = a.displacement[i] + shift
                change = shift / a.step[0]
                if wp.static(tracked):
                    kick = half_kick(i, a.step, a.mass, a.force, a.external)
                    start = (a.velocity[i] - kick) / (real(1.0) - half_loss(a.step, a.damping))
                    works(i, change, start, start, real(1.0), a)
                    if wp.static(loaded):
                        # The drift took the load along the way that the point did not go.
                        a.work[i] = a.work[i] + wp.float64(real(0.5) * wp.dot(a.external[i], shift))
                strike(i, change, a)

    @pointwise(Contact, writes=("velocity", "impulse", "work", "dissipated"))
    def separate(begin: int, end: int, a: Contact):
        tolerance = real(wp.static(1e-5 if bits == 32 else 1e-10))
        for i in range(begin, end):
            touching, normal = touch(arm(i, a), a.constants, tolerance)
            if touching and free(i, a):
                approach = wp.dot(a.velocity[i] - a.body_velocity, normal)
                if approach < real(0.0):
                    change = -approach * normal
                    if wp.static(tracked):
                        loss = half_loss(a.step, a.damping)
                        kick = half_kick(i, a.step, a.mass, a.force, a.external)
                        start = (real(1.0) + loss) * a.velocity[i] - kick
                        mean = a.velocity[i] - real(0.5) * loss * change
                        works(i, change, mean, start, real(1.0) + loss, a)
                    strike(i, change, a)
                    if wp.static(damped):
                        # The second half kick divided by 1 + c dt / 2; the impulse of the body counts before.
                        a.impulse[i] = a.impulse[i] - (half_loss(a.step, a.damping) * a.mass[i] * approach) * normal

    return ContactKernels(project, separate)
