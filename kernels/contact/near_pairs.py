"""Pairs of points that may touch: their contact distances, and lists of nearby pairs.

Cells are found by a hash of their integer coordinates. The order of a bucket, a linked list, depends on thread timing;
the list of each point is sorted and does not. The contact forces are in kernels/contact/self_contact.py.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions
from ..numeric import numeric

# What a status array holds: whether the lists are to be made, one was full, one holds a pair, and whether a pair has
# touched since they were made.
STALE, CROWDED, LISTED, TOUCHED = 0, 1, 2, 3


@dataclass(frozen=True)
class PairFunctions:
    """Functions and types of the pairs of one configuration.

    Attributes:
        Points: Struct: reference positions, pieces, areas divided by the reference area, contact distances.
        distance_kept: (points, i, j) -> contact distance d_ij [m].
        between: (points, displacement, i, j) -> x_j - x_i [m], vec3.
    """

    Points: Any
    distance_kept: wp.Function
    between: wp.Function


@functools.cache
def pair_functions(bits: int, pieces: bool) -> PairFunctions:
    """Functions of pairs of points.

    Args:
        bits: 32 or 64.
        pieces: Whether the sheet has several pieces.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Points:
        reference: wp.array(dtype=vec3)
        piece: wp.array(dtype=wp.int32)
        area: wp.array(dtype=real)
        distance: real
        fraction: real
        stiffness: real

    @wp.func
    def distance_kept(points: Points, i: int, j: int):
        kept = points.distance
        apart = bool(True)
        if wp.static(pieces):
            apart = points.piece[i] == points.piece[j]
        if apart:
            kept = wp.min(kept, points.fraction * wp.length(points.reference[j] - points.reference[i]))
        return kept

    @wp.func
    def between(points: Points, displacement: wp.array(dtype=vec3), i: int, j: int):
        # Far parts of a sheet touch: both differences are large and nearly cancel, to the round-off of displacements.
        return (points.reference[j] - points.reference[i]) + (displacement[j] - displacement[i])

    return PairFunctions(Points, distance_kept, between)


@dataclass(frozen=True)
class ListKernels:
    """Kernels that build the lists of pairs; all but `look` return immediately unless the lists are stale.

    Attributes:
        look: Marks the lists as stale if a point has moved by more than half the skin.
        clear: Empties the buckets.
        insert: Puts points into buckets.
        collect: Lists the pairs of each point.
        finish: Marks the lists as fresh.
    """

    look: Kernel
    clear: Kernel
    insert: Kernel
    collect: Kernel
    finish: Kernel


@functools.cache
def pair_lists(layout: Layout, pieces: bool) -> ListKernels:
    """Kernels that build the lists of pairs.

    Args:
    layout: Layout of the families.
    pieces: Whether the sheet has several pieces.
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    pairs = pair_functions(bits, pieces)
    Points, distance_kept, between = pairs.Points, pairs.distance_kept, pairs.between
    word_size, stale, crowded, listed, touched = WORD, STALE, CROWDED, LISTED, TOUCHED

    @wp.func
    def bucket_of(cell: wp.vec3i, buckets: int):
        mixed = wp.uint32(cell[0]) * wp.uint32(73856093)
        mixed = mixed ^ (wp.uint32(cell[1]) * wp.uint32(19349663))
        mixed = mixed ^ (wp.uint32(cell[2]) * wp.uint32(83492791))
        return wp.int32(mixed & wp.uint32(buckets - 1))

    @wp.func
    def is_member(family: Family, i: int, j: int):
        found = bool(False)
        for k in range(family.members):
            word = k // word_size
            if (f.initial(family, i, word) >> wp.uint32(k - word * word_size)) & wp.uint32(1) != wp.uint32(0):
                if f.neighbour(family, i, k) == j:
                    found = True
        return found

    @kernel(per="list")
    def look(
        displacement: wp.array(dtype=vec3),
        listed_at: wp.array(dtype=vec3),
        limit: real,
        first: int,
        status: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        # All threads that write here write the same. A displacement that is not finite counts as moved.
        if not wp.length_sq(displacement[i] - listed_at[i]) < limit:
            status[stale] = 1

    @kernel(per="list")
    def clear(first: int, heads: wp.array(dtype=wp.int32), status: wp.array(dtype=wp.int32)):
        b = wp.tid() + first
        if status[stale] != 0:
            heads[b] = -1
            if b == 0:
                status[listed] = 0
                status[touched] = 0

    @kernel(per="list")
    def insert(
        points: Points,
        displacement: wp.array(dtype=vec3),
        inverse_cell: real,
        stride: int,
        first: int,
        heads: wp.array(dtype=wp.int32),
        following: wp.array(dtype=wp.int32),
        cells: wp.array(dtype=wp.vec3i),
        listed_at: wp.array(dtype=vec3),
        status: wp.array(dtype=wp.int32),
    ):
        begin = wp.tid() + first
        if status[stale] != 0:
            for i in range(begin, displacement.shape[0], stride):
                u = displacement[i]
                x = inverse_cell * (points.reference[i] + u)
                cell = wp.vec3i(wp.int32(wp.floor(x[0])), wp.int32(wp.floor(x[1])), wp.int32(wp.floor(x[2])))
                cells[i] = cell
                listed_at[i] = u
                following[i] = wp.atomic_exch(heads, bucket_of(cell, heads.shape[0]), i)

    @kernel(per="list")
    def collect(
        family: Family,
        points: Points,
        displacement: wp.array(dtype=vec3),
        cells: wp.array(dtype=wp.vec3i),
        heads: wp.array(dtype=wp.int32),
        following: wp.array(dtype=wp.int32),
        skin: real,
        family_reach: real,
        first: int,
        counts: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
        status: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        if status[stale] == 0:
            return
        home = cells[i]
        found = wp.int32(0)
        for place in range(27):
            cell = home + wp.vec3i(place % 3 - 1, (place // 3) % 3 - 1, place // 9 - 1)
            j = heads[bucket_of(cell, heads.shape[0])]
            while j >= 0:
                if j != i and cells[j] == cell:
                    reach = distance_kept(points, i, j) + skin
                    if wp.length_sq(between(points, displacement, i, j)) < reach * reach:
                        bonded = bool(False)
                        if wp.length(points.reference[j] - points.reference[i]) < family_reach:
                            bonded = is_member(family, i, j)
                        if not bonded:
                            if found < near.shape[0]:
                                at = wp.int32(found)
                                while at > 0 and near[wp.max(at - 1, 0), i] > j:
                                    near[at, i] = near[at - 1, i]
                                    at = at - 1
                                near[at, i] = j
                            found = found + 1
                j = following[j]
        if found > near.shape[0]:
            status[crowded] = 1
        if found > 0:
            status[listed] = 1
        counts[i] = wp.min(found, near.shape[0])

    @kernel(per="once")
    def finish(first: int, status: wp.array(dtype=wp.int32)):
        status[stale] = 0

    return ListKernels(look, clear, insert, collect, finish)
