"""The VTKHDF series: what VTK reads back is what was written, whatever happens to the run."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torn_frames
from torn_frames import BALL, FRAMES, make_surface
from torn_frames import make_frame_with_fields as make_frame

from warp_pd.interfaces.frame import Body, Frame, Surface

pytest.importorskip("h5py")

import h5py

from warp_pd.output.vtkhdf import BodySeries, VtkHdfSeries, point_fields, read_frame, read_series

write_all = functools.partial(torn_frames.write_all, VtkHdfSeries, frame=make_frame)


class Reader:
    """VTK's own reader, one step at a time, as numpy arrays."""

    def __init__(self, path: Path) -> None:
        hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
        self._reader = hdf.vtkHDFReader()
        assert self._reader.CanReadFile(str(path))
        self._reader.SetFileName(str(path))
        self._reader.UpdateInformation()
        self.steps = self._reader.GetNumberOfSteps()

    def at(self, step: int) -> dict[str, Any]:
        from vtkmodules.util.numpy_support import vtk_to_numpy

        self._reader.SetStep(step)
        self._reader.Update()
        output = self._reader.GetOutput()
        data = output.GetPointData()
        names = [data.GetArrayName(number) for number in range(data.GetNumberOfArrays())]
        return {
            "time": self._reader.GetTimeValue(),
            "points": vtk_to_numpy(output.GetPoints().GetData()),
            "faces": vtk_to_numpy(output.GetPolys().GetConnectivityArray()).reshape(-1, 3),
            "cells": output.GetNumberOfCells(),
            "fields": {name: vtk_to_numpy(data.GetArray(name)) for name in names},
            "pose_ball": output.GetFieldData().GetArray("pose_ball"),
        }


