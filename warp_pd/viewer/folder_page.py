"""The browser page of a run, made from the folder of its results."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..device.checks import InputError
from ..output.file_writers import FRAMES
from ..run.folder import PAGE, read_history, run_summary, write_atomically

if TYPE_CHECKING:
    from .view import Limits, PageFrames

# A run writes its page itself for sheets of at most so many points.
LARGE = 200_000


def page(
    folder: str | Path,
    limits: Limits | None = None,
    shared: str | None = None,
    frames: Callable[[], PageFrames] | None = None,
) -> str:
    """The page of a run as one self-contained HTML text; arguments as for `warp_pd.viewer.view`.

    `frames` returns what the page holds of the frames, if that was begun earlier. A killed run has neither summary nor
    history; the page then shows only its frames. Raises InputError if the folder has no frames, the frames are damaged,
    or they lack a field.
    """
    from .view import page as page_of
    from .view import page_frames

    folder = Path(folder)
    if not folder.exists():
        raise InputError(f"folder = {str(folder)!r}: the folder does not exist; expected the folder of a run")
    if not folder.is_dir():
        raise InputError(f"folder = {str(folder)!r}: it is a file; expected the folder of a run")
    path = folder / FRAMES
    if not path.is_file():
        raise InputError(f"folder = {str(folder)!r}: it has no {path.name}; expected the folder of a run with frames")
    history = read_history(folder / "history.csv") if (folder / "history.csv").is_file() else []
    summary: dict[str, Any] = run_summary(folder) or {}
    return page_of(path, summary, history, page_frames(path, limits) if frames is None else frames(), shared)


def write_page(
    folder: str | Path,
    out: str | Path | None = None,
    points: int | None = None,
    frames: int | None = None,
    read: Callable[[], PageFrames] | None = None,
) -> Path:
    """Write the page of a run atomically, by default as view.html in its folder, and return the file.

    `points` and `frames` are the largest numbers shown; by default 40 000 points and as many frames as keep the page
    small. `read` returns what the page holds of the frames, if that was begun earlier. Raises InputError as `page`, or
    if the file cannot be written.
    """
    from .view import POINTS, Limits

    path = Path(folder) / PAGE if out is None else Path(out)
    text = page(folder, Limits(POINTS if points is None else points, frames), frames=read)
    if path.is_dir():
        raise InputError(f"out = {str(path)!r}: it is a folder; expected a file")
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError(f"out = {str(path)!r}: expected a file in a folder")
    write_atomically(path, text)
    return path
