"""Outlines from SVG files."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import InputError, one_of, positive, said
from .file_checks import METERS, UNITS, existing_file, library_reads, meters

# Physical units of lengths in SVG [m], and a user unit of a file without a viewBox (CSS Values and Units, section 6.2).
PHYSICAL = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0, "q": 0.25e-3}
PIXEL = 0.0254 / 96.0
# Distance over the extent below which two points are one.
CLOSE = 1e-9


@dataclass(frozen=True, eq=False)
class Rings:
    """The outline of one flat piece, as polygons whose last corner is joined with the first.

    Attributes:
        boundary: Corners, counter-clockwise [m], shape (N, 2).
        holes: Corners of each hole, clockwise [m], shape (N_i, 2).
    """

    boundary: np.ndarray
    holes: tuple[np.ndarray, ...] = ()


def read_outline(
    path: str | os.PathLike[str],
    *,
    tolerance: float,
    unit: str | float | None = None,
    part: str | None = None,
) -> Rings:
    """The outline that the closed paths of an SVG file enclose: one boundary, and the holes in it.

    Transforms apply. x is to the right, y upwards, and the origin is that of the user units, so that a drawing from
    y = 0 downwards lies below y = 0. Colours, stroke widths and clip paths have no part in it, and elements that are
    not displayed are left out.

    Args:
        path: The file.
        tolerance: Largest distance of curves from the polygon's sides [m], such as a twentieth of the spacing.
        unit: Of a user unit: "m", "mm", "cm", "in", or a number of meters; "document" for a file that says its width
            and height in physical units. It is never guessed.
        part: `id` of the element to take; None for all.

    Raises:
        InputError: for a file that is missing or cannot be read, a missing unit, no closed path, open paths, paths
            that cross themselves or each other, several boundaries, or an island in a hole.
    """
    file = existing_file(path)
    tolerance = positive("tolerance", tolerance)
    if unit is None or (isinstance(unit, str) and unit not in (*METERS, "document")):
        raise InputError(f"unit = {said(unit)}: {UNITS}, or 'document' for the physical size of the file")
    where = f"path = {str(file)!r}"
    with library_reads(file):
        root = _parsed(file)
    scale = _document(where, root) if unit == "document" else meters(unit)
    to_meters = np.diag([scale, -scale, 1.0]) @ _to_user_units(root)
    rings = []
    for name, path_of, matrix in _paths(where, root, part):
        rings += _closed(where, name, path_of, to_meters @ matrix, tolerance)
    if not rings:
        raise InputError(f"{where}: no closed path: expected one or more")
    return _nested(where, rings)


def _parsed(path: Path) -> Any:
    from svgelements import SVG

    with path.open("rb") as stream:
        root = SVG.parse(stream, reify=False, ppi=96.0, on_error="raise")
    if not isinstance(root, SVG):
        raise InputError(f"path = {str(path)!r}: expected an SVG file")
    return root


def _array(matrix: Any) -> np.ndarray:
    return np.array([[matrix.a, matrix.c, matrix.e], [matrix.b, matrix.d, matrix.f], [0.0, 0.0, 1.0]])


def _document(where: str, root: Any) -> float:
    """Meters per user unit of a document with a physical size."""
    texts = [str(root.values["attributes"].get(name, "")).strip() for name in ("width", "height")]
    found = [re.fullmatch(r"([\d.]+(?:e[+-]?\d+)?)\s*([a-z]+)", text.lower()) for text in texts]
    lengths = [float(f[1]) * PHYSICAL[f[2]] for f in found if f is not None and f[2] in PHYSICAL]
    said_size = f"{where}: width = {texts[0]!r}, height = {texts[1]!r}"
    if len(lengths) < 2:
        raise InputError(f"unit = 'document': {said_size}: expected lengths in {', '.join(PHYSICAL)}")
    if root.viewbox is None:
        return PIXEL
    scales = lengths[0] / root.viewbox.width, lengths[1] / root.viewbox.height
    if not math.isclose(*scales, rel_tol=1e-4):
        raise InputError(f"unit = 'document': {said_size}: expected the ratio of the viewBox")
    return scales[0]


def _to_user_units(root: Any) -> np.ndarray:
    """From the pixels of the library to user units, those of the viewBox."""
    from svgelements import Matrix

    return np.linalg.inv(_array(Matrix(root.viewbox_transform)))


def _paths(where: str, root: Any, part: str | None) -> list[tuple[str, Any, np.ndarray]]:
    """Name, path and matrix to pixels of every shape that is drawn."""
    from svgelements import Image, Path, Shape, Text

    shapes = [e for e in root.elements() if isinstance(e, Shape | Text | Image)]
    if part is not None:
        names = [str(e.id) for e in shapes if e.id is not None]
        shapes = [e for e in shapes if e.id == one_of("part", part, names)]
    found = []
    for number, element in enumerate(shapes):
        name = f"{element.values.get('tag', 'element')} {element.id or number}"
        if not isinstance(element, Shape):
            raise InputError(f"{where}: {name}: expected paths; turn text into paths, and take pictures out")
        found.append((name, Path(element.segments(transformed=False)), _array(element.transform)))
    return found


def _closed(where: str, name: str, path: Any, matrix: np.ndarray, tolerance: float) -> list[np.ndarray]:
    """Polygons [m] of all parts of a path.

    Raises:
        InputError: for an open one.
    """
    stretch = float(np.linalg.norm(matrix[:2, :2], 2))
    rings = []
    for subpath in path.as_subpaths():
        corners = _polyline(subpath, tolerance / stretch)
        placed = corners @ matrix[:2, :2].T + matrix[:2, 2]
        extent = float(np.ptp(placed, axis=0).max())
        moved = np.linalg.norm(placed - np.roll(placed, -1, axis=0), axis=1) > CLOSE * extent
        if moved[-1]:
            ends = [np.array2string(placed[k], precision=6, separator=", ") for k in (0, -1)]
            raise InputError(f"{where}: {name} is open, from {ends[0]} to {ends[1]} m: expected closed paths")
        if moved.sum() < 3:
            raise InputError(f"{where}: {name} has {int(moved.sum())} corners: expected three or more")
        rings.append(placed[moved])
    return rings


def _polyline(subpath: Any, tolerance: float) -> np.ndarray:
    """Points along a part of a path, within `tolerance` of it, shape (N, 2)."""
    from svgelements import Close, Line, Move

    points: list[tuple[float, float]] = []
    for segment in subpath:
        if isinstance(segment, Move):
            points.append((segment.end.x, segment.end.y))
            continue
        if segment.end is None:
            continue
        count = 1 if isinstance(segment, Line | Close) else math.ceil(math.sqrt(_bend(segment) / (8.0 * tolerance)))
        inner = [segment.point(k / count) for k in range(1, count)]
        points += [(p.x, p.y) for p in (*inner, segment.end)]
    return np.array(points, np.float64)


def _bend(segment: Any) -> float:
    """Largest second derivative of a curve by its parameter, 0 to 1: a chord over dt is within bend dt^2 / 8 of it."""
    from svgelements import Arc, CubicBezier, QuadraticBezier

    if isinstance(segment, Arc):
        return max(segment.rx, segment.ry) * segment.sweep**2
    if isinstance(segment, QuadraticBezier):
        return 2.0 * abs(segment.start - 2.0 * segment.control + segment.end)
    assert isinstance(segment, CubicBezier)
    first = segment.start - 2.0 * segment.control1 + segment.control2
    return 6.0 * max(abs(first), abs(segment.control1 - 2.0 * segment.control2 + segment.end))


def _nested(where: str, rings: list[np.ndarray]) -> Rings:
    """One boundary, and the holes in it.

    Raises:
        InputError: for rings that cross, or are nested in another way.
    """
    import shapely

    polygons = [shapely.Polygon(ring) for ring in rings]
    for polygon in polygons:
        if not polygon.is_valid:
            raise InputError(f"{where}: {_reason(polygon)}: expected paths that do not cross themselves")
    lines = np.array([polygon.exterior for polygon in polygons])
    one, other = shapely.STRtree(lines).query(lines, predicate="intersects")
    meeting = np.flatnonzero(one < other)
    if len(meeting):
        shared = lines[one[meeting[0]]].intersection(lines[other[meeting[0]]])
        x, y = min(map(tuple, shapely.get_coordinates(shared)))
        raise InputError(f"{where}: two paths meet at ({x:.6g}, {y:.6g}) m: expected paths apart from each other")
    inner, _ = shapely.STRtree(polygons).query(polygons, predicate="within")
    depth = np.bincount(inner, minlength=len(rings)) - 1
    outer = np.flatnonzero(depth == 0)
    if len(outer) > 1:
        corners = ", ".join(f"({polygons[k].bounds[0]:.6g}, {polygons[k].bounds[1]:.6g})" for k in outer[:4])
        raise InputError(
            f"{where}: {len(outer)} boundaries, with lower left corners at {corners} m: expected one; choose with part="
        )
    if depth.max() > 1:
        x, y = polygons[int(depth.argmax())].bounds[:2]
        raise InputError(f"{where}: an island in a hole, at ({x:.6g}, {y:.6g}) m: expected one piece")
    turned = [ring if shapely.LinearRing(ring).is_ccw else ring[::-1] for ring in rings]
    return Rings(turned[outer[0]], tuple(ring[::-1] for ring, level in zip(turned, depth, strict=True) if level == 1))


def _reason(polygon: Any) -> str:
    """Such as "self-intersection at (0.1, 0.2) m"."""
    from shapely import is_valid_reason

    text, _, place = is_valid_reason(polygon).rstrip("]").partition("[")
    return f"{text.lower()} at ({', '.join(f'{float(c):.6g}' for c in place.split())}) m" if place else text.lower()
