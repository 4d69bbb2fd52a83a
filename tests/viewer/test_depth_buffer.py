"""The depth buffer of pictures: no gaps, near before far, lines on the sheet."""

import numpy as np
import pytest

from warp_pd.viewer import painter
from warp_pd.viewer.painter import DepthBuffer

RED, BLUE = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)


def square(depth_left, depth_right):
    """Two triangles that cover the unit square, with a depth that changes along x."""
    corners = np.array([(0, 0, depth_left), (1, 0, depth_right), (1, 1, depth_right), (0, 1, depth_left)], float)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def empty(columns=64, rows=40):
    return DepthBuffer.of(np.zeros(2), np.ones(2), columns, rows)


def test_squares_that_cross_hide_each_other_by_half(monkeypatch):
    monkeypatch.setattr(painter, "FRAGMENTS", 300)
    buffer = empty()
    buffer.draw(np.concatenate([square(0.0, 1.0), square(1.0, 0.0)]), np.array([RED, RED, BLUE, BLUE]))
    assert (buffer.image[:, 32:, 0] == 255).all() and (buffer.image[:, :32, 2] == 255).all()
    middles = (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(buffer.depth, np.tile(np.maximum(middles, 1.0 - middles), (40, 1)), atol=1e-12)


def test_triangles_of_a_sheet_leave_no_gap_and_do_not_overlap():
    """A random sheet that fills the square: each pixel belongs to exactly one triangle, within its corners."""
    from scipy.spatial import Delaunay

    points = np.vstack([np.random.default_rng(0).random((300, 2)), [(0, 0), (0, 1), (1, 0), (1, 1)]])
    triangles = Delaunay(points).simplices
    corners = np.column_stack([points, np.zeros(len(points))])[triangles]
    buffer, found = empty(), np.zeros((40, 64), int)
    buffer.draw(corners, np.tile(RED, (len(corners), 1)))
    assert (buffer.image[..., 3] == 255).all()
    for corner in corners:
        alone = empty()
        alone.draw(corner[None], np.array([RED]))
        found += alone.image[..., 3] > 0
    assert (found == 1).all()


def test_a_triangle_that_reaches_beyond_the_picture_is_cut():
    buffer = empty()
    buffer.draw(np.array([[(-9.0, -9.0, 1.0), (20.0, -9.0, 1.0), (0.5, 30.0, 1.0)]]), np.array([RED]))
    assert (buffer.depth == 1.0).all()
    buffer.draw(np.array([[(2.0, 2.0, 5.0), (3.0, 2.0, 5.0), (2.0, 3.0, 5.0)]]), np.array([BLUE]))
    assert (buffer.depth == 1.0).all()


@pytest.mark.parametrize("steepness", [0.0, 1.0, 300.0])
def test_lines_on_a_sheet_are_seen_and_lines_below_it_are_not(steepness):
    buffer, sheet = empty(), square(0.0, steepness)
    buffer.draw(sheet, np.array([RED, RED]))
    ends = np.array([[(0.1, 0.3, 0.1 * steepness), (0.9, 0.3, 0.9 * steepness)]])
    pieces, line = buffer.seen(ends, sheet[:1])
    assert np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum() == pytest.approx(0.8)
    assert (line == 0).all()
    # Half of it is hidden by a square in front of its right half.
    front = square(steepness + 1.0, steepness + 1.0) * (0.5, 1.0, 1.0) + (0.5, 0.0, 0.0)
    buffer.draw(front, np.array([BLUE, BLUE]))
    pieces, _ = buffer.seen(ends, sheet[:1])
    shown = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum()
    if steepness < 10.0:
        assert shown == pytest.approx(0.4, abs=0.1)
