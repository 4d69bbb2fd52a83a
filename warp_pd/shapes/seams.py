"""Where edges of triangles meet in space but not by their points: seams of no width, hanging nodes and overlaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import boundary_sides, components, directed_edges, joined_points, undirected

# Over the shortest edge at a point: points nearer than this are one, and a point nearer to an edge lies on it. Files
# with six or seven digits move points by up to 1e-3 of their edges.
SAME = 1e-3
# Over the length of an edge: a gap narrower than this is noted.
NARROW = 0.1


@dataclass(frozen=True, eq=False)
class Merged:
    """Points of which those at one place have one index.

    Attributes:
        index: Index of each given point among them; that of the first at its place, shape (V,).
        points: Number of points that were at the place of another.
        apart: Largest distance of two points that were merged [in units of the points].
        seams: Number of lines along which edges meet by merging.
    """

    index: np.ndarray
    points: int
    apart: float
    seams: int

    def note(self, where: str) -> list[str]:
        """What was merged, or nothing."""
        if not self.points:
            return []
        seams = "1 seam" if self.seams == 1 else f"{self.seams} seams"
        return [
            f"{where}: {self.points} points at the place of another one (up to {self.apart:.2g} apart in the file's "
            f"unit) were merged with it, which closes {seams} of no width; a crack is drawn with cut, slit or "
            "Sheet.outline(cracks=)"
        ]


def shortest_edges(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Length of the shortest edge at each point, shape (V,); infinite at points without edges. Edges are (E, 2)."""
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    least = np.full(len(points), np.inf)
    for end in (0, 1):
        np.minimum.at(least, edges[length > 0.0, end], length[length > 0.0])
    return least


