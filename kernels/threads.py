"""Threads of a GPU that work together: lanes and barriers. A CPU thread works alone.

Lanes are adjacent threads of a warp that share a family. A barrier is where the threads of a block, or of all blocks,
need what others wrote earlier in a launch. Blocks that wait must all run at the same time: a launch that uses it may
have one block for each multiprocessor.
"""

import functools

import warp as wp

from .numeric import numeric

# Threads that share a family: a warp, or half of one if the family has no more members.
WARP = 32

# Mask of the threads of a warp that share the family of a thread.
_OWN = "const unsigned own = ((1ull << lanes) - 1u) << (threadIdx.x % 32u / lanes * lanes);"

_SUM_OF_LANES = f"""
#if defined(__CUDA_ARCH__)
    {_OWN}
    for (int apart = lanes / 2; apart > 0; apart /= 2) value += __shfl_xor_sync(own, value, apart);
#endif
    return value;
"""

_VALUE_OF_LANE = f"""
#if defined(__CUDA_ARCH__)
    {_OWN}
    return __shfl_sync(own, value, lane, lanes);
#else
    return value;
#endif
"""


def lanes_of(members: int) -> int:
    """Number of threads of a GPU that share a family."""
    return WARP // 2 if 2 * members <= WARP else WARP


@functools.cache
def sum_of_lanes(bits: int) -> wp.Function:
    """Function (value, lanes) -> sum over adjacent threads of a warp, in the same order for all of them."""
    real = numeric(bits).real

    @wp.func_native(_SUM_OF_LANES)
    def summed(value: real, lanes: int) -> real: ...

    return summed


@functools.cache
def value_of_lane(bits: int) -> wp.Function:
    """Function (value, lane, lanes) -> the value of one of the threads; all of them must call it."""
    real = numeric(bits).real

    @wp.func_native(_VALUE_OF_LANE)
    def value_of(value: real, lane: int, lanes: int) -> real: ...

    return value_of


# As in cooperative groups: block 0 adds what, together with one from each other block, flips the highest bit. So the
# counter needs no reset, and the number of blocks may differ from launch to launch.
_WAIT = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (threadIdx.x == 0 && blocks > 1) {
        const unsigned own = blockIdx.x == 0 ? 0x80000000u - static_cast<unsigned>(blocks - 1) : 1u;
        unsigned before, now;
        asm volatile("atom.add.release.gpu.u32 %0, [%1], %2;"
                     : "=r"(before) : "l"(arrived.data), "r"(own) : "memory");
        do {
            asm volatile("ld.acquire.gpu.u32 %0, [%1];" : "=r"(now) : "l"(arrived.data) : "memory");
        } while (((before ^ now) & 0x80000000u) == 0u);
    }
    __syncthreads();
#endif
"""


@wp.func_native("WP_TILE_SYNC();")
def synchronize():
    """Barrier for all threads of the block; their writes to shared tiles are then visible."""
    ...


@wp.func_native(_WAIT)
def wait_for_blocks(arrived: wp.array(dtype=wp.int32), blocks: int):
    """Wait until all threads of the first `blocks` blocks of a launch have come here; on a CPU it does nothing.

    What they wrote before is then visible to all of them. Every thread of these blocks must call it, and no others.
    arrived: an array with one entry, zero at the start, for barriers alone.
    """
    ...
