"""Arrays and launches: what a simulation keeps on its device and what it runs there, in order."""

from __future__ import annotations

import functools
import itertools
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp

# Below this many threads a launch is not worth splitting over the cores of a CPU.
SPLIT_FROM = 4096
# Points that a thread of a CPU works through in a row, of what touches its own point alone.
POINT_RUN = 256
# Below this many points small blocks let a launch reach all processors of a GPU.
SMALL, SMALL_BLOCK = 2**17, 64


@dataclass(frozen=True)
class ArrayUse:
    """One array on the device.

    Attributes:
        name: What it holds.
        owner: The part that asked for it.
        array: The Warp array.
    """

    name: str
    owner: str
    array: Any

    @property
    def nbytes(self) -> int:
        """Size in bytes."""
        return int(self.array.size) * wp.types.type_size_in_bytes(self.array.dtype)


@dataclass(eq=False)
class Launch:
    """One kernel launch with its arguments.

    Attributes:
        name: The kernel's name, or those of the point functions that it joins.
        owner: The part that asked for it.
        source: The Warp kernel; one of its arguments is called `first`. Or a PointFunction.
        threads: Number of threads, of a point function that of points.
        arguments: Value of every argument but `first` and `stop`, by name.
        block_dim: Threads of a block on CUDA.
        begin: What the first thread gets for `first`.
        module: Name of the Warp module of a point function's kernel.
        run: Points of a thread of a point function, or 0.
        beside: Whether it may run beside the launches after it, up to the next one of point functions.
    """

    name: str
    owner: str
    source: Any
    threads: int
    arguments: dict[str, Any]
    block_dim: int
    begin: int = 0
    module: str = ""
    run: int = 0
    beside: bool = False

    @property
    def parts(self) -> list[str]:
        """Names of what it does in turn."""
        return self.name.split(", ")

    @functools.cached_property
    def kernel(self) -> Any:
        """The Warp kernel; that of a point function is declared when it is asked for, once it is joined with others."""
        from .kernels.points import every_point

        return every_point(self.source, self.run, self.module) if self.run else self.source

    def slice(self, begin: int, end: int) -> tuple[int, list[Any]]:
        """Number of threads, and arguments in the kernel's order, for begin to end - 1 of its threads or points."""
        places = {"first": begin, "stop": end} if self.run else {"first": begin}
        values = {**self.arguments, **places}
        return -(-(end - begin) // (self.run or 1)), [values[a.label] for a in self.kernel.adj.args]

    def check(self) -> None:
        """Compare the argument names with the kernel's.

        Raises:
            TypeError: if one is missing or unknown.
        """
        _check_names(f"launch of {self.name}", {a.label for a in self.kernel.adj.args} - {"first"}, set(self.arguments))


def _check_names(what: str, wanted: set[str], given: set[str]) -> None:
    """Compare the names of arguments.

    Raises:
        TypeError: if one is missing or unknown.
    """
    if wanted != given:
        raise TypeError(f"{what}: missing {sorted(wanted - given)}, unknown {sorted(given - wanted)}")


@dataclass(eq=False)
class Call:
    """A step that is no Warp kernel: Torch, on arrays that it shares with Warp.

    Attributes:
        name: What it does.
        owner: The part that asked for it.
        threads: Rows that it works on.
        function: Does it, on Warp's stream of the device.
    """

    name: str
    owner: str
    threads: int
    function: Callable[[], None]

    @property
    def parts(self) -> list[str]:
        """Its name."""
        return [self.name]


@dataclass(eq=False)
class Workspace:
    """Where the parts of a simulation put their arrays and launches.

    Attributes:
        device: The Warp device.
        bits: Precision, 32 or 64.
        module: Name of the Warp module that holds every kernel of this configuration.
        block_dim: Threads of a block on CUDA; one number for all launches, as kernels are compiled for it.
        arrays: All arrays, in the order they were asked for.
        stages: Launches by stage, in order: "start" and "setup" once, "clock" where the host moved the time, "step"
            every step, "frame" at frames, "estimate" for one iteration of the stable step.
        turns: By stage that follows itself, one launch in place of its last and then its first.
    """

    device: Any
    bits: int
    module: str
    block_dim: int = 256
    arrays: list[ArrayUse] = field(default_factory=list)
    stages: dict[str, list[Launch | Call]] = field(default_factory=dict)
    turns: dict[str, Launch] = field(default_factory=dict)

    def array(self, name: str, owner: str, dtype: Any, values: np.ndarray | None = None, shape: Any = None) -> Any:
        """Allocate an array, filled with `values` or zero, and put it on the list."""
        if values is None:
            array = wp.zeros(shape, dtype=dtype, device=self.device)
        else:
            array = wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)
        self.arrays.append(ArrayUse(name, owner, array))
        return array

    def use_fast_math(self, module: str) -> None:
        """Let a module take the divisions, roots and exponentials of the hardware, in float32 on a GPU."""
        wp.get_module(module).options["fast_math"] = self.bits == 32 and self.device.is_cuda

    def launch(self, stage: str, owner: str, kernel: Any, threads: int, *, begin: int = 0, **arguments: Any) -> Launch:
        """Add a launch to a stage; `begin` is what the first thread gets for `first`."""
        launch = Launch(kernel.func.__name__, owner, kernel, threads, arguments, self.block_dim, begin)
        launch.check()
        self.stages.setdefault(stage, []).append(launch)
        return launch

    def point(self, stage: str, owner: str, part: Any, threads: int, *, begin: int = 0, **arguments: Any) -> None:
        """Add a point function to a stage: to the launch before, if that is of point functions of the same points.

        Raises:
            TypeError: if an argument is missing or unknown.
        """
        _check_names(f"point function {part.name}", set(part.arguments.vars), set(arguments))
        values = part.arguments()
        for name, value in arguments.items():
            if value is not None:
                setattr(values, name, value)
        run = 1 if self.device.is_cuda else POINT_RUN
        launches = self.stages.setdefault(stage, [])
        launch = Launch(part.name, owner, part, threads, {"arguments": values}, self.block_dim, begin, self.module, run)
        joined = _joined(launches[-1], launch) if launches else None
        launches[-1 if joined else len(launches) :] = [joined or launch]

    def close(self, stage: str) -> None:
        """Let the last launch of a stage share one with its first, where the stage follows itself and they may."""
        first, last = self.stages[stage][0], self.stages[stage][-1]
        turn = _joined(last, first)
        if turn is not None and first is not last and not turn.source.looks_around:
            self.turns[stage] = turn

    def call(self, stage: str, owner: str, name: str, threads: int, function: Callable[[], None]) -> None:
        """Add a step that is no kernel to a stage."""
        self.stages.setdefault(stage, []).append(Call(name, owner, threads, function))

    def array_bytes(self) -> int:
        """Bytes of all arrays."""
        return sum(use.nbytes for use in self.arrays)

    def compile(self) -> float:
        """Build or load every kernel now; returns the seconds it took."""
        begin = time.perf_counter()
        launches = [x for stage in self.stages.values() for x in stage if isinstance(x, Launch)]
        launches += self.turns.values()
        for module, block_dim in {(launch.kernel.module, launch.block_dim) for launch in launches}:
            # A launch on a CPU has blocks of one thread; a module built for other blocks would be built again there.
            module.load(self.device, block_dim if self.device.is_cuda else 1)
        return time.perf_counter() - begin

    def sequence(self, stage: str, repeat: int = 1) -> LaunchSequence:
        """The launches of a stage, ready to run."""
        return LaunchSequence(self.device, self.stages.get(stage, []), repeat, self.turns.get(stage))


