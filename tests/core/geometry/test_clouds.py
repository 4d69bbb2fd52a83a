"""Holes of clouds: named, or noted where triangles cover them."""

import numpy as np
import pytest
from helpers import refused

from warp_pd import Circle, InputError, Sheet

SOLID = {"thickness": 1e-3, "density": 1000.0}
RIM, HOLE = Circle((0.0, 0.0), 0.05), Circle((0.005, 0.0), 0.015)
RING = Sheet.outline(RIM, holes=[HOLE], spacing=0.0035, **SOLID)


def test_an_outline_covers_holes_with_a_note():
    sheet = Sheet.from_points(RING.points, outline=RIM, **SOLID)
    assert sheet.areas.sum() > 1.09 * RING.areas.sum()
    assert "a hole or notch of the points is covered" in sheet.notes[0] and len(sheet.notes) == 1


@pytest.mark.parametrize("outline", [None, RIM])
@pytest.mark.parametrize(("holes", "name"), [([HOLE], "hole 1"), ({"hub": HOLE}, "hub")])
def test_named_holes_stay_open(outline, holes, name):
    sheet = Sheet.from_points(RING.points, outline=outline, holes=holes, **SOLID)
    assert sheet.areas.sum() == pytest.approx(RING.areas.sum(), rel=2e-4) and sheet.notes == ()
    assert list(sheet.parts) == ["outline", name]
    assert sheet.parts[name].tolist() == RING.parts["hole 1"].tolist()


def test_small_holes_are_open_and_those_without_a_curve_keep_numbers():
    """A hole of four spacings that the Delaunay triangulation would close, named, beside a wide one."""
    points = Sheet.rectangle(0.1, 0.1, points=41, **SOLID).points
    small, wide = (
        np.linalg.norm(points - centre, axis=1) < radius
        for centre, radius in (((0.02, 0.02), 0.0049), ((0.06, 0.06), 0.02))
    )
    sheet = Sheet.from_points(points[~small & ~wide], holes={"eye": Circle((0.02, 0.02), 0.0045)}, **SOLID)
    assert set(sheet.parts) == {"outline", "eye", "hole 1"}
    assert np.linalg.norm(sheet.points[sheet.parts["eye"]] - 0.02, axis=1).max() < 0.0075


def test_clouds_without_holes_have_no_note():
    for sheet in (
        Sheet.filled(0.1, 0.1, points=21, jitter=0.3, **SOLID),
        Sheet.from_points(Sheet.rectangle(0.1, 0.05, points=(11, 21), **SOLID).points, **SOLID),
        Sheet.from_points(Sheet.filled(0.1, 0.1, points=21, turn=20.0, **SOLID).points, **SOLID),
    ):
        assert sheet.notes == ()


def test_wrong_holes():
    with refused(match="holes and triangles: expected only one of them"):
        Sheet.from_points(RING.points, triangles=RING.triangles, holes=[HOLE], **SOLID)
    with refused(match="hole 1: no triangle of the points lies in it"):
        Sheet.from_points(RING.points, holes=[Circle((-0.03, 0.0), 0.0002)], **SOLID)
    with refused(match=r"points\[\d+\] at .* has no triangle inside the outline or outside holes"):
        Sheet.from_points(RING.points, holes=[Circle((-0.03, 0.0), 0.01)], **SOLID)


@pytest.mark.parametrize(("radius", "covered"), [(2.3, True), (2.7, False)])
def test_holes_are_covered_up_to_two_and_a_half_spacings_of_radius(radius, covered):
    grid = Sheet.rectangle(0.2, 0.2, points=21, **SOLID).points - 0.1
    ring = 0.01 * radius * np.column_stack([np.cos(t := np.arange(16) * np.pi / 8.0), np.sin(t)])
    outside = grid[np.hypot(*grid.T) > 0.01 * (radius + 0.5)]
    sheet = Sheet.from_points(np.concatenate([outside, ring]), spacing=0.01, **SOLID)
    hole = 8.0 * np.sin(np.pi / 8.0) * (0.01 * radius) ** 2
    assert sheet.areas.sum() == pytest.approx(0.04 - (0.0 if covered else hole), rel=1e-9)


@pytest.mark.parametrize("grid", [{}, {"turn": 20.0}, {"jitter": 0.2}], ids=["lattice", "turned", "jittered"])
def test_a_filled_rectangle_has_whole_areas_if_asked(grid):
    sheet = Sheet.filled(0.1, 0.1, points=11, layers=(1, 0), areas="whole", **grid, **SOLID)
    np.testing.assert_allclose(sheet.areas, 1e-4, rtol=1e-12)
    with pytest.raises(InputError, match="areas = 'half'"):
        Sheet.filled(0.1, 0.1, points=11, areas="half", **grid, **SOLID)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (500e3, 4.5e6), (-500e3, -4.5e6)])
def test_a_cloud_at_survey_coordinates_has_its_triangles(shift):
    """Squares of coordinates of 4500 km keep no digits of spacings of 5 mm."""
    near = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=21)
    sheet = Sheet.from_points(near.points + np.array(shift), thickness=1e-3, density=1e3)
    assert len(sheet.triangles) == 800
    assert sheet.areas.sum() == pytest.approx(0.01, rel=1e-6)
    assert len(sheet.edges("outline")) == 80
