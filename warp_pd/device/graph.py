"""Runs stages with little work on the host: captured graphs on CUDA, recorded launches on a CPU."""

from __future__ import annotations

import contextlib
import functools
import gc
import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import warp as wp

from .cores import available_cores, cores
from .launches import Call, Item, Launch, Stage
from .streams import MAIN, SIDE, stream_of, stream_waits

# A launch that takes longer than this on one core of a CPU [s] is split over all; starting them takes a third of it.
SPLIT_FROM = 1e-4
# Number of runs, of which the shortest decides.
TIMED_RUNS = 3


class LaunchSequence:
    """The launches of a stage, repeated, ready to run any number of times.

    On CUDA they are one captured graph; if one is a Call, the Call captures them. On a CPU every launch is recorded
    once; one that takes long is cut into slices that run on all cores (a launch releases the interpreter lock), and
    calls run in between. The stage's wraparound launch replaces the last launch and the first of the next repetition.
    """

    def __init__(self, stage: Stage, repeat: int = 1) -> None:
        self.device, self.repeat = stage.device, repeat
        once = list(stage)
        self.items = once * repeat
        if stage.wraparound is not None:
            self.items = [*once[:-1], *[stage.wraparound, *once[1:-1]] * (repeat - 1), once[-1]]
        self._replay: Callable[[], None] | None = None
        self._commands: list[Callable[[], None]] = []
        if not self.device.is_cuda:
            recorded = {
                item: CpuLaunch(item, self.device).run if isinstance(item, Launch) else item.function
                for item in dict.fromkeys(self.items)
            }
            self._commands = [recorded[item] for item in self.items]

    def run(self) -> None:
        """Run the list `repeat` times, in order."""
        if not self.items:
            return
        if self.device.is_cuda:
            self._replay = self._replay or self._captured()
            self._replay()
            return
        for command in self._commands:
            command()

    def _captured(self) -> Callable[[], None]:
        calls = [item for item in dict.fromkeys(self.items) if isinstance(item, Call)]
        body = functools.partial(run_once, self.device, self.items)
        if calls:
            return calls[0].capture(self.device, functools.partial(_run_calls, calls), body)
        with no_collection(), wp.ScopedCapture(device=self.device, force_module_load=False) as capture:
            body()
        return functools.partial(wp.capture_launch, capture.graph)


@contextlib.contextmanager
def no_collection() -> Iterator[None]:
    """Keep the garbage collector off: it may free the graph of an earlier run, which CUDA forbids during a capture."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _run_calls(calls: Iterable[Call]) -> None:
    for call in calls:
        call.function()


class CpuLaunch:
    """A launch on a CPU: on one core, or in slices on all of them if it takes long. Results are the same.

    Args:
        item: The launch.
        device: The CPU.
        split_from: Time on one core from which it is split [s].
        parts: Number of slices; None: one per core.
    """

    def __init__(
        self, item: Launch, device: wp.Device, split_from: float = SPLIT_FROM, parts: int | None = None
    ) -> None:
        self.item, self.device = item, device
        self._split_from, self._parts = split_from, parts or available_cores()
        self.slices = [self._record(item.begin, item.begin + item.threads)]
        self._needed = None if item.only_if is None else item.only_if.numpy()
        self._undecided = TIMED_RUNS if min(item.threads, self._parts) > 1 else 0
        self._shortest = math.inf

    def run(self) -> None:
        """Run the launch and wait for it, unless it would do nothing."""
        if self._needed is not None and not self._needed[0]:
            return
        if self._undecided:
            self._run_timed()
            return
        first, *others = self.slices
        started = [cores().submit(other) for other in others]
        first()
        for future in started:
            future.result()

    def _run_timed(self) -> None:
        begin = time.perf_counter()
        self.slices[0]()
        self._shortest = min(self._shortest, time.perf_counter() - begin)
        self._undecided -= 1
        if not self._undecided and self._shortest > self._split_from:
            item = self.item
            bounds = item.begin + np.linspace(0, item.threads, self._parts + 1).astype(int)
            self.slices = [self._record(int(begin), int(end)) for begin, end in itertools.pairwise(bounds)]

    def _record(self, begin: int, end: int) -> Callable[[], None]:
        item = self.item
        threads, values = item.slice(begin, end)
        command: Any = wp.launch(
            item.kernel, dim=threads, inputs=values, device=self.device, record_cmd=True, block_dim=item.block_dim
        )
        return cast(Callable[[], None], command.launch)


def run_once(device: wp.Device, items: Iterable[Item]) -> None:
    """Run launches now, one by one; on CUDA those of other streams in parallel with others that do not need them."""
    items = list(items)
    if device.is_cuda and any(stream_of(item) != MAIN for item in items):
        _run_on_streams(device, items)
        return
    for item in items:
        if isinstance(item, Launch):
            _launch(item, device)
        else:
            item.function()


def _run_on_streams(device: wp.Device, items: Sequence[Item]) -> None:
    numbers = sorted({stream_of(item) for item in items} | {MAIN})
    streams = {number: _stream(device.alias, number) if number != MAIN else device.stream for number in numbers}
    for stream in list(streams.values())[1:]:
        stream.wait_stream(device.stream)
    waits = stream_waits(items)
    awaited = {number for pairs in waits for _, number in pairs}
    events: dict[int, wp.Event] = {}
    for place, pairs in enumerate(waits):
        for waiting, number in pairs:
            streams[waiting].wait_event(events[number])
        if place == len(items):
            return
        item = items[place]
        stream = streams[stream_of(item)]
        if isinstance(item, Launch):
            _launch(item, device, stream)
        elif stream is device.stream:
            item.function()
        else:
            with wp.ScopedStream(stream):
                item.function()
        if place in awaited:
            events[place] = stream.record_event()


def launch_now(item: Launch, device: wp.Device, **changed: Any) -> None:
    """Run one launch with some arguments changed; for solvers with separate vectors."""
    threads, values = replace(item, arguments={**item.arguments, **changed}).slice(
        item.begin, item.begin + item.threads
    )
    wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim)


def _launch(item: Launch, device: wp.Device, stream: wp.Stream | None = None) -> None:
    threads, values = item.slice(item.begin, item.begin + item.threads)
    wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim, stream=stream)


@functools.cache
def _stream(alias: str, number: int) -> wp.Stream:
    """Stream of a GPU for launches in parallel with the main stream; those of the side stream go before all others."""
    return wp.Stream(alias, priority=-1 if number == SIDE else 0)
