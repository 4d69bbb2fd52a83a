"""Families of a lattice: one stencil, and one row per family class, that is points with the same neighbourhood."""

from __future__ import annotations

import numpy as np

from ..shapes.triangulation import crosses
from ..sheet import Sheet
from .masks import pack
from .tables import TOLERANCE, Families, InfluenceFunction


def lattice_families(
    sheet: Sheet, horizon: float, function: InfluenceFunction, depth: int, intersections: bool
) -> Families:
    """Families of a lattice; arguments as for `build_families`, the horizon in meters."""
    lattice = sheet.lattice
    assert lattice is not None
    reach_x, reach_y = int(horizon / lattice.dx + 1e-6), int(horizon / lattice.dy + 1e-6)
    if lattice.rows == 1:
        reach_y = 0
    oy, ox = np.mgrid[-reach_y : reach_y + 1, -reach_x : reach_x + 1]
    length = np.hypot(ox * lattice.dx, oy * lattice.dy)
    inside = (length > 0.0) & (length <= horizon * (1.0 + TOLERANCE))
    ox, oy, r = ox[inside], oy[inside], np.minimum(length[inside] / horizon, 1.0)
    offsets = np.column_stack([ox * lattice.dx, oy * lattice.dy])
    apart = np.linalg.norm(offsets[:, None] - offsets[None], axis=-1)
    reverses = np.array([int(np.flatnonzero((ox == -a) & (oy == -b))[0]) for a, b in zip(ox, oy, strict=True)])

    # Points whose neighbourhoods are the same up to `reach` share a row.
    reach = max(reach_x, reach_y, depth) + 1
    ix, iy = np.arange(lattice.columns), np.arange(lattice.rows)
    near_x = _edge_code(lattice.columns, reach)
    near_y = _edge_code(lattice.rows, reach)
    code = near_y[:, None].astype(np.int64) * (near_x.max() + 1) + near_x[None, :]
    column, row = (grid.ravel() for grid in np.meshgrid(ix, iy))
    code = code.ravel()
    severed = _severed(sheet, column, row, ox, oy)
    if severed is not None:
        touched, lost = severed
        patterns, which = np.unique(pack(lost), axis=0, return_inverse=True)
        code = code * (len(patterns) + 1)
        code[touched] += 1 + which.ravel()
    if sheet.stiffness is not None:
        factors, which = np.unique(sheet.stiffness, return_inverse=True)
        code = code * len(factors) + which.ravel()
    _, first, family_class = np.unique(code, return_index=True, return_inverse=True)

    to_x, to_y = column[first, None] + ox, row[first, None] + oy
    exists = (to_x >= 0) & (to_x < lattice.columns) & (to_y >= 0) & (to_y < lattice.rows)
    severed_rows = np.zeros(len(first), bool)
    if severed is not None:
        touched, lost = severed
        position = np.full(sheet.size, -1)
        position[touched] = np.arange(len(touched))
        here = position[first]
        exists[here >= 0] &= ~lost[here[here >= 0]]
        severed_rows[here >= 0] = lost[here[here >= 0]].any(axis=1)
    reference_area = float(sheet.areas.mean())
    member = np.where(exists, to_y * lattice.columns + to_x, 0)
    return Families(
        horizon=horizon,
        reference_area=reference_area,
        exists=exists,
        bonds=offsets / horizon,
        influence=function(r),
        common=pack(apart <= horizon * (1.0 + TOLERANCE)) if intersections else np.zeros((0, 0), np.uint32),
        member_areas=np.where(exists, sheet.areas[member], 0.0) / reference_area,
        areas=sheet.areas[first] / reference_area,
        reverses=reverses,
        family_class=family_class.ravel().astype(np.int32),
        shift=(oy * lattice.columns + ox).astype(np.int32),
        steps=np.column_stack([ox, oy]),
        first=first,
        severed=severed_rows,
        stiffness=None if sheet.stiffness is None else sheet.stiffness[first],
    )


def _edge_code(length: int, reach: int) -> np.ndarray:
    """0 .. reach - 1 from one end, reach inside, reach + 1 .. from the other end; all distinct if short."""
    index = np.arange(length)
    if length <= 2 * reach + 1:
        return index
    return np.where(index < reach, index, np.where(index >= length - reach, index - length + 2 * reach + 1, reach))


def _severed(
    sheet: Sheet, column: np.ndarray, row: np.ndarray, ox: np.ndarray, oy: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Points near a cut and which of their members lie across it; None without cuts."""
    if not sheet.cuts or sheet.lattice is None:
        return None
    offsets = np.column_stack([ox * sheet.lattice.dx, oy * sheet.lattice.dy])
    reach = float(np.linalg.norm(offsets, axis=1).max())
    touched = np.flatnonzero(near_cuts(sheet, reach))
    tail = np.repeat(sheet.points[touched][:, None], len(offsets), axis=1)
    lost = np.zeros((len(touched), len(offsets)), bool)
    for segment in sheet.cuts:
        lost |= crosses(tail, tail + offsets, segment)
    return touched, lost


def near_cuts(sheet: Sheet, reach: float) -> np.ndarray:
    """Which points lie within `reach` of a cut, shape (N,)."""
    near = np.zeros(sheet.size, bool)
    for start, end in sheet.cuts:
        a, b = np.array(start), np.array(end)
        share = np.clip((sheet.points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        near |= np.linalg.norm(sheet.points - a - share[:, None] * (b - a), axis=1) <= reach * (1.0 + 1e-6)
    return near
