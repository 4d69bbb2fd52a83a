"""The folder of a run: what may be written there, what an earlier run left, history and summary."""

from __future__ import annotations

import contextlib
import csv
import itertools
import json
import math
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..device.checks import InputError, OutputError, said
from ..interfaces import History
from . import restart

try:
    import fcntl
except ImportError:  # Windows has no such lock: there two runs at once are not noticed.
    fcntl = None  # type: ignore[assignment]


PAGE = "view.html"
FINE = "fine_history.csv"
RESULTS = ("summary.json", "history.csv", FINE, restart.NAME, "frames.vtkhdf", "bodies.vtkhdf", "animation.usd", PAGE)


def writable_folder(out: str | Path | None, resume: bool, overwrite: bool = False) -> Path | None:
    """The folder of the results; None writes nothing.

    Args:
        out: The folder.
        resume: Whether a run in it goes on.
        overwrite: Whether the results of another run in it may be replaced.

    Raises:
        InputError: for a folder that cannot be written, a run to resume that is not there, or a folder that holds
            results that nobody asked to replace.
    """
    if resume and overwrite:
        raise InputError("resume = True, overwrite = True: expected one of them")
    if out is not None and not isinstance(out, str | Path):
        raise InputError(f"out = {said(out)}: expected a folder or None")
    if out is None:
        if resume:
            raise InputError("resume = True: expected a folder that holds a restart file")
        return None
    if not str(out):
        raise InputError("out = '': expected a folder that can be written")
    folder = Path(out)
    if resume and not folder.is_dir():
        raise InputError(f"resume from {str(folder)!r}: the folder does not exist; expected that of an earlier run")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".probe"
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise InputError(f"out = {str(folder)!r}: expected a folder that can be written ({error.strerror})") from None
    if not resume:
        _require_free(folder, overwrite)
    return folder


def _require_free(folder: Path, overwrite: bool) -> None:
    left = results_in(folder)
    if left and not overwrite:
        raise InputError(
            f"out = {str(folder)!r}: it holds {left[0]}; expected a folder without results, or overwrite (--overwrite) "
            "or resume (--resume)"
        )
    if "summary.json" in left and run_summary(folder) is None:
        raise InputError(f"out = {str(folder)!r}: its summary.json is not of a run; expected another folder")


def results_in(folder: Path) -> list[str]:
    """Names of the files of a run that a folder holds."""
    return [name for name in RESULTS if (folder / name).exists()]


def run_summary(folder: Path) -> dict[str, Any] | None:
    """The summary of a run in a folder, or None."""
    try:
        found = json.loads((folder / "summary.json").read_text())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and {"scene", "settings", "status"} <= set(found) else None


def _numbered(wanted: Path) -> Iterator[Path]:
    """The folder itself, then wanted-2, wanted-3, ..."""
    yield wanted
    for number in itertools.count(2):
        yield wanted.with_name(f"{wanted.name}-{number}")


def remove_if_empty(folder: Path) -> None:
    """Remove the folder of a run that was refused."""
    with contextlib.suppress(OSError):
        folder.rmdir()


def free_folder(wanted: Path) -> Path:
    """The first of wanted, wanted-2, wanted-3, ... that holds no results."""
    return next(folder for folder in _numbered(wanted) if not results_in(folder))


def newest_folder(wanted: Path) -> Path:
    """The last of wanted, wanted-2, wanted-3, ... that holds results; `wanted` if none does."""
    return [wanted, *itertools.takewhile(results_in, _numbered(wanted))][-1]


def require_room(folder: Path, needed: int) -> None:
    """Check that the disk has room for what is written next.

    Args:
        folder: The folder of the run.
        needed: [bytes].

    Raises:
        OutputError: otherwise.
    """
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"out = {str(folder)!r}: {free / 1e6:.3g} MB are free, expected {needed / 1e6:.3g} MB for what is written "
            "next; make room, then go on with --resume, or begin anew if no frame was written"
        )


@contextlib.contextmanager
def sole_use(folder: Path | None) -> Iterator[None]:
    """Context in which no other run writes into the folder. The system takes the lock from a run that died.

    Raises:
        InputError: if another run writes there.
    """
    if folder is None or fcntl is None:
        yield
        return
    path = folder / ".lock"
    with path.open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"out = {str(folder)!r}: another run writes there; expected a folder of its own") from None
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove what an earlier run left: it must not pass for this one's."""
    drawn = (run_summary(folder) or {}).get("pictures", [])
    for name in (*RESULTS, *drawn):
        (folder / Path(name).name).unlink(missing_ok=True)


def clear_unfinished(folder: Path) -> None:
    """Remove what a killed run was about to write; no resumed one reads it."""
    for pattern in (".animation.*.usdc", "summary.json.part", "history.csv.part",
                    f"{PAGE}.part", f"{FINE}.part", f"{restart.NAME}.part", ".*.unfinished"):  # fmt: skip
        for path in folder.glob(pattern):
            path.unlink()


def read_history(path: Path) -> History:
    """What `write_history` wrote.

    Raises:
        InputError: if it is missing or damaged.
    """
    try:
        with path.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        history = [{key: float("nan" if text == "" else text) for key, text in row.items()} for row in rows]
    except (OSError, ValueError, TypeError):
        history = []
    if not history:
        raise InputError(f"file = {str(path)!r}: expected the history.csv of a run")
    return history


def write_atomically(path: Path, text: str) -> None:
    """Write a file under another name and move it into place when it is complete."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def write_history(path: Path, history: History) -> None:
    """History as CSV, one row per frame, written atomically; a number that is missing is an empty cell."""
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(history[-1]))
        writer.writeheader()
        writer.writerows({name: "" if math.isnan(value) else value for name, value in row.items()} for row in history)
    os.replace(part, path)
