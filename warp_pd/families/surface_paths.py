"""Points of a curved sheet that are close in space but not along the sheet, for example across a fold or slit."""

from __future__ import annotations

import numpy as np

from ..geometry.sheet import Sheet
from ..geometry.triangulation import boundary_edges, undirected

# Longest path along the edges of the triangles between points that share a bond, over their distance: a square lattice
# without one of its diagonals has 1.42.
LONGEST_PATH = 1.5
# Longest path around the tip of a slit between two bonded points, divided by their distance, as in visibility.py; and
# the fraction by which points on a slit are moved into their triangles.
DETOUR, ASIDE = 1.2, 1e-3
# A pair of points is looked at if its normals turn by more than 60 degrees, or if it leaves a tangent plane by more
# than 30 degrees.
LEAST_COSINE, MOST_RISE = 0.5, 0.5
# Entries of the table of distances that is in memory at a time.
BLOCK = 4_000_000


def apart_along(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask, shape (B,), of pairs of points, shape (B, 2), that are far apart along the sheet.

    Only pairs near open edges, or where the sheet comes close to itself, are checked.
    """
    reach = float(np.linalg.norm(sheet.points[pairs[:, 1]] - sheet.points[pairs[:, 0]], axis=1).max(initial=0.0))
    looked_at = np.flatnonzero(_near_suspects(sheet, pairs)[pairs].all(axis=1))
    lost = through_slits(sheet, pairs)
    if len(looked_at):
        chosen = pairs[looked_at]
        chord = np.linalg.norm(sheet.points[chosen[:, 1]] - sheet.points[chosen[:, 0]], axis=1)
        lost[looked_at] |= _paths(sheet, chosen, LONGEST_PATH * reach) > LONGEST_PATH * chord
    return lost


def through_slits(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask, shape (B,), of pairs of points, shape (B, 2), separated by a slit and too far from its tip for a bond.

    A slit is where open edges of triangles coincide; each pair of edges is examined in its tangent plane. Points on a
    slit are moved slightly into their own triangles, so that the points of its two faces lie on different sides.
    """
    lost = np.zeros(len(pairs), bool)
    edges = boundary_edges(sheet.triangles)
    on_edge, ends = np.unique(edges, return_inverse=True)
    place = np.unique(sheet.points[on_edge], axis=0, return_inverse=True)[1].ravel()
    faces = np.bincount(undirected(place[ends.reshape(-1, 2)]), minlength=1)
    faces = edges[(faces == 2)[undirected(place[ends.reshape(-1, 2)])]]
    if not len(faces) or not len(pairs):
        return lost
    doubled = on_edge[np.bincount(place)[place] == 2]
    tips = np.setdiff1d(faces, doubled)
    points = sheet.points.copy()
    for point in doubled:
        own = sheet.triangles[(sheet.triangles == point).any(axis=1)]
        points[point] += ASIDE * (sheet.points[own].mean(axis=(0, 1)) - points[point])
    tail, head = points[pairs[:, 0]], points[pairs[:, 1]]
    length = np.linalg.norm(head - tail, axis=1)
    open_pairs = ~np.isin(pairs, tips).any(axis=1)
    tolerance = 2.0 * ASIDE * sheet.widest_spacing
    for a, b in faces:
        start, along = sheet.points[a], sheet.points[b] - sheet.points[a]
        size = float(np.linalg.norm(along))
        near = np.flatnonzero(open_pairs & (np.linalg.norm(tail - start, axis=1) <= length.max() + size))
        across = np.cross(sheet.normals[[a, b]].mean(axis=0), along / size)
        first, last = (tail[near] - start) @ across, (head[near] - start) @ across
        opposite = first * last < 0.0
        near, first, last = near[opposite], first[opposite], last[opposite]
        way = tail[near] - start + (first / (first - last))[:, None] * (head[near] - tail[near])
        at = way @ along / size
        # A bond may pass through the tip itself.
        begin, end = (-1.0 if point in tips else 1.0 for point in (a, b))
        lost[near[(at > -begin * tolerance) & (at < size + end * tolerance)]] = True
    for tip in sheet.points[tips]:
        around = np.linalg.norm(tail - tip, axis=1) + np.linalg.norm(head - tip, axis=1)
        lost &= around > DETOUR * length
    return lost


def _near_suspects(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask of points on an open edge, in a suspicious pair, or in a pair with one of these, shape (N,)."""
    normals = sheet.normals
    chord = sheet.points[pairs[:, 1]] - sheet.points[pairs[:, 0]]
    most = MOST_RISE * np.linalg.norm(chord, axis=1)
    suspicious = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) < LEAST_COSINE
    for end in range(2):
        suspicious |= np.abs((normals[pairs[:, end]] * chord).sum(axis=1)) > most
    suspect = np.zeros(sheet.size, bool)
    suspect[pairs[suspicious]] = True
    for part in sheet.parts.values():
        suspect[part] = True
    near = suspect.copy()
    near[pairs[suspect[pairs].any(axis=1)]] = True
    return near


def _paths(sheet: Sheet, pairs: np.ndarray, limit: float) -> np.ndarray:
    """Shortest paths along edges of triangles between the points of pairs [m], infinite above the limit, shape (B,)."""
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import cKDTree

    near = cKDTree(sheet.points[np.unique(pairs)]).query(sheet.points, distance_upper_bound=limit * 1.001)[0] < np.inf
    local = np.cumsum(near) - 1
    sides = sheet.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    sides = np.unique(np.sort(sides[near[sides].all(axis=1)], axis=1), axis=0)
    length = np.linalg.norm(sheet.points[sides[:, 1]] - sheet.points[sides[:, 0]], axis=1)
    size = int(near.sum())
    graph = sparse.csr_array((length, (local[sides[:, 0]], local[sides[:, 1]])), shape=(size, size))
    order = np.argsort(pairs[:, 0], kind="stable")
    tails, heads = local[pairs[order]].T
    found = np.empty(len(pairs))
    sources, begins = np.unique(tails, return_index=True)
    ends = np.append(begins[1:], len(tails))
    step = max(1, BLOCK // size)
    for first in range(0, len(sources), step):
        block = slice(first, first + step)
        distance = dijkstra(graph, directed=False, indices=sources[block], limit=limit)
        rows = slice(begins[block][0], ends[block][-1])
        # The tails ascend: their ranks are the rows of the table.
        ranks = np.cumsum(np.append(0, np.diff(tails[rows]) != 0))
        found[order[rows]] = distance[ranks, heads[rows]]
    return found