def assert_step_is_frame(step: dict[str, Any], surface: Surface, frame: Frame) -> None:
    assert step["time"] == pytest.approx(frame.time)
    np.testing.assert_allclose(step["points"], frame.positions(surface), atol=1e-7)
    np.testing.assert_array_equal(step["faces"], frame.faces(surface))
    assert step["cells"] == len(frame.faces(surface))
    # Warped by the displacement and -1 it is the reference sheet.
    np.testing.assert_allclose(step["points"] - step["fields"]["displacement"], surface.points, atol=1e-6)
    expected = {"displacement": frame.displacement, "velocity": frame.velocity, **frame.point_data}
    expected["reference_position"] = surface.points
    if frame.damage is not None:
        expected["damage"] = frame.damage
    assert set(step["fields"]) == set(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(step["fields"][name], values, rtol=1e-6, atol=1e-6, err_msg=name)
    if frame.bodies is not None:
        assert step["pose_ball"].GetTuple(0) == pytest.approx(frame.bodies[0])


# Also backwards and leaping: the reader must find each step without having read the one before.
@pytest.mark.parametrize("order", [range(FRAMES), range(FRAMES - 1, -1, -1), [0, FRAMES - 1, 2]])
def test_vtk_reads_every_step(tmp_path: Path, order) -> None:
    path = tmp_path / "frames.vtkhdf"
    surface = write_all(path)
    reader = Reader(path)
    assert reader.steps == FRAMES
    for index in order:
        assert_step_is_frame(reader.at(index), surface, make_frame(surface, index))
    assert [entry.name for entry in tmp_path.iterdir()] == ["frames.vtkhdf"]


BOX = Body("box", "box", (1.0,), np.eye(3), np.array([[0, 1, 2]]))
POSES = np.array([[0.0, 0.0, 0.1 * k, 0.0, 0.0, np.sin(0.2 * k), np.cos(0.2 * k)] for k in range(FRAMES)])


def with_bodies(surface: Surface, at: int) -> Frame:
    frame = make_frame(surface, at)
    return replace(frame, bodies=np.vstack([frame.bodies, POSES[at]]))


def test_vtk_reads_the_bodies_where_they_are_in_every_frame(tmp_path: Path) -> None:
    path, surface = tmp_path / "bodies.vtkhdf", make_surface(bodies=(BALL, BOX))
    series = BodySeries(path, surface)
    for index in range(FRAMES):
        series.write(with_bodies(surface, index))
    reader = Reader(path)
    assert reader.steps == FRAMES
    for index in (0, 5, FRAMES - 1):
        step, frame = reader.at(index), with_bodies(surface, index)
        of_box = step["fields"]["body"] == 1
        np.testing.assert_allclose(step["points"][of_box], BOX.placed(POSES[index]), atol=1e-7)
        shell = step["points"][~of_box] - frame.bodies[0, :3]
        np.testing.assert_allclose(np.linalg.norm(shell, axis=1), 0.05, atol=1e-7)
        assert step["time"] == pytest.approx(frame.time)
    assert read_series(path).metadata["bodies"] == "ball, box"


def test_frame_with_what_is_optional_left_out(tmp_path: Path) -> None:
    path, surface = tmp_path / "frames.vtkhdf", make_surface(bodies=())
    left_out = {"intact_faces": None, "damage": None, "bodies": None, "point_data": {}}
    series = VtkHdfSeries(path, surface)
    for index in range(3):
        series.write(make_frame(surface, index, **left_out))
    reader = Reader(path)
    for index in range(3):
        assert_step_is_frame(reader.at(index), surface, make_frame(surface, index, **left_out))
    with h5py.File(path) as file:
        assert len(file["VTKHDF/Polygons/Connectivity"]) == 3 * 40


def test_all_faces_torn(tmp_path: Path) -> None:
    path, surface = tmp_path / "frames.vtkhdf", make_surface()
    frames = [
        make_frame(surface, 0),
        make_frame(surface, 1, intact_faces=np.zeros(40, bool)),
        make_frame(surface, 2, intact_faces=np.zeros(40, bool)),
    ]
    series = VtkHdfSeries(path, surface)
    for frame in frames:
        series.write(frame)
    reader = Reader(path)
    for index in (2, 1, 0):
        assert_step_is_frame(reader.at(index), surface, frames[index])


def test_triangles_are_stored_when_they_change(tmp_path: Path) -> None:
    surface = write_all(tmp_path / "frames.vtkhdf")
    faces = [make_frame(surface, index).faces(surface) for index in range(FRAMES)]
    stored = [faces[0]] + [later for earlier, later in itertools.pairwise(faces) if len(earlier) != len(later)]
    assert 1 < len(stored) < FRAMES
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        np.testing.assert_array_equal(file["VTKHDF/Polygons/NumberOfCells"], [len(each) for each in stored])
        assert len(file["VTKHDF/Polygons/Connectivity"]) == sum(each.size for each in stored)


def test_triangles_torn_in_the_same_array_are_gone(tmp_path: Path) -> None:
    surface, path = make_surface(), tmp_path / "frames.vtkhdf"
    intact = np.ones(len(surface.faces), bool)
    series = VtkHdfSeries(path, surface)
    for index in range(3):
        intact[:index] = False
        series.write(make_frame(surface, index, intact_faces=intact))
    assert read_series(path).faces.tolist() == [len(surface.faces) - index for index in range(3)]


def test_info(tmp_path: Path) -> None:
    surface = write_all(tmp_path / "frames.vtkhdf")
    info = read_series(tmp_path / "frames.vtkhdf")
    assert info.frames == FRAMES and info.points == 30
    np.testing.assert_allclose(info.times, 0.01 * np.arange(FRAMES))
    assert info.faces.tolist() == [len(make_frame(surface, i).faces(surface)) for i in range(FRAMES)]
    assert set(info.fields) == {"displacement", "velocity", "damage", "stress", "force", "bonds", "held"}
    positions = "deformed; reference_position + displacement"
    known = {"title": "tear", "positions": positions, "version": "1", "points": 30}
    assert info.metadata == known
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        assert file["VTKHDF/PointData/reference_position"].shape == (30, 3)


def test_every_frame_is_on_disk_when_write_returns(tmp_path: Path) -> None:
    path, surface = tmp_path / "frames.vtkhdf", make_surface()
    series = VtkHdfSeries(path, surface)
    for index in range(3):
        series.write(make_frame(surface, index))
        assert read_series(path).frames == index + 1
        reader = Reader(path)
        assert reader.steps == index + 1
        assert_step_is_frame(reader.at(index), surface, make_frame(surface, index))


def test_read_frame_is_what_vtk_reads(tmp_path: Path) -> None:
    path = tmp_path / "frames.vtkhdf"
    write_all(path)
    reader = Reader(path)
    for index in range(FRAMES):
        time, points, triangles, fields = read_frame(path, index)
        step = reader.at(index)
        assert time == step["time"]
        np.testing.assert_array_equal(points, step["points"])
        np.testing.assert_array_equal(triangles, step["faces"])
        assert set(fields) == set(step["fields"]) - {"reference_position"}
        for name, values in fields.items():
            np.testing.assert_array_equal(values, step["fields"][name])


def test_killed_run_leaves_every_frame(tmp_path: Path) -> None:
    path = tmp_path / "frames.vtkhdf"
    torn_frames.write_until_killed(VtkHdfSeries, path, 20, make_frame)
    surface, frames = make_surface(), read_series(path).frames
    assert frames > 20
    write_all(path, frames, frames + 2, append_from=frames)
    reader = Reader(path)
    assert reader.steps == frames + 2
    for index in range(frames + 2):
        assert_step_is_frame(reader.at(index), surface, make_frame(surface, index))


def contents(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}

    def add(name: str, member: Any) -> None:
        if isinstance(member, h5py.Dataset):
            found[name] = (member.dtype, member[()].tolist())
        for key, value in member.attrs.items():
            found[f"{name}@{key}"] = np.asarray(value).tolist()

    with h5py.File(path) as file:
        file.visititems(add)
    return found


@pytest.mark.parametrize("first", [1, 4])
def test_appending_equals_writing_in_one_go(tmp_path: Path, first: int) -> None:
    write_all(tmp_path / "in_one_go.vtkhdf")
    parts, surface = tmp_path / "parts.vtkhdf", make_surface()
    series = VtkHdfSeries(parts, surface)
    for index in range(FRAMES):
        healthy = index < first
        changes = {} if healthy else {"damage": np.ones(30), "intact_faces": np.arange(40) == index}
        series.write(make_frame(surface, index, **changes))
    write_all(parts, first, append_from=first)
    assert contents(parts) == contents(tmp_path / "in_one_go.vtkhdf")
    assert "VTKHDF/Steps@NSteps" in contents(parts)


def test_rows_of_a_frame_that_failed_are_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_all(tmp_path / "in_one_go.vtkhdf", last=3)
    path, surface = tmp_path / "frames.vtkhdf", make_surface()
    series = VtkHdfSeries(path, surface)
    series.write(make_frame(surface, 0))
    series.write(make_frame(surface, 1))
    with monkeypatch.context() as patch:
        # A kill at the worst moment, between two writes.
        patch.setattr("warp_pd.output.vtkhdf._before_last", interrupt)
        with pytest.raises(KeyboardInterrupt):
            series.write(make_frame(surface, 2, intact_faces=np.zeros(40, bool)))
    assert Reader(path).steps == 2
    assert_step_is_frame(Reader(path).at(1), surface, make_frame(surface, 1))
    series.write(make_frame(surface, 2))
    assert contents(path) == contents(tmp_path / "in_one_go.vtkhdf")


def interrupt(*_arguments) -> None:
    raise KeyboardInterrupt


def test_a_new_series_removes_the_old_one(tmp_path: Path) -> None:
    write_all(tmp_path / "frames.vtkhdf")
    VtkHdfSeries(tmp_path / "frames.vtkhdf", make_surface())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"damage": np.zeros(30)}, "damage"),
        ({"reference_position": np.zeros((30, 3))}, "reference_position"),
        ({"a/b": np.zeros(30)}, "a/b"),
        ({"stress": np.zeros((30, 9))}, "stress"),
    ],
)
def test_fields_that_a_file_cannot_hold_are_refused_in_one_line(fields, names: str) -> None:
    with pytest.raises(ValueError, match=names) as caught:
        point_fields(make_frame(make_surface(), 1, point_data=fields))
    assert "expected" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("first", [3, -1])
