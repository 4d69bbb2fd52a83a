"""The geometry of a sheet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .triangulation import Lattice, Segment


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """Points with areas, and a triangulation.

    Attributes:
        points: Reference positions [m], float64, shape (N, 2); of a curved sheet (N, 3).
        areas: Area that each point stands for [m^2], shape (N,).
        triangles: Triangulation, counter-clockwise (of a curved sheet: seen from outside), shape (F, 3), int32.
        spacing: Distance of neighbouring points [m], the least one of a graded sheet; the horizon is a multiple of it.
        lattice: The grid, if the points form a complete one.
        cuts: Segments that no bond crosses.
        inclusions: Point indices of each rigid inclusion.
        grid: Column and row of each point that is on a square grid of pitch `spacing`, int32, shape (N, 2), -1 for the
            others; or None. Points on it are in order, row by row. It may have gaps.
        spacings: Local spacing at each point [m], shape (N,), of a graded sheet; or None: one everywhere.
        frames: Orthonormal tangent vectors at each point, columns e1 and e2, shape (N, 3, 2), of a curved sheet; or
            None.
        barriers: Edges of the sheet that no bond crosses, pairs of points with the sheet on the left, int32, shape
            (B, 2); or None: bonds are as long as the horizon, whatever is between.
        bodies: Number of the rigid inclusion inside which each point lies, 0 for the sheet and the edges of inclusions,
            int32, shape (N,); or None. Bonds join points of one number.
        parts: Point indices of parts of the boundary, by name.
        pieces: Number of the piece that each point belongs to, from 1, int32, shape (N,); or None: there is one. Bonds
            join points of one piece.
        origins: Where the origin of each piece lies [m], shape (pieces, 2); of a curved shape (pieces, 3); or None.
    """

    points: np.ndarray
    areas: np.ndarray
    triangles: np.ndarray
    spacing: float
    lattice: Lattice | None = None
    cuts: tuple[Segment, ...] = ()
    inclusions: tuple[np.ndarray, ...] = ()
    grid: np.ndarray | None = None
    spacings: np.ndarray | None = None
    frames: np.ndarray | None = None
    barriers: np.ndarray | None = None
    bodies: np.ndarray | None = None
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    pieces: np.ndarray | None = None
    origins: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def extent(self) -> np.ndarray:
        """Size along each axis [m]."""
        # The first and the last corner of a lattice.
        corners = self.points if self.whole_lattice is None else self.points[[0, -1]]
        return np.asarray(np.ptp(corners, axis=0))

    @property
    def whole_lattice(self) -> Lattice | None:
        """The grid, if the points are all of it in order; None for a part of a lattice, too."""
        lattice = self.lattice
        return lattice if lattice is not None and self.size == lattice.columns * lattice.rows else None

    @property
    def widest_spacing(self) -> float:
        """The largest distance of neighbouring points [m]."""
        return self.spacing if self.spacings is None else float(self.spacings.max())

    @property
    def layout(self) -> str:
        """Layout of the families: "lattice", "grid" (with gaps) or "cloud"."""
        if self.lattice is not None:
            return "lattice"
        alike = self.spacings is None and self.frames is None
        return "grid" if self.grid is not None and alike else "cloud"

    @property
    def positions(self) -> np.ndarray:
        """Reference positions [m], shape (N, 3); z is zero on a flat sheet."""
        return np.column_stack([self.points, np.zeros((self.size, 3 - self.points.shape[1]))])

    @property
    def normals(self) -> np.ndarray:
        """Unit normals [-], shape (N, 3): +z on a flat sheet, outward on a curved one."""
        if self.frames is None:
            return np.tile([0.0, 0.0, 1.0], (self.size, 1))
        return np.cross(self.frames[..., 0], self.frames[..., 1])
