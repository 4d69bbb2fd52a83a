"""Sums over points by blocks, in a fixed order: the same bits on any device and any number of processes.

A thread sums a block of points. Where there are many blocks, a thread then sums a group of them, so that a single one
can add up the rest.
"""

import warp as wp

from .effects import kernel

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
