"""Strips of a large sheet, which follow each other through memory, and lists of the points in them unlike the others.

The forces of a strip stay where they are until its points and those of the strip behind it have gathered them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.context import Context
from ..device.fields import Array


@dataclass(frozen=True)
class Strip:
    """Points begin to end - 1 of a sheet, and those whose force is complete after the forces of these families."""

    number: int
    begin: int
    end: int
    gather_begin: int
    gather_end: int

    @property
    def size(self) -> int:
        """Number of points."""
        return self.end - self.begin


@dataclass(frozen=True)
class Listed:
    """Points on a list.

    Attributes:
        points: The points, and room for more.
        count: How many there are.
        most: How many there may be.
    """

    points: Array
    count: Array
    most: int


def strips_of(here: slice, points: int, reach: int, most: int, room: int) -> list[Strip]:
    """Strips of a sheet, equal up to the last one.

    Args:
        here: Points whose families are not empty.
        points: Number of points.
        reach: Largest difference of the indices of two points that share a bond.
        most: Maximum number of points of a strip.
        room: Strips that are in memory at a time.
    """
    total = here.stop - here.start
    count = -(-total // most)
    size = -(-total // count)
    if 2 * reach > size or count <= room:
        return [Strip(0, here.start, here.stop, 0, points)]
    strips: list[Strip] = []
    for number, begin in enumerate(range(here.start, here.stop, size)):
        end = min(begin + size, here.stop)
        gathered = strips[-1].gather_end if strips else 0
        strips.append(Strip(number, begin, end, gathered, points if end == here.stop else end - reach))
    return strips


def known_lists(w: Context, owner: str, strips: Sequence[Strip], others: np.ndarray) -> list[Listed]:
    """Points of each strip that are known to be others.

    Args:
        w: Takes the arrays.
        owner: The part that adds them.
        strips: The strips.
        others: Whether the family of a point is not that of the stencil, (N,) bool.
    """
    edges = [strip.begin + np.flatnonzero(others[strip.begin : strip.end]) for strip in strips]
    counts = [len(e) for e in edges]
    ends = np.cumsum(counts).tolist()
    # A slice of an array has at least one entry.
    points = w.array("other_points", owner, wp.int32, np.append(np.concatenate(edges), 0).astype(np.int32), per="table")
    count = w.array("other_count", owner, wp.int32, np.array(counts, np.int32), per="table")
    return [
        Listed(points[end - most : end + (most == 0)], count[k : k + 1], most)
        for k, (end, most) in enumerate(zip(ends, counts, strict=True))
    ]


def found_lists(w: Context, owner: str, strips: Sequence[Strip], room: int) -> list[Listed]:
    """Lists that the kernel of undamaged families fills; strips that are `room` apart share one."""
    found = []
    for k in range(min(room, len(strips))):
        points = w.array(f"other_points_{k}", owner, wp.int32, shape=strips[0].size, per="table")
        count = w.array(f"other_count_{k}", owner, wp.int32, shape=1, per="once")
        found.append(Listed(points, count, strips[0].size))
    return [found[strip.number % len(found)] for strip in strips]
