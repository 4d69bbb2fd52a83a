"""Families of a cloud of points: one row per point."""

from __future__ import annotations

import numpy as np

from ..checks import InputError
from ..kernels.families import WORD
from ..sheet import Sheet
from .masks import pack
from .tables import TOLERANCE, Families, InfluenceFunction, in_blocks
from .visibility import cut_through, severed


def cloud_families(sheet: Sheet, horizon: float, function: InfluenceFunction, intersections: bool) -> Families:
    """Families of a cloud; arguments as for `build_families`, the horizon in meters.

    Raises:
        InputError: for a point without neighbours.
    """
    points, (neighbours, reverses, incomplete) = sheet.points, _cloud_neighbours(sheet, horizon)
    size, n = neighbours.shape
    exists = neighbours >= 0
    reference_area = float(sheet.areas.mean())
    bonds, influence, member_areas = np.empty((size, n, 2)), np.empty((size, n)), np.empty((size, n))

    def fill(part: slice) -> None:
        here, member = exists[part], np.maximum(neighbours[part], 0)
        bonds[part] = np.where(here[..., None], points[member] - points[part, None], 0.0) / horizon
        r = np.minimum(np.linalg.norm(bonds[part], axis=-1), 1.0)
        influence[part] = np.where(here, function(np.where(here, r, 1.0)), 0.0)
        member_areas[part] = np.where(here, sheet.areas[member], 0.0) / reference_area

    in_blocks(size, n, fill)
    return Families(
        horizon=horizon,
        reference_area=reference_area,
        exists=exists,
        bonds=bonds,
        influence=influence,
        common=_cloud_common(bonds, exists) if intersections else np.zeros((0, 0, 0), np.uint32),
        member_areas=member_areas,
        areas=sheet.areas / reference_area,
        reverses=reverses,
        neighbours=neighbours,
        severed=incomplete,
        stiffness=sheet.stiffness,
    )


def _cloud_neighbours(sheet: Sheet, horizon: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbours in ascending order and reverse members, (N, n); which points lost bonds to a cut, (N,)."""
    from scipy import sparse
    from scipy.spatial import cKDTree

    points, size = sheet.points, sheet.size
    pairs = cKDTree(points).query_pairs(horizon * (1.0 + TOLERANCE), output_type="ndarray")
    incomplete = np.zeros(size, bool)
    incomplete[pairs[cut_through(sheet, pairs)]] = True
    pairs = pairs[~severed(sheet, pairs)]
    half = sparse.coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(size, size)).tocsr()
    graph = half + half.T
    sizes = np.diff(graph.indptr)
    if (sizes == 0).any():
        lone = int(np.flatnonzero(sizes == 0)[0])
        raise InputError(
            f"points[{lone}] at {points[lone].tolist()} has no neighbour within the horizon "
            f"{horizon:.6g} m: expected points with at least one; raise the horizon or remove the point"
        )
    member = np.arange(int(sizes.max()), dtype=np.int32)
    exists = member < sizes[:, None]
    neighbours = np.full(exists.shape, -1, np.int32)
    neighbours[exists] = graph.indices
    # Bond (i, j) is entry e by rows; by columns, entry e is its reverse bond.
    slot = np.broadcast_to(member, exists.shape)[exists]
    reverses = np.zeros(exists.shape, np.int32)
    reverses[exists] = sparse.csr_array((slot, graph.indices, graph.indptr), shape=graph.shape).tocsc().data
    return neighbours, reverses, incomplete


def _cloud_common(bonds: np.ndarray, exists: np.ndarray) -> np.ndarray:
    points, n = exists.shape
    common = np.empty((points, n, -(-n // WORD)), np.uint32)
    limit = (1.0 + TOLERANCE) ** 2

    def fill(part: slice) -> None:
        x, y, here = bonds[part, :, 0], bonds[part, :, 1], exists[part]
        apart = (x[:, :, None] - x[:, None]) ** 2
        apart += (y[:, :, None] - y[:, None]) ** 2
        common[part] = pack((apart <= limit) & here[:, :, None] & here[:, None])

    in_blocks(points, n * n, fill)
    return common
