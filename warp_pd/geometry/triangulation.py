"""Triangulated surfaces: lattices, triangles, edges and sides."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError

Segment = tuple[tuple[float, float], tuple[float, float]]
# Part of the length of a segment that places along it are uncertain by.
ROUND_OFF = 1e-9
# Distance from the origin, over the extent, from which a triangulation is made about the middle.
FAR = 1e3


@dataclass(frozen=True)
class Lattice:
    """A complete rectangular grid; point (column, row) has the index column + row * columns.

    Attributes:
        columns: Points along x.
        rows: Points along y.
        dx: Spacing along x [m].
        dy: Spacing along y [m].
    """

    columns: int
    rows: int
    dx: float
    dy: float

    @property
    def points(self) -> int:
        """Number of points."""
        return self.columns * self.rows


@dataclass(frozen=True)
class CoarseLattice:
    """Every n-th column and row of a lattice, n = `stride`, and the last ones."""

    fine: Lattice
    stride: int

    @functools.cached_property
    def columns(self) -> np.ndarray:
        """The kept columns, ascending."""
        return np.unique(np.append(np.arange(0, self.fine.columns, self.stride), self.fine.columns - 1))

    @functools.cached_property
    def rows(self) -> np.ndarray:
        """The kept rows, ascending."""
        return np.unique(np.append(np.arange(0, self.fine.rows, self.stride), self.fine.rows - 1))

    def points(self, begin: int = 0, end: int | None = None) -> np.ndarray:
        """Indices in the fine lattice of the kept points from `begin` to `end` - 1, ascending."""
        kept = np.add.outer(self.fine.columns * self.rows, self.columns).ravel()
        return np.asarray(kept[slice(*np.searchsorted(kept, [begin, self.fine.points if end is None else end]))])

    def torn(self, triangles: np.ndarray) -> np.ndarray:
        """Mask of coarse triangles (`lattice_triangles`) whose cell contains any of the given fine triangles."""
        return self._triangles_at(*self._cells(triangles))

    def cut(self, triangles: np.ndarray) -> np.ndarray:
        """Mask of coarse triangles whose cell lacks any fine triangle; given are those that exist, shape (F, 3)."""
        columns, number = self.fine.columns - 1, (self.fine.columns - 1) * (self.fine.rows - 1)
        row, column = self._cells(triangles)
        there = np.bincount(row * columns + column, minlength=number)
        return self._triangles_at(*np.divmod(np.flatnonzero(there < 2), columns))

    def _cells(self, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of the fine cell of each fine triangle."""
        return triangles.min(axis=1) // self.fine.columns, (triangles % self.fine.columns).min(axis=1)

    def _triangles_at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Mask of coarse triangles whose cell contains one of the given fine cells."""
        found = np.zeros((len(self.rows) - 1, len(self.columns) - 1, 2), bool)
        found[np.searchsorted(self.rows, row, "right") - 1, np.searchsorted(self.columns, column, "right") - 1] = True
        return found.ravel()


def crosses(
    tail: np.ndarray, head: np.ndarray, segment: Segment, tips: tuple[bool, bool] = (False, False)
) -> np.ndarray:
    """Mask, shape (B,), of the bonds from `tail` to `head`, shape (B, 2), that cross the segment.

    A point on the line of the segment counts as left of it. A bond through an end of the segment crosses it, unless the
    end is among the `tips`.
    """
    start, end = np.array(segment[0]), np.array(segment[1])
    along = end - start
    length_squared = float(along @ along)

    def height(p: np.ndarray) -> np.ndarray:
        offset = p - start
        value = along[0] * offset[..., 1] - along[1] * offset[..., 0]
        return np.where(np.abs(value) < 1e-12 * length_squared, 0.0, value)

    above, below = height(tail), height(head)
    differ = (above >= 0.0) != (below >= 0.0)
    fraction = above / np.where(differ, above - below, 1.0)
    meeting = tail + fraction[..., None] * (head - tail) - start
    place = (meeting @ along) / length_squared
    # Beyond an end, or short of a tip, by what round-off moves.
    first, last = (ROUND_OFF if tip else -1e-12 for tip in tips)
    return np.asarray(differ & (place >= first) & (place <= 1.0 - last))


def moved_cut(cut: Segment, move: Callable[[np.ndarray], np.ndarray]) -> Segment:
    """A segment with both ends at new places."""
    (ax, ay), (bx, by) = (move(np.array(end)).tolist() for end in cut)
    return (ax, ay), (bx, by)


def cell_triangles(whole: np.ndarray) -> np.ndarray:
    """Triangles of the complete cells of a lattice, given a mask of shape (rows - 1, columns - 1)."""
    rows, columns = whole.shape
    return np.asarray(lattice_triangles(columns + 1, rows + 1).reshape(rows, columns, 6)[whole].reshape(-1, 3))


def lattice_triangles(columns: int, rows: int) -> np.ndarray:
    """Triangles of a lattice, int32, shape (F, 3): two for each cell, the diagonals alternating."""
    points = np.arange(columns * rows, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    even = np.add.outer(np.arange(rows - 1), np.arange(columns - 1)) % 2 == 0
    found = np.empty((rows - 1, columns - 1, 2, 3), np.int32)
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = a, b, np.where(even, c, d)
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = np.where(even, a, b), c, d
    return found.reshape(-1, 3)


def whole_cells(kept: np.ndarray) -> np.ndarray:
    """Mask of the cells of a lattice whose corners are all kept, (rows - 1, columns - 1); given is (rows, columns)."""
    return np.asarray(kept[:-1, :-1] & kept[:-1, 1:] & kept[1:, :-1] & kept[1:, 1:])


def cell_areas(lattice: Lattice, whole: np.ndarray) -> np.ndarray:
    """Areas of points, a quarter of each adjacent complete cell [m^2]."""
    padded = np.pad(whole.astype(np.float64), 1)
    corners = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    return 0.25 * lattice.dx * lattice.dy * corners.ravel()


def signed_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Areas of triangles [m^2], positive if counter-clockwise, shape (F,)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def doubled_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Normals of triangles in space with twice their area as length [m^2], shape (F, 3); points have shape (N, 3)."""
    # `take` and products by component need two thirds of the time of indices and `np.cross`.
    a, b, c = (points.take(triangles[:, k], axis=0) for k in range(3))
    (u, v, w), (x, y, z) = (b - a).T, (c - a).T
    return np.stack([v * z - w * y, w * x - u * z, u * y - v * x], axis=1)


