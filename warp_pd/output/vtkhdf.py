"""Frames of a sheet in one VTKHDF file, which ParaView opens directly.

The file is a VTKHDF PolyData with time steps. Every array of the sheet is one long column to which each frame appends
rows; `Steps` stores where each frame's rows begin. A frame with the same triangles as the one before refers to the
existing rows, so a sheet that does not tear stores its triangles once.

Point positions are deformed, so ParaView shows the deformed sheet, consistent with the bodies in `bodies.vtkhdf`. The
reference position is a point field, stored once; "Warp By Vector" with the displacement and the factor -1 shows the
reference sheet.

HDF5 has no journal. Three measures keep the file of a killed run readable: the file gets its final name only when its
first frame is complete; it is open only while a frame is being added; and the number of steps, without which readers
ignore the new rows, is written last. VTK's reader overruns its memory if `Steps/Values` has more rows than there are
steps, so both are written together. If the load factor may decrease, `Steps/Values` are the indices of the frames,
since readers sort them, and `load_times` their times.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..device.checks import InputError, user_code
from ..interfaces.frame import Body, Frame, Surface
from .background import require_room

TAKEN = ("displacement", "velocity", "damage", "reference_position")


class FrameFields(dict[str, NDArray[Any]]):
    """Fields by name, with a one-line error for a missing name."""

    def __missing__(self, name: str) -> NDArray[Any]:
        """Raise the error for a field that the frames do not have."""
        raise InputError(f"field {name!r}: the frames hold {', '.join(self)}; expected one of these")


def point_fields(frame: Frame, chosen: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Point data of a frame by name, in the types of the file; `chosen` besides the displacement, None for all."""
    fields = {"displacement": frame.displacement, "velocity": frame.velocity}
    if frame.damage is not None:
        fields["damage"] = frame.damage
    for name, values in frame.point_data.items():
        if name in TAKEN or not name or "/" in name or name == ".":
            raise ValueError(f"point_data has a field '{name}'; expected any other name, without '/'")
        if np.shape(values)[1:] not in ((), (3,)):
            raise ValueError(f"point_data['{name}'] has shape {np.shape(values)}; expected (N,) or (N, 3)")
        fields[name] = values
    kept = fields if chosen is None else {name: fields[name] for name in fields if name in {"displacement", *chosen}}
    return {name: stored(np.asarray(values)) for name, values in kept.items()}


def stored(values: NDArray[Any]) -> NDArray[Any]:
    """Convert real numbers to single precision, and booleans, which VTK lacks, to 0 and 1."""
    if values.dtype == np.bool_:
        return values.astype(np.uint8)
    return values if np.issubdtype(values.dtype, np.integer) else values.astype(np.float32, copy=False)


