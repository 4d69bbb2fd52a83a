"""A sheet drawn with fewer points: its triangulation contracted onto clusters of points.

Connected points in a cell of a cubic grid form a cluster, represented by the point nearest to the cell's node.
Connectivity is that of the last frame, so the two sides of a crack are never in the same cluster; points left without a
triangle form separate clusters, by the connectivity of the first frame. A triangle with corners in three clusters
becomes a triangle of their representatives, which is intact as long as one such triangle is. A crack between clusters
is drawn as wide as a drawn triangle, a crack through a cluster at its true width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangulation import components, directed_edges, triangle_areas

Triangles = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Drawn:
    """The drawn points and triangles of a sheet.

    Attributes:
        points: Indices of the points, ascending, shape (P,).
        triangles: Indices into `points`, shape (T, 3).
        intact: Whether each triangle is intact at each frame, shape (frames, T).
    """

    points: NDArray[np.int64]
    triangles: NDArray[np.int64]
    intact: NDArray[np.bool_]


def clusters(reference: NDArray[np.floating], first: Triangles, last: Triangles, most: int) -> NDArray[np.int64]:
    """Representative of each point, shape (N,); the point itself in a sheet of at most `most` points.

    `first` and `last` are the intact triangles of the first and last frame.
    """
    used = np.zeros(len(reference), bool)
    used[first] = True
    used[last] = True
    cluster = np.arange(len(reference))
    if np.count_nonzero(used) <= most:
        return cluster
    # A sheet torn to shreds has too many clusters: it is coarsened as it was in the first frame.
    loose = used.copy()
    loose[last] = False
    between = first[loose[first].all(axis=1)]
    for faces in (np.concatenate([last, between]), first):
        cluster = _joined(reference, faces, used, most)
        if len(np.unique(cluster[used])) <= 1.5 * most:
            break
    return cluster


def contracted(triangles: Triangles, cluster: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles between three clusters, smallest index first; may contain duplicates."""
    corners = cluster[triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    order = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.asarray(np.take_along_axis(corners, order, axis=1))


def drawn(frames: Sequence[NDArray[np.int64]], size: int) -> Drawn:
    """All contracted triangles of the frames, and when they are intact; a row of points has no triangles.

    Frames with the same triangles may share their array, which is then looked at once.
    """
    distinct = {id(corners): corners for corners in frames}
    keys = {name: _keys(corners, size) for name, corners in distinct.items()}
    every, first = np.unique(np.concatenate(list(keys.values())), return_index=True)
    points, triangles = np.unique(np.concatenate(list(distinct.values()))[first], return_inverse=True)
    present = {name: np.isin(every, key) for name, key in keys.items()}
    intact = np.stack([present[id(corners)] for corners in frames])
    if not len(every):
        points = np.arange(size)
    return Drawn(points, triangles.reshape(-1, 3), intact)


def _keys(corners: NDArray[np.int64], points: int) -> NDArray[np.generic]:
    """A key for each triangle, equal for equal triangles."""
    if points < 2**21:
        return np.asarray((corners[:, 0] * points + corners[:, 1]) * points + corners[:, 2])
    return np.ascontiguousarray(corners).view([("", corners.dtype)] * 3).ravel()


def _joined(reference: NDArray[np.floating], faces: Triangles, used: NDArray[np.bool_], most: int) -> NDArray[np.int64]:
    """Clusters of points connected by triangles.

    The grid has nodes at the ends of the sheet, so that points on its edges become representatives.
    """
    low, high = reference[used].min(axis=0), reference[used].max(axis=0)
    area = triangle_areas(reference, faces).sum()
    across = np.maximum(np.round((high - low) / np.sqrt(area / most)), 1)
    step = np.where(high > low, (high - low) / across, 1.0)
    node = np.round((reference - low) / step).astype(np.int64)
    cell = (node[:, 0] * (across[1] + 1) + node[:, 1]) * (across[2] + 1) + node[:, 2]
    ends = directed_edges(faces)
    label = components(len(reference), ends[cell[ends[:, 0]] == cell[ends[:, 1]]])
    far = np.linalg.norm((reference - low) / step - node, axis=1)
    order = np.lexsort((far, label))
    begins = np.concatenate([[True], label[order][1:] != label[order][:-1]])
    nearest = order[begins]
    return np.asarray(nearest[label])
