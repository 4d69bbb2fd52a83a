"""How a sheet is painted: projection, colour scale, triangles in a depth buffer (near ones hide far ones)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device.checks import InputError, finite, show
from ..geometry.triangulation import numbers_of_ranges
from .pictures import Shown

# A side of the box that is shorter than this fraction of the longest is drawn as long as that; one that is shorter than
# the second fraction is flat, and is left as it is.
SHORTEST, FLAT = 0.25, 1e-6
# A body that is larger than the sheet by this factor does not widen a picture.
LARGEST_BODY = 2.0
# Squares of the grid of material lines along the longest side of a flat sheet, and of a curved one.
SQUARES, SQUARES_OF_CURVED = 12, 8
# Strokes along the longest side.
STROKES = 30


def plane_of(away: str) -> tuple[int, float, float]:
    """Component, side (1 or -1) and place [m] of what is cut away, such as "y<0.05".

    Raises:
        InputError: for any other text.
    """
    found = re.fullmatch(r"\s*([xyz])\s*([<>])\s*(\S+)\s*", away)
    try:
        name, side, value = found.groups() if found else ("", "", "")
        return "xyz".index(name or "?"), 1.0 if side == ">" else -1.0, finite("cut", float(value))
    except ValueError:
        raise InputError(
            f"cut = {show(away)}: expected x, y or z, < or >, and a number [m], such as 'y<0.05'"
        ) from None


def require_left(away: str | None, places: np.ndarray) -> None:
    """Check that a cut leaves something of the places in a picture [m], shape (P, 3)."""
    if away is None:
        return
    c, side, level = plane_of(away)
    low, high = places[:, c].min(), places[:, c].max()
    if (low if side > 0.0 else -high) > side * level:
        raise InputError(f"cut = {show(away)}: it leaves nothing; expected a number between {low:.4g} and {high:.4g} m")


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
        """The plane of a cut, see `DepthBuffer`; what is `away`, such as "y<0.05" [m], is not drawn."""
        c, sign, level = plane_of(away)
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
        owner, row = numbers_of_ranges(*self._rows(corners))
        triangles = _ordered(corners, self.low, self.pixel)
        first, last = self._columns(triangles[owner], row)
        inks = np.round(255.0 * colours).astype(np.uint8)
        depth, image = self.depth.reshape(-1), self.image.reshape(-1, 4)
        slopes, lowest, highest = _slopes(triangles), triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)
        ends = np.cumsum(last - first)
        for begin, end in _chunks(ends):
            span, column = numbers_of_ranges(first[begin:end], last[begin:end])
            triangle, y = owner[begin:end][span], row[begin:end][span]
            base, slope = triangles[triangle, 0], slopes[triangle]
            found = base[:, 2] + slope[:, 0] * (column + 0.5 - base[:, 0]) + slope[:, 1] * (y + 0.5 - base[:, 1])
            # Rounding of a steep triangle must not lead beyond its corners.
            found = np.clip(found, lowest[triangle], highest[triangle])
            if self.cut is not None:
                places = self.low + self.pixel * np.stack([column + 0.5, y + 0.5], axis=1)
                kept = self._outside_cut(np.column_stack([places, found]))
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
        line, part = numbers_of_ranges(np.zeros(len(parts), int), parts)
        start, way = ends[line, 0], (ends[:, 1] - ends[:, 0])[line]
        cut = np.stack([start + (part + k)[:, None] / parts[line][:, None] * way for k in (0.0, 1.0)], axis=1)
        middle = cut.mean(axis=1)
        column, row = ((middle[:, :2] - self.low) / self.pixel).astype(int).T
        rows, columns = self.depth.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows) & self._outside_cut(middle)
        column, row = np.clip(column, 0, columns - 1), np.clip(row, 0, rows - 1)
        # Within two pixels the triangle itself, or the next one, may be nearer than the line.
        steep = 2.0 * np.abs(_slopes(_ordered(corners, self.low, self.pixel))).sum(axis=1)
        slack = np.minimum(steep, np.ptp(corners[..., 2], axis=1)) + 1e-9 * self.pixel.max()
        shown = inside & (middle[:, 2] >= self.depth[row, column] - slack[line])
        return cut[shown][..., :2], line[shown]

    def _outside_cut(self, places: np.ndarray) -> np.ndarray:
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
            _crossed(lowest, highest, y),
            np.where(below, _crossed(lowest, middle, y), _crossed(middle, highest, y)),
        ]
        columns = np.clip(np.ceil(np.sort(sides, axis=0) - 0.5), 0, self.depth.shape[1]).astype(int)
        return columns[0], columns[1]


def _ordered(corners: np.ndarray, low: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """Corners in pixels, the lowest first: triangles on both sides of an edge then find the same crossings."""
    scaled = corners.astype(float)
    scaled[..., :2] = (scaled[..., :2] - low) / pixel
    return np.take_along_axis(scaled, np.argsort(scaled[..., 1], axis=1, kind="stable")[..., None], axis=1)


def _crossed(start: np.ndarray, end: np.ndarray, y: np.ndarray) -> np.ndarray:
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


def _chunks(ends: np.ndarray) -> list[tuple[int, int]]:
    """Ranges of rows with at most about `FRAGMENTS` fragments each; `ends` are running sums of fragments."""
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(FRAGMENTS, total, FRAGMENTS)) + 1
    marks = np.unique([0, *cuts, len(ends)])
    return list(zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True))


# Perceptually uniform maps: of fields with one sign, of damage, and of fields with both signs (Moreland 2009).
ONE_SIGN, DAMAGE, BOTH_SIGNS = "viridis", "inferno_r", "coolwarm"
# Colour of places at which a field has no value, such as the damage of a joint where nothing is joined.
NO_VALUE = "0.72"
# A field has both signs if its smaller side is more than this fraction of its larger one.
SMALLER_SIDE = 0.02


@dataclass(frozen=True, eq=False)
class ColourScale:
    """Maps values of a field to colours.

    Attributes:
        name: Name of the Matplotlib colour map.
        low: Value of its first colour.
        high: Value of its last colour; low = -high for a diverging map.
        shown: Lowest and highest value on the colour bar.
        label: Label of the colour bar.
    """

    name: str
    low: float
    high: float
    shown: tuple[float, float]
    label: str

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Red, green, blue and opacity of values, shape (..., 4)."""
        colours, norm = self._mapping()
        return np.asarray(colours(norm(values)))

    def add_bar(self, figure: Any, axes: Any, **options: Any) -> None:
        """Draw the colour bar beside `axes`, over the range `shown`."""
        from matplotlib.cm import ScalarMappable

        colours, norm = self._mapping()
        bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=self.label, **options)
        bar.ax.set_ylim(*self.shown)

    def _mapping(self) -> tuple[Any, Any]:
        from matplotlib import colormaps
        from matplotlib.colors import Normalize

        return colormaps[self.name].with_extremes(bad=NO_VALUE), Normalize(self.low, self.high)


def scale_of(frames: Sequence[Shown], field: str, label: str, limits: tuple[float, float] | None) -> ColourScale:
    """The scale of a field over all frames; `limits` are by default those of the field."""
    low, high = limits or _range(frames, field)
    if min(high, -low) > SMALLER_SIDE * max(high, -low):
        reach = max(high, -low)
        return ColourScale(BOTH_SIGNS, -reach, reach, (low, high), label)
    name = DAMAGE if field == "damage" else ONE_SIGN
    # Zero has one colour, whichever sign the field has.
    return ColourScale(f"{name}_r" if high <= 0.0 else name, low, high, (low, high), label)


def _range(frames: Sequence[Shown], field: str) -> tuple[float, float]:
    values = np.concatenate([f.fields[field][f.framed] for f in frames])
    values = values[np.isfinite(values)]
    low, high = float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))
    return (low, high if high > low else low + 1.0) if len(values) else (0.0, 1.0)
