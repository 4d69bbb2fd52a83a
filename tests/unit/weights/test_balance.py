"""Area weights of the bonds: balance of a uniform stress, positivity, exactness on lattices of any size."""

import functools
import time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from warp_pd.checks import InputError
from warp_pd.weights import (
    FLOOR,
    clipped_index,
    corrected_weights,
    edge_vectors,
    plain_weights,
    reached_points,
    rectangle_corrected,
)

HORIZONS = (1.5, 2.015, 3.015, 3.15, 4.15)
# Least ratio of the corrected to the plain weights that was measured on wide lattices, rounded down.
LEAST_RATIO = {1.5: 0.63, 2.015: 0.41, 3.015: 0.08, 3.15: 0.07, 4.15: 0.055}


def stencil(horizon, step=(1.0, 1.0)):
    """Offsets, influences and intersections of a lattice's family; the horizon is in units of `step`."""
    reach = int(horizon / min(step)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    offsets = np.column_stack([x.ravel(), y.ravel()])
    length = np.linalg.norm(offsets * step, axis=1)
    inside = (length > 0) & (length <= horizon * (1 + 1e-9))
    offsets, length = offsets[inside], length[inside]
    apart = np.linalg.norm((offsets[:, None] - offsets[None]) * step, axis=-1)
    return {
        "offsets": offsets,
        "influence": np.maximum(1.0 - length / horizon, 0.0),
        "common": apart <= horizon * (1 + 1e-9),
    }


@functools.cache
def wide(horizon):
    return rectangle_corrected(1000, 3000, 0.01, **stencil(horizon))


def lattice(columns, rows, step=(1.0, 1.0)):
    """Points, areas and triangles of a rectangle; point = column + row * columns."""
    y, x = np.mgrid[:rows, :columns]
    x, y = x.ravel(), y.ravel()
    areas = step[0] * step[1] * np.where((x == 0) | (x == columns - 1), 0.5, 1.0)
    areas = areas * np.where((y == 0) | (y == rows - 1), 0.5, 1.0)
    first = (np.arange(columns - 1) + np.arange(rows - 1)[:, None] * columns).ravel()
    lower = np.column_stack([first, first + 1, first + 1 + columns])
    upper = np.column_stack([first, first + 1 + columns, first + columns])
    return np.column_stack([x, y]) * np.array(step), areas, np.concatenate([lower, upper])


def lattice_neighbours(columns, rows, offsets):
    y, x = np.mgrid[:rows, :columns]
    to_x, to_y = x.ravel()[:, None] + offsets[:, 0], y.ravel()[:, None] + offsets[:, 1]
    exists = (to_x >= 0) & (to_x < columns) & (to_y >= 0) & (to_y < rows)
    return np.where(exists, to_x + to_y * columns, -1).astype(np.int32)


def cloud(points, horizon, severed=None):
    """Neighbours, influences and intersections of any points."""
    found = cKDTree(points).query_ball_point(points, horizon * (1 + 1e-9))
    families = [
        [j for j in sorted(members) if j != i and not (severed and severed(points[i], points[j]))]
        for i, members in enumerate(found)
    ]
    neighbours = np.full((len(points), max(map(len, families))), -1, np.int32)
    for i, members in enumerate(families):
        neighbours[i, : len(members)] = members
    exists = neighbours >= 0
    place = np.where(exists[..., None], points[neighbours], np.inf)
    length = np.where(exists, np.linalg.norm(np.where(exists[..., None], place, 0) - points[:, None], axis=-1), 0)
    near = np.where(exists[..., None], place, 1e9)
    common = np.linalg.norm(near[:, :, None] - near[:, None], axis=-1) <= horizon * (1 + 1e-9)
    common &= exists[:, :, None] & exists[:, None, :]
    return neighbours, np.where(exists, 1 - length / horizon, 0), common


def third_areas(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    areas = np.zeros(len(points))
    for k in range(3):
        np.add.at(areas, triangles[:, k], np.abs(signed) / 6)
    return areas


def jittered(jitter):
    """A 21 x 21 lattice whose points are moved at random, those of an edge along it: points, triangles."""
    points, _, triangles = lattice(21, 21)
    shift = np.random.default_rng(1).uniform(-jitter, jitter, points.shape)
    return points + np.where((points == 0) | (points == 20), 0.0, shift), triangles


def out_of_balance(points, areas, family, weights, triangles):
    """sum W G - b of every point, bond by bond as theory 3b has it and not as the module does."""
    neighbours, influence, common = family
    total = -edge_vectors(points, triangles)
    for i in range(len(points)):
        row = influence if influence.ndim == 1 else influence[i]
        table = common if common.ndim == 2 else common[i]
        real = np.flatnonzero(neighbours[i] >= 0)
        for j in real[weights[i, real] != 0]:
            members = real[table[j, real]]
            bonds = points[neighbours[i, members]] - points[i]
            c = row[members] * areas[neighbours[i, members]]
            shape = np.einsum("k,ka,kb->ab", c, bonds, bonds)
            gradients = weights[i, j] * c[:, None] * np.linalg.solve(shape, bonds.T).T
            np.add.at(total, neighbours[i, members], gradients)
            total[i] -= gradients.sum(axis=0)
    return total


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
    weights = found.table.reshape(-1, found.table.shape[-1])[found.kinds()]
    left = out_of_balance(points, areas, (neighbours, family["influence"], family["common"]), weights, triangles)
    assert np.abs(left).max() < 1e-10 * 0.01
    assert weights.sum() == pytest.approx(areas.sum(), rel=1e-12)
    column, row = np.arange(41 * 33) % 41, np.arange(41 * 33) // 41
    np.testing.assert_array_equal(found.at(column, row), weights)


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


def test_the_lattice_solved_as_a_cloud_is_balanced_too():
    points, areas, triangles = lattice(19, 17)
    family = cloud(points, 3.15)
    found = corrected_weights(points, areas, *family, edge_vectors=edge_vectors(points, triangles))
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR
    assert np.abs(out_of_balance(points, areas, family, found.weights, triangles)).max() < 1e-10


@pytest.mark.parametrize(("horizon", "jitter"), [(2.015, 0.25), (3.015, 0.1), (3.15, 0.1)])
def test_a_jittered_cloud_is_balanced(horizon, jitter):
    points, triangles = jittered(jitter)
    areas = third_areas(points, triangles)
    family = cloud(points, horizon)
    found = corrected_weights(points, areas, *family, edge_vectors=edge_vectors(points, triangles))
    assert found.residual < 1e-10 < found.start_residual
    assert found.smallest_ratio > FLOOR
    assert found.changed_points == len(points)
    assert found.weights.sum() == pytest.approx(areas.sum(), rel=1e-10)
    assert np.abs(out_of_balance(points, areas, family, found.weights, triangles)).max() < 1e-10


def test_the_points_that_no_positive_weights_balance_are_few():
    # A linear programme finds no positive weights for this cloud: the best least ratio is -0.138.
    points, triangles = jittered(0.25)
    vectors = edge_vectors(points, triangles)
    found = corrected_weights(points, third_areas(points, triangles), *cloud(points, 3.15), edge_vectors=vectors)
    assert 0 < found.unbalanced_points < 0.05 * len(points)
    assert found.residual < 0.1 * found.start_residual
    assert found.smallest_ratio > FLOOR


@pytest.mark.parametrize("horizon", (1.5, 2.015, 3.15))
def test_a_staircase_hole_is_balanced(horizon):
    points, _, triangles = lattice(31, 31)
    triangles = triangles[(np.linalg.norm(points - 15, axis=1) >= 5.3)[triangles].all(axis=1)]
    kept = np.unique(triangles)
    points, triangles = points[kept], np.searchsorted(kept, triangles)
    family = cloud(points, horizon)
    areas = third_areas(points, triangles)
    found = corrected_weights(points, areas, *family, edge_vectors=edge_vectors(points, triangles))
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR


def test_a_hole_starts_from_the_weights_of_the_rectangle():
    size, horizon = 61, 2.015
    points, areas, triangles = lattice(size, size)
    outer = rectangle_corrected(size, size, 1.0, **stencil(horizon))
    column, row = np.arange(size**2) % size, np.arange(size**2) // size
    whole = triangles[(np.linalg.norm(points - 30, axis=1) >= 5.3)[triangles].all(axis=1)]
    kept = np.unique(whole)
    triangles = np.searchsorted(kept, whole)
    families = cloud(points[kept], horizon)
    vectors = edge_vectors(points[kept], triangles)
    # The cloud's members are sorted by index, and so are the stencil's, whose rows run along x.
    whole_rows = lattice_neighbours(size, size, stencil(horizon)["offsets"])[kept]
    renumber = np.full(size**2, -1)
    renumber[kept] = np.arange(len(kept))
    present = (whole_rows >= 0) & (renumber[whole_rows] >= 0)
    start = np.zeros(families[0].shape)
    start[families[0] >= 0] = outer.at(column, row)[kept][present]
    found = corrected_weights(points[kept], areas[kept], *families, edge_vectors=vectors, start=start)
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR
    assert found.changed_points < 500
    edge = (points[kept] == 0).any(axis=1)
    np.testing.assert_array_equal(found.weights[edge], start[edge])


@pytest.mark.parametrize("horizon", (1.5, 3.15))
def test_severed_families_stay_plain_and_all_other_points_are_balanced(horizon):
    size = 25
    points, areas, triangles = lattice(size, size)

    def severed(a, b):
        if (a[1] - 12.5) * (b[1] - 12.5) >= 0:
            return False
        return a[0] + (12.5 - a[1]) * (b[0] - a[0]) / (b[1] - a[1]) < 10.3

    family = cloud(points, horizon, severed)
    frozen = (family[0] >= 0).sum(axis=1) != (cloud(points, horizon)[0] >= 0).sum(axis=1)
    dropped = reached_points(family[0], frozen)
    found = corrected_weights(
        points,
        areas,
        *family,
        edge_vectors=edge_vectors(points, triangles),
        frozen=frozen,
        unbalanced=dropped,
    )
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR
    plain = plain_weights(areas, family[0], family[2])
    np.testing.assert_allclose(found.weights[frozen], plain[frozen], rtol=1e-14)
    left = np.abs(out_of_balance(points, areas, family, found.weights, triangles))
    assert left[~dropped].max() < 1e-10 < left[dropped].max()


def test_plain_weights_share_each_area():
    points, areas, _ = lattice(9, 8)
    neighbours, _, common = cloud(points, 2.015)
    weights = plain_weights(areas, neighbours, common)
    np.testing.assert_allclose(weights.sum(axis=1), areas, rtol=1e-14)
    assert (weights[neighbours < 0] == 0).all()
    family = stencil(2.015)
    by_stencil = plain_weights(areas, lattice_neighbours(9, 8, family["offsets"]), family["common"])
    np.testing.assert_allclose(np.sort(by_stencil.sum(axis=0)), np.sort(by_stencil[:, ::-1].sum(axis=0)), rtol=1e-14)
    np.testing.assert_allclose(by_stencil.sum(axis=1), areas, rtol=1e-14)


def test_collinear_intersections_get_no_weight():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 5.0]])
    neighbours, influence, common = cloud(points[:3], 1.5)
    nothing = np.zeros((3, 2))
    found = corrected_weights(points[:3], np.ones(3), neighbours, influence, common, edge_vectors=nothing)
    assert (found.weights == 0).all()
    assert found.unbalanced_points == 0


