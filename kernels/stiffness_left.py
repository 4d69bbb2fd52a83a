"""Degradation functions: by what factor damage reduces the stiffness of a family (kernels/tearing/damage_field.py)."""

import functools
from typing import Any

import warp as wp

from .effects import Kernel, kernel
from .numeric import numeric


@functools.cache
def stiffness_left(bits: int) -> wp.Function:
    """Function d -> g(d) = (1 - d)^2."""
    real = numeric(bits).real

    @wp.func
    def stiffness_left(damage: real):
        return (real(1.0) - damage) * (real(1.0) - damage)

    return stiffness_left


@functools.cache
def degradation(bits: int, weak: bool) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions of (d, m) that return g, -dg/dd and d²g/dd², where m is -dg/dd at d = 0.

    `weak`: Lorentz's g, which falls faster at first; otherwise (1 - d)^2, with m = 2.
    """
    real = numeric(bits).real

    if not weak:

        @wp.func
        def left(d: real, m: real):
            return (real(1.0) - d) * (real(1.0) - d)

        @wp.func
        def fall(d: real, m: real):
            return real(2.0) * (real(1.0) - d)

        @wp.func
        def curvature(d: real, m: real):
            return real(2.0)

        return left, fall, curvature

    @wp.func
    def shape(m: real):
        return wp.min(real(1.0), real(1.5) * (m - real(2.0)) - real(0.5))

    @wp.func
    def below(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) + m * d * (real(1.0) + shape(m) * d)

    @wp.func
    def left(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) / below(d, m)

    @wp.func
    def fall(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        return m * (real(1.0) - d) * (real(1.0) + growth * d) / (below(d, m) * below(d, m))

    @wp.func
    def curvature(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        bottom = below(d, m)
        top = (real(1.0) - d) * (real(1.0) + growth * d)
        top_slope = growth - real(1.0) - real(2.0) * growth * d
        bottom_slope = m * (real(1.0) + real(2.0) * shape(m) * d) - real(2.0) * (real(1.0) - d)
        return m * (real(2.0) * top * bottom_slope - top_slope * bottom) / (bottom * bottom * bottom)

    return left, fall, curvature


@functools.cache
def soften(bits: int, value: Any) -> Kernel:
    """Kernel that reduces a value of each family, such as an energy or a stress, by the damage of its point."""
    real, left = numeric(bits).real, stiffness_left(bits)

    @kernel()
    def soften(damage: wp.array(dtype=real), first: int, values: wp.array(dtype=value)):
        i = wp.tid() + first
        values[i] = value(left(damage[i])) * values[i]

    return soften
