"""Strips of a large sheet, which follow each other through memory, and the points in them that are none of the many.

The forces of a strip stay where they are until its points and those of the strip behind it have gathered them. Two
strips are in memory at a time: while one is gathered, the next one is computed.
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


@dataclass(frozen=True)
class Lists:
    """The points of a strip whose families are not those of the stencil.

    Attributes:
        known: Those known before the forces, or None.
        known_next: How many will be known next time, if bonds can break; or None.
        found: Those that are found with the forces, or None.
    """

    known: Listed | None = None
    known_next: Array | None = None
    found: Listed | None = None


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


def lists_of(
    w: Context, owner: str, strips: Sequence[Strip], others: np.ndarray, which: str, room: int
) -> tuple[list[Lists], Array | None]:
    """Lists of each strip, and which points are marked as known if the lists grow.

    The lists of what is found are those of two strips, which are in use together.

    Args:
        w: Takes the arrays.
        owner: The part that adds them.
        strips: The strips.
        others: Whether the family of a point is not that of the stencil, undamaged, (N,) bool.
        room: Strips that are in use together.
        which: "all", "before" or "none": as of the kernel of undamaged families.
    """
    edges = [strip.begin + np.flatnonzero(others[strip.begin : strip.end]) for strip in strips]
    counts = np.array([len(e) for e in edges], np.int32)
    grows = which == "before"
    sizes = [strip.size if grows else max(len(e), 1) for strip, e in zip(strips, edges, strict=True)]
    known = known_count = known_next = marked = None
    if which != "none":
        padded = [np.append(e, np.zeros(n - len(e))) for e, n in zip(edges, sizes, strict=True)]
        known = w.array("known_points", owner, wp.int32, np.concatenate(padded).astype(np.int32), per="table")
        known_count = w.array("known_count", owner, wp.int32, counts, per="once")
    if grows:
        known_next = w.array("known_next", owner, wp.int32, counts, per="once")
        marked = w.array("known", owner, wp.uint8, others.astype(np.uint8))
    found: list[Listed] = []
    if which != "all":
        for k in range(min(room, len(strips))):
            points = w.array(f"found_points_{k}", owner, wp.int32, shape=strips[0].size, per="table")
            count = w.array(f"found_count_{k}", owner, wp.int32, shape=1, per="once")
            found.append(Listed(points, count, strips[0].size))
    lists, end = [], 0
    for k, size in enumerate(sizes):
        begin, end = end, end + size
        here = None
        if known is not None and known_count is not None:
            most = size if grows else int(counts[k])
            here = Listed(known[begin:end], known_count[k : k + 1], most)
        following = None if known_next is None else known_next[k : k + 1]
        lists.append(Lists(here, following, found[k % len(found)] if found else None))
    return lists, marked
