"""Faces and groups of the mesh formats that meshio reads, of Abaqus .inp, Wavefront .obj and .off files."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError
from .abaqus import read_abaqus
from .nastran import read_nastran
from .off import read_off
from .usd_mesh import Faces
from .wavefront import read_wavefront

CORNERS = {"triangle": 3, "quad": 4}
KINDS = ("point", "line", "surface")
# Arrays of group numbers, by the reader of meshio that makes them.
NUMBERS = ("gmsh:physical", "medit:ref", "nastran:ref", "su2:tag", "netgen:index")
# Largest number of a node.
MOST_NUMBER = 100_000_000
# Readers of texts with polygons.
TEXTS = {".obj": read_wavefront, ".off": read_off}
# Formats of meshio that are refused: tetrahedra alone, and texts that take its reader for ever if a number is wrong.
NOT_READ = ("tetgen", "wkt")
# Meshes in one file, of which the reader of meshio keeps one.
SEVERAL = {
    ".vtu": (re.compile(rb"<Piece\s"), "pieces"),
    **dict.fromkeys((".dat", ".tec"), (re.compile(rb"^\s*ZONE\b", re.IGNORECASE | re.MULTILINE), "zones")),
}


class _Ending(io.BufferedReader):
    """A file that raises at the hundredth read beyond its end: some readers of meshio would read there for ever."""

    beyond = 0

    def _counted(self, found: bytes) -> bytes:
        self.beyond += not found
        if self.beyond > 100:
            raise EOFError("the file ends too early")
        return found

    def read(self, size: int | None = -1, /) -> bytes:
        """Read the next bytes."""
        return self._counted(super().read(size))

    def read1(self, size: int = -1, /) -> bytes:
        """Read the next bytes that are at hand, as text files do."""
        return self._counted(super().read1(size))

    def readline(self, size: int | None = -1, /) -> bytes:
        """Read the next line."""
        return self._counted(super().readline(size))


def _open(path: str, mode: str = "r") -> Any:
    """A file as `open` gives it to read, which raises EOFError if it is read on and on beyond its end."""
    file = _Ending(io.FileIO(path))
    return file if "b" in mode else io.TextIOWrapper(file, encoding="utf-8", errors="replace")


@contextlib.contextmanager
def _ending_files() -> Iterator[None]:
    """Context in which meshio opens files by `_open`."""
    from meshio import _files

    vars(_files)["open"] = _open
    try:
        yield
    finally:
        del vars(_files)["open"]


@_ending_files()
def read_faces(path: Path) -> Faces:
    """Read the faces of a file by its suffix.

    Raises:
        InputError: for an unknown suffix, several pieces or zones in one file, or volume elements.
    """
    import meshio
    from meshio._helpers import reader_map

    suffix = path.suffix.lower()
    if suffix in TEXTS:
        return TEXTS[suffix](path)
    if suffix == ".inp":
        mesh, notes = read_abaqus(path)
        return replace(_faces(path, mesh), notes=notes)
    if suffix in (".bdf", ".nas", ".fem"):
        return _faces(path, read_nastran(path))
    if suffix == ".msh":
        return _faces(path, _read_msh(path))
    known = meshio.extension_to_filetypes.get(suffix, [])
    formats = [name for name in known if name in reader_map and name not in NOT_READ]
    if not formats:
        hint = "; outlines are read by read_outline" if suffix == ".svg" else ""
        raise InputError(
            f"path = {str(path)!r}: expected .msh, .stl, .obj, .ply, .vtu, .vtk, .off, .usd, .usda, .usdc, or another "
            f"format of meshio{hint}"
        )
    if suffix in SEVERAL:
        begins, name = SEVERAL[suffix]
        if (count := len(begins.findall(path.read_bytes()))) > 1:
            raise InputError(f"path = {str(path)!r}: {count} {name}: expected one")
    # meshio.read tries the formats of a suffix in turn and ends the process if none fits.
    for name in formats[:-1]:
        with contextlib.suppress(meshio.ReadError):
            return _faces(path, reader_map[name](str(path)))
    return _faces(path, reader_map[formats[-1]](str(path)))


def _read_msh(path: Path) -> Any:
    """Read a .msh file of Gmsh (begins with a dollar sign) or Ansys (begins with a bracket)."""
    from meshio._helpers import reader_map

    with open(path, "rb") as file:
        if file.peek(64).lstrip().startswith(b"("):
            return reader_map["ansys"](str(path))
        lines = (line.decode("ascii", "replace").strip() for line in file)
        version = next((next(lines, "").split() for line in lines if line == "$MeshFormat"), [])
    return _read_gmsh41(path) if version[:1] in (["4"], ["4.1"]) else reader_map["gmsh"](str(path))


def _read_gmsh41(path: Path) -> Any:
    """Read a .msh file of version 4.1 with all physical groups of every entity, of which meshio keeps the first."""
    import meshio
    from meshio.gmsh import _gmsh41 as parts
    from meshio.gmsh import common, main

    names: dict[str, Any] = {}
    groups: Any = ({}, {}, {}, {})
    nodes: Any = None
    elements: Any = None
    with _open(str(path), "rb") as file:
        while file.readline().decode().strip() != "$MeshFormat":
            pass
        _, size, ascii_file = main._read_header(file)
        while True:
            line, ended = common._fast_forward_over_blank_lines(file)
            if ended:
                break
            section = line[1:].strip()
            if section == "PhysicalNames":
                common._read_physical_names(file, names)
            elif section == "Entities":
                groups = parts._read_entities(file, ascii_file, size)[0]
            elif section == "Nodes":
                nodes = parts._read_nodes(file, ascii_file, size)
                # The reader of elements makes an array of that size.
                if (largest := 1 + np.max(nodes[1], initial=0)) > MOST_NUMBER:
                    raise InputError(f"path = {str(path)!r}: node number {largest}: expected at most {MOST_NUMBER}")
            elif section == "Elements":
                elements = parts._read_elements(file, nodes[1], None, None, ascii_file, size, {})
            else:
                common._fast_forward_to_end_block(file, section)
    if nodes is None or elements is None:
        raise InputError(f"path = {str(path)!r}: expected sections $Nodes and $Elements")
    cells, data, _ = elements
    called = {(int(dimension), int(tag)): name for name, (tag, dimension) in names.items()}
    sets: dict[str, list[np.ndarray]] = {}
    for index, (block, entity) in enumerate(zip(cells, data.get("gmsh:geometrical", []), strict=True)):
        # All elements of a block belong to one entity; a group of reversed orientation has a negative number.
        for tag in {abs(int(number)) for number in groups[block.dim].get(int(entity[0]), [])} if len(entity) else ():
            name = called.get((block.dim, tag), f"{KINDS[min(block.dim, 2)]} {tag}")
            sets.setdefault(name, [np.zeros(0, np.int64)] * len(cells))[index] = np.arange(len(block.data))
    return meshio.Mesh(nodes[0], cells, cell_sets=sets)


def _faces(path: Path, mesh: Any) -> Faces:
    """The faces of a meshio mesh, with its groups."""
    counts, corners, first, number = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], {}, 0
    for index, block in enumerate(mesh.cells):
        if block.type.startswith(("vertex", "line")):
            continue
        data = np.asarray(block.data)
        plain = block.type.rstrip("0123456789")
        if plain not in (*CORNERS, "polygon"):
            raise InputError(f"path = {str(path)!r}: {len(data)} elements {block.type!r}: expected a surface")
        first[index] = number
        number += len(data)
        data = data[:, : CORNERS.get(plain, data.shape[1])]
        counts.append(np.full(len(data), data.shape[1]))
        corners.append(data.astype(np.int64).ravel())
    points = np.asarray(mesh.points, np.float64)
    points = points.reshape(len(points), -1)[:, :3]
    parts = {str(name): np.unique(np.asarray(each, np.int64)) for name, each in mesh.point_sets.items()}
    groups: dict[str, list[np.ndarray]] = {}
    for name, index, cells in _groups(mesh):
        if index in first:
            groups.setdefault(name, []).append(first[index] + cells)
        else:
            parts[name] = np.union1d(parts.get(name, []), np.asarray(mesh.cells[index].data)[cells]).astype(np.int64)
    return Faces(
        points=np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]),
        counts=np.concatenate(counts),
        corners=np.concatenate(corners),
        meters=None,
        parts=parts,
        groups={name: np.unique(np.concatenate(faces)) for name, faces in groups.items()},
    )


def _groups(mesh: Any) -> Iterator[tuple[str, int, np.ndarray]]:
    """Name, index of the block and cells of each group of cells in each block."""
    for name, blocks in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):
            for index, cells in enumerate(blocks):
                if cells is not None and len(cells):
                    yield str(name), index, np.asarray(cells, np.int64)
    called = {(int(dimension), int(tag)): name for name, (tag, dimension) in _names(mesh).items()}
    for array in NUMBERS:
        blocks = [np.asarray(tags).reshape(-1) for tags in mesh.cell_data.get(array, [])]
        surfaces = [
            tags for block, tags in zip(mesh.cells, blocks, strict=False) if block.dim == 2 and tags.dtype.kind in "iu"
        ]
        several = len(np.unique(np.concatenate(surfaces))) > 1 if surfaces else False
        for index, (block, tags) in enumerate(zip(mesh.cells, blocks, strict=False)):
            for tag in np.unique(tags).tolist() if tags.dtype.kind in "iu" else ():
                name = called.get((block.dim, tag))
                # A number that all faces have, as files without groups do, names nothing.
                if name is None and tag != 0 and (block.dim < 2 or several):
                    name = f"{KINDS[min(block.dim, 2)]} {tag}"
                if name is not None:
                    yield name, index, np.flatnonzero(tags == tag)
    # Salome: each tag stands for several names.
    for index, tags in enumerate(mesh.cell_data.get("cell_tags", [])):
        for tag, names in getattr(mesh, "cell_tags", {}).items():
            for name in names:
                yield str(name), index, np.flatnonzero(np.asarray(tags) == tag)


def _names(mesh: Any) -> dict[str, tuple[int, int]]:
    """Number and dimension of each named group of Gmsh."""
    return {str(name): (int(v[0]), int(v[1])) for name, v in mesh.field_data.items() if np.size(v) == 2}
