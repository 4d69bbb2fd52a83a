"""Central differences as half kick, drift, force, half kick; prescribed motion; the clock.

With mass damping c (force -c m v) the two halves
    v(n+1/2) = v(n) (1 - c dt/2) + dt/2 a(n),      v(n+1) = [v(n+1/2) + dt/2 a(n+1)] / (1 + c dt/2)
are the central difference scheme. Velocities are known at full steps, so the step may change at any time.

`held` is a bit mask a point: bits 0 to 2 hold a component to a prescribed motion, bit 3 marks a point of a
rigid inclusion. A held component keeps the velocity it was given and is never accelerated.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .numeric import numeric
from .points import PointFunction

RIGID = 8


@dataclass(frozen=True)
class IntegrationKernels:
    """Kernels of one configuration.

    Attributes:
        drift: Point function: first half kick and drift.
        kick: Point function: second half kick.
        kinetic_energy: Kinetic energy of each point [J]; held components do not count.
        residual: Squared unbalanced force and squared reaction of each point [N^2].
    """

    drift: Any
    kick: Any
    kinetic_energy: Any
    residual: Any


@functools.cache
def integration(bits, held, loaded, damped, tracked, module):
    """Kernels of the explicit integrator.

    Args:
        bits: 32 or 64.
        held: Whether any component is held.
        loaded: Whether external forces act.
        damped: Whether there is mass damping.
        tracked: Whether external work and dissipation are summed up, per point.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    rigid = RIGID

    @wp.func(module=module)
    def power(held_bits: wp.uint8, internal: vec3, external: vec3, velocity: vec3):
        """Power of external forces and of the supports, which balance the internal force."""
        rate = wp.float64(0.0)
        if (wp.int32(held_bits) & rigid) != 0:
            return wp.float64(wp.dot(external, velocity))
        for c in range(3):
            if (wp.int32(held_bits) & (1 << c)) != 0:
                rate -= wp.float64(internal[c] * velocity[c])
            else:
                rate += wp.float64(external[c] * velocity[c])
        return rate

    @functools.partial(wp.struct, module=module)
    class Motion:
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        work: wp.array(dtype=wp.float64)
        dissipated: wp.array(dtype=wp.float64)

    @wp.func(module=module)
    def drift(begin: int, end: int, a: Motion):
        for i in range(begin, end):
            dt = a.step[0]
            v = a.velocity[i]
            total = a.force[i]
            if wp.static(loaded):
                total += a.external[i]
            keep = real(1.0)
            if wp.static(damped):
                keep = real(1.0) - real(0.5) * dt * a.damping[0]
            half = keep * v + (real(0.5) * dt / a.mass[i]) * total
            if wp.static(held):
                bits_here = a.held_mask[i]
                for c in range(3):
                    if (wp.int32(bits_here) & ((1 << c) | rigid)) != 0:
                        half[c] = v[c]
                if wp.static(tracked):
                    load = total - a.force[i]
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt) * power(bits_here, a.force[i], load, half)
            else:
                if wp.static(tracked and loaded):
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt * wp.dot(a.external[i], half))
            a.displacement[i] = a.displacement[i] + dt * half
            a.velocity[i] = half

    @wp.func(module=module)
    def kick(begin: int, end: int, a: Motion):
        for i in range(begin, end):
            dt = a.step[0]
            half = a.velocity[i]
            total = a.force[i]
            if wp.static(loaded):
                total += a.external[i]
            v = half + (real(0.5) * dt / a.mass[i]) * total
            if wp.static(damped):
                v = v / (real(1.0) + real(0.5) * dt * a.damping[0])
            moving = v
            if wp.static(held):
                bits_here = a.held_mask[i]
                for c in range(3):
                    if (wp.int32(bits_here) & ((1 << c) | rigid)) != 0:
                        v[c] = half[c]
                    if (wp.int32(bits_here) & (1 << c)) != 0:
                        moving[c] = real(0.0)
                if wp.static(tracked):
                    load = total - a.force[i]
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt) * power(bits_here, a.force[i], load, half)
            else:
                if wp.static(tracked and loaded):
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt * wp.dot(a.external[i], half))
            if wp.static(tracked and damped):
                loss = dt * a.damping[0] * a.mass[i] * wp.dot(moving, moving)
                a.dissipated[i] = a.dissipated[i] + wp.float64(loss)
            a.velocity[i] = v

    @wp.kernel(module=module, enable_backward=False)
    def kinetic_energy(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        v = velocity[i]
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                    v[c] = real(0.0)
        out[i] = wp.float64(real(0.5) * mass[i] * wp.dot(v, v))

    @wp.kernel(module=module, enable_backward=False)
    def residual(
        held_mask: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        unbalanced: wp.array(dtype=wp.float64),
        reaction: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        load = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(loaded):
            load = external[i]
        free = force[i] + load
        support = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                    support[c] = free[c]
                    free[c] = real(0.0)
                elif (wp.int32(held_mask[i]) & rigid) != 0:
                    free[c] = real(0.0)
        unbalanced[i] = wp.float64(wp.dot(free, free))
        reaction[i] = wp.float64(wp.dot(support, support) + wp.dot(load, load))

    return IntegrationKernels(
        PointFunction(drift, Motion, "drift"), PointFunction(kick, Motion, "kick"), kinetic_energy, residual
    )


@functools.cache
def clock(bits, module):
    """Kernel of time `tick`, and point function `prescribe`, which turns motions into velocities.

    A schedule is a piecewise linear function of time, three values a knot; schedule s owns the knots
    begins[s] to begins[s+1] - 1. Outside its knots it keeps its first or last value. `tick` moves the time by so many
    steps and evaluates every schedule s of S twice: scheduled[s] is now, scheduled[S + s] a step later, for what
    moves before the next tick.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.func(module=module)
    def evaluate(
        time: wp.float64,
        begins: wp.array(dtype=wp.int32),
        knots: wp.array(dtype=wp.float64),
        values: wp.array(dtype=wp.vec3d),
        s: int,
    ):
        left = begins[s]
        last = begins[s + 1] - 1
        result = values[left]
        if time >= knots[last]:
            result = values[last]
        else:
            for k in range(left, last):
                if time >= knots[k] and time < knots[k + 1]:
                    share = (time - knots[k]) / (knots[k + 1] - knots[k])
                    result = values[k] + share * (values[k + 1] - values[k])
        return result

    @wp.kernel(module=module, enable_backward=False)
    def tick(
        advance: wp.array(dtype=wp.float64),
        begins: wp.array(dtype=wp.int32),
        knots: wp.array(dtype=wp.float64),
        values: wp.array(dtype=wp.vec3d),
        steps: int,
        first: int,
        time: wp.array(dtype=wp.float64),
        scheduled: wp.array(dtype=vec3),
    ):
        now = wp.min(time[0] + wp.float64(steps) * advance[0], advance[1])
        soon = wp.min(now + advance[0], advance[1])
        time[0] = now
        count = begins.shape[0] - 1
        for s in range(count):
            value = evaluate(now, begins, knots, values, s)
            scheduled[s] = vec3(real(value[0]), real(value[1]), real(value[2]))
            value = evaluate(soon, begins, knots, values, s)
            scheduled[count + s] = vec3(real(value[0]), real(value[1]), real(value[2]))

    @functools.partial(wp.struct, module=module)
    class Prescribed:
        rows: wp.array(dtype=wp.int32)
        schedules: wp.array(dtype=wp.vec3i)
        scheduled: wp.array(dtype=vec3)
        step: wp.array(dtype=real)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)

    @wp.func(module=module)
    def prescribe(begin: int, end: int, a: Prescribed):
        for i in range(begin, end):
            row = a.rows[i]
            if row >= 0:
                v = a.velocity[i]
                for c in range(3):
                    s = a.schedules[row][c]
                    if s >= 0:
                        v[c] = (a.scheduled[s][c] - a.displacement[i][c]) / a.step[0]
                a.velocity[i] = v

    return tick, PointFunction(prescribe, Prescribed, "prescribe")


@functools.cache
def adaptive_damping(bits, module):
    """Kernels that set the mass damping to twice the frequency of the present motion (dynamic relaxation).

    Rayleigh's quotient of the last step, omega^2 = (v . K v) / (v . M v) with K v = -(change of force) / dt,
    tends to the lowest frequency still in motion, for which c = 2 omega is critical. `blocks` threads sum
    one block of points each, in order, so the sums repeat bit for bit; one thread adds them up.
    Source: Underwood's adaptive dynamic relaxation, with the tangent along the motion in place of a diagonal.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.kernel(module=module, enable_backward=False)
    def measure_motion(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        block: int,
        first: int,
        previous: wp.array(dtype=vec3),
        sums: wp.array2d(dtype=wp.float64),
    ):
        b = wp.tid() + first
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for i in range(b * block, wp.min((b + 1) * block, velocity.shape[0])):
            v = velocity[i]
            if held_mask:
                for c in range(3):
                    if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                        v[c] = real(0.0)
            inertia += wp.float64(mass[i] * wp.dot(v, v))
            stiffness += wp.float64(wp.dot(v, previous[i] - force[i]))
            previous[i] = force[i]
        sums[0, b] = inertia
        sums[1, b] = stiffness

    @wp.kernel(module=module, enable_backward=False)
    def set_damping(
        sums: wp.array2d(dtype=wp.float64),
        step: wp.array(dtype=real),
        first: int,
        damping: wp.array(dtype=real),
    ):
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for b in range(sums.shape[1]):
            inertia += sums[0, b]
            stiffness += sums[1, b]
        dt = wp.float64(step[0])
        omega = wp.float64(0.0)
        if inertia > wp.float64(0.0) and stiffness > wp.float64(0.0):
            omega = wp.sqrt(stiffness / (dt * inertia))
        damping[0] = real(wp.min(wp.float64(2.0) * omega, wp.float64(1.5) / dt))

    return measure_motion, set_damping


@functools.cache
def power_iteration(bits, module):
    """Kernels that estimate the largest natural frequency by finite differences of the force.

    trial(s) = u + s e v, with e so that the fastest component of v moves by `reach`; the stiffness times v
    is the central difference of the force; v <- M^-1 K v.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.kernel(module=module, enable_backward=False)
    def trial(
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        reach: wp.array(dtype=real),
        sign: real,
        first: int,
        out: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        out[i] = displacement[i] + (sign * reach[0]) * direction[i]

    @wp.kernel(module=module, enable_backward=False)
    def respond(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        plus: wp.array(dtype=vec3),
        minus: wp.array(dtype=vec3),
        reach: wp.array(dtype=real),
        direction: wp.array(dtype=vec3),
        block: int,
        first: int,
        response: wp.array(dtype=vec3),
        sums: wp.array2d(dtype=wp.float64),
    ):
        """Response M^-1 K v, and per block: v M v, v K v, |response|^2 weighted by mass, max |response|."""
        b = wp.tid() + first
        norm = wp.float64(0.0)
        product = wp.float64(0.0)
        image = wp.float64(0.0)
        largest = real(0.0)
        for i in range(b * block, wp.min((b + 1) * block, direction.shape[0])):
            r = (minus[i] - plus[i]) / (real(2.0) * reach[0] * mass[i])
            if held_mask:
                for c in range(3):
                    if (wp.int32(held_mask[i]) & ((1 << c) | 8)) != 0:
                        r[c] = real(0.0)
            response[i] = r
            v = direction[i]
            m = wp.float64(mass[i])
            norm += m * wp.float64(wp.dot(v, v))
            product += m * wp.float64(wp.dot(v, r))
            image += m * wp.float64(wp.dot(r, r))
            largest = wp.max(largest, wp.max(wp.max(wp.abs(r[0]), wp.abs(r[1])), wp.abs(r[2])))
        sums[0, b] = norm
        sums[1, b] = product
        sums[2, b] = image
        sums[3, b] = wp.float64(largest)

    @wp.kernel(module=module, enable_backward=False)
    def summarise(
        sums: wp.array2d(dtype=wp.float64),
        first: int,
        scale: wp.array(dtype=real),
        squared_frequency: wp.array(dtype=wp.float64),
    ):
        norm = wp.float64(0.0)
        product = wp.float64(0.0)
        image = wp.float64(0.0)
        largest = wp.float64(0.0)
        for b in range(sums.shape[1]):
            norm += sums[0, b]
            product += sums[1, b]
            image += sums[2, b]
            largest = wp.max(largest, sums[3, b])
        scale[0] = real(0.0)
        if largest > wp.float64(0.0):
            scale[0] = real(wp.float64(1.0) / largest)
        squared_frequency[0] = wp.float64(0.0)
        squared_frequency[1] = wp.float64(0.0)
        if norm > wp.float64(0.0):
            squared_frequency[0] = product / norm
            squared_frequency[1] = wp.sqrt(image / norm)

    @wp.kernel(module=module, enable_backward=False)
    def renew(response: wp.array(dtype=vec3), scale: wp.array(dtype=real), first: int, direction: wp.array(dtype=vec3)):
        i = wp.tid() + first
        direction[i] = scale[0] * response[i]

    return trial, respond, summarise, renew