def _joined(first: Launch | Call, second: Launch | Call) -> Launch | None:
    """One launch of two of point functions on the same points, or None."""
    from .kernels.points import in_turn

    if not (isinstance(first, Launch) and isinstance(second, Launch) and first.run and second.run):
        return None
    if (first.threads, first.begin) != (second.threads, second.begin):
        return None
    part = in_turn(first.source, second.source, first.module)
    both = part.arguments()
    both.a, both.b = first.arguments["arguments"], second.arguments["arguments"]
    owner = ", ".join(dict.fromkeys([*first.owner.split(", "), *second.owner.split(", ")]))
    return replace(first, name=part.name, owner=owner, source=part, arguments={"arguments": both})


class LaunchSequence:
    """A list of launches that runs again and again with the least work on the host.

    On CUDA the list, repeated, is one captured graph; Torch captures it where a step is Torch's. On a CPU every
    launch is recorded once; a large one is cut into slices that run on all cores (a launch releases the interpreter
    lock), and Torch runs in between. `turn` is a launch that takes the place of the last one and the first one of
    the next repetition.
    """

    def __init__(
        self, device: Any, launches: Iterable[Launch | Call], repeat: int = 1, turn: Launch | None = None
    ) -> None:
        self.device = device
        self.repeat = repeat
        once = list(launches)
        self.launches = once * repeat
        if turn is not None:
            self.launches = [*once[:-1], *[turn, *once[1:-1]] * (repeat - 1), once[-1]]
        self._graph: Any = None
        self._commands: list[list[Callable[[], None]]] = []
        if not device.is_cuda:
            recorded = {launch: _record(launch, device) for launch in dict.fromkeys(self.launches)}
            self._commands = [recorded[launch] for launch in self.launches]

    def run(self) -> None:
        """Run the list `repeat` times, in order."""
        if not self.launches:
            return
        if self.device.is_cuda:
            self._run_graph()
            return
        for commands in self._commands:
            if len(commands) == 1:
                commands[0]()
            else:
                list(cores().map(_call, commands))

    def _run_graph(self) -> None:
        if any(isinstance(launch, Call) for launch in self.launches):
            self._run_torch_graph()
            return
        if self._graph is None:
            with wp.ScopedCapture(device=self.device, force_module_load=False) as capture:
                run_once(self.device, self.launches)
            self._graph = capture.graph
        wp.capture_launch(self._graph)

    def _run_torch_graph(self) -> None:
        import torch

        if self._graph is None:
            # Torch allocates and chooses its algorithms on the first call, which no capture allows.
            for launch in dict.fromkeys(self.launches):
                if isinstance(launch, Call):
                    launch.function()
            wp.synchronize_device(self.device)
            stream = torch.cuda.Stream(device=wp.device_to_torch(self.device))
            graph = torch.cuda.CUDAGraph()
            with wp.ScopedStream(wp.stream_from_torch(stream)), torch.cuda.graph(graph, stream=stream):
                wp.capture_begin(device=self.device, force_module_load=False, external=True)
                try:
                    run_once(self.device, self.launches)
                finally:
                    wp.capture_end(device=self.device)
            self._graph = graph
        # Replayed on Warp's stream, in order with everything else.
        with torch.cuda.stream(wp.stream_to_torch(self.device.stream)):
            self._graph.replay()


