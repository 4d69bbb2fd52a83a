"""Central differences as half kick, drift, force, half kick (velocity Verlet).

With mass damping c (force -c m v) the two halves
    v(n+1/2) = v(n) (1 - c dt/2) + dt/2 a(n),      v(n+1) = [v(n+1/2) + dt/2 a(n+1)] / (1 + c dt/2)
are the central difference scheme. Velocities are known at full steps, so the time step may change between steps.

Central differences conserve the strain energy together with m v(n-1/2) v(n+1/2) / 2, which for free oscillations is
exact at any stable step; m v(n)^2 / 2 differs from it by m (dt a)^2 / 8. The energy balance uses the former.
Consistently, external work and damping losses are the mean of the forces at both ends of a step times the displacement
v(n+1/2) dt. The difference between the two kinetic energies is computed from the force at each point. A contact that
changes velocities adds the effect of its impulses, see `half_step`; for a contact that does not, the difference is left
out (`contact`).

`held_mask` is a bit mask per point: bits 0 to 2 hold a component to a prescribed motion, bit 3 marks a point of a
rigid inclusion. A held component keeps its prescribed velocity and is never accelerated.

`clock` evaluates schedules on the device, for prescribed motions and loads. A schedule is a piecewise linear function
of time, three values per knot; schedule s has the knots begins[s] to begins[s+1] - 1. Before its first and after its
last knot it is constant. `tick` advances the time by a number of steps and evaluates every schedule s of S twice:
scheduled[s] is the value now, scheduled[S + s] the value one step later, for stages that move points before the next
tick.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .effects import Kernel, Pointwise, kernel, pointwise
from .numeric import numeric

RIGID = 8


@dataclass(frozen=True)
class StepOptions:
    """What the integrator, and contacts that change velocities, compile of a step.

    Attributes:
        bits: Precision, 32 or 64.
        held: Whether any component is held.
        loaded: Whether external forces act.
        damped: Whether there is mass damping.
        tracked: Whether work and losses are summed per point.
    """

    bits: int
    held: bool
    loaded: bool
    damped: bool
    tracked: bool


@dataclass(frozen=True)
class IntegrationKernels:
    """Kernels of one configuration.

    Attributes:
        drift: Pointwise stage: first half kick and drift.
        kick: Pointwise stage: second half kick.
    """

    drift: Pointwise
    kick: Pointwise


@functools.cache
def free_components(bits: int) -> wp.Function:
    """Function (held bits, mask, v) -> v with held components zero, and zero if the point has a bit of `mask`."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.func
    def without_held(held_bits: wp.uint8, mask: int, v: vec3):
        for c in range(3):
            if (wp.int32(held_bits) & ((1 << c) | mask)) != 0:
                v[c] = real(0.0)
        return v

    return without_held


@functools.cache
def integration(options: StepOptions) -> IntegrationKernels:
    """Kernels of the explicit integrator."""
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    held, loaded, damped, tracked = options.held, options.loaded, options.damped, options.tracked
    rigid = RIGID
    without_held = free_components(options.bits)

    @wp.func
    def power(held_bits: wp.uint8, internal: vec3, external: vec3, velocity: vec3):
        """Power of external forces and of the supports, whose reactions balance the internal force."""
        rate = wp.float64(0.0)
        if (wp.int32(held_bits) & rigid) != 0:
            return wp.float64(wp.dot(external, velocity))
        for c in range(3):
            if (wp.int32(held_bits) & (1 << c)) != 0:
                rate -= wp.float64(internal[c] * velocity[c])
            else:
                rate += wp.float64(external[c] * velocity[c])
        return rate

    @wp.struct
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

    @pointwise(Motion, writes=("displacement", "velocity", "work", "dissipated"))
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
            if wp.static(tracked and damped):
                moving = half
                if wp.static(held):
                    moving = without_held(a.held_mask[i], 0, half)
                a.dissipated[i] = a.dissipated[i] + wp.float64(
                    real(0.5) * dt * a.damping[0] * a.mass[i] * wp.dot(v, moving)
                )
            a.displacement[i] = a.displacement[i] + dt * half
            a.velocity[i] = half

    @pointwise(Motion, writes=("velocity", "work", "dissipated"))
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
            moving = half
            if wp.static(held):
                bits_here = a.held_mask[i]
                for c in range(3):
                    if (wp.int32(bits_here) & ((1 << c) | rigid)) != 0:
                        v[c] = half[c]
                moving = without_held(bits_here, 0, moving)
                if wp.static(tracked):
                    load = total - a.force[i]
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt) * power(bits_here, a.force[i], load, half)
            else:
                if wp.static(tracked and loaded):
                    a.work[i] = a.work[i] + wp.float64(real(0.5) * dt * wp.dot(a.external[i], half))
            if wp.static(tracked and damped):
                loss = real(0.5) * dt * a.damping[0] * a.mass[i] * wp.dot(v, moving)
                a.dissipated[i] = a.dissipated[i] + wp.float64(loss)
            a.velocity[i] = v

    return IntegrationKernels(drift, kick)


