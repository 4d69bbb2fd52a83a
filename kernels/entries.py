"""Entries of contiguous arrays, read with fewer instructions."""

import functools
from typing import Any

import warp as wp


@functools.cache
def entry_of(kind: Any, dimension: int) -> wp.Function:
    """Function (array, number) -> an entry of a contiguous array, by its number in memory.

    An array may have any strides, which a thread would have to read and multiply for each of its axes.
    """
    Values: Any = wp.array(dtype=kind, ndim=dimension)

    @wp.func_native("return values.data[number];")
    def entry(values: Values, number: int) -> kind: ...

    return entry
