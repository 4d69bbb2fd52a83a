"""Runs stages with little host overhead: captured graphs on CUDA, recorded launches on a CPU."""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import warp as wp

from .cores import available_cores, cores, load_kernel, no_collection
from .fields import Array
from .launches import Call, Item, Launch, Stage, arrays_in

# A launch that takes longer than this on one core of a CPU [s] is split over all; starting them takes a third of it.
SPLIT_FROM = 1e-4
# Time that a slice takes at least [s], and most slices for each core: a core that another program uses, too, such as
# the one that writes files beside the run, then takes fewer of them.
SLICE_SECONDS, SLICES_PER_CORE = 5e-4, 4
# Number of runs, of which the shortest decides. Launches on so many points or more remember them from run to run.
TIMED_RUNS, REMEMBERED_FROM = 3, 1000


class LaunchSequence:
    """The repeated launches of a stage as a sequence that can run any number of times.

    On CUDA the sequence is one captured graph; if an item is a Call, the Call captures it. On a CPU every launch is
    recorded once; a long launch is divided into slices that run on all cores (a launch releases the interpreter lock).
    The stage's wraparound launch replaces the last launch and the first launch of the next repetition.

    Args:
        stage: The stage.
        repeat: Number of repetitions.
        begin: Index of the first repetition, see `Launch.every`.
    """

    def __init__(self, stage: Stage, repeat: int = 1, begin: int = 0) -> None:
        self.device, self.repeat = stage.device, repeat
        rounds = [stage.round(number) for number in range(begin, begin + repeat)]
        self.items = [item for once in rounds for item in once]
        if stage.wraparound is not None:
            self.items = wrapped(rounds, stage.wraparound, stage.leading, self.device.is_cuda)
        self._replay: Callable[[], None] | None = None
        self._commands: list[Callable[[], None]] = []
        if not self.device.is_cuda:
            recorded = {
                item: CpuLaunch(item, self.device).run if isinstance(item, Launch) else item.function
                for item in dict.fromkeys(self.items)
            }
            self._commands = [recorded[item] for item in self.items]

    def run(self) -> None:
        """Run the launches `repeat` times, in order."""
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


def wrapped(rounds: Sequence[list[Item]], joined: Launch, leading: int, beside: bool) -> list[Item]:
    """Repetitions of a stage whose last launch, and the first of the next repetition, are replaced by `joined`.

    The `leading` launches that run before it may go `beside` the others of the previous repetition, on the side stream.
    """
    leaders, inner = [once[:leading] for once in rounds], [once[leading + 1 : -1] for once in rounds]
    others = [item for once in inner for item in once]
    beside = beside and not any(isinstance(item, Call) for item in others)
    beside = beside and not any(_must_wait(item, first) for first in leaders[0] for item in others)
    items = rounds[0][: leading + 1]
    for number, own in enumerate(inner):
        last = number + 1 == len(rounds)
        coming = [] if last else leaders[number + 1]
        if beside:
            items += [*(replace(cast(Launch, item), side_stream=True) for item in coming), *own]
        else:
            items += [*own, *coming]
        items.append(rounds[-1][-1] if last else joined)
    return items


def _run_calls(calls: Iterable[Call]) -> None:
    for call in calls:
        call.function()


