"""Writing of files in a separate thread, one frame at a time."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from ..device.checks import OutputError
from ..interfaces.frame import Frame


class Background:
    """A writer that writes frames in a separate thread and returns immediately.

    At most one frame waits to be written, so memory stays bounded, and a killed run loses at most one frame. Errors in
    the thread are raised at the next call.

    Args:
        write_frame: Function that writes a frame.
    """

    def __init__(self, write_frame: Callable[[Frame], None]) -> None:
        self._write_frame = write_frame
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="warp_pd_writer")
        self._waiting: Future[None] | None = None

    def write(self, frame: Frame) -> None:
        """Accept one frame, after the previous one has been written."""
        self.save()
        self._waiting = self._thread.submit(self._write_frame, frame)

    def save(self) -> None:
        """Wait until everything so far is written."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            with as_output_error():
                waiting.result()

    def then(self, work: Callable[[], None]) -> None:
        """Make the thread call `work` after the last frame, unless that was not written."""
        before = self._waiting

        def follow() -> None:
            if before is not None:
                before.result()
            work()

        self._waiting = self._thread.submit(follow)

    def close(self) -> None:
        """Write what waits."""
        try:
            self.save()
        finally:
            self._thread.shutdown()


@contextlib.contextmanager
def as_output_error(path: Path | None = None) -> Iterator[None]:
    """Context that turns errors of files into a one-line OutputError; `path` names the file if the error does not.

    Raises:
        OutputError: for an error of the operating system, or of a library that could not write.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        name = "a result file" if path is None else repr(str(path))
        reason = getattr(error, "strerror", None) or "the disk may be full, or another program may hold the file"
        if isinstance(error, OSError) and error.errno and "errno = " in reason:
            # HDF5 puts a report of its own there.
            reason = os.strerror(error.errno)
        raise OutputError(f"{name} could not be written: {reason}") from error


def require_room(folder: Path, needed: int) -> None:
    """Check that the disk has room for `needed` bytes. Raises OutputError if it has not, or the folder is gone."""
    with as_output_error(folder):
        free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"out = {str(folder)!r}: {free / 1e6:.3g} MB are free, expected {needed / 1e6:.3g} MB for the next files; "
            "free some space, then continue with --resume, or start again if no frame was written"
        )
