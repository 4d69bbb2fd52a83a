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
