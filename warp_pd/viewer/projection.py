"""3D drawing of sheets: projection, bounding box and material lines."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError, finite, said
from .picture_frames import Shown

# A side of the box that is shorter than this fraction of the longest is drawn as long as that; one that is shorter than
# the second fraction is flat, and is left as it is.
SHORTEST, FLAT = 0.25, 1e-6
# A body that is larger than the sheet by this factor does not widen a picture.
LARGEST_BODY = 2.0
# Squares of the grid of material lines along the longest side of a flat sheet, and of a curved one.
SQUARES, SQUARES_OF_CURVED = 12, 8
# Strokes along the longest side.
STROKES = 30


@dataclass(frozen=True, eq=False)
class View:
    """A parallel projection.

    Attributes:
        low: Lowest coordinates of the bounding box [m], shape (3,).
        high: Highest coordinates of the bounding box [m], shape (3,).
        grown: Magnification of x, y and z, shape (3,).
        axes: Directions right, up, and towards the viewer, shape (3, 3).
    """

    low: np.ndarray
    high: np.ndarray
    grown: np.ndarray
    axes: np.ndarray

    @staticmethod
    def of(low: np.ndarray, high: np.ndarray, elevation: float, azimuth: float) -> View:
        """The view of a box from a direction [degrees]."""
        extent = (high - low).astype(float)
        longest = max(float(extent.max()), 1e-300)
        grown = np.maximum(1.0, SHORTEST * longest / np.maximum(extent, 1e-300))
        grown[extent < FLAT * longest] = 1.0
        up, around = np.deg2rad((elevation, azimuth))
        towards = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        right = np.array([-np.sin(around), np.cos(around), 0.0])
        return View(low, high, grown, np.array([right, np.cross(towards, right), towards]))

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Coordinates of points to the right, up, and towards the viewer, shape (..., 3)."""
        return np.asarray(((points - self.low) * self.grown) @ self.axes.T)

    def cut(self, away: str) -> np.ndarray:
        """The plane of a cut, see `DepthBuffer`; what is `away`, such as "y<0.05" [m], is not drawn.

        Raises:
            InputError: for any other text.
        """
        found = re.fullmatch(r"\s*([xyz])\s*([<>])\s*(\S+)\s*", away)
        try:
            name, side, value = found.groups() if found else ("", "", "")
            c, sign, level = "xyz".index(name or "?"), 1.0 if side == ">" else -1.0, finite("cut", float(value))
        except ValueError:
            raise InputError(
                f"cut = {said(away)}: expected x, y or z, < or >, and a number [m], such as 'y<0.05'"
            ) from None
        return sign * np.append(self.axes[:, c] / self.grown[c], level - self.low[c])

    @property
    def size(self) -> float:
        """Length of the diagonal of the box [m]."""
        return float(np.linalg.norm((self.high - self.low) * self.grown))

    def corners(self) -> np.ndarray:
        """Corners of the box [m], shape (8, 3)."""
        ends = np.array([self.low, self.high])
        return np.stack([ends[np.arange(8) >> c & 1, c] for c in range(3)], axis=1)

    def edges(self) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Edges of the box with scales: component, both ends [m], and the direction that leads away from the box."""
        near = np.where(self.axes[2] >= 0.0, self.high, self.low)
        base = np.array([near[0], near[1], self.low[2]])
        floor = self.corners()[:4]
        left = floor[self.seen(floor)[:, 0].argmin()]
        middle = self.seen(0.5 * (self.low + self.high))[:2]
        found = []
        for c in range(3):
            if (self.high - self.low)[c] <= FLAT * (self.high - self.low).max():
                continue
            start, end = (left if c == 2 else base).copy(), (left if c == 2 else base).copy()
            start[c], end[c] = self.low[c], self.high[c]
            along = (self.seen(end) - self.seen(start))[:2]
            away = np.array([-along[1], along[0]])
            away /= max(float(np.linalg.norm(away)), 1e-300)
            if away @ (self.seen(0.5 * (start + end))[:2] - middle) < 0.0:
                away = -away
            found.append((c, start, end, away))
        return found


def places_of(frame: Shown) -> np.ndarray:
    """Points of the sheet and of nearby bodies without planes [m], shape (P, 3)."""
    sheet = frame.points[frame.framed]
    low, high = sheet.min(axis=0), sheet.max(axis=0)
    size = float((high - low).max())
    small = [vertices for vertices, _ in frame.bodies if np.ptp(vertices, axis=0).max() <= LARGEST_BODY * size]
    return np.vstack([sheet, *(np.clip(vertices, low - 0.5 * size, high + 0.5 * size) for vertices in small)])


def material_lines(frame: Shown) -> tuple[np.ndarray, np.ndarray]:
    """Lines of constant reference coordinates: ends of segments [m], shape (S, 2, 3), and triangles, shape (S,)."""
    corners = frame.reference[frame.triangles]
    if len(corners) == 0:
        return np.zeros((0, 2, 3)), np.zeros(0, int)
    low, high = frame.reference.min(axis=0), frame.reference.max(axis=0)
    squares = SQUARES_OF_CURVED if high[2] > low[2] else SQUARES
    step = float((high - low).max()) / squares
    segments, owners = [], []
    for c in range(3):
        # Slightly off the rows of points, which may lie on the levels.
        for level in np.arange(low[c] + step * (1.0 + 1e-4), high[c] - 0.01 * step, step):
            above = corners[:, :, c] > level
            cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
            # The corner that is alone on its side of the level.
            few = above[cut].sum(axis=1) == 1
            alone = np.where(few, above[cut].argmax(axis=1), (~above[cut]).argmax(axis=1))
            ends = [_crossing(frame, cut, alone, (alone + k) % 3, c, level) for k in (1, 2)]
            segments.append(np.stack(ends, axis=1))
            owners.append(cut)
    return np.concatenate(segments), np.concatenate(owners)


def strokes(frame: Shown, field: str) -> tuple[np.ndarray, np.ndarray]:
    """Strokes along a direction at some points: ends [m], shape (S, 2, 3), and the triangle of each, shape (S,)."""
    step = float(np.ptp(frame.reference, axis=0).max()) / STROKES
    points, first = np.unique(frame.triangles, return_index=True)
    cells = np.floor((frame.reference[points] - frame.reference.min(axis=0)) / step)
    apart = ((frame.reference[points] - frame.reference.min(axis=0)) / step - cells - 0.5) ** 2
    order = np.argsort(apart.sum(axis=1), kind="stable")
    chosen = order[np.unique(cells[order], axis=0, return_index=True)[1]]
    chosen = chosen[np.isfinite(frame.fields[field][points[chosen]]).all(axis=1)]
    along = 0.4 * step * frame.fields[field][points[chosen]]
    middle = frame.points[points[chosen]]
    return np.stack([middle - along, middle + along], axis=1), first[chosen] // 3


def _crossing(
    frame: Shown, cut: np.ndarray, first: np.ndarray, second: np.ndarray, component: int, level: float
) -> np.ndarray:
    """Deformed positions [m] where triangle sides between two corners cross a level, shape (S, 3)."""
    a, b = frame.triangles[cut, first], frame.triangles[cut, second]
    start, end = frame.reference[a, component], frame.reference[b, component]
    fraction = ((level - start) / (end - start))[:, None]
    return np.asarray(frame.points[a] + fraction * (frame.points[b] - frame.points[a]))
