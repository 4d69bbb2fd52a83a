"""Quantities that the host reads at frames: sums over points, whether all values are finite, the largest speed.

Each thread sums a block of points in order, so sums are reproducible bit for bit; the host adds the blocks.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .block_sums import BLOCK
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
