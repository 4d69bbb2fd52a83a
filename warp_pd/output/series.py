"""What a file of frames holds, and how VTKHDF names its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

VERSION = (2, 2)
# The kinds of cells of a PolyData, in the order of the columns of Steps/CellOffsets. Readers want all four.
KINDS = ("Vertices", "Lines", "Polygons", "Strips")
POLYGONS = KINDS.index("Polygons")
# Folder of the files of the processes, beside the file that joins them.
FOLDER = "parts"


@dataclass(frozen=True, eq=False)
class SeriesInfo:
    """What a VTKHDF file of frames holds.

    Attributes:
        frames: Number of frames.
        times: Simulated time of each frame [s], shape (frames,).
        points: Number of points of the sheet.
        faces: Number of intact triangles at each frame, shape (frames,).
        fields: Names of the point data.
        metadata: Configuration, version, units, as given with the surface.
    """

    frames: int
    times: NDArray[np.float64]
    points: int
    faces: NDArray[np.int64]
    fields: tuple[str, ...]
    metadata: dict[str, Any]


class NotASeriesError(Exception):
    """The file is HDF5, but what it holds does not fit together as a series of frames."""


@dataclass(frozen=True)
class Segment:
    """The files of the frames from `first` on, one for each process.

    Attributes:
        first: Index of the first frame in them.
        files: Their names, relative to the folder of the run.
        own: Number of own points in each: the first ones.
    """

    first: int
    files: tuple[str, ...]
    own: tuple[int, ...]


def file_of(first: int, rank: int) -> str:
    """Name of the file of a process, relative to the folder of the run, for the frames from `first` on."""
    return f"{FOLDER}/frames.{first}.{rank}.vtkhdf"
