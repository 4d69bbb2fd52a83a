"""Triangulated surfaces from files."""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass, field, replace

import numpy as np

from ..device.checks import InputError, one_of
from ..geometry.sheet import SIDES, Shape
from ..geometry.triangulation import boundary_edges, counter_clockwise, pieces, ring_names, voronoi_areas
from .clouds import cloud
from .faces import repeated_faces, sides_of, triangulate
from .file_checks import existing_file, library_reads, meters
from .mesh_blocks import read_faces
from .mesh_checks import require_closed, require_faces, require_surface, require_unfolded
from .seams import merged, seam_notes
from .usd_mesh import read_usd

USD = (".usd", ".usda", ".usdc", ".usdz")
# Extent along z over the largest extent of a mesh that counts as flat.
FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Mesh:
    """A checked triangulated surface that a sheet can use.

    Attributes:
        vertices: Positions [m], float64, shape (V, 3); every vertex belongs to a triangle.
        triangles: Consistently oriented triangles, int32, shape (F, 3).
        parts: Vertex indices of the file's groups of points, lines and faces, by name.
        notes: What reading changed or left out, and what may be a mistake of the mesh, one line each.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    parts: dict[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def flat(self) -> bool:
        """Whether all vertices have the same z."""
        extent = np.ptp(self.vertices, axis=0)
        return bool(extent[2] <= FLAT * extent.max())

    @functools.cached_property
    def pieces(self) -> int:
        """Number of connected pieces."""
        return int(pieces(self.triangles).max()) + 1


def read_mesh(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    part: str | None = None,
    closed: bool = False,
) -> Mesh:
    """Read the triangulated surface from a file.

    Quadrilaterals and polygons are divided into triangles. Second-order elements are reduced to their corners. A USD
    file with y up (upAxis) is turned to z up. Points without a triangle are dropped, as are line and point elements,
    but groups of points, lines and faces become `parts`; those without a name are "line 3", "surface 7", ... by their
    number. Points nearer than 0.001 of the shortest edge at either are merged, and faces listed twice are read once;
    `notes` say so.

    Args:
        path: A USD file (.usd, .usda, .usdc), an .obj or Abaqus .inp file, or any file that meshio reads: .msh, .stl,
            .ply, .vtu, .vtk, .off, ...
        unit: Unit of the coordinates: "m", "mm", "cm", "in", or a number of meters. None is only allowed for USD files
            that specify it (metersPerUnit).
        part: Name of the mesh in a USD file with several, or of the group of faces in another file.
        closed: Whether the surface must have no boundary.

    Raises:
        InputError: if the file is missing or unreadable, or the unit is missing. Also, naming the indices: for no
            triangles, missing points, coordinates that are not finite, triangles without area, hanging nodes, edges
            with more than two triangles, flipped or folded triangles, flat pieces that overlap, or volume elements.
    """
    file = existing_file(path)
    one_of("closed", closed, (True, False))
    if part is not None and not isinstance(part, str):
        raise InputError(f"part = {part!r}: expected a name or None")
    where = f"path = {str(file)!r}"
    is_usd = file.suffix.lower() in USD
    if not is_usd:
        meters(unit)
    with library_reads(file):
        faces = read_usd(file, part) if is_usd else read_faces(file)
    if part is not None and not is_usd:
        if not faces.groups:
            raise InputError(f"part = {part!r}: {file.name} has no named groups of faces: expected None")
        faces = faces.only(faces.groups[one_of("part", part, faces.groups)])
    scale = faces.meters if unit is None and faces.meters is not None else meters(unit)
    require_faces(where, faces.points, faces.counts, faces.corners)
    one = merged(faces.points, sides_of(faces.counts, faces.corners))
    corners = one.index[faces.corners]
    notes = [*(f"{where}: {note}" for note in faces.notes), *one.note(where)]
    triangles, face_of = triangulate(where, faces.points, faces.counts, corners)
    again = repeated_faces(faces.counts, corners)
    if again.any():
        notes.append(f"{where}: {int(again.sum())} faces with the corners of another one were left out")
        triangles, face_of = triangles[~again[face_of]], face_of[~again[face_of]]
    after = f"{where}: after merging {one.points} points at the place of another one" if one.points else where
    require_surface(after, faces.points, triangles, face_of)
    if closed:
        require_closed(where, triangles)
    used = np.unique(triangles)
    renumber = np.full(len(faces.points), -1)
    renumber[used] = np.arange(len(used))
    parts = {name: faces.points_of(chosen) for name, chosen in faces.groups.items()}
    for name, indices in faces.parts.items():
        parts[name] = np.union1d(parts.get(name, []), indices).astype(np.int64)
    parts = {name: np.unique(renumber[one.index[indices]]) for name, indices in parts.items()}
    parts = {name: indices[indices >= 0].astype(np.int32) for name, indices in parts.items()}
    notes += [
        f"{where}: group {name!r} has no point of the surface, and is no part of the sheet"
        for name, indices in parts.items()
        if not len(indices)
    ]
    mesh = Mesh(
        vertices=scale * faces.points[used],
        triangles=renumber[triangles].astype(np.int32),
        parts={name: indices for name, indices in parts.items() if len(indices)},
    )
    if mesh.flat:
        require_unfolded(where, faces.points, triangles, face_of)
    places = faces.points[:, :2] if mesh.flat else faces.points
    return replace(mesh, notes=(*notes, *seam_notes(where, places, triangles)))


def flat_shape(mesh: Mesh, graded: bool = False) -> Shape:
    """The shape of a flat mesh on its vertices, with its boundary as barriers and named rings."""
    points = mesh.vertices[:, :2]
    triangles = counter_clockwise(points, mesh.triangles)
    edges = boundary_edges(triangles)
    rings = ring_names(points, edges)
    both = [name for name in (*rings, *SIDES, "all") if name in mesh.parts]
    height, extent = float(mesh.vertices[0, 2]), float(np.ptp(points, axis=0).max())
    lowered = f"the mesh at z = {height:g} m became a sheet at z = 0: move bodies of its drawing, too"
    return replace(
        cloud(points, triangles, voronoi_areas(points, triangles), None, graded=graded),
        barriers=edges,
        parts={**rings, **mesh.parts},
        notes=(
            *mesh.notes,
            *([lowered] if abs(height) > FLAT * extent else ()),
            *(f"part {name!r} is the group of that name in the file, not the edge" for name in both),
        ),
    )
