"""Point functions: parts of a step of which thread i touches nothing that another thread of the part writes.

Parts that follow each other on the same points share a launch, so that a step of a small sheet waits for fewer of
them and a large one passes its arrays through the processors less often.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp


@dataclass(frozen=True)
class PointFunction:
    """A part of a step.

    Attributes:
        function: Warp function (i, arguments).
        arguments: Its Warp struct.
        name: What it is called in the plan.
    """

    function: Any
    arguments: Any
    name: str


@functools.cache
def in_turn(first, second, module):
    """Point function of one after the other; its struct holds theirs as `a` and `b`."""
    First, Second = first.arguments, second.arguments
    begin, end = first.function, second.function

    @functools.partial(wp.struct, module=module)
    class Both:
        a: First
        b: Second

    @wp.func(module=module)
    def both(i: int, arguments: Both):
        begin(i, arguments.a)
        end(i, arguments.b)

    return PointFunction(both, Both, f"{first.name}, {second.name}")


@functools.cache
def every_point(part, module):
    """Kernel of a point function."""
    Arguments, function = part.arguments, part.function

    @wp.kernel(module=module, enable_backward=False)
    def every_point(arguments: Arguments, first: int):
        function(wp.tid() + first, arguments)

    return every_point
