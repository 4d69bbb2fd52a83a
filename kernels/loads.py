"""External force of loads that do not depend on the displacement."""

import functools

import warp as wp

from .effects import Kernel, kernel
from .numeric import numeric
from .pointwise import Pointwise, pointwise


@functools.cache
def begin_loads(bits: int, present: bool) -> Pointwise:
    """Pointwise stage that sets the external force to the constant loads, or to zero."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class BeginLoads:
        constant: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)

    @pointwise(BeginLoads, writes=("external",))
    def begin_loads(begin: int, end: int, a: BeginLoads):
        for i in range(begin, end):
            if wp.static(present):
                a.external[i] = a.constant[i]
            else:
                a.external[i] = vec3(real(0.0), real(0.0), real(0.0))

    return begin_loads


@functools.cache
def dead_load(bits: int) -> Kernel:
    """Kernel that adds forces on selected points, multiplied by a schedule."""
    vec3 = numeric(bits).vec3

    @kernel(per="list")
    def add_dead_load(
        points: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        external: wp.array(dtype=vec3),
    ):
        p = wp.tid() + first
        i = points[p]
        external[i] = external[i] + factors[schedule][0] * force[p]

    return add_dead_load


@functools.cache
def support_forces(bits: int, loaded: bool) -> Kernel:
    """Kernel that fills `out` with the forces of supports on selected points [N], zero in components that are free.

    They are minus the internal force, and minus the external force if there are loads (`loaded`).
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @kernel(per="list")
    def support_forces(
        points: wp.array(dtype=wp.int32),
        held_mask: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=vec3),
    ):
        p = wp.tid() + first
        i = points[p]
        pull = -force[i]
        if wp.static(loaded):
            pull -= external[i]
        for c in range(3):
            if (wp.int32(held_mask[i]) & (1 << c)) == 0:
                pull[c] = real(0.0)
        out[p] = pull

    return support_forces


@functools.cache
def scaled_values(bits: int) -> Kernel:
    """Kernel that fills `values` with `unit` times the factor of a schedule."""
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel()
    def scale_values(
        unit: wp.array(dtype=real),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        values: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        values[i] = factors[schedule][0] * unit[i]

    return scale_values
