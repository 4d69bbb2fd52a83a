"""The folder of a run: what may be written there, what an earlier run left, history and summary."""

from __future__ import annotations

import contextlib
import csv
import json
import os
from pathlib import Path

from ..checks import InputError
from ..interfaces import History
from . import restart


def writable_folder(out: str | Path | None, resume: bool) -> Path | None:
    """The folder of the results; None writes nothing.

    Raises:
        InputError: for a folder that cannot be written, or a run to resume that is not there.
    """
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
    return folder


def clear(folder: Path) -> None:
    """Remove what an earlier run left: it must not pass for this one's."""
    drawn: list[str] = []
    with contextlib.suppress(OSError, ValueError, AttributeError):
        drawn = json.loads((folder / "summary.json").read_text()).get("pictures", [])
    for name in ("summary.json", "history.csv", restart.NAME, "frames.vtkhdf", "animation.usd", *drawn):
        (folder / Path(name).name).unlink(missing_ok=True)


def clear_unfinished(folder: Path) -> None:
    """Remove what a killed run was about to write; no resumed one reads it."""
    for pattern in (".animation.*.usdc", ".frames.vtkhdf.unfinished", "summary.json.part", "history.csv.part",
                    f"{restart.NAME}.part", "*.png.part"):  # fmt: skip
        for path in folder.glob(pattern):
            path.unlink()


def read_history(path: Path) -> History:
    """What `write_history` wrote.

    Raises:
        InputError: if it is missing or damaged.
    """
    try:
        with path.open(newline="") as stream:
            history = [{key: float(text) for key, text in row.items()} for row in csv.DictReader(stream)]
    except (OSError, ValueError, TypeError):
        history = []
    if not history:
        raise InputError(f"file = {str(path)!r}: expected the history.csv of a run")
    return history


def write_atomically(path: Path, text: str) -> None:
    """Write a file under another name and move it into place when it is complete."""
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    os.replace(part, path)


def write_history(path: Path, history: History) -> None:
    """History as CSV, one row per frame, written atomically."""
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(history[-1]))
        writer.writeheader()
        writer.writerows(history)
    os.replace(part, path)
