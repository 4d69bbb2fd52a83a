"""Damage by broken bonds, triangles not cut by a crack, and by what factor a damage field reduces stiffness."""

import functools
from typing import Any

import warp as wp

from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from .numeric import numeric


@functools.cache
def point_damage(layout: Layout) -> Kernel:
    """Kernel `damage`."""
    real = layout.types.real
    f = family_functions(layout)
    Family = f.struct
    word_size = WORD

    @kernel()
    def damage(family: Family, first: int, out: wp.array(dtype=wp.float32)):
        """Fill `out` with the area of the lost members divided by the area of the initial family."""
        i = wp.tid() + first
        lost = real(0.0)
        for word in range(family.words):
            members = f.initial(family, i, word) & ~family.intact[word, i]
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                lost += f.area(family, f.neighbour(family, i, k))
        out[i] = wp.float32(wp.min(lost / f.family_area(family, i), real(1.0)))

    return damage


@functools.cache
def face_damage(layout: Layout) -> Kernel:
    """Kernel `find_intact_faces`."""
    f = family_functions(layout)
    Family = f.struct
    word_size = WORD

    @wp.func
    def lost(family: Family, i: int, j: int):
        """Whether the family of i has lost its bond to j."""
        found = bool(False)
        for word in range(family.words):
            members = f.initial(family, i, word) & ~f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                if f.neighbour(family, i, k) == j:
                    found = True
        return found

    @kernel(per="face")
    def find_intact_faces(
        family: Family,
        triangles: wp.array(dtype=wp.vec3i),
        first: int,
        intact_faces: wp.array(dtype=wp.uint8),
    ):
        """Mark triangles whose edge bonds are all intact; edges longer than the horizon have no bond."""
        t = wp.tid() + first
        a, b, c = triangles[t][0], triangles[t][1], triangles[t][2]
        torn = lost(family, a, b) or lost(family, b, c) or lost(family, c, a)
        intact_faces[t] = wp.uint8(1)
        if torn:
            intact_faces[t] = wp.uint8(0)

    return find_intact_faces


@functools.cache
def stiffness_left(bits: int) -> wp.Function:
    """Function d -> g(d) = (1 - d)^2."""
    real = numeric(bits).real

    @wp.func
    def stiffness_left(damage: real):
        return (real(1.0) - damage) * (real(1.0) - damage)

    return stiffness_left


@functools.cache
def degradation(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions of (d, m) that return g, -dg/dd and d²g/dd² for g = (1 - d)^2, where m, -dg/dd at d = 0, is 2."""
    real = numeric(bits).real

    @wp.func
    def left(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d)

    @wp.func
    def fall(d: real, m: real):
        return real(2.0) * (real(1.0) - d)

    @wp.func
    def curvature(d: real, m: real):
        return real(2.0)

    return left, fall, curvature


@functools.cache
def weak_degradation(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """The same for Lorentz's g, which falls faster at first, with any m greater than 2."""
    real = numeric(bits).real

    @wp.func
    def shape(m: real):
        return wp.min(real(1.0), real(1.5) * (m - real(2.0)) - real(0.5))

    @wp.func
    def below(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) + m * d * (real(1.0) + shape(m) * d)

    @wp.func
    def left(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) / below(d, m)

    @wp.func
    def fall(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        return m * (real(1.0) - d) * (real(1.0) + growth * d) / (below(d, m) * below(d, m))

    @wp.func
    def curvature(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        bottom = below(d, m)
        top = (real(1.0) - d) * (real(1.0) + growth * d)
        top_slope = growth - real(1.0) - real(2.0) * growth * d
        bottom_slope = m * (real(1.0) + real(2.0) * shape(m) * d) - real(2.0) * (real(1.0) - d)
        return m * (real(2.0) * top * bottom_slope - top_slope * bottom) / (bottom * bottom * bottom)

    return left, fall, curvature


@functools.cache
def soften(bits: int, value: Any) -> Kernel:
    """Kernel that reduces a value of each family, such as an energy or a stress, by the damage of its point."""
    real, left = numeric(bits).real, stiffness_left(bits)

    @kernel()
    def soften(damage: wp.array(dtype=real), first: int, values: wp.array(dtype=value)):
        i = wp.tid() + first
        values[i] = value(left(damage[i])) * values[i]

    return soften
