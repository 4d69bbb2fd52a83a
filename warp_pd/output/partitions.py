"""Frames of which every process writes its own points into a file of its own, and the file that joins them.

A process writes a VTKHDF file like that of a run on one process (vtkhdf.py): of its own points, and after them of the
corners beyond them that its own triangles have. `frames.vtkhdf` is small: it holds the times, and virtual columns of
HDF5, whose rows lie in those files. ParaView and the readers of this package open it as one file, a part of the
surface for each process. It is written anew, and takes its name, when all processes have written a frame: before that
no reader sees anything of it.

A run that goes on, perhaps on another number of processes, writes new files: a segment.
"""

from __future__ import annotations

import bisect
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..device.checks import InputError
from ..interfaces import Writer
from ..interfaces.frame import Frame
from .point_fields import plain_value
from .series import KINDS, POLYGONS, VERSION, NotASeriesError, Segment, SeriesInfo

_GROUP = "partitions"


class JoinedSeries:
    """Writes the frames of a sheet that several processes share; every process calls the same methods.

    Every frame is on disk, and in the file that joins them, when `write` returns.
    """

    def __init__(
        self, path: Path, own: Writer, segments: Sequence[Segment], leads: bool,
        together: Callable[[Callable[[], None]], None],
    ) -> None:  # fmt: skip
        """Begin a segment.

        Args:
            path: The file that joins them.
            own: Writes the frames of the own points, numbered from 0.
            segments: Those to keep of an earlier run, and the new one.
            leads: Whether this process writes the file that joins them.
            together: Does work in all processes; if it fails in one, all end.
        """
        self._path, self._own, self._segments, self._leads = path, own, list(segments), leads
        self._together = together

    def write(self, frame: Frame) -> None:
        """Write the next frame of the own points."""
        numbered = replace(frame, index=frame.index - self._segments[-1].first)
        self._together(lambda: self._own.write(numbered))
        self._together(lambda: join(self._path, self._segments, frame.index + 1) if self._leads else None)

    def save(self) -> None:
        """Nothing to do: every frame is on disk once it is written."""

    def close(self) -> None:
        """The run is over."""
        self._own.close()


@dataclass(frozen=True, eq=False)
class _Part:
    """What a file of one process holds, as far as the file that joins them needs it.

    Attributes:
        name: Its name, relative to the folder of the run.
        own: Number of own points.
        points: Number of points.
        times: Times of its frames [s].
        meshes: Number of its triangulation at each frame.
        cells: Number of triangles of each triangulation.
        columns: Shape and type of each column of points, and of the corners.
    """

    name: str
    own: int
    points: int
    times: NDArray[np.float64]
    meshes: NDArray[np.int64]
    cells: NDArray[np.int64]
    columns: dict[str, tuple[tuple[int, ...], np.dtype[Any]]]


def _part(folder: Path, name: str, own: int) -> _Part:
    with h5py.File(folder / name, "r", locking=False) as file:
        root = file["VTKHDF"]
        names = ["Points", *(f"PointData/{field}" for field in root["PointData"])]
        names += ["Polygons/Offsets", "Polygons/Connectivity"]
        return _Part(
            name, own, int(root["NumberOfPoints"][0]), root["Steps/Values"][:], root["Steps/PartOffsets"][:],
            root["Polygons/NumberOfCells"][:], {column: (root[column].shape, root[column].dtype) for column in names},
        )  # fmt: skip


class _Column:
    """Rows of the files of the processes, one below the other."""

    def __init__(self, name: str) -> None:
        self.name, self.rows = name, 0
        self._pieces: list[tuple[_Part, int, int]] = []

    def add(self, part: _Part, begin: int, number: int) -> None:
        """Add some rows of a file."""
        if number:
            self._pieces.append((part, begin, number))
            self.rows += number

    def create(self, root: Any, part: _Part) -> None:
        """Create the column in a file; its type is that in the file of a process."""
        shape, dtype = part.columns[self.name]
        layout = h5py.VirtualLayout((self.rows, *shape[1:]), dtype)
        at = 0
        for source, begin, number in self._pieces:
            there = h5py.VirtualSource(source.name, f"VTKHDF/{self.name}", source.columns[self.name][0])
            layout[at : at + number] = there[begin : begin + number]
            at += number
        root.create_virtual_dataset(self.name, layout)


