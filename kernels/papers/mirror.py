"""Layers of points outside a sheet that mirror its displacement (HE eqs. 98, 99).

A component of a point outside is u_f = 2 U* - u, with u that of its mirror image in the sheet and U* the displacement
of the edge between them; along an edge on rollers it is u_f = u.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric


@functools.cache
def mirror(bits: int) -> Kernel:
    """Kernel `mirror_layers`; a point without an image, -1, stays as it is."""
    vec3 = numeric(bits).vec3

    @kernel(gathers=("displacement",))
    def mirror_layers(
        images: wp.array(dtype=wp.int32),
        twice_edge: wp.array(dtype=vec3),
        signs: wp.array(dtype=vec3),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        displacement: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        if images[i] >= 0:
            displacement[i] = factors[schedule][0] * twice_edge[i] + wp.cw_mul(signs[i], displacement[images[i]])

    return mirror_layers
