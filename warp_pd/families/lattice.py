"""Families of a lattice: one stencil, and one row per family class (points with equal neighbourhoods).

The corrected weights of a rectangle are solved on a small one and valid for every larger one with the same spacing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.result_cache import ResultCache
from ..geometry.couplings import distance_from_segments
from ..geometry.sheet import Sheet
from ..geometry.triangulation import crosses
from .tables import TOLERANCE, Families, Horizon, InfluenceFunction, pack
from .weights import CorrectedWeights, corrected_weights


def lattice_families(
    sheet: Sheet, horizon: Horizon, function: InfluenceFunction, corrected: bool, intersections: bool
) -> Families:
    """Families of a lattice; arguments as for `build_families`."""
    lattice = sheet.lattice
    assert lattice is not None
    reach_x, reach_y = horizon.reach(lattice.dx), horizon.reach(lattice.dy)
    if lattice.rows == 1:
        reach_y = 0
    oy, ox = np.mgrid[-reach_y : reach_y + 1, -reach_x : reach_x + 1]
    length = np.hypot(ox * lattice.dx, oy * lattice.dy)
    inside = (length > 0.0) & (length <= horizon.length * (1.0 + TOLERANCE))
    ox, oy, r = ox[inside], oy[inside], np.minimum(length[inside] / horizon.length, 1.0)
    offsets = np.column_stack([ox * lattice.dx, oy * lattice.dy])
    apart = np.linalg.norm(offsets[:, None] - offsets[None], axis=-1)
    reverses = np.array([int(np.flatnonzero((ox == -a) & (oy == -b))[0]) for a, b in zip(ox, oy, strict=True)])

    # Points whose neighbourhoods are the same up to `reach` share a row.
    steps = np.column_stack([ox, oy])
    depth = corrected_depth(steps) if corrected else 0
    reach = max(reach_x, reach_y, depth) + 1
    near_x = clipped_index(lattice.columns, reach)
    near_y = clipped_index(lattice.rows, reach)
    severed = _severed(sheet, ox, oy) if sheet.cuts else None
    first, family_class = _classes(near_x, near_y)
    if severed is not None:
        first, family_class = _with_lost(family_class, *severed)
    if (factors := sheet.factors) is not None:
        different, which = np.unique(factors, return_inverse=True)
        code = family_class * np.int64(len(different)) + which.ravel()
        _, first, family_class = np.unique(code, return_index=True, return_inverse=True)

    row, column = np.divmod(first, lattice.columns)
    to_x, to_y = column[:, None] + ox, row[:, None] + oy
    exists = (to_x >= 0) & (to_x < lattice.columns) & (to_y >= 0) & (to_y < lattice.rows)
    lost = np.zeros_like(exists) if severed is None else _lost_of(first, *severed)
    exists &= ~lost
    areas, reference_area = sheet.areas, float(sheet.areas.mean())
    member = np.where(exists, to_y * lattice.columns + to_x, 0)
    return Families(
        horizon=horizon.length,
        reference_area=reference_area,
        exists=exists,
        bonds=offsets / horizon.length,
        influence=function(r),
        common=pack(apart <= horizon.length * (1.0 + TOLERANCE)) if intersections else np.zeros((0, 0), np.uint32),
        member_areas=np.where(exists, areas[member.ravel()].reshape(member.shape), 0.0) / reference_area,
        areas=areas[first] / reference_area,
        reverses=reverses,
        family_class=family_class.ravel().astype(np.int32, copy=False),
        shift=(oy * lattice.columns + ox).astype(np.int32),
        steps=steps,
        first=first,
        severed=np.asarray(lost.any(axis=1)),
        factors=None if factors is None else factors[first],
    )


def clipped_index(length: int, depth: int) -> np.ndarray:
    """Kind of each place along an edge of `length` points, shape (length,).

    0 .. depth - 1 from one end, depth in the middle, depth + 1 .. 2 depth up to the other end; if the edge is shorter
    than that, every place is a separate kind.
    """
    index = np.arange(length)
    if length <= 2 * depth + 1:
        return index
    return np.where(index < depth, index, np.maximum(index - (length - 1 - 2 * depth), depth))


def _classes(near_x: np.ndarray, near_y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First point of each pair of codes, and the index of the pair at each point."""
    _, first_x, of_x = np.unique(near_x, return_index=True, return_inverse=True)
    _, first_y, of_y = np.unique(near_y, return_index=True, return_inverse=True)
    first = (len(near_x) * first_y[:, None] + first_x).ravel()
    family_class = np.add.outer((len(first_x) * of_y).astype(np.int32), of_x.astype(np.int32))
    return first, family_class.ravel()


