"""The points of a sheet that one of several processes has."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ..kernels.block_sums import BLOCK

# Own and inner points of a lattice begin at a multiple of it, as do the blocks of its processes: the threads of a warp
# then access whole lines of memory. Without, the second of two GPUs took a quarter longer for a drift.
ALIGNED = BLOCK


@dataclass(frozen=True, eq=False)
class Partition:
    """The points that a process owns, and its ghost points: the surrounding points that it also needs (halo).

    Attributes:
        rank: Number of the process, from 0.
        bounds: First point of the blocks of each process, and the number of points of the whole sheet, shape (processes
            + 1,). Sums over points are computed by these blocks.
        points: Index in the whole sheet of each local point, shape (n,); ascending unless points are scattered.
        owned: Range of the owned points among them; all others are ghost points.
        near: Mask of points with complete families: owned points and one horizon around them, shape (n,). The others
            have empty families.
        halo: Mask of the owned points and two horizons around them, shape (n,): all but the further layers.
        faces: Index in the whole sheet of each local triangle (those whose lowest corner is owned), shape (F,).
        inner: Longest range of owned points whose families are all owned.
        owners: Owner of each point of the whole sheet, shape (N,), if points are scattered, i.e. assigned by position
            instead of by block; otherwise None.
    """

    rank: int
    bounds: np.ndarray
    points: np.ndarray
    owned: slice
    near: np.ndarray
    halo: np.ndarray
    faces: np.ndarray
    inner: slice
    owners: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of processes."""
        return len(self.bounds) - 1

    @property
    def ghost(self) -> np.ndarray:
        """Mask of ghost points among the local points, shape (n,)."""
        found = np.ones(len(self.points), bool)
        found[self.owned] = False
        return found

    @functools.cached_property
    def span(self) -> slice:
        """Range of the points of this process in the whole sheet, if they are consecutive; see `rows`."""
        return slice(int(self.points[0]), int(self.points[-1]) + 1)

    def rows(self, values: np.ndarray) -> np.ndarray:
        """The entries of this process of an array of all points; a view if its points are consecutive."""
        return values[self.span] if self.owners is None else np.asarray(values[self.points])

    @property
    def block_points(self) -> int:
        """Number of points of the own blocks."""
        return int(self.bounds[self.rank + 1] - self.bounds[self.rank])

    @functools.cached_property
    def whole_families(self) -> slice:
        """Range from the first to the last point of this process whose whole family is in this process."""
        near = np.flatnonzero(self.near)
        return slice(int(near[0]), int(near[-1]) + 1)

    @functools.cached_property
    def _order(self) -> np.ndarray:
        """Order of the local points by index in the whole sheet."""
        return np.argsort(self.points, kind="stable")

    def here(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions in `points` (indices in the whole sheet) of the local ones, and their local indices."""
        if self.owners is None:
            # They follow each other.
            places = np.asarray(points, np.int64) - self.points[0]
            at = np.flatnonzero((places >= 0) & (places < len(self.points)))
            return at, places[at].astype(np.int32)
        found = np.searchsorted(self.points, points, sorter=self._order)
        found = self._order[np.minimum(found, len(self.points) - 1)]
        at = np.flatnonzero(self.points[found] == points)
        return at, found[at].astype(np.int32)

    def owner_of(self, points: np.ndarray) -> np.ndarray:
        """Owner of each of the given points of the whole sheet."""
        return self.block_owner_of(points) if self.owners is None else np.asarray(self.owners[points])

    def block_owner_of(self, points: np.ndarray) -> np.ndarray:
        """Process whose blocks contain each of the given points of the whole sheet."""
        return np.asarray(np.searchsorted(self.bounds, points, side="right") - 1)
