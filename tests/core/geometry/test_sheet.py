"""Sheets: wrong numbers, and edits that meet no point or bond, are named."""

import numpy as np
import pytest
from helpers import refused, square

from warp_pd import Sheet

NAN = float("nan")
CLOUD = {"thickness": 1e-3, "density": 1.0}
WRONG = [
    (lambda: Sheet.rectangle(0.0, 1.0, thickness=1.0, density=1.0), r"width = 0\.0"),
    (lambda: Sheet.rectangle(1.0, -1.0, thickness=1.0, density=1.0), r"height = -1\.0"),
    (lambda: Sheet.rectangle(NAN, 1.0, thickness=1.0, density=1.0), "width = nan"),
    (lambda: square(5, thickness=0.0), r"thickness = 0\.0"),
    (lambda: square(5, density=NAN), "density = nan"),
    (lambda: square(5).cut((2.0, 2.0), (3.0, 3.0)), "crosses no bond"),
    (
        lambda: square(9).cut((0.03, 0.04), (0.06, 0.04)).cut((0.03, 0.04), (0.06, 0.04)),
        "lies on an earlier cut from .*: expected each cut once",
    ),
    (
        lambda: square(9).inclusion((0.05, 0.05), 0.03).cut((0.0, 0.044), (0.06, 0.044)),
        r"passes through a rigid inclusion at \(0.025, 0.0375\): expected a cut beside it",
    ),
    (lambda: square(5).cut((0.01, 0.01), (0.01, 0.01)), "segment of nonzero length"),
    (lambda: square(5).hole((5.0, 5.0), 0.01), "contains no points"),
    (lambda: square(5).hole((0.05, 0.05), 1.0), "removes the whole sheet"),
    (lambda: square(5).inclusion((0.01, 0.01), 1e-4), r"^inclusion at \(0.01, 0.01\) .* contains no points"),
    (lambda: square(5).where(lambda x: x > 0.0), r"^condition\(x, y\): TypeError: .*; expected a function of arrays"),
    (
        lambda: square(5).rigid(square(5).edges("left")),
        "5 points on a line: expected three or more that are not collinear",
    ),
    (lambda: square(5).rigid([0, 1, 5]).rigid([5, 6, 10]), "^rigid: point 5 is in another rigid body"),
    (lambda: square(9).rigid([0, 1, 9], 0.1).hole((0.01, 0.01), 0.01), "^hole at .* changes the mass of a rigid body"),
    (lambda: square(5).rigid([0, 1, 5], mass=0.0), "rigid: mass = 0.0"),
    (lambda: square(5).rigid(range(12)).rigid(range(12, 25)), "rigid: all 25 points of the sheet would"),
    (lambda: square(5).edges("middle"), "edge = 'middle'"),
    (
        lambda: Sheet.from_points(np.vstack([square(5).points, square(5).points[3]]), **CLOUD),
        r"points\[3\] and points\[25\] coincide",
    ),
    (lambda: Sheet.from_points(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), **CLOUD), "collinear"),
    (lambda: Sheet.from_points(np.full((4, 2), NAN), **CLOUD), r"points\[0, 0\] = nan"),
    (lambda: Sheet.from_points(np.zeros((4, 3)), **CLOUD), r"got \(4, 3\)"),
    (lambda: Sheet.rectangle(1.0, 1.0, thickness=1.0, density=1.0, points=10**6), "points = 1000000 with layers"),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_sheets_are_named(make, text):
    with refused(match=text):
        make()


@pytest.mark.parametrize(
    "condition",
    [3, lambda x, y: True, lambda x, y: np.array([True]), lambda x, y: np.arange(3), lambda x, y: 0.0 * x + 5.0],
    ids=["no function", "one truth value", "one in an array", "indices", "numbers"],
)
def test_where_takes_one_truth_value_per_point(condition):
    """Anything else would hold or pull the wrong points without a word."""
    with refused(match=r"^condition (=|returned) .*: expected "):
        square(5).where(condition)


def test_within_a_radius_are_the_points_at_the_radius_too():
    assert len(square(11).within((0.05, 0.05), 0.02)) == 13


@pytest.mark.parametrize("centred", [False, True])
@pytest.mark.parametrize("layers", [(0, 0), (2, 1)])
def test_a_rectangle_begins_at_its_origin(centred, layers):
    """Its points stand for the cells from the origin to the opposite corner, and for the layers around them."""
    origin, size, points = np.array([0.3, -0.2]), np.array([0.12, 0.05]), np.array([6, 5])
    sheet = Sheet.rectangle(
        *size, thickness=1e-3, density=1.0, points=tuple(points), origin=tuple(origin), layers=layers, centred=centred
    )
    spacing = size / (points if centred else points - 1)
    beyond = spacing * layers
    margin = 0.5 * spacing if centred else 0.0
    np.testing.assert_allclose(sheet.points.min(axis=0), origin - beyond + margin, atol=1e-15)
    np.testing.assert_allclose(sheet.points.max(axis=0), origin + size + beyond - margin, atol=1e-15)
    assert sheet.areas.sum() == pytest.approx(np.prod(size + 2.0 * beyond), rel=1e-12)
    middle = sheet.areas @ sheet.points / sheet.areas.sum()
    np.testing.assert_allclose(middle, origin + 0.5 * size, atol=1e-15)


@pytest.mark.parametrize("points", [4, 5])
def test_a_line_is_cells_from_zero_to_its_length(points):
    sheet = Sheet.line(0.3, 1e-4, density=1.0, points=points)
    assert sheet.areas.sum() == pytest.approx(0.3, rel=1e-12)
    assert sheet.areas @ sheet.points[:, 0] == pytest.approx(0.3 * 0.15, rel=1e-12)
