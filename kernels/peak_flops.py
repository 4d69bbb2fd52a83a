"""Peak arithmetic rate of a device: a kernel of multiply-adds that access no memory."""

import functools

import warp as wp

from .effects import unstaged
from .numeric import numeric


@functools.cache
def multiply_add(bits: int) -> wp.Kernel:
    """Kernel with eight sums per thread of `rounds` multiply-adds each."""
    real = numeric(bits).real

    @unstaged
    def multiply_adds(rounds: int, first: int, out: wp.array(dtype=real)):
        i = wp.tid() + first
        x = real(1.0) + real(1.0e-7) * real(i)
        a = real(0.1)
        b = real(0.2)
        c = real(0.3)
        d = real(0.4)
        e = real(0.5)
        f = real(0.6)
        g = real(0.7)
        h = real(0.8)
        for _round in range(rounds):
            a = a * x + b
            b = b * x + c
            c = c * x + d
            d = d * x + e
            e = e * x + f
            f = f * x + g
            g = g * x + h
            h = h * x + real(1.0e-9)
        out[i] = a + b + c + d + e + f + g + h

    return multiply_adds