class CpuLaunch:
    """A launch on a CPU: on one core, or in slices on all cores if it takes long, with the same results.

    Args:
        item: The launch.
        device: The CPU.
    """

    def __init__(self, item: Launch, device: wp.Device) -> None:
        self.item, self.device, self._parts = item, device, available_cores()
        # Keeps its module loaded.
        self._recorded: Any = None
        self._arguments: Any = None
        self.slices = [self._record(item.begin, item.begin + item.threads)]
        self._needed = None if item.only_if is None else item.only_if.numpy()
        self._undecided = TIMED_RUNS if min(item.threads, self._parts) > 1 else 0
        self._shortest = math.inf
        self._same: tuple[Any, ...] | None = None
        if self._undecided and item.threads >= REMEMBERED_FROM:
            self._same = item.kernel, item.begin, item.threads, *(array.shape for _, array in arrays_in(item.arguments))
            self._shortest, self._undecided = _TIMES.get(self._same, (self._shortest, self._undecided))
            self._split_if_long()

    def run(self) -> None:
        """Run the launch and wait for it, unless its condition is 0."""
        if self._needed is not None and not self._needed[0]:
            return
        if self._undecided:
            self._run_timed()
            return
        if len(self.slices) == 1:
            self.slices[0]()
            return
        # Threads take the next slice from one iterator until there is none.
        waiting = iter(self.slices)
        started = [cores().submit(_run_all, waiting) for _ in range(self._parts - 1)]
        _run_all(waiting)
        for future in started:
            # A thread that has not begun has nothing left to do.
            if not future.cancel():
                future.result()

    def _run_timed(self) -> None:
        begin = time.perf_counter()
        self.slices[0]()
        self._shortest = min(self._shortest, time.perf_counter() - begin)
        self._undecided -= 1
        if self._same is not None:
            _TIMES[self._same] = self._shortest, self._undecided
        self._split_if_long()

    def _split_if_long(self) -> None:
        if not self._undecided and self._shortest > SPLIT_FROM:
            item = self.item
            most = min(SLICES_PER_CORE * self._parts, int(self._shortest / SLICE_SECONDS), item.threads)
            bounds = item.begin + np.linspace(0, item.threads, max(most, self._parts) + 1).astype(int)
            self.slices = [self._record(int(begin), int(end)) for begin, end in itertools.pairwise(bounds)]

    def _record(self, begin: int, end: int) -> Callable[[], None]:
        item = self.item
        threads, values = item.slice(begin, end)
        if self._arguments is not None:
            # A slice differs in its numbers alone; to record takes 60 microseconds.
            arguments = type(self._arguments).from_buffer_copy(self._arguments)
            bounds = type(self._recorded.bounds)((threads,))
            for (name, _), value in zip(arguments._fields_, values, strict=True):
                if isinstance(value, int):
                    setattr(arguments, name, value)
            return functools.partial(self._recorded.hooks.forward, ctypes.byref(bounds), ctypes.byref(arguments))
        key = item.kernel, item.block_dim, *map(_kind, values)
        found: tuple[Any, Any] = _RECORDED.get(key, (None, None))
        command, Arguments = found
        if command is None:
            load_kernel(item.kernel, self.device)
            command = wp.launch(
                item.kernel, dim=threads, inputs=values, device=self.device, record_cmd=True, block_dim=item.block_dim
            )
            if command.block_dim > 1:
                return cast(Callable[[], None], command.launch)
            Arguments = _packed(tuple(map(type, command.params[1:])))
            arguments = Arguments(*command.params[1:])
            command.params, command.fwd_args = (), ()
            if None not in key:
                _RECORDED[key] = command, Arguments
        else:
            # Warp checks and packs each argument for five microseconds; those of other types had another key.
            arguments = Arguments()
            for (name, _), value in zip(arguments._fields_, values, strict=True):
                if value is not None:
                    setattr(arguments, name, value.__ctype__() if hasattr(value, "__ctype__") else value)
        bounds = type(command.bounds)((threads,))
        self._recorded, self._arguments = command, arguments
        return functools.partial(command.hooks.forward, ctypes.byref(bounds), ctypes.byref(arguments))


# The shortest time [s] of a kernel on arrays of certain shapes, and the number of runs that are left to decide.
_TIMES: dict[tuple[Any, ...], tuple[float, int]] = {}
# Launches of kernels with arguments of certain types, without the arguments, and the C struct that takes them.
_RECORDED: dict[tuple[Any, ...], tuple[Any, Any]] = {}


def _kind(value: Any) -> Any:
    """What Warp checks of an argument; None for one that it converts."""
    kind = type(value)
    if kind is wp.array:
        return value.dtype, value.ndim
    if value is None or kind in (int, float, bool) or isinstance(value, ctypes.Array):
        return kind
    return getattr(value, "_cls", None)


