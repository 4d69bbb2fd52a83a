"""Work in processes beside a run: its files, its pictures and its page.

Python runs one thread at a time. A thread that writes files makes the steps wait, which need Python between launches:
on two cores for longer than the writing takes. Pictures and page would come one after the other.

The processes load what they need while the run is set up and steps. Within `processes_beside` a picture function that
is marked `drawn_beside` returns at once, and `wait_for_pictures` waits for all pictures. Elsewhere, and where
Matplotlib is loaded already and may have settings of the user's, this process draws them at once. The files are the
same.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import io
import os
import pickle
import queue
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import ContextVar
from typing import Any, ParamSpec, TypeVar

from ..device.checks import InputError
from ..device.cores import available_cores
from ..geometry.picture_files import current, drawing, new_figure
from ..interfaces.frame import Frame
from ..interfaces.output import Writer

# Points of a sheet whose pictures are worth processes, and most processes.
MANY_POINTS, MOST_PROCESSES = 5000, 4
# As in the command.
COLLECT_AFTER = 10_000
# Of Linux: the signal that a process gets when its parent dies.
PR_SET_PDEATHSIG = 1

T = TypeVar("T")
P = ParamSpec("P")


class Processes:
    """Processes that call functions, each one at a time, and one that writes files.

    Args:
        number: Number of processes that call functions.

    Attributes:
        pictures: For each picture that is being drawn, a function that waits for it.
        files: Channel to the process that writes files.
    """

    def __init__(self, number: int) -> None:
        self.pictures: list[Callable[[], None]] = []
        self._first, (self.files, *self._channels) = _started(1 + number)
        self._threads = ThreadPoolExecutor(number, thread_name_prefix="warp_pd_beside")
        self._idle: queue.SimpleQueue[Channel] = queue.SimpleQueue()
        for channel in self._channels:
            self._idle.put(channel)

    def begin(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        """Begin a call in the next idle process; the function returned waits for its value, or raises its error."""
        here = functools.partial(work, *args, **kwargs)
        try:
            job = pickle.dumps((current(), work, args, kwargs))
        except (pickle.PicklingError, AttributeError, TypeError):
            # An argument that exists in this process only.
            return here
        return functools.partial(_answer, self._threads.submit(self._ask, job), here)

    def _ask(self, job: bytes) -> Any:
        channel = self._idle.get()
        try:
            channel.send(job)
            return channel.receive()
        finally:
            self._idle.put(channel)

    def close(self) -> None:
        """End the processes."""
        self._threads.shutdown(cancel_futures=True)
        for channel in (self.files, *self._channels):
            channel.close()
        self._first.wait()


class FilesBeside:
    """Writers in another process as one, see `interfaces.Writer`.

    Args:
        channel: Channel to that process.
        made: A call that makes the writers, as `pickle` wrote it.

    Raises:
        InputError: as the call that makes the writers.
    """

    def __init__(self, channel: Channel, made: bytes) -> None:
        self._channel = channel
        self._ask(made)

    def write(self, frame: Frame) -> None:
        """Write one frame."""
        self._ask(pickle.dumps(("write", (frame,)), pickle.HIGHEST_PROTOCOL))

    def save(self) -> None:
        """Flush everything written so far to disk."""
        self._ask(pickle.dumps(("save", ())))

    def close(self) -> None:
        """Close all files."""
        self._ask(pickle.dumps(("close", ())))

    def _ask(self, message: bytes) -> None:
        try:
            self._channel.send(message)
            error = self._channel.receive()
        except (OSError, EOFError, pickle.UnpicklingError):
            raise OSError("the process that writes it is gone") from None
        if error is not None:
            raise error


class Channel:
    """One end of a connection between two processes.

    Args:
        end: Its socket.
    """

    def __init__(self, end: socket.socket) -> None:
        self.end, self._stream = end, end.makefile("rwb")

    def send(self, value: Any) -> None:
        """Send a value that can be pickled."""
        pickle.dump(value, self._stream)
        self._stream.flush()

    def receive(self) -> Any:
        """Wait for a value.

        Raises:
            EOFError: if the other process is gone.
        """
        return pickle.load(self._stream)

    def close(self) -> None:
        """Close this end."""
        with contextlib.suppress(OSError):
            self._stream.close()
        self.end.close()


def _started(number: int) -> tuple[subprocess.Popen[bytes], list[Channel]]:
    """Start a process that divides into `number`, and a channel to each; the first writes files."""
    pairs = [socket.socketpair() for _ in range(number)]
    theirs = [other.fileno() for _, other in pairs]
    # Modules are found where this process finds them. Threads of OpenBLAS would not survive the division. A group of
    # its own spares the processes the Ctrl-C of a terminal.
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    first = subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import serve; serve({theirs}, {os.getpid()})"],
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, pass_fds=theirs, process_group=0,
    )  # fmt: skip
    for _, other in pairs:
        other.close()
    return first, [Channel(mine) for mine, _ in pairs]


def _answer(future: Future[Any], here: Callable[[], T]) -> T:
    """The value of a call in another process, or its error; of a process that is gone, of the same call in this one."""
    try:
        error, value = future.result()
    except (OSError, EOFError, pickle.UnpicklingError):
        return here()
    if isinstance(error, UnreadableError):
        return here()
    if error is not None:
        raise error
    return value  # type: ignore[no-any-return]


class UnreadableError(Exception):
    """A process cannot load its work, for example the class of an argument from a scene's file."""