def test_a_file_that_does_not_go_on_is_refused_in_one_line(tmp_path: Path, first: int) -> None:
    write_all(tmp_path / "short.vtkhdf", last=2)
    with pytest.raises(ValueError, match="expected 0 to 2"):
        VtkHdfSeries(tmp_path / "short.vtkhdf", make_surface(), append_from=first)


def not_hdf5(path: Path) -> None:
    path.write_text("time,damage\n0,0\n", encoding="utf-8")


def cut_short(path: Path) -> None:
    write_all(path)
    path.write_bytes(path.read_bytes()[:20000])


def of_another_program(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["temperature"] = np.zeros(3)


def without_rows(path: Path) -> None:
    write_all(path)
    with h5py.File(path, "r+") as file:
        file["VTKHDF/PointData/velocity"].resize(30, axis=0)


@pytest.mark.parametrize("spoil", [not_hdf5, cut_short, of_another_program, without_rows])
def test_info_refuses_damaged_and_foreign_files_in_one_line(tmp_path: Path, spoil) -> None:
    path = tmp_path / "frames.vtkhdf"
    spoil(path)
    with pytest.raises(ValueError, match=str(path)) as caught:
        read_series(path)
    assert "expected" in str(caught.value) and "\n" not in str(caught.value)


def test_info_of_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="expected"):
        read_series(tmp_path / "frames.vtkhdf")