def join(path: Path, segments: Sequence[Segment], frames: int) -> None:
    """Write the file that joins those of the processes, and put it in place when it is whole.

    Args:
        path: The file.
        segments: Files of the processes, in the order of their frames.
        frames: Number of frames; all files hold theirs.
    """
    held = [[_part(path.parent, *each) for each in zip(s.files, s.own, strict=True)] for s in segments]
    model = held[-1][0]
    columns = {name: _Column(name) for name in model.columns}
    fields = [name for name in model.columns if not name.startswith("Polygons")]
    steps: dict[str, list[Any]] = {name: [] for name in ("Values", "PartOffsets", "NumberOfParts", "PointOffsets")}
    parts: dict[str, list[int]] = {name: [] for name in ("points", "cells", "own")}
    before: tuple[int, ...] | None = None
    cells_before, mesh_at = [], (0, 0)
    for index in range(frames):
        number = bisect.bisect_right([s.first for s in segments], index) - 1
        local = index - segments[number].first
        meshes = (number, *(int(part.meshes[local]) for part in held[number]))
        if meshes != before:
            before, mesh_at = meshes, (len(parts["points"]), sum(parts["cells"]))
            for part, mesh in zip(held[number], meshes[1:], strict=True):
                _add_mesh(columns, parts, part, mesh)
        steps["Values"].append(held[number][0].times[local])
        steps["PartOffsets"].append(mesh_at[0])
        steps["NumberOfParts"].append(len(held[number]))
        steps["PointOffsets"].append(columns["Points"].rows)
        cells_before.append(mesh_at[1])
        for name in fields:
            for part in held[number]:
                columns[name].add(part, local * part.points, part.points)
    unfinished = path.with_name(f".{path.name}.unfinished")
    with h5py.File(unfinished, "w", locking=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, np.int64)
        root.attrs.create("Type", np.bytes_("PolyData"), dtype=h5py.string_dtype("ascii", len("PolyData")))
        for column in columns.values():
            column.create(root, model)
        _lay_out(root, steps, parts, cells_before, fields)
        _copy_small(file, path.parent, segments, frames)
        group = file.create_group(_GROUP)
        group["own"] = np.array(parts["own"], np.int64)
        group.attrs["segments"] = json.dumps([asdict(segment) for segment in segments])
    os.replace(unfinished, path)


def _add_mesh(columns: dict[str, _Column], parts: dict[str, list[int]], part: _Part, mesh: int) -> None:
    """Add a triangulation of one process."""
    before, cells = int(part.cells[:mesh].sum()), int(part.cells[mesh])
    columns["Polygons/Offsets"].add(part, before + mesh, cells + 1)
    columns["Polygons/Connectivity"].add(part, 3 * before, 3 * cells)
    for name, number in (("points", part.points), ("cells", cells), ("own", part.own)):
        parts[name].append(number)


def _lay_out(
    root: Any, steps: dict[str, list[Any]], parts: dict[str, list[int]], cells_before: list[int], fields: list[str]
) -> None:
    """All but the columns of points and of triangles."""
    number = len(parts["points"])
    root["NumberOfPoints"] = np.array(parts["points"], np.int64)
    for kind in KINDS:
        cells = root.require_group(kind)
        count = np.array(parts["cells"] if kind == "Polygons" else np.zeros(number), np.int64)
        cells["NumberOfCells"], cells["NumberOfConnectivityIds"] = count, 3 * count
        if kind != "Polygons":
            cells["Offsets"], cells["Connectivity"] = np.zeros(number, np.int64), np.zeros(0, np.int64)
    group = root.create_group("Steps")
    group.attrs["NSteps"] = np.int64(len(steps["Values"]))
    for name, values in steps.items():
        group[name] = np.array(values, np.float64 if name == "Values" else np.int64)
    offsets = np.zeros((len(cells_before), len(KINDS)), np.int64)
    offsets[:, POLYGONS] = cells_before
    group["CellOffsets"], group["ConnectivityIdOffsets"] = offsets, 3 * offsets
    for name in fields[1:]:
        group[f"PointDataOffsets/{name.removeprefix('PointData/')}"] = np.array(steps["PointOffsets"], np.int64)


def _copy_small(file: Any, folder: Path, segments: Sequence[Segment], frames: int) -> None:
    """Copy what is not of points: the poses of bodies at each frame, and what is said of the sheet."""
    ends = [*(s.first for s in segments[1:]), frames]
    for place, (segment, end) in enumerate(zip(segments, ends, strict=True)):
        with h5py.File(folder / segment.files[0], "r", locking=False) as source:
            if place == 0:
                source.copy("warp_pd", file)
            for name in (f"{kind}/{n}" for kind in _SMALL for n in source["VTKHDF"].get(kind, ())):
                rows = source["VTKHDF"][name][: end - segment.first]
                held = file["VTKHDF"].get(name)
                rows = rows if held is None else np.concatenate([held[:], rows])
                if held is not None:
                    del file["VTKHDF"][name]
                file["VTKHDF"][name] = rows
    for name, offsets in file["VTKHDF/Steps"].get("FieldDataOffsets", {}).items():
        offsets[:] = np.arange(len(offsets))
        assert name in file["VTKHDF/FieldData"]