@functools.cache
def _packed(kinds: tuple[type, ...]) -> Any:
    """The C struct in which a kernel on a CPU takes arguments of these types."""
    return type("Arguments", (ctypes.Structure,), {"_fields_": [(f"a{k}", kind) for k, kind in enumerate(kinds)]})


def _run_all(slices: Iterator[Callable[[], None]]) -> None:
    for run in slices:
        run()


def run_once(device: wp.Device, items: Iterable[Item]) -> None:
    """Run launches once, now; on CUDA launches of the side stream run in parallel with independent launches."""
    items = list(items)
    conditional = device.is_cuda and wp.is_conditional_graph_supported()
    aside = device.is_cuda and any(item.side_stream for item in items)
    main: Any = device.stream if aside else None
    side: Any = _side_stream(device.alias) if aside else None
    waits = side_stream_waits(items)
    for condition, group in itertools.groupby(zip(items, waits, strict=False), lambda pair: _condition(pair[0])):
        pairs = list(group)
        if condition is not None and conditional:
            if pairs[0][1]:
                main.wait_stream(side)
            wp.capture_if(condition, on_true=functools.partial(_run_in_order, [item for item, _ in pairs], device))
            continue
        for item, wait in pairs:
            if wait and aside:
                main.wait_stream(side)
            if item.side_stream and aside:
                # The side stream waits for everything before it.
                side.wait_stream(main)
            _run(item, device, side if item.side_stream else main)
    if waits[-1] and aside:
        main.wait_stream(side)


def _run_in_order(items: Iterable[Item], device: wp.Device) -> None:
    for item in items:
        _run(item, device)


def _condition(item: Item) -> Array | None:
    """The array that decides on a GPU whether a launch and adjacent ones are needed, or None."""
    return item.only_if if isinstance(item, Launch) and item.grouped else None


def side_stream_waits(items: Sequence[Item]) -> list[bool]:
    """For each item, and for the end, whether the main stream must wait for the side stream (one entry more than
    items).

    It always waits before conditional launches, where graph capture allows only one stream.
    """
    waits: list[bool] = []
    parallel: list[Item] = []
    for item in items:
        alone = _condition(item) is not None
        # What follows on the side stream is in order there.
        follows = item.side_stream and not item.divided and not alone
        waits.append(not follows and any(alone or _must_wait(item, earlier) for earlier in parallel))
        if waits[-1]:
            parallel = []
        if item.side_stream:
            parallel.append(item)
    return [*waits, bool(parallel)]


def _must_wait(item: Item, earlier: Item) -> bool:
    """Whether an item waits for an earlier one on the side stream."""
    if item.divided and earlier.divided:
        # Parts of divided launches touch different points up to the next exchange.
        return isinstance(item, Call)
    return item.touched.must_wait_for(earlier.touched)


def launch_now(item: Launch, device: wp.Device, **changed: Any) -> None:
    """Run one launch with some arguments replaced, for solvers with separate vectors."""
    threads, values = replace(item, arguments={**item.arguments, **changed}).slice(
        item.begin, item.begin + item.threads
    )
    wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim)


def _run(item: Item, device: wp.Device, stream: wp.Stream | None = None) -> None:
    """Run a launch or call on a stream of a GPU, or on a CPU."""
    if isinstance(item, Launch):
        threads, values = item.slice(item.begin, item.begin + item.threads)
        wp.launch(item.kernel, dim=threads, inputs=values, device=device, block_dim=item.block_dim, stream=stream)
    elif stream is None or stream is device.stream:
        item.function()
    else:
        with wp.ScopedStream(stream, sync_enter=False):
            item.function()


@functools.cache
def _side_stream(alias: str) -> wp.Stream:
    """Side stream of a GPU, for launches that run in parallel with the main stream."""
    return wp.Stream(alias, priority=-1)
