"""Unbalanced force of a sheet, and the loads and reactions it is compared with.

The sum of internal and external force is the unbalanced force on free components and a reaction on held ones. Rigid
inclusions move under the sum of the forces on their points, so the force on a single such point counts as neither.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..integrate import RIGID
from ..numeric import numeric


@functools.cache
def residual(bits: int, held: bool, loaded: bool, apart: bool, stressed: bool) -> Kernel:
    """Kernel that fills the unbalanced force [points], N, its square and the squared loads and reactions, N^2.

    Args:
        bits: Precision, 32 or 64.
        held: Whether any component is held.
        loaded: Whether external forces act.
        apart: Whether dead loads are also summed separately, because displacement-dependent loads may balance them.
        stressed: Whether `moving` is filled with the squared loads and changes of reactions, N^2: reactions without
            those to the `initial` internal force.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    rigid = RIGID

    @kernel()
    def residual(
        held_mask: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        dead: wp.array(dtype=vec3),
        initial: wp.array(dtype=vec3),
        first: int,
        unbalanced: wp.array(dtype=vec3),
        squared: wp.array(dtype=wp.float64),
        reaction: wp.array(dtype=wp.float64),
        moving: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        load = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(loaded):
            load = external[i]
        free = force[i] + load
        support = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                    support[c] = free[c]
                    free[c] = real(0.0)
                elif (wp.int32(held_mask[i]) & rigid) != 0:
                    free[c] = real(0.0)
        unbalanced[i] = free
        squared[i] = wp.float64(wp.dot(free, free))
        size = wp.dot(support, support) + wp.dot(load, load)
        if wp.static(apart):
            size += wp.dot(dead[i], dead[i])
        reaction[i] = wp.float64(size)
        if wp.static(stressed):
            change = vec3(real(0.0), real(0.0), real(0.0))
            if wp.static(held):
                for c in range(3):
                    if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                        change[c] = support[c] - initial[i][c]
            moved = wp.dot(change, change) + wp.dot(load, load)
            if wp.static(apart):
                moved += wp.dot(dead[i], dead[i])
            moving[i] = wp.float64(moved)

    return residual
