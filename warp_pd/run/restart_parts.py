"""Restart files of a sheet that several processes share: each writes what it owns, and reads what it needs.

`restart.npz` names the files of the processes, and takes its place when all are written. Any number of processes goes
on from them: each reads the rows of its own points and of its halo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..device.fields import Stored, to_host
from ..interfaces.context import Context
from ..output.series import FOLDER
from .built import Built

# What a field has an entry for that processes divide among themselves.
DIVIDED = ("point", "bond", "face")


@dataclass(frozen=True)
class Part:
    """The file of one process.

    Attributes:
        file: Its name, relative to the folder of the run.
        points: First point in it, and the one after the last.
        faces: First triangle in it, and the one after the last.
    """

    file: str
    points: tuple[int, int]
    faces: tuple[int, int]


@dataclass(frozen=True)
class DividedField:
    """A field whose rows are in the files of several processes.

    Attributes:
        name: Its name.
        folder: The folder of the run.
        parts: The files, in the order of the points.
    """

    name: str
    folder: Path
    parts: tuple[Part, ...]

    def here(self, context: Context, stored: Stored) -> np.ndarray:
        """What a process needs of it.

        Raises:
            InputError: for a file that is missing or damaged.
        """
        share, per = context.share, stored.field.per
        if share is not None and share.owners is not None:
            return context.values_here(stored, self._rows(per, 0, max(part.points[1] for part in self.parts)))
        if per == "face":
            begin, end = 0, max(part.faces[1] for part in self.parts)
            if share is not None:
                begin, end = (int(share.faces[0]), int(share.faces[-1]) + 1) if len(share.faces) else (0, 0)
        else:
            begin, end = 0, max(part.points[1] for part in self.parts)
            if share is not None:
                begin, end = int(share.points[0]), int(share.points[-1]) + 1
        found = self._rows(per, begin, end)
        if per == "bond" and share is not None:
            found[:, ~share.near] = 0
        return found

    def _rows(self, per: str, begin: int, end: int) -> np.ndarray:
        """Rows begin to end - 1, of all files that hold some of them."""
        from ..output.part_arrays import read_rows

        axis, found = int(per == "bond"), []
        for k, part in enumerate(self.parts):
            first, last = part.faces if per == "face" else part.points
            low, high = max(begin, first) - first, max(min(end, last) - first, 0)
            if low < high or (k == 0 and begin >= end):
                found.append(read_rows(self.folder / part.file, self.name, slice(low, high), axis))
        return np.concatenate(found, axis=axis)


def divides(built: Built, stored: Stored) -> bool:
    """Whether the processes divide the rows of a field among themselves."""
    return built.context.share is not None and stored.field.per in DIVIDED


def file_of(frame: int, rank: int) -> str:
    """Name of the file of a process, relative to the folder of the run."""
    return f"{FOLDER}/restart.{frame}.{rank}.h5"


def own_part(built: Built, frame: int) -> Part:
    """What the file of this process holds."""
    share = built.context.share
    assert share is not None
    begin, end = (built.context.number(share.own.start), built.context.number(share.own.stop - 1) + 1)
    faces = (int(share.faces[0]), int(share.faces[-1]) + 1) if len(share.faces) else (0, 0)
    return Part(file_of(frame, share.rank), (begin, end), faces)


def save_part(folder: Path, built: Built, frame: int) -> None:
    """Write what this process owns."""
    share = built.context.share
    assert share is not None
    from ..output.part_arrays import write_arrays

    arrays = {}
    for stored in built.context.fields:
        if stored.field.restart and divides(built, stored):
            array = built.context.own(stored.array) if stored.field.per == "point" else stored.array
            values = to_host(array)
            arrays[stored.name] = values[:, share.own] if stored.field.per == "bond" else values
    write_arrays(folder / file_of(frame, share.rank), arrays)


def remove_others(folder: Path, kind: str, kept: Sequence[str]) -> None:
    """Remove files of the processes, but some.

    Args:
        folder: The folder of the run.
        kind: "frames" or "restart".
        kept: Names of those to keep, relative to the folder.
    """
    for path in (folder / FOLDER).glob(f"{kind}.*"):
        if f"{FOLDER}/{path.name}" not in kept:
            path.unlink()