@functools.cache
def half_step(options: StepOptions) -> tuple[wp.Function, wp.Function]:
    """Velocity changes of a half step, for contacts that change velocities in the same half step.

    With a = c dt/2, half kicks k and k', and changes of the velocity p after the first half kick and s at the end,
        u = (1 - a) v + k + p,     (1 + a) (v' - s) = u + k',
    so the point gets the impulses m p and m q, q = (1 + a) s. Energy at half steps changes by the force's work along u,
        m p.(v + p/2) + m q.(v' - q/2)   and   -a m (v + v').u,
    exactly. Drift and kick sum up a m v.(u - p) and a m (v' - s).u of the loss; contacts add a m p.v and a m s.u.

    Returns:
        (i, step, mass, force, external) -> change of velocity due to the forces; (step, damping) -> c dt / 2.
    """
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    loaded, damped = options.loaded, options.damped

    @wp.func
    def half_kick(
        i: int,
        step: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
    ):
        total = force[i]
        if wp.static(loaded):
            total += external[i]
        return (real(0.5) * step[0] / mass[i]) * total

    @wp.func
    def half_loss(step: wp.array(dtype=real), damping: wp.array(dtype=real)):
        loss = real(0.0)
        if wp.static(damped):
            loss = real(0.5) * step[0] * damping[0]
        return loss

    return half_kick, half_loss


@functools.cache
def kinetic_energy(options: StepOptions) -> Kernel:
    """Kernel of the kinetic energy of each point [J]; held components do not count.

    If work and losses are summed, it also fills `half_step` with m v(n-1/2) v(n+1/2) / 2.
    """
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    held, loaded, damped, tracked = options.held, options.loaded, options.damped, options.tracked
    rigid = RIGID
    without_held = free_components(options.bits)

    @kernel()
    def kinetic_energy(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=wp.float64),
        half_step: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        v = velocity[i]
        if wp.static(held):
            v = without_held(held_mask[i], 0, v)
        out[i] = wp.float64(real(0.5) * mass[i] * wp.dot(v, v))
        if wp.static(tracked):
            change = force[i]
            if wp.static(loaded):
                change += external[i]
            change = (real(0.5) * step[0] / mass[i]) * change
            if wp.static(damped):
                change -= real(0.5) * step[0] * damping[0] * v
            if wp.static(held):
                change = without_held(held_mask[i], rigid, change)
            half_step[i] = out[i] - wp.float64(real(0.5) * mass[i] * wp.dot(change, change))

    return kinetic_energy


@functools.cache
def clock(bits: int) -> Kernel:
    """Kernel `tick`, which advances the time and evaluates the schedules."""
    vec3 = numeric(bits).vec3

    @wp.func
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
        elif time >= knots[left]:
            k = int(left)
            after = int(last)
            while after - k > 1:
                middle = (k + after) // 2
                if time >= knots[middle]:
                    k = middle
                else:
                    after = middle
            fraction = (time - knots[k]) / (knots[k + 1] - knots[k])
            result = values[k] + fraction * (values[k + 1] - values[k])
        return result

    @kernel(per="once")
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
            scheduled[s] = vec3(value)
            value = evaluate(soon, begins, knots, values, s)
            scheduled[count + s] = vec3(value)

    return tick


@functools.cache
def prescribed_motion(bits: int, placed: bool, turned: bool) -> Pointwise:
    """Pointwise stage `prescribe`: sets the velocity that takes points to their prescribed positions in one step.

    Motions of a sheet stretched before it was clamped (`placed`) start from `origins` [m]. Points that turn (`turned`)
    also have the schedule of an angle [rad], and vectors `away` from the axis and `across` both [m].
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Prescribed:
        rows: wp.array(dtype=wp.int32)
        schedules: wp.array(dtype=wp.vec3i)
        scheduled: wp.array(dtype=vec3)
        origins: wp.array(dtype=vec3)
        turns: wp.array(dtype=wp.int32)
        away: wp.array(dtype=vec3)
        across: wp.array(dtype=vec3)
        step: wp.array(dtype=real)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)

    @pointwise(Prescribed, writes=("velocity",))
    def prescribe(begin: int, end: int, a: Prescribed):
        for i in range(begin, end):
            row = a.rows[i]
            if row >= 0:
                v = a.velocity[i]
                moved = a.displacement[i]
                if wp.static(placed):
                    moved -= a.origins[i]
                if wp.static(turned):
                    turn = a.turns[row]
                    if turn >= 0:
                        angle = a.scheduled[turn][0]
                        half = wp.sin(real(0.5) * angle)
                        moved += real(2.0) * half * half * a.away[row] - wp.sin(angle) * a.across[row]
                for c in range(3):
                    s = a.schedules[row][c]
                    if s >= 0:
                        v[c] = (a.scheduled[s][c] - moved[c]) / a.step[0]
                a.velocity[i] = v

    return prescribe
