"""Curved surfaces: from vertices and triangles, tubes and spheres."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError, corners, count, counts, one_of, positions, positive
from ..gas.enclosed import volume_of
from ..geometry.sheet import Shape
from ..geometry.triangulation import boundary_edges, cell_triangles, doubled_normals, local_spacings, require_one_side
from .seams import require_distinct, seam_notes

# Arc of an edge of the icosahedron [rad].
EDGE_ARC = float(np.arctan(2.0))
# Rounds in which the points of a sphere move to the middle of the triangles around them.
ROUNDS = 10


def surface(vertices: np.ndarray, triangles: np.ndarray, spacing: float | None, graded: bool = False) -> Shape:
    """A surface of triangles in space; arguments as for `Sheet.from_surface`."""
    points = positions("vertices", vertices, components=3)
    one_of("graded", graded, (True, False))
    if graded and spacing is not None:
        raise InputError(f"graded = True and spacing = {spacing!r}: expected only one of them")
    triangles = corners("triangles", triangles, len(points))
    doubled = doubled_normals(points, triangles)
    sizes = np.linalg.norm(doubled, axis=1)
    if (sizes <= 1e-12 * sizes.max()).any():
        flat = int(np.argmin(sizes))
        raise InputError(f"triangles[{flat}] = {triangles[flat].tolist()}: expected corners that span an area")
    rim = _rim(points, triangles)
    notes = seam_notes("triangles", points, triangles)
    areas = _point_sums(np.repeat(sizes[:, None] / 6.0, 3, axis=1), triangles, len(points))
    unused = np.flatnonzero(areas == 0.0)
    if len(unused):
        raise InputError(f"vertices[{unused[0]}] belongs to no triangle: expected every vertex in a triangle")
    require_distinct("vertices", points, triangles)
    normals = vertex_normals(points, triangles)
    lengths = np.linalg.norm(normals, axis=1)
    if (folded := np.flatnonzero(lengths <= 1e-6 * np.median(lengths))).size:
        raise InputError(
            f"vertices[{folded[0]}]: the triangles around it are folded back to back; expected a unique normal"
        )
    spacings = local_spacings(points, triangles) if graded else None
    if spacings is not None:
        spacing = float(spacings.min())
    return Shape(
        points=points,
        areas=areas,
        triangles=triangles,
        spacing=float(np.sqrt(areas.mean())) if spacing is None else positive("spacing", spacing),
        spacings=spacings,
        frames=tangents(normals),
        parts={"rim": rim} if len(rim) else {},
        notes=tuple(notes),
    )


def tube(radius: float, length: float, points: int | tuple[int, int]) -> Shape:
    """A tube along z; arguments as for `Sheet.tube`."""
    radius, length = positive("radius", radius), positive("length", length)
    if isinstance(points, tuple):
        around, along = counts("points", points, 3)
        count("points[0]", around, 6)
    else:
        around = count("points", points, 6)
        along = max(3, round(length / (2.0 * np.pi * radius) * around) + 1)
    angle = 2.0 * np.pi * np.arange(around) / around
    dx, dz = 2.0 * np.pi * radius / around, length / (along - 1)
    turn, height = np.tile(angle, along), np.repeat(dz * np.arange(along), around)
    cosine, sine = np.cos(turn), np.sin(turn)
    nothing = np.zeros_like(turn)
    e1, e2 = np.column_stack([-sine, cosine, nothing]), np.column_stack([nothing, nothing, nothing + 1.0])
    index = np.arange(around * along, dtype=np.int32)
    fraction = np.where((index < around) | (index >= around * (along - 1)), 0.5, 1.0)
    # One column more than there are points around: the last one is the first.
    cells = cell_triangles(np.ones((along - 1, around), bool))
    row, column = np.divmod(cells, around + 1)
    return Shape(
        points=np.column_stack([radius * cosine, radius * sine, height]),
        areas=fraction * dx * dz,
        triangles=(row * around + column % around).astype(np.int32),
        spacing=float(np.sqrt(dx * dz)),
        frames=np.stack([e1, e2], axis=-1),
        parts={"bottom": index[:around], "top": index[-around:]},
    )


def sphere(radius: float, points: int) -> Shape:
    """A sphere about the origin; arguments as for `Sheet.sphere`."""
    radius = positive("radius", radius)
    parts = max(1, round(count("points", points, 2) * EDGE_ARC / (0.5 * np.pi)))
    unit, triangles = _geodesic_grid(parts)
    for _ in range(ROUNDS):
        middle = unit[triangles].sum(axis=1)
        middle *= (_solid_angles(unit, triangles) / np.linalg.norm(middle, axis=1))[:, None]
        moved = _point_sums(np.repeat(middle[:, None], 3, axis=1), triangles, len(unit))
        unit = moved / np.linalg.norm(moved, axis=1)[:, None]
    third = radius**2 * _solid_angles(unit, triangles) / 3.0
    areas = _point_sums(np.repeat(third[:, None], 3, axis=1), triangles, len(unit))
    return Shape(
        points=radius * unit,
        areas=areas,
        triangles=triangles,
        spacing=float(np.sqrt(areas.mean())),
        frames=tangents(unit),
    )


def tangents(normals: np.ndarray) -> np.ndarray:
    """Orthonormal e1 and e2 with e1 x e2 along the normals, as columns, shape (N, 3, 2); `normals` has shape (N, 3)."""
    n = normals / np.linalg.norm(normals, axis=1)[:, None]
    axis = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    e1 = axis - (axis * n).sum(axis=1)[:, None] * n
    e1 /= np.linalg.norm(e1, axis=1)[:, None]
    return np.stack([e1, np.cross(n, e1)], axis=-1)


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Normals at the points, of any length, shape (N, 3): exact on spheres.

    Source: Max, Weights for computing vertex normals from facet normals, J. Graphics Tools 4 (1999) 1-6.
    """
    p = points[triangles]
    corner_values = np.empty((len(triangles), 3, 3))
    for corner in range(3):
        a, b = p[:, (corner + 1) % 3] - p[:, corner], p[:, (corner + 2) % 3] - p[:, corner]
        corner_values[:, corner] = np.cross(a, b) / ((a * a).sum(axis=1) * (b * b).sum(axis=1))[:, None]
    return _point_sums(corner_values, triangles, len(points))


