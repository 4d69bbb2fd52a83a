"""Generalised alpha (Chung and Hulbert, J. Appl. Mech. 60, 1993) as terms of the unbalanced force at the end of a step.

With d = u(n+1) - u(n), A = 1 / (beta dt^2) and B = gamma dt A, Newmark's formulas are

    a(n+1) = A d + a*,      a* = -A (dt v + dt^2 (1/2 - beta) a)
    v(n+1) = B d + v*,      v* = v + dt ((1 - gamma) a + gamma a*)

and the balance at the alpha levels, divided by 1 - alpha_f, is

    F(u(n+1)) + rest - k d = 0,     k = m ((1 - alpha_m) / (1 - alpha_f) A + c B)

with the sum F of internal force and loads, and mass damping c. Forces and loads are those at the ends of steps, so
every law, load and internal variable is evaluated at a time of its own displacement. Components that are held follow
their supports.

Coefficients of a step, `c`: those of Newmark's formulas, then weights of mass and of earlier forces, which are zero for
steps without inertia.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import Kernel, kernel
from ..integrate import RIGID, StepOptions, free_components
from ..numeric import numeric


@dataclass(frozen=True)
class ImplicitKernels:
    """Kernels of one configuration.

    Attributes:
        begin: Keeps the displacement, and fills `rest` and `inertia` (k); the displacement becomes a prediction.
        unbalance: Adds rest - k d to the unbalanced force, and k d to the forces with which it is compared.
        finish: Acceleration, velocity, work and losses of a step, and the squared error of the displacement.
        first: Acceleration at the start, from the forces there.
    """

    begin: Kernel
    unbalance: Kernel
    finish: Kernel
    first: Kernel


# Order of the coefficients of a step:
#     a* = from_velocity v + from_acceleration a,       v* = v + of_acceleration a + of_star a*,
#     rest = earlier F - m (at_end a* + at_begin a) - c m (v* + earlier v),
# the factor on a(n+1) - a(n) that is the error of the displacement, and the prediction: u + dt v + dt^2 a / 2 after a
# smooth step, otherwise u + ahead (u - u before).
COEFFICIENTS = (
    "dt", "A", "B", "from_velocity", "from_acceleration", "of_acceleration", "of_star", "at_end", "at_begin", "earlier",
    "damping", "error", "smooth", "ahead",
)  # fmt: skip
DT, A, B, FROM_VELOCITY, FROM_ACCELERATION, OF_ACCELERATION, OF_STAR = range(7)
AT_END, AT_BEGIN, EARLIER, DAMPING, ERROR, SMOOTH, AHEAD = range(7, 14)


@functools.cache
def implicit_motion(options: StepOptions, stressed: bool) -> ImplicitKernels:
    """Kernels of implicit steps; `stressed` as for `kernels.statics.equilibrium`."""
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    held, loaded, damped, tracked = options.held, options.loaded, options.damped, options.tracked
    without_held = free_components(options.bits)

    @wp.func
    def free_part(held_mask: wp.array(dtype=wp.uint8), i: int, value: vec3):
        if wp.static(held):
            return without_held(held_mask[i], RIGID, value)
        else:
            return value

    @wp.func
    def star(c: wp.array(dtype=real), v: vec3, a: vec3):
        """a* and v*."""
        s = c[FROM_VELOCITY] * v + c[FROM_ACCELERATION] * a
        return s, v + c[OF_ACCELERATION] * a + c[OF_STAR] * s

    @kernel()
    def begin(
        c: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        velocity: wp.array(dtype=vec3),
        acceleration: wp.array(dtype=vec3),
        force_before: wp.array(dtype=vec3),
        first: int,
        displacement: wp.array(dtype=vec3),
        before: wp.array(dtype=vec3),
        rest: wp.array(dtype=vec3),
        inertia: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        u, v, a = displacement[i], velocity[i], acceleration[i]
        a_star, v_star = star(c, v, a)
        predicted = u + c[DT] * (v + (real(0.5) * c[DT]) * a)
        if c[SMOOTH] == real(0.0):
            predicted = u + c[AHEAD] * (u - before[i])
        before[i] = u
        if inertia:
            m = mass[i]
            pull = c[EARLIER] * force_before[i] - m * (c[AT_END] * a_star + c[AT_BEGIN] * a)
            rest[i] = pull - (c[DAMPING] * m) * (v_star + c[EARLIER] * v)
            inertia[i] = m * (c[AT_END] * c[A] + c[DAMPING] * c[B])
        displacement[i] = predicted

    @kernel()
    def unbalance(
        held_mask: wp.array(dtype=wp.uint8),
        displacement: wp.array(dtype=vec3),
        before: wp.array(dtype=vec3),
        rest: wp.array(dtype=vec3),
        inertia: wp.array(dtype=real),
        first: int,
        unbalanced: wp.array(dtype=vec3),
        squared: wp.array(dtype=wp.float64),
        reaction: wp.array(dtype=wp.float64),
        moving: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        resisting = free_part(held_mask, i, inertia[i] * (displacement[i] - before[i]))
        total = unbalanced[i] + free_part(held_mask, i, rest[i]) - resisting
        unbalanced[i] = total
        squared[i] = wp.float64(wp.dot(total, total))
        size = wp.float64(wp.dot(resisting, resisting))
        reaction[i] = reaction[i] + size
        if wp.static(stressed):
            moving[i] = moving[i] + size

    @wp.func
    def loads_of(held_mask: wp.array(dtype=wp.uint8), i: int, force: vec3, external: vec3):
        """Forces that do work: loads, and what supports pull with."""
        if wp.static(held):
            outside = without_held(held_mask[i], 0, external)
            return outside - (force - without_held(held_mask[i], 0, force))
        else:
            return external

    @kernel()
    def finish(
        c: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        displacement: wp.array(dtype=vec3),
        before: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        velocity: wp.array(dtype=vec3),
        acceleration: wp.array(dtype=vec3),
        force_before: wp.array(dtype=vec3),
        loads_before: wp.array(dtype=vec3),
        work: wp.array(dtype=wp.float64),
        dissipated: wp.array(dtype=wp.float64),
        error: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        d = displacement[i] - before[i]
        v, a = velocity[i], acceleration[i]
        a_star, v_star = star(c, v, a)
        new_a = free_part(held_mask, i, c[A] * d + a_star)
        new_v = c[B] * d + v_star
        if wp.static(held):
            with_support = d / c[DT]
            new_v = with_support + without_held(held_mask[i], RIGID, new_v - with_support)
        apart = c[ERROR] * (new_a - a)
        error[i] = wp.float64(wp.dot(apart, apart))
        load = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(loaded):
            load = external[i]
        if wp.static(tracked):
            loads = loads_of(held_mask, i, force[i], load)
            if work:
                work[i] = work[i] + wp.float64(real(0.5) * wp.dot(loads_before[i] + loads, d))
            loads_before[i] = loads
            if wp.static(damped):
                mean = free_part(held_mask, i, real(0.5) * (v + new_v))
                dissipated[i] = dissipated[i] + wp.float64(c[DAMPING] * mass[i] * wp.dot(mean, d))
        force_before[i] = force[i] + load
        velocity[i] = new_v
        acceleration[i] = new_a

    @kernel()
    def first_acceleration(
        c: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        moves: int,
        first: int,
        acceleration: wp.array(dtype=vec3),
        force_before: wp.array(dtype=vec3),
        loads_before: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        load = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(loaded):
            load = external[i]
        total = force[i] + load
        force_before[i] = total
        if wp.static(tracked):
            loads_before[i] = loads_of(held_mask, i, force[i], load)
        if moves != 0:
            a = total / mass[i] - c[DAMPING] * velocity[i]
            acceleration[i] = free_part(held_mask, i, a)

    return ImplicitKernels(begin, unbalance, finish, first_acceleration)
