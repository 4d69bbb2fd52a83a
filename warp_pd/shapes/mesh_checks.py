"""Checks of meshes from files; each error message is one line with the offending indices, counted from 0."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import (
    boundary_edges,
    crowded_edges,
    directed_edges,
    doubled_normals,
    flipped,
    pieces,
    signed_areas,
)
from .file_checks import listed
from .seams import near_pairs

# Least area of a triangle over the mean.
LEAST_AREA = 1e-12
# Largest coordinate whose fourth power is finite.
LARGEST = 1e70


def require_faces(where: str, points: np.ndarray, counts: np.ndarray, corners: np.ndarray) -> None:
    """Check the faces of a file; `corners` are the point indices of all faces, one after the other, `counts` of each.

    Raises InputError, which begins with `where`, if there are no faces, fewer than three corners, missing points, or
    coordinates that are not finite.
    """
    if len(counts) == 0:
        raise InputError(f"{where}: no triangles or quadrilaterals: expected at least one")
    face_of = np.repeat(np.arange(len(counts)), counts)
    _refuse(where, "face", np.flatnonzero(counts < 3), "with fewer than 3 corners: expected triangles")
    missing = np.unique(face_of[(corners < 0) | (corners >= len(points))])
    _refuse(where, "face", missing, f"with points that are missing: expected 0 to {len(points) - 1}")
    used = np.unique(corners)
    bad = used[~(np.abs(points[used]) < LARGEST).all(axis=1)]
    _refuse(where, "point", bad, f"with coordinates that are NaN or infinite: expected numbers below {LARGEST:g}")


def require_surface(where: str, points: np.ndarray, triangles: np.ndarray, face_of: np.ndarray) -> None:
    """Check a triangulated surface; `face_of` is the face in the file of each triangle, shape (F,).

    Raises InputError, which begins with `where`, for degenerate triangles, coincident points, edges with more than two
    triangles, or triangles with flipped orientation.
    """
    areas = 0.5 * np.linalg.norm(doubled_normals(points, triangles), axis=1)
    thin = np.unique(face_of[~(areas > LEAST_AREA * areas.mean())])
    _refuse(where, "face", thin, f"without area: expected more than {LEAST_AREA:g} of the mean")
    crowded = crowded_edges(triangles)
    _refuse(where, "edge", crowded, "with more than two triangles: expected one or two")
    turned = flipped(triangles)
    if turned is None:
        raise InputError(f"{where}: the surface is not orientable (a Moebius strip): expected an orientable surface")
    _refuse(where, "face", np.unique(face_of[turned]), "flipped against the neighbours: expected one orientation")


def require_distinct_points(where: str, points: np.ndarray, triangles: np.ndarray) -> None:
    """Check that no two points of triangles are at one place. Raises InputError if some are."""
    pairs = near_pairs(points, directed_edges(triangles))
    _refuse(where, "pair", pairs, "of coincident points: expected distinct points")


def require_unfolded(where: str, points: np.ndarray, triangles: np.ndarray, face_of: np.ndarray) -> None:
    """Check that no piece of a flat mesh is folded over itself; points have shape (V, 2 or more)."""
    sign = np.sign(signed_areas(points, triangles))
    piece = pieces(triangles)
    most = np.sign(np.bincount(piece, sign))[piece]
    folded = np.unique(face_of[sign != np.where(most == 0.0, 1.0, most)])
    _refuse(where, "face", folded, "folded over the neighbours: expected a flat mesh that covers each place once")


def require_closed(where: str, triangles: np.ndarray) -> None:
    """Check that a surface has no boundary. Raises InputError if it is not."""
    _refuse(where, "edge", boundary_edges(triangles), "with one triangle: expected a closed surface")


def _refuse(where: str, noun: str, indices: np.ndarray, words: str) -> None:
    if len(indices):
        raise InputError(f"{where}: {listed(indices, noun)} {words}")
