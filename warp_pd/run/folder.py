"""The folder of a run: checks before writing, results of earlier runs, history and summary."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import json
import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..device.checks import InputError, one_of, show
from ..output.background import as_output_error
from ..output.info import read_summary

if TYPE_CHECKING:
    from ..interfaces import History

FRAMES, BODIES, ANIMATION, PAGE = "frames.vtkhdf", "bodies.vtkhdf", "animation.usd", "view.html"
FILM = "film.gif"
FINE = "fine_history.csv"
RESTART = "restart.npz"
FIT = "fit.json"
# The first columns of a history.
HISTORY_BEGINS = b"time,step"
RESULTS = ("summary.json", "history.csv", FINE, RESTART, FRAMES, BODIES, ANIMATION, PAGE, FILM, FIT)
# Those of them that are made of the others when a run ends, or later.
MADE_AT_END = ("summary.json", ANIMATION, PAGE, FILM)


# The folder that `claimed_folder` holds for a run.
_claimed: ContextVar[Path | None] = ContextVar("_claimed", default=None)


class BusyError(InputError):
    """Another run writes into the folder."""


# Formats of pictures, and of films.
FORMATS = ("png", "pdf", "svg")
FILMS = ("gif", "webp", "mp4", "webm")


def picture_formats(pictures: bool | str) -> tuple[str, ...]:
    """Parse the formats of the pictures; empty for none."""
    if isinstance(pictures, bool):
        return ("png",) if pictures else ()
    names = [name.strip().lower().removeprefix(".") for name in str(pictures).split(",")]
    return tuple(dict.fromkeys(one_of("pictures", name, FORMATS) for name in names))


def pictures_in(folder: Path) -> list[Path]:
    """Pictures in a folder, in all formats."""
    return [path for path in _to_look_at(folder) if path.suffix[1:].lower() in FORMATS]


def _to_look_at(folder: Path) -> list[Path]:
    """Pictures, films and pages in a folder."""
    suffixes = (*FORMATS, *FILMS, "html")
    found = (path for path in folder.iterdir() if path.suffix[1:].lower() in suffixes)
    return sorted(path for path in found if not path.name.startswith("."))


def writable_folder(out: str | Path | None, resume: bool, overwrite: bool = False) -> Path | None:
    """Check and create the folder of the results; None if nothing is to be written."""
    if resume and overwrite:
        raise InputError("resume = True, overwrite = True: expected at most one of them")
    if out is not None and not isinstance(out, str | Path):
        raise InputError(f"out = {show(out)}: expected a folder or None")
    if out is None:
        if resume:
            raise InputError("resume = True: expected `out` to be a folder with a restart file")
        return None
    if not str(out):
        raise InputError("out = '': expected a writable folder")
    folder = Path(out)
    for path, kind in ((folder, "folder"), (folder / RESTART, "file")) if resume else ():
        if not path.exists():
            raise InputError(
                f"resume from {str(path)!r}: the {kind} does not exist; expected the folder of an earlier run"
            )
    with _writing_in(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


@contextlib.contextmanager
def _writing_in(folder: Path) -> Iterator[None]:
    """Context in which the first files are made in a folder. Raises InputError if it cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"out = {str(folder)!r}: expected a writable folder ({error.strerror})") from None


def require_free(folder: Path, overwrite: bool) -> None:
    """Check that a new run may write into a folder: it has no results, or those of a run that it may replace."""
    left = results_in(folder)
    if left and not overwrite:
        raise InputError(
            f"out = {str(folder)!r}: it contains {left[0]}; expected a folder without results, overwrite (--overwrite) "
            "or resume (--resume)"
        )
    for name in left:
        if not _is_of_a_run(folder / name):
            raise InputError(f"out = {str(folder)!r}: its {name} does not belong to a run; expected another folder")


def _is_of_a_run(path: Path) -> bool:
    """Whether a result file is one of ours, as far as its name leaves that open."""
    if path.name == "summary.json":
        return run_summary(path.parent) is not None
    if path.name in ("history.csv", FINE):
        with path.open("rb") as stream:
            return stream.read(len(HISTORY_BEGINS)) == HISTORY_BEGINS
    return path.name != FIT


def results_in(folder: Path) -> list[str]:
    """Names of the result files of a run in a folder."""
    return [name for name in RESULTS if (folder / name).exists()]


def run_summary(folder: Path) -> dict[str, Any] | None:
    """The summary of the run in a folder, or None if there is none."""
    return read_summary(folder / "summary.json")


def _numbered(wanted: Path) -> Iterator[Path]:
    """Yield the folder itself, then wanted-2, wanted-3, ..."""
    yield wanted
    for number in itertools.count(2):
        yield wanted.with_name(f"{wanted.name}-{number}")


def remove_if_empty(folder: Path) -> None:
    """Remove the folder of a refused run if it is empty."""
    with contextlib.suppress(OSError):
        folder.rmdir()


@contextlib.contextmanager
def claimed_folder(wanted: Path) -> Iterator[Path]:
    """Context with the first of wanted, wanted-2, ... without results, and its lock: one run takes it, and no other.

    The folder is removed at the end if it is empty.
    """
    for folder in _numbered(wanted):
        if results_in(folder):
            continue
        with contextlib.ExitStack() as stack:
            with _writing_in(folder):
                folder.mkdir(parents=True, exist_ok=True)
            stack.callback(remove_if_empty, folder)
            try:
                stack.enter_context(sole_use(folder))
            except BusyError:
                continue
            # A run may have ended here meanwhile.
            if results_in(folder):
                continue
            token = _claimed.set(folder)
            try:
                yield folder
            finally:
                _claimed.reset(token)
            return


def newest_folder(wanted: Path) -> Path:
    """The last of wanted, wanted-2, wanted-3, ... with results; `wanted` if none has any."""
    return [wanted, *itertools.takewhile(results_in, _numbered(wanted))][-1]


@contextlib.contextmanager
def sole_use(folder: Path | None) -> Iterator[None]:
    """Context in which no other run can write into the folder; the system releases the lock of a run that died."""
    if folder is None:
        yield
        return
    if folder == _claimed.get():
        token = _claimed.set(None)
        try:
            yield
        finally:
            _claimed.reset(token)
        return
    # Not above: it takes longer to import than wrong input to be refused.
    from filelock import FileLock, Timeout

    lock = FileLock(folder / ".lock", timeout=0)
    with _writing_in(folder):
        try:
            lock.acquire()
        except Timeout:
            raise BusyError(
                f"out = {str(folder)!r}: another run is writing there; expected a different folder"
            ) from None
    try:
        yield
    finally:
        # Windows removes no open file; there it stays.
        with contextlib.suppress(OSError):
            (folder / ".lock").unlink()
        lock.release()


def clear(folder: Path, names: Sequence[str] = RESULTS) -> None:
    """Remove the named results of an earlier run, with its pictures, films and pages, as they do not show this one."""
    summary = run_summary(folder) or {}
    made = {str(name) for key in ("pictures", "made") for name in summary.get(key, [])}
    for path in (*(folder / name for name in names), *(path for path in _to_look_at(folder) if path.name in made)):
        path.unlink(missing_ok=True)


def remember(folder: Path, path: Path) -> None:
    """Note a film or page of the run in a folder in its summary, so that it is removed when another takes its place."""
    summary = run_summary(folder)
    if summary is not None and path.resolve().parent == folder.resolve():
        summary["made"] = sorted({path.name, *map(str, summary.get("made", []))})
        save_summary(folder, summary)


def save_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json atomically."""
    write_atomically(folder / "summary.json", json.dumps(summary, indent=2) + "\n")


def clear_unfinished(folder: Path) -> None:
    """Remove the unfinished files of a killed run; a resumed run does not read them."""
    for pattern in (".animation.unfinished.usdc", "summary.json.part", "history.csv.part",
                    f"{PAGE}.part", f"{FINE}.part", f"{RESTART}.part", ".*.unfinished"):  # fmt: skip
        for path in folder.glob(pattern):
            path.unlink()


def read_history(path: Path) -> History:
    """Read the history that `write_history` wrote. Raises InputError if it is missing or damaged."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        history = [{key: float("nan" if text == "" else text) for key, text in row.items()} for row in rows]
    except (OSError, ValueError, TypeError, csv.Error):
        history = []
    if not history or "time" not in history[0]:
        raise InputError(f"file = {str(path)!r}: expected the history.csv of a run")
    return history


def write_atomically(path: Path, text: str) -> None:
    """Write a file under a temporary name and rename it when it is complete. Raises OutputError if that fails."""
    part = path.with_name(path.name + ".part")
    with as_output_error(path):
        try:
            part.write_text(text, encoding="utf-8", newline="")
            os.replace(part, path)
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink()
            raise


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table as CSV atomically; None becomes an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(head)
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def write_history(path: Path, history: History) -> None:
    """Write the history as CSV atomically, one row per frame; a missing number is an empty cell."""
    names = list(history[-1])
    write_csv(path, names, (["" if math.isnan(row[name]) else row[name] for name in names] for row in history))
