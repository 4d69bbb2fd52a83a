"""Lists of marked entries, and sums over them in a fixed order, by blocks of threads.

Each block has its own entries, and its own part of a list, so bits repeat without a sort. Blocks take turns at every 32
entries, so that a small patch of the sheet is work for all of them. On a CPU a block has one thread. The block that
ends last adds up the sums of all blocks, in their order (as in the CUDA sample threadFenceReduction), so no launch is
spent on that.
"""

import functools
from typing import Any

import warp as wp

from ..effects import kernel
from ..families import lowest_bit, number_of_bits, without_lowest_bit

# Whether any thread of the block has a nonzero count; on a CPU the count itself.
_ANY = """
#if defined(__CUDA_ARCH__)
    return __syncthreads_or(count);
#else
    return count;
#endif
"""

# An exchange between lanes that are HALF apart; a loop over all exchanges would not be unrolled.
_EXCHANGE = """
    #pragma unroll
    for (int k = 0; k < HALF; ++k) {
        const bool upper = (lane & HALF) != 0;
        const double given = upper ? v[k] : v[k + HALF];
        v[k] = (upper ? v[k + HALF] : v[k]) + __shfl_xor_sync(0xffffffffu, given, HALF);
    }
"""

# The sum over the threads of a block to sums[part]. In each of five exchanges a lane of a warp keeps half of the
# components that it has, and in the end the sum of one over the warp; then the first warp adds up all warps.
_TO_BLOCK = """
#if defined(__CUDA_ARCH__)
    __shared__ double rows[(WP_TILE_BLOCK_DIM + 31) / 32][32];
    const int lane = threadIdx.x % 32, warp = threadIdx.x / 32, warps = (blockDim.x + 31) / 32;
    double v[32];
    #pragma unroll
    for (int k = 0; k < 32; ++k) v[k] = k < LENGTH ? value.c[k < LENGTH ? k : 0] : 0.0;
    EXCHANGES
    rows[warp][lane] = v[0];
    __syncthreads();
    if (warp == 0 && lane < LENGTH) {
        double total = v[0];
        for (int w = 1; w < warps; ++w) total += rows[w][lane];
        reinterpret_cast<double*>(sums.data)[LENGTH * part + lane] = total;
    }
#else
    sums.data[part] = value;
#endif
""".replace("EXCHANGES", "".join(_EXCHANGE.replace("HALF", str(half)) for half in (16, 8, 4, 2, 1)))

# Whether all other blocks have come here before; then their sums and counts can be read.
_IS_LAST = """
#if defined(__CUDA_ARCH__)
    __shared__ int last;
    __syncthreads();
    if (threadIdx.x == 0) {
        int before;
        asm volatile("atom.add.acq_rel.gpu.s32 %0, [%1], 1;" : "=r"(before) : "l"(arrived.data) : "memory");
        last = before == blocks - 1;
        if (last) arrived.data[0] = 0;
    }
    __syncthreads();
    return last;
#else
    const bool last = __atomic_fetch_add(arrived.data, 1, __ATOMIC_ACQ_REL) == blocks - 1;
    if (last) arrived.data[0] = 0;
    return last;
#endif
"""

# The sum over blocks that have counted something, for the first thread. Other blocks have written what is read here, so
# the first cache is passed by.
_OF_BLOCKS = """
    auto total = zero;
#if defined(__CUDA_ARCH__)
    __shared__ double rows[(WP_TILE_BLOCK_DIM + 31) / 32][32];
    const int lane = threadIdx.x % 32, warp = threadIdx.x / 32, warps = (blockDim.x + 31) / 32;
    const double* given = reinterpret_cast<const double*>(sums.data) + (lane < LENGTH ? lane : 0);
    double sum = 0.0;
    #pragma unroll 16
    for (int k = warp; k < blocks; k += warps) {
        const double found = __ldcg(given + LENGTH * k);
        if (__ldcg(counts.data + k) > 0) sum += found;
    }
    rows[warp][lane] = sum;
    __syncthreads();
    if (warp == 0) {
        for (int w = 1; w < warps; ++w) sum += rows[w][lane];
        rows[0][lane] = sum;
        __syncwarp();
        #pragma unroll
        for (int k = 0; k < LENGTH; ++k) total.c[k] = rows[0][k];
    }
#else
    for (int k = 0; k < blocks; ++k)
        if (counts.data[k] > 0) total = wp::add(total, sums.data[k]);
#endif
    return total;
"""

