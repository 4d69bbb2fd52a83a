"""Launches, and stages: lists of launches that run in order.

The arrays that a launch reads, gathers from neighbours and writes are declared (kernels/effects.py). They determine
which pointwise stages can share a launch, and which launches must wait for one on a side stream.
"""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import warp as wp

from ..kernels.effects import Effects, Kernel, Pointwise, every_point, in_turn
from .checks import InputError
from .cores import compilers
from .fields import Array
from .kernel_cache import is_loaded, load_module

# Consecutive points that a CPU thread works through in a pointwise stage.
POINT_RUN = 256
# Up to this many points do not fill a GPU: with FEW_BLOCKS blocks per multiprocessor threads may use more registers.
FEW_POINTS, FEW_BLOCKS = 2**15, 4
# Blocks per multiprocessor of a larger launch whose costly branch is rare, so that it keeps few registers.
RARE_BLOCKS = 5


@dataclass(frozen=True)
class Touched:
    """Arrays that a launch accesses, by address.

    Attributes:
        reads: Arrays read at the thread's own point, or by a launch that does not work on points.
        gathers: Arrays read at other points.
        writes: Arrays written at the thread's own point.
    """

    reads: frozenset[int] = frozenset()
    gathers: frozenset[int] = frozenset()
    writes: frozenset[int] = frozenset()

    def __or__(self, other: Touched) -> Touched:
        return Touched(self.reads | other.reads, self.gathers | other.gathers, self.writes | other.writes)

    def may_share_launch(self, later: Touched) -> bool:
        """Whether a later pointwise stage can share the launch, i.e. neither gathers an array that the other writes."""
        return not (self.writes & later.gathers or self.gathers & later.writes)

    def must_wait_for(self, earlier: Touched) -> bool:
        """Whether this launch cannot run in parallel with an earlier one."""
        used = self.reads | self.gathers | self.writes
        return bool(earlier.writes & used or self.writes & (earlier.reads | earlier.gathers))


