"""Families of the points of a partition: selected from the whole sheet's, or built locally for a cloud."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..families.cloud import find_neighbours, point_rows, refuse_lone_points
from ..families.grid import widened
from ..families.partition import Partition
from ..families.tables import Families, InfluenceFunction, WholeFamilies, checked_horizon, influence_function
from ..geometry.sheet import Sheet


@dataclass(frozen=True, eq=False)
class LocalRows:
    """Rows of the whole sheet's families that a partition needs.

    Families that are incomplete in this process are empty, so that no kernel reads a point of another process.

    Attributes:
        families: The families of the points of the partition.
        rows: Row of the whole sheet's families for each local row, shape (R,).
        empty: Mask of empty rows, shape (R,).
    """

    families: Families
    rows: np.ndarray
    empty: np.ndarray

    def table(self, values: np.ndarray) -> np.ndarray:
        """Select the local rows of a table of the whole sheet's families; empty rows are zero."""
        found = np.asarray(values[self.rows])
        found[self.empty] = 0
        return found


def local_rows(families: Families, partition: Partition) -> LocalRows:
    """The families of the points of a partition."""
    rows, empty, family_class = _kept_rows(families, partition)
    made = LocalRows(families, rows, empty)
    by_row = families.neighbours is not None

    def row(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[rows]

    def point(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[partition.points]

    neighbours, exists = None, made.table(families.exists)
    if families.neighbours is not None:
        neighbours = _local(families.neighbours[rows], partition)
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
        centres=None if families.centres is None else _local(families.centres[:, partition.points], partition),
        first=None if families.first is None else np.maximum(_local(families.first[rows], partition), 0),
        severed=row(families.severed),
        factors=row(families.factors),
        frames=point(families.frames),
        chords=point(families.chords),
        whole=_whole(families),
    )
    return replace(made, families=here)


def _kept_rows(families: Families, partition: Partition) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Rows of the whole sheet's families that are kept, a mask of empty ones, and the local row of each point."""
    if families.family_class is None:
        return partition.points, ~partition.near, None
    # Row 0 of a grid and the commonest one of a lattice keep their places: kernels know them.
    family_class = partition.rows(families.family_class).copy()
    kept = np.arange(len(families.exists))
    if families.layout == "grid":
        kept = np.unique(np.append(family_class[partition.near], 0))
        family_class[partition.near] = np.searchsorted(kept, family_class[partition.near])
    # Empty rows keep their area, which the families around them read.
    far = np.flatnonzero(~partition.near)
    emptied, of_far = np.unique(family_class[far], return_inverse=True)
    family_class[far] = len(kept) + of_far.ravel()
    return np.append(kept, emptied), np.arange(len(kept) + len(emptied)) >= len(kept), family_class


def _local(points: np.ndarray, partition: Partition) -> np.ndarray:
    """Local indices of points of the whole sheet, -1 for those of other processes, int32."""
    found = np.full(points.size, -1, np.int32)
    at, local = partition.here(points.ravel())
    found[at] = local
    return found.reshape(points.shape)


def _whole(families: Families) -> WholeFamilies:
    if families.family_class is None:
        return WholeFamilies(families.bond_count, 0, False)
    points = families.points_of_rows()
    row = 0 if families.layout == "grid" else int(points.argmax())
    return WholeFamilies(int((families.exists.sum(axis=1) * points).sum()), row, bool(points[row] > 0))


def builds_alone(sheet: Sheet, partition: Partition | None) -> bool:
    """Whether a process can build its families locally: on clouds whose bonds need no visibility check."""
    return partition is not None and sheet.layout == "cloud" and sheet.barriers is None and sheet.frames is None


def local_cloud_families(
    sheet: Sheet, partition: Partition, horizon: float, influence: str | InfluenceFunction,
    gathered: Callable[[int], list[int]],
) -> Families:  # fmt: skip
    """Families of the points of a partition of a whole sheet; incomplete ones are empty.

    `horizon` and `influence` are as for `build_families`; `gathered` gathers a number from all processes.
    """
    function, checked = influence_function(influence), checked_horizon(sheet, horizon)
    # Members are in the order of the user's points, on any number of processes.
    among = np.sort(partition.points)
    neighbours, reverses, incomplete = find_neighbours(sheet, among, checked)
    place = np.searchsorted(among, partition.points)
    neighbours, reverses = neighbours[place], reverses[place]
    neighbours[~partition.near], reverses[~partition.near] = -1, 0
    sizes = (neighbours >= 0).sum(axis=1)
    lone = partition.points[partition.near & (sizes == 0)]
    # All processes refuse the same point.
    first = min(gathered(int(lone.min(initial=sheet.size))))
    if first < sheet.size:
        refuse_lone_points(sheet, np.array([first]), np.full((1, 1), -1), checked)
    members = max(gathered(int(sizes.max())))
    neighbours, reverses = widened(neighbours, members, -1), widened(reverses, members, 0)
    made = point_rows(sheet, partition.points, neighbours, reverses, incomplete[place], checked, function, True)
    bonds = sum(gathered(int(sizes[partition.owned].sum())))
    return replace(made, neighbours=_local(neighbours, partition), whole=WholeFamilies(bonds, 0, False))
