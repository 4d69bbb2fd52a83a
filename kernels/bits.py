"""Loops over family members stored in 32-bit masks.

    members = ...                                   bits of one word
    while members != wp.uint32(0):
        k = word * WORD + lowest_bit(members)       member index
        members = without_lowest_bit(members)
        ...

Members are visited in ascending order, so sums are reproducible bit for bit.
"""

import warp as wp

_LOWEST = """
#if defined(__CUDA_ARCH__)
    return __ffs(static_cast<int>(mask)) - 1;
#else
    return __builtin_ctz(mask);
#endif
"""

_NUMBER = """
#if defined(__CUDA_ARCH__)
    return __popc(mask);
#else
    return __builtin_popcount(mask);
#endif
"""


@wp.func_native(_LOWEST)
def lowest_bit(mask: wp.uint32) -> int:
    """Index of the lowest set bit; undefined for 0."""
    ...


@wp.func_native(_NUMBER)
def number_of_bits(mask: wp.uint32) -> int:
    """Number of set bits."""
    ...


@wp.func
def without_lowest_bit(mask: wp.uint32):
    """The mask with its lowest set bit cleared."""
    return mask & (mask - wp.uint32(1))


@wp.func
def bit_of(mask: wp.uint32, index: int):
    """Whether a bit, 0 to 31, is set."""
    return ((mask >> wp.uint32(index)) & wp.uint32(1)) != wp.uint32(0)
