"""Curves: points on them, about a spacing apart, and their sides."""

import numpy as np
import pytest

from warp_pd.shapes.curves import Circle, ParametricCurve, Polygon, Spline, as_curve, spread_evenly
from warp_pd.shapes.lines import ring

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def even(spacing):
    return lambda points: np.full(len(points), spacing)


def gaps(points):
    return np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)


def test_a_polygon_keeps_its_corners_and_names_its_sides():
    points, side = Polygon(SQUARE).sampled(even(0.13))
    assert np.array_equal(points[np.flatnonzero(np.diff(side, prepend=-1))], SQUARE)
    assert np.allclose(gaps(points), 0.125)
    assert np.array_equal(np.bincount(side), [8] * 4)


def test_a_polygon_may_repeat_its_first_corner():
    assert np.array_equal(Polygon([*SQUARE, SQUARE[0]]).corners, SQUARE)


@pytest.mark.parametrize("count", [4, 8, 40])
def test_a_circle_has_points_on_both_axes(count):
    points, side = Circle((0.3, -0.2), 2.0).sampled(even(4.0 * np.pi / count))
    assert len(points) == count and not side.any()
    offset = points - (0.3, -0.2)
    assert np.allclose(np.hypot(*offset.T), 2.0, rtol=1e-15)
    assert np.allclose(offset[:: count // 4], [(2, 0), (0, 2), (-2, 0), (0, -2)], atol=1e-12)
    assert np.allclose(gaps(points), gaps(points)[0], rtol=1e-5)


def test_points_follow_a_varying_spacing():
    def spacing(points):
        return 0.02 * (1.0 + points[:, 0])

    points, _ = Polygon(SQUARE).sampled(spacing)
    middle = 0.5 * (points + np.roll(points, -1, axis=0))
    assert np.abs(gaps(points) / spacing(middle) - 1.0).max() < 0.05


def test_a_spline_goes_through_its_points_and_is_smooth():
    through = np.array([(0, 0), (2, -0.5), (3, 1), (1, 2)])
    points, _ = Spline(through).sampled(even(0.01))
    assert max(np.linalg.norm(points - p, axis=1).min() for p in through) < 0.006
    along = np.roll(points, -1, axis=0) - points
    turn = np.angle((along[:, 0] + 1j * along[:, 1]) / np.roll(along[:, 0] + 1j * along[:, 1], 1))
    assert np.abs(turn).max() < 0.1
    assert np.isclose(turn.sum(), 2.0 * np.pi)


def test_a_function_of_t_is_a_curve():
    curve = as_curve("outline", lambda t: np.column_stack([2 * np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)]))
    assert isinstance(curve, ParametricCurve)
    points, _ = curve.sampled(even(0.1))
    assert np.allclose((points[:, 0] / 2) ** 2 + points[:, 1] ** 2, 1.0)
    assert np.abs(gaps(points) / 0.1 - 1.0).max() < 0.02


def test_rings_are_counter_clockwise_and_sides_keep_their_segments():
    clockwise = ring("outline", SQUARE[::-1], even(0.25))
    x, y = clockwise.points.T
    assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0.0
    assert clockwise.corners.sum() == 4
    middle = 0.5 * (clockwise.points + np.roll(clockwise.points, -1, axis=0))
    # Side 0 of the clockwise square is its upper edge: from (0, 1) to (1, 1).
    assert np.allclose(middle[clockwise.side == 0, 1], 1.0)


def test_a_piece_is_divided_at_least_into_its_multiple():
    assert len(spread_evenly(lambda t: np.column_stack([t, 0 * t]), even(100.0), 4)) == 5
