"""Signed distances of bodies, against independent ones."""

import numpy as np
import pytest
import warp as wp
from helpers import refused
from hypothesis import example, given, settings
from hypothesis import strategies as st

from warp_pd import Box, Capsule, Cylinder, Plane, Sphere, TriangleMesh
from warp_pd.contact.body_shapes import signed_distances

CPU = wp.get_device("cpu")
SIZES, PLACES = st.floats(0.1, 2.0), st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3), min_size=1, max_size=20)


def measured(shape, points):
    return signed_distances(shape, np.array(points, float).reshape(-1, 3), CPU)


def box(points, half):
    """Outside, the distance from the clamped point; inside, from the nearest face."""
    beyond = np.abs(points) - half
    outside = np.linalg.norm(points - np.clip(points, -half, half), axis=1)
    return np.where((beyond < 0.0).all(axis=1), beyond.max(axis=1), outside)


@settings(max_examples=40, deadline=None)
@example(diameter=1.0, length=1.0, points=[(0.0, 0.0, 5.733278541960259e-158)])
@given(diameter=SIZES, length=SIZES, points=PLACES)
def test_distances_are_exact(diameter, length, points):
    x, r, h = np.array(points), 0.5 * diameter, 0.5 * length
    across = np.hypot(x[:, 0], x[:, 1])
    axis = np.column_stack([0.0 * across, 0.0 * across, np.clip(x[:, 2], -h, h)])
    section = np.column_stack([across, x[:, 2]])
    expected = {
        Sphere(diameter): np.linalg.norm(x, axis=1) - r,
        Capsule(diameter, length): np.linalg.norm(x - axis, axis=1) - r,
        Cylinder(diameter, length): box(section, np.array([r, h])),
        Box((diameter, length, 1.0)): box(x, 0.5 * np.array([diameter, length, 1.0])),
        Plane((0.0, 3.0, 4.0)): x @ [0.0, 0.6, 0.8],
    }
    for shape, distance in expected.items():
        found = measured(shape, points)
        np.testing.assert_allclose(found[:, 3], distance, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(found[:, :3], axis=1), 1.0, atol=1e-12)
        # Along the normal the distance falls to zero.
        on_surface = x - found[:, 3:] * found[:, :3]
        np.testing.assert_allclose(measured(shape, on_surface)[:, 3], 0.0, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(sides=st.tuples(SIZES, SIZES, SIZES), points=PLACES)
def test_the_distance_of_a_mesh_is_that_of_the_box_it_is(sides, points):
    shape = Box(sides)
    mesh = TriangleMesh(*shape.outline(0.0))
    np.testing.assert_allclose(measured(mesh, points)[:, 3], measured(shape, points)[:, 3], atol=2e-6)


def test_the_sign_of_a_sharp_mesh_is_right_beyond_its_tip():
    """A thin tetrahedron, which is where all its faces have a point behind them."""
    vertices = np.array([(0.0, 0.0, -0.06), (6e-3, 0.0, 0.0), (-3e-3, 6e-3, 0.0), (-3e-3, -6e-3, 0.0)])
    mesh = TriangleMesh(vertices, np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]))
    corners = mesh.outline(0.0)[0][mesh.triangles]
    points = corners[0, 0] + np.random.default_rng(0).normal(scale=(4e-3, 4e-3, 3e-2), size=(5000, 3))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    behind = np.einsum("pfc,fc->pf", points[:, None] - corners[:, 0], normals) < 0.0
    inside = behind.all(axis=1)
    assert 10 < inside.sum() < 2500
    np.testing.assert_array_equal(measured(mesh, points)[:, 3] < 0.0, inside)


@pytest.mark.parametrize("shape", [Sphere(1.0), Capsule(0.6, 1.2), Cylinder(1.0, 1.4), Box((1.0, 0.8, 1.2))])
def test_inertia_is_that_of_the_fine_mesh_and_outlines_are_closed(shape):
    mesh = TriangleMesh(*shape.outline(0.0))
    np.testing.assert_allclose(mesh.inertia(), shape.inertia(), atol=0.02 * shape.inertia().max())
    np.testing.assert_allclose(mesh.centroid, 0.0, atol=1e-12)
    assert mesh.radius() == pytest.approx(shape.radius(), rel=0.01)


