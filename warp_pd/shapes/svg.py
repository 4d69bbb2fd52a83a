"""Outlines from SVG files."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..device.checks import InputError, one_of, positive, show, user_code
from .curves import Spacing, spread_evenly, spread_on_curve
from .file_checks import METERS, UNITS, existing_file, library_reads, meters
from .svg_tree import PHYSICAL, PIXEL, Document, Drawn, unreadable

# Distance over the extent below which two points are one, and turn of a corner [rad].
CLOSE, CORNER = 1e-9, math.radians(10.0)
# What is read of one file, at most: bytes, points of its curves.
MOST_BYTES, MOST_POINTS = 20_000_000, 1_000_000


@dataclass(frozen=True, eq=False)
class TracedCurve:
    """A closed curve from a file, for `Sheet.outline`.

    Its corners become points of the sheet; points along its smooth sides follow the spacing.

    Attributes:
        points: Points along the curve [m], shape (N, 2), dense enough for its curvature; the last is connected to the
            first.
        corners: Indices of the points where it turns by more than 10 degrees, shape (C,).
    """

    points: np.ndarray
    corners: np.ndarray

    def sampled(self, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
        """Points on the curve, see `warp_pd.shapes.curves.Curve`; sides are between corners."""
        if len(self.corners) == 0:
            return spread_on_curve(_along(np.vstack([self.points, self.points[:1]])), spacing)
        found, side = [], []
        for number, (start, end) in enumerate(zip(self.corners, np.roll(self.corners, -1), strict=True)):
            run = np.arange(start, end + 1 if end > start else end + 1 + len(self.points)) % len(self.points)
            at = _along(self.points[run])
            points = at(spread_evenly(at, spacing, 1)[:-1])
            # The corner itself, without round-off.
            points[0] = self.points[start]
            found.append(points)
            side.append(np.full(len(points), number))
        return np.concatenate(found), np.concatenate(side)

    def reversed(self) -> TracedCurve:
        """The same curve in the other direction."""
        return TracedCurve(self.points[::-1], np.sort(len(self.points) - 1 - self.corners))


@dataclass(frozen=True, eq=False)
class Rings:
    """The outline of one flat piece.

    Attributes:
        boundary: Outer boundary, counter-clockwise.
        holes: Holes, clockwise.
    """

    boundary: TracedCurve
    holes: tuple[TracedCurve, ...] = ()


def read_outline(
    path: str | os.PathLike[str],
    *,
    tolerance: float,
    unit: str | float | None = None,
    part: str | None = None,
) -> Rings:
    """Read an outline from the closed paths of an SVG file: one boundary, and the holes in it.

    Transforms are applied. x points right and y up, with the origin of the user units, so SVG coordinates with positive
    y (downwards) become negative y. Colours, strokes, markers and filters are ignored; elements that do not show are
    skipped, and those that a clip path, a mask or the viewport of a nested svg cuts are refused.

    Args:
        path: The file.
        tolerance: Largest distance of curves from the polygon's sides [m], such as a twentieth of the spacing.
        unit: Length of a user unit: "m", "mm", "cm", "in", or a number of meters; "document" to use the file's physical
            width and height. Required.
        part: `id` of the element to use; None for all.

    Raises:
        InputError: if the file is missing or unreadable, the unit is missing, there is no closed path, paths are open
            or cross themselves or each other, there are several boundaries, or a hole contains an island.
    """
    file = existing_file(path)
    tolerance = positive("tolerance", tolerance)
    if unit is None or (isinstance(unit, str) and unit not in (*METERS, "document")):
        raise InputError(f"unit = {show(unit)}: {UNITS}, or 'document' for the physical size of the file")
    where = f"path = {str(file)!r}"
    with library_reads(file):
        document = _parsed(where, file)
        scale = _document(where, document) if unit == "document" else meters(unit)
        drawn = document.drawn()
    to_meters = np.diag([scale, -scale, 1.0])
    curves: list[TracedCurve] = []
    for name, each in _select(where, drawn, part):
        left = MOST_POINTS - sum(len(curve.points) for curve in curves)
        with user_code(partial(unreadable, where, name)):
            found = _closed(where, name, each.path, to_meters @ each.matrix, tolerance, left)
            _require_whole(where, name, each, found, to_meters, tolerance)
        curves += found
    if not curves:
        raise InputError(f"{where}: no closed path: expected one or more")
    return _nested(where, curves)


def _parsed(where: str, path: Path) -> Document:
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise InputError(f"{where}: {size / 1e6:.3g} MB: expected at most {MOST_BYTES / 1e6:g} MB")
    content = path.read_bytes()
    if b"<?xml-stylesheet" in content:
        raise InputError(f"{where}: its style sheet is another file: expected it in the file")
    return Document(where, ElementTree.fromstring(content))


def _document(where: str, document: Document) -> float:
    """Meters per user unit of a document with a physical size."""
    texts, box = document.size(), document.box()
    found = [re.fullmatch(r"([\d.]+(?:e[+-]?\d+)?)\s*([a-z]+)", text.lower()) for text in texts]
    lengths = [float(f[1]) * PHYSICAL[f[2]] for f in found if f is not None and f[2] in PHYSICAL]
    sizes = f"{where}: width = {texts[0]!r}, height = {texts[1]!r}"
    if len(lengths) < 2:
        raise InputError(f"unit = 'document': {sizes}: expected lengths in {', '.join(PHYSICAL)}")
    if box is None:
        return PIXEL
    if not min(*lengths, *box[2:]) > 0.0:
        raise InputError(f"unit = 'document': {sizes}: expected positive lengths, and a viewBox that has an extent")
    scales = lengths[0] / box[2], lengths[1] / box[3]
    if not math.isclose(*scales, rel_tol=1e-4):
        raise InputError(f"unit = 'document': {sizes}: expected the ratio of the viewBox")
    return float(scales[0])


def _select(where: str, drawn: list[Drawn], part: str | None) -> list[tuple[str, Drawn]]:
    """Name and shape of every element that shows, or of those with an id."""
    if part is not None:
        part = one_of("part", part, [each.id for each in drawn if each.id is not None])
        drawn = [each for each in drawn if each.id == part]
    found = [(f"{each.tag} {each.id or number}", each) for number, each in enumerate(drawn)]
    for name, each in found:
        if each.path is None:
            raise InputError(
                f"{where}: {name}: expected only paths and shapes; convert text to paths and remove images"
            )
    return found


def _require_whole(
    where: str, name: str, each: Drawn, curves: list[TracedCurve], to_meters: np.ndarray, tolerance: float
) -> None:
    """Raise InputError if a clip path or the viewport of a nested svg cuts the curves of a shape."""
    import shapely

    shape = _area([curve.points for curve in curves])
    for region in each.regions:
        # Every subpath of a region is closed.
        areas = [
            _area([np.concatenate(pieces) for _, pieces in _subpaths(where, region.name, path, matrix, tolerance)])
            for path, matrix in ((path, to_meters @ matrix) for path, matrix in region.shapes)
        ]
        # Curves are within the tolerance of their polygons on either side.
        if not shapely.union_all(areas).buffer(2.0 * tolerance).covers(shape):
            raise InputError(f"{where}: {region.name} cuts {name}: expected shapes as they show")


def _area(rings: list[np.ndarray]) -> Any:
    """The area between rings, of which every other one is a hole."""
    import shapely

    area = shapely.Polygon()
    for ring in rings:
        area = area.symmetric_difference(shapely.make_valid(shapely.Polygon(ring))) if len(ring) > 2 else area
    return area


def _subpaths(
    where: str, name: str, path: Any, matrix: np.ndarray, tolerance: float, most: int = MOST_POINTS
) -> Iterator[tuple[list[Any], list[np.ndarray]]]:
    """Segments of each subpath, and points along each of them [m], at most `most` in all."""
    from svgelements import Move

    fine = tolerance / float(np.linalg.norm(matrix[:2, :2], 2))
    wanted = sum(_count(segment, fine) for segment in path if not isinstance(segment, Move))
    if not wanted <= most:
        raise InputError(
            f"{where}: {name} takes {wanted:.3g} points: expected at most {most} (larger tolerance or unit)"
        )
    for subpath in path.as_subpaths():
        segments = [s for s in subpath if not isinstance(s, Move) and s.start is not None and s.end is not None]
        if segments:
            yield segments, [_flattened(segment, fine) @ matrix[:2, :2].T + matrix[:2, 2] for segment in segments]


def _closed(where: str, name: str, path: Any, matrix: np.ndarray, tolerance: float, most: int) -> list[TracedCurve]:
    """The closed curves of a path [m], of at most `most` points. Raises InputError if one is open."""
    curves = []
    for every, pieces in _subpaths(where, name, path, matrix, tolerance, most):
        small = CLOSE * float(np.ptp(np.concatenate(pieces), axis=0).max())
        longer = [k for k, piece in enumerate(pieces) if np.ptp(piece, axis=0).max() > small]
        if not longer:
            raise InputError(f"{where}: {name} has no extent, or a coordinate that is no number: expected a curve")
        placed, segments = [pieces[k] for k in longer], [every[k] for k in longer]
        start, end = placed[0][0], placed[-1][-1]
        if np.linalg.norm(end - start) > small:
            ends = [np.array2string(place, precision=6, separator=", ") for place in (start, end)]
            raise InputError(f"{where}: {name} is open, from {ends[0]} to {ends[1]} m: expected closed paths")
        points = np.concatenate([piece[:-1] for piece in placed])
        if len(points) < 3:
            raise InputError(f"{where}: {name} has {len(points)} corners: expected three or more")
        begins = np.cumsum([0, *(len(piece) - 1 for piece in placed[:-1])])
        directions = [_directions(segment) @ matrix[:2, :2].T for segment in segments]
        turns = [
            _angle(before[1], after[0])
            for before, after in zip([directions[-1], *directions[:-1]], directions, strict=True)
        ]
        curves.append(TracedCurve(points, begins[np.array(turns) > CORNER]))
    return curves


def _directions(segment: Any) -> np.ndarray:
    """Directions of a segment at its start and at its end, shape (2, 2)."""
    # Handles may lie on the ends of a curve, where its derivative is then zero.
    near = [segment.point(t) for t in (0.0, 1e-4, 1.0 - 1e-4, 1.0)]
    start, after, before, end = np.array([(place.x, place.y) for place in near])
    return np.array([after - start, end - before])


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between two directions [rad]."""
    return abs(math.atan2(one[0] * other[1] - one[1] * other[0], float(one @ other)))


