"""What the host asks for at a frame."""

import functools

import warp as wp

from .numeric import numeric


@functools.cache
def finite_check(bits, module):
    """Kernel that leaves the lowest index of a point whose displacement or velocity is not finite.

    `bad` starts as the number of points and stays so when all is well.
    """
    vec3 = numeric(bits).vec3

    @wp.kernel(module=module, enable_backward=False)
    def find_not_finite(
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        first: int,
        bad: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        if not (wp.isfinite(displacement[i]) and wp.isfinite(velocity[i])):
            wp.atomic_min(bad, 0, i)

    return find_not_finite
