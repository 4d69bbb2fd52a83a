"""Meshes of USD files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces as stored in a file.

    Attributes:
        points: Positions in the file's unit, shape (V, 3).
        counts: Corners of each face, shape (P,).
        corners: Point indices of all faces, one after the other, shape (sum of counts,).
        meters: The file's unit [m], or None.
        parts: Point indices by name.
        groups: Indices of the faces of each named group.
        notes: What was left out, one line each.
    """

    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray
    meters: float | None
    parts: dict[str, np.ndarray] = field(default_factory=dict)
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def points_of(self, faces: np.ndarray) -> np.ndarray:
        """Points of some faces, ascending."""
        chosen = np.zeros(len(self.counts), bool)
        chosen[faces] = True
        return np.unique(self.corners[np.repeat(chosen, self.counts)])

    def only(self, faces: np.ndarray) -> Faces:
        """Only some faces, given by ascending indices, without groups."""
        chosen = np.zeros(len(self.counts), bool)
        chosen[faces] = True
        return replace(
            self, counts=self.counts[chosen], corners=self.corners[np.repeat(chosen, self.counts)], groups={}
        )


def read_usd(path: Path, part: str | None) -> Faces:
    """Read the faces of a UsdGeom.Mesh at its first time sample, in world coordinates with z up.

    Where the file says that y is up (upAxis), y becomes z and z becomes -y; a note says so.
    For a mesh with a subdivision scheme these are the control points. Holes (`holeIndices`) are left out. `part` is the
    name or path of the prim; None if the file has only one mesh. Raises InputError if there is no such mesh.
    """
    from pxr import Tf, Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(f"path = {str(path)!r}: the file cannot be read: expected a complete USD file") from error
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(UsdGeom.Mesh)]
    mesh = _select(path, meshes, part)
    first = Usd.TimeCode.EarliestTime()
    points = np.array(mesh.GetPointsAttr().Get(first) or [], np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(first) or [], np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(first) or [], np.int64)
    if len(points) == 0:
        raise InputError(f"path = {str(path)!r}: {mesh.GetPath()} has no points: expected a mesh")
    if counts.sum() != len(corners) or (counts < 0).any():
        raise InputError(f"path = {str(path)!r}: {mesh.GetPath()}: {len(corners)} corners: expected {counts.sum()}")
    world = np.array(mesh.ComputeLocalToWorldTransform(first))
    turned = np.linalg.det(world[:3, :3]) < 0.0
    if (mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded) != turned:
        corners = _reversed(counts, corners)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(first) or [], np.int64)
    kept = ~np.isin(np.arange(len(counts)), holes)
    number = np.cumsum(kept) - 1
    subsets = {each.GetPrim().GetName(): each for each in UsdGeom.Subset.GetAllGeomSubsets(mesh)}
    groups = {
        name: np.array(each.GetIndicesAttr().Get(first) or [], np.int64)
        for name, each in subsets.items()
        if each.GetElementTypeAttr().Get() == UsdGeom.Tokens.face
    }
    for name, faces in (*groups.items(), ("holeIndices", holes)):
        if len(bad := faces[(faces < 0) | (faces >= len(counts))]):
            raise InputError(
                f"path = {str(path)!r}: {mesh.GetPath()}: {name} has face {bad[0]}: expected 0 to {len(counts) - 1}"
            )
    points, notes = points @ world[:3, :3] + world[3, :3], []
    if not stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis):
        notes = ["the file does not say which axis is up (upAxis): z was taken"] if np.ptp(points[:, 2]) else []
    elif UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        points = np.column_stack([points[:, 0], 0.0 - points[:, 2], points[:, 1]])
        notes = ["y is up in the file: (x, y, z) became (x, -z, y)"]
    return Faces(
        points=points,
        counts=counts[kept],
        corners=corners[np.repeat(kept, counts)],
        meters=UsdGeom.GetStageMetersPerUnit(stage) if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else None,
        groups={name: number[faces[kept[faces]]] for name, faces in groups.items()},
        notes=notes,
    )


def _select(path: Path, meshes: list[Any], part: str | None) -> Any:
    paths = [str(mesh.GetPath()) for mesh in meshes]
    if not meshes:
        raise InputError(f"path = {str(path)!r}: expected a file with a UsdGeom.Mesh, found none")
    if part is None and len(meshes) > 1:
        raise InputError(f"part = None: {path.name} has {len(meshes)} meshes: expected one of {', '.join(paths)}")
    fitting = [
        m for m, name in zip(meshes, paths, strict=True) if part is None or part in (name, m.GetPrim().GetName())
    ]
    if len(fitting) != 1:
        raise InputError(f"part = {part!r}: expected one of {', '.join(paths)}")
    return fitting[0]


def _reversed(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The corners of each face in the other direction."""
    end = np.cumsum(counts)
    place = np.arange(len(corners))
    face = np.repeat(np.arange(len(counts)), counts)
    return np.asarray(corners[(end - counts)[face] + end[face] - 1 - place])
