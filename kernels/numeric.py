"""Scalar, vector and matrix types of one precision, fast access to entries of their arrays, and fast division."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import warp as wp


@dataclass(frozen=True)
class Numeric:
    """Warp types of one floating-point precision.

    Attributes:
        vec2: Vector on the reference sheet.
        vec3: Vector in space.
        mat22: Tensor on the reference sheet.
        mat32: Two-point tensor: columns are images of the sheet's two directions.
        mat33: Tensor in space.
        vec6: Symmetric 3x3 matrix, by rows: 11, 12, 13, 22, 23, 33.
        parameters: Up to four constants, such as those of a material.
    """

    bits: int
    real: Any
    vec2: Any
    vec3: Any
    mat22: Any
    mat32: Any
    mat33: Any
    vec6: Any
    parameters: Any

    def constants(self, count: int) -> Any:
        """Vector type for `count` material constants; `parameters` for up to four."""
        return wp.types.vector(length=max(count, 4), dtype=self.real)


@functools.cache
def numeric(bits: int) -> Numeric:
    """Types for `bits` = 32 or 64. Raises ValueError for any other precision."""
    if bits not in (32, 64):
        raise ValueError(f"precision = {bits!r}: expected 32 or 64")
    real = wp.float32 if bits == 32 else wp.float64
    return Numeric(
        bits=bits,
        real=real,
        vec2=wp.types.vector(length=2, dtype=real),
        vec3=wp.types.vector(length=3, dtype=real),
        mat22=wp.types.matrix(shape=(2, 2), dtype=real),
        mat32=wp.types.matrix(shape=(3, 2), dtype=real),
        mat33=wp.types.matrix(shape=(3, 3), dtype=real),
        vec6=wp.types.vector(length=6, dtype=real),
        parameters=wp.types.vector(length=4, dtype=real),
    )


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


FunctionFactory: TypeAlias = Callable[[int], wp.Function]
PairFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function]]
PairwiseFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function, wp.Function]]


def constants_of(function: wp.Function) -> Any:
    """Type of the constants that a function of a material or of a law takes: `constants`, or the second argument."""
    types = function.input_types
    return types.get("constants", list(types.values())[1])


# An estimate of 20 bits, and a step of third order.
_QUOTIENT = """
#if defined(__CUDA_ARCH__)
    double inverse;
    asm("rcp.approx.ftz.f64 %0, %1;" : "=d"(inverse) : "d"(b));
    double error = fma(-b, inverse, 1.0);
    error = fma(error, error, error);
    return a * fma(inverse, error, inverse);
#else
    return a / b;
#endif
"""


@functools.cache
def division(bits: int) -> wp.Function:
    """Function (a, b) -> a / b for an ordinary b, i.e. one that is neither zero, infinite nor subnormal.

    In float64 on a GPU it is accurate to two units in the last place, and takes a third of the instructions of a
    division, which also treats the other cases. The result for another b is NaN.
    """
    real = numeric(bits).real

    @wp.func
    def quotient(a: real, b: real):
        return a / b

    @wp.func_native(_QUOTIENT)
    def double_quotient(a: wp.float64, b: wp.float64) -> wp.float64: ...

    return double_quotient if bits == 64 else quotient
