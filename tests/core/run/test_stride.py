"""Frames of some points: every n-th column and row of a lattice; test_processes.py has them on several processes."""

import itertools

import numpy as np
import pytest
from helpers import StopAt, refused
from resumed_runs import restarts_at_every_frame
from shared_scenes import scene

from warp_pd import Frames
from warp_pd.run.recorder import FramePoints
from warp_pd.run.runner import require_gatherable


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone") / "torn"
    assert scene("torn", frames=4).run(device="cpu", out=folder, usd=False).status == "finished"
    return folder


@restarts_at_every_frame
def test_frames_of_every_fifth_column_and_row(alone, tmp_path):
    folder, options = tmp_path / "out", {"device": "cpu", "out": tmp_path / "out", "usd": False, "stride": 5}
    assert scene("torn", frames=4).run(**options, writers=[StopAt(2)]).status == "interrupted"
    resumed = scene("torn", frames=4).run(**options, resume=True)
    found, whole = Frames(folder), Frames(alone)
    places = np.append(np.arange(0, 33, 5), 32)
    kept = (33 * places[:, None] + places).ravel()
    assert found.points == len(kept) and len(found) == 5 and resumed.frame.displacement.shape == (len(kept), 3)
    for some, every in zip(found, whole, strict=True):
        np.testing.assert_array_equal(some.positions, every.positions[kept])
        for name in whole.fields:
            np.testing.assert_array_equal(some[name], every[name][kept], err_msg=name)
        require_torn_where_the_sheet_is(some.triangles, every.triangles, places)
    assert len(found[-1].triangles) < len(found[0].triangles) < 2 * (len(places) - 1) ** 2
    # Measures see all points.
    assert (folder / "history.csv").read_text() == (alone / "history.csv").read_text()
    with refused(match="stride = 4: expected 5"):
        scene("torn", frames=4).run(**{**options, "stride": 4}, resume=True)


def require_torn_where_the_sheet_is(coarse, fine, places):
    """Cells of the coarser lattice have both triangles where all triangles of the sheet in them are intact, or none."""
    intact = np.zeros((32, 32), int)
    row, column = np.divmod(fine, 33)
    np.add.at(intact, (row.min(axis=1), column.min(axis=1)), 1)
    there = np.zeros((len(places) - 1,) * 2, int)
    row, column = np.divmod(coarse, len(places))
    np.add.at(there, (row.min(axis=1), column.min(axis=1)), 1)
    for k, (low, high) in enumerate(itertools.pairwise(places)):
        for j, (left, right) in enumerate(itertools.pairwise(places)):
            assert there[k, j] == (2 if (intact[low:high, left:right] == 2).all() else 0)


def test_a_stride_that_leaves_only_edges_is_refused():
    with refused(match="stride = 17: expected at most 16 on a lattice of 33 x 33 points"):
        scene("torn").run(device="cpu", stride=17)


def test_a_cloud_has_whole_frames():
    with refused(match="stride = 2: expected 1 for a sheet that is not a lattice"):
        scene("cloud").run(device="cpu", stride=2)


def test_more_points_than_one_process_holds_are_refused_with_what_to_do():
    built = scene("torn").build(device="cpu")
    require_gatherable(FramePoints(built), True, most=33 * 33)
    with refused(match=r"frames of 1089 points: expected at most 1000 .* \(--stride\)"):
        require_gatherable(FramePoints(built), False, most=1000)
    with refused(match=r"restart files of 1089 points: expected at most 1000 .* \(--no-restart\)"):
        require_gatherable(FramePoints(built, 2), True, most=1000)
    with refused(match="measures of 1089 points: expected at most 1000"):
        require_gatherable(FramePoints(built, 2), False, most=1000)
