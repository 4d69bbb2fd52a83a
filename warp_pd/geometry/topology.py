"""Edges and sides of triangulated surfaces."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError


def directed_edges(triangles: np.ndarray) -> np.ndarray:
    """The three edges of each triangle in its direction, shape (3 F, 2); edge e belongs to triangle e % F."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def undirected(edges: np.ndarray) -> np.ndarray:
    """Index of each edge irrespective of its direction, shape (E,)."""
    low, high = np.sort(edges.astype(np.int64), axis=1).T
    _, number = np.unique(low * (int(high.max(initial=0)) + 1) + high, return_inverse=True)
    return np.asarray(number)


def boundary_sides(triangles: np.ndarray) -> np.ndarray:
    """Indices of the `directed_edges` that belong to only one triangle, ascending, shape (B,)."""
    number = undirected(directed_edges(triangles))
    return np.flatnonzero(np.bincount(number, minlength=1)[number] == 1)


def boundary_edges(triangles: np.ndarray) -> np.ndarray:
    """Edges that belong to only one triangle, with it on the left, int32, shape (B, 2)."""
    return np.asarray(directed_edges(triangles)[boundary_sides(triangles)], np.int32)


def edges_run_twice(triangles: np.ndarray) -> np.ndarray:
    """Edges with the same direction in two triangles, ascending, shape (K, 2)."""
    edges, size = directed_edges(triangles).astype(np.int64), int(triangles.max(initial=0)) + 1
    keys, uses = np.unique(edges @ np.array([size, 1]), return_counts=True)
    return np.column_stack(np.divmod(keys[uses > 1], size))


def require_one_side(triangles: np.ndarray) -> None:
    """Raise InputError if two triangles have an edge with the same direction."""
    if len(twice := edges_run_twice(triangles)):
        a, b = twice[0]
        raise InputError(
            f"triangles: two of them run along the edge from point {a} to point {b} in one direction: expected all "
            "counter-clockwise seen from outside, and two triangles at an edge at most"
        )


def crowded_edges(triangles: np.ndarray) -> np.ndarray:
    """Edges that belong to more than two triangles, shape (K, 2)."""
    edges = directed_edges(triangles)
    number = undirected(edges)
    first = np.unique(number, return_index=True)[1]
    return np.sort(edges[first[np.bincount(number, minlength=1) > 2]], axis=1)


