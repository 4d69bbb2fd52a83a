"""Cracks: two faces, one tip, no bond across; on a row of points they belong to neither side."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from warp_pd import Sheet
from warp_pd.families import build_families
from warp_pd.shapes.curves import Circle

SQUARE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
SPACING = 0.005


def cracked(*paths, boundary=SQUARE, **parts):
    return Sheet.outline(boundary, spacing=SPACING, cracks=list(paths), thickness=1e-3, density=1000.0, **parts)


def bonds_of(sheet, horizon=3.15):
    families = build_families(sheet, horizon, "linear", intersections=False)
    members = families.members_of(np.arange(sheet.size))
    tail = np.repeat(np.arange(sheet.size), members.shape[1])
    return np.column_stack([tail, members.ravel()])[members.ravel() >= 0]


def turn(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def faces(sheet, name="crack 1"):
    tips = sheet.parts.get(f"{name} tips", np.zeros(0, int))
    return (np.setdiff1d(sheet.parts[f"{name} {side}"], tips) for side in ("left", "right"))


@pytest.mark.parametrize(
    "path",
    [
        [(0.02, 0.05), (0.08, 0.05)],
        [(0.0231, 0.0488), (0.0812, 0.0567)],
        [(0.02, 0.03), (0.05, 0.06), (0.08, 0.04)],
        [(0.0, 0.05), (0.06, 0.05)],
        [(0.0, 0.0), (0.05, 0.05)],
        [(0.0, 0.0523), (0.1, 0.0581)],
        [(0.0212, 0.1), (0.0212, 0.04), (0.06, 0.02)],
    ],
    ids=["on a row", "askew", "polyline", "from an edge", "from a corner", "across", "polyline from an edge"],
)
def test_faces_lie_on_each_other_and_share_no_bond(path):
    sheet = cracked(path)
    left, right = faces(sheet)
    apart = cKDTree(sheet.points[left]).query(sheet.points[right])
    assert len(left) == len(right) and (apart[0] == 0.0).all() and len(np.unique(apart[1])) == len(left)
    bonds = bonds_of(sheet)
    assert not (np.isin(bonds[:, 0], left) & np.isin(bonds[:, 1], right)).any()
    # The triangles of the two faces are on its two sides.
    start, end = np.asarray(path[0]), np.asarray(path[1])
    for face, sign in ((left, 1.0), (right, -1.0)):
        on = face[np.abs(turn(end - start, sheet.points[face] - start)) < 1e-12]
        touching = sheet.triangles[np.isin(sheet.triangles, on).sum(axis=1) == 2]
        middle = sheet.points[touching].mean(axis=1) - start
        assert (sign * turn(end - start, middle) > 0.0).all()


def test_tips_are_one_point_where_they_were_asked_for():
    ends = [(0.0231, 0.0488), (0.0812, 0.0567)]
    sheet = cracked(ends)
    tips = sheet.points[sheet.parts["crack 1 tips"]]
    assert {tuple(tip) for tip in tips} == set(ends)
    assert np.isclose(sheet.areas.sum(), 0.01, rtol=1e-12)


def test_a_crack_on_a_row_of_points_belongs_to_neither_side():
    """The sheet is its own mirror image: points, areas, and the bonds of each."""
    sheet = cracked([(0.02, 0.05), (0.08, 0.05)])
    mirrored = sheet.points * (1.0, -1.0) + (0.0, 0.1)
    left, right = faces(sheet)
    image = np.full(sheet.size, -1)
    others = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    distance, at = cKDTree(sheet.points[others]).query(mirrored[others])
    assert distance.max() < 1e-14
    image[others] = others[at]
    for one, other in ((left, right), (right, left)):
        image[one] = other[cKDTree(sheet.points[other]).query(mirrored[one])[1]]
    assert np.allclose(sheet.areas[image], sheet.areas, rtol=1e-12)
    bonds = {tuple(pair) for pair in bonds_of(sheet)}
    assert bonds == {(image[i], image[j]) for i, j in bonds}


def test_a_crack_across_divides_the_sheet():
    sheet = cracked([(0.0, 0.0523), (0.1, 0.0581)])
    assert "crack 1 tips" not in sheet.parts
    above = sheet.points[:, 1] > 0.0523 + 0.058 * sheet.points[:, 0]
    left, right = faces(sheet)
    above[left], above[right] = True, False
    bonds = bonds_of(sheet)
    assert (above[bonds[:, 0]] == above[bonds[:, 1]]).all()


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.234])
def test_a_crack_begins_on_the_true_circle(angle):
    hole = Circle((0.05, 0.05), 0.02)
    along = np.array([np.cos(angle), np.sin(angle)])
    for start in (0.02, 0.012):
        sheet = cracked([hole.centre + start * along, hole.centre + 0.04 * along], holes=[hole])
        assert len(sheet.parts["crack 1 tips"]) == 1
        rim = np.hypot(*(sheet.points[sheet.parts["hole 1"]] - hole.centre).T)
        assert np.abs(rim - 0.02).max() < 2e-5 * 0.02 + (start < 0.02) * 1e-4 * 0.02
        mouth = np.isin(sheet.parts["crack 1"], sheet.parts["hole 1"])
        assert mouth.any()


def test_the_order_of_the_points_says_what_is_left():
    there, back = (cracked(path) for path in ([(0.02, 0.05), (0.08, 0.05)], [(0.08, 0.05), (0.02, 0.05)]))
    for sheet, sign in ((there, 1.0), (back, -1.0)):
        left, _ = faces(sheet)
        touching = sheet.triangles[np.isin(sheet.triangles, left).sum(axis=1) == 2]
        assert (sign * (sheet.points[touching].mean(axis=1)[:, 1] - 0.05) > 0.0).all()


def test_a_crack_that_leaves_the_sheet_ends_at_its_edge_and_keeps_its_sides():
    sheet = cracked([(-0.02, 0.04), (0.03, 0.05), (0.06, 0.05)])
    left, _ = faces(sheet)
    touching = sheet.triangles[np.isin(sheet.triangles, left).sum(axis=1) == 2]
    assert (sheet.points[touching].mean(axis=1)[:, 1] > 0.044).all()
    assert (sheet.points[left][:, 0] == 0.0).any()
