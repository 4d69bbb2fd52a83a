"""Division in the innermost loops of materials."""

import functools

import warp as wp

from .numeric import numeric

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
