"""Notes on the shape of an untorn sheet at the end of a run: triangles that turned over, and lost area."""

from __future__ import annotations

import numpy as np

from .recorder import Recorder

# Area over that of the stress-free sheet below which a note says so, and distance from a plane [spacings] of a sheet
# that counts as one in a plane.
LEAST_AREA, IN_PLANE = 0.5, 1e-3
# Area over the mean one below which a triangle has no side that one can tell.
NO_AREA = 1e-9


def shape_notes(recorder: Recorder) -> list[str]:
    """Notes on the last frame; none on a torn sheet, whose edges may crumple."""
    built, frame, surface = recorder.built, recorder.last, recorder.points.surface
    if frame is None or not len(surface.faces) or (frame.intact_faces is not None and not frame.intact_faces.all()):
        return []
    whole = built.context.whole
    positions, faces = frame.positions(surface), np.asarray(surface.faces)
    normals = _normals(positions, faces)
    areas = np.linalg.norm(normals, axis=1)
    share = areas.sum() / np.linalg.norm(_normals(whole.positions, whole.triangles), axis=1).sum()
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
    return notes


def _normals(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Twice the area vectors of triangles, (F, 3)."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _turned_over(positions: np.ndarray, normals: np.ndarray, tolerance: float) -> int:
    """Number of triangles whose side differs from that of most, if the points are in a plane within a tolerance [m]."""
    centred = positions - positions.mean(axis=0)
    across = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    if np.abs(centred @ across).max() > tolerance:
        return 0
    seen = normals @ across
    least = NO_AREA * np.abs(seen).mean()
    return int(min((seen > least).sum(), (seen < -least).sum()))
