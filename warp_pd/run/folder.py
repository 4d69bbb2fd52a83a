"""The folder of a run: checks before writing, results of earlier runs, history and summary."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import math
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ..device.checks import InputError, OutputError, said
from ..geometry.picture_files import pictures_in
from ..interfaces import History
from ..output.file_writers import ANIMATION, BODIES, FRAMES
from ..output.info import read_summary
from . import restart

try:
    import fcntl
except ImportError:  # Windows has no such lock: there two runs at once are not noticed.
    fcntl = None  # type: ignore[assignment]


PAGE = "view.html"
FINE = "fine_history.csv"
FIT = "fit.json"
RESULTS = ("summary.json", "history.csv", FINE, restart.NAME, FRAMES, BODIES, ANIMATION, PAGE, FIT)


def writable_folder(out: str | Path | None, resume: bool, overwrite: bool = False) -> Path | None:
    """Check and create the folder of the results; None if nothing is to be written."""
    if resume and overwrite:
        raise InputError("resume = True, overwrite = True: expected at most one of them")
    if out is not None and not isinstance(out, str | Path):
        raise InputError(f"out = {said(out)}: expected a folder or None")
    if out is None:
        if resume:
            raise InputError("resume = True: expected `out` to be a folder with a restart file")
        return None
    if not str(out):
        raise InputError("out = '': expected a writable folder")
    folder = Path(out)
    if resume and not folder.is_dir():
        raise InputError(
            f"resume from {str(folder)!r}: the folder does not exist; expected the folder of an earlier run"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".probe"
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise InputError(f"out = {str(folder)!r}: expected a writable folder ({error.strerror})") from None
    if not resume:
        _require_free(folder, overwrite)
    return folder


def _require_free(folder: Path, overwrite: bool) -> None:
    left = results_in(folder)
    if left and not overwrite:
        raise InputError(
            f"out = {str(folder)!r}: it contains {left[0]}; expected a folder without results, overwrite (--overwrite) "
            "or resume (--resume)"
        )
    if "summary.json" in left and run_summary(folder) is None:
        raise InputError(f"out = {str(folder)!r}: its summary.json does not belong to a run; expected another folder")


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


def free_folder(wanted: Path) -> Path:
    """The first of wanted, wanted-2, wanted-3, ... without results."""
    return next(folder for folder in _numbered(wanted) if not results_in(folder))


def newest_folder(wanted: Path) -> Path:
    """The last of wanted, wanted-2, wanted-3, ... with results; `wanted` if none has any."""
    return [wanted, *itertools.takewhile(results_in, _numbered(wanted))][-1]


def require_room(folder: Path, needed: int) -> None:
    """Check that the disk has room for `needed` bytes. Raises OutputError if it has not."""
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"out = {str(folder)!r}: {free / 1e6:.3g} MB are free, expected {needed / 1e6:.3g} MB for the next files; "
            "free some space, then continue with --resume, or start again if no frame was written"
        )


@contextlib.contextmanager
def sole_use(folder: Path | None) -> Iterator[None]:
    """Context in which no other run can write into the folder; the system releases the lock of a run that died."""
    if folder is None or fcntl is None:
        yield
        return
    path = folder / ".lock"
    with path.open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"out = {str(folder)!r}: another run is writing there; expected a different folder"
            ) from None
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove the results of an earlier run, so that they are not mistaken for those of this one."""
    drawn = {str(name) for name in (run_summary(folder) or {}).get("pictures", [])}
    for path in (*(folder / name for name in RESULTS), *(path for path in pictures_in(folder) if path.name in drawn)):
        path.unlink(missing_ok=True)


def clear_unfinished(folder: Path) -> None:
    """Remove the unfinished files of a killed run; a resumed run does not read them."""
    for pattern in (".animation.unfinished.usdc", "summary.json.part", "history.csv.part",
                    f"{PAGE}.part", f"{FINE}.part", f"{restart.NAME}.part", ".*.unfinished"):  # fmt: skip
        for path in folder.glob(pattern):
            path.unlink()


def read_history(path: Path) -> History:
    """Read the history that `write_history` wrote. Raises InputError if it is missing or damaged."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        history = [{key: float("nan" if text == "" else text) for key, text in row.items()} for row in rows]
    except (OSError, ValueError, TypeError):
        history = []
    if not history:
        raise InputError(f"file = {str(path)!r}: expected the history.csv of a run")
    return history


def write_atomically(path: Path, text: str) -> None:
    """Write a file under a temporary name and rename it when it is complete."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8", newline="")
    os.replace(part, path)


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