# Bit k is set if entry begin + k is marked.
_MARKED = """
    unsigned mask = 0u;
#if defined(__CUDA_ARCH__)
    if (begin + 32 <= marks.shape[0]) {
        const uint4* words = reinterpret_cast<const uint4*>(marks.data + begin);
        const uint4 a = words[0], b = words[1];
        const unsigned all[8] = {a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w};
        #pragma unroll
        for (int k = 0; k < 8; ++k) {
            // A byte that is not 0 sets its lowest bit, and these bits move together.
            unsigned w = all[k] | all[k] >> 4;
            w |= w >> 2;
            w = (w | w >> 1) & 0x01010101u;
            mask |= (w * 0x10204080u >> 28) << (4 * k);
        }
        return mask;
    }
#endif
    for (int k = 0; k < 32 && begin + k < marks.shape[0]; ++k)
        if (marks.data[begin + k]) mask |= 1u << k;
    return mask;
"""


@wp.func_native(_ANY)
def any_of_block(count: int) -> int: ...


@wp.func_native(_IS_LAST)
def is_last_block(arrived: wp.array(dtype=wp.int32), blocks: int) -> bool: ...


@wp.func_native(_MARKED)
def marked_of(marks: wp.array(dtype=wp.uint8), begin: int) -> wp.uint32: ...


@functools.cache
def sum_of_blocks(kind: Any) -> wp.Function:
    """Function (value, count, part, lane, sums, counts, arrived) -> whether the block ends last; then also the sum.

    value, count: of a thread; values count only if a thread of the block has a nonzero count. part, lane: number of the
    block and of the thread in it. sums, counts: room for each block. arrived: zero before and after a launch. The sum
    is that of the first thread. `kind`: vector of at most 32 numbers in float64.
    """
    length = str(kind._length_)

    @wp.func_native(_TO_BLOCK.replace("LENGTH", length))
    def sum_block(value: kind, part: int, sums: wp.array(dtype=kind)): ...

    @wp.func_native(_OF_BLOCKS.replace("LENGTH", length))
    def sum_all(zero: kind, blocks: int, counts: wp.array(dtype=wp.int32), sums: wp.array(dtype=kind)) -> kind: ...

    @wp.func
    def summed(
        value: kind, count: int, part: int, lane: int, sums: wp.array(dtype=kind), counts: wp.array(dtype=wp.int32),
        arrived: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        counted = any_of_block(count)
        if counted != 0:
            sum_block(value, part, sums)
        if lane == 0:
            counts[part] = counted
        ends = is_last_block(arrived, counts.shape[0])
        total = kind()
        if ends:
            total = sum_all(kind(), counts.shape[0], counts, sums)
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


@wp.func
def list_of_block(
    marks: wp.array(dtype=wp.uint8), block: int, part: int, lane: int, entries: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Write the marked entries of a block, of `block` entries, to the beginning of its part of `entries`."""
    blocks = counts.shape[0]
    count = wp.int32(0)
    for turn in range(lane, block / 32, wp.block_dim()):
        count += number_of_bits(marked_of(marks, entry_of(part, 32 * turn, blocks)))
    at = part * block + wp.untile(wp.tile_scan_exclusive(wp.tile(count)))
    if lane == wp.block_dim() - 1:
        counts[part] = at + count - part * block
    if count > 0:
        for turn in range(lane, block / 32, wp.block_dim()):
            begin = entry_of(part, 32 * turn, blocks)
            marked = marked_of(marks, begin)
            while marked != wp.uint32(0):
                entries[at] = begin + lowest_bit(marked)
                marked = without_lowest_bit(marked)
                at += 1


@kernel(per="block")
def list_marked(
    marks: wp.array(dtype=wp.uint8), block: int, first: int, entries: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Write the marked entries of each block to its part of `entries`."""
    part, lane = place_in_block(wp.tid() + first)
    list_of_block(marks, block, part, lane, entries, counts)
