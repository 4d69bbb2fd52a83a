"""Triangulation of polygonal faces."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import signed_areas
from .file_checks import listed


def triangulate(
    where: str, points: np.ndarray, counts: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate faces, keeping their order: triangles, shape (F, 3), and the face of each, shape (F,).

    A quadrilateral is divided along its shorter interior diagonal, a face with more corners by a constrained Delaunay
    triangulation. `counts` are the numbers of corners, 3 or more, `corners` the points of all faces in turn.
    Raises InputError, which begins with `where`, if a face crosses or touches itself.
    """
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    threes, fours = np.flatnonzero(counts == 3), np.flatnonzero(counts == 4)
    triangles, face_of = [corners[start[threes, None] + np.arange(3)]], [threes]
    if len(fours):
        halves, crossed = _halves(points, corners[start[fours, None] + np.arange(4)])
        _refuse_crossed(where, fours[crossed])
        triangles.append(halves.reshape(-1, 3))
        face_of.append(np.repeat(fours, 2))
    for face in np.flatnonzero(counts > 4):
        loop = corners[start[face] : start[face] + counts[face]]
        pieces = _divided(points[loop])
        if pieces is None:
            _refuse_crossed(where, np.array([face]))
        triangles.append(loop[pieces])
        face_of.append(np.full(len(loop) - 2, face))
    joined = np.concatenate(face_of)
    order = np.argsort(joined, kind="stable")
    return np.concatenate(triangles)[order], joined[order]


def sides_of(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Sides of faces, pairs of points, shape (sum of counts, 2); arguments as for `triangulate`."""
    end = np.cumsum(counts)
    following = np.arange(1, len(corners) + 1)
    following[end - 1] = end - counts
    return np.column_stack([corners, corners[following]])


def repeated_faces(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Mask of the faces with the same corners as an earlier one, shape (P,); arguments as for `triangulate`."""
    start, again = np.cumsum(counts) - counts, np.zeros(len(counts), bool)
    for count in np.unique(counts):
        faces = np.flatnonzero(counts == count)
        sets = np.sort(corners[start[faces, None] + np.arange(count)], axis=1)
        again[faces] = True
        again[faces[np.unique(sets, axis=0, return_index=True)[1]]] = False
    return again


def _refuse_crossed(where: str, faces: np.ndarray) -> None:
    if len(faces):
        raise InputError(f"{where}: {listed(faces, 'face')} with sides that cross or touch: expected simple polygons")


def _halves(points: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both triangles of each quadrilateral, shape (Q, 2, 3), and a mask of those without an interior diagonal, (Q,)."""
    divided = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
    inside, lengths = [], []
    for (first, second), (a, b) in zip(divided, ((0, 2), (1, 3)), strict=True):
        normals = [
            np.cross(points[quads[:, t[1]]] - points[quads[:, t[0]]], points[quads[:, t[2]]] - points[quads[:, t[0]]])
            for t in (first, second)
        ]
        inside.append((normals[0] * normals[1]).sum(axis=1) > 0.0)
        lengths.append(np.linalg.norm(points[quads[:, a]] - points[quads[:, b]], axis=1))
    # Equal diagonals, as of squares, differ by round-off.
    other = inside[1] & (~inside[0] | (lengths[1] < (1.0 - 1e-9) * lengths[0]))
    return quads[np.arange(len(quads))[:, None, None], divided[other.astype(int)]], ~(inside[0] | inside[1])


def _divided(loop: np.ndarray) -> np.ndarray | None:
    """Triangles of one polygon, (n, 3), projected onto its mean plane, shape (n - 2, 3); None if it touches itself."""
    import shapely

    centred = loop - loop.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(centred, axis, axis=1)
    polygon = shapely.Polygon(flat)
    corner = {place: k for k, place in enumerate(map(tuple, flat.tolist()))}
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)) if polygon.is_valid else []
    # A ring that touches itself is divided into fewer triangles.
    if len(pieces) != len(loop) - 2:
        return None
    triangles = np.array([[corner[place] for place in piece.exterior.coords[:3]] for piece in pieces])
    upward = normal[axis] * (-1.0 if axis == 1 else 1.0)
    turned = signed_areas(flat, triangles) * upward < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles
