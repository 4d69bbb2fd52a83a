"""Overlap of communication and computation: interior points are computed while ghost points are exchanged.

The launches that follow an exchange are split by points. Inner points, whose families are all owned, run immediately;
points near the border run after the exchange, on the side stream. The declared effects of a launch decide whether it
may be split.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import replace

import warp as wp

from ..device.launches import Call, Item, Launch, Touched
from ..families.partition import Partition


def has_streams(device: wp.Device) -> bool:
    """Whether the device can run launches in parallel on streams."""
    return bool(device.is_cuda)


def overlap_exchanges(
    items: Sequence[Item],
    exchanges: Set[int],
    partition: Partition,
    of_points: Set[int],
    numbered: Callable[[Launch], bool],
) -> list[Item]:
    """Rearrange a stage so that exchanges run in parallel with the following launches of inner points.

    Args:
        items: The items, with exchanges.
        exchanges: Identities of the items that are exchanges.
        partition: The part of the sheet in this process.
        of_points: Addresses of the arrays with one entry per point.
        numbered: Whether thread indices of a launch are point indices, i.e. no array is a view with an offset.
    """
    found: list[Item] = []
    left = list(items)
    while left:
        item = left.pop(0)
        if id(item) not in exchanges:
            found.append(item)
            continue
        assert isinstance(item, Call)
        divided: Sequence[Item] = []
        before: list[Touched] = []
        if chain := _chain(left, item.touched.writes, partition, numbered):
            # In order on the side stream, beside the inner points of the launch after them.
            launch, beside = left[chain], [replace(other, side_stream=True) for other in left[:chain]]
            assert isinstance(launch, Launch)
            first = replace(left[0], side_stream=False)
            if isinstance(first, Launch) and _may_go_first(first, item.touched.writes, [], of_points):
                # Inner points of the first one do not wait for the exchange either.
                divided = _parts(first, partition)
                beside = beside[1:] if divided else beside
            found += [replace(item, side_stream=True, divided=True), *divided, *beside, *_parts(launch, partition)]
            del left[: chain + 1]
            continue
        while left and isinstance(launch := left[0], Launch) and numbered(launch):
            parts = _parts(launch, partition)
            if not parts or not _may_go_first(launch, item.touched.writes, before, of_points):
                break
            before.append(by_point(launch))
            divided = [*divided, *parts]
            left.pop(0)
        found += [replace(item, side_stream=True, divided=True), *divided] if divided else [item]
    return found


def _chain(left: Sequence[Item], sent: Set[int], partition: Partition, numbered: Callable[[Launch], bool]) -> int:
    """Number of items after an exchange that may run on the side stream, beside inner points of the launch after them.

    0 if there are none, or if they may all be divided themselves.
    """
    divisible = True
    for count, launch in enumerate(left):
        parts = _parts(launch, partition) if isinstance(launch, Launch) and numbered(launch) else []
        if isinstance(launch, Launch) and parts and not divisible and not launch.side_stream:
            mine = by_point(launch)
            if not mine.writes & sent and not any(mine.must_wait_for(other.touched) for other in left[:count]):
                return count
        divisible = divisible and bool(parts)
        if isinstance(launch, Launch) and launch.grouped:
            # A graph skips such launches on one stream alone.
            break
    return 0


def _parts(launch: Launch, partition: Partition) -> list[Launch]:
    """The launch split into border points (side stream) and inner points; empty if there are no inner points."""
    if launch.source.effects.per != "point" and launch.span is None:
        return []
    begin, end = launch.points
    first, last = max(begin, partition.inner.start), min(end, partition.inner.stop)
    if first >= last:
        return []
    # The interior last, so that the border is queued before the device is full.
    ranges = [(begin, first, True), (last, end, True), (first, last, False)]
    return [
        replace(launch.on_points(a, b), side_stream=border, divided=True) for a, b, border in ranges if a < b
    ]  # fmt: skip


def _may_go_first(launch: Launch, sent: Set[int], before: Sequence[Touched], of_points: Set[int]) -> bool:
    """Whether the inner part of a launch may run before an exchange and before the border parts of earlier launches.

    `sent` are the arrays that are exchanged, `before` those that the earlier launches access, and `of_points` those
    that a launch accesses only at its own point unless it gathers.
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
    """Arrays that a launch accesses; a launch on a span of points gathers only arrays that its kernel names."""
    touched = launch.touched
    if launch.span is None:
        return touched
    named = launch.gathered
    return Touched(touched.reads | touched.gathers - named, touched.gathers & named, touched.writes)
