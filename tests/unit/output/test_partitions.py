"""Frames in a file for each process, joined: the readers of this package and ParaView's see one file."""

import itertools

import numpy as np
import pytest

from warp_pd import Frames, InputError, Sheet
from warp_pd.interfaces.frame import Frame, Surface
from warp_pd.output.partitions import JoinedSeries, segments_of
from warp_pd.output.series import Segment, file_of
from warp_pd.output.vtkhdf import VtkHdfSeries

SHEET = Sheet.rectangle(1.0, 0.75, points=(9, 7), thickness=1e-3, density=1000.0)
FRAMES = 5


def frame(index, points, faces):
    """A frame of points that follow each other; a triangle more is torn each time."""
    x, y = SHEET.points[points].T
    u = np.column_stack([0.1 * index * x, 0.2 * index * y, index * x * y]).astype(np.float32)
    intact = faces >= 3 * max(index - 1, 0)
    return Frame(index, 0.5 * index, u, 2.0 * u, intact, np.full(len(x), 0.1 * index), point_data={"number": points})


def written(folder, bounds, first, last, earlier=()):
    """Frames first to last - 1 of processes that own the points between some bounds."""
    (folder / "parts").mkdir(exist_ok=True)
    lowest = SHEET.triangles.min(axis=1)
    own = tuple(int(n) for n in np.diff(bounds))
    segment = Segment(first, tuple(file_of(first, rank) for rank in range(len(own))), own)
    parts = []
    for rank, (begin, end) in enumerate(itertools.pairwise(bounds)):
        faces = np.flatnonzero((lowest >= begin) & (lowest < end))
        points = np.arange(begin, min(end + 10, SHEET.size))
        surface = Surface(SHEET.positions[points], SHEET.triangles[faces] - begin)
        series = VtkHdfSeries(folder / segment.files[rank], surface)
        # Only the last one joins them: all others have written by then.
        joined = JoinedSeries(
            folder / "frames.vtkhdf", series, [*earlier, segment], rank == len(own) - 1, lambda work: work()
        )
        parts.append((joined, points, faces))
    for index in range(first, last):
        for joined, points, faces in parts:
            joined.write(frame(index, points, faces))
    return segment


@pytest.fixture
def folder(tmp_path):
    """Frames of two processes up to the third, and of three from there on."""
    begun = written(tmp_path, [0, 25, 63], 0, 3)
    # The third frame is written anew.
    written(tmp_path, [0, 18, 40, 63], 2, FRAMES, [begun])
    return tmp_path


def test_they_are_the_frames_of_one_process(folder, tmp_path):
    alone = VtkHdfSeries(tmp_path / "alone.vtkhdf", Surface(SHEET.positions, SHEET.triangles))
    for index in range(FRAMES):
        alone.write(frame(index, np.arange(SHEET.size), np.arange(len(SHEET.triangles))))
    found, expected = Frames(folder), Frames(alone.path)
    assert len(found) == FRAMES and found.points == SHEET.size and found.fields == expected.fields
    for one, other in zip(found, expected, strict=True):
        assert one.time == other.time
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.triangles, other.triangles)
        for name in expected.fields:
            assert one[name].dtype == other[name].dtype
            np.testing.assert_array_equal(one[name], other[name])
    assert [segment.first for segment in segments_of(folder / "frames.vtkhdf")] == [0, 2]
    assert segments_of(alone.path) is None


def test_vtk_reads_them(folder):
    """The reader of ParaView: a part for each process, and all triangles where they are."""
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(folder / "frames.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == FRAMES
    for index, other in enumerate(Frames(folder)):
        reader.SetStep(index)
        reader.Update()
        data = reader.GetOutputDataObject(0)
        pieces = [data.GetPartition(k) for k in range(data.GetNumberOfPartitions())]
        assert len(pieces) == (2 if index < 2 else 3)
        seen = []
        for piece in pieces:
            corners = numpy_support.vtk_to_numpy(piece.GetPolys().GetConnectivityArray()).reshape(-1, 3)
            numbers = numpy_support.vtk_to_numpy(piece.GetPointData().GetArray("number"))
            places = numpy_support.vtk_to_numpy(piece.GetPoints().GetData())
            np.testing.assert_array_equal(places, other.positions[numbers])
            seen.append(numbers[corners])
        np.testing.assert_array_equal(np.concatenate(seen), other.triangles)


def test_a_lost_or_short_part_is_refused_by_name(folder, tmp_path):
    part = folder / "parts" / "frames.2.1.vtkhdf"
    part.rename(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"parts/frames.2.1.vtkhdf, which holds a part of the points, is missing"):
        Frames(folder)
    # What another run left under this name, with too few frames.
    other = VtkHdfSeries(part, Surface(SHEET.positions[18:50], SHEET.triangles[:1]))
    other.write(frame(0, np.arange(18, 50), np.arange(1)))
    with pytest.raises(InputError, match=r"frames.2.1.vtkhdf, which holds a part of the points, has less than 3"):
        Frames(folder)
