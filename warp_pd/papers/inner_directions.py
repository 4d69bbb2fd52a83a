"""Directions of the bonds inside a sheet, for point fields of pairwise laws at its edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..families import Families
from ..geometry.sheet import Sheet
from ..geometry.triangulation import boundary_edges

# Points whose families are looked at, number of directions kept apart, and angle between different ones over pi.
LOOKED_AT, DIRECTIONS, DIFFERENT = 500, 64, 1e-7


@dataclass(frozen=True)
class InnerDirections:
    """Arrays on a device.

    Attributes:
        directions: Unit vectors, (D,) vec2.
        shares: Share of each in the weights of a family inside the sheet, (D,); their sum is 1.
    """

    directions: Any
    shares: Any


def inner_directions(context: Context, owner: str, families: Families, weights: np.ndarray) -> InnerDirections:
    """Directions on the device; `weights` of the bonds by row, shape (R, n)."""
    angle, share = _angles(context.sheet, families, weights)
    vectors, types = np.column_stack([np.cos(angle), np.sin(angle)]), context.types
    return InnerDirections(
        context.array("inner_directions", owner, types.vec2, vectors, per="table"),
        context.array("inner_shares", owner, types.real, share, per="table"),
    )


def _angles(sheet: Sheet, families: Families, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] and shares, both (D,): those of families that no edge cuts off, or of a round one."""
    points = _inside(sheet, families)
    if not len(points):
        return np.pi * np.arange(DIRECTIONS) / DIRECTIONS, np.full(DIRECTIONS, 1.0 / DIRECTIONS)
    rows = points if families.family_class is None else families.family_class[points]
    bonds = np.broadcast_to(families.bonds, (*families.exists.shape, 2))[rows]
    there = families.exists[rows]
    angle = np.arctan2(bonds[there][:, 1], bonds[there][:, 0]) / np.pi % 1.0
    angle[angle > 1.0 - 0.5 * DIFFERENT] = 0.0
    share = weights[rows][there] / weights[rows][there].sum()
    kind = np.unique(np.round(angle / DIFFERENT), return_inverse=True)[1].ravel()
    if kind.max() >= DIRECTIONS:
        kind = np.unique((angle * DIRECTIONS).astype(int), return_inverse=True)[1].ravel()
    total = np.bincount(kind, share)
    return np.pi * np.bincount(kind, share * angle) / total, total


def _inside(sheet: Sheet, families: Families) -> np.ndarray:
    """Up to LOOKED_AT points whose families have no point of an edge or a cut."""
    edge = np.zeros(sheet.size, bool)
    if not len(sheet.triangles):
        return np.flatnonzero(edge)
    edge[boundary_edges(np.asarray(sheet.triangles)).ravel()] = True
    if families.severed is not None:
        edge |= families.rows_of_points(families.severed)
    free = np.flatnonzero(~edge)
    for step in sorted({max(1, len(free) // LOOKED_AT), 1}, reverse=True):
        some = free[::step]
        members = families.members_of(some)
        whole = some[~(edge[members] & (members >= 0)).any(axis=1)]
        if len(whole):
            break
    return np.asarray(whole[:: max(1, len(whole) // LOOKED_AT)])
