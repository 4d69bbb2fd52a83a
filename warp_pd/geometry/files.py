"""Triangulated surfaces from files."""

from __future__ import annotations

import functools
import io
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, one_of
from .clouds import cloud
from .faces import repeated_faces, sides_of, triangulate
from .file_checks import existing_file, library_reads, meters
from .mesh_checks import require_closed, require_faces, require_surface, require_unfolded
from .seams import merged, notes_on_pieces, require_met
from .shape import Shape
from .topology import boundary_edges, pieces, ring_names
from .triangulation import counter_clockwise, voronoi_areas
from .usd_mesh import Faces, read_usd

USD = (".usd", ".usda", ".usdc", ".usdz")
CORNERS = {"triangle": 3, "quad": 4}
# Extent along z over the largest extent of a mesh that counts as flat.
FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Mesh:
    """A checked triangulated surface that a sheet can use.

    Attributes:
        vertices: Positions [m], float64, shape (V, 3); every vertex belongs to a triangle.
        triangles: Consistently oriented triangles, int32, shape (F, 3).
        parts: Vertex indices of the file's named groups of points and lines, by name.
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

    Quadrilaterals and polygons are divided into triangles. Second-order elements are reduced to their corners. Points
    without a triangle are dropped, as are line and point elements, but their named groups become `parts`. Points
    nearer than 0.001 of the shortest edge at either are merged, and faces listed twice are read once; `notes` say so.

    Args:
        path: A USD file (.usd, .usda, .usdc), or any file that meshio reads: .msh, .stl, .obj, .ply, .vtu, .vtk, .off,
            ...
        unit: Unit of the coordinates: "m", "mm", "cm", "in", or a number of meters. None is only allowed for USD files
            that specify it (metersPerUnit).
        part: Name of the mesh in a USD file with several, or of the group of faces in another file.
        closed: Whether the surface must have no boundary.

    Raises:
        InputError: if the file is missing or unreadable, or the unit is missing. Also, naming the indices: for no
            triangles, missing points, coordinates that are not finite, triangles without area, hanging nodes, edges
            with more than two triangles, flipped or folded triangles, pieces that overlap, or volume elements.
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
        faces = read_usd(file, part) if is_usd else _read_meshio(file, part)
    scale = faces.meters if unit is None and faces.meters is not None else meters(unit)
    require_faces(where, faces.points, faces.counts, faces.corners)
    one = merged(faces.points, sides_of(faces.counts, faces.corners))
    corners = one.index[faces.corners]
    notes = one.note(where)
    triangles, face_of = triangulate(where, faces.points, faces.counts, corners)
    again = repeated_faces(faces.counts, corners)
    if again.any():
        notes.append(f"{where}: {int(again.sum())} faces with the corners of another one were left out")
        triangles, face_of = triangles[~again[face_of]], face_of[~again[face_of]]
    require_surface(where, faces.points, triangles, face_of)
    if closed:
        require_closed(where, triangles)
    used = np.unique(triangles)
    renumber = np.full(len(faces.points), -1)
    renumber[used] = np.arange(len(used))
    parts = {name: np.unique(renumber[one.index[indices]]) for name, indices in faces.parts.items()}
    parts = {name: indices[indices >= 0].astype(np.int32) for name, indices in parts.items()}
    mesh = Mesh(
        vertices=scale * faces.points[used],
        triangles=renumber[triangles].astype(np.int32),
        parts={name: indices for name, indices in parts.items() if len(indices)},
    )
    if mesh.flat:
        require_unfolded(where, faces.points, triangles, face_of)
    places = faces.points[:, :2] if mesh.flat else faces.points
    require_met(where, places, triangles)
    return replace(mesh, notes=(*notes, *notes_on_pieces(where, places, triangles)))


def flat_shape(mesh: Mesh, graded: bool = False) -> Shape:
    """The shape of a flat mesh on its vertices, with its boundary as barriers and named rings."""
    points = mesh.vertices[:, :2]
    triangles = counter_clockwise(points, mesh.triangles)
    edges = boundary_edges(triangles)
    return replace(
        cloud(points, triangles, voronoi_areas(points, triangles), None, graded=graded),
        barriers=edges,
        parts={**ring_names(points, edges), **mesh.parts},
        notes=mesh.notes,
    )


def _read_meshio(path: Path, part: str | None) -> Faces:
    import meshio
    from meshio._helpers import reader_map

    suffix = path.suffix.lower()
    if suffix == ".msh":
        return _faces(path, _read_msh(path), part)
    formats = [name for name in meshio.extension_to_filetypes.get(suffix, []) if name in reader_map]
    if not formats:
        hint = "; outlines are read by read_outline" if suffix == ".svg" else ""
        raise InputError(
            f"path = {str(path)!r}: expected .msh, .stl, .obj, .ply, .vtu, .vtk, .off, .usd, .usda, .usdc, or another "
            f"format of meshio{hint}"
        )
    # meshio.read tries the formats of a suffix in turn and ends the process if none fits.
    for name in formats[:-1]:
        try:
            return _faces(path, reader_map[name](str(path)), part)
        except meshio.ReadError:
            continue
    return _faces(path, reader_map[formats[-1]](str(path)), part)


class _Ending(io.BufferedReader):
    """A file wrapper that raises at the end: meshio's reader of Ansys files would search for a bracket forever."""

    beyond = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Read the next bytes. Raises EOFError at the hundredth read beyond the end of the file."""
        found = super().read(size)
        self.beyond += not found
        if self.beyond > 100:
            raise EOFError("the file ends too early")
        return found


def _read_msh(path: Path) -> Any:
    """Read a .msh file of Gmsh (begins with a dollar sign) or Ansys (begins with a bracket)."""
    from meshio._helpers import reader_map

    with _Ending(io.FileIO(path)) as file:
        if file.peek(64).lstrip().startswith(b"("):
            return reader_map["ansys"](file)
    return reader_map["gmsh"](str(path))


def _faces(path: Path, mesh: Any, part: str | None) -> Faces:
    """The faces of a meshio mesh."""
    counts, corners = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    chosen = _group(path, mesh, part) if part is not None else None
    for index, block in enumerate(mesh.cells):
        if block.type.startswith(("vertex", "line")):
            continue
        data = np.asarray(block.data)
        plain = block.type.rstrip("0123456789")
        if plain not in (*CORNERS, "polygon"):
            raise InputError(f"path = {str(path)!r}: {len(data)} elements {block.type!r}: expected a surface")
        if chosen is not None:
            data = data[chosen[index]]
        data = data[:, : CORNERS.get(plain, data.shape[1])]
        counts.append(np.full(len(data), data.shape[1]))
        corners.append(data.astype(np.int64).ravel())
    points = np.asarray(mesh.points, np.float64)
    points = points.reshape(len(points), -1)[:, :3]
    return Faces(
        points=np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]),
        counts=np.concatenate(counts),
        corners=np.concatenate(corners),
        meters=None,
        parts=_point_groups(mesh),
    )


def _groups(mesh: Any) -> dict[str, tuple[int, list[np.ndarray]]]:
    """Named groups of cells: their dimension, and their cells in each block."""
    physical = mesh.cell_data.get("gmsh:physical")
    if physical is None:
        return {}
    return {
        name: (
            int(dimension),
            [
                np.flatnonzero((tags == tag) & (block.dim == dimension))
                for block, tags in zip(mesh.cells, physical, strict=True)
            ],
        )
        for name, (tag, dimension) in mesh.field_data.items()
    }


def _group(path: Path, mesh: Any, part: str) -> list[np.ndarray]:
    faces = {name: cells for name, (dimension, cells) in _groups(mesh).items() if dimension == 2}
    if not faces:
        raise InputError(f"part = {part!r}: {path.name} has no named groups of faces: expected None")
    return faces[one_of("part", part, faces)]


def _point_groups(mesh: Any) -> dict[str, np.ndarray]:
    """Points of the named groups of points and lines."""
    return {
        name: np.unique(
            np.concatenate([block.data[cells].ravel() for block, cells in zip(mesh.cells, groups, strict=True)])
        )
        for name, (dimension, groups) in _groups(mesh).items()
        if dimension < 2
    }
