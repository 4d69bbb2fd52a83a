"""Tangent of bending, in closed form, as rows of 3x3 blocks.

With the vectors v_a = g, r and the sides s_m of a triangle (kernels/bending/plate.py), and a^m the vectors of its plane
with a^m . s_l = delta_ml, the normal changes by dn = -sum_m a^m (n . ds_m). The six strains so change by

    dk_a = n . sum_p C_ap du_p,    C_ap = B_ap - sum_m (a^m . v_a) S_mp,

if v_a = sum_p B_ap u_p and s_m = sum_p S_mp u_p, over the points p of the triangle's fits. The force on p is -f_p n,
with f_p = sum_a m_a C_ap and the moments m = M k. The derivative of that gives, with A_p = sum_m S_mp a^m and
w = sum_a m_a v_a,

    K_pq = (C_p . M C_q - (n . w) A_p . A_q) n n^T - f_q n A_p^T - f_p A_q n^T.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import entry_of, numeric
from ..statics.blocks import block_row_product
from .plate import components, plate_tables, triangle_functions

# Rows of what triangles store: n, a^1, a^2, m, a^1 . v, a^2 . v, n . w.
NORMAL, DUAL, MOMENT, ALONG, ACROSS, STATE = 0, 3, 9, 15, 27, 28


@dataclass(frozen=True)
class BendingTangentKernels:
    """Kernels of one configuration.

    Attributes:
        Stencils: Warp struct of the points of the fits of each triangle.
        bend: Stores what the blocks of each triangle need.
        assemble: Blocks of each row from the diagonal on.
        product: Adds the derivative of the force along a direction.
    """

    Stencils: Any
    bend: Kernel
    assemble: Kernel
    product: Kernel


@functools.cache
def bending_tangent(bits: int, curved: bool, breakable: bool) -> BendingTangentKernels:
    """Kernels of the tangent; arguments as for `bending`."""
    types = numeric(bits)
    real, vec3, vec2, vec6, mat33 = types.real, types.vec3, types.vec2, types.vec6, types.mat33
    Plate, of = plate_tables(bits), triangle_functions(bits, curved, breakable)
    moments_of, bent = of.moments_of, of.bent
    _, _, vector_at, put_vector = components(bits)
    share_of, row_product = entry_of(vec6, 2), block_row_product(bits, bits)

    @wp.struct
    class Stencils:
        # As points, triangles are of few kinds on a lattice.
        kind: wp.array(dtype=wp.int32)
        counts: wp.array(dtype=wp.int32)
        steps: wp.array2d(dtype=wp.int32)  # to the points, ascending, from the first corner
        corners: wp.array(dtype=wp.vec3i)  # which of them they are
        shares: wp.array2d(dtype=vec6)  # B of each point [-]
        begins: wp.array(dtype=wp.int32)  # of the entries of each point in `places`, (N + 1,)
        places: wp.array(dtype=wp.int32)  # number of points of the largest stencil x triangle + place in it

    @wp.func
    def sides_with(corners: wp.vec3i, p: int):
        """S of a point: by how much its displacement changes the two sides."""
        if p == corners[0]:
            return vec2(real(-1.0), real(-1.0))
        elif p == corners[1]:
            return vec2(real(1.0), real(0.0))
        elif p == corners[2]:
            return vec2(real(0.0), real(1.0))
        else:
            return vec2(real(0.0), real(0.0))

    @wp.func
    def six_at(state: wp.array2d(dtype=real), row: int, t: int):
        return vec6(
            state[row, t], state[row + 1, t], state[row + 2, t],
            state[row + 3, t], state[row + 4, t], state[row + 5, t],
        )  # fmt: skip

    @kernel(per="face")
    def bend(
        plate: Plate,
        displacement: wp.array(dtype=vec3),
        slope: wp.array2d(dtype=real),
        first: int,
        state: wp.array2d(dtype=real),
    ):
        t = wp.tid() + first
        b = bent(plate, t, displacement, slope)
        n = b.normal
        along, across = wp.cross(b.second, n) * b.over, wp.cross(n, b.first) * b.over
        put_vector(state, NORMAL, t, n)
        put_vector(state, DUAL, t, along)
        put_vector(state, DUAL + 3, t, across)
        for a in range(6):
            state[MOMENT + a, t] = b.moment[a]
            state[ALONG + a, t] = wp.dot(along, b.vectors[a])
            state[ALONG + 6 + a, t] = wp.dot(across, b.vectors[a])
        state[ACROSS, t] = wp.dot(n, wp.transpose(b.vectors) * b.moment)

    @kernel(gathers=("state",))
    def assemble(
        plate: Plate,
        stencils: Stencils,
        state: wp.array2d(dtype=real),
        starts: wp.array(dtype=wp.int32),
        columns: wp.array(dtype=wp.int32),
        first: int,
        matrix: wp.array(dtype=mat33),
    ):
        i = wp.tid() + first
        diagonal = int(starts[i])
        while columns[diagonal] < i:
            diagonal += 1
        for entry in range(diagonal, starts[i + 1]):
            matrix[entry] = mat33()
        for place in range(stencils.begins[i], stencils.begins[i + 1]):
            t, p = stencils.places[place] // stencils.steps.shape[0], stencils.places[place] % stencils.steps.shape[0]
            kind, kinds, origin = stencils.kind[t], stencils.steps.shape[1], plate.first_corner[t]
            corners = stencils.corners[kind]
            n, d1, d2 = vector_at(state, NORMAL, t), vector_at(state, DUAL, t), vector_at(state, DUAL + 3, t)
            m, along, across = six_at(state, MOMENT, t), six_at(state, ALONG, t), six_at(state, ALONG + 6, t)
            own = sides_with(corners, p)
            own_strain = share_of(stencils.shares, p * kinds + kind) - along * own[0] - across * own[1]
            own_moment, own_dual = moments_of(plate, t, own_strain), d1 * own[0] + d2 * own[1]
            own_force = wp.dot(m, own_strain)
            entry = int(diagonal)
            for q in range(p, stencils.counts[kind]):
                j = origin + stencils.steps[q, kind]
                while columns[entry] < j:
                    entry += 1
                sides = sides_with(corners, q)
                strain = share_of(stencils.shares, q * kinds + kind) - along * sides[0] - across * sides[1]
                dual = d1 * sides[0] + d2 * sides[1]
                normal = n * (wp.dot(strain, own_moment) - state[ACROSS, t] * wp.dot(own_dual, dual))
                matrix[entry] = (
                    matrix[entry] + wp.outer(n, normal - own_dual * wp.dot(m, strain)) - wp.outer(dual, n * own_force)
                )

    @kernel(gathers=("direction",))
    def product(
        matrix: wp.array(dtype=mat33),
        starts: wp.array(dtype=wp.int32),
        columns: wp.array(dtype=wp.int32),
        direction: wp.array(dtype=vec3),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        change[i] = change[i] - row_product(matrix, columns, direction, starts[i], starts[i + 1])

    return BendingTangentKernels(Stencils, bend, assemble, product)
