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
# Triangles of a piece that are compared with other pieces: most, and least of large meshes.
MOST_COMPARED, LEAST_COMPARED = 100, 4
# Pairs of places and triangles that are compared, and those at a time.
PAIRS, AT_ONCE = 2_000_000, 100_000
# Corners, middles of the edges and the centre of a triangle, slightly inside, and their depth over its size.
PLACES = np.array([(98, 1, 1), (1, 98, 1), (1, 1, 98), (49, 49, 2), (49, 2, 49), (2, 49, 49), (100 / 3,) * 3]) / 100.0
DEPTH = 1e-3
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


def require_solid(where: str, points: np.ndarray, triangles: np.ndarray) -> str:
    """Check that each piece of a closed surface faces outwards, or is a cavity of another one.

    Returns a line on a piece that lies or reaches inside another one, "" if none was found: places just behind some of
    its triangles are compared with the other pieces. Raises InputError, which begins with `where`, for a piece that
    faces inwards.
    """
    overlap = ""
    piece = pieces(triangles)
    order = np.argsort(piece, kind="stable")
    first = np.flatnonzero(np.diff(piece[order], prepend=-1))
    corners = points[triangles[order]]
    sets = np.split(corners, first[1:])
    low, high = np.minimum.reduceat(corners.min(axis=1), first), np.maximum.reduceat(corners.max(axis=1), first)
    for number, own in enumerate(sets):
        volume = float(np.linalg.det(own - own[0, 0]).sum() / 6.0)
        near = np.flatnonzero(((low <= high[number]) & (high >= low[number])).all(axis=1))
        near = near[near != number]
        if volume > 0.0 and not len(near):
            continue
        middle = 0.5 * (low[number] + high[number])
        what = "the mesh" if len(sets) == 1 else f"piece {number} ({len(own)} triangles around {_place(middle)} m)"
        affordable = PAIRS // (len(PLACES) * (len(own) + sum(len(sets[other]) for other in near)))
        compared = min(max(affordable, LEAST_COMPARED), MOST_COMPARED)
        places = _places_behind(own[:: -(-len(own) // compared)])
        # A piece thinner than that depth has some of them beyond itself.
        places = places[np.abs(_winding_numbers(places, own) - (volume > 0.0)) < 0.1]
        # Undecided, no whole number, where the surface of another piece is.
        times = np.sum([_winding_numbers(places, sets[other]) for other in near], axis=0) + np.zeros(len(places))
        times = times[np.abs(times - np.rint(times)) < 0.1]
        if volume <= 0.0 and not (len(times) and (times > 0.5).all()):
            raise InputError(
                f"{where}: {what} encloses {volume:.4g} m^3: expected triangles that face outwards"
                f"{', unless it is a cavity of another piece' if len(sets) > 1 else ''}"
            )
        if (wrong := int((np.rint(times) != (volume <= 0.0)).sum())) and not overlap:
            overlap = f"{what} lies inside another one at {wrong} of {len(times)} places compared"
    return overlap


def _places_behind(corners: np.ndarray) -> np.ndarray:
    """Places just behind triangles, on the side of the solid, shape (P, 3); corners have shape (F, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    depth = DEPTH * normals / np.sqrt(np.linalg.norm(normals, axis=1))[:, None]
    return np.asarray((PLACES @ corners - depth[:, None]).reshape(-1, 3))


def _winding_numbers(places: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """How often a closed surface, given by its corners, (F, 3, 3), goes around places, (P, 3); shape (P,).

    Source: Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126: the solid angle of a triangle.
    """
    found = np.zeros(len(places))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    inside = np.flatnonzero(((places >= low) & (places <= high)).all(axis=1))
    for some in np.array_split(inside, max(1, len(inside) * len(corners) // AT_ONCE)):
        arms = corners[None] - places[some, None, None]
        lengths = np.linalg.norm(arms, axis=3)
        a, b, c = (arms[:, :, k] for k in range(3))
        total = lengths.prod(axis=2)
        for k in range(3):
            total += (arms[:, :, k] * arms[:, :, (k + 1) % 3]).sum(axis=2) * lengths[:, :, (k + 2) % 3]
        found[some] = np.arctan2((a * np.cross(b, c)).sum(axis=2), total).sum(axis=1) / (2.0 * np.pi)
    return found


def _place(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:.4g}' for value in point.tolist())})"


def _refuse(where: str, noun: str, indices: np.ndarray, words: str) -> None:
    if len(indices):
        raise InputError(f"{where}: {listed(indices, noun)} {words}")
