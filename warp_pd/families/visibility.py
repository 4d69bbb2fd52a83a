"""Visibility: pairs of points that share no bond because the path between them leaves the sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.sheet import Sheet
from ..geometry.triangulation import crosses, numbers_of_ranges
from .surface_paths import apart_along

# A bond that leaves the sheet exists all the same if a way inside, by one other point, is longer by no more than this.
DETOUR = 1.2
# Relative size of what counts as zero, and angles [rad] that count as straight.
ROUND_OFF, STRAIGHT = 1e-9, 1e-6
# Bonds that are looked at together.
BLOCK = 200_000


def severed(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask, shape (B,), of nearby pairs of points, shape (B, 2), that share no bond.

    They are on opposite sides of a cut, fold or slit, or the path between them leaves the sheet. A chord across a hole
    is kept as a bond if the path around is hardly longer.
    """
    if sheet.frames is not None:
        return np.asarray(apart_along(sheet, pairs) | _in_two_pieces(sheet, pairs))
    lost = np.asarray(cut_through(sheet, pairs) | _in_two_pieces(sheet, pairs))
    if sheet.bodies is not None:
        lost |= sheet.bodies[pairs[:, 0]] != sheet.bodies[pairs[:, 1]]
    if sheet.barriers is not None:
        lost |= _outside(sheet, pairs, lost)
    return lost