def same_arrays(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    """Whether two arrays, or None, are equal."""
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def plain_value(value: Any) -> Any:
    """Convert a NumPy number to a Python number."""
    return value.item() if isinstance(value, np.generic) else value


VERSION = (2, 2)
# The kinds of cells of a PolyData, in the order of the columns of Steps/CellOffsets. Readers want all four.
KINDS = ("Vertices", "Lines", "Polygons", "Strips")
POLYGONS = KINDS.index("Polygons")
# What the names of columns with the position and quaternion of a body begin with.
POSE = "pose_"
# The point field that all frames share.
REFERENCE = "reference_position"
# What the metadata say about the points.
POSITIONS = f"deformed; {REFERENCE} + displacement"
# HDF5 splits a column's table of chunks when it has taken in 64 more; a kill in that split would cost the
# file. Chunks of many frames make splits rare.
_CHUNK_BYTES = 2**20
# Bytes of the columns of a few rows and of the tables of chunks, at most.
_SMALL_COLUMNS = 500_000
# HDF5 takes no chunk of 4 GB.
_MOST_BYTES = 2**30


@dataclass(frozen=True, eq=False)
class SeriesInfo:
    """Contents of a VTKHDF file of frames.

    Attributes:
        frames: Number of frames.
        times: Simulated time of each frame [s], shape (frames,).
        points: Number of points of the sheet.
        faces: Number of intact triangles at each frame, shape (frames,).
        fields: Names of the point data.
        metadata: Configuration, version and units, as given with the surface.
    """

    frames: int
    times: NDArray[np.float64]
    points: int
    faces: NDArray[np.int64]
    fields: tuple[str, ...]
    metadata: dict[str, Any]


# Time [s], deformed positions [m], intact triangles and point data of a frame, as `read_frames` says.
SeriesFrame = tuple[float, NDArray[np.float32], NDArray[np.int64], dict[str, NDArray[Any]]]


class NotASeriesError(Exception):
    """The file is HDF5, but not a consistent series of frames."""


class VtkHdfSeries:
    """Writes frames into one VTKHDF file, which can be read at any time after the first frame.

    Every frame is on disk when `write` returns. Other programs may read the file while it grows.
    """

    def __init__(
        self, path: str | os.PathLike[str], surface: Surface, *, append_from: int | None = None,
        fields: Collection[str] | None = None,
    ) -> None:  # fmt: skip
        """Begin a series, or continue one.

        Args:
            path: The file. An existing file is replaced unless `append_from` is given.
            surface: The reference sheet.
            append_from: Index of the first new frame; earlier frames of the existing file are kept, later ones dropped.
                None and 0 begin a new file.
            fields: Names of the point fields to store besides the displacement; None for all fields of a frame.
        """
        self.path = Path(path).resolve()
        self.surface = surface
        self._field_names = fields
        self._last_faces: NDArray[np.integer] | None = None
        self._last_intact: NDArray[np.bool_] | None = None
        self._unfinished = False
        if append_from:
            self._continue_from(append_from)
        else:
            self.path.unlink(missing_ok=True)

    def write(self, frame: Frame) -> None:
        """Add the next frame, with the same fields as the one before."""
        fields = point_fields(frame, self._field_names)
        # HDF5 does not survive a write that fails: the process ends with a segmentation fault.
        require_room(self.path.parent, _most_bytes(self.surface, fields))
        if frame.index == 0:
            self._create(frame, fields)
        else:
            with h5py.File(self.path, "r+", locking=False) as file:
                self._add(file, frame, fields)

    def _create(self, frame: Frame, fields: dict[str, NDArray[Any]]) -> None:
        """Write the first frame to a temporary file, and rename it when complete."""
        unfinished = self.path.with_name(f".{self.path.name}.unfinished")
        with h5py.File(unfinished, "w", locking=False) as file:
            _lay_out(file, self.surface, frame, fields)
            self._add(file, frame, fields)
        os.replace(unfinished, self.path)

    def _add(self, file: h5py.File, frame: Frame, fields: Mapping[str, NDArray[Any]]) -> None:
        """Add the rows of one frame, and then increment the number of steps."""
        root, steps = file["VTKHDF"], file["VTKHDF/Steps"]
        if self._unfinished:
            # What an earlier call began and did not finish is not part of any frame.
            _cut(root, frame.index)
        self._unfinished = True
        faces = self._last_faces
        if faces is None or not same_arrays(frame.intact_faces, self._last_intact):
            faces = frame.faces(self.surface)
            if not same_arrays(faces, self._last_faces):
                _add_faces(root, faces, len(self.surface.points))
        begin = len(root["Points"])
        _add_rows(root, "Points", frame.positions(self.surface))
        data, offsets = root["PointData"], steps["PointDataOffsets"]
        for name, values in fields.items():
            _add_rows(data, name, values)
            _add_rows(offsets, name, [begin])
        if frame.index == 0:
            _add_rows(data, REFERENCE, self.surface.points)
        _add_rows(offsets, REFERENCE, [0])
        for name, place in _places_of_bodies(self.surface, frame).items():
            _add_rows(root["FieldData"], name, [place])
            _add_rows(steps["FieldDataOffsets"], name, [frame.index])
            _add_rows(steps["FieldDataSizes"], name, [[len(place), 1]])
        _add_rows(steps, "PointOffsets", [begin])
        _add_rows(steps, "NumberOfParts", [1])
        _add_rows(steps, "PartOffsets", [len(root["NumberOfPoints"]) - 1])
        _add_rows(steps, "CellOffsets", [_before_last(root, "NumberOfCells")])
        _add_rows(steps, "ConnectivityIdOffsets", [_before_last(root, "NumberOfConnectivityIds")])
        file.flush()
        numbered = "load_times" in file
        if numbered:
            file["load_times"].resize(frame.index, axis=0)
            _add_rows(file, "load_times", [frame.time])
        _add_rows(steps, "Values", [frame.index if numbered else frame.time])
        steps.attrs.modify("NSteps", frame.index + 1)
        file.flush()
        self._unfinished = False
        self._last_faces = faces
        self._last_intact = None if frame.intact_faces is None else frame.intact_faces.copy()

    def _continue_from(self, first: int) -> None:
        """Drop the frames from `first` on, and restore the state after the frame before it."""
        info = read_series(self.path)
        if not 0 < first <= info.frames:
            raise ValueError(
                f"append_from is {first}; expected 0 to {info.frames}, the number of frames in {self.path}"
            )
        with _reading(self.path), h5py.File(self.path, "r+", locking=False) as file:
            root = file["VTKHDF"]
            root["Steps/Values"].resize(first, axis=0)
            root["Steps"].attrs.modify("NSteps", first)
            file.flush()
            _cut(root, first)
            begin = root["Steps/ConnectivityIdOffsets"][first - 1, POLYGONS]
            self._last_faces = root["Polygons/Connectivity"][begin:].reshape(-1, 3)


class BodySeries(VtkHdfSeries):
    """Writes the outlines of the bodies of frames, moved, as `VtkHdfSeries` writes the sheet.

    The point field `body` is the index of the body, in the order of the scene. Arguments as for `VtkHdfSeries`; the
    surface is that of the sheet.
    """

    def __init__(self, path: str | os.PathLike[str], surface: Surface, *, append_from: int | None = None) -> None:
        first = np.cumsum([0, *(len(body.vertices) for body in surface.bodies)])
        self._field = {"body": np.repeat(np.arange(len(surface.bodies)), np.diff(first))}
        points = np.concatenate([body.vertices for body in surface.bodies])
        faces = np.concatenate([body.triangles + n for body, n in zip(surface.bodies, first, strict=False)])
        named = {**surface.metadata, "bodies": ", ".join(body.name for body in surface.bodies)}
        self._bodies = surface.bodies
        outlines = Surface(points, faces, f"bodies of {surface.title}", named)
        super().__init__(path, outlines, append_from=append_from, fields=("body",))

    def write(self, frame: Frame) -> None:
        """Add the bodies of the next frame."""
        assert frame.bodies is not None
        placed = [body.placed(pose) for body, pose in zip(self._bodies, frame.bodies, strict=True)]
        moved = np.concatenate(placed) - self.surface.points
        super().write(Frame(frame.index, frame.time, moved, np.zeros_like(moved), point_data=self._field))


def read_series(path: str | os.PathLike[str]) -> SeriesInfo:
    """Read the contents of a VTKHDF file of frames without the frames themselves.

    Raises:
        FileNotFoundError: if the file does not exist.
        ValueError: if the file is damaged, or was not written by `VtkHdfSeries`.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"path is {path}; expected a file that exists")
    with _reading(path), h5py.File(path, "r", locking=False) as file:
        return _read_info(file)


def _reading(path: str | os.PathLike[str]) -> contextlib.AbstractContextManager[None]:
    """Context in which a file may turn out to be damaged: one line instead of any error of HDF5 or of numbers in it."""

    def text_of(error: Exception) -> str:
        # HDF5's only sign that this process has the file open with other settings.
        if isinstance(error, OSError) and any(sign in str(error) for sign in ("locking flag", "already open")):
            return f"{path}: it is open in this process; expected it to be closed first, or opened with locking=False"
        return f"{path}: expected a complete VTKHDF file of frames"

    return user_code(text_of)


def read_frame(path: str | os.PathLike[str], index: int) -> SeriesFrame:
    """One frame of a VTKHDF file; see `read_frames`."""
    return next(read_frames(path, [index]))


def read_frames(path: str | os.PathLike[str], indices: Iterable[int]) -> Iterator[SeriesFrame]:
    """Read frames of a VTKHDF file, one after the other.

    Yields:
        Time [s]; deformed positions [m], shape (N, 3); intact triangles, shape (F, 3); and the point data by name, each
        of shape (N,) or (N, 3).

    Raises:
        FileNotFoundError: if the file does not exist.
        ValueError: if the file is damaged or was not written by `VtkHdfSeries`.
    """
    info = read_series(path)
    with _reading(path), h5py.File(path, "r", locking=False) as file:
        root = file["VTKHDF"]
        columns = {name: root["PointData"][name] for name in info.fields}
        begins = root["Steps/ConnectivityIdOffsets"][: info.frames, POLYGONS]
        for index in indices:
            rows = slice(index * info.points, (index + 1) * info.points)
            begin = int(begins[index])
            corners = root["Polygons/Connectivity"][begin : begin + 3 * int(info.faces[index])]
            if corners.size and not 0 <= corners.min() <= corners.max() < info.points:
                raise NotASeriesError(f"triangles of points that do not exist at frame {index}")
            fields = {name: column[rows] for name, column in columns.items()}
            yield float(info.times[index]), root["Points"][rows], corners.reshape(-1, 3), fields


def read_outlines(path: str | os.PathLike[str]) -> list[tuple[Body, NDArray[np.float64]]]:
    """Rigid bodies of a VTKHDF file; positions [m] and quaternions, (frames, 7)."""
    found = []
    with _reading(path), h5py.File(path, "r", locking=False) as file:
        own, columns = file["warp_pd"], file["VTKHDF"].get("FieldData", {})
        for name, stored in own.items():
            kind, sizes = str(stored.attrs["kind"]), tuple(float(size) for size in stored.attrs["sizes"])
            body = Body(name, kind, sizes, stored["vertices"][:], stored["triangles"][:])
            found.append((body, columns[f"{POSE}{name}"][:]))
    return found


def _read_info(file: h5py.File) -> SeriesInfo:
    root, own = file["VTKHDF"], file["warp_pd"]
    steps = root["Steps"]
    frames = min(int(steps.attrs["NSteps"]), len(steps["Values"]))
    if frames < 1:
        raise NotASeriesError("no frame")
    parts = steps["PartOffsets"][:frames]
    points = int(root["NumberOfPoints"][0])
    fields = {name: column for name, column in root["PointData"].items() if name != REFERENCE}
    for name, column in {"Points": root["Points"], **fields}.items():
        if len(column) < frames * points:
            raise NotASeriesError(f"{frames} steps of {points} points but {len(column)} rows of {name}")
    faces = root["Polygons/NumberOfCells"][: parts[-1] + 1]
    if len(faces) <= parts[-1] or len(root["Polygons/Connectivity"]) < 3 * faces.sum():
        raise NotASeriesError("triangles are missing")
    return SeriesInfo(
        frames=frames,
        times=file.get("load_times", steps["Values"])[:frames],
        points=points,
        faces=faces[parts],
        fields=tuple(fields),
        metadata={name: plain_value(value) for name, value in own.attrs.items()},
    )


def _lay_out(file: h5py.File, surface: Surface, frame: Frame, fields: Mapping[str, NDArray[Any]]) -> None:
    """Create all groups and empty columns."""
    points = len(surface.points)
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array(VERSION, np.int64)
    # Readers take a fixed-length ASCII string only.
    root.attrs.create("Type", np.bytes_("PolyData"), dtype=h5py.string_dtype("ascii", len("PolyData")))
    _create_column(root, "Points", np.float32, (3,), points)
    _create_column(root, "NumberOfPoints", np.int64)
    for kind in KINDS:
        cells = root.create_group(kind)
        faces = len(surface.faces) if kind == "Polygons" else 0
        _create_column(cells, "NumberOfCells", np.int64)
        _create_column(cells, "NumberOfConnectivityIds", np.int64)
        _create_column(cells, "Offsets", np.int64, rows_per_frame=faces + 1)
        _create_column(cells, "Connectivity", np.int64, rows_per_frame=3 * faces)
    steps = root.create_group("Steps")
    # Created one after the other these two stand side by side in the file, and change in one write.
    steps.attrs["NSteps"] = np.int64(0)
    _create_column(steps, "Values", np.float64)
    for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
        _create_column(steps, name, np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        _create_column(steps, name, np.int64, (len(KINDS),))
    for name, values in {**fields, REFERENCE: surface.points.astype(np.float32)}.items():
        _create_column(root.require_group("PointData"), name, values.dtype, values.shape[1:], points)
        _create_column(steps.require_group("PointDataOffsets"), name, np.int64)
    for name, place in _places_of_bodies(surface, frame).items():
        _create_column(root.require_group("FieldData"), name, np.float64, (len(place),))
        _create_column(steps.require_group("FieldDataOffsets"), name, np.int64)
        _create_column(steps.require_group("FieldDataSizes"), name, np.int64, (2,))
    own = file.create_group("warp_pd")
    for body in surface.bodies:
        stored = own.create_group(body.name)
        stored.attrs["kind"], stored.attrs["sizes"] = body.kind, body.sizes
        stored["vertices"], stored["triangles"] = body.vertices, body.triangles
    if surface.metadata.get("turns"):
        # Readers want rising values: there the frames are numbered.
        _create_column(file, "load_times", np.float64)
    for name, value in {"title": surface.title, "positions": POSITIONS, **surface.metadata}.items():
        own.attrs[name] = value


def _most_bytes(surface: Surface, fields: Mapping[str, NDArray[Any]]) -> int:
    """Bytes by which a file grows with a frame, at most: each column by its rows and one more chunk."""
    points, faces = len(surface.points), len(surface.faces)
    # Points, reference, displacement and fields of points; corners and offsets of triangles.
    columns = [12 * points, 12 * points, *(values.nbytes for values in fields.values()), 24 * faces, 8 * (faces + 1)]
    return _SMALL_COLUMNS + sum(2 * size + min(16 * size, _CHUNK_BYTES) for size in columns)


def _add_faces(root: h5py.Group, faces: NDArray[np.integer], points: int) -> None:
    """Add the triangles of a frame, shape (F, 3), and the other, empty kinds of cells."""
    _add_rows(root, "NumberOfPoints", [points])
    for kind in KINDS:
        corners = faces if kind == "Polygons" else np.empty((0, 3), np.int64)
        cells = root[kind]
        _add_rows(cells, "NumberOfCells", [len(corners)])
        _add_rows(cells, "NumberOfConnectivityIds", [corners.size])
        _add_rows(cells, "Offsets", 3 * np.arange(len(corners) + 1))
        _add_rows(cells, "Connectivity", corners.ravel())


def _before_last(root: h5py.Group, count: str) -> list[int]:
    """Number of rows before the latest triangles, for each kind of cells."""
    before = [0] * len(KINDS)
    before[POLYGONS] = int(np.sum(root["Polygons"][count][:-1]))
    return before


def _cut(root: h5py.Group, frames: int) -> None:
    """Remove all rows not used by the first `frames` frames."""
    steps = root["Steps"]
    parts = int(steps["PartOffsets"][frames - 1]) + 1 if frames else 0
    points = int(root["NumberOfPoints"][0]) if frames else 0
    for column in _columns(steps):
        _shorten(column, frames)
    _shorten(root["Points"], frames * points)
    for column in _columns(root["PointData"]):
        _shorten(column, frames * points)
    if "FieldData" in root:
        for column in _columns(root["FieldData"]):
            _shorten(column, frames)
    _shorten(root["NumberOfPoints"], parts)
    for kind in KINDS:
        cells = root[kind]
        _shorten(cells["NumberOfCells"], parts)
        _shorten(cells["NumberOfConnectivityIds"], parts)
        _shorten(cells["Offsets"], int(np.sum(cells["NumberOfCells"])) + parts)
        _shorten(cells["Connectivity"], int(np.sum(cells["NumberOfConnectivityIds"])))


def _places_of_bodies(surface: Surface, frame: Frame) -> dict[str, NDArray[Any]]:
    """Columns of a frame with the position and quaternion of each body."""
    poses = () if frame.bodies is None else frame.bodies
    return {f"{POSE}{body.name}": pose for body, pose in zip(surface.bodies, poses, strict=True)}


def _create_column(
    group: Any,
    name: str,
    dtype: Any,
    row_shape: tuple[int, ...] = (),
    rows_per_frame: int = 1,
) -> None:
    """Create an empty, resizable column."""
    row_bytes = np.dtype(dtype).itemsize * int(np.prod(row_shape, dtype=int))
    # A whole number of frames, at most 16 of them, so that a short run of a small sheet makes a small file.
    frames = min(max(_CHUNK_BYTES // (row_bytes * max(rows_per_frame, 1)), 1), 16)
    rows = min(max(frames * rows_per_frame, 64), _MOST_BYTES // row_bytes)
    group.create_dataset(name, (0, *row_shape), dtype, maxshape=(None, *row_shape), chunks=(rows, *row_shape))


def _add_rows(group: Any, name: str, rows: Any) -> None:
    """Add rows at the end of a column, by HDF5's own functions: those of h5py take longer than writing a few rows."""
    column = h5py.h5d.open(group.id, name.encode())
    rows = np.ascontiguousarray(rows, column.dtype)
    before, *below = column.shape
    column.set_extent((before + len(rows), *below))
    if rows.size:
        place = column.get_space()
        place.select_hyperslab((before, *(0 for _ in below)), (len(rows), *below))
        column.write(h5py.h5s.create_simple((len(rows), *below)), place, rows)


def _columns(group: Any) -> list[Any]:
    """All columns in a group and in the groups inside it."""
    found: list[Any] = []
    for member in group.values():
        found.extend(_columns(member) if hasattr(member, "values") else [member])
    return found


def _shorten(column: Any, rows: int) -> None:
    """Truncate a column to its first `rows` rows."""
    if len(column) > rows:
        column.resize(rows, axis=0)