def arrays_in(arguments: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """Names and arrays among arguments; those of structs as "struct.array"."""
    for name, value in arguments.items():
        if isinstance(value, wp.array):
            yield name, value
        elif hasattr(value, "_cls"):  # an instance of a Warp struct, whose class Warp does not export
            members = {member: getattr(value, member) for member in value._cls.vars}
            yield from ((f"{name}.{member}", array) for member, array in arrays_in(members))


def with_values(struct: Any, values: Mapping[str, Any]) -> Any:
    """Fill a Warp struct with values; members with None are left unchanged."""
    for name, value in values.items():
        if value is not None:
            setattr(struct, name, value)
    return struct


def touched(effects: Effects, arguments: Mapping[str, Any]) -> Touched:
    """Arrays that a launch with these arguments accesses."""
    reads, gathers, writes = set(), set(), set()
    for name, array in arrays_in(arguments):
        if not array.ptr:
            continue
        if name in effects.writes:
            writes.add(array.ptr)
        elif effects.per != "point" or name in effects.gathers:
            gathers.add(array.ptr)
        else:
            reads.add(array.ptr)
    return Touched(frozenset(reads), frozenset(gathers), frozenset(writes))


@dataclass(frozen=True)
class Span:
    """Division of the points from argument `start` to `stop` - 1 among the blocks of a launch.

    The argument `blocks` is the number of blocks; each block loops until all points are done.

    Attributes:
        together: Points that a block works on at once.
        most: Maximum number of blocks.
    """

    together: int
    most: int

    def blocks(self, points: int) -> int:
        """Number of blocks for a number of points."""
        return min(-(-points // self.together), self.most)


@dataclass(eq=False)
class Launch:
    """One kernel launch with its arguments.

    Attributes:
        name: The kernel's name, or the names of the joined pointwise stages.
        source: The kernel, which must have an argument `first`, or a pointwise stage.
        threads: Number of threads; for a pointwise stage, number of points.
        arguments: Value of every argument except `first` and `stop`, by name.
        touched: Arrays that it accesses.
        block_dim: Threads per block on CUDA.
        begin: Value of `first` for the first thread.
        run: Points per thread of a pointwise stage, or 0.
        side_stream: Whether it may run in parallel with later launches, up to the first that accesses its arrays.
        alone: Whether a pointwise stage must not share a launch.
        divided: Whether it is part of a launch that was split by points around an exchange (distributed/overlap.py).
            Parts of one split need not wait for each other.
        span: Division of points among blocks, if threads do not correspond to points.
        only_if: Array; while its first entry is 0, a CPU skips the launch, and on a GPU the kernel does nothing.
        grouped: Whether a GPU also skips it, together with adjacent launches with the same `only_if`.
        every: Interval of repetitions of a repeated stage in which it runs.
        since: First repetition in which it runs.
        late: The same launch after those that lead the next repetition, if it then has other arguments.
        pieces: The launches of the pointwise stages that share it, if several do.
    """

    name: str
    owner: str
    source: Kernel | Pointwise
    threads: int
    arguments: dict[str, Any]
    touched: Touched
    block_dim: int
    begin: int = 0
    run: int = 0
    side_stream: bool = False
    alone: bool = False
    divided: bool = False
    span: Span | None = None
    only_if: Array | None = None
    grouped: bool = False
    every: int = 1
    since: int = 0
    late: Launch | None = None
    pieces: tuple[Launch, ...] = ()

    @property
    def gathered(self) -> set[int]:
        """Arrays that its kernel names as gathered, by address."""
        named = self.source.effects.gathers
        return {int(array.ptr) for name, array in arrays_in(self.arguments) if name in named}

    @property
    def points(self) -> tuple[int, int]:
        """First point that it works on, and last point plus 1."""
        if self.span is None:
            return self.begin, self.begin + self.threads
        return self.arguments["start"], self.arguments["stop"]

    def on_points(self, begin: int, end: int) -> Launch:
        """The same launch on the points begin to end - 1."""
        if self.span is None:
            return replace(self, begin=begin, threads=end - begin)
        blocks = self.span.blocks(end - begin)
        arguments = {**self.arguments, "start": begin, "stop": end, "blocks": blocks}
        return replace(self, threads=self.threads // self.arguments["blocks"] * blocks, arguments=arguments)

    @property
    def parts(self) -> list[str]:
        """Names of its stages, in order."""
        return self.name.split(", ")

    @functools.cached_property
    def kernel(self) -> wp.Kernel:
        """The Warp kernel; for a pointwise stage it is declared on first use, after joining."""
        if isinstance(self.source, Pointwise):
            few = self.run == 1 and self.threads <= FEW_POINTS
            blocks = FEW_BLOCKS if few else RARE_BLOCKS if self.source.rare else 0
            return every_point(self.source, self.run, (self.block_dim, blocks) if blocks else None)
        return self.source.kernel

    def slice(self, begin: int, end: int) -> tuple[int, list[Any]]:
        """Number of threads and ordered kernel arguments for the threads or points begin to end - 1."""
        places = {"first": begin, "stop": end} if self.run else {"first": begin}
        values = {**self.arguments, **places}
        return -(-(end - begin) // (self.run or 1)), [values[a.label] for a in self.kernel.adj.args]


@dataclass(eq=False)
class Call:
    """An item that is not a Warp kernel, such as a Torch network on arrays shared with Warp.

    Attributes:
        threads: Rows that it works on.
        function: The function to call, on Warp's stream of the device.
        capture: (device, warm-up, body) -> replay: captures `body` in a CUDA graph that may contain this call.
        divided: Whether launches were split around it.
    """

    name: str
    owner: str
    threads: int
    function: Callable[[], None]
    capture: Callable[[wp.Device, Callable[[], None], Callable[[], None]], Callable[[], None]]
    touched: Touched
    side_stream: bool = False
    divided: bool = False
    every: int = 1
    since: int = 0

    @property
    def parts(self) -> list[str]:
        """Its name."""
        return [self.name]


Item: TypeAlias = Launch | Call


@dataclass(eq=False)
class Stage:
    """Launches that run in order.

    Attributes:
        name: Name, unique in a simulation.
        when: How often it runs, for `plan`.
        wraparound: For a repeated stage, a launch that replaces the last launch and the first of the next repetition,
            or None.
        leading: Number of launches at the beginning that then run before it.
    """

    name: str
    when: str
    device: wp.Device
    block_dim: int
    items: list[Item]
    wraparound: Launch | None = None
    leading: int = 0
    _every: int = field(default=1, init=False)
    # Number of items before those among which pointwise stages share launches; None if they do not.
    _shared_from: int | None = field(default=None, init=False)

    def __iter__(self) -> Iterator[Item]:
        return iter(self.items)

    @property
    def interval(self) -> int:
        """Number of repetitions after which all items have run at least once."""
        return math.lcm(*(item.every for item in self.items))

    def round(self, number: int) -> list[Item]:
        """The items that run in a repetition."""
        return [item for item in self.items if number % item.every == item.since]

    def writes(self, array: Array) -> bool:
        """Whether an item writes to an array, or to a part of it."""
        start, stop = int(array.ptr or 0), int(array.ptr or 0) + int(array.capacity)
        return any(start <= address < stop for item in self.items for address in item.touched.writes)

    @contextlib.contextmanager
    def every(self, repetitions: int) -> Iterator[None]:
        """Context in which added items run only in every n-th repetition, n = `repetitions`."""
        self._every = repetitions
        yield
        self._every = 1

    @contextlib.contextmanager
    def one_launch(self, and_next: bool = False) -> Iterator[None]:
        """Context in which pointwise stages that follow each other on the same points share a launch.

        `and_next`: on a GPU the last of them also shares one with the first of the next repetition, if it may. A CPU
        would gain nothing, and compile the kernels of both a second time.
        """
        outside, self._shared_from = self._shared_from, len(self.items)
        yield
        self._shared_from = outside
        if and_next and self.device.is_cuda:
            self.fuse_wraparound()

    @contextlib.contextmanager
    def leads(self) -> Iterator[None]:
        """Context for the launches that begin a stage and may run before the last one of the previous repetition.

        The last one then has its arguments `late`.
        """
        yield
        self.leading = len(self.items)

    def __len__(self) -> int:
        return len(self.items)

    def launch(
        self,
        owner: str,
        kernel: Kernel,
        threads: int,
        *,
        begin: int = 0,
        block_dim: int | None = None,
        side_stream: bool = False,
        span: Span | None = None,
        only_if: Array | None = None,
        grouped: bool = False,
        **arguments: Any,
    ) -> None:
        """Add a launch; `begin` is the value of `first` for the first thread."""
        expected = {a.label for a in kernel.kernel.adj.args} - {"first"}
        _check_names(f"launch of {kernel.name}", expected, set(arguments))
        self.items.append(Launch(
            kernel.name, owner, kernel, threads, arguments, touched(kernel.effects, arguments),
            block_dim or self.block_dim, begin, side_stream=side_stream, span=span, only_if=only_if,
            grouped=grouped, every=self._every,
        ))  # fmt: skip

    def pointwise(
        self,
        owner: str,
        part: Pointwise,
        threads: int,
        *,
        begin: int = 0,
        only_if: Array | None = None,
        grouped: bool = False,
        late: Mapping[str, Any] | None = None,
        **arguments: Any,
    ) -> None:
        """Add a pointwise stage; within `one_launch` it may share the launch of the one before.

        A stage with `only_if` does not where it can be skipped: on a CPU, and on a GPU if `grouped`. `late`: arguments
        that differ after the launches that lead the next repetition.
        """
        _check_names(f"pointwise stage {part.name}", set(part.arguments.vars), set(arguments))
        values = with_values(part.arguments(), arguments)
        run = 1 if self.device.is_cuda else POINT_RUN
        alone = grouped or (only_if is not None and not self.device.is_cuda)
        launch = Launch(
            part.name, owner, part, threads, {"arguments": values}, touched(part.effects, arguments), self.block_dim,
            begin, run, alone=alone, only_if=only_if, grouped=grouped, every=self._every,
)  # fmt: skip
        if late is not None:
            after = {"arguments": with_values(part.arguments(), {**arguments, **late})}
            launch.late = replace(launch, arguments=after, touched=touched(part.effects, after))
        shares = self._shared_from is not None and self._shared_from < len(self.items)
        if not shares or not (joined := _joined(last := self.items[-1], launch)):
            self.items.append(launch)
            return
        if not last.touched.may_share_launch(launch.touched):
            raise InputError(
                f"{owner}: {part.name} and {last.name} of {last.owner} would share a launch, and one gathers what the "
                "other writes: expected a kernel of its own (Stage.launch)"
            )
        self.items[-1] = joined

    def call(self, call: Call) -> None:
        """Add an item that is not a kernel."""
        self.items.append(replace(call, every=self._every))

    def fuse_wraparound(self) -> None:
        """Join the last launch with the first one of the next repetition after those that lead it, if they can be."""
        leaders, inner, last = self.items[: self.leading], self.items[self.leading :], self.items[-1]
        if len(inner) > 1 and all(item.every == 1 for item in (*leaders, inner[0], last)):
            if leaders and isinstance(last, Launch):
                last = last.late or last
            waits = any(last.touched.must_wait_for(item.touched) for item in leaders)
            if not waits and last.touched.may_share_launch(inner[0].touched):
                self.wraparound = _joined(last, inner[0])

    def launches(self) -> Iterator[Launch]:
        """Every kernel launch, including the wraparound."""
        yield from (item for item in self.items if isinstance(item, Launch))
        if self.wraparound is not None:
            yield self.wraparound


def compile_launches(launches: Iterable[Launch], device: wp.Device) -> None:
    """Compile or load every kernel now, several modules in parallel."""
    # A launch on a CPU has blocks of one thread; a module built for another block size would be built again. They begin
    # in the order of the launches: first those of the force, which take longest, last the small ones of the frames.
    modules = dict.fromkeys((launch.kernel.module, launch.block_dim if device.is_cuda else 1) for launch in launches)
    missing = [(module, block_dim) for module, block_dim in modules if not is_loaded(module, device, block_dim)]
    if not missing:
        return
    with compilers(device) as pool:
        for loaded in [pool.submit(load_module, module, device, block_dim) for module, block_dim in missing]:
            loaded.result()


def _check_names(what: str, expected: set[str], given: set[str]) -> None:
    """Compare the names of arguments. Raises TypeError if one is missing or unknown."""
    if expected != given:
        raise TypeError(f"{what}: missing {sorted(expected - given)}, unknown {sorted(given - expected)}")


def _joined(first: Item, second: Item) -> Launch | None:
    """Join two launches of pointwise stages on the same points into one; None if they are not."""
    if not (isinstance(first, Launch) and isinstance(second, Launch)):
        return None
    if not (isinstance(first.source, Pointwise) and isinstance(second.source, Pointwise)):
        return None
    if first.alone or second.alone or first.every != second.every:
        return None
    if (first.threads, first.begin) != (second.threads, second.begin):
        return None
    part = in_turn(first.source, second.source)
    both = part.arguments()
    both.a, both.b = first.arguments["arguments"], second.arguments["arguments"]
    late = _joined(first.late or first, second.late or second) if first.late or second.late else None
    owner = ", ".join(dict.fromkeys([*first.owner.split(", "), *second.owner.split(", ")]))
    return replace(
        first, name=part.name, owner=owner, source=part, arguments={"arguments": both},
        touched=first.touched | second.touched, late=late, pieces=(*(first.pieces or (first,)), second),
    )  # fmt: skip
