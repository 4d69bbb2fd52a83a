"""Couplings of neighbouring points (cotangent Laplacian) for a field that is linear on every triangle."""

from __future__ import annotations

import numpy as np

from .sheet import Shape
from .triangulation import Lattice, boundary_edges, directed_edges

# Largest distance of a cut from the edges of triangles that it has removed, what counts as near along it, and how far
# inside such an edge it may lie, in spacings.
REMOVED, ASIDE, TOUCHES = 1.5, 0.1, 0.02


def gradient_couplings(shape: Shape, of: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours of every point and their couplings w_ik, with sum_ik w_ik (d_i - d_k)^2 / 2 = integral of |grad d|^2.

    w_ik is half the sum of the cotangents of the angles opposite an edge; negative values, from obtuse angles, are set
    to zero. Points on opposite sides of a cut are not coupled, except on a lattice or grid.

    Returns neighbours, int32, and couplings [-], both of shape (K, N), or of the points `of` alone, shape (N,). Missing
    neighbours are the point itself with zero coupling.
    """
    of = np.arange(shape.size, dtype=np.int32) if of is None else of
    if shape.whole_lattice is not None:
        return _of_lattice(shape.whole_lattice, of)
    if not len(shape.triangles):
        return of[None], np.zeros((1, len(of)))
    return _of_triangles(shape.positions, np.asarray(shape.triangles), of)


def _of_triangles(points: np.ndarray, triangles: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Couplings of points that triangles connect."""
    from scipy.sparse import coo_array

    size = len(points)
    edges = directed_edges(triangles)
    facing = points[np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])]
    a, b = points[edges[:, 0]] - facing, points[edges[:, 1]] - facing
    cotangent = (a * b).sum(axis=1) / np.linalg.norm(np.cross(a, b), axis=1)
    low, high = np.sort(edges.astype(np.int64), axis=1).T
    keys, number = np.unique(low * size + high, return_inverse=True)
    weights = np.maximum(0.5 * np.bincount(number, cotangent), 0.0)
    low, high = np.divmod(keys, size)
    both = np.concatenate([low, high]), np.concatenate([high, low])
    graph = coo_array((np.tile(weights, 2), both), shape=(size, size)).tocsr()
    counts = np.diff(graph.indptr)
    there = np.arange(counts.max()) < counts[:, None]
    neighbours, table = np.tile(np.arange(size, dtype=np.int32)[:, None], there.shape[1]), np.zeros(there.shape)
    neighbours[there], table[there] = graph.indices, graph.data
    return np.ascontiguousarray(neighbours[of].T), np.ascontiguousarray(table[of].T)


