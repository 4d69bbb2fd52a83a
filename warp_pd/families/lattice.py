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
    near_x = _edge_code(lattice.columns, reach)
    near_y = _edge_code(lattice.rows, reach)
    severed = _severed(sheet, ox, oy)
    if severed is None and sheet.stiffness is None:
        first, family_class = _classes(near_x, near_y)
    else:
        code = (near_y[:, None].astype(np.int64) * (near_x.max() + 1) + near_x[None, :]).ravel()
        if severed is not None:
            touched, lost = severed
            patterns, which = np.unique(pack(lost), axis=0, return_inverse=True)
            code = code * (len(patterns) + 1)
            code[touched] += 1 + which.ravel()
        if sheet.stiffness is not None:
            factors, which = np.unique(sheet.stiffness, return_inverse=True)
            code = code * len(factors) + which.ravel()
        _, first, family_class = np.unique(code, return_index=True, return_inverse=True)

    row, column = np.divmod(first, lattice.columns)
    to_x, to_y = column[:, None] + ox, row[:, None] + oy
    exists = (to_x >= 0) & (to_x < lattice.columns) & (to_y >= 0) & (to_y < lattice.rows)
    severed_rows = np.zeros(len(first), bool)
    if severed is not None:
        touched, lost = severed
        position = np.full(sheet.size, -1)
        position[touched] = np.arange(len(touched))
        here = position[first]
        exists[here >= 0] &= ~lost[here[here >= 0]]
        severed_rows[here >= 0] = lost[here[here >= 0]].any(axis=1)
    areas, reference_area = sheet.stored("areas"), float(sheet.areas.mean())
    member = np.where(exists, to_y * lattice.columns + to_x, 0)
    return Families(
        horizon=horizon,
        reference_area=reference_area,
        exists=exists,
        bonds=offsets / horizon,
        influence=function(r),
        common=pack(apart <= horizon * (1.0 + TOLERANCE)) if intersections else np.zeros((0, 0), np.uint32),
        member_areas=np.where(exists, areas[member.ravel()].reshape(member.shape), 0.0) / reference_area,
        areas=areas[first] / reference_area,
        reverses=reverses,
        family_class=family_class.ravel().astype(np.int32, copy=False),
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


def _classes(near_x: np.ndarray, near_y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First point of each pair of codes, and the number of the pair at each point, without a table of all codes."""
    _, first_x, of_x = np.unique(near_x, return_index=True, return_inverse=True)
    _, first_y, of_y = np.unique(near_y, return_index=True, return_inverse=True)
    first = (len(near_x) * first_y[:, None] + first_x).ravel()
    found = np.empty((len(near_y), len(near_x)), np.int32)
    np.add((len(first_x) * of_y)[:, None], of_x, out=found, casting="same_kind")
    return first, found.ravel()


def _severed(sheet: Sheet, ox: np.ndarray, oy: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
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
