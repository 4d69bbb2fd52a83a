"""Power iteration with momentum for the largest natural frequency, using finite differences of the force.

The trial displacement is u + s e v, where e moves the largest component of v by `reach`. K v is the central difference
of the force. The update is v <- M^-1 K v - b v', where v' is the previous direction, b = (DAMPED lambda / 2)^2 and
lambda is the current estimate. Modes with eigenvalues up to DAMPED lambda then grow at the same rate, and the mode of
lambda grows 1.15 times as fast. Without momentum (b = 0), a mode at 0.99 lambda falls behind by only 1 % per iteration.
Source: De Sa, He, Mitliagkas, Re, Xu, "Accelerated stochastic power iteration", AISTATS 2018 (without its sampling).
`respond` sums each block of points in order and `summarise` adds the blocks in order, so the sums are reproducible bit
for bit. On a GPU the threads of a warp do it together: one alone would wait for memory at every point or block.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .block_sums import BLOCK
from .effects import Kernel, kernel
from .integrate import RIGID, free_components
from .numeric import numeric
from .threads import value_of_lane

# Eigenvalues up to this fraction of the largest found so far are damped equally. A larger fraction would end nearer to
# lambda, but more slowly.
DAMPED = 0.99
# Size of the noise, where the largest component of the direction is 1.
NOISE = 0.05


@dataclass(frozen=True)
class PowerIteration:
    """Kernels of one precision.

    Attributes:
        disturb: Adds noise to the free components of the direction, the same on any number of processes, and discards
            the earlier direction.
        trial: Displacement plus or minus a small multiple of the direction.
        respond: Response M^-1 K v, which overwrites the second force; per block: v M v, v K v, mass-weighted
            |response|^2, max |response|.
        summarise: Squared frequency from the sums of the blocks, the scale of the next direction, and b.
        renew: The next direction, and the last one rescaled to match.
    """

    disturb: Kernel
    trial: Kernel
    respond: Kernel
    summarise: Kernel
    renew: Kernel


@functools.cache
def power_iteration(bits: int, lanes: int) -> PowerIteration:
    """Kernels of a precision; `lanes`: threads that share a block in `respond`, and those of `summarise`."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    rigid, block = RIGID, BLOCK
    quarter = wp.constant(wp.float64(0.25 * DAMPED**2))
    noise_size = wp.constant(real(NOISE))
    without_held = free_components(bits)
    value_of, module = value_of_lane(64), f"power_iteration_{bits}_{lanes}"

    @kernel(module=module)
    def disturb(
        held_mask: wp.array(dtype=wp.uint8),
        numbers: wp.array(dtype=int),
        seed: wp.array(dtype=int),
        first: int,
        earlier: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        number = i
        if numbers:
            number = numbers[i]
        random = wp.rand_init(seed[0], number)
        noise = vec3()
        for c in range(3):
            noise[c] = noise_size * real(wp.randf(random, -1.0, 1.0))
        if held_mask:
            noise = without_held(held_mask[i], rigid, noise)
        direction[i] += noise
        earlier[i] = vec3()

    @kernel(module=module)
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

    @kernel(per="block", module=module)
    def respond(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        plus: wp.array(dtype=vec3),
        reach: wp.array(dtype=real),
        direction: wp.array(dtype=vec3),
        first: int,
        response: wp.array(dtype=vec3),
        sums: wp.array2d(dtype=wp.float64),
    ):
        thread = wp.tid() + first
        b = thread // wp.static(lanes)
        norm = wp.float64(0.0)
        product = wp.float64(0.0)
        image = wp.float64(0.0)
        largest = wp.float64(0.0)
        for begin in range(b * block, wp.min((b + 1) * block, direction.shape[0]), wp.static(lanes)):
            i = begin + thread % wp.static(lanes)
            m = wp.float64(0.0)
            v = vec3()
            r = vec3()
            if i < direction.shape[0]:
                m = wp.float64(mass[i])
                v = direction[i]
                r = (response[i] - plus[i]) / (real(2.0) * reach[0] * mass[i])
                if held_mask:
                    r = without_held(held_mask[i], rigid, r)
                response[i] = r
            vv = m * wp.float64(wp.dot(v, v))
            vr = m * wp.float64(wp.dot(v, r))
            rr = m * wp.float64(wp.dot(r, r))
            most = wp.float64(wp.max(wp.max(wp.abs(r[0]), wp.abs(r[1])), wp.abs(r[2])))
            for k in range(wp.static(lanes)):
                norm += value_of(vv, k, wp.static(lanes))
                product += value_of(vr, k, wp.static(lanes))
                image += value_of(rr, k, wp.static(lanes))
                largest = wp.max(largest, value_of(most, k, wp.static(lanes)))
        if thread % wp.static(lanes) == 0:
            sums[0, b] = norm
            sums[1, b] = product
            sums[2, b] = image
            sums[3, b] = largest

    @wp.func
    def total(sums: wp.array2d(dtype=wp.float64), row: int, lane: int):
        """Sum of a row, in order."""
        found = wp.float64(0.0)
        for begin in range(0, sums.shape[1], wp.static(lanes)):
            value = wp.float64(0.0)
            if begin + lane < sums.shape[1]:
                value = sums[row, begin + lane]
            for k in range(wp.static(lanes)):
                found += value_of(value, k, wp.static(lanes))
        return found

    @kernel(per="once", module=module)
    def summarise(
        sums: wp.array2d(dtype=wp.float64),
        first: int,
        scale: wp.array(dtype=real),
        momentum: wp.array(dtype=real),
        squared_frequency: wp.array(dtype=wp.float64),
    ):
        lane = wp.tid() + first
        norm = total(sums, 0, lane)
        product = total(sums, 1, lane)
        image = total(sums, 2, lane)
        most = wp.float64(0.0)
        for b in range(lane, sums.shape[1], wp.static(lanes)):
            most = wp.max(most, sums[3, b])
        largest = wp.float64(0.0)
        for k in range(wp.static(lanes)):
            largest = wp.max(largest, value_of(most, k, wp.static(lanes)))
        if lane > 0:
            return
        scale[0] = real(0.0)
        if largest > wp.float64(0.0):
            scale[0] = real(wp.float64(1.0) / largest)
        momentum[0] = real(0.0)
        squared_frequency[0] = wp.float64(0.0)
        squared_frequency[1] = wp.float64(0.0)
        if norm > wp.float64(0.0):
            squared_frequency[0] = product / norm
            squared_frequency[1] = wp.sqrt(image / norm)
            momentum[0] = real(quarter * image / norm)

    @kernel(module=module)
    def renew(
        response: wp.array(dtype=vec3),
        scale: wp.array(dtype=real),
        momentum: wp.array(dtype=real),
        first: int,
        earlier: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        v = direction[i]
        direction[i] = scale[0] * (response[i] - momentum[0] * earlier[i])
        earlier[i] = scale[0] * v

    return PowerIteration(disturb, trial, respond, summarise, renew)