def available_cores() -> int:
    """Number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


_pool: ThreadPoolExecutor | None = None


def cores() -> ThreadPoolExecutor:
    """Threads, one a core, for work that releases the interpreter lock."""
    global _pool  # noqa: PLW0603 - one pool a process
    if _pool is None:
        _pool = ThreadPoolExecutor(available_cores(), thread_name_prefix="warp_pd")
    return _pool


def _call(command: Callable[[], None]) -> None:
    command()


def _record(launch: Launch | Call, device: Any) -> list[Callable[[], None]]:
    """The launch as recorded commands, one a slice."""
    if isinstance(launch, Call):
        return [launch.function]
    parts = available_cores() if launch.threads >= SPLIT_FROM else 1
    bounds = launch.begin + np.linspace(0, launch.threads, parts + 1).astype(int)
    commands = []
    for begin, end in itertools.pairwise(bounds):
        threads, values = launch.slice(int(begin), int(end))
        command = wp.launch(
            launch.kernel, dim=threads, inputs=values, device=device, record_cmd=True, block_dim=launch.block_dim
        )
        commands.append(command.launch)
    return commands


def run_once(device: Any, launches: Iterable[Launch | Call]) -> None:
    """Run launches now, one by one."""
    beside = False
    for launch in launches:
        if isinstance(launch, Call):
            launch.function()
            continue
        threads, values = launch.slice(launch.begin, launch.begin + launch.threads)
        stream = None
        if device.is_cuda and launch.beside:
            stream, beside = _side_stream(device.alias), True
            stream.wait_stream(device.stream)
        elif beside and launch.run:
            device.stream.wait_stream(_side_stream(device.alias))
            beside = False
        wp.launch(launch.kernel, dim=threads, inputs=values, device=device, block_dim=launch.block_dim, stream=stream)
    if beside:
        device.stream.wait_stream(_side_stream(device.alias))


@functools.cache
def _side_stream(alias: str) -> Any:
    """Stream of a GPU for what runs beside the rest."""
    return wp.Stream(alias)
