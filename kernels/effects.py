"""Kernels and the arrays they access, which decide which launches can be merged, can run in parallel, or need a halo.

Every kernel in this package takes `first`, the index of its first thread. Arrays before `first` in the argument list
are read; arrays after it are written (and may be read). Arrays that a thread reads at points other than its own are
declared as `gathers`. tests/core/kernels/test_effects.py compares the declarations with what the kernels do.

Pointwise stages write only to their own point. Consecutive ones on the same points share a launch: a step of a small
sheet then waits for fewer launches, and a step of a large sheet reads and writes its arrays less often. A call works
through a range of points: one on a GPU, many on a CPU, where each call copies the arguments.
"""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import warp as wp

# What a thread works on.
PER = ("point", "block", "list", "face", "body", "once")
# Warp's header, compiled once for a CPU, does without bfloat16, which no kernel uses. Clang instantiates the header's
# templates then, not in every module. The code is the same.
_GIVEN = "-march=native" if wp.config.cpu_compiler_flags is None else wp.config.cpu_compiler_flags
CPU_FLAGS = f"{_GIVEN} -fpch-instantiate-templates -DWP_NO_BFLOAT16"


@dataclass(frozen=True)
class Effects:
    """Arrays that a kernel accesses, by argument name; constant tables need not be listed.

    Attributes:
        per: What a thread works on: its own "point", a "block" of points, an entry of a "list" of points, a "face", a
            rigid "body", or everything ("once"). All but "point" count as gathering everything they read. A "list"
            kernel with explicit `gathers` reads all other arrays only at the listed points.
        writes: Arrays that it writes; a "point" kernel writes only at its own point.
        gathers: Arrays that it reads at points other than its own.
    """

    per: str
    writes: frozenset[str]
    gathers: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.per not in PER:
            raise ValueError(f"per = {self.per!r}: expected one of {PER}")


@dataclass(frozen=True)
class Kernel:
    """A Warp kernel with the arrays that it accesses."""

    kernel: wp.Kernel
    effects: Effects

    @property
    def name(self) -> str:
        """Name of the function."""
        return str(self.kernel.func.__name__)


def warp_kernel(
    function: Callable[..., None],
    *,
    launch_bounds: tuple[int, int] | None = None,
    fast_math: bool = False,
    module: str = "unique",
) -> wp.Kernel:
    """Make a Warp kernel, by default in a separate module named by a hash of its content.

    All scenes that use the same kernel share its compiled code, and a change recompiles only the kernels it affects.
    """
    options: dict[str, Any] = {"fast_math": fast_math, "cpu_compiler_flags": CPU_FLAGS}
    unique = module == "unique"
    if not unique:
        wp.get_module(module).options.update(options)
    made: wp.Kernel = wp.kernel(
        function,
        module=module,
        module_options=options if unique else None,
        enable_backward=False,
        launch_bounds=launch_bounds,
    )
    return made


def unstaged(function: Callable[..., None]) -> wp.Kernel:
    """Decorator for a Warp kernel outside the step, such as one that fills tables; it has no declared effects."""
    return warp_kernel(function)


def kernel(
    *,
    gathers: tuple[str, ...] = (),
    writes: tuple[str, ...] = (),
    per: str = "point",
    launch_bounds: tuple[int, int] | None = None,
    name: str | None = None,
    fast_math: bool = False,
    module: str = "unique",
) -> Callable[[Callable[..., None]], Kernel]:
    """Decorator that makes a kernel of the step, see `warp_kernel`.

    Args:
        gathers: Arguments that are read at points other than the thread's own.
        writes: Members of structs that are written, such as "a.velocity", besides the arguments after `first`.
        per: What a thread works on, see `Effects`.
        launch_bounds: Maximum threads per block and minimum blocks per multiprocessor, on CUDA.
        name: Name of the kernel; defaults to the name of the function.
        fast_math: Whether a GPU may use approximate divisions, roots and exponentials. float32 divisions are then
            accurate to two units in the last place; the error against float64 does not grow.
        module: Name of a module of small kernels that are always used together, which compile faster in one module. It
            tells their options.
    """

    def declare(function: Callable[..., None]) -> Kernel:
        if name is not None:
            function.__name__ = function.__qualname__ = name
        names = list(inspect.signature(function).parameters)
        if "first" not in names:
            raise ValueError(
                f"kernel {function.__name__}: expected an argument `first` between what it reads and writes"
            )
        written = frozenset([*names[names.index("first") + 1 :], *writes])
        made = warp_kernel(function, launch_bounds=launch_bounds, fast_math=fast_math, module=module)
        return Kernel(made, Effects(per, written, frozenset(gathers)))

    return declare


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
