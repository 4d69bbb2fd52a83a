"""Sums over points by blocks, in a fixed order: the same bits on any device and any number of processes.

A thread sums a block of points. The host adds the blocks of what it reads at frames: sums, whether all values are
finite, the largest speed. On the device, where there are many blocks, a thread sums a group of them, so that a single
one can add up the rest.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .effects import Kernel, kernel
from .numeric import numeric


@dataclass(frozen=True)
class FrameChecks:
    """Kernels of one configuration; each launch has one thread per block of points.

    Attributes:
        watch_motion: Lowest index of a point of the block whose displacement or velocity is NaN or infinite (the number
            of points if all are finite), and the largest squared speed.
        sum_blocks: Sum of float64 numbers.
        sum_vectors: Sum of vectors, one row per component.
    """

    watch_motion: Kernel
    sum_blocks: Kernel
    sum_vectors: Kernel


@functools.cache
def frame_checks(bits: int) -> FrameChecks:
    """Kernels for a precision."""
    vec3 = numeric(bits).vec3
    block = BLOCK
    module = f"frame_checks_{bits}"

    @kernel(per="block", module=module)
    def watch_motion(
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        first: int,
        not_finite: wp.array(dtype=wp.int32),
        fastest: wp.array(dtype=wp.float64),
    ):
        b = wp.tid() + first
        points = velocity.shape[0]
        lowest = points
        largest = wp.float64(0.0)
        for i in range(b * block, wp.min((b + 1) * block, points)):
            v = velocity[i]
            if not (wp.isfinite(displacement[i]) and wp.isfinite(v)):
                lowest = wp.min(lowest, i)
            x, y, z = wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2])
            largest = wp.max(largest, x * x + y * y + z * z)
        not_finite[b] = lowest
        fastest[b] = largest

    @kernel(per="block", module=module)
    def sum_blocks(values: wp.array(dtype=wp.float64), row: int, first: int, sums: wp.array2d(dtype=wp.float64)):
        b = wp.tid() + first
        total = wp.float64(0.0)
        for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
            total += values[i]
        sums[row, b] = total

    @kernel(per="block", module=module)
    def sum_vectors(values: wp.array(dtype=vec3), row: int, first: int, sums: wp.array2d(dtype=wp.float64)):
        b = wp.tid() + first
        total = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
            v = values[i]
            total += wp.vec3d(v)
        for c in range(3):
            sums[row + c, b] = total[c]

    return FrameChecks(watch_motion, sum_blocks, sum_vectors)


# Points of a block.
BLOCK = 64
# Blocks up to which a single thread adds all up: it takes some 0.2 us for each. More are summed by groups first.
MANY_BLOCKS, GROUP = 256, 64


@kernel(per="once")
def add_groups(
    sums: wp.array2d(dtype=wp.float64), maxima: int, group: int, first: int, shorter: wp.array2d(dtype=wp.float64)
):
    """Add groups of blocks in order; of the last `maxima` rows, whose values are not negative, take the largest."""
    rows = sums.shape[0]
    t = wp.tid() + first
    row = t % rows
    g = t // rows
    total = wp.float64(0.0)
    for b in range(g * group, wp.min((g + 1) * group, sums.shape[1])):
        if row < rows - maxima:
            total += sums[row, b]
        else:
            total = wp.max(total, sums[row, b])
    shorter[row, g] = total
