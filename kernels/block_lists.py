"""Lists of marked entries, and sums over them in a fixed order, by blocks of threads.

Each block has its own entries, and its own part of a list, so bits repeat without a sort. Blocks take turns at every 32
entries, so that a small patch of the sheet is work for all of them. On a CPU a block has one thread. The block that
ends last adds up the sums of all blocks, in their order (as in the CUDA sample threadFenceReduction), so no launch is
spent on that.
"""

import functools
from typing import Any

import warp as wp

from .effects import kernel

_ARRIVE = """
#if defined(__CUDA_ARCH__)
    __threadfence();
    int before = atomicAdd(arrived.data, 1);
    __threadfence();
    return before;
#else
    return __atomic_fetch_add(arrived.data, 1, __ATOMIC_ACQ_REL);
#endif
"""


@wp.func_native(_ARRIVE)
def arrive(arrived: wp.array(dtype=wp.int32)) -> int:
    """Count a block, after it has written its sums; return how many came before."""
    ...


@functools.cache
def sum_of_blocks(kind: Any) -> wp.Function:
    """Function (value, count, part, lane, sums, counts, arrived) -> whether the block ends last; then also the sum.

    value, count: of a thread; values count only if a thread of the block has a nonzero count. part, lane: number of the
    block and of the thread in it. sums, counts: room for each block. arrived: zero before and after a launch. On a CPU
    a block has one thread.
    """

    # Used twice, and not inlined: the compiler spells it out for every number of `kind`.
    @wp.func(inline=False)
    def over_block(value: kind):
        """Sum over the threads of a block."""
        return wp.tile_sum(wp.tile(value, preserve_type=True))[0]

    @wp.func
    def summed(
        value: kind, count: int, part: int, lane: int, sums: wp.array(dtype=kind), counts: wp.array(dtype=wp.int32),
        arrived: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        total = value
        number = wp.tile_sum(wp.tile(count))[0]
        if number > 0:
            total = over_block(value)
        last = wp.int32(0)
        if lane == 0:
            counts[part] = number
            if number > 0:
                sums[part] = total
            if arrive(arrived) == counts.shape[0] - 1:
                arrived[0] = 0
                last = 1
        ends = wp.tile_sum(wp.tile(last))[0] > 0
        if ends:
            total = kind()
            for k in range(lane, counts.shape[0], wp.block_dim()):
                if counts[k] > 0:
                    total += sums[k]
            total = over_block(total)
        return ends, total

    return summed


@wp.func
def place_in_block(thread: int):
    """Number of the block of a thread, and number of the thread in it."""
    part = thread / wp.block_dim()
    return part, thread - part * wp.block_dim()


@wp.func
def entry_of(part: int, k: int, blocks: int):
    """The k-th entry of a block."""
    turn = k / 32
    return 32 * (turn * blocks + part) + k - 32 * turn


@kernel(per="block")
def list_marked(
    marks: wp.array(dtype=wp.uint8), block: int, first: int, entries: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Write the marked entries of each block, of `block` entries, to the beginning of its part of `entries`."""
    part, lane = place_in_block(wp.tid() + first)
    blocks = counts.shape[0]
    count = wp.int32(0)
    for k in range(lane, block, wp.block_dim()):
        i = entry_of(part, k, blocks)
        if i < marks.shape[0]:
            if marks[i] != wp.uint8(0):
                count += 1
    at = part * block + wp.untile(wp.tile_scan_exclusive(wp.tile(count)))
    if lane == wp.block_dim() - 1:
        counts[part] = at + count - part * block
    if count > 0:
        for k in range(lane, block, wp.block_dim()):
            i = entry_of(part, k, blocks)
            if i < marks.shape[0]:
                if marks[i] != wp.uint8(0):
                    entries[at] = i
                    at += 1