@pytest.mark.parametrize("shape", [Sphere(1.0), Capsule(0.6, 0.5), Cylinder(0.7, 1.4), Cylinder(0.7, 0.5, 0.1)])
def test_inertia_of_a_round_body_is_the_sum_over_its_discs(shape):
    """Their radii are where the distance from the surface is 0."""
    half = 0.5 * np.ptp(shape.outline(0.0)[0][:, 2])
    z = half * (2.0 * np.arange(4000) + 1.0 - 4000.0) / 4000.0
    inner, outer = np.zeros_like(z), np.full_like(z, 2.0 * half)
    for _ in range(40):
        middle = 0.5 * (inner + outer)
        inside = measured(shape, np.column_stack([middle, 0.0 * z, z]))[:, 3] < 0.0
        inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
    squares = inner**2
    along = 0.5 * (squares**2).sum() / squares.sum()
    across = 0.5 * along + (squares * z**2).sum() / squares.sum()
    np.testing.assert_allclose(shape.inertia(), np.diag([across, across, along]), rtol=1e-5)


ALL = 1.0 - 1e-9


@pytest.mark.parametrize(
    ("rounded", "limit"),
    [
        (Box((1.0, 1.0, 1.0), 0.5 * ALL), Sphere(1.0)),
        (Box((0.6, 0.6, 1.4), 0.3 * ALL), Capsule(0.6, 0.8)),
        (Cylinder(0.6, 1.4, 0.3 * ALL), Capsule(0.6, 0.8)),
        (Box((1.0, 0.8, 1.2), 1e-12), Box((1.0, 0.8, 1.2))),
        (Cylinder(1.0, 1.4, 1e-12), Cylinder(1.0, 1.4)),
    ],
)
def test_rounded_bodies_become_round_ones_and_sharp_ones(rounded, limit):
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (500, 3))
    np.testing.assert_allclose(measured(rounded, points)[:, 3], measured(limit, points)[:, 3], atol=1e-8)
    np.testing.assert_allclose(rounded.inertia(), limit.inertia(), atol=1e-8)
    assert rounded.radius() == pytest.approx(limit.radius(), abs=1e-8)
    assert rounded.thinnest() == pytest.approx(limit.thinnest())
    assert rounded.edge_radius() == rounded.rounding


@pytest.mark.parametrize("shape", [Box((1.0, 0.8, 1.2), 0.2), Cylinder(1.0, 0.9, 0.2)])
def test_rounded_edges_are_balls_rolled_along_the_sharp_edges_of_a_smaller_body(shape):
    inner = Box((0.6, 0.4, 0.8)) if isinstance(shape, Box) else Cylinder(0.6, 0.5)
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (500, 3))
    found, expected = measured(shape, points), measured(inner, points)
    outside = expected[:, 3] > 0.0
    np.testing.assert_allclose(found[outside, 3], expected[outside, 3] - 0.2, atol=1e-12)
    np.testing.assert_allclose(found[outside, :3], expected[outside, :3], atol=1e-12)
    vertices, triangles = shape.outline(0.0)
    np.testing.assert_allclose(measured(shape, vertices)[:, 3], 0.0, atol=1e-12)
    mesh = TriangleMesh(vertices, triangles)
    np.testing.assert_allclose(mesh.inertia(), shape.inertia(), atol=0.01 * shape.inertia().max())


def test_sharp_meshes_are_told_from_smooth_ones():
    assert TriangleMesh(*Box((1.0, 0.8, 1.2)).outline(0.0)).edge_radius() == 0.0
    assert TriangleMesh(*Box((1.0, 0.8, 1.2), 0.2).outline(0.0)).edge_radius() == np.inf
    assert TriangleMesh(*Sphere(1.0).outline(0.0)).edge_radius() == Sphere(1.0).edge_radius() == np.inf


@pytest.mark.parametrize(("make", "said"), [
    (lambda: Box((1.0, 0.8, 1.2), 0.4), "Box.rounding = 0.4: expected less than half its thickness, 0.4"),
    (lambda: Cylinder(1.0, 0.8, -0.1), "Cylinder.rounding = -0.1: expected"),
])  # fmt: skip
def test_a_rounding_that_cannot_be_is_refused(make, said):
    with refused(said):
        make()


def test_a_mesh_moved_from_the_origin_has_its_centroid():
    vertices, triangles = Box((1.0, 2.0, 3.0)).outline(0.0)
    mesh = TriangleMesh(vertices + [5.0, 6.0, 7.0], triangles)
    np.testing.assert_allclose(mesh.centroid, [5.0, 6.0, 7.0], atol=1e-12)
    np.testing.assert_allclose(mesh.inertia(), Box((1.0, 2.0, 3.0)).inertia(), atol=1e-12)
