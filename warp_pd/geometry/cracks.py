"""Cracks in a triangulation: every point of a crack except its tips is doubled, one copy per side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class SplitPoints:
    """A triangulation opened along a crack.

    Attributes:
        triangles: Triangles, those on the right side of the crack with the new points, shape (F, 3).
        doubled: Points that have a copy, in order along the crack; the copies come after all other points.
    """

    triangles: np.ndarray
    doubled: np.ndarray


def split_along(
    points: np.ndarray,
    triangles: np.ndarray,
    crack: np.ndarray,
    mouths: tuple[bool, bool],
    frames: np.ndarray | None = None,
) -> SplitPoints:
    """Open a triangulation along a crack.

    Args:
        points: Positions [m], shape (N, 2), or (N, 3) on a curved sheet.
        triangles: Counter-clockwise, shape (F, 3); the crack runs along their edges.
        crack: Points along the crack, shape (L,).
        mouths: Whether the crack starts and ends at the edge of the sheet, where its end point is doubled, too.
        frames: Tangent vectors at the points of a curved sheet, shape (N, 3, 2).
    """
    first, last = (0 if mouths[0] else 1), (len(crack) if mouths[1] else len(crack) - 1)
    doubled = crack[first:last]
    copy = np.full(len(points), -1)
    copy[doubled] = len(points) + np.arange(len(doubled))
    place = np.full(len(points), -1)
    place[crack] = np.arange(len(crack))
    triangles = triangles.copy()
    face, corner = np.nonzero(copy[triangles] >= 0)
    vertex = triangles[face, corner]
    at = place[vertex]
    middle = points[triangles[face]].mean(axis=1) - points[vertex]
    ahead = points[crack[np.minimum(at + 1, len(crack) - 1)]] - points[vertex]
    behind = points[crack[np.maximum(at - 1, 0)]] - points[vertex]
    if frames is not None:
        middle, ahead, behind = (np.einsum("pc,pca->pa", v, frames[vertex]) for v in (middle, ahead, behind))
    # At a mouth the crack has one direction there; the other is its continuation.
    ahead = np.where((at == len(crack) - 1)[:, None], -behind, ahead)
    behind = np.where((at == 0)[:, None], -ahead, behind)
    right = _turn(ahead, middle) > _turn(ahead, behind)
    triangles[face[right], corner[right]] = copy[vertex[right]]
    return SplitPoints(triangles, doubled)


def _turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Counter-clockwise angle from one direction to the other, 0 to 2 pi, shape (P,)."""
    cross = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    angle = np.arctan2(cross, (start * end).sum(axis=1))
    return np.asarray(np.where(angle < 0.0, angle + 2.0 * np.pi, angle))