def _along(points: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Function from a fraction of the length of a polyline (0 to 1) to a point."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])

    def at(t: np.ndarray) -> np.ndarray:
        place = np.asarray(t) * length[-1]
        return np.column_stack([np.interp(place, length, component) for component in points.T])

    return at


def _flattened(segment: Any, tolerance: float) -> np.ndarray:
    """Points from the start of a segment to its end, within `tolerance` of it, shape (N, 2)."""
    count = int(_count(segment, tolerance))
    places = [segment.start, *(segment.point(k / count) for k in range(1, count)), segment.end]
    return np.array([(place.x, place.y) for place in places], np.float64)


def _count(segment: Any, tolerance: float) -> float:
    """Number of straight pieces of a segment that are within `tolerance` of it; NaN or infinite for no such number."""
    from svgelements import Close, Line

    if isinstance(segment, Line | Close) or segment.start is None or segment.end is None:
        return 1.0
    return float(max(1.0, np.ceil(np.sqrt(_bend(segment) / (8.0 * tolerance)))))


def _bend(segment: Any) -> float:
    """Largest second derivative of a curve by its parameter (0 to 1); a chord over dt is within bend dt^2 / 8."""
    from svgelements import Arc, CubicBezier, QuadraticBezier

    if isinstance(segment, Arc):
        return float(max(segment.rx, segment.ry) * segment.sweep**2)
    if isinstance(segment, QuadraticBezier):
        return 2.0 * float(abs(segment.start - 2.0 * segment.control + segment.end))
    assert isinstance(segment, CubicBezier)
    first = segment.start - 2.0 * segment.control1 + segment.control2
    return 6.0 * float(max(abs(first), abs(segment.control1 - 2.0 * segment.control2 + segment.end)))


def _nested(where: str, curves: list[TracedCurve]) -> Rings:
    """One boundary, and the holes in it. Raises InputError if rings cross or are nested differently."""
    import shapely

    polygons = [shapely.Polygon(curve.points) for curve in curves]
    for polygon in polygons:
        if not polygon.is_valid:
            raise InputError(f"{where}: {_reason(polygon)}: expected paths that do not cross themselves")
    lines = np.array([polygon.exterior for polygon in polygons])
    one, other = shapely.STRtree(lines).query(lines, predicate="intersects")
    meeting = np.flatnonzero(one < other)
    if len(meeting):
        shared = lines[one[meeting[0]]].intersection(lines[other[meeting[0]]])
        x, y = min(map(tuple, shapely.get_coordinates(shared)))
        raise InputError(f"{where}: two paths meet at ({x:.6g}, {y:.6g}) m: expected separate paths")
    inner, _ = shapely.STRtree(polygons).query(polygons, predicate="within")
    depth = np.bincount(inner, minlength=len(curves)) - 1
    outer = np.flatnonzero(depth == 0)
    if len(outer) > 1:
        corners = ", ".join(f"({polygons[k].bounds[0]:.6g}, {polygons[k].bounds[1]:.6g})" for k in outer[:4])
        raise InputError(
            f"{where}: {len(outer)} boundaries, with lower left corners at {corners} m: expected one; choose with part="
        )
    if depth.max() > 1:
        x, y = polygons[int(depth.argmax())].bounds[:2]
        raise InputError(f"{where}: an island in a hole, at ({x:.6g}, {y:.6g}) m: expected one piece")
    inside = [
        curve.reversed() if polygon.exterior.is_ccw else curve for curve, polygon in zip(curves, polygons, strict=True)
    ]
    return Rings(inside[outer[0]].reversed(), tuple(curve for curve, level in zip(inside, depth, strict=True) if level))


def _reason(polygon: Any) -> str:
    """Why a polygon is invalid, such as "self-intersection at (0.1, 0.2) m"."""
    from shapely import is_valid_reason

    text, _, place = is_valid_reason(polygon).rstrip("]").partition("[")
    return f"{text.lower()} at ({', '.join(f'{float(c):.6g}' for c in place.split())}) m" if place else text.lower()
