"""Derivative of a force along a direction by a central difference: f'(u) v = [f(u + e v) - f(u - e v)] / 2e.

The step e moves the point that v moves most by a given distance. What another tangent has more with an added tension
than without (`bare`), which no force has, is added.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric


@functools.cache
def differences(bits: int) -> tuple[Kernel, Kernel, Kernel]:
    """Kernels `find_step` (e), `displace` (u + e v and u - e v) and `difference`."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @kernel(per="once")
    def find_step(direction: wp.array(dtype=vec3), distance: real, first: int, step: wp.array(dtype=real)):
        longest = real(0.0)
        for i in range(direction.shape[0]):
            longest = wp.max(longest, wp.length(direction[i]))
        step[0] = distance / wp.max(longest, real(1.0e-30))

    @kernel()
    def displace(
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        first: int,
        ahead: wp.array(dtype=vec3),
        behind: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        ahead[i] = displacement[i] + step[0] * direction[i]
        behind[i] = displacement[i] - step[0] * direction[i]

    @kernel()
    def difference(
        force_ahead: wp.array(dtype=vec3),
        force_behind: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        bare: wp.array(dtype=vec3),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        """`change` holds the product of the other tangent with the added tension before."""
        i = wp.tid() + first
        change[i] = (change[i] - bare[i]) + (force_ahead[i] - force_behind[i]) / (real(2.0) * step[0])

    return find_step, displace, difference