def _with_lost(family_class: np.ndarray, touched: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First points and classes if the points `touched` lost members; those with equal losses share a class."""
    patterns, which = np.unique(pack(lost), axis=0, return_inverse=True)
    code = family_class * np.int64(len(patterns) + 1)
    code[touched] += 1 + which.ravel()
    _, first, family_class = np.unique(code, return_index=True, return_inverse=True)
    return first, family_class.ravel().astype(np.int32)


def _lost_of(first: np.ndarray, touched: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Mask of the members that the points `first` lost, (R, n), of those that the points `touched` did."""
    found = np.zeros((len(first), lost.shape[1]), bool)
    _, here, at = np.intersect1d(first, touched, return_indices=True)
    found[here] = lost[at]
    return found


def _severed(sheet: Sheet, ox: np.ndarray, oy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points near a cut, ascending, and a mask of their members across it."""
    lattice, points = sheet.lattice, sheet.points
    assert lattice is not None
    offsets = np.column_stack([ox * lattice.dx, oy * lattice.dy])
    reach = float(np.linalg.norm(offsets, axis=1).max()) * (1.0 + 1e-6)
    touched = np.flatnonzero(distance_from_segments(points, np.array(sheet.cuts), reach) <= reach)
    tail = np.repeat(points[touched][:, None], len(offsets), axis=1)
    lost = np.zeros((len(touched), len(offsets)), bool)
    for segment, tips in zip(sheet.cuts, sheet.tips, strict=True):
        lost |= crosses(tail, tail + offsets, segment, tips)
    return touched, lost


# Coarser and larger lattices of one process ask for the same weights.
SOLVED = ResultCache()


@dataclass(frozen=True, eq=False)
class RectangleWeights:
    """Corrected weights of a rectangular lattice of any size, one row per kind of place.

    Attributes:
        table: W_ij [m^2], shape (kinds along x, kinds along y, n).
        columns: Points along x.
        rows: Points along y.
        depth: Points further than this many spacings from all edges keep the plain weights.
        solved: The solution on the reduced lattice, with one row of weights per point of that lattice.
    """

    table: np.ndarray
    columns: int
    rows: int
    depth: int
    solved: CorrectedWeights

    def at(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Weights [m^2], shape (P, n), of the points at lattice places (column, row), each of shape (P,)."""
        x, y = clipped_index(self.columns, self.depth), clipped_index(self.rows, self.depth)
        return np.asarray(self.table[x[column], y[row]])


def corrected_depth(offsets: np.ndarray) -> int:
    """Spacings from an edge up to which corrected weights differ, for lattice steps to the members, (n, 2)."""
    return max(2 * int(np.abs(offsets).max()), 3)


def rectangle_corrected(
    columns: int,
    rows: int,
    spacing: float | tuple[float, float],
    *,
    offsets: np.ndarray,
    influence: np.ndarray,
    common: np.ndarray | None,
) -> RectangleWeights:
    """Corrected weights of a rectangular lattice of any size, whose outer points lie on its edges.

    Places with the same distances from the edges, up to twice the reach of the families, share their weights. A lattice
    just large enough that its middle is unaffected by the edges has all kinds of places; its weights balance every
    larger lattice exactly.

    Args:
        columns: Points along x.
        rows: Points along y.
        spacing: Spacing, or spacings (along x, along y) [m].
        offsets: Lattice steps to each family member, int, shape (n, 2).
        influence: w of each member, shape (n,).
        common: Whether member k belongs to the intersection of member j, shape (n, n) [j, k]; None for laws without
            intersections, see `corrected_weights`.
    """
    reach, depth = int(np.abs(offsets).max()), corrected_depth(offsets)
    step = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (2,))
    lengths = (min(columns, 2 * (depth + reach) + 1), min(rows, 2 * (depth + reach) + 1))
    table, solved = SOLVED.result(_solved, lengths, reach, depth, step, offsets, influence, common)
    return RectangleWeights(table, columns, rows, depth, solved)


def _solved(
    lengths: tuple[int, int], reach: int, depth: int, step: np.ndarray, offsets: np.ndarray, influence: np.ndarray,
    common: np.ndarray | None,
) -> tuple[np.ndarray, CorrectedWeights]:  # fmt: skip
    """Weights by kind of place, and the solution; further runs of a process on the same lattice share them."""
    place = np.indices(lengths).reshape(2, -1)

    target = place[:, :, None] + offsets.T[:, None, :]
    exists = ((target >= 0) & (target < np.array(lengths)[:, None, None])).all(axis=0)
    neighbours = np.where(exists, target[0] * lengths[1] + target[1], -1).astype(np.int32)
    width, normal = np.empty((2, place.shape[1])), np.empty((2, place.shape[1]))
    for axis in range(2):
        low, high = place[axis] == 0, place[axis] == lengths[axis] - 1
        width[axis] = step[axis] * np.where(low | high, 0.5, 1.0)
        normal[axis] = high.astype(np.float64) - low

    clip = [clipped_index(length, depth) for length in lengths]
    kind = clip[0][place[0]] * (clip[1].max() + 1) + clip[1][place[1]]
    deep = np.logical_and.reduce([(lengths[a] > 2 * depth) & (clip[a][place[a]] == depth) for a in range(2)])
    # The balance of a point feels families up to one reach away: beyond depth + reach all are the same.
    balance = [clipped_index(length, depth + reach) for length in lengths]
    balance_kind = balance[0][place[0]] * (balance[1].max() + 1) + balance[1][place[1]]
    repeated = np.ones(place.shape[1], bool)
    repeated[np.unique(balance_kind, return_index=True)[1]] = False
    solved = corrected_weights(
        points=(place * step[:, None]).T,
        areas=width[0] * width[1],
        neighbours=neighbours,
        influence=influence,
        common=common,
        edge_vectors=(normal * width[::-1]).T,
        strip=~deep,
        kind=kind,
        unbalanced=repeated,
    )
    first = np.unique(kind, return_index=True)[1]
    table = solved.weights[first].reshape(clip[0].max() + 1, clip[1].max() + 1, -1)
    return table, solved
