"""Field operations of the static solvers: trial steps, smoothing, transfer between lattices.

Held components (bits of `held_mask`) are excluded: their residual, product and correction are zero.

The sum of internal and external force is the unbalanced force on free components and a reaction on held ones. Rigid
inclusions move under the sum of the forces on their points, so the force on a single such point counts as neither.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import Kernel, kernel
from ..integrate import RIGID, free_components
from ..numeric import numeric


@dataclass(frozen=True)
class EquilibriumKernels:
    """Kernels of one configuration.

    Attributes:
        advance: displacement = base + step length x direction.
        hold: Turns the derivative of the force into the stiffness product: minus the derivative, with held components
            zero.
        smooth: One sweep of block Jacobi, x += omega D^-1 (b - K x).
        combine: z = alpha x + beta y.
        scale_blocks: z = D^-1 x.
        add_blocks: change += D direction.
    """

    advance: Kernel
    hold: Kernel
    smooth: Kernel
    combine: Kernel
    scale_blocks: Kernel
    add_blocks: Kernel


@functools.cache
def free_parts(bits: int, held: bool) -> wp.Function:
    """Warp function (held_mask, i, value) -> the vector with its held components zero."""
    vec3, without_held = numeric(bits).vec3, free_components(bits)

    @wp.func
    def free_part(held_mask: wp.array(dtype=wp.uint8), i: int, value: vec3):
        if wp.static(held):
            return without_held(held_mask[i], 0, value)
        else:
            return value

    return free_part


@functools.cache
def equilibrium(bits: int, held: bool) -> EquilibriumKernels:
    """Kernels of the static solvers."""
    types = numeric(bits)
    real, vec3, mat33 = types.real, types.vec3, types.mat33

    free_part = free_parts(bits, held)

    @kernel()
    def advance(
        base: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        step_length: wp.array(dtype=real),
        first: int,
        displacement: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        displacement[i] = base[i] + step_length[0] * direction[i]

    @kernel()
    def hold(held_mask: wp.array(dtype=wp.uint8), first: int, change: wp.array(dtype=vec3)):
        i = wp.tid() + first
        change[i] = -free_part(held_mask, i, change[i])

    @kernel()
    def smooth(
        inverse_blocks: wp.array(dtype=mat33),
        right_side: wp.array(dtype=vec3),
        image: wp.array(dtype=vec3),
        omegas: wp.array(dtype=real),
        sweep: int,
        fresh: int,
        first: int,
        solution: wp.array(dtype=vec3),
    ):
        """One sweep of block Jacobi; with `fresh` it starts from zero."""
        i = wp.tid() + first
        if fresh != 0:
            solution[i] = omegas[sweep] * (inverse_blocks[i] * right_side[i])
        else:
            solution[i] = solution[i] + omegas[sweep] * (inverse_blocks[i] * (right_side[i] - image[i]))

    @kernel()
    def combine(
        x: wp.array(dtype=vec3), alpha: real, y: wp.array(dtype=vec3), beta: real, first: int, z: wp.array(dtype=vec3)
    ):
        i = wp.tid() + first
        result = alpha * x[i]
        if beta != real(0.0):
            result += beta * y[i]
        z[i] = result

    @kernel()
    def scale_blocks(
        inverse_blocks: wp.array(dtype=mat33), x: wp.array(dtype=vec3), first: int, z: wp.array(dtype=vec3)
    ):
        i = wp.tid() + first
        z[i] = inverse_blocks[i] * x[i]

    @kernel()
    def add_blocks(
        blocks: wp.array(dtype=mat33), direction: wp.array(dtype=vec3), first: int, change: wp.array(dtype=vec3)
    ):
        i = wp.tid() + first
        change[i] = change[i] + blocks[i] * direction[i]

    return EquilibriumKernels(advance, hold, smooth, combine, scale_blocks, add_blocks)


@functools.cache
def lattice_transfer(bits: int, held: bool) -> tuple[Kernel, Kernel, Kernel]:
    """Kernels between two lattices over the same rectangle.

    interpolate: target += values of the source lattice at the points of the target, bilinear.
    interpolate_smoothly: target = the same by cubic polynomials; kinks would cost Newton's method a step or two.
    restrict_residual: coarse = P^T (b - K x), where P interpolates from coarse to fine; the energies match, so P^T
    needs no factor.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    free_part = free_parts(bits, held)

    @kernel(gathers=("source",))
    def interpolate(
        source: wp.array(dtype=vec3),
        source_columns: int,
        source_rows: int,
        columns: int,
        rows: int,
        held_mask: wp.array(dtype=wp.uint8),
        first: int,
        target: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        x = real(i % columns) * real(source_columns - 1) / real(columns - 1)
        y = real(i / columns) * real(source_rows - 1) / real(rows - 1)
        cx = wp.min(int(x), source_columns - 2)
        cy = wp.min(int(y), source_rows - 2)
        sx = x - real(cx)
        sy = y - real(cy)
        p = cx + cy * source_columns
        one = real(1.0)
        value = (one - sy) * ((one - sx) * source[p] + sx * source[p + 1])
        value += sy * ((one - sx) * source[p + source_columns] + sx * source[p + source_columns + 1])
        target[i] = target[i] + free_part(held_mask, i, value)

    @wp.func
    def cubic_weight(place: real, begin: int, k: int):
        """Cubic Lagrange polynomial of node begin + k on the four nodes from `begin` on."""
        weight = real(1.0)
        for n in range(4):
            if n != k:
                weight *= (place - real(begin + n)) / real(k - n)
        return weight

    @kernel(gathers=("source",))
    def interpolate_smoothly(
        source: wp.array(dtype=vec3),
        source_columns: int,
        source_rows: int,
        columns: int,
        rows: int,
        first: int,
        target: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        x = real(i % columns) * real(source_columns - 1) / real(columns - 1)
        y = real(i / columns) * real(source_rows - 1) / real(rows - 1)
        cx = wp.clamp(int(x) - 1, 0, source_columns - 4)
        cy = wp.clamp(int(y) - 1, 0, source_rows - 4)
        value = vec3(real(0.0), real(0.0), real(0.0))
        for b in range(4):
            wy = cubic_weight(y, cy, b)
            for a in range(4):
                value += (wy * cubic_weight(x, cx, a)) * source[cx + a + (cy + b) * source_columns]
        target[i] = value

    @kernel(gathers=("right_side", "image"))
    def restrict_residual(
        right_side: wp.array(dtype=vec3),
        image: wp.array(dtype=vec3),
        columns: int,
        rows: int,
        coarse_columns: int,
        coarse_rows: int,
        held_mask: wp.array(dtype=wp.uint8),
        first: int,
        coarse: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        cx = i % coarse_columns
        cy = i / coarse_columns
        per_x = real(columns - 1) / real(coarse_columns - 1)
        per_y = real(rows - 1) / real(coarse_rows - 1)
        begin_x = wp.max(0, int(wp.floor(real(cx - 1) * per_x)))
        end_x = wp.min(columns - 1, int(wp.ceil(real(cx + 1) * per_x)))
        begin_y = wp.max(0, int(wp.floor(real(cy - 1) * per_y)))
        end_y = wp.min(rows - 1, int(wp.ceil(real(cy + 1) * per_y)))
        total = vec3(real(0.0), real(0.0), real(0.0))
        for iy in range(begin_y, end_y + 1):
            wy = real(1.0) - wp.abs(real(iy) / per_y - real(cy))
            if wy > real(0.0):
                for ix in range(begin_x, end_x + 1):
                    wx = real(1.0) - wp.abs(real(ix) / per_x - real(cx))
                    if wx > real(0.0):
                        p = ix + iy * columns
                        total += (wx * wy) * (right_side[p] - image[p])
        coarse[i] = free_part(held_mask, i, total)

    return interpolate, interpolate_smoothly, restrict_residual


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