def near_pairs(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Pairs of points of edges, (E, 2), nearer than SAME of the shortest edge at either, ascending, shape (K, 2)."""
    from scipy.spatial import cKDTree

    used = np.unique(edges)
    reach = SAME * shortest_edges(points, edges)[used]
    if not np.isfinite(reach).any():
        return np.zeros((0, 2), np.int64)
    pairs = cKDTree(points[used]).query_pairs(float(reach[np.isfinite(reach)].max()), output_type="ndarray")
    apart = np.linalg.norm(points[used[pairs[:, 1]]] - points[used[pairs[:, 0]]], axis=1)
    pairs = pairs[apart <= reach[pairs].min(axis=1)]
    return np.unique(np.sort(used[pairs], axis=1), axis=0)


def merged(points: np.ndarray, edges: np.ndarray) -> Merged:
    """Merge the points at one place; `edges` are the sides of all faces, shape (E, 2)."""
    pairs = near_pairs(points, edges)
    index = np.arange(len(points))
    if not len(pairs):
        return Merged(index, 0, 0.0, 0)
    _, first, group = np.unique(components(len(points), pairs), return_index=True, return_inverse=True)
    index = first[group.ravel()]
    # Sides that were on an edge before, and are not any more.
    before, after = undirected(edges), undirected(index[edges])
    closed = (np.bincount(before)[before] == 1) & (np.bincount(after)[after] > 1)
    ends = np.unique(index[edges[closed]])
    seams = len(np.unique(components(len(points), index[edges[closed]])[ends])) if len(ends) else 0
    apart = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    return Merged(index, int((index != np.arange(len(points))).sum()), float(apart.max()), seams)


def require_distinct(name: str, points: np.ndarray, triangles: np.ndarray) -> None:
    """Check that each place has one point, and each triangle is listed once. Raises InputError if not."""
    for a, b in near_pairs(points, directed_edges(triangles))[:1].tolist():
        raise InputError(
            f"{name}[{a}] and {name}[{b}] coincide at {points[a].tolist()}, to {SAME:g} of the edges there: expected "
            "distinct points"
        )
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    again = np.setdiff1d(np.arange(len(triangles)), first)
    if len(again):
        raise InputError(f"triangles[{again[0]}] = {triangles[again[0]].tolist()} is listed twice: expected it once")


def seam_notes(where: str, points: np.ndarray, triangles: np.ndarray) -> list[str]:
    """Notes on several pieces of triangles, and on narrow gaps between edges, which no bond crosses.

    Raises InputError, which begins with `where`, for a corner in the middle of an edge (a hanging node), and on a flat
    mesh, whose points have shape (V, 2), for edges that cross and pieces that overlap.
    """
    sides = boundary_sides(triangles)
    edges = directed_edges(triangles)[sides].astype(np.int64)
    label = joined_points(len(points), triangles)[triangles[:, 0]]
    pieces = len(np.unique(label))
    notes = [f"{where}: {pieces} pieces, which nothing connects"] if pieces > 1 else []
    if not len(edges):
        return notes
    third = triangles[sides % len(triangles)].astype(np.int64).sum(axis=1) - edges.sum(axis=1)
    node, edge, apart, place = _nodes_beside(points, edges, third)
    length = np.linalg.norm(points[edges[edge, 1]] - points[edges[edge, 0]], axis=1)
    hanging = np.flatnonzero((apart <= SAME * length) & (place > SAME) & (place < 1.0 - SAME))
    if len(hanging):
        (a, b), first = edges[edge[hanging[0]]].tolist(), node[hanging[0]]
        more = f" and {len(hanging) - 1} more" if len(hanging) > 1 else ""
        raise InputError(
            f"{where}: point {first} at {_place(points[first])}{more} lies in the middle of the edge of another "
            f"triangle, from point {a} to point {b} (a hanging node): expected triangles that meet corner to corner"
        )
    if points.shape[1] == 2:
        _refuse_overlaps(where, points, triangles, edges, label)
    wide = ~_at_sharp_corners(len(points), triangles, node, edges[edge])
    if wide.any():
        nearest = np.flatnonzero(wide)[np.argmin(apart[wide])]
        notes.append(
            f"{where}: a gap narrower than {NARROW:g} of the edges along it at {len(np.unique(node[wide]))} points, "
            f"{apart[nearest]:.2g} at {_place(points[node[nearest]])}; no bond crosses it"
        )
    return notes


def _nodes_beside(
    points: np.ndarray, edges: np.ndarray, third: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points on open edges, shape (B, 2), nearer than NARROW of its length to another open edge.

    The third corner of the edge's own triangle, shape (B,), is left out. Returns the points, the edge beside each, the
    distance from it and the place along it, from 0 to 1, all of shape (K,).
    """
    from scipy.spatial import cKDTree

    nodes = np.unique(edges)
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    found = cKDTree(points[nodes]).query_ball_point(start + 0.5 * along, 0.5 * length * (1.0 + NARROW))
    edge = np.repeat(np.arange(len(edges)), [len(each) for each in found])
    node = nodes[np.concatenate([np.asarray(each, np.int64) for each in found])]
    other = (node[:, None] != edges[edge]).all(axis=1) & (node != third[edge])
    edge, node = edge[other], node[other]
    offset = points[node] - start[edge]
    place = (offset * along[edge]).sum(axis=1) / length[edge] ** 2
    apart = np.linalg.norm(offset - place[:, None] * along[edge], axis=1)
    near = (place >= 0.0) & (place <= 1.0) & (apart <= NARROW * length[edge])
    return node[near], edge[near], apart[near], place[near]


def _at_sharp_corners(size: int, triangles: np.ndarray, node: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Whether each of some points has an edge to just one end of an edge beside it, shape (K, 2); shape (K,)."""
    some = np.zeros(size, bool)
    some[node] = True
    sides = directed_edges(triangles[some[triangles].any(axis=1)]).astype(np.int64)
    sides = np.sort(sides, axis=1) @ np.array([size, 1])
    ways = np.sort(np.stack([np.column_stack([node, edges[:, end]]) for end in (0, 1)], axis=1), axis=2)
    return np.asarray(np.isin(ways @ np.array([size, 1]), sides).sum(axis=1) == 1)


def _refuse_overlaps(
    where: str, points: np.ndarray, triangles: np.ndarray, edges: np.ndarray, label: np.ndarray
) -> None:
    """Raise InputError if open edges cross, or a piece covers another one; `label` is the piece of each triangle."""
    import shapely

    lines = shapely.linestrings(points[edges])
    tree = shapely.STRtree(lines)
    one, other = tree.query(lines, predicate="crosses")
    if len(one):
        place = np.atleast_1d(shapely.get_coordinates(shapely.intersection(lines[one[0]], lines[other[0]]))[0])
        a, b = edges[one[0]].tolist()
        raise InputError(
            f"{where}: the edge from point {a} to point {b} crosses another one at {_place(place)}: expected a flat "
            "mesh that covers each place once"
        )
    pieces, first = np.unique(label, return_index=True)
    if len(pieces) == 1:
        return
    middles = shapely.points(points[triangles[first]].mean(axis=1))
    at, covering = shapely.STRtree(shapely.polygons(points[triangles])).query(middles, predicate="within")
    covered = np.flatnonzero(label[covering] != pieces[at])
    if len(covered):
        raise InputError(
            f"{where}: two pieces overlap at {_place(points[triangles[first[at[covered[0]]]]].mean(axis=0))}: expected "
            "a flat mesh that covers each place once"
        )


def _place(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:.6g}' for value in point.tolist())})"
