"""The partition of a sheet among processes: owned points, and ghost points around them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..device.checks import InputError
from ..families.partition import ALIGNED, Partition
from ..families.tables import Horizon
from ..geometry.couplings import points_near
from ..geometry.sheet import Sheet
from ..kernels.block_sums import BLOCK

# Width of the halo in horizons: forces on the owned points need the families of the first horizon outside, and these
# families need the displacements of the second.
HALO = 2


def bounds_of(points: int, processes: int) -> np.ndarray:
    """First point of each process and the number of points, shape (processes + 1,): whole blocks, evenly divided."""
    blocks = -(-points // BLOCK)
    return np.minimum(np.linspace(0, blocks, processes + 1).astype(np.int64) * BLOCK, points)


def partition_sheet(sheet: Sheet, horizon: float, rank: int, processes: int, layers: int = 0) -> Partition:
    """The partition of a whole sheet for the process `rank` of several; the horizon is in spacings.

    `layers` of further points (neighbours in triangles) surround the halo.
    """
    bounds = bounds_of(sheet.size, processes)
    if not (np.diff(bounds) > 0).all():
        most = -(-sheet.size // BLOCK)
        raise InputError(
            f"processes = {processes!r}: expected at most {most} on a sheet of {sheet.size} points, as each takes "
            f"whole blocks of {BLOCK}"
        )
    if sheet.lattice is None:
        return _scattered(sheet, horizon, rank, bounds, layers)
    begin, end = int(bounds[rank]), int(bounds[rank + 1])
    reach = _lattice_reach(sheet, horizon)
    columns = sheet.lattice.columns
    # At most a row more.
    step = ALIGNED if columns >= ALIGNED else 1
    apart, wide = (-(-far // step) * step for far in (reach, HALO * reach + layers * (columns + 1)))
    points = np.arange(max(begin - wide, 0), min(end + wide, sheet.size))
    near, halo = ((points >= begin - far) & (points < end + far) for far in (reach, HALO * reach))
    own = slice(begin - int(points[0]), end - int(points[0]))
    inner = slice(own.start + (apart if own.start else 0), own.stop - (reach if own.stop < len(points) else 0))
    return Partition(rank, bounds, points, own, near, halo, _faces(sheet, begin, end), inner)


def _faces(sheet: Sheet, begin: int, end: int) -> np.ndarray:
    """Triangles of a lattice whose lowest corner is one of the points begin to end - 1."""
    lowest = sheet.triangles.min(axis=1)
    return np.flatnonzero((lowest >= begin) & (lowest < end))


def _scattered(sheet: Sheet, horizon: float, rank: int, bounds: np.ndarray, layers: int) -> Partition:
    """The partition of a cloud or a grid with holes, by position instead of by index.

    Owned points come first. On a cloud, inner points come before those near the border, and complete families before
    empty ones.
    """
    cloud, processes = sheet.layout == "cloud", len(bounds) - 1
    owners = bisection(sheet.points, processes) if cloud else row_bands(sheet.points, processes, sheet.spacing)
    if np.bincount(owners, minlength=processes).min() == 0:
        raise InputError(f"processes = {processes!r}: expected fewer than the rows of a grid of {sheet.size} points")
    mine = owners == rank
    own = np.flatnonzero(mine)
    faces = np.flatnonzero(mine[sheet.triangles.min(axis=1)])
    near, reached = _around(sheet, horizon, own, np.unique(sheet.triangles[faces]))
    within = reached.copy()
    for _ in range(layers):
        reached[sheet.triangles[reached[sheet.triangles].any(axis=1)]] = True
    halo = np.flatnonzero(reached & ~mine)
    apart = _apart(sheet, horizon, own, halo)
    if cloud:
        own, apart = np.concatenate([own[apart], own[~apart]]), np.sort(apart)[::-1]
        halo = np.concatenate([halo[near[halo]], halo[~near[halo]]])
    points = np.concatenate([own, halo])
    inner = _longest_run(apart)
    return Partition(rank, bounds, points, slice(0, len(own)), near[points], within[points], faces, inner, owners)


def _longest_run(flags: np.ndarray) -> slice:
    """The longest run of true flags."""
    ends = np.flatnonzero(np.concatenate([[True], ~flags, [True]]))
    longest = int(np.argmax(np.diff(ends)))
    return slice(int(ends[longest]), int(ends[longest + 1]) - 1)


def row_bands(points: np.ndarray, parts: int, spacing: float) -> np.ndarray:
    """Part to which each point belongs, shape (N,): bands along x that divide no row of a grid.

    Kernels rely on the points of a row being consecutive.
    """
    height = points[:, 1]
    order = np.argsort(height, kind="stable")
    begins = np.flatnonzero(np.diff(height[order]) > 1e-6 * spacing) + 1
    wanted = len(points) * np.arange(1, parts) // parts
    found = np.zeros(len(points), np.uint16)
    for at in begins[np.minimum(np.searchsorted(begins, wanted), len(begins) - 1)]:
        found[order[at:]] += 1
    return found


def bisection(points: np.ndarray, parts: int) -> np.ndarray:
    """Part to which each point belongs, shape (N,), by recursive bisection across the longest side."""
    found = np.zeros(len(points), np.uint16)
    pieces = [(np.arange(len(points)), 0, parts)]
    while pieces:
        piece, first, number = pieces.pop()
        found[piece] = first
        if number == 1:
            continue
        low = number // 2
        at = len(piece) * low // number
        places = points[piece]
        along = places[:, np.argmax(np.ptp(places, axis=0))]
        # Points side by side stay in their order, so that every process finds the same.
        order = np.argsort(along, kind="stable")
        pieces += [(np.sort(piece[order[:at]]), first, low), (np.sort(piece[order[at:]]), first + low, number - low)]
    return found


def _apart(sheet: Sheet, horizon: float, own: np.ndarray, halo: np.ndarray) -> np.ndarray:
    """Mask of the points `own` that have no point of `halo` within the horizon."""
    from scipy.spatial import cKDTree

    if not len(halo):
        return np.ones(len(own), bool)
    distance = horizon * sheet.widest_spacing * (1.0 + 1e-6)
    found, _ = cKDTree(sheet.points[halo]).query(sheet.points[own], distance_upper_bound=distance)
    return np.asarray(np.isinf(found))


def _lattice_reach(sheet: Sheet, horizon: float) -> int:
    """Largest difference of the indices of two points of a family or of a triangle of a lattice."""
    lattice = sheet.lattice
    assert lattice is not None
    found = Horizon.of(sheet, horizon)
    reach = [max(1, found.reach(step)) for step in (lattice.dx, lattice.dy)]
    return reach[0] + reach[1] * lattice.columns


def _around(sheet: Sheet, horizon: float, own: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the points within one horizon of `own` (or in `corners`), and within two horizons, (N,)."""
    distance = horizon * sheet.widest_spacing * (1.0 + 1e-6)
    near = np.zeros(sheet.size, bool)
    near[own] = True
    for _ in range(HALO - 1):
        near = points_near(sheet.points, near, distance)
    near[corners] = True
    return near, points_near(sheet.points, near, distance)


def sheet_on_partition(sheet: Sheet, partition: Partition) -> Sheet:
    """The points of a partition as a sheet, with the whole lattice but without edges, cuts and outlines.

    It has the point data that parts and laws need. Families are built from the whole sheet.
    """

    def of(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else partition.rows(values)

    return replace(
        sheet,
        points=partition.rows(sheet.points), areas=partition.rows(sheet.areas),
        triangles=partition.here(sheet.triangles[partition.faces].ravel())[1].reshape(-1, 3),
        grid=of(sheet.grid), spacings=of(sheet.spacings), frames=of(sheet.frames), bodies=of(sheet.bodies),
        pieces=of(sheet.pieces), **sheet.at_points(partition.rows), barriers=None, cuts=(), tips=(), parts={},
        inclusions=(),
    )  # fmt: skip