_SMALL = ("FieldData", "Steps/FieldDataOffsets", "Steps/FieldDataSizes")


def is_joined(file: Any) -> bool:
    """Whether an open file joins those of several processes."""
    return _GROUP in file


def segments_of(path: Path) -> list[Segment] | None:
    """The files that a file of frames joins; None for one that holds its frames itself.

    Raises:
        InputError: for a file that cannot be read.
    """
    try:
        with h5py.File(path, "r", locking=False) as file:
            return _segments(file) if is_joined(file) else None
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(f"{path}: expected a whole file of frames in VTKHDF ({error})") from None


def _segments(file: Any) -> list[Segment]:
    return [Segment(s["first"], tuple(s["files"]), tuple(s["own"])) for s in json.loads(file[_GROUP].attrs["segments"])]


def joined_info(file: Any) -> SeriesInfo:
    """What an open file that joins others holds.

    Raises:
        NotASeriesError: if one of the others is not there, or lacks frames.
    """
    root, own, segments = file["VTKHDF"], file["warp_pd"], _segments(file)
    frames = int(root["Steps"].attrs["NSteps"])
    ends = [*(s.first for s in segments[1:]), frames]
    for segment, end in zip(segments, ends, strict=True):
        for name in segment.files:
            _require_frames(Path(file.filename).parent, name, end - segment.first)
    begins, numbers = root["Steps/PartOffsets"][:], root["Steps/NumberOfParts"][:]
    cells, points = root["Polygons/NumberOfCells"][:], file[_GROUP]["own"][:]
    faces = [int(cells[b : b + n].sum()) for b, n in zip(begins, numbers, strict=True)]
    return SeriesInfo(
        frames=frames,
        times=root["Steps/Values"][:],
        points=int(points[: numbers[0]].sum()),
        faces=np.array(faces, np.int64),
        fields=tuple(root["PointData"]),
        metadata={name: plain_value(value) for name, value in own.attrs.items()},
    )


def _require_frames(folder: Path, name: str, frames: int) -> None:
    """HDF5 itself fills in zeros for rows of a file that is not there.

    Raises:
        NotASeriesError: for a file that does not hold so many frames.
    """
    if not (folder / name).is_file():
        raise NotASeriesError(f"{name}, which holds a part of the points, is missing")
    with h5py.File(folder / name, "r", locking=False) as part:
        root = part["VTKHDF"]
        rows = frames * int(root["NumberOfPoints"][0])
        if int(root["Steps"].attrs["NSteps"]) < frames or len(root["Points"]) < rows:
            raise NotASeriesError(f"{name}, which holds a part of the points, has less than {frames} frames")


def read_joined_frame(
    file: Any, index: int
) -> tuple[float, NDArray[np.float32], NDArray[np.int64], dict[str, NDArray[Any]]]:
    """One frame of an open file that joins others; see `read_frame`."""
    root, steps = file["VTKHDF"], file["VTKHDF/Steps"]
    first, number = int(steps["PartOffsets"][index]), int(steps["NumberOfParts"][index])
    some = slice(first, first + number)
    own, held, cells = file[_GROUP]["own"][some], root["NumberOfPoints"][some], root["Polygons/NumberOfCells"][some]
    begins = int(steps["PointOffsets"][index]) + np.append(0, np.cumsum(held))[:-1]
    corners_at = int(steps["ConnectivityIdOffsets"][index, POLYGONS]) + np.append(0, np.cumsum(3 * cells))

    def column(name: str) -> NDArray[Any]:
        found = root[name]
        return np.concatenate([found[b : b + n] for b, n in zip(begins, own, strict=True)])

    corners = root["Polygons/Connectivity"][corners_at[0] : corners_at[-1]]
    # Points of a process are numbered from 0; those beyond its own follow them in the sheet.
    for k, point in enumerate(np.append(0, np.cumsum(own))[:-1]):
        corners[corners_at[k] - corners_at[0] : corners_at[k + 1] - corners_at[0]] += point
    fields = {name: column(f"PointData/{name}") for name in root["PointData"]}
    return float(steps["Values"][index]), column("Points"), corners.reshape(-1, 3), fields