def counter_clockwise(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Orient all triangles counter-clockwise."""
    turned = signed_areas(points, triangles) < 0.0
    triangles = triangles.copy()
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Areas of triangles [m^2], shape (F,); points have shape (N, 2) or (N, 3)."""
    if points.shape[1] == 2:
        return np.asarray(np.abs(signed_areas(points, triangles)))
    return np.asarray(0.5 * np.linalg.norm(doubled_normals(points, triangles), axis=1))


def point_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """A third of each adjacent triangle for every point [m^2], shape (N,)."""
    return corner_sums(np.tile(triangle_areas(points, triangles)[:, None] / 3.0, 3), triangles, len(points))


def local_spacings(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Root of twice the mean area of the triangles around each point and its neighbours [m], shape (N,).

    On a square grid it is the spacing. Points without a triangle have the mean.
    """
    ones, corner = np.ones(triangles.shape), np.tile(triangle_areas(points, triangles)[:, None], 3)
    count = corner_sums(ones, triangles, len(points))
    around = corner_sums(corner, triangles, len(points)) / np.maximum(count, 1.0)
    mean = np.repeat(around[triangles].mean(axis=1, keepdims=True), 3, axis=1)
    smooth = corner_sums(mean, triangles, len(points)) / np.maximum(count, 1.0)
    return np.asarray(np.sqrt(2.0 * np.where(count > 0.0, smooth, corner[:, 0].mean())))


def corner_sums(values: np.ndarray, triangles: np.ndarray, points: int) -> np.ndarray:
    """Sum of values at the corners of triangles, shape (F, 3), for every point, shape (N,)."""
    return np.bincount(triangles.T.ravel(), values.T.ravel(), points)


def vector_sums(vectors: np.ndarray, triangles: np.ndarray, points: int) -> np.ndarray:
    """Sum of a vector of each triangle, shape (F, 3), over the triangles at every point, shape (N, 3)."""
    return np.column_stack([corner_sums(np.repeat(each[:, None], 3, axis=1), triangles, points) for each in vectors.T])


def numbers_of_ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the range and number, for each number of the ranges from `first` to before `last`."""
    count = last - first
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count - first, count)


def triangles_of(points: np.ndarray) -> np.ndarray:
    """Delaunay triangulation of the convex hull of points. Raises InputError if the points are collinear."""
    from scipy.spatial import Delaunay, QhullError

    low, high = points.min(axis=0), points.max(axis=0)
    if np.abs(high).max() > FAR * (high - low).max():
        # Squares of coordinates far from the origin keep no digits of the distances between points.
        points = points - 0.5 * (low + high)
    try:
        return np.asarray(Delaunay(points).simplices)
    except QhullError:
        raise InputError("points are collinear: expected points that span an area") from None


def delaunay(points: np.ndarray, spacing: float | None) -> np.ndarray:
    """Delaunay triangulation without triangles whose circumcircle has a radius of 2.5 spacings or more."""
    triangles = triangles_of(points)
    signed = np.abs(signed_areas(points, triangles))
    sides = np.linalg.norm(points[triangles] - points[np.roll(triangles, -1, axis=1)], axis=2)
    if spacing is None:
        spacing = float(np.sqrt(2.0 * np.median(signed)))
    radius = sides.prod(axis=1) / np.maximum(4.0 * signed, 1e-300)
    # Slivers along a straight edge have a huge circle and no area.
    return np.asarray(triangles[radius < 2.5 * spacing])


def coincident_pairs(points: np.ndarray) -> np.ndarray:
    """Pairs of points less than 1e-9 of the extent apart, ascending, shape (K, 2)."""
    from scipy.spatial import cKDTree

    extent = float(np.ptp(points, axis=0).max())
    pairs = cKDTree(points).query_pairs(1e-9 * max(extent, 1e-300), output_type="ndarray")
    return np.unique(np.sort(pairs, axis=1), axis=0)


def refuse_coincident(points: np.ndarray, name: str = "points") -> None:
    """Raise InputError if two points coincide."""
    for a, b in coincident_pairs(points)[:1].tolist():
        raise InputError(f"{name}[{a}] and {name}[{b}] coincide at {points[a].tolist()}: expected distinct points")


def turned_grid(spacing: tuple[float, float], half: np.ndarray, extent: float, turn: float) -> np.ndarray:
    """Points of a grid rotated by `turn` [degrees] about the origin, at least to `extent` [m], shape (N, 2).

    `half` is the place of the origin in a cell along both directions, 0 (at a point) or 0.5.
    """
    reach = int(np.ceil(extent / min(spacing))) + 1
    step = np.arange(-reach, reach + 1)
    u, v = np.meshgrid((step + half[0]) * spacing[0], (step + half[1]) * spacing[1])
    angle = np.deg2rad(turn)
    x = np.cos(angle) * u.ravel() - np.sin(angle) * v.ravel()
    y = np.sin(angle) * u.ravel() + np.cos(angle) * v.ravel()
    return np.column_stack([x, y])


def voronoi_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Area of the Voronoi cell of each point, clipped by the triangulation [m^2], shape (N,).

    Of an obtuse triangle the obtuse corner gets half and the others a quarter of the area (Meyer, Desbrun, Schroeder &
    Barr 2003, section 3.3). The areas sum to that of the triangles.
    """
    corners = points[triangles]
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    squares = (sides**2).sum(axis=-1)
    area = triangle_areas(points, triangles)
    # Twice the cotangent of each corner times twice the area.
    dot = 0.5 * (squares.sum(axis=1, keepdims=True) - 2.0 * squares)
    cell = np.empty(dot.shape)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        cell[:, k] = (squares[:, a] * dot[:, a] + squares[:, b] * dot[:, b]) / (16.0 * area)
    obtuse = dot < -1e-12 * squares.max(axis=1, keepdims=True)
    some = obtuse.any(axis=1)
    cell[some] = np.where(obtuse[some], 0.5, 0.25) * area[some, None]
    return corner_sums(cell, triangles, len(points))


def barycentric(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of places projected on triangles, shape (..., 3); corners have shape (..., 3, 3)."""
    a, b, p = (
        corners[..., 1, :] - corners[..., 0, :],
        corners[..., 2, :] - corners[..., 0, :],
        places - corners[..., 0, :],
    )
    aa, ab, bb = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    pa, pb = (p * a).sum(-1), (p * b).sum(-1)
    determinant = np.maximum(aa * bb - ab**2, 1e-300)
    second, third = (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
    return np.stack([1.0 - second - third, second, third], axis=-1)


def places_on_triangles(corners: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The nearest triangle, given by its corners, shape (F, 3, 3), that each place, shape (P, 3), lies above or below.

    Returns the triangle, shape (P,), weights of its corners, shape (P, 3), of which one is negative for a place beside
    the surface, and the height above it along its normal [m], shape (P,).
    """
    from scipy.spatial import cKDTree

    number = min(24, len(corners))
    near = cKDTree(corners.mean(axis=1)).query(places, k=number)[1].reshape(len(places), number)
    weights = barycentric(corners[near], places[:, None])
    normals = np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights = ((places[:, None] - corners[near, 0]) * normals[near]).sum(axis=-1)
    # Those beside a triangle count as infinitely far from it; of these, the least outside.
    beside = np.maximum(-weights.min(axis=-1) - 1e-6, 0.0)
    best = np.lexsort((np.abs(heights), beside), axis=1)[:, 0]
    rows = np.arange(len(places))
    return near[rows, best], weights[rows, best], heights[rows, best]


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