def _in_two_pieces(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask, shape (B,), of pairs of points, shape (B, 2), in different pieces."""
    if sheet.pieces is None:
        return np.zeros(len(pairs), bool)
    return np.asarray(sheet.pieces[pairs[:, 0]] != sheet.pieces[pairs[:, 1]])


def cut_through(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Mask, shape (B,), of pairs of points, shape (B, 2), on opposite sides of a cut."""
    lost = np.zeros(len(pairs), bool)
    for segment, tips in zip(sheet.cuts, sheet.tips, strict=True):
        lost |= crosses(sheet.points[pairs[:, 0]], sheet.points[pairs[:, 1]], segment, tips)
    return lost


def _outside(sheet: Sheet, pairs: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Mask of pairs connected inside the sheet only by a detour or not at all; pairs already lost are skipped."""
    points, barriers = sheet.points, sheet.barriers
    broken = np.zeros(len(pairs), bool)
    if barriers is None or not len(pairs):
        return broken
    sectors = _sectors(points, barriers)
    if _is_convex(points, barriers, sectors):
        return broken
    candidates = np.flatnonzero(_near(points, barriers, pairs) & ~lost)
    if sheet.bodies is not None:
        candidates = candidates[sheet.bodies[pairs[candidates, 0]] == 0]
    tried = pairs[candidates]
    along = points[tried[:, 1]] - points[tried[:, 0]]
    out = _crossing(points, barriers, sectors, tried) | _between_faces(points, sectors, tried)
    out |= sectors.leaves(tried[:, 0], along) | sectors.leaves(tried[:, 1], -along)
    broken[candidates[out]] = True
    broken[candidates[out]] = ~_has_way(points, pairs, broken | lost, tried[out])
    return broken


def _is_convex(points: np.ndarray, barriers: np.ndarray, sectors: Sectors) -> bool:
    """Whether the boundary is convex, so that no bond can leave the sheet."""
    turns = (np.pi - sectors.width[barriers[:, 0]]).sum()
    return bool((sectors.width < np.pi + STRAIGHT).all() and turns < 2.0 * np.pi + 1e-3)


def _near(points: np.ndarray, barriers: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Mask of pairs close enough to the edge of the sheet to cross it, shape (B,)."""
    from scipy.spatial import cKDTree

    longest = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1).max()
    edge = np.linalg.norm(points[barriers[:, 1]] - points[barriers[:, 0]], axis=1).max()
    reach = (longest + edge) * (1.0 + 1e-9)
    near = np.isfinite(cKDTree(points[barriers[:, 0]]).query(points, distance_upper_bound=reach)[0])
    return np.asarray(near[pairs].all(axis=1))


@dataclass(frozen=True, eq=False)
class Sectors:
    """Angular sectors of the sheet at the points on its edge.

    Attributes:
        begin: Direction of the edge that leaves the point [rad], shape (N,).
        width: Angle from there, counter-clockwise, to the edge that arrives, shape (N,); 0 for points not on the edge.
            At the tip of a crack it is 2 pi.
    """

    begin: np.ndarray
    width: np.ndarray

    def angle(self, at: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Counter-clockwise angle from the edge that leaves point `at` to a direction [rad], shape (P,)."""
        return np.asarray((np.arctan2(direction[:, 1], direction[:, 0]) - self.begin[at]) % (2.0 * np.pi))

    def leaves(self, at: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Whether a direction from point `at` leads out of the sheet, shape (P,)."""
        angle = self.angle(at, direction)
        outside = (angle > self.width[at] + STRAIGHT) & (angle < 2.0 * np.pi - STRAIGHT)
        return np.asarray(outside & (self.width[at] > 0.0))


def _sectors(points: np.ndarray, barriers: np.ndarray) -> Sectors:
    begin, width = np.zeros(len(points)), np.zeros(len(points))
    ahead, behind = np.full((2, len(points)), -1)
    ahead[barriers[:, 0]], behind[barriers[:, 1]] = barriers[:, 1], barriers[:, 0]
    at = np.flatnonzero((ahead >= 0) & (behind >= 0))
    leaving, arriving = points[ahead[at]] - points[at], points[behind[at]] - points[at]
    begin[at] = np.arctan2(leaving[:, 1], leaving[:, 0])
    turn = (np.arctan2(arriving[:, 1], arriving[:, 0]) - begin[at]) % (2.0 * np.pi)
    width[at] = np.where((turn < STRAIGHT) | (turn > 2.0 * np.pi - STRAIGHT), 2.0 * np.pi, turn)
    # Where two pieces of the edge meet in a point, every direction may be inside.
    width[np.bincount(barriers[:, 0], minlength=len(points)) > 1] = 2.0 * np.pi
    return Sectors(begin, width)


def _crossing(points: np.ndarray, barriers: np.ndarray, sectors: Sectors, pairs: np.ndarray) -> np.ndarray:
    """Mask of bonds that cross an edge of the sheet, or leave it through a point of the edge, shape (P,)."""
    from scipy.spatial import cKDTree

    tail, head = points[pairs[:, 0]], points[pairs[:, 1]]
    start, end = points[barriers[:, 0]], points[barriers[:, 1]]
    reach = 0.5 * (np.linalg.norm(head - tail, axis=1).max() + np.linalg.norm(end - start, axis=1).max())
    found = np.zeros(len(pairs), bool)
    tree = cKDTree(0.5 * (start + end))
    for begin in range(0, len(pairs), BLOCK):
        part = slice(begin, begin + BLOCK)
        near = cKDTree(0.5 * (tail + head)[part]).sparse_distance_matrix(
            tree, reach * (1.0 + 1e-9), output_type="ndarray"
        )
        bond, edge = begin + near["i"], near["j"]
        bond, edge = bond.astype(np.int64), edge.astype(np.int64)
        shared = (pairs[bond][:, :, None] == barriers[edge][:, None, :]).any(axis=(1, 2))
        along, across = head[bond] - tail[bond], end[edge] - start[edge]
        scale = ROUND_OFF * np.linalg.norm(along, axis=1) * np.linalg.norm(across, axis=1)
        first, last = _cross(along, start[edge] - tail[bond]), _cross(along, end[edge] - tail[bond])
        behind, before = _cross(across, tail[bond] - start[edge]), _cross(across, head[bond] - start[edge])
        zero = np.abs(first) <= scale
        cuts = ~shared & ~zero & (np.abs(last) > scale) & ((first > 0.0) != (last > 0.0))
        cuts &= (np.abs(behind) > scale) & (np.abs(before) > scale) & ((behind > 0.0) != (before > 0.0))
        place = ((start[edge] - tail[bond]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300)
        through = zero & (place > ROUND_OFF) & (place < 1.0 - ROUND_OFF)
        vertex = barriers[edge, 0]
        cuts |= through & (sectors.leaves(vertex, along) | sectors.leaves(vertex, -along))
        found[bond[cuts]] = True
    return found


def _between_faces(points: np.ndarray, sectors: Sectors, pairs: np.ndarray) -> np.ndarray:
    """Mask of bonds that run along a crack from one face to the other, shape (P,)."""
    along = points[pairs[:, 1]] - points[pairs[:, 0]]
    kinds = []
    for at, direction in ((pairs[:, 0], along), (pairs[:, 1], -along)):
        angle, width = sectors.angle(at, direction), sectors.width[at]
        edge = (width > 0.0) & (width < 2.0 * np.pi)
        leaving = edge & ((angle < STRAIGHT) | (angle > 2.0 * np.pi - STRAIGHT))
        arriving = edge & (np.abs(angle - width) < STRAIGHT)
        kinds.append((leaving, arriving))
    return np.asarray((kinds[0][0] & kinds[1][0]) | (kinds[0][1] & kinds[1][1]) | (~along.any(axis=1)))


def _has_way(points: np.ndarray, pairs: np.ndarray, lost: np.ndarray, tried: np.ndarray) -> np.ndarray:
    """Mask of the tried pairs with a common neighbour on a path hardly longer than the straight line, shape (P,)."""
    from scipy import sparse

    size = len(points)
    near = np.zeros(size, bool)
    near[tried] = True
    kept = pairs[~lost & near[pairs].any(axis=1)]
    half = sparse.coo_array((np.ones(len(kept), bool), (kept[:, 0], kept[:, 1])), shape=(size, size)).tocsr()
    graph = (half + half.T).tocsr()
    row, entry = numbers_of_ranges(graph.indptr[tried[:, 0]], graph.indptr[tried[:, 0] + 1])
    middle = graph.indices[entry]
    tail, head = points[tried[row, 0]], points[tried[row, 1]]
    way = np.linalg.norm(points[middle] - tail, axis=1) + np.linalg.norm(head - points[middle], axis=1)
    short = np.flatnonzero(way <= DETOUR * np.linalg.norm(head - tail, axis=1))
    keys = np.sort(kept, axis=1) @ np.array([size, 1], np.int64)
    wanted = np.sort(np.column_stack([middle[short], tried[row[short], 1]]), axis=1).astype(np.int64) @ np.array(
        [size, 1]
    )
    found = np.zeros(len(tried), bool)
    found[row[short[np.isin(wanted, keys)]]] = True
    return found


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
