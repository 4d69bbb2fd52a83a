"""Members and shape tensors of family intersections, for tables with one row per point.

The sums are those of kernels/bond_associated.py, always in float64: for bond (i, j) over the members k of the family of
i with |X_k - X_j| <= horizon, j included. Lengths are in units of the horizon, areas in those of the reference area.
"""

import functools

import warp as wp

from .effects import unstaged
from .families import WORD, lowest_bit, without_lowest_bit
from .kinematics import kinematics


@functools.cache
def common_members(dimension: int, graded: bool) -> wp.Kernel:
    """Kernel that sets the member bits of each intersection [rows, members, words], which are zero on entry.

    With `graded` each pair uses the mean of the `horizons` [rows, members] of both points.
    """
    vector = wp.types.vector(length=dimension, dtype=wp.float64)
    word_size = WORD

    @unstaged
    def mark_common_members(
        bonds: wp.array2d(dtype=vector),
        horizons: wp.array2d(dtype=wp.float64),
        sizes: wp.array(dtype=wp.int32),
        limit: wp.float64,
        first: int,
        common: wp.array3d(dtype=wp.uint32),
    ):
        i = wp.tid() + first
        size = sizes[i]
        for j in range(size):
            at = bonds[i, j]
            own = j // word_size
            bit = wp.uint32(1) << wp.uint32(j - own * word_size)
            common[i, j, own] = common[i, j, own] | bit
            for k in range(j + 1, size):
                apart = wp.length_sq(at - bonds[i, k])
                if wp.static(graded):
                    both = wp.float64(0.5) * (horizons[i, j] + horizons[i, k])
                    apart = apart / (both * both)
                if apart <= limit:
                    word = k // word_size
                    common[i, j, word] = common[i, j, word] | (wp.uint32(1) << wp.uint32(k - word * word_size))
                    common[i, k, own] = common[i, k, own] | bit

    return mark_common_members


@functools.cache
def intersection_shapes() -> wp.Kernel:
    """Kernel that fills K_ij^-1 and |D_ij|, both [rows, members] and zero where the intersection is degenerate."""
    tensors = kinematics(64)
    determines_gradient, inverse_shape = tensors.determines_gradient, tensors.inverse_shape
    word_size = WORD

    @unstaged
    def sum_intersection_shapes(
        bonds: wp.array2d(dtype=wp.vec2d),
        influences: wp.array2d(dtype=wp.float64),
        areas: wp.array2d(dtype=wp.float64),
        sizes: wp.array(dtype=wp.int32),
        common: wp.array3d(dtype=wp.uint32),
        first: int,
        inverse: wp.array2d(dtype=wp.vec3d),
        size: wp.array2d(dtype=wp.float64),
    ):
        i = wp.tid() + first
        for j in range(bonds.shape[1]):
            shape = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
            total = wp.float64(0.0)
            if j < sizes[i]:
                for word in range(common.shape[2]):
                    members = common[i, j, word]
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        xi = bonds[i, k]
                        c = influences[i, k] * areas[i, k]
                        shape += wp.vec3d(c * xi[0] * xi[0], c * xi[0] * xi[1], c * xi[1] * xi[1])
                        total += areas[i, k]
            if determines_gradient(shape):
                inverse[i, j] = inverse_shape(shape)
                size[i, j] = total
            else:
                inverse[i, j] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
                size[i, j] = wp.float64(0.0)

    return sum_intersection_shapes
