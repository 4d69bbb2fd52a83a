"""Pairs of points that are welded: a stiff spring in all directions between the two."""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric


@functools.cache
def weld(bits: int) -> Kernel:
    """Kernel that adds the force of each point's spring to `out` [points], N.

    `partner` is the other point of a pair, -1 for none, `apart` [points] the way to it before any displacement [m].
    """
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel(gathers=("moved",))
    def add_weld(
        partner: wp.array(dtype=wp.int32),
        stiffness: real,
        apart: wp.array(dtype=vec3),
        moved: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        m = partner[i]
        if m >= 0:
            out[i] = out[i] + stiffness * (apart[i] + moved[m] - moved[i])

    return add_weld
