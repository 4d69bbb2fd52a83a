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
    if families.family_class is None:
        rows, empty, family_class = share.points, ~share.near, None
    else:
        whole_class = families.family_class[share.points]
        # Row 0 of a grid and the commonest one of a lattice keep their places: kernels know them.
        kept = np.arange(len(families.exists))
        if families.layout == "grid":
            kept = np.unique(np.append(whole_class[share.near], 0))
        # Empty rows keep their area, which the families around them read.
        emptied = np.unique(whole_class[~share.near])
        rows, empty = np.append(kept, emptied), np.arange(len(kept) + len(emptied)) >= len(kept)
        at = np.searchsorted(kept, whole_class), len(kept) + np.searchsorted(emptied, whole_class)
        family_class = np.where(share.near, *at).astype(np.int32)
    made = RowsHere(families, rows, empty)
    by_row = families.neighbours is not None
    local = np.full(families.points, -1, np.int32)
    local[share.points] = np.arange(len(share.points))

    def row(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[rows]

    def point(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[share.points]

    neighbours, exists = None, made.table(families.exists)
    if families.neighbours is not None:
        found = families.neighbours[rows]
        neighbours = np.where(found >= 0, local[found], -1).astype(np.int32)
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
        centres=None if families.centres is None else local[families.centres[:, share.points]],
        first=None if families.first is None else np.maximum(local[families.first[rows]], 0),
        severed=row(families.severed),
        stiffness=row(families.stiffness),
        frames=point(families.frames),
        chords=point(families.chords),
        whole=_whole(families),
    )
    return replace(made, families=here)


def _whole(families: Families) -> WholeFamilies:
    cloud = families.family_class is None
    row = 0 if cloud else families.commonest_row
    return WholeFamilies(families.bond_count, row, not cloud and families.has_common)
