"""Pointwise stages: parts of a step that write only to their own point.

Consecutive stages on the same points share a launch. A step of a small sheet then waits for fewer launches, and a step
of a large sheet reads and writes its arrays less often. A call works through a range of points: one point on a GPU,
many on a CPU, where each call copies the arguments.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import warp as wp

from .effects import Effects, warp_kernel

# Points of a block for which is noted whether a body is near: a block of threads of a large sheet.
NEAR_BLOCK = 256


@dataclass(frozen=True)
class Pointwise:
    """A pointwise stage.

    Attributes:
        function: Warp function (begin, end, arguments) that works on the points begin to end - 1.
        arguments: Its Warp struct.
        effects: The arrays that it accesses, by their names in the struct.
        rare: Whether it needs many registers, but only at few points.
        local: Whether it moves points where bodies are, and notes where for the end of the step.
    """

    function: wp.Function
    arguments: Any
    name: str
    effects: Effects
    rare: bool = False
    local: bool = False


def pointwise(
    arguments: Any,
    *,
    writes: tuple[str, ...],
    gathers: tuple[str, ...] = (),
    rare: bool = False,
    local: bool = False,
) -> Callable[[Callable[..., None]], Pointwise]:
    """Decorator that turns a function (begin, end, arguments) into a pointwise stage.

    `arguments` is their Warp struct; members `writes` are written at the thread's own point, `gathers` read at others.
    """

    def declare(function: Callable[..., None]) -> Pointwise:
        effects = Effects("point", frozenset(writes), frozenset(gathers))
        return Pointwise(wp.func(function), arguments, function.__name__, effects, rare, local)

    return declare


@functools.cache
def in_turn(first: Pointwise, second: Pointwise) -> Pointwise:
    """Pointwise stage that runs two stages in sequence; its struct has their structs as `a` and `b`.

    Its effects are empty; the caller, which joins the two stages, knows the arrays of both.
    """
    First, Second = first.arguments, second.arguments
    do_first, do_second = first.function, second.function

    @wp.struct
    class Both:
        a: First
        b: Second

    @wp.func
    def both(begin: int, end: int, arguments: Both):
        do_first(begin, end, arguments.a)
        do_second(begin, end, arguments.b)

    rare = first.rare or second.rare
    return Pointwise(both, Both, f"{first.name}, {second.name}", Effects("point", frozenset()), rare)


@functools.cache
def every_point(stage: Pointwise, run: int, launch_bounds: tuple[int, int] | None = None) -> wp.Kernel:
    """Warp kernel that runs a pointwise stage on the points first to stop - 1, `run` points per thread.

    Without launch bounds the compiler uses few registers, so that many threads fit a multiprocessor, but each thread
    then has few loads in flight. Bounds (maximum threads per block, minimum blocks per multiprocessor) allow more.
    """
    Arguments, function = stage.arguments, stage.function

    def every_point(arguments: Arguments, first: int, stop: int):
        begin = first + wp.tid() * wp.static(run)
        if wp.static(run == 1):
            function(begin, begin + 1, arguments)
        else:
            function(begin, wp.min(begin + wp.static(run), stop), arguments)

    return warp_kernel(every_point, launch_bounds=launch_bounds)
