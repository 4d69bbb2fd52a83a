"""Files are written beside the computation: one frame at a time, in a thread of its own."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from ..device.checks import OutputError
from ..interfaces.frame import Frame


class Background:
    """A writer that hands frames to other writers and returns at once.

    At most one frame waits: the next one is taken when it has been written, so memory stays bounded, and a killed run
    loses one frame at most. What goes wrong in the thread is raised at the next call.

    Args:
        writers: Take every frame, in turn; see `warp_pd.interfaces.Writer`.
        require_room: Called before anything is written; raises OutputError where there is no room for it. A file whose
            writing failed half-way may be beyond repair, and HDF5 with it.
    """

    def __init__(self, writers: Sequence[Any], require_room: Callable[[], None] = lambda: None) -> None:
        self.writers, self.require_room = list(writers), require_room
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="warp_pd_writer")
        self._waiting: Future[None] | None = None

    def write(self, frame: Frame) -> None:
        """Take one frame, once the one before has been written."""
        self._settle()
        self.require_room()
        self._waiting = self._thread.submit(self._write, frame)

    def save(self) -> None:
        """Bring everything written so far to the disk."""
        self._settle()
        for writer in self.writers:
            writer.save()

    def save_then(self, work: Callable[[], None]) -> None:
        """Let the writer thread save all files, then call `work`; neither if the last frame was not written."""
        before = self._waiting

        def save() -> None:
            if before is not None:
                before.result()
            for writer in self.writers:
                writer.save()
            work()

        self._waiting = self._thread.submit(save)

    def close(self) -> None:
        """Write what waits, and close all files, even if one of them failed."""
        try:
            self._settle()
        finally:
            self._thread.shutdown()
            with _as_output_error():
                for writer in self.writers:
                    writer.close()

    def _write(self, frame: Frame) -> None:
        for writer in self.writers:
            writer.write(frame)

    def _settle(self) -> None:
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            with _as_output_error():
                waiting.result()


@contextlib.contextmanager
def _as_output_error() -> Iterator[None]:
    """Context that turns errors of the files into one line.

    Raises:
        OutputError: for an error of the operating system, or of a library that could not write.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise OutputError(f"a result file could not be written: {str(error)[:200]}") from error
