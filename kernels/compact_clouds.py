"""Families of a cloud in few bytes, for a GPU: what a thread can find anew as fast as it would read it has no table.

A member is stored as the difference of its index from that of the point, in 16 bits where all differences of a sheet
fit, and the reverse bond in 8. Bond vectors are differences of positions in float64, as exact as those of a table.
Named influence functions are evaluated, and shape tensors are sums: the kernel of the force has what they take at hand.
The functions are those of kernels/families.py, so that all other kernels work on these families, too; the inverse shape
tensor of an intersection takes them a loop over its members.
"""

import warp as wp

from .bits import lowest_bit, without_lowest_bit
from .entries import entry_of
from .families import WORD, FamilyFunctions, Layout, flat_functions
from .kinematics import kinematics

# Influence functions that are evaluated; others have a table.
EVALUATED = ("linear", "inverse", "inverse_square")


def compact_functions(layout: Layout) -> FamilyFunctions:
    """Functions of a flat cloud whose bonds keep their weight; `compact` is one of EVALUATED or "table"."""
    types = layout.types
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    inverse_shape = kinematics(layout.bits).inverse_shape
    evaluated = layout.compact in EVALUATED
    linear, inverse = layout.compact == "linear", layout.compact == "inverse"
    word_size = WORD
    short, byte, word_of, number = (entry_of(kind, 2) for kind in (wp.int16, wp.uint8, wp.uint32, real))
    mask_of, place = entry_of(wp.uint32, 3), entry_of(wp.vec2d, 1)

    # What a sheet does not need stays without an array. With `far`, indices have a second half, and so have members of
    # reverse bonds with `large`.
    @wp.struct
    class CompactFamily:
        members: wp.int32
        words: wp.int32
        points: wp.int32
        far: wp.int32
        large: wp.int32
        inverse_horizon: wp.float64
        positions: wp.array(dtype=wp.vec2d)
        neighbours: wp.array2d(dtype=wp.int16)
        neighbours_high: wp.array2d(dtype=wp.int16)
        reverses: wp.array2d(dtype=wp.uint8)
        reverses_high: wp.array2d(dtype=wp.uint8)
        influences: wp.array2d(dtype=real)
        commons: wp.array3d(dtype=wp.uint32)
        initials: wp.array2d(dtype=wp.uint32)
        weights: wp.array2d(dtype=real)
        areas: wp.array(dtype=real)
        family_areas: wp.array(dtype=real)

    @wp.func
    def neighbour(family: CompactFamily, i: int, k: int):
        difference = wp.int32(short(family.neighbours, k * family.points + i))
        if family.far != 0:
            difference = (difference & 0xFFFF) + (wp.int32(short(family.neighbours_high, k * family.points + i)) << 16)
        return i + difference

    @wp.func
    def reverse(family: CompactFamily, i: int, k: int):
        member = wp.int32(byte(family.reverses, k * family.points + i))
        if family.large != 0:
            member = member + (wp.int32(byte(family.reverses_high, k * family.points + i)) << 8)
        return member

    @wp.func
    def bond(family: CompactFamily, i: int, k: int):
        X = family.inverse_horizon * (place(family.positions, neighbour(family, i, k)) - place(family.positions, i))
        return vec2(real(X[0]), real(X[1]))

    @wp.func
    def influence(family: CompactFamily, i: int, k: int):
        if wp.static(evaluated):
            X = bond(family, i, k)
            r = wp.min(wp.length(X), real(1.0))
            if wp.static(linear):
                return real(1.0) - r
            elif wp.static(inverse):
                return real(1.0) / r
            else:
                return real(1.0) / (r * r)
        else:
            return number(family.influences, k * family.points + i)

    @wp.func
    def common(family: CompactFamily, i: int, k: int, word: int):
        return mask_of(family.commons, (k * family.words + word) * family.points + i)

    @wp.func
    def initial(family: CompactFamily, i: int, word: int):
        return word_of(family.initials, word * family.points + i)

    @wp.func
    def area(family: CompactFamily, i: int):
        return family.areas[i]

    @wp.func
    def shape(family: CompactFamily, i: int, k: int):
        K = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(family.words):
            members = common(family, i, k, word)
            while members != wp.uint32(0):
                m = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                X = bond(family, i, m)
                c = influence(family, i, m) * area(family, neighbour(family, i, m))
                K += c * vec3(X[0] * X[0], X[0] * X[1], X[1] * X[1])
        return inverse_shape(K)

    @wp.func
    def weight(family: CompactFamily, i: int, k: int):
        return number(family.weights, k * family.points + i)

    @wp.func
    def family_area(family: CompactFamily, i: int):
        return family.family_areas[i]

    return FamilyFunctions(
        CompactFamily, neighbour, reverse, bond, influence, common, initial, shape, weight, area, family_area,
        chord=bond, **flat_functions(layout, CompactFamily),
    )  # fmt: skip
