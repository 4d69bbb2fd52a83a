"""Frames of a run, read from its file one at a time to limit memory use."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ..device.checks import InputError, one_of, show
from ..interfaces.frame import format_time
from .vtkhdf import FrameFields, read_frame, read_series

FILE = "frames.vtkhdf"


@dataclass(frozen=True, eq=False, repr=False)
class SavedFrame:
    """One frame of a file; `frame["damage"]` is the field of that name.

    Attributes:
        index: Index of the frame; the first is 0.
        time: Time, or load time of a static solver [s].
        when: The time or load factor as text.
        positions: Deformed positions [m], shape (N, 3).
        triangles: Intact triangles, shape (F, 3).
        fields: Point fields by name, each of shape (N,) or (N, 3).
    """

    index: int
    time: float
    when: str
    positions: NDArray[np.float32]
    triangles: NDArray[np.int64]
    fields: FrameFields

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A field."""
        return self.fields[name]

    def __repr__(self) -> str:
        """One line."""
        return f"SavedFrame({self.index}: {self.when}, {len(self.positions)} points; {', '.join(self.fields)})"

    @property
    def displacement(self) -> NDArray[Any]:
        """Displacement [m], shape (N, 3)."""
        return self["displacement"]

    @property
    def velocity(self) -> NDArray[Any]:
        """Velocity [m/s], shape (N, 3)."""
        return self["velocity"]


class Frames(Sequence[SavedFrame]):
    """The frames of a file, each read on access: `frames[-1]`, `frames[::10]`, `for frame in frames`.

    Args:
        path: A frames.vtkhdf, or the folder of a run that contains one.

    Attributes:
        path: The file.
        times: Times of the frames [s], shape (frames,).
        fields: Names of the point fields.
        points: Number of points.

    Raises:
        InputError: if the file is missing or damaged.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        if not isinstance(path, str | os.PathLike):
            raise InputError(f"path = {show(path)}: expected the folder of a run, or its {FILE}")
        found = Path(path)
        self.path = found / FILE if found.is_dir() else found
        if not self.path.is_file():
            raise InputError(f"path = {str(path)!r}: expected the folder of a run that contains {FILE}, or that file")
        info = read_series(self.path)
        self.fields, self.points, self._all_times = info.fields, info.points, info.times
        self._load_duration = info.metadata.get("load_duration")
        self._kept = range(info.frames)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the frames [s], shape (frames,)."""
        return np.asarray(self._all_times[self._kept])

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._kept)

    def __repr__(self) -> str:
        """One line."""
        return f"Frames({self.path}: {len(self)} frames of {self.points} points; {', '.join(self.fields)})"

    @overload
    def __getitem__(self, index: int) -> SavedFrame: ...
    @overload
    def __getitem__(self, index: slice) -> Frames: ...
    def __getitem__(self, index: int | slice) -> SavedFrame | Frames:
        """A frame, or for a slice a lazy selection of frames.

        Raises:
            IndexError: if there is no such frame.
        """
        if isinstance(index, slice):
            some = Frames(self.path)
            some._kept = self._kept[index]
            return some
        try:
            number = self._kept[operator.index(index)]
        except IndexError:
            raise IndexError(f"frames[{index}]: expected {-len(self)} to {len(self) - 1}") from None
        time, positions, triangles, fields = read_frame(self.path, number)
        return SavedFrame(
            number, time, format_time(time, self._load_duration), positions, triangles, FrameFields(fields)
        )

    def __iter__(self) -> Iterator[SavedFrame]:
        """The frames in order, one in memory at a time."""
        return (self[k] for k in range(len(self)))

    def at(self, time: float) -> SavedFrame:
        """The frame nearest to a time [s]."""
        return self[int(np.abs(self.times - time).argmin())]

    def series(self, field: str, points: Any) -> NDArray[Any]:
        """A field at given points in all frames, shape (frames, points) or (frames, points, 3).

        Args:
            field: Its name.
            points: Point indices, or a single index, which drops that axis.

        Raises:
            InputError: if the file does not have the field, or an index does not exist.
        """
        one_of("field", field, self.fields)
        try:
            return np.stack([frame.fields[field][points] for frame in self])
        except IndexError:
            raise InputError(f"points = {show(points)}: expected indices of {self.points} points") from None
