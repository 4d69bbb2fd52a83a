"""Work in processes beside a run: its pictures, its page and the files made from its frames.

Python runs one thread at a time: in the process of the run they would come one after the other.

The processes load what they need while the run is set up and steps. Within `processes_beside` a picture function that
is marked `drawn_beside` returns at once, and `wait_for_pictures` waits for all pictures. Elsewhere, and where
Matplotlib is loaded already and may have settings of the user's, this process draws them at once. The files are the
same.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import multiprocessing
import multiprocessing.forkserver
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextvars import ContextVar
from typing import Any, ParamSpec, TypeVar

from ..device.checks import InputError
from ..device.cores import available_cores
from .pictures import current, drawing

# Points of a sheet whose pictures are worth processes, and most processes.
MANY_POINTS, MOST_PROCESSES = 5000, 4
# What draws, loaded once by the process from which the others are divided.
DRAWING = ["matplotlib.backends.backend_agg", *(f"{__package__}.{name}" for name in ("default_pictures", "view"))]

T = TypeVar("T")
P = ParamSpec("P")


class Processes:
    """Processes that call functions, each one at a time.

    Args:
        number: Number of processes.

    Attributes:
        pictures: For each picture that is being drawn, a function that waits for it.
    """

    def __init__(self, number: int) -> None:
        self.pictures: list[Callable[[], None]] = []
        divided = multiprocessing.get_context("forkserver")
        divided.set_forkserver_preload(DRAWING)
        self._pool = ProcessPoolExecutor(number, mp_context=divided, initializer=_begin, initargs=gc.get_threshold())
        with _one_thread_of_blas():
            multiprocessing.forkserver.ensure_running()
        # In a thread: a process is divided once what draws is loaded.
        self._starting = ThreadPoolExecutor(1)
        self._starting.submit(lambda: [self._pool.submit(os.getpid) for _ in range(number)])

    def begin(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        """Begin a call in the next idle process; the function returned waits for its value, or raises its error."""
        here = functools.partial(work, *args, **kwargs)
        try:
            job = pickle.dumps((current(), work, args, kwargs))
            return functools.partial(_answer, self._pool.submit(_call, job), here)
        except (pickle.PicklingError, AttributeError, TypeError, BrokenProcessPool):
            # An argument that exists in this process only, or no process.
            return here

    def close(self) -> None:
        """End the processes."""
        self._starting.shutdown()
        self._pool.shutdown(cancel_futures=True)


@contextlib.contextmanager
def _one_thread_of_blas() -> Iterator[None]:
    """Context in which processes start with one thread of OpenBLAS: threads do not survive a division."""
    name = "OPENBLAS_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        del os.environ[name]
        if before is not None:
            os.environ[name] = before


# In the other processes --------------------------------------------------------------------------------


def _begin(*collect_after: int) -> None:
    """Leave the Ctrl-C of a terminal to the run, and end with it: its folder may be that of a later run.

    Python looks for garbage as seldom as in the run.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(*collect_after)
    threading.Thread(target=_end_with_the_run, daemon=True).start()


def _end_with_the_run() -> None:
    run = multiprocessing.parent_process()
    assert run is not None
    run.join()
    os._exit(1)


class UnreadableError(Exception):
    """A process cannot load its work, for example the class of an argument from a scene's file."""


def _call(job: bytes) -> Any:
    try:
        common, work, args, kwargs = pickle.loads(job)
    except (AttributeError, ImportError) as error:
        raise UnreadableError(str(error)) from None
    with drawing(common):
        return work(*args, **kwargs)


# In the process of the run -----------------------------------------------------------------------------


def _answer(future: Future[T], here: Callable[[], T]) -> T:
    """The value of a call in another process, or its error; of a process that is gone, of the same call in this one."""
    try:
        return future.result()
    except (BrokenProcessPool, UnreadableError):
        return here()


def number_beside(points: int) -> int:
    """Number of processes for the pictures of a sheet: none for a small one, whose pictures take less than a start."""
    # Windows cannot divide a process, and libraries of macOS do not survive it.
    wanted = points >= MANY_POINTS and sys.platform == "linux" and bool(sys.executable)
    return min(available_cores(), MOST_PROCESSES) if wanted and available_cores() > 1 else 0


_processes: ContextVar[Processes | None] = ContextVar("_processes", default=None)


@contextlib.contextmanager
def processes_beside(number: int) -> Iterator[None]:
    """Context with so many processes for pictures and pages; with 0 everything happens in this process."""
    if number == 0:
        yield
        return
    with contextlib.closing(Processes(number)) as processes:
        token = _processes.set(processes)
        try:
            yield
        finally:
            _processes.reset(token)


def begun(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
    """Begin a call in another process, if there is one; the function returned waits for its value."""
    processes = _processes.get()
    if processes is None:
        return functools.partial(work, *args, **kwargs)
    return processes.begin(work, *args, **kwargs)


def drawn_beside(draw: Callable[P, None]) -> Callable[P, None]:
    """Mark a function of a module that draws a picture: within `processes_beside` another process calls it."""

    @functools.wraps(draw)
    def call(*args: P.args, **kwargs: P.kwargs) -> None:
        processes = _processes.get()
        if processes is None or "matplotlib" in sys.modules:
            draw(*args, **kwargs)
        else:
            processes.pictures.append(processes.begin(call, *args, **kwargs))

    return call


def wait_for_pictures() -> None:
    """Wait for the pictures that other processes draw.

    Raises:
        InputError: the first error, or another one that a picture function raised.
    """
    processes = _processes.get()
    if processes is None:
        return
    pictures, processes.pictures = processes.pictures, []
    errors: list[Exception] = []
    for finished in pictures:
        try:
            finished()
        except InputError as error:
            errors.append(error)
    if errors:
        raise errors[0]
