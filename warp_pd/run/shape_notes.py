"""Notes on the shape of an untorn sheet at the end of a run: triangles that turned over, lost area, and short waves."""

from __future__ import annotations

import numpy as np

from ..geometry.topology import boundary_edges
from ..geometry.triangulation import doubled_normals
from .recorder import Recorder

# Area over that of the stress-free sheet below which a note says so, and distance from a plane [spacings] of a sheet
# that counts as one in a plane.
LEAST_AREA, IN_PLANE = 0.5, 1e-3
# Height of a point over its neighbours from which it is high, and steep [their spacings]; share of such points, and
# root mean square height, from which the sheet is wavy; and likeness of neighbours below which the waves are short:
# 1/3 in waves of four spacings in one direction, 4/5 of eight, near 1 of long ones.
HIGH, STEEP, MANY, WAVY, ALIKE = 0.03, 0.35, 0.2, 0.05, 0.7
# Area over the mean one below which a triangle has no side that one can tell.
NO_AREA = 1e-9


def shape_notes(recorder: Recorder) -> list[str]:
    """Notes on the last frame; none on a torn sheet, whose edges may crumple."""
    built, frame, surface = recorder.built, recorder.last, recorder.points.surface
    if frame is None or not len(surface.faces) or (frame.intact_faces is not None and not frame.intact_faces.all()):
        return []
    whole = built.context.whole
    positions, faces = frame.positions(surface), np.asarray(surface.faces)
    normals = doubled_normals(positions, faces)
    areas = np.linalg.norm(normals, axis=1)
    share = areas.sum() / np.linalg.norm(doubled_normals(whole.positions, whole.triangles), axis=1).sum()
    advice = ""
    if built.law.goes_slack and built.law.weights == "plain":
        advice = "; take the weights 'corrected': plain ones do not hold a free edge of a TensionField"
    notes = []
    over = 0 if whole.frames is not None else _turned_over(positions, normals, IN_PLANE * whole.spacing)
    if over:
        notes.append(
            f"triangles: {over} of {len(faces)} of the untorn sheet are turned over at the end, so it lies on itself"
            f"{advice}"
        )
    if share < LEAST_AREA:
        notes.append(f"area: the untorn sheet ends with {100.0 * share:.2g} % of its stress-free area{advice}")
    if not built.contacts:
        notes += _waves(np.asarray(surface.points, np.float64), positions, faces)
    return notes


def _waves(start: np.ndarray, end: np.ndarray, faces: np.ndarray) -> list[str]:
    """A note if the points lie in short waves at the end that were not there at the start, both (N, 3)."""
    height = _heights(end, faces) - _heights(start, faces)
    if (np.abs(height) > HIGH).mean() < MANY:
        return []
    # Neighbours on one side alone make no wave.
    height[boundary_edges(faces)] = 0.0
    size = float(np.sqrt((height**2).mean()))
    if size < WAVY or (np.abs(height) > HIGH).mean() < MANY:
        return []
    alike = float(height @ _neighbours(height[:, None], faces)[:, 0]) / (len(height) * size**2)
    if alike > ALIKE and (np.abs(height) > STEEP).mean() < MANY:
        return []
    return [
        f"short waves: points of the untorn sheet end {size:.2g} spacings over or under their neighbours, in waves of "
        "a few spacings, which families average, so that they cost little energy; expected more points, or tension in "
        "every direction"
    ]


def _neighbours(values: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Mean of values (N, C) over the other corners of the triangles of each point, (N, C)."""
    points, others = len(values), values[faces].sum(axis=1)[:, None] - values[faces]
    count = 2 * np.maximum(np.bincount(faces.ravel(), minlength=points), 1)
    sums = [np.bincount(faces.ravel(), others[..., c].ravel(), minlength=points) for c in range(values.shape[1])]
    return np.asarray(np.stack(sums, axis=1) / count[:, None])


def _heights(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Height of each point under the mean of its neighbours along its normal, over their spacing [-], (N,)."""
    areas = doubled_normals(positions, faces)
    each = np.repeat(areas, 3, axis=0)
    normals = np.stack([np.bincount(faces.ravel(), each[:, c], minlength=len(positions)) for c in range(3)], axis=1)
    size = np.linalg.norm(normals, axis=1)
    unit = normals / np.where(size > 0.0, size, 1.0)[:, None]
    around = np.bincount(faces.ravel(), np.repeat(np.linalg.norm(areas, axis=1), 3), minlength=len(positions))
    spacing = np.sqrt(around / np.maximum(np.bincount(faces.ravel(), minlength=len(positions)), 1))
    height = ((_neighbours(positions, faces) - positions) * unit).sum(axis=1)
    return np.asarray(height / np.where(spacing > 0.0, spacing, 1.0))


def _turned_over(positions: np.ndarray, normals: np.ndarray, tolerance: float) -> int:
    """Number of triangles whose side differs from that of most, if the points are in a plane within a tolerance [m]."""
    centred = positions - positions.mean(axis=0)
    across = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    if np.abs(centred @ across).max() > tolerance:
        return 0
    seen = normals @ across
    least = NO_AREA * np.abs(seen).mean()
    return int(min((seen > least).sum(), (seen < -least).sum()))
