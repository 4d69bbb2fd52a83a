"""Holes and stiffer parts of a sheet: areas and stiffness of its points."""

import numpy as np
import pytest
from helpers import refused, square

from warp_pd import Place


def test_a_hole_shrinks_areas():
    complete = square(41)
    holed = complete.hole((0.05, 0.05), 0.02)
    removed = complete.areas.sum() - holed.areas.sum()
    assert removed == pytest.approx(np.pi * 0.02**2, rel=0.15)
    assert holed.lattice is None and holed.size < complete.size


def test_a_rim_of_steps_is_noted():
    """A hole of four spacings is 1.19 times its circle; one in the edge, and a fine one, say nothing."""
    (note,) = square(21).hole((0.05, 0.05), 0.02).notes
    assert note.startswith("hole at (0.05, 0.05) of radius 0.02: its rim has steps and encloses 1.19 times its circle")
    assert square(21).hole((0.0, 0.05), 0.02).notes == () and square(401).hole((0.05, 0.05), 0.03).notes == ()
    both = square(41).hole((0.03, 0.05), 0.01).hole((0.07, 0.05), 0.01)
    assert len(both.notes) == 2


def test_points_beside_holes_keep_their_places_on_the_grid():
    complete = square(41)
    holed = complete.hole((0.03, 0.05), 0.01).hole((0.07, 0.05), 0.01).cut((0.0, 0.011), (0.02, 0.011))
    np.testing.assert_allclose(holed.spacing * holed.grid, holed.points, atol=1e-15)
    assert holed.layout == "grid" and complete.layout == "lattice"
    assert holed.as_cloud().grid is None and holed.turned(90.0).layout == "cloud"
    oblong = square(size=0.1, points=(41, 40)).hole((0.05, 0.05), 0.02)
    assert oblong.grid is None and oblong.layout == "cloud"


def test_a_second_hole_leaves_whole_cells_around_points():
    holed = square(41).hole((0.03, 0.05), 0.01).hole((0.07, 0.05), 0.01)
    at_once = square(41).hole((0.07, 0.05), 0.01).hole((0.03, 0.05), 0.01)
    cells = holed.areas / holed.spacing**2
    assert set(np.round(cells, 9)) == {0.25, 0.5, 0.75, 1.0}
    np.testing.assert_array_equal(holed.areas, at_once.areas)
    np.testing.assert_array_equal(holed.triangles, at_once.triangles)


def test_stiffness_goes_with_its_points():
    sheet = square(21).stiffened([0, 5], 2.0).stiffened([5], 3.0)
    assert sheet.stiffness[[0, 1, 5]].tolist() == [2.0, 1.0, 6.0]
    holed = sheet.hole((0.05, 0.05), 0.02)
    kept = [int(np.flatnonzero((sheet.points == p).all(axis=1))[0]) for p in holed.points]
    assert holed.size < sheet.size and (holed.stiffness == sheet.stiffness[kept]).all()
    assert square(5).stiffness is None


@pytest.mark.parametrize(
    ("points", "factor", "message"),
    [
        ([0], 0.0, r"^stiffened: factor = 0\.0"),
        ([81], 2.0, "contains point 81"),
        ([], 2.0, r"^stiffened: points = \[\]: expected at least one"),
    ],
)
def test_wrong_stiffness_is_named(points, factor, message):
    with refused(match=message):
        square(9).stiffened(points, factor)


def test_a_place_turns_right_handed_about_an_axis_of_any_length():
    place = Place((1.0, 2.0, 3.0), axis=(0.0, 0.0, 2.0), degrees=90.0)
    assert place.of(np.array([[1.0, 0.0, 5.0]])) == pytest.approx(np.array([[1.0, 3.0, 8.0]]))
