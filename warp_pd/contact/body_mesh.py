"""A rigid body from a triangle mesh."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..device.checks import InputError, numbers
from ..kernels.contact.mesh_distance import mesh_distance, mesh_distance_of_point
from ..shapes.files import read_mesh
from ..shapes.mesh_checks import require_closed, require_distinct_points, require_faces, require_solid, require_surface
from .body_shapes import BodyShape, Outline, convex_edges

# Least angle by which the normal turns at a sharp edge [rad].
SHARP = 0.5


@dataclass(frozen=True, eq=False)
class TriangleMesh(BodyShape):
    """A solid bounded by a closed triangle surface; the origin of its frame is the centre of mass, `centroid`.

    Attributes:
        vertices: Positions [m], shape (V, 3).
        triangles: Vertex indices, counter-clockwise seen from outside, shape (F, 3).
        centroid: Centre of mass for uniform density, in the coordinates of `vertices` [m], shape (3,).
        notes: What reading it from a file changed, and pieces that overlap, for the notes of a run.
        overlap: Which pieces overlap; "" if none was found.

    A closed piece inside another one that faces inwards is a cavity.

    Raises:
        InputError: for a surface with a boundary, degenerate or flipped triangles, or pieces that face inwards.
    """

    vertices: Any
    triangles: Any
    centroid: np.ndarray = field(init=False)
    notes: tuple[str, ...] = ()
    overlap: str = field(init=False)

    kind: ClassVar[str] = "mesh"
    distance: ClassVar[Any] = mesh_distance
    remembering: ClassVar[Any] = mesh_distance_of_point

    def __post_init__(self) -> None:
        where = "TriangleMesh"
        points, triangles = numbers(f"{where}.vertices", self.vertices), np.asarray(self.triangles)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"{where}.vertices: expected shape (V, 3), got {points.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
            raise InputError(
                f"{where}.triangles is {triangles.dtype} of shape {triangles.shape}: expected indices, (F, 3)"
            )
        require_faces(where, points, np.full(len(triangles), 3), triangles.ravel())
        require_distinct_points(where, points, triangles)
        require_surface(where, points, triangles, np.arange(len(triangles)))
        require_closed(where, triangles)
        if overlap := require_solid(where, points, triangles):
            overlap = f"{overlap}, which counts twice in its centre of mass and inertia"
            object.__setattr__(self, "notes", (*self.notes, f"{overlap}; unite its pieces"))
        object.__setattr__(self, "overlap", overlap)
        used = np.unique(triangles)
        renumber = np.zeros(len(points), np.int32)
        renumber[used] = np.arange(len(used))
        object.__setattr__(self, "vertices", points[used])
        object.__setattr__(self, "triangles", renumber[triangles])
        object.__setattr__(self, "centroid", points[0] + _moments(points - points[0], triangles)[1])

    @staticmethod
    def from_file(
        path: str | os.PathLike[str], *, unit: str | float | None = None, part: str | None = None
    ) -> TriangleMesh:
        """Read the closed surface from a file, or one part of it; see `warp_pd.read_mesh`.

        Raises:
            InputError: if the file cannot be read or the surface is not closed.
        """
        mesh = read_mesh(path, unit=unit, part=part, closed=True)
        return TriangleMesh(mesh.vertices, mesh.triangles, mesh.notes)

    def sizes(self) -> tuple[float, ...]:
        """The radius."""
        return (self.radius(),)

    def radius(self) -> float:
        """Largest distance of a vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices - self.centroid, axis=1).max())

    def thinnest(self) -> float:
        """Smallest extent along x, y or z [m]."""
        return float(np.ptp(self.vertices, axis=0).min())

    def edge_radius(self) -> float:
        """0 where faces meet at a sharp convex edge [m]."""
        return 0.0 if len(convex_edges(*self.surface(), least=SHARP)[1]) else math.inf

    def inertia(self) -> np.ndarray:
        """Inertia tensor divided by mass [m^2], integrated over the tetrahedra between origin and triangles.

        Raises:
            InputError: for pieces that overlap.
        """
        if self.overlap:
            raise InputError(f"TriangleMesh: {self.overlap}: expected pieces united in one, or Free(inertia=)")
        volume, _, second = _moments(self.vertices - self.centroid, self.triangles)
        return np.asarray((np.trace(second) * np.eye(3) - second) / volume)

    def outline(self, extent: float) -> Outline:
        """The mesh."""
        return self.vertices - self.centroid, self.triangles

    def surface(self) -> Outline:
        """The mesh."""
        return self.outline(0.0)

    def segments(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """The convex edges."""
        return *convex_edges(*self.surface()), 0.0


def _moments(points: np.ndarray, triangles: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume [m^3], centre of mass [m], (3,), and integral of x (x) x [m^5], (3, 3), of a closed surface."""
    corners = points[triangles]
    volumes = np.linalg.det(corners) / 6.0
    volume, total = float(volumes.sum()), corners.sum(axis=1)
    second = np.einsum("f,fka,fkb->ab", volumes, corners, corners) + np.einsum("f,fa,fb->ab", volumes, total, total)
    return volume, volumes @ total / (4.0 * volume), second / 20.0
