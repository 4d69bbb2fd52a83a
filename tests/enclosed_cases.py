"""Closed surfaces, and their enclosed volumes on a device without a force law."""

from types import SimpleNamespace

import numpy as np

from warp_pd import Sheet
from warp_pd.context import Context, find_device
from warp_pd.device.clock import Clock
from warp_pd.device.fields import FieldRegister
from warp_pd.geometry.sheet import Shape
from warp_pd.kernels.families import Layout
from warp_pd.kernels.integrate import StepOptions
from warp_pd.kernels.numeric import numeric

TETRAHEDRON = (
    np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]),
)
CORNERS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
CUBE = CORNERS, np.array(
    [[0, 3, 1], [0, 2, 3], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
     [2, 7, 3], [2, 6, 7], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]
)  # fmt: skip


def ball(rounds=2):
    """A tetrahedron whose edges are halved some times, on the unit sphere; irregular."""
    points, triangles = TETRAHEDRON
    for _ in range(rounds):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        distinct, which = np.unique(edges, axis=0, return_inverse=True)
        middle = len(points) + which.reshape(-1, 3)
        a, b, c = triangles.T
        ab, bc, ca = middle.T
        points = np.vstack([points, points[distinct].mean(axis=1)])
        triangles = np.vstack([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return points / np.linalg.norm(points, axis=1, keepdims=True), triangles


def enclosed(points, triangles, load, displacement, bits=64, held=None):
    """Force of a load on the points of a closed surface at a displacement, pressure, volume."""
    n = len(points)
    shape = Shape(points=points, areas=np.ones(n), triangles=triangles.astype(np.int32), spacing=0.1)
    sheet = Sheet.of(shape, thickness=1e-3, density=1e3)
    context = Context(
        sheet=sheet, given=sheet, device=find_device("cpu"), types=numeric(bits),
        options=StepOptions(bits, False, False, False, False),
        layout=Layout("cloud", bits), held=np.zeros(n, np.uint8) if held is None else held,
        initial_displacement=np.zeros((n, 3)), fields=FieldRegister(find_device("cpu")), clock=Clock(1.0),
    )  # fmt: skip
    built = load.build(context, SimpleNamespace(intact=None, damage=None))
    context.clock.allocate(context.fields, context.types)
    u = context.array("u", "test", context.types.vec3, displacement)
    force = context.array("f", "test", context.types.vec3, shape=n)
    built.add_force(context.stage("force", "once"), u, force)
    context.run("force")
    pressure, volume, _ = built.enclosed.numpy()
    return force.numpy().astype(np.float64), pressure, volume
