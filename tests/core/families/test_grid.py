"""Families of a grid with gaps are those of the same sheet as a cloud."""

from dataclasses import replace

import numpy as np
import pytest
from grid_sheets import holed, partly_off_the_grid
from helpers import refused, square

from warp_pd import Sheet
from warp_pd.families import build_families, unpack


def outlined(cracks=()):
    """A square whose outline fits the grid, with a round hole that does not."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = (0.045, 0.05) + 0.012 * np.column_stack([np.cos(angle), np.sin(angle)])
    corners = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
    return Sheet.outline(corners, holes=[ring], cracks=cracks, thickness=1e-3, density=1000.0, spacing=0.1 / 30)


SHEETS = {
    "outline": outlined,
    "outline with a crack": lambda: outlined([[(0.1, 0.05), (0.075, 0.061)]]),
    "hole": holed,
    "two holes": lambda: square(31).hole((0.03, 0.05), 0.011).hole((0.08, 0.03), 0.006),
    "cut beside a hole": lambda: holed().cut((0.062, 0.0533), (0.101, 0.057)),
    "points off the grid": partly_off_the_grid,
    "edges inside": lambda: replace(holed(), barriers=np.array([[300, 301], [301, 300]], np.int32)),
}


@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
@pytest.mark.parametrize("name", SHEETS)
def test_families_are_those_of_the_cloud(name, horizon):
    sheet = SHEETS[name]()
    grid, cloud = (build_families(s, horizon, "linear") for s in (sheet, sheet.as_cloud()))
    assert (grid.layout, cloud.layout) == ("grid", "cloud")
    everyone = np.arange(sheet.size)
    n = cloud.members
    members = grid.members_of(everyone)
    assert (members[:, n:] == -1).all()
    np.testing.assert_array_equal(members[:, :n], cloud.members_of(everyone))
    i, k = np.nonzero(cloud.exists)
    np.testing.assert_array_equal(grid.reverse_members(i, k), cloud.reverse_members(i, k))
    assert grid.bond_count == cloud.bond_count and grid.reference_area == cloud.reference_area
    for table in ("bonds", "influence", "member_areas"):
        values = grid.rows_of_points(getattr(grid, table))
        np.testing.assert_allclose(values[i, k], getattr(cloud, table)[i, k], rtol=0.0, atol=1e-12)
    common = unpack(grid.rows_of_points(grid.common), grid.members)
    np.testing.assert_array_equal(common[:, :n, :n], unpack(cloud.common, n))
    np.testing.assert_allclose(grid.areas[grid.family_class], cloud.areas, rtol=1e-12)
    np.testing.assert_array_equal(grid.severed[grid.family_class], cloud.severed)
    inverse, size = (grid.rows_of_points(values)[:, :n] for values in grid.inverse_shapes())
    expected, expected_size = cloud.inverse_shapes()
    np.testing.assert_allclose(inverse, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(size, expected_size, rtol=1e-12)


def test_points_with_a_row_of_their_own_are_few():
    for horizon, corrected, least in ((1.5, 0, 0.8), (2.015, 0, 0.7), (3.15, 0, 0.6), (2.015, 1, 0.6)):
        families = build_families(square(101).hole((0.05, 0.05), 0.016), horizon, "linear", corrected)
        deep = families.family_class == 0
        assert deep.mean() > least
        assert len(families.exists) == 1 + (~deep).sum()


def test_indices_of_bonded_points_differ_by_little():
    sheet = holed(21)
    for families in (build_families(s, 2.015, "linear") for s in (sheet, sheet.as_cloud(), square(21))):
        members = families.members_of(np.arange(families.points))
        apart = np.abs(members - np.arange(families.points)[:, None])[members >= 0]
        assert families.index_reach() == apart.max()


def test_stiffness_other_than_that_of_most_points_has_rows():
    sheet = holed()
    stiff = sheet.stiffened(sheet.where(lambda x, y: x > 0.07), 3.0)
    families = build_families(stiff, 1.5, "linear")
    np.testing.assert_array_equal(families.factors[families.family_class], stiff.stiffness)
    assert (families.family_class == 0).sum() < (build_families(sheet, 1.5, "linear").family_class == 0).sum()


def test_a_grid_out_of_order_is_refused():
    sheet = holed()
    turned_about = replace(sheet, points=sheet.points[::-1], areas=sheet.areas[::-1], grid=sheet.grid[::-1])
    with refused(match=r"sheet\.grid: expected points on the grid in order"):
        build_families(turned_about, 2.015, "linear")


def test_points_beside_their_places_have_rows_of_their_own():
    sheet = holed()
    middle = sheet.nearest(0.02, 0.08)
    points = sheet.points.copy()
    points[middle] += 1e-6 * sheet.spacing
    families, before = (build_families(replace(sheet, points=p), 1.5, "linear") for p in (points, sheet.points))
    assert before.family_class[middle] == 0 < families.family_class[middle]
