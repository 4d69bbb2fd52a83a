"""Corrected weights of a rectangle, solved on a small one and valid for every larger one with the same spacing."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ..lattice import clipped_index
from .balance import CorrectedWeights, corrected_weights

# Lattices whose weights a process remembers.
REMEMBERED = 16


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
    reach = int(np.abs(offsets).max())
    depth = max(2 * reach, 3)
    step = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (2,))
    lengths = (min(columns, 2 * (depth + reach) + 1), min(rows, 2 * (depth + reach) + 1))
    given = tuple(None if array is None else _Values(array) for array in (step, offsets, influence, common))
    table, solved = _solved(lengths, reach, depth, *given)
    return RectangleWeights(table, columns, rows, depth, solved)


class _Values:
    """An array as a key: equal if its values are."""

    def __init__(self, array: np.ndarray) -> None:
        self.array = array
        self._key = (array.shape, array.dtype.str, np.ascontiguousarray(array).tobytes())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Values) and self._key == other._key


@functools.lru_cache(maxsize=REMEMBERED)
def _solved(
    lengths: tuple[int, int], reach: int, depth: int, spacing: _Values, members: _Values, weighted: _Values,
    shared: _Values | None,
) -> tuple[np.ndarray, CorrectedWeights]:  # fmt: skip
    """Weights by kind of place, and the solution; further runs of a process on the same lattice share them."""
    step, offsets, influence = spacing.array, members.array, weighted.array
    common = None if shared is None else shared.array
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
    for array in (table, solved.weights, solved.left):
        array.setflags(write=False)
    return table, solved
