"""Adaptive mass damping for dynamic relaxation: critical damping of the lowest mode still in motion.

The Rayleigh quotient of the last step, omega^2 = (v . K v) / (v . M v) with K v = -(change of force) / dt, tends to the
square of the lowest frequency still in motion; c = 2 omega damps that mode critically. Source: Underwood's adaptive
dynamic relaxation, with the tangent along the motion instead of a diagonal stiffness.
"""

import functools

import warp as wp

from ..block_sums import BLOCK
from ..effects import Kernel, kernel
from ..integrate import free_components
from ..numeric import numeric


@functools.cache
def adaptive_damping(bits: int, following: bool) -> tuple[Kernel, Kernel]:
    """Kernels `measure_motion` (sums blocks of points in a fixed order) and `set_damping` (a single thread).

    `following`: loads depend on the displacement; the external force is then part of the stiffness.
    """
    types = numeric(bits)
    real, vec3, block = types.real, types.vec3, BLOCK
    without_held = free_components(bits)

    @kernel(per="block")
    def measure_motion(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        previous: wp.array(dtype=vec3),
        sums: wp.array2d(dtype=wp.float64),
    ):
        b = wp.tid() + first
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for i in range(b * block, wp.min((b + 1) * block, velocity.shape[0])):
            v = velocity[i]
            if held_mask:
                v = without_held(held_mask[i], 0, v)
            total = force[i]
            if wp.static(following):
                total += external[i]
            inertia += wp.float64(mass[i] * wp.dot(v, v))
            stiffness += wp.float64(wp.dot(v, previous[i] - total))
            previous[i] = total
        sums[0, b] = inertia
        sums[1, b] = stiffness

    @kernel(per="once")
    def set_damping(
        sums: wp.array2d(dtype=wp.float64),
        step: wp.array(dtype=real),
        first: int,
        damping: wp.array(dtype=real),
    ):
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for b in range(sums.shape[1]):
            inertia += sums[0, b]
            stiffness += sums[1, b]
        dt = wp.float64(step[0])
        omega = wp.float64(0.0)
        if inertia > wp.float64(0.0) and stiffness > wp.float64(0.0):
            omega = wp.sqrt(stiffness / (dt * inertia))
        damping[0] = real(wp.min(wp.float64(2.0) * omega, wp.float64(1.5) / dt))

    return measure_motion, set_damping
