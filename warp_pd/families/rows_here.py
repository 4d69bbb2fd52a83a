"""The families of a share of a sheet, out of those of the whole sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .share import Share
from .tables import Families, WholeFamilies


@dataclass(frozen=True, eq=False)
class RowsHere:
    """Rows of the whole families that a share needs.

    Families that are not whole here are empty, so that no kernel reads a point that is not here.

    Attributes:
        families: The families of the points of the share.
        rows: Row of the whole families that each row here is, shape (R,).
        empty: Which rows are empty, shape (R,).
    """

    families: Families
    rows: np.ndarray
    empty: np.ndarray

    def table(self, values: np.ndarray) -> np.ndarray:
        """Rows here of a table of the whole families, zero where they are empty."""
        found = np.asarray(values[self.rows])
        found[self.empty] = 0
        return found


def rows_here(families: Families, share: Share) -> RowsHere:
    """The families of the points of a share."""
    rows, empty, family_class = _kept_rows(families, share)
    made = RowsHere(families, rows, empty)
    by_row, local = families.neighbours is not None, _Local(families, share)

    def row(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[rows]

    def point(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[share.points]

    neighbours, exists = None, made.table(families.exists)
    if families.neighbours is not None:
        found = families.neighbours[rows]
        neighbours = np.where(found >= 0, local.of(found), -1).astype(np.int32)
        neighbours[empty] = -1
    here = replace(
        families,
        exists=exists,
        member_areas=made.table(families.member_areas),
        areas=families.areas[rows],
        bonds=families.bonds[rows] if by_row else families.bonds,
        influence=families.influence[rows] if by_row else families.influence,
        common=made.table(families.common) if by_row and families.common.size else families.common,
        reverses=families.reverses[rows] if by_row else families.reverses,
        neighbours=neighbours,
        family_class=family_class,
        centres=None if families.centres is None else local.of(families.centres[:, share.points]),
        first=None if families.first is None else np.maximum(local.of(families.first[rows]), 0),
        severed=row(families.severed),
        stiffness=row(families.stiffness),
        frames=point(families.frames),
        chords=point(families.chords),
        whole=_whole(families),
    )
    return replace(made, families=here)


def _kept_rows(families: Families, share: Share) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Rows of the whole families that are rows here, which of them are empty, and the row here of each point."""
    if families.family_class is None:
        return share.points, ~share.near, None
    # Row 0 of a grid and the commonest one of a lattice keep their places: kernels know them.
    family_class = share.rows(families.family_class).copy()
    kept = np.arange(len(families.exists))
    if families.layout == "grid":
        kept = np.unique(np.append(family_class[share.near], 0))
        family_class[share.near] = np.searchsorted(kept, family_class[share.near])
    # Empty rows keep their area, which the families around them read.
    far = np.flatnonzero(~share.near)
    emptied, of_far = np.unique(family_class[far], return_inverse=True)
    family_class[far] = len(kept) + of_far.ravel()
    return np.append(kept, emptied), np.arange(len(kept) + len(emptied)) >= len(kept), family_class


class _Local:
    """Indices here of points of the whole sheet, -1 for those that are not here."""

    def __init__(self, families: Families, share: Share) -> None:
        self.share, self._table = share, None
        if share.owners is not None:
            self._table = np.full(families.points, -1, np.int32)
            self._table[share.points] = np.arange(len(share.points))

    def of(self, points: np.ndarray) -> np.ndarray:
        """The index here of each, int32."""
        if self._table is not None:
            return np.asarray(self._table[points])
        span = self.share.span
        return np.where((points >= span.start) & (points < span.stop), points - span.start, -1).astype(np.int32)


def _whole(families: Families) -> WholeFamilies:
    if families.family_class is None:
        return WholeFamilies(families.bond_count, 0, False)
    points = families.points_of_rows()
    row = 0 if families.layout == "grid" else int(points.argmax())
    return WholeFamilies(int((families.exists.sum(axis=1) * points).sum()), row, bool(points[row] > 0))
