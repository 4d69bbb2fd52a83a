"""Triangles drawn into pixels with a depth buffer, so that near ones hide far ones however they are mixed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Most fragments, i.e. pixels of single triangles, at a time; and pixels between two tests along a line.
FRAGMENTS, PIXELS_APART = 2_000_000, 6.0


@dataclass(eq=False)
class DepthBuffer:
    """A picture of a rectangle of the plane that is seen.

    Attributes:
        low: Its lower left corner, shape (2,).
        pixel: Width and height of a pixel, shape (2,).
        depth: Depth at the centres of the pixels, towards the viewer, shape (rows, columns); -inf without a triangle.
        image: Red, green, blue and opacity of the pixels, shape (rows, columns, 4), the lowest row first.
        cut: (a, b, c, d): nothing is drawn where a right + b up + c depth > d; None to draw everything.
    """

    low: np.ndarray
    pixel: np.ndarray
    depth: np.ndarray
    image: np.ndarray
    cut: np.ndarray | None = None

    @staticmethod
    def of(low: np.ndarray, high: np.ndarray, columns: int, rows: int, cut: np.ndarray | None = None) -> DepthBuffer:
        """An empty one, transparent white."""
        image = np.full((rows, columns, 4), (255, 255, 255, 0), np.uint8)
        return DepthBuffer(low, (high - low) / (columns, rows), np.full((rows, columns), -np.inf), image, cut)

    def draw(self, corners: np.ndarray, colours: np.ndarray) -> None:
        """Draw triangles.

        Args:
            corners: Right, up and depth of the corners, shape (F, 3, 3).
            colours: Red, green, blue and opacity from 0 to 1, shape (F, 4).
        """
        owner, row = _expanded(*self._rows(corners))
        triangles = _ordered(corners, self.low, self.pixel)
        first, last = self._columns(triangles[owner], row)
        inks = np.round(255.0 * colours).astype(np.uint8)
        depth, image = self.depth.reshape(-1), self.image.reshape(-1, 4)
        slopes, lowest, highest = _slopes(triangles), triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)
        ends = np.cumsum(last - first)
        for begin, end in _chunks(ends):
            span, column = _expanded(first[begin:end], last[begin:end])
            triangle, y = owner[begin:end][span], row[begin:end][span]
            base, slope = triangles[triangle, 0], slopes[triangle]
            found = base[:, 2] + slope[:, 0] * (column + 0.5 - base[:, 0]) + slope[:, 1] * (y + 0.5 - base[:, 1])
            # Rounding of a steep triangle must not lead beyond its corners.
            found = np.clip(found, lowest[triangle], highest[triangle])
            if self.cut is not None:
                places = self.low + self.pixel * np.stack([column + 0.5, y + 0.5], axis=1)
                kept = self._kept(np.column_stack([places, found]))
                found, y, column, triangle = found[kept], y[kept], column[kept], triangle[kept]
            place = y * self.depth.shape[1] + column
            np.maximum.at(depth, place, found)
            seen = found == depth[place]
            image[place[seen]] = inks[triangle[seen]]

    def seen(self, ends: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pieces of lines that no triangle hides, shape (P, 2, 2), and the line of each, shape (P,).

        Args:
            ends: Right, up and depth of both ends, shape (S, 2, 3).
            corners: Those of the triangle on which each line lies, which does not hide it, shape (S, 3, 3).
        """
        lengths = np.linalg.norm((ends[:, 1, :2] - ends[:, 0, :2]) / self.pixel, axis=1)
        parts = np.maximum(1, np.ceil(lengths / PIXELS_APART)).astype(int)
        line, part = _expanded(np.zeros(len(parts), int), parts)
        start, way = ends[line, 0], (ends[:, 1] - ends[:, 0])[line]
        cut = np.stack([start + (part + k)[:, None] / parts[line][:, None] * way for k in (0.0, 1.0)], axis=1)
        middle = cut.mean(axis=1)
        column, row = ((middle[:, :2] - self.low) / self.pixel).astype(int).T
        rows, columns = self.depth.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows) & self._kept(middle)
        column, row = np.clip(column, 0, columns - 1), np.clip(row, 0, rows - 1)
        # Within two pixels the triangle itself, or the next one, may be nearer than the line.
        steep = 2.0 * np.abs(_slopes(_ordered(corners, self.low, self.pixel))).sum(axis=1)
        slack = np.minimum(steep, np.ptp(corners[..., 2], axis=1)) + 1e-9 * self.pixel.max()
        shown = inside & (middle[:, 2] >= self.depth[row, column] - slack[line])
        return cut[shown][..., :2], line[shown]

    def _kept(self, places: np.ndarray) -> np.ndarray:
        """Whether places, shape (P, 3), are not cut away, shape (P,)."""
        return np.full(len(places), True) if self.cut is None else places @ self.cut[:3] <= self.cut[3]

    def _rows(self, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First row with a centre in each triangle, and the one after its last, shape (F,)."""
        up = (corners[..., 1] - self.low[1]) / self.pixel[1]
        ends = np.stack([up.min(axis=1), up.max(axis=1)])
        rows = np.clip(np.ceil(ends - 0.5), 0, self.depth.shape[0]).astype(int)
        return rows[0], rows[1]

    def _columns(self, triangles: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First column with a centre in the triangle of each row, and the one after its last, shape (R,)."""
        y = row + 0.5
        lowest, middle, highest = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        below = y < middle[:, 1]
        sides = [
            _crossing(lowest, highest, y),
            np.where(below, _crossing(lowest, middle, y), _crossing(middle, highest, y)),
        ]
        columns = np.clip(np.ceil(np.sort(sides, axis=0) - 0.5), 0, self.depth.shape[1]).astype(int)
        return columns[0], columns[1]


def _ordered(corners: np.ndarray, low: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """Corners in pixels, the lowest first: triangles on both sides of an edge then find the same crossings."""
    scaled = corners.astype(float)
    scaled[..., :2] = (scaled[..., :2] - low) / pixel
    return np.take_along_axis(scaled, np.argsort(scaled[..., 1], axis=1, kind="stable")[..., None], axis=1)


def _crossing(start: np.ndarray, end: np.ndarray, y: np.ndarray) -> np.ndarray:
    rise = end[:, 1] - start[:, 1]
    fraction = (y - start[:, 1]) / np.where(rise > 0.0, rise, 1.0)
    return np.asarray(start[:, 0] + fraction * (end[:, 0] - start[:, 0]))


def _slopes(triangles: np.ndarray) -> np.ndarray:
    """Change of depth per column and per row, shape (F, 2); zero for a triangle without area."""
    a, b = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    over = np.where(twice != 0.0, 1.0 / np.where(twice != 0.0, twice, 1.0), 0.0)
    return (
        np.stack([a[:, 2] * b[:, 1] - b[:, 2] * a[:, 1], b[:, 2] * a[:, 0] - a[:, 2] * b[:, 0]], axis=1) * over[:, None]
    )


def _expanded(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the range and number, for each number of the ranges from `first` to before `last`."""
    count = last - first
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count - first, count)


def _chunks(ends: np.ndarray) -> list[tuple[int, int]]:
    """Ranges of rows with at most about `FRAGMENTS` fragments each; `ends` are running sums of fragments."""
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(FRAGMENTS, total, FRAGMENTS)) + 1
    marks = np.unique([0, *cuts, len(ends)])
    return list(zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True))
