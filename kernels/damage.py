"""Damage of points, and triangles not cut by a crack."""

import functools

import warp as wp

from .bits import lowest_bit, without_lowest_bit
from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions


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
