"""Point functions: parts of a step that touch of what they write nothing but their own point.

Parts that follow each other on the same points share a launch, so that a step of a small sheet waits for fewer of
them and a large one passes its arrays through the processors less often. A part works through a run of points: one
on a GPU; many on a CPU, where a call copies its arguments.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp


@dataclass(frozen=True)
class PointFunction:
    """A part of a step.

    Attributes:
        function: Warp function (begin, end, arguments) of the points begin to end - 1.
        arguments: Its Warp struct.
        name: What it is called in the plan.
        looks_around: Whether it reads the displacement of other points, so that none may move in the same launch.
    """

    function: Any
    arguments: Any
    name: str
    looks_around: bool = False


@functools.cache
def in_turn(first, second, module):
    """Point function of one after the other; its struct holds theirs as `a` and `b`."""
    First, Second = first.arguments, second.arguments
    do_first, do_second = first.function, second.function

    @functools.partial(wp.struct, module=module)
    class Both:
        a: First
        b: Second

    @wp.func(module=module)
    def both(begin: int, end: int, arguments: Both):
        do_first(begin, end, arguments.a)
        do_second(begin, end, arguments.b)

    return PointFunction(both, Both, f"{first.name}, {second.name}", first.looks_around or second.looks_around)


@functools.cache
def every_point(part, run, module):
    """Kernel of a point function for the points first to stop - 1; a thread takes `run` of them."""
    Arguments, function = part.arguments, part.function

    @wp.kernel(module=module, enable_backward=False)
    def every_point(arguments: Arguments, first: int, stop: int):
        begin = first + wp.tid() * wp.static(run)
        if wp.static(run == 1):
            function(begin, begin + 1, arguments)
        else:
            function(begin, wp.min(begin + wp.static(run), stop), arguments)

    return every_point
