"""Corrected weights of a rectangle: balance, positivity, exactness on lattices of any size."""

import functools

import numpy as np
import pytest
from weight_cases import lattice, lattice_neighbours, out_of_balance, stencil

from warp_pd.families.lattice import rectangle_corrected
from warp_pd.families.weights import FLOOR

HORIZONS = (1.5, 2.015, 3.015, 3.15, 4.15)
# Smallest ratio of corrected to plain weights measured on wide lattices, rounded down.
LEAST_RATIO = {1.5: 0.63, 2.015: 0.41, 3.015: 0.08, 3.15: 0.07, 4.15: 0.055}


@functools.cache
def wide(horizon):
    return rectangle_corrected(1000, 3000, 0.01, **stencil(horizon))


@pytest.mark.parametrize("horizon", HORIZONS)
def test_a_rectangle_is_balanced_with_positive_weights(horizon):
    spacing = 0.01
    found = wide(horizon)
    assert found.solved.residual <= 1e-10 * spacing
    assert found.solved.start_residual > 0.2 * spacing
    assert found.solved.unbalanced_points == 0
    assert found.solved.smallest_ratio > max(FLOOR, LEAST_RATIO[horizon])
    assert found.solved.largest_ratio < 50


@pytest.mark.parametrize("horizon", HORIZONS[:4])
def test_the_reduced_lattice_serves_larger_ones_exactly(horizon):
    family = stencil(horizon)
    points, areas, triangles = lattice(41, 33, (0.01, 0.01))
    neighbours = lattice_neighbours(41, 33, family["offsets"])
    found = rectangle_corrected(41, 33, 0.01, **family)
    np.testing.assert_array_equal(found.table, wide(horizon).table)
    weights = found.at(np.arange(41 * 33) % 41, np.arange(41 * 33) // 41)
    left = out_of_balance(points, areas, (neighbours, family["influence"], family["common"]), weights, triangles)
    assert np.abs(left).max() < 1e-10 * 0.01
    assert weights.sum() == pytest.approx(areas.sum(), rel=1e-12)


@pytest.mark.parametrize("horizon", HORIZONS)
def test_weights_far_from_the_edge_stay_plain(horizon):
    found = wide(horizon)
    sizes = stencil(horizon)["common"].sum(axis=1)
    np.testing.assert_allclose(found.table[found.depth, found.depth], 1e-4 * sizes / sizes.sum(), rtol=1e-14)
    assert found.depth == max(3, 2 * int(horizon))


def test_the_square_is_mirrored():
    family = stencil(3.15)
    table = rectangle_corrected(100, 100, 1.0, **family).table
    offsets = family["offsets"]

    def position(x, y):
        return np.array([int(np.flatnonzero((offsets == pair).all(axis=1))[0]) for pair in zip(x, y, strict=True)])

    x, y = offsets.T
    np.testing.assert_allclose(table, table[::-1][:, :, position(-x, y)], rtol=1e-8)
    np.testing.assert_allclose(table, table.transpose(1, 0, 2)[:, :, position(y, x)], rtol=1e-8)


def test_spacings_may_differ_and_strips_may_be_narrow():
    step = (1.0, 0.97)
    family = stencil(3.015, step)
    for columns, rows in ((30, 31), (9, 40)):
        found = rectangle_corrected(columns, rows, step, **family)
        assert found.solved.residual < 1e-10
        points, areas, triangles = lattice(columns, rows, step)
        weights = found.at(np.arange(len(points)) % columns, np.arange(len(points)) // columns)
        neighbours = lattice_neighbours(columns, rows, family["offsets"])
        left = out_of_balance(points, areas, (neighbours, family["influence"], family["common"]), weights, triangles)
        assert np.abs(left).max() < 1e-10


@pytest.mark.parametrize("points", (3, 10, 12))
def test_small_sheets_are_balanced(points):
    for horizon in HORIZONS:
        found = rectangle_corrected(points, points, 1.0, **stencil(horizon)).solved
        assert found.residual < 1e-10
        assert found.smallest_ratio > FLOOR


def test_a_sheet_too_narrow_for_its_horizon_says_what_is_left():
    # A linear programme finds no positive weights on 6 x 6 points at 3.15: the best least ratio is -0.065.
    found = rectangle_corrected(6, 6, 1.0, **stencil(3.15)).solved
    assert 0 < found.unbalanced_points < 36
    assert found.residual < 0.1 * found.start_residual
    assert found.smallest_ratio > FLOOR
