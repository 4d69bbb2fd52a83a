"""End a run by Ctrl-C, SIGTERM or SIGHUP: at its next frame, soon in a long frame, and wherever it is in the end."""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, Protocol

# Seconds after the signal: when a frame is left unfinished; when the process ends, in whatever it is.
PATIENCE, LAST = 0.8, 1.6
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Deadline:
    """Ends this process LAST seconds after a signal, also within a call that Python cannot interrupt.

    A factorisation or a compilation may take longer, and Python handles signals only after it.

    Attributes:
        last_words: Called before the process ends; or None.
        number: The signal that ended the run; Ctrl-C if none did.
    """

    def __init__(self) -> None:
        self.last_words: Callable[[], None] | None = None
        self.number: int = signal.SIGINT

    @property
    def exit_code(self) -> int:
        """Exit code of an interrupted run: 128 and the number of the signal."""
        return 128 + self.number

    @contextlib.contextmanager
    def within(self, signals: tuple[int, ...]) -> Iterator[None]:
        """Context in which the given signals end the process, unless an earlier context or an event loop listens."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        heard, written = socket.socketpair()
        written.setblocking(False)
        earlier = signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
        if earlier != -1:
            signal.set_wakeup_fd(earlier)
        over = threading.Event()
        listener = threading.Thread(target=self._listen, args=(heard, signals, over), daemon=True)
        listener.start()
        try:
            yield
        finally:
            over.set()
            if earlier == -1:
                signal.set_wakeup_fd(-1)
            written.close()
            listener.join()
            heard.close()

    def _listen(self, heard: socket.socket, signals: tuple[int, ...], over: threading.Event) -> None:
        while number := heard.recv(1):
            if number[0] in signals:
                self.number = number[0]
                if not over.wait(LAST):
                    self._end()
                return

    def _end(self) -> None:
        resumable = self.last_words is not None
        try:
            if self.last_words is not None:
                self.last_words()
        finally:
            # The terminal may be what was lost.
            with contextlib.suppress(OSError, ValueError, AttributeError):
                print("warp-pd: interrupted" + (": continue with --resume" if resumable else ""), file=sys.stderr)
                sys.stderr.flush()
                sys.stdout.flush()
            os._exit(self.exit_code)


# The process has one: a run tells it how to write its summary.
deadline = Deadline()


class Stoppable(Protocol):
    """A run that can be asked to stop.

    Attributes:
        stop_asked: Whether it was.
        finishing: Whether its last frame is being recorded.
        reporter: What reports its progress, or None.
    """

    stop_asked: bool
    finishing: bool
    reporter: Any

    @property
    def alone(self) -> bool:
        """Whether no other process shares the sheet."""
        ...

    def ask_to_stop(self) -> None:
        """Let it end at its next frame, or soon."""
        ...


@contextlib.contextmanager
def stopping_at_frames(run: Stoppable, last_words: Callable[[], None]) -> Iterator[None]:
    """Context in which Ctrl-C or SIGTERM ends the run at the next frame, or soon; a second one ends it immediately.

    `last_words` writes the summary of a run that is still in a call that Python cannot interrupt.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    alone = run.alone
    timer = threading.Timer(PATIENCE, _thread.interrupt_main, (signal.SIGTERM,))
    timer.daemon = True

    def ask(number: int, stack: Any) -> None:
        # Several processes get one signal twice, from the terminal and from torchrun, and stop together.
        if run.stop_asked and alone:
            # A frame that is being recorded is the last one, and is not left unfinished.
            if run.finishing:
                return
            raise KeyboardInterrupt
        if not run.stop_asked and alone:
            timer.start()
        run.ask_to_stop()
        deadline.number = number
        # By SIGTERM torchrun ends those that are left when one is killed; the launcher says why.
        if run.reporter is not None and number == signal.SIGINT:
            with contextlib.suppress(OSError, ValueError, AttributeError):
                os.write(sys.stderr.fileno(), b"\nstopping at the next frame, or soon; once more stops at once\n")

    # `nohup` ignores a lost terminal.
    ignored = [s for s in SIGNALS if s != signal.SIGINT and signal.getsignal(s) is signal.SIG_IGN]
    earlier = {s: signal.signal(s, ask) for s in SIGNALS if s not in ignored}
    deadline.number, deadline.last_words = signal.SIGINT, last_words if alone else None
    try:
        with deadline.within(tuple(s for s in SIGNALS if s != signal.SIGINT)) if alone else contextlib.nullcontext():
            yield
    finally:
        timer.cancel()
        deadline.last_words = None
        for number, handler in earlier.items():
            signal.signal(number, handler)