def serve(ends: Sequence[int], parent: int) -> None:
    """Divide into a process for each end of a channel: one that writes files, and others that draw.

    Args:
        ends: Descriptors of their sockets, that of the process that writes files first.
        parent: The process that waits for this one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with(parent)
    gc.set_threshold(COLLECT_AFTER)
    if _forked():
        _write_files(_only(ends[0], ends))
        os._exit(0)
    _load_matplotlib()
    mine = next((end for end in ends[2:] if _forked()), ends[1])
    _call(_only(mine, ends))
    for _ in ends[1:] if mine == ends[1] else ():
        os.wait()
    # At once: taking the interpreter down would let the run wait.
    os._exit(0)


def _forked() -> bool:
    """Divide this process; whether this is the new one."""
    first = os.getpid()
    if os.fork():
        return False
    _end_with(first)
    return True


def _end_with(parent: int) -> None:
    """Let the system kill this process when its parent dies: it must not write into the folder of a later run."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL))
    if os.getppid() != parent:
        os._exit(1)


def _only(mine: int, ends: Sequence[int]) -> Channel:
    """The channel at one end, with the other ends closed."""
    for end in ends:
        if end != mine:
            os.close(end)
    return Channel(socket.socket(fileno=mine))


def _load_matplotlib() -> None:
    """Load Matplotlib with its fonts, and what draws, before there is work."""
    from . import default_pictures, view  # noqa: F401 - what calls import

    figure = new_figure(1.0, 1.0)
    figure.subplots().set_title("1")
    figure.savefig(io.BytesIO(), format="png")


def _call(channel: Channel) -> None:
    """Make the calls that come through a channel until it is closed."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            channel.send(_done(channel.receive()))


def _write_files(channel: Channel) -> None:
    """Make writers, and call their methods, as the channel asks; the answer is the error, or None."""
    from . import body_frames, usd, vtkhdf  # noqa: F401 - what writers import

    writers: list[Writer] = []
    with contextlib.suppress(EOFError, OSError):
        while True:
            method, arguments = pickle.loads(channel.receive())
            error = None
            try:
                if callable(method):
                    writers = method(*arguments)
                else:
                    for writer in writers:
                        getattr(writer, method)(*arguments)
            except Exception as failed:
                # Raised where the frame comes from.
                error = failed
            channel.send(error)


def _done(job: bytes) -> tuple[Exception | None, Any]:
    try:
        common, work, args, kwargs = pickle.loads(job)
    except (AttributeError, ImportError) as error:
        return UnreadableError(str(error)), None
    try:
        with drawing(common):
            return None, work(*args, **kwargs)
    except Exception as error:
        # Raised where the work was asked for.
        return error, None


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


def writers_beside(make: Callable[..., list[Writer]], *args: Any) -> list[Writer]:
    """Writers that a function makes, in another process, if there is one.

    Raises:
        InputError: as the function.
    """
    processes = _processes.get()
    if processes is None:
        return make(*args)
    try:
        made = pickle.dumps((make, args))
    except (pickle.PicklingError, AttributeError, TypeError):
        # An argument that exists in this process only.
        return make(*args)
    return [FilesBeside(processes.files, made)]


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
