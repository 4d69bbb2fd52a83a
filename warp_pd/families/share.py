"""The part of a sheet that one process of several holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..checks import InputError
from ..sheet import Sheet

# Points are divided in whole blocks: sums over points go by blocks, and then are the same on any number of processes.
BLOCK = 256
# Width of the halo in horizons: forces on the own points need the families of the first horizon outside, and these
# families need the displacements of the second.
HALO = 2


@dataclass(frozen=True, eq=False)
class Share:
    """The points that a process owns, and those around them that it also needs: its halo.

    Attributes:
        rank: Number of the process, from 0.
        bounds: First point of each process in the whole sheet, and the number of its points, shape (processes + 1,).
        points: Index in the whole sheet of each point that is here, rising, shape (n,).
        own: The own points among them.
        near: Points whose families are whole here: the own ones and one horizon around them, bool, shape (n,). The
            others have empty families.
        faces: Index in the whole sheet of each triangle that is here; they are all own, shape (F,).
        inner: Own points whose families are all own, the longest run of them.
    """

    rank: int
    bounds: np.ndarray
    points: np.ndarray
    own: slice
    near: np.ndarray
    faces: np.ndarray
    inner: slice

    @property
    def size(self) -> int:
        """Number of processes."""
        return len(self.bounds) - 1

    def here(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which of some points of the whole sheet are here, positions in `points`, and their indices here."""
        found = np.searchsorted(self.points, points)
        found = np.minimum(found, len(self.points) - 1)
        at = np.flatnonzero(self.points[found] == points)
        return at, found[at].astype(np.int32)

    def owner_of(self, points: np.ndarray) -> np.ndarray:
        """Process that owns each of some points of the whole sheet."""
        return np.asarray(np.searchsorted(self.bounds, points, side="right") - 1)


def bounds_of(points: int, processes: int) -> np.ndarray:
    """First point of each process and the number of points, shape (processes + 1,): whole blocks, evenly divided."""
    blocks = -(-points // BLOCK)
    return np.minimum(np.linspace(0, blocks, processes + 1).astype(np.int64) * BLOCK, points)


def divided(sheet: Sheet, horizon: float, rank: int, processes: int) -> Share:
    """What a process holds of a sheet.

    Args:
        sheet: The sheet, whole.
        horizon: Over the spacing of the sheet [-].
        rank: Number of the process.
        processes: Number of processes.

    Raises:
        InputError: for more processes than the sheet has blocks of points.
    """
    bounds = bounds_of(sheet.size, processes)
    if not (np.diff(bounds) > 0).all():
        most = -(-sheet.size // BLOCK)
        raise InputError(
            f"processes = {processes!r}: expected at most {most} on a sheet of {sheet.size} points, as each takes "
            f"whole blocks of {BLOCK}"
        )
    begin, end = int(bounds[rank]), int(bounds[rank + 1])
    # The triangles of a point go with it: each belongs to the owner of its lowest corner.
    lowest = sheet.triangles.min(axis=1)
    faces = np.flatnonzero((lowest >= begin) & (lowest < end))
    reached = _lattice_reach(sheet, horizon) if sheet.lattice is not None else None
    if reached is not None:
        ranges = [(max(begin - k * reached, 0), min(end + k * reached, sheet.size)) for k in range(1, HALO + 1)]
        points = np.arange(*ranges[-1])
        near = (points >= ranges[0][0]) & (points < ranges[0][1])
    else:
        points, near = _around(sheet, horizon, begin, end, np.unique(sheet.triangles[faces]))
    own = slice(first := int(np.searchsorted(points, begin)), first + end - begin)
    if reached is not None:
        inner = slice(own.start + (reached if own.start else 0), own.stop - (reached if own.stop < len(points) else 0))
    else:
        inner = _inner(sheet, horizon, points, own)
    return Share(rank, bounds, points, own, near, faces, inner)


def _inner(sheet: Sheet, horizon: float, points: np.ndarray, own: slice) -> slice:
    """The longest run of own points without a point of the halo within the horizon."""
    from scipy.spatial import cKDTree

    outside = np.delete(points, own)
    if not len(outside):
        return own
    distance = horizon * sheet.widest_spacing * (1.0 + 1e-6)
    apart = cKDTree(sheet.points[outside]).query(sheet.points[points[own]], distance_upper_bound=distance)[0]
    ends = np.flatnonzero(np.isfinite(np.concatenate([[0.0], apart, [0.0]])))
    longest = int(np.argmax(np.diff(ends)))
    return slice(own.start + int(ends[longest]), own.start + int(ends[longest + 1]) - 1)


def _lattice_reach(sheet: Sheet, horizon: float) -> int:
    """Largest difference of the indices of two points of a family or of a triangle of a lattice."""
    lattice = sheet.lattice
    assert lattice is not None
    reach = [max(1, int(horizon * sheet.spacing / step + 1e-6)) for step in (lattice.dx, lattice.dy)]
    return reach[0] + reach[1] * lattice.columns


def _around(sheet: Sheet, horizon: float, begin: int, end: int, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points within two horizons of the points begin to end - 1, and which of them are within one, or are corners."""
    from scipy.spatial import cKDTree

    distance = horizon * sheet.widest_spacing * (1.0 + 1e-6)
    near = np.zeros(sheet.size, bool)
    near[begin:end] = True
    for _ in range(HALO - 1):
        inside = cKDTree(sheet.points[near]).query(sheet.points, distance_upper_bound=distance)[0]
        near |= np.isfinite(inside)
    near[corners] = True
    held = np.isfinite(cKDTree(sheet.points[near]).query(sheet.points, distance_upper_bound=distance)[0])
    points = np.flatnonzero(held)
    return points, near[points]


def part_of_sheet(sheet: Sheet, share: Share) -> Sheet:
    """The points of a share as a sheet. Its lattice is the whole one; edges, cuts and outlines are left out.

    It carries what parts and laws ask of points. Families are built of the whole sheet.
    """
    points = share.points
    local = np.full(sheet.size, -1, np.int32)
    local[points] = np.arange(len(points))

    def of(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[points]

    return replace(
        sheet,
        points=sheet.points[points], areas=sheet.areas[points], triangles=local[sheet.triangles[share.faces]],
        grid=of(sheet.grid), spacings=of(sheet.spacings), frames=of(sheet.frames), bodies=of(sheet.bodies),
        pieces=of(sheet.pieces), stiffness=of(sheet.stiffness), barriers=None, cuts=(), parts={}, inclusions=(),
    )  # fmt: skip
