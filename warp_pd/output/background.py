"""Writing of files in a separate thread, one frame at a time."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from ..device.checks import OutputError
from ..interfaces.frame import Frame


class Background:
    """A writer that passes frames to other writers in a separate thread and returns immediately.

    At most one frame waits to be written, so memory stays bounded, and a killed run loses at most one frame. Errors in
    the thread are raised at the next call.

    Args:
        writers: Writers that receive every frame, see `warp_pd.interfaces.Writer`.
        require_room: Function called before every write; raises OutputError if disk space is insufficient, because a
            failed write may leave a file, and the HDF5 library, in an invalid state.
    """

    def __init__(self, writers: Sequence[Any], require_room: Callable[[], None] = lambda: None) -> None:
        self.writers, self.require_room = list(writers), require_room
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="warp_pd_writer")
        self._waiting: Future[None] | None = None

    def write(self, frame: Frame) -> None:
        """Accept one frame, after the previous one has been written."""
        self._settle()
        self.require_room()
        self._waiting = self._thread.submit(self._write, frame)

    def save(self) -> None:
        """Flush everything written so far to disk."""
        self._settle()
        for writer in self.writers:
            writer.save()

    def save_then(self, work: Callable[[], None]) -> None:
        """Make the writer thread save all files and then call `work`, unless the last frame was not written."""
        before = self._waiting

        def save() -> None:
            if before is not None:
                before.result()
            for writer in self.writers:
                writer.save()
            work()

        self._waiting = self._thread.submit(save)

    def close(self) -> None:
        """Write the waiting frame and close all files, even if one of them failed."""
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
    """Context that turns file errors into a one-line OutputError.

    Raises:
        OutputError: for an error of the operating system, or of a library that could not write.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise OutputError(f"a result file could not be written: {str(error)[:200]}") from error
