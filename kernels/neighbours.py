"""Neighbour search: points within a distance of each point, from a cell list.

Positions are float64, in units of the cell edge, relative to a corner of the box. The edge is at least the search
distance, so all neighbours are in the 9 cells around a point. `order` lists the points cell by cell, and `starts`
[cells + 1] holds the first entry of each cell.
"""

import functools

import warp as wp

from .effects import unstaged


@functools.cache
def near_points(counts: bool) -> wp.Kernel:
    """Kernel that counts the neighbours of each point [points] or lists them in ascending order [points, members]."""

    @unstaged
    def list_near_points(
        points: wp.array(dtype=wp.vec2d),
        order: wp.array(dtype=wp.int32),
        starts: wp.array(dtype=wp.int32),
        columns: int,
        rows: int,
        limit: wp.float64,
        first: int,
        sizes: wp.array(dtype=wp.int32),
        near: wp.array2d(dtype=wp.int32),
    ):
        i = wp.tid() + first
        here = points[i]
        column = int(here[0])
        row = int(here[1])
        found = wp.int32(0)
        for y in range(wp.max(row - 1, 0), wp.min(row + 2, rows)):
            begin = starts[y * columns + wp.max(column - 1, 0)]
            end = starts[y * columns + wp.min(column + 1, columns - 1) + 1]
            for place in range(begin, end):
                other = order[place]
                if other != i and wp.length_sq(points[other] - here) <= limit:
                    if wp.static(not counts):
                        at = wp.int32(found)
                        while at > 0 and near[i, wp.max(at - 1, 0)] > other:
                            near[i, at] = near[i, at - 1]
                            at = at - 1
                        near[i, at] = other
                    found = found + 1
        if wp.static(counts):
            sizes[i] = found
        else:
            for at in range(found, near.shape[1]):
                near[i, at] = -1

    return list_near_points


@functools.cache
def reverse_members() -> wp.Kernel:
    """Kernel that finds each point's index in the sorted list of each member [points, members]; 0 without member."""

    @unstaged
    def find_reverse_members(
        near: wp.array2d(dtype=wp.int32),
        sizes: wp.array(dtype=wp.int32),
        first: int,
        reverses: wp.array2d(dtype=wp.int32),
    ):
        i = wp.tid() + first
        for k in range(near.shape[1]):
            low = wp.int32(0)
            if k < sizes[i]:
                j = near[i, k]
                high = sizes[j] - 1
                while low < high:
                    middle = (low + high) // 2
                    if near[j, middle] < i:
                        low = middle + 1
                    else:
                        high = middle
            reverses[i, k] = low

    return find_reverse_members
