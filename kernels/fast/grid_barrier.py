"""Barriers of a launch, where threads need what others wrote earlier in it: of a block, and of all blocks on a GPU.

The blocks that wait must all run at the same time: a launch that uses it may have one block for each multiprocessor.
"""

import warp as wp

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
