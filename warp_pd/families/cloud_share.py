"""Families of the points of a cloud that one process of several holds, without those of all others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..geometry.sheet import Sheet
from .cloud import find_neighbours, point_rows, refuse_lone_points
from .horizon import checked_horizon
from .share import Share
from .tables import Families, InfluenceFunction, WholeFamilies, influence_function


def made_by_share(sheet: Sheet, share: Share | None) -> bool:
    """Whether a process can make the families of its share alone: of a cloud whose bonds need no way inside."""
    return share is not None and sheet.layout == "cloud" and sheet.barriers is None and sheet.frames is None


def share_families(
    sheet: Sheet, share: Share, horizon: float, influence: str | InfluenceFunction,
    gathered: Callable[[int], list[int]],
) -> Families:  # fmt: skip
    """Families of the points of a share; those that are not whole here are empty.

    Args:
        sheet: The sheet, whole.
        share: What is here of it.
        horizon: Over the spacing of the sheet [-].
        influence: As for `build_families`.
        gathered: What all processes have of a number.

    Raises:
        InputError: for a horizon that the sheet does not allow, or a point without neighbours.
    """
    function, checked = influence_function(influence), checked_horizon(sheet, horizon)
    # Members are in the order of the user's points, on any number of processes.
    among = np.sort(share.points)
    neighbours, reverses, incomplete = find_neighbours(sheet, among, checked)
    place = np.searchsorted(among, share.points)
    neighbours, reverses = neighbours[place], reverses[place]
    neighbours[~share.near], reverses[~share.near] = -1, 0
    sizes = (neighbours >= 0).sum(axis=1)
    lone = share.points[share.near & (sizes == 0)]
    # All processes refuse the same point.
    first = min(gathered(int(lone.min(initial=sheet.size))))
    if first < sheet.size:
        refuse_lone_points(sheet, np.array([first]), np.full((1, 1), -1), checked)
    members = max(gathered(int(sizes.max())))
    neighbours, reverses = _wide(neighbours, members, -1), _wide(reverses, members, 0)
    made = point_rows(sheet, share.points, neighbours, reverses, incomplete[place], checked, function, True)
    bonds = sum(gathered(int(sizes[share.own].sum())))
    local = np.full(neighbours.shape, -1, np.int32)
    there = neighbours >= 0
    local[there] = share.here(neighbours[there])[1]
    return replace(made, neighbours=local, whole=WholeFamilies(bonds, 0, False))


def _wide(table: np.ndarray, members: int, value: int) -> np.ndarray:
    """A table with so many columns; what it loses is empty."""
    table = table[:, :members]
    return np.pad(table, ((0, 0), (0, members - table.shape[1])), constant_values=value)
