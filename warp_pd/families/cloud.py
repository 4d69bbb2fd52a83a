"""Families of a cloud of points: one row per point."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError
from ..geometry.sheet import Sheet
from .rows import common_by_row
from .tables import TOLERANCE, Families, Horizon, InfluenceFunction, in_blocks
from .visibility import cut_through, severed


def cloud_families(sheet: Sheet, horizon: Horizon, function: InfluenceFunction, intersections: bool) -> Families:
    """Families of a cloud; arguments as for `build_families`. Raises InputError if a point has no neighbours."""
    neighbours, reverses, incomplete = find_neighbours(sheet, np.arange(sheet.size), horizon)
    refuse_lone_points(sheet, np.arange(sheet.size), neighbours, horizon)
    return point_rows(sheet, np.arange(sheet.size), neighbours, reverses, incomplete, horizon, function, intersections)


def point_rows(
    sheet: Sheet,
    owners: np.ndarray,
    neighbours: np.ndarray,
    reverses: np.ndarray,
    incomplete: np.ndarray,
    horizon: Horizon,
    function: InfluenceFunction,
    intersections: bool,
) -> Families:
    """Family rows of the given points, one row per point.

    Args:
        sheet: The sheet.
        owners: The points, shape (R,).
        neighbours: Their members, -1 where there is none, shape (R, n).
        reverses: Member indices of the reverse bonds, shape (R, n).
        incomplete: Mask of families that lost members to a cut, shape (R,).
        horizon: The horizon.
        function: Influence function.
        intersections: As for `build_families`.
    """
    points, (rows, n) = sheet.points, neighbours.shape
    exists = neighbours >= 0
    reference_area = float(sheet.areas.mean())
    # Of the points, over the horizon that lengths are divided by.
    relative = None if sheet.spacings is None else sheet.spacings / sheet.spacing
    horizons = None if relative is None else np.where(exists, relative[neighbours], 1.0)
    chords = np.empty((rows, n, points.shape[1]))
    influence, member_areas = np.empty((rows, n)), np.empty((rows, n))

    def fill(part: slice) -> None:
        here, member = exists[part], np.maximum(neighbours[part], 0)
        chords[part] = np.where(here[..., None], points[member] - points[owners[part], None], 0.0) / horizon.length
        r = np.sqrt(sum(x**2 for x in np.moveaxis(chords[part], -1, 0)))
        if horizons is not None and relative is not None:
            r /= 0.5 * (horizons[part] + relative[owners[part], None])
        r = np.minimum(r, 1.0)
        influence[part] = np.where(here, function(np.where(here, r, 1.0)), 0.0)
        member_areas[part] = np.where(here, sheet.areas[member], 0.0) / reference_area

    in_blocks(rows, n, fill)
    frames = None if sheet.frames is None else whole_frames(sheet.frames[owners])
    return Families(
        horizon=horizon.length,
        reference_area=reference_area,
        exists=exists,
        bonds=chords if frames is None else chords @ frames[..., :2],
        influence=influence,
        common=common_by_row(chords, exists, TOLERANCE, horizons) if intersections else np.zeros((0, 0, 0), np.uint32),
        member_areas=member_areas,
        areas=sheet.areas[owners] / reference_area,
        reverses=reverses,
        neighbours=neighbours,
        severed=incomplete,
        factors=None if sheet.factors is None else sheet.factors[owners],
        frames=frames,
        chords=None if frames is None else chords,
    )


def whole_frames(frames: np.ndarray) -> np.ndarray:
    """Tangent vectors e1 and e2, shape (N, 3, 2), and the normal e1 x e2, as columns, shape (N, 3, 3)."""
    return np.concatenate([frames, np.cross(frames[..., 0], frames[..., 1])[..., None]], axis=-1)


def refuse_lone_points(sheet: Sheet, owners: np.ndarray, neighbours: np.ndarray, horizon: Horizon) -> None:
    """Raise InputError if a point has no neighbours, i.e. its first member does not exist."""
    lone = owners[neighbours[:, 0] < 0] if neighbours.shape[1] else owners
    if len(lone):
        raise InputError(
            f"points[{lone[0]}] at {sheet.points[lone[0]].tolist()} has no neighbour within the horizon "
            f"{horizon.length:.6g} m: expected at least one; increase the horizon or remove the point"
        )


def find_neighbours(sheet: Sheet, among: np.ndarray, horizon: Horizon) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the bonds among the given points, ascending indices of shape (P,).

    Returns:
        Neighbours in ascending order (-1 for none) and reverse members, both (P, n); mask of points that lost bonds to
        a cut, (P,).
    """
    from scipy import sparse
    from scipy.spatial import cKDTree

    size = len(among)
    if sheet.spacings is None:
        pairs = cKDTree(sheet.points[among]).query_pairs(horizon.length * (1.0 + TOLERANCE), output_type="ndarray")
    else:
        pairs = _graded_pairs(sheet.points[among], sheet.spacings[among] * horizon.ratio)
    incomplete = np.zeros(size, bool)
    incomplete[pairs[cut_through(sheet, among[pairs])]] = True
    pairs = pairs[~severed(sheet, among[pairs])]
    half = sparse.coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(size, size)).tocsr()
    graph = half + half.T
    sizes = np.diff(graph.indptr)
    member = np.arange(int(sizes.max(initial=0)), dtype=np.int32)
    exists = member < sizes[:, None]
    neighbours = np.full(exists.shape, -1, np.int32)
    neighbours[exists] = among[graph.indices]
    # Bond (i, j) is entry e by rows; by columns, entry e is its reverse bond.
    slot = np.broadcast_to(member, exists.shape)[exists]
    reverses = np.zeros(exists.shape, np.int32)
    reverses[exists] = sparse.csr_array((slot, graph.indices, graph.indptr), shape=graph.shape).tocsc().data
    return neighbours, reverses, incomplete


def _graded_pairs(points: np.ndarray, horizons: np.ndarray) -> np.ndarray:
    """Pairs of points within the mean of their horizons [m], lower index first, shape (B, 2)."""
    from scipy.spatial import cKDTree

    found = cKDTree(points).query_ball_point(points, horizons * (1.0 + TOLERANCE))
    tail = np.repeat(np.arange(len(points)), [len(members) for members in found])
    head = np.concatenate([np.asarray(members, np.int64) for members in found])
    # Of two points, the one with the longer horizon finds the other.
    pairs = np.unique(np.sort(np.column_stack([tail, head])[tail != head], axis=1), axis=0)
    length = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    return np.asarray(pairs[length <= horizons[pairs].mean(axis=1) * (1.0 + TOLERANCE)])
