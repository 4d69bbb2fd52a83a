"""Notes on the shape of an untorn sheet: turned triangles and lost area in any frame, short waves at the end."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ..geometry.triangulation import boundary_edges, doubled_normals
from ..interfaces.frame import Frame, Surface, format_time
from .built import Built

# Area over that of the stress-free sheet below which a note says so, and distance from a plane [spacings] of a sheet
# that counts as one in a plane.
LEAST_AREA, IN_PLANE = 0.5, 1e-3
# Height of a point over its neighbours from which it is high, and steep [their spacings]; share of such points, and
# root mean square height, from which the sheet is wavy; and likeness of neighbours below which the waves are short:
# 1/3 in waves of four spacings in one direction, 4/5 of eight, near 1 of long ones.
HIGH, STEEP, MANY, WAVY, ALIKE = 0.03, 0.35, 0.2, 0.05, 0.7
# Triangles that are looked at in a frame, at most twice as many; of larger sheets evenly spread ones.
LOOKED_AT = 100_000
# Area over the mean one below which a triangle has no side that one can tell.
NO_AREA = 1e-9


class ShapeWatch:
    """Looks at the shape of the sheet in every frame until it tears; edges of a torn sheet may crumple."""

    def __init__(self, built: Built) -> None:
        self.built = built

    @functools.cached_property
    def _area(self) -> float:
        """Twice the area of the stress-free sheet [m^2]."""
        whole = self.built.context.whole
        return float(np.linalg.norm(doubled_normals(whole.positions, whole.triangles), axis=1).sum())

    def look(self, surface: Surface, frame: Frame, found: dict[str, Any]) -> None:
        """Add to `found` what a frame shows: when triangles turned over or area was lost, the worst, and the last."""
        if not _untorn(surface, frame):
            return
        whole = self.built.context.whole
        positions = frame.positions(surface)
        normals = doubled_normals(positions, np.asarray(surface.faces)[:: max(1, len(surface.faces) // LOOKED_AT)])
        each = len(surface.faces) / len(normals)
        share = each * float(np.linalg.norm(normals, axis=1).sum()) / self._area
        over = 0 if whole.frames is not None else _turned_over(positions, normals, IN_PLANE * whole.spacing)
        over = round(each * over)
        when = format_time(frame.time, self.built.simulation.load_duration)
        for name, value, beyond in (("turned over", over, over > 0), ("area", -share, share < LEAST_AREA)):
            if beyond:
                found.setdefault(name, {"since": when, "worst": value})
            if name in found:
                known = found[name]
                known["worst"], known["last"] = max(known["worst"], value), bool(beyond)

    def notes(self, surface: Surface, last: Frame | None, found: dict[str, Any]) -> list[str]:
        """Notes on what `look` found, and on waves of the last frame."""
        law, advice, notes = self.built.law, "", []
        if law.goes_slack and law.weights == "plain":
            advice = "; take the weights 'corrected': plain ones do not hold a free edge of a TensionField"
        spans = {
            name: f"from {known['since']} on" if known["last"] else f"first at {known['since']}, not at the end"
            for name, known in found.items()
        }
        if "turned over" in found:
            notes.append(
                f"triangles: {found['turned over']['worst']} of {len(surface.faces)} of the untorn sheet are turned "
                f"over ({spans['turned over']}), so it lies on itself{advice}"
            )
        if "area" in found:
            notes.append(
                f"area: the untorn sheet has less than half of its stress-free area ({spans['area']}), down to "
                f"{-100.0 * found['area']['worst']:.2g} %{advice}"
            )
        if last is not None and _untorn(surface, last) and not self.built.contacts:
            faces = np.asarray(surface.faces)
            notes += _waves(np.asarray(surface.points, np.float64), last.positions(surface), faces)
        return notes


def _untorn(surface: Surface, frame: Frame) -> bool:
    return bool(len(surface.faces)) and (frame.intact_faces is None or bool(frame.intact_faces.all()))


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
