"""Runs stages with little work on the host: captured graphs on CUDA, recorded launches on a CPU."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from ..cores import available_cores, cores
from .launches import Call, Item, Launch, Stage, Touched

# Below this number of threads, splitting a launch over the cores of a CPU does not pay.
SPLIT_FROM = 4096


class LaunchSequence:
    """The launches of a stage, repeated, ready to run any number of times.

    On CUDA they are one captured graph; if one is a Call, the Call captures them. On a CPU every launch is recorded
    once; a large one is cut into slices that run on all cores (a launch releases the interpreter lock), and calls run
    in between. The stage's wraparound launch replaces the last launch and the first one of the next repetition.
    """

    def __init__(self, stage: Stage, repeat: int = 1) -> None:
        self.device, self.repeat = stage.device, repeat
        once = list(stage)
        self.items = once * repeat
        if stage.wraparound is not None:
            self.items = [*once[:-1], *[stage.wraparound, *once[1:-1]] * (repeat - 1), once[-1]]
        self._replay: Callable[[], None] | None = None
        self._commands: list[list[Callable[[], None]]] = []
        if not self.device.is_cuda:
            recorded = {item: _record(item, self.device) for item in dict.fromkeys(self.items)}
            self._commands = [recorded[item] for item in self.items]

    def run(self) -> None:
        """Run the list `repeat` times, in order."""
        if not self.items:
            return
        if self.device.is_cuda:
            self._replay = self._replay or self._captured()
            self._replay()
            return
        for commands in self._commands:
            if len(commands) == 1:
                commands[0]()
            else:
                list(cores().map(_call, commands))

    def _captured(self) -> Callable[[], None]:
        calls = [item for item in dict.fromkeys(self.items) if isinstance(item, Call)]
        body = functools.partial(run_once, self.device, self.items)
        if calls:
            return calls[0].capture(self.device, functools.partial(_run_calls, calls), body)
        with wp.ScopedCapture(device=self.device, force_module_load=False) as capture:
            body()
        return functools.partial(wp.capture_launch, capture.graph)


def _call(command: Callable[[], None]) -> None:
    command()


def _run_calls(calls: Iterable[Call]) -> None:
    for call in calls:
        call.function()


def _record(item: Item, device: wp.Device) -> list[Callable[[], None]]:
    """The launch as recorded commands, one per slice."""
    if isinstance(item, Call):
        return [item.function]
    parts = available_cores() if item.threads >= SPLIT_FROM else 1
    bounds = item.begin + np.linspace(0, item.threads, parts + 1).astype(int)
    commands: list[Callable[[], None]] = []
    for begin, end in itertools.pairwise(bounds):
        threads, values = item.slice(int(begin), int(end))
        command: Any = wp.launch(
            item.kernel, dim=threads, inputs=values, device=device, record_cmd=True, block_dim=item.block_dim
        )
        commands.append(command.launch)
    return commands


def run_once(device: wp.Device, items: Iterable[Item]) -> None:
    """Run launches now, one by one; on CUDA those of the side stream in parallel with others that do not need them."""
    items = list(items)
    waits = side_stream_waits(items) if device.is_cuda else [False] * (len(items) + 1)
    for item, wait in zip(items, waits, strict=False):
        if wait:
            device.stream.wait_stream(_side_stream(device.alias))
        if isinstance(item, Launch):
            _launch(item, device)
        else:
            item.function()
    if waits[-1]:
        device.stream.wait_stream(_side_stream(device.alias))


def side_stream_waits(items: Sequence[Item]) -> list[bool]:
    """Whether the main stream waits for the side stream before each item, and at the end: one entry more than items."""
    waits: list[bool] = []
    parallel: list[Touched] = []
    for item in items:
        waits.append(any(item.touched.must_wait_for(earlier) for earlier in parallel))
        if waits[-1]:
            parallel = []
        if item.side_stream:
            parallel.append(item.touched)
    return [*waits, bool(parallel)]


def launch_now(item: Launch, device: wp.Device, **changed: Any) -> None:
    """Run one launch with some arguments changed; for solvers with separate vectors."""
    threads, values = replace(item, arguments={**item.arguments, **changed}).slice(
        item.begin, item.begin + item.threads
    )
    wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim)


def _launch(item: Launch, device: wp.Device) -> None:
    stream = None
    if device.is_cuda and item.side_stream:
        stream = _side_stream(device.alias)
        stream.wait_stream(device.stream)
    threads, values = item.slice(item.begin, item.begin + item.threads)
    wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim, stream=stream)


@functools.cache
def _side_stream(alias: str) -> wp.Stream:
    """Stream of a GPU for launches that run in parallel with the main stream."""
    return wp.Stream(alias)
