"""Sheets that are drawn with fewer points."""

import numpy as np
import pytest
from helpers import jittered, square

from warp_pd.viewer.coarsen import clusters, contracted, drawn

SIZE = 0.1


def coarse(points, frames, most):
    """The sheet as it is drawn, and the area of its intact triangles at each frame."""
    cluster = clusters(points, frames[0], frames[-1], most)
    sheet = drawn([contracted(triangles, cluster) for triangles in frames], len(points))
    return sheet, [area(points, sheet.points[sheet.triangles[intact]]) for intact in sheet.intact]


def area(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def normals(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)[:, 2]


def same_triangles(a, b):
    def turned(t):
        return {tuple(np.roll(row, -int(row.argmin()))) for row in t}

    return turned(a) == turned(b)


def test_a_small_sheet_keeps_every_triangle_and_its_side():
    sheet = jittered(9)
    found, _ = coarse(sheet.positions, [sheet.triangles, sheet.triangles[5:]], 81)
    assert same_triangles(found.points[found.triangles], sheet.triangles)
    assert same_triangles(found.points[found.triangles[found.intact[1]]], sheet.triangles[5:])


@pytest.mark.parametrize("sheet", [square(61), jittered(61, share=0.3)], ids=["lattice", "cloud"])
def test_the_area_stays(sheet):
    """Exactly on a lattice, whose edges keep points and where no triangle is turned over."""
    found, areas = coarse(sheet.positions, [sheet.triangles], 400)
    assert 250 < len(found.points) < 600
    assert areas[0] == pytest.approx(SIZE**2, rel=1e-6 if sheet.lattice is not None else 0.02)
    if sheet.lattice is not None:
        assert np.all(normals(sheet.positions, found.points[found.triangles]) > 0.0)


@pytest.mark.parametrize("row", [27, 28, 29])
def test_a_crack_is_drawn_where_it_is(row):
    """No wider than a drawn triangle, whichever way it runs through the clusters, of three rows each."""
    sheet = square(61)
    height = (row + 0.5) * sheet.spacing
    centres = sheet.positions[sheet.triangles].mean(axis=1)
    across = (np.abs(centres[:, 1] - height) < 0.5 * sheet.spacing) & (centres[:, 0] < 0.5 * SIZE)
    found, (before, after) = coarse(sheet.positions, [sheet.triangles, sheet.triangles[~across]], 400)
    assert before == pytest.approx(SIZE**2, rel=1e-6)
    assert 0.9 <= (before - after) / area(sheet.positions, sheet.triangles[across]) <= 3.1
    # No triangle of the torn sheet reaches across, so that the faces of the crack can move apart.
    corners = sheet.positions[found.points[found.triangles[found.intact[1]]]]
    left = corners[(corners[:, :, 0] < 0.4 * SIZE).all(axis=1), :, 1]
    assert not np.any((left.min(axis=1) < height) & (left.max(axis=1) > height))


def test_points_that_a_wide_tear_leaves_loose_stand_for_no_face():
    """They fly away; a face that is drawn at such a point would follow it."""
    sheet = square(61)
    centres = sheet.positions[sheet.triangles].mean(axis=1)
    left = sheet.triangles[np.abs(centres[:, 1] - 0.45 * SIZE) > 3.0 * sheet.spacing]
    found, (before, after) = coarse(sheet.positions, [sheet.triangles, left], 200)
    assert before == pytest.approx(SIZE**2, rel=1e-6) and after == pytest.approx(area(sheet.positions, left), rel=0.02)
    assert np.isin(found.points[found.triangles[found.intact[1]]], left).all()
    assert len(found.points) < 350


def test_sheets_that_lie_close_are_not_joined():
    below = square(41).positions
    above = below + [0.0, 0.0, 1e-5]
    triangles = np.concatenate([square(41).triangles, square(41).triangles + len(below)])
    points = np.concatenate([below, above])
    found, areas = coarse(points, [triangles], 300)
    assert areas[0] == pytest.approx(2.0 * SIZE**2, rel=1e-6)
    assert {tuple(row) for row in found.points[found.triangles] >= len(below)} == {(True,) * 3, (False,) * 3}


def test_a_sheet_in_shreds_is_drawn_with_few_points_all_the_same():
    sheet = square(61)
    kept = np.random.default_rng(0).random(len(sheet.triangles)) < 0.02
    found, areas = coarse(sheet.positions, [sheet.triangles, sheet.triangles[kept]], 400)
    assert len(found.points) < 700
    assert areas[0] == pytest.approx(SIZE**2, rel=1e-6) and areas[1] < 0.3 * areas[0]


def test_triangles_that_come_back_are_drawn():
    sheet = square(9)
    found, areas = coarse(sheet.positions, [sheet.triangles[3:], sheet.triangles], 81)
    assert areas[1] == pytest.approx(SIZE**2) and areas[0] < areas[1]
    assert len(found.triangles) == len(sheet.triangles)


def test_a_row_of_points_keeps_them():
    points = np.column_stack([np.arange(7.0), np.zeros((7, 2))])
    found, _ = coarse(points, [np.zeros((0, 3), np.int64)] * 2, 100)
    assert list(found.points) == list(range(7)) and found.intact.shape == (2, 0)
