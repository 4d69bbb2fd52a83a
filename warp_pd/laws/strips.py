"""Strips of a large sheet, which follow each other through memory.

The forces of a strip stay where they are until its points and those of the strip behind it have gathered them.
"""

from __future__ import annotations

from dataclasses import dataclass


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


def short_strips(here: slice, points: int, reach: int, most: int, room: int) -> list[Strip]:
    """Strips of a sheet, equal up to the last one, of which several are computed at a time.

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
    return _strips(here, points, reach, size)


def long_strips(here: slice, points: int, reach: int, ring: int) -> list[Strip]:
    """Strips of a sheet that follow each other through a ring of `ring` columns; other arguments as above."""
    size = ring - 2 * reach
    if points <= 2 * ring or size < ring // 2:
        return [Strip(0, here.start, here.stop, 0, points)]
    return _strips(here, points, reach, size)


def _strips(here: slice, points: int, reach: int, size: int) -> list[Strip]:
    strips: list[Strip] = []
    for number, begin in enumerate(range(here.start, here.stop, size)):
        end = min(begin + size, here.stop)
        gathered = strips[-1].gather_end if strips else 0
        strips.append(Strip(number, begin, end, gathered, points if end == here.stop else end - reach))
    return strips
