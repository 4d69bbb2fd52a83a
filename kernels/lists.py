"""Lists that threads fill in any order."""

import warp as wp

_NEXT = """
#if defined(__CUDA_ARCH__)
    const unsigned together = __activemask();
    const int lane = threadIdx.x & 31, first = __ffs(together) - 1;
    int begin = 0;
    if (lane == first) begin = atomicAdd(count.data, __popc(together));
    return __shfl_sync(together, begin, first) + __popc(together & ((1u << lane) - 1u));
#else
    return count.data[0]++;
#endif
"""


@wp.func_native(_NEXT)
def next_place(count: wp.array(dtype=wp.int32)) -> int:
    """The next free place of a list with `count` entries; threads of a warp share one atomic operation."""
    ...
