"""Adjacent threads of a warp of a GPU that share a family. On a CPU a family has one thread."""

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