def _of_lattice(lattice: Lattice, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Couplings of points of a lattice, without diagonals, whose opposite angles are right angles."""
    columns, rows = lattice.columns, lattice.rows
    row, column = np.divmod(of, columns)
    across, along = lattice.dy / lattice.dx * _width(row, rows), lattice.dx / lattice.dy * _width(column, columns)
    steps = [
        (1, column < columns - 1, across), (-1, column > 0, across),
        (columns, row < rows - 1, along), (-columns, row > 0, along),
    ]  # fmt: skip
    neighbours = [np.where(there, of + step, of) for step, there, _ in steps]
    return np.array(neighbours, np.int32), np.array([np.where(there, weight, 0.0) for _, there, weight in steps])


def _width(place: np.ndarray, places: int) -> np.ndarray:
    """Width of the row of each point in spacings: 0.5 for the first and last of several rows, otherwise 1."""
    return np.where((places > 1) & ((place == 0) | (place == places - 1)), 0.5, 1.0)


def crack_segments(shape: Shape) -> np.ndarray:
    """Ends of the cuts of a shape and of coincident edge pairs (cracks) [m], shape (S, 2, dimensions)."""
    points = shape.points
    cuts = np.asarray(shape.cuts, float).reshape(-1, 2, points.shape[1])
    if shape.whole_lattice is not None:
        return cuts
    edges, faces = _boundary(shape)
    # Each part of a crack has two faces, which run in opposite directions.
    return np.concatenate([cuts, points[edges[faces & (_order(points[edges]) > 0)]]])


def edge_segments(shape: Shape) -> np.ndarray:
    """Ends of the free edges of a shape, without cracks [m], shape (S, 2, dimensions)."""
    if shape.whole_lattice is not None:
        (left, low), (right, high) = shape.points.min(axis=0), shape.points.max(axis=0)
        corners = np.array([[left, low], [right, low], [right, high], [left, high]])
        return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    edges, faces = _boundary(shape)
    ends = np.asarray(shape.points[edges[~faces]])
    return ends[~_along_cuts(shape, ends)] if shape.cuts else ends


def _along_cuts(shape: Shape, edges: np.ndarray) -> np.ndarray:
    """Whether an edge, (S, 2, 2) with the sheet on its left, faces a cut: it bounds a triangle that the cut removed.

    Then all of the cut near it lies outside. A cut that ends or begins at an edge lies inside.
    """
    middle, along = edges.mean(axis=1), edges[:, 1] - edges[:, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    found = np.zeros(len(edges), bool)
    for start, end in np.asarray(shape.cuts, float):
        way, step = end - start, ASIDE * shape.spacing / np.linalg.norm(end - start)
        place = ((middle - start) @ way / float(way @ way)).clip(0.0, 1.0)
        near, outside = np.zeros(len(edges), bool), np.ones(len(edges), bool)
        for beside in (0.0, step, -step):
            apart = start + (place + beside).clip(0.0, 1.0)[:, None] * way - middle
            near |= np.linalg.norm(apart, axis=1) < REMOVED * shape.spacing
            outside &= (apart * outward).sum(axis=1) > -TOUCHES * shape.spacing
        found |= near & outside
    return found


def _order(pairs: np.ndarray) -> np.ndarray:
    """1 where the first end of a pair comes first in the order of x, y, z, otherwise -1; pairs (S, 2, dimensions)."""
    apart = pairs[:, 1] - pairs[:, 0]
    first = np.argmax(apart != 0.0, axis=1)
    return np.asarray(np.sign(apart[np.arange(len(apart)), first]))


def _boundary(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the boundary, (B, 2), and whether each is a face of a crack, (B,)."""
    edges = None if shape.frames is not None else shape.barriers
    edges = boundary_edges(shape.triangles) if edges is None else edges
    if not len(edges):
        return np.zeros((0, 2), np.int32), np.zeros(0, bool)
    places = np.round(shape.points[edges] / (1e-6 * shape.spacing)).astype(np.int64)
    there = {tuple(pair.ravel().tolist()) for pair in places}
    return edges, np.array([tuple(pair[::-1].ravel().tolist()) in there for pair in places])


def distance_from_segments(points: np.ndarray, segments: np.ndarray, within: float) -> np.ndarray:
    """Distance of points from the nearest segment [m], shape (N,); some beyond `within` are infinite."""
    nearest = np.full(len(points), np.inf)
    for start, end in segments:
        low, high = np.minimum(start, end) - within, np.maximum(start, end) + within
        at = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        along = end - start
        fraction = ((points[at] - start) @ along / max(float(along @ along), 1e-300)).clip(0.0, 1.0)
        apart = np.linalg.norm(points[at] - start - fraction[:, None] * along, axis=1)
        nearest[at] = np.minimum(nearest[at], apart)
    return nearest


def points_near(points: np.ndarray, chosen: np.ndarray, within: float) -> np.ndarray:
    """Mask of the points at most `within` [m] from one of `chosen`, a mask, too; both (N,)."""
    from scipy.spatial import cKDTree

    if not chosen.any():
        return np.zeros(len(points), bool)
    return np.asarray(cKDTree(points[chosen]).query(points, distance_upper_bound=within)[0] <= within)


def loose_ends(segments: np.ndarray) -> np.ndarray:
    """Ends that belong to only one segment [m], shape (E, dimensions), for segments of shape (S, 2, dimensions)."""
    ends = segments.reshape(-1, segments.shape[-1])
    _, first, count = np.unique(np.round(ends, 12), axis=0, return_index=True, return_counts=True)
    return np.asarray(ends[first[count == 1]])
