"""The geometry of a sheet."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .triangulation import Lattice, Segment, doubled_normals


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """Points with areas, and a triangulation.

    Attributes:
        points: Reference positions [m], float64, shape (N, 2); of a curved sheet (N, 3).
        areas: Area represented by each point [m^2], shape (N,).
        triangles: Triangulation, counter-clockwise (of a curved sheet: seen from outside), shape (F, 3), int32.
        spacing: Distance of neighbouring points [m], the minimum on a graded sheet; the horizon is a multiple of it.
        lattice: The lattice if the points form a complete rectangular grid, otherwise None.
        cuts: Segments that no bond crosses.
        tips: Whether the ends of each cut are tips, inside the shape and not on another cut: a bond through a tip
            exists, so that a cut acts as long as it is drawn.
        inclusions: Point indices of each rigid inclusion.
        grid: Column and row of each point on a square grid of pitch `spacing`, -1 for other points, int32, shape (N,
            2); or None. Points on the grid are in order, row by row. The grid may have gaps.
        spacings: Local spacing at each point of a graded sheet [m], shape (N,); None if uniform.
        frames: Orthonormal tangent vectors at each point, columns e1 and e2, shape (N, 3, 2), of a curved sheet; or
            None.
        barriers: Edges of the sheet that no bond crosses, pairs of points with the sheet on the left, int32, shape
            (B, 2); or None if bonds are only limited by the horizon.
        bodies: Index (from 1) of the rigid inclusion that contains each point, 0 for the sheet and the edges of
            inclusions, int32, shape (N,); or None. Bonds join only points with equal indices.
        parts: Point indices of parts of the boundary, by name.
        pieces: Index (from 1) of the piece of each point, int32, shape (N,); None for a single piece. Bonds join only
            points of one piece.
        origins: Position of the origin of each piece [m], shape (pieces, 2); of a curved shape (pieces, 3); or None.
        notes: What may be a mistake of the shape, and what its reader changed, one line each; the summary of a run has
            them.
    """

    points: np.ndarray
    areas: np.ndarray
    triangles: np.ndarray
    spacing: float
    lattice: Lattice | None = None
    cuts: tuple[Segment, ...] = ()
    tips: tuple[tuple[bool, bool], ...] = ()
    inclusions: tuple[np.ndarray, ...] = ()
    grid: np.ndarray | None = None
    spacings: np.ndarray | None = None
    frames: np.ndarray | None = None
    barriers: np.ndarray | None = None
    bodies: np.ndarray | None = None
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    pieces: np.ndarray | None = None
    origins: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def extent(self) -> np.ndarray:
        """Size along each axis [m]."""
        return np.asarray(np.ptp(self.points, axis=0))

    @property
    def whole_lattice(self) -> Lattice | None:
        """The lattice if the points are all of its points in order; None for a part of a lattice."""
        lattice = self.lattice
        return lattice if lattice is not None and self.size == lattice.columns * lattice.rows else None

    @property
    def widest_spacing(self) -> float:
        """The largest distance between neighbouring points [m]."""
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

    def body_of(self, points: np.ndarray) -> np.ndarray:
        """Index (from 0) of the rigid inclusion of each of these points, of their shape; -1 outside."""
        body = np.full(self.size, -1, np.int32)
        for number, members in enumerate(self.inclusions):
            body[members] = number
        return np.asarray(body[points])

    @property
    def normals(self) -> np.ndarray:
        """Unit normals [-], shape (N, 3): +z on a flat sheet, outward on a curved one."""
        if self.frames is None:
            return np.tile([0.0, 0.0, 1.0], (self.size, 1))
        return np.cross(self.frames[..., 0], self.frames[..., 1])

    @functools.cached_property
    def folds(self) -> np.ndarray:
        """Twice the largest angle between the normal of a point and that of its triangles [degrees], shape (N,)."""
        largest = np.ones(self.size)
        if self.frames is None or not len(self.triangles):
            return 0.0 * largest
        triangles = np.asarray(self.triangles)
        normals = doubled_normals(self.points, triangles)
        normals = normals / np.linalg.norm(normals, axis=1)[:, None]
        for corner in range(3):
            np.minimum.at(largest, triangles[:, corner], (normals * self.normals[triangles[:, corner]]).sum(axis=1))
        return np.asarray(2.0 * np.degrees(np.arccos(np.clip(largest, -1.0, 1.0))))
