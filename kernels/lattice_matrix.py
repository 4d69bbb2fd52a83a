"""Tangent of the bond-associated law on an undamaged lattice, stored as a matrix indexed by lattice steps.

On a CPU a product with it takes a quarter of the time of the matrix-free product. The equations are in
kernels/bond_associated_tangent.py.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .bits import bit_of, lowest_bit, without_lowest_bit
from .bond_associated_tangent import block_functions
from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions


@dataclass(frozen=True)
class LatticeMatrixKernels:
    """Kernels of the tangent of an undamaged lattice, stored as a matrix.

    Attributes:
        assemble: Fills matrix [offsets, points] with the 3x3 stiffness blocks between a point and the point one lattice
            offset away; the first offset is the point itself.
        product: Derivative of the force along a direction, from that matrix.
        inverse_diagonal: Inverse of the diagonal blocks, without held components.
    """

    assemble: Kernel
    product: Kernel
    inverse_diagonal: Kernel


@functools.cache
def lattice_matrix(layout: Layout, held: bool) -> LatticeMatrixKernels:
    """Kernels of the stored tangent of an undamaged lattice."""
    types = layout.types
    real, vec2, vec3, vec6 = types.real, types.vec2, types.vec3, types.vec6
    mat32, mat33 = types.mat32, types.mat33
    f = family_functions(layout)
    Family = f.struct
    _, inverse_of = block_functions(layout.bits)
    word_size = WORD

    @kernel(gathers=("gradient", "stress", "moduli"))
    def assemble(
        family: Family,
        gradient: wp.array2d(dtype=mat32),
        stress: wp.array2d(dtype=vec3),
        moduli: wp.array2d(dtype=vec6),
        pair_offset: wp.array2d(dtype=wp.int32),
        unit_stiffness: real,
        first: int,
        matrix: wp.array2d(dtype=mat33),
    ):
        i = wp.tid() + first
        for o in range(matrix.shape[0]):
            matrix[o, i] = mat33()
        # Families that contain i: its own, where it is the centre (member index `members`), and its neighbours'.
        for s in range(family.members + 1):
            q = i
            mine = family.members
            belongs = bool(True)
            word = 0
            bit = wp.uint32(0)
            if s < family.members:
                word = s // word_size
                belongs = bit_of(f.initial(family, i, word), s - word * word_size)
                if belongs:
                    q = f.neighbour(family, i, s)
                    mine = f.reverse(family, i, s)
                    word = mine // word_size
                    bit = wp.uint32(1) << wp.uint32(mine - word * word_size)
            if belongs:
                for j in range(family.members):
                    inverse = f.shape(family, q, j)
                    if inverse[0] > real(0.0) and (
                        mine == family.members or (f.common(family, q, j, word) & bit) != wp.uint32(0)
                    ):
                        # First the sum over the members; its negative is the coefficient of the centre.
                        centre = vec2(real(0.0), real(0.0))
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.initial(family, q, w)
                            while members != wp.uint32(0):
                                k = w * word_size + lowest_bit(members)
                                members = without_lowest_bit(members)
                                c = f.influence(family, q, k) * f.area(family, f.neighbour(family, q, k))
                                centre -= c * f.bond(family, q, k)
                        raw = centre
                        if mine < family.members:
                            raw = (f.influence(family, q, mine) * f.area(family, i)) * f.bond(family, q, mine)
                        g = vec2(inverse[0] * raw[0] + inverse[1] * raw[1], inverse[1] * raw[0] + inverse[2] * raw[1])
                        F = gradient[j, q]
                        S = stress[j, q]
                        T = moduli[j, q]
                        F1 = vec3(F[0, 0], F[1, 0], F[2, 0])
                        F2 = vec3(F[0, 1], F[1, 1], F[2, 1])
                        b1 = real(2.0) * g[0] * F1
                        b2 = real(2.0) * g[1] * F2
                        b3 = g[1] * F1 + g[0] * F2
                        half = real(0.5) * unit_stiffness
                        t1 = half * (T[0] * b1 + T[1] * b2 + T[2] * b3)
                        t2 = half * (T[1] * b1 + T[3] * b2 + T[4] * b3)
                        t3 = half * (T[2] * b1 + T[4] * b2 + T[5] * b3)
                        one = wp.identity(n=3, dtype=real)
                        R1 = (
                            (unit_stiffness * (S[0] * g[0] + S[1] * g[1])) * one
                            + real(2.0) * wp.outer(t1, F1)
                            + wp.outer(t3, F2)
                        )
                        R2 = (
                            (unit_stiffness * (S[1] * g[0] + S[2] * g[1])) * one
                            + real(2.0) * wp.outer(t2, F2)
                            + wp.outer(t3, F1)
                        )
                        # Fold K^-1 in here, so that the loop over members only needs c xi.
                        Q1 = inverse[0] * R1 + inverse[1] * R2
                        Q2 = inverse[1] * R1 + inverse[2] * R2
                        o = pair_offset[mine, family.members]
                        matrix[o, i] = matrix[o, i] + centre[0] * Q1 + centre[1] * Q2
                        for w in range(family.words):
                            members = f.common(family, q, j, w) & f.initial(family, q, w)
                            while members != wp.uint32(0):
                                k = w * word_size + lowest_bit(members)
                                members = without_lowest_bit(members)
                                c = f.influence(family, q, k) * f.area(family, f.neighbour(family, q, k))
                                cxi = c * f.bond(family, q, k)
                                o = pair_offset[mine, k]
                                matrix[o, i] = matrix[o, i] + cxi[0] * Q1 + cxi[1] * Q2

    @kernel(gathers=("direction",))
    def product(
        matrix: wp.array2d(dtype=mat33),
        shift: wp.array(dtype=wp.int32),
        direction: wp.array(dtype=vec3),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        total = vec3(real(0.0), real(0.0), real(0.0))
        last = direction.shape[0] - 1
        for o in range(matrix.shape[0]):
            # Steps that leave the sheet have a zero block.
            m = wp.clamp(i + shift[o], 0, last)
            total -= matrix[o, i] * direction[m]
        change[i] = total

    @kernel()
    def inverse_diagonal(
        matrix: wp.array2d(dtype=mat33), held_mask: wp.array(dtype=wp.uint8), first: int, out: wp.array(dtype=mat33)
    ):
        i = wp.tid() + first
        mask = wp.uint8(0)
        if wp.static(held):
            mask = held_mask[i]
        out[i] = inverse_of(matrix[0, i], mask)

    return LatticeMatrixKernels(assemble, product, inverse_diagonal)
