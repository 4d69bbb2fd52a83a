"""Which launches of a stage run beside each other on the streams of a GPU, and which wait for which.

Stream 0 runs what stands in order. Launches on other streams run beside it, until something touches their arrays.
"""

from __future__ import annotations

from collections.abc import Sequence

from .launches import Call, Item

# Streams: that of the launches in order, an urgent one beside it, and a second one for every other strip of a sheet.
MAIN, SIDE, SECOND = 0, 1, 2


def stream_of(item: Item) -> int:
    """Stream on which an item runs."""
    return item.strip.stream if item.strip is not None else SIDE if item.side_stream else MAIN


def stream_waits(items: Sequence[Item]) -> list[list[tuple[int, int]]]:
    """What streams wait for before each item, and at the end: one entry more than items.

    Returns:
        For each item, pairs of a stream and the number of an earlier item on another one that it waits for.
    """
    waits: list[list[tuple[int, int]]] = []
    on: dict[int, list[int]] = {MAIN: []}
    # How many items of each stream are over when a stream goes on, and when an item is over.
    known: dict[int, dict[int, int]] = {MAIN: {}}
    over: list[dict[int, int]] = []

    def wait(stream: int, other: int, place: int) -> None:
        waits[-1].append((stream, on[other][place]))
        known[stream] = _latest(known[stream], over[on[other][place]])

    for number, item in enumerate(items):
        waits.append([])
        stream = stream_of(item)
        mine = on.setdefault(stream, [])
        known.setdefault(stream, {})
        for other, earlier in on.items():
            if other != stream:
                place = _awaited(item, stream, other, [items[k] for k in earlier[known[stream].get(other, 0) :]])
                if place:
                    wait(stream, other, known[stream].get(other, 0) + place - 1)
        if stream == SIDE and any(_meet_beside(item, items[k]) for k in mine[known[MAIN].get(SIDE, 0) :]):
            # What runs beside an exchange has waited for nothing beside the one before.
            wait(MAIN, SIDE, len(mine) - 1)
        mine.append(number)
        known[stream] = {**known[stream], stream: len(mine)}
        over.append(known[stream])
    waits.append([])
    for other, launched in on.items():
        if other != MAIN and known[MAIN].get(other, 0) < len(launched):
            wait(MAIN, other, len(launched) - 1)
    return waits


def side_stream_waits(items: Sequence[Item]) -> list[bool]:
    """Whether the main stream waits for another one before each item, and at the end: one entry more than items."""
    return [any(stream == MAIN for stream, _ in waits) for waits in stream_waits(items)]


def _latest(one: dict[int, int], other: dict[int, int]) -> dict[int, int]:
    return {stream: max(one.get(stream, 0), other.get(stream, 0)) for stream in {**one, **other}}


def _awaited(item: Item, stream: int, other: int, earlier: Sequence[Item]) -> int:
    """How many of the earlier items on another stream must be over before an item begins."""
    if item.strip is None:
        # All: what is on the side stream waits for everything that stands before it.
        needed = bool(earlier) and ((stream != MAIN and other == MAIN) or any(_must_wait(item, e) for e in earlier))
        return len(earlier) if needed else 0
    return max((k + 1 for k, e in enumerate(earlier) if _must_wait(item, e)), default=0)


def _must_wait(item: Item, earlier: Item) -> bool:
    """Whether an item waits for an earlier one on another stream."""
    if item.beside and earlier.beside:
        # Parts of divided launches touch different points up to the next exchange.
        return isinstance(item, Call)
    if item.strip is not None and earlier.strip is not None:
        return item.strip.must_wait_for(earlier.strip)
    return item.touched.must_wait_for(earlier.touched)


def _meet_beside(item: Item, earlier: Item) -> bool:
    """Whether an item is an exchange after what ran beside an earlier one."""
    return isinstance(item, Call) and item.beside and earlier.beside