def _point_sums(corner_values: np.ndarray, triangles: np.ndarray, points: int) -> np.ndarray:
    """Sum values at the corners of triangles, shape (F, 3, ...), to the points, shape (N, ...)."""
    corners, inner = triangles.ravel(), corner_values.shape[2:]
    columns = corner_values.reshape(len(corners), -1).T
    return np.stack([np.bincount(corners, column, points) for column in columns], axis=-1).reshape(points, *inner)


def _rim(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Points on the open edges of the surface, int32, ascending."""
    require_one_side(triangles)
    open_sides = boundary_edges(triangles)
    if len(open_sides) == 0 and volume_of(points - points.mean(axis=0), triangles) <= 0.0:
        raise InputError("triangles: expected triangles counter-clockwise seen from outside, got clockwise")
    return np.unique(open_sides).astype(np.int32)


def _solid_angles(unit: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Areas of spherical triangles on the unit sphere, shape (F,) (Van Oosterom and Strackee)."""
    a, b, c = (unit[triangles[:, k]] for k in range(3))
    volume = (a * np.cross(b, c)).sum(axis=1)
    around = 1.0 + (a * b).sum(axis=1) + (b * c).sum(axis=1) + (c * a).sum(axis=1)
    return np.asarray(2.0 * np.arctan2(volume, around))


def _geodesic_grid(parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the unit sphere, shape (N, 3), and triangles: an icosahedron whose edges are divided into `parts`."""
    corners, faces = _icosahedron()
    steps = [(a, b) for a in range(parts + 1) for b in range(parts + 1 - a)]
    index = {step: k for k, step in enumerate(steps)}
    weights = np.array([(parts - a - b, a, b) for a, b in steps]) / parts
    # Equal arcs along the edges.
    weight = np.sin(weights * EDGE_ARC)
    points = np.einsum("sk,fkc->fsc", weight, corners[faces]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1)[:, None]
    local = []
    for a, b in steps:
        if a + b < parts:
            local.append((index[a, b], index[a + 1, b], index[a, b + 1]))
        if a + b < parts - 1:
            local.append((index[a + 1, b], index[a + 1, b + 1], index[a, b + 1]))
    everywhere = (np.arange(len(faces))[:, None, None] * len(steps) + np.array(local)).reshape(-1, 3)
    # Points on edges of the icosahedron occur once for each face that has them.
    _, first, same = np.unique(np.round(points * 1e9).astype(np.int64), axis=0, return_index=True, return_inverse=True)
    return points[first], same.ravel()[everywhere].astype(np.int32)


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Corners on the unit sphere, shape (12, 3), and faces, counter-clockwise seen from outside, shape (20, 3)."""
    from scipy.spatial import ConvexHull

    golden = 0.5 * (1.0 + np.sqrt(5.0))
    corners = np.array([(0.0, y, z * golden) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    corners = np.vstack([np.roll(corners, k, axis=1) for k in range(3)]) / np.hypot(1.0, golden)
    faces = ConvexHull(corners).simplices
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = (a * np.cross(b, c)).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return corners, faces
