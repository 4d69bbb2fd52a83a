"""Fast access to entries of contiguous arrays."""

import functools
from typing import Any

import warp as wp


@functools.cache
def entry_of(kind: Any, dimension: int, index: Any = wp.int32) -> wp.Function:
    """Function (array, number) -> entry of a contiguous array by its flat index, of the integer type `index`.

    It saves reading and multiplying the strides of each axis.
    """
    Values: Any = wp.array(dtype=kind, ndim=dimension)

    @wp.func_native("return values.data[number];")
    def entry(values: Values, number: index) -> kind: ...

    return entry


@functools.cache
def put_entry(kind: Any, dimension: int, index: Any = wp.int32) -> wp.Function:
    """Function (array, number, value) that writes an entry of a contiguous array, as for `entry_of`."""
    Values: Any = wp.array(dtype=kind, ndim=dimension)

    @wp.func_native("values.data[number] = value;")
    def put(values: Values, number: index, value: kind): ...

    return put