def test_edge_vectors_of_a_rectangle_do_not_depend_on_orientation():
    points, _, triangles = lattice(5, 4, (0.5, 0.25))
    vectors = edge_vectors(points, triangles)
    np.testing.assert_allclose(vectors, edge_vectors(points, triangles[:, ::-1]))
    np.testing.assert_allclose(vectors[0], [-0.125, -0.25])
    np.testing.assert_allclose(vectors[2], [0.0, -0.5])
    np.testing.assert_array_equal(vectors[6], [0.0, 0.0])
    np.testing.assert_allclose(vectors.sum(axis=0), 0.0, atol=1e-15)


def test_clipped_index():
    np.testing.assert_array_equal(clipped_index(9, 2), [0, 1, 2, 2, 2, 2, 2, 3, 4])
    np.testing.assert_array_equal(clipped_index(5, 2), np.arange(5))
    np.testing.assert_array_equal(clipped_index(4, 2), np.arange(4))


def test_a_million_points_take_seconds():
    begin = time.perf_counter()
    found = rectangle_corrected(1000, 1000, 1e-3, **stencil(3.15))
    kinds = found.kinds()
    assert time.perf_counter() - begin < 5.0
    assert kinds.shape == (1_000_000,)
    assert kinds.max() < found.table.shape[0] * found.table.shape[1]


def test_wrong_input_is_named():
    family = stencil(1.5)
    with pytest.raises(InputError, match=r"floor = 1\.0: allowed"):
        rectangle_corrected(9, 9, 1.0, **family, floor=1.0)
    with pytest.raises(InputError, match="depth = 0: allowed"):
        rectangle_corrected(9, 9, 1.0, **family, depth=0)
    points, areas, triangles = lattice(5, 5)
    with pytest.raises(InputError, match=r"strip has shape \(3,\)"):
        corrected_weights(
            points,
            areas,
            *cloud(points, 1.5),
            edge_vectors=edge_vectors(points, triangles),
            strip=np.ones(3, bool),
        )