def neighbours(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of triangles that share an edge, shape (K, 2), and whether their orientations are opposite.

    No edge may belong to more than two triangles.
    """
    edges = directed_edges(triangles)
    one, other = shared_sides(undirected(edges)).T
    return np.column_stack([one, other]) % len(triangles), edges[one, 0] == edges[other, 0]


def shared_sides(number: np.ndarray) -> np.ndarray:
    """Pairs of sides of triangles with the same number (`undirected`), shape (K, 2)."""
    order = np.argsort(number, kind="stable")
    shared = np.flatnonzero(number[order[1:]] == number[order[:-1]])
    return np.column_stack([order[shared], order[shared + 1]])


def pieces(triangles: np.ndarray) -> np.ndarray:
    """Index of the connected piece of each triangle, shape (F,); pieces share no edge."""
    pairs, _ = neighbours(triangles)
    return components(len(triangles), pairs)


def flipped(triangles: np.ndarray) -> np.ndarray | None:
    """Triangles with the minority orientation of their piece; None if a piece is not orientable.

    Each triangle is used twice, as given and reversed; neighbours with consistent orientation are connected. An
    orientable piece separates into two copies, and its given triangles are in one or the other.
    """
    count = len(triangles)
    pairs, opposite = neighbours(triangles)
    turned = np.where(opposite, count, 0)
    copies = np.concatenate(
        [
            np.column_stack([pairs[:, 0], pairs[:, 1] + turned]),
            np.column_stack([pairs[:, 0] + count, pairs[:, 1] + count - turned]),
        ]
    )
    label = components(2 * count, copies)
    upright, reverse = label[:count], label[count:]
    if (upright == reverse).any():
        return None
    piece = np.minimum(upright, reverse)
    first = upright == piece
    votes = np.bincount(piece, np.where(first, 1.0, -1.0), minlength=2 * count)
    return np.flatnonzero(np.where(votes[piece] >= 0.0, ~first, first))


def boundary_rings(edges: np.ndarray) -> list[np.ndarray]:
    """Closed rings of boundary edges, shape (B, 2): the points of each in order. A point may be in several."""
    following: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        following.setdefault(start, []).append(end)
    rings = []
    while following:
        at = start = next(iter(following))
        ring: list[int] = []
        while not ring or at != start:
            ring.append(at)
            ends = following[at]
            following_point = ends.pop()
            if not ends:
                del following[at]
            at = following_point
        rings.append(np.array(ring))
    return rings


def ring_names(points: np.ndarray, edges: np.ndarray) -> dict[str, np.ndarray]:
    """Points of the boundary rings of a flat sheet by name: "outline", "hole 1", "hole 2", ..., largest first.

    Several pieces have "outline 1", "outline 2", ... The edges have the sheet on their left.
    """
    rings = boundary_rings(edges)
    x, y = (([points[ring, c] for ring in rings]) for c in (0, 1))
    areas = [float(np.sum(a * np.roll(b, -1) - b * np.roll(a, -1))) for a, b in zip(x, y, strict=True)]
    outer = sorted((k for k, area in enumerate(areas) if area > 0.0), key=lambda k: -areas[k])
    holes = sorted((k for k, area in enumerate(areas) if area <= 0.0), key=lambda k: areas[k])
    names = ["outline"] if len(outer) == 1 else [f"outline {number}" for number in range(1, len(outer) + 1)]
    names += [f"hole {number}" for number in range(1, len(holes) + 1)]
    return {name: np.unique(rings[k]).astype(np.int32) for name, k in zip(names, outer + holes, strict=True)}


def components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Index of the connected component of each of `count` nodes, shape (count,); `pairs`, shape (K, 2), join them."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def joined_points(count: int, triangles: np.ndarray) -> np.ndarray:
    """Index of the connected piece of each of `count` points, shape (count,); triangles join their corners."""
    return components(count, np.column_stack([np.repeat(triangles[:, 0], 2), triangles[:, 1:].ravel()]))


def joined(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Index of the connected patch of each of some points, shape (P,); edges of triangles between them connect them."""
    edges = directed_edges(triangles)
    inside = edges[np.isin(edges, points).all(axis=1)]
    return np.asarray(components(int(max(triangles.max(), points.max())) + 1, inside)[points])


def split_along(points: int, triangles: np.ndarray, crack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Open a triangulation of `points` points along a crack.

    The corners at a point are divided into groups that are connected through triangles without crossing the crack. At a
    tip there is one group; an end on the edge of the sheet has two. The crack runs along edges of the counter-clockwise
    triangles, shape (F, 3); its points have shape (L,), and those of a closed one end with the first.

    Returns the triangles, those on the right side of the crack with the new points, shape (F, 3), and the points that
    have a copy, in order along the crack. The copies come after all other points.
    """
    edges, steps = directed_edges(triangles).astype(np.int64), np.column_stack([crack[:-1], crack[1:]])
    number = undirected(np.concatenate([edges, steps]))
    whole, on_crack = number[: len(edges)], np.isin(number[: len(edges)], number[len(edges) :])
    sides = shared_sides(whole)
    one, other = sides[~on_crack[sides[:, 1]]].T
    # Edge e starts at corner e and ends at the next corner of its triangle.
    after = np.roll(np.arange(len(edges)), -len(triangles))
    group = components(len(edges), np.column_stack([np.append(one, after[one]), np.append(after[other], other)]))
    keys = edges @ [points, 1]
    left, right = (np.flatnonzero(np.isin(keys, steps[:, way] @ [points, 1])) for way in ([0, 1], [1, 0]))
    left, right = (group[np.append(side, after[side])] for side in (left, right))
    corner = np.isin(group, np.setdiff1d(right, left))
    doubled = np.unique(crack, return_index=True)[1]
    doubled = crack[np.sort(doubled)]
    doubled = doubled[np.isin(doubled, edges[corner, 0])]
    copy = np.arange(points)
    copy[doubled] = points + np.arange(len(doubled))
    found = np.where(corner, copy[edges[:, 0]], edges[:, 0])
    return found.reshape(3, -1).T.astype(triangles.dtype), doubled
