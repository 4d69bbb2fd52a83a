"""What points remember of a mesh, against searches without memory and against all triangles."""

import numpy as np
import pytest
import warp as wp

from warp_pd import Box, Sphere, TriangleMesh
from warp_pd.contact import body_shapes
from warp_pd.kernels.contact.distances import BodyShape
from warp_pd.kernels.contact.mesh_distance import mesh_distance_of_point, square_of

SPACING, POINTS = 1e-3, 3000


@wp.kernel
def ask(points: wp.array(dtype=wp.vec3d), reach: wp.float64, body: BodyShape, found: wp.array(dtype=wp.vec4d)):
    i = wp.tid()
    found[i] = mesh_distance_of_point(i, points[i], reach, body)


@wp.kernel
def ask_all(points: wp.array(dtype=wp.vec3d), body: BodyShape, found: wp.array(dtype=wp.float64)):
    i = wp.tid()
    least = wp.float64(wp.inf)
    for f in range(body.surface[0].triangles.shape[0]):
        least = wp.min(least, square_of(points[i], f, body.surface[0]))
    found[i] = wp.sqrt(least)


def cone(sides=60):
    """Many narrow triangles that meet in a tip."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rim = 0.01 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    k, following = np.arange(sides), (np.arange(sides) + 1) % sides
    sides_of = np.column_stack([k, following, np.full(sides, sides)])
    base = np.column_stack([following, k, np.full(sides, sides + 1)])
    return TriangleMesh(np.vstack([rim, [[0, 0, 0.02], [0, 0, 0]]]), np.vstack([sides_of, base]).astype(np.int32))


MESHES = {
    "box": lambda: TriangleMesh(*Box((0.04, 0.05, 0.02)).outline(0.0)),
    "sphere": lambda: TriangleMesh(*Sphere(0.03).outline(0.0)),
    "cone": cone,
}


def with_memory(shape):
    kinds = {"seen": wp.vec4, "faces": wp.vec4i, "apart": wp.vec4}
    remembered = {name: wp.zeros(POINTS, dtype=kind) for name, kind in kinds.items()}
    remembered["faces"].fill_(-1)
    return body_shapes.on_device(shape, wp.get_device("cpu"), SPACING, remembered)


@pytest.mark.parametrize("mesh", MESHES)
def test_memory_changes_no_bit_of_exact_distances(mesh, monkeypatch):
    """Points on faces, edges and corners, and above them, that walk on."""
    shape = MESHES[mesh]()
    rng = np.random.default_rng(0)
    vertices, triangles = shape.surface()
    weights = rng.dirichlet((1.0, 1.0, 1.0), POINTS)
    weights[: POINTS // 4] = np.eye(3)[rng.integers(0, 3, POINTS // 4)]
    weights[POINTS // 4 : POINTS // 2, 0] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    start = np.einsum("nk,nkc->nc", weights, vertices[triangles[rng.integers(0, len(triangles), POINTS)]])
    start += rng.choice([0.0, 1e-6, 1e-4, 1e-3], (POINTS, 1)) * rng.normal(size=(POINTS, 3))
    way = rng.normal(size=(POINTS, 3))
    remembering, _alive = with_memory(shape)
    monkeypatch.setattr(body_shapes, "TRUST", 0.0)
    forgetting, _alive_too = with_memory(shape)
    searched, met = [], []
    for step in range(12):
        points = wp.array(start + way * (2e-6 * step if step < 9 else 1e-4 * step), dtype=wp.vec3d)
        reach = (2e-6, 2e-4)[step % 2]
        found = [wp.empty(POINTS, dtype=wp.vec4d) for _ in range(2)]
        before = remembering.seen.numpy().copy()
        for body, out in zip((remembering, forgetting), found, strict=True):
            wp.launch(ask, POINTS, inputs=[points, reach, body], outputs=[out])
        searched.append((remembering.seen.numpy() != before).any(axis=1).mean())
        assert found[0].numpy().tobytes() == found[1].numpy().tobytes()
        exact = wp.empty(POINTS, dtype=wp.float64)
        wp.launch(ask_all, POINTS, inputs=[points, remembering], outputs=[exact])
        distance = np.abs(found[0].numpy()[:, 3])
        np.testing.assert_allclose(distance, np.minimum(exact.numpy(), reach), rtol=1e-12, atol=1e-16)
        met.append((distance < reach).sum())
    assert searched[0] == 1.0
    assert min(met[1:9:2]) > 500
    assert max(searched[2:9]) < 0.25
