"""The interior of a partition is computed while its ghost points are on the way.

The launches that follow an exchange are divided by their points: the inner ones, whose families are all owned, run at
once; those near the border run after the exchange, on the side stream, too. Which launches may be divided follows from
what they declare.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import replace

import warp as wp

from ..device.launches import Call, Item, Launch, Touched, arrays_in
from ..families.partition import Partition


def has_streams(device: wp.Device) -> bool:
    """Whether launches of a device run in parallel on streams."""
    return bool(device.is_cuda)


def overlap_exchanges(
    items: Sequence[Item],
    exchanges: Set[int],
    partition: Partition,
    of_points: Set[int],
    numbered: Callable[[Launch], bool],
) -> list[Item]:
    """The items of a stage, with exchanges that run in parallel with the launches of the inner points after them.

    Args:
        items: The items, with exchanges.
        exchanges: Which of them are exchanges, by identity.
        partition: What is here.
        of_points: Addresses of the arrays that have an entry for each point.
        numbered: Whether the threads of a launch have the numbers of points: no array is a view that begins elsewhere.
    """
    found: list[Item] = []
    left = list(items)
    while left:
        item = left.pop(0)
        if id(item) not in exchanges:
            found.append(item)
            continue
        assert isinstance(item, Call)
        divided: list[Item] = []
        before: list[Touched] = []
        while left and isinstance(launch := left[0], Launch) and numbered(launch):
            parts = _parts(launch, partition)
            if not parts or not _may_go_first(launch, item.touched.writes, before, of_points):
                break
            before.append(by_point(launch))
            divided += parts
            left.pop(0)
        found += [replace(item, side_stream=True, divided=True), *divided] if divided else [item]
    return found


def _parts(launch: Launch, partition: Partition) -> list[Launch]:
    """The launch on the points near the borders, on the side stream, and on those inside; nothing if none is inside."""
    if launch.source.effects.per != "point" and launch.span is None:
        return []
    begin, end = launch.points
    first, last = max(begin, partition.inner.start), min(end, partition.inner.stop)
    if first >= last:
        return []
    # The interior last: what waits for the exchange is on its way before the device is full.
    ranges = [(begin, first, True), (last, end, True), (first, last, False)]
    return [
        replace(launch.on_points(a, b), side_stream=border, divided=True) for a, b, border in ranges if a < b
    ]  # fmt: skip


def _may_go_first(launch: Launch, sent: Set[int], before: Sequence[Touched], of_points: Set[int]) -> bool:
    """Whether the inner points of a launch may go before an exchange, and before the border of earlier launches.

    Args:
        launch: The launch.
        sent: Arrays that are exchanged.
        before: What the earlier launches touch.
        of_points: Arrays of which a launch touches its own point, unless it gathers.
    """
    mine = by_point(launch)
    if launch.side_stream or mine.writes & sent:
        return False
    for earlier in before:
        meet = mine.writes & (earlier.reads | earlier.writes) | mine.reads & earlier.writes
        if mine.writes & earlier.gathers or mine.gathers & earlier.writes or not meet <= of_points:
            return False
    return True


def by_point(launch: Launch) -> Touched:
    """What a launch touches; one on a span of points gathers what its kernel names, and reads all else at its point."""
    touched = launch.touched
    if launch.span is None:
        return touched
    named = {int(a.ptr) for name, a in arrays_in(launch.arguments) if name in launch.source.effects.gathers}
    return Touched(touched.reads | touched.gathers - named, touched.gathers & named, touched.writes)
