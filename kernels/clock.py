"""The clock, which evaluates schedules on the device, and prescribed motions.

A schedule is a piecewise linear function of time, three values per knot; schedule s has the knots begins[s] to
begins[s+1] - 1. Before its first and after its last knot it is constant. `tick` advances the time by a number of steps
and evaluates every schedule s of S twice: scheduled[s] is the value now, scheduled[S + s] the value one step later, for
stages that move points before the next tick.
"""

import functools

import warp as wp

from .effects import Kernel, Pointwise, kernel, pointwise
from .numeric import numeric


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
