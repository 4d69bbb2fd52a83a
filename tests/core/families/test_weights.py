"""Plain weights of any cloud of points, and corrected ones: balance of a uniform stress, positivity."""

import numpy as np
import pytest
from helpers import refused
from weight_cases import (
    cloud,
    jittered_lattice,
    lattice,
    lattice_neighbours,
    out_of_balance,
    stencil,
    third_areas,
)

from warp_pd.families import weights
from warp_pd.families.lattice import rectangle_corrected
from warp_pd.families.weights import (
    FLOOR,
    corrected_weights,
    edge_vectors,
    plain_weights,
    reached_points,
)


def test_the_lattice_solved_as_a_cloud_is_balanced_too():
    points, areas, triangles = lattice(19, 17)
    family = cloud(points, 3.15)
    found = corrected_weights(points, areas, *family, edge_vectors=edge_vectors(points, triangles))
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR
    assert np.abs(out_of_balance(points, areas, family, found.weights, triangles)).max() < 1e-10


@pytest.mark.parametrize(("horizon", "jitter"), [(2.015, 0.25), (3.015, 0.1), (3.15, 0.1)])
def test_a_jittered_cloud_is_balanced(horizon, jitter):
    points, triangles = jittered_lattice(jitter)
    areas = third_areas(points, triangles)
    family = cloud(points, horizon)
    found = corrected_weights(points, areas, *family, edge_vectors=edge_vectors(points, triangles))
    assert found.residual < 1e-10 < found.start_residual
    assert found.smallest_ratio > FLOOR
    assert found.weights.sum() == pytest.approx(areas.sum(), rel=1e-10)
    assert np.abs(out_of_balance(points, areas, family, found.weights, triangles)).max() < 1e-10


def test_too_large_an_irregular_cloud_is_refused(monkeypatch):
    monkeypatch.setattr(weights, "MAX_BALANCES", 100)
    points, triangles = jittered_lattice(0.1)
    areas = third_areas(points, triangles)
    with refused(match=r"weights = 'corrected': .* expected up to 100"):
        corrected_weights(points, areas, *cloud(points, 2.015), edge_vectors=edge_vectors(points, triangles))


def test_the_points_that_no_positive_weights_balance_are_few():
    # A linear programme finds no positive weights for this cloud: the best least ratio is -0.138.
    points, triangles = jittered_lattice(0.25)
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
    outside = triangles[(np.linalg.norm(points - 30, axis=1) >= 5.3)[triangles].all(axis=1)]
    kept = np.unique(outside)
    triangles = np.searchsorted(kept, outside)
    families = cloud(points[kept], horizon)
    vectors = edge_vectors(points[kept], triangles)
    # Members of the cloud are sorted by index, and so are those of the stencil, whose rows run along x.
    lattice_rows = lattice_neighbours(size, size, stencil(horizon)["offsets"])[kept]
    renumber = np.full(size**2, -1)
    renumber[kept] = np.arange(len(kept))
    present = (lattice_rows >= 0) & (renumber[lattice_rows] >= 0)
    start = np.zeros(families[0].shape)
    start[families[0] >= 0] = outer.at(column, row)[kept][present]
    found = corrected_weights(points[kept], areas[kept], *families, edge_vectors=vectors, start=start)
    assert found.residual < 1e-10
    assert found.smallest_ratio > FLOOR
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
    # Opposite members of the stencil lie as far from its start as from its end: their sums mirror each other.
    np.testing.assert_array_equal(family["offsets"], -family["offsets"][::-1])
    np.testing.assert_allclose(by_stencil.sum(axis=0), by_stencil.sum(axis=0)[::-1], rtol=1e-14)
    assert np.ptp(by_stencil.sum(axis=0)) > 0.0
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
