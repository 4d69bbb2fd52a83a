"""Which points the launches of the fast kernels of a GPU work on; see laws/fast_path.py."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.fields import Array
from .variational import BondAssociatedLaw


@dataclass(frozen=True)
class Run:
    """Families that a launch of the kernel of all families works on: some points, or entries of a list of points.

    Attributes:
        points: The list, or None.
        count: Array of the number of entries, on the device.
        start: First point or entry.
        stop: The one after the last.
    """

    points: Array | None
    count: Array | None
    start: int
    stop: int


@dataclass(frozen=True)
class Lists:
    """Lists of points of a lattice or grid.

    Attributes:
        edges: Points without the family of inner ones, ascending, on the host.
        edge_points: The same on the device.
        every: An array of one number, larger than all lists.
        near_breaking: Inner points of which a bond may break now; their number is counts[0].
        damaged: Inner points that have lost bonds, or None if bonds cannot break; their number is counts[1].
        counts: (2,).
    """

    edges: np.ndarray
    edge_points: Array
    every: Array
    near_breaking: Array | None
    damaged: Array | None
    counts: Array

    @staticmethod
    def of(force: BondAssociatedLaw, whole_families: slice, inner: int) -> Lists:
        """The lists of a law on a sheet."""
        context, owner = force.context, force.owner
        assert force.families.family_class is not None
        here = force.families.family_class[whole_families]
        edges = (np.flatnonzero(here != inner) + whole_families.start).astype(np.int32)
        held = edges if len(edges) else np.zeros(1, np.int32)
        several = [
            context.array(name, owner, wp.int32, shape=force.points, per="table") if force.intact is not None else None
            for name in ("near_breaking_points", "damaged_points")
        ]
        return Lists(
            edges=edges,
            edge_points=context.array("edge_points", owner, wp.int32, held, per="once"),
            every=context.array("every_edge_point", owner, wp.int32, np.array([2**31 - 1], np.int32), per="once"),
            near_breaking=several[0],
            damaged=several[1],
            counts=context.array("other_count", owner, wp.int32, shape=2, per="once"),
        )

    def edges_between(self, begin: int, end: int) -> Run:
        """Those of the points begin to end - 1 that are at an edge."""
        start, stop = np.searchsorted(self.edges, (begin, end)).tolist()
        return Run(self.edge_points, self.every, start, stop)
