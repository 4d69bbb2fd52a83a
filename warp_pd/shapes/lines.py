"""Points on the curves and cracks of an outline, and their checks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device.checks import InputError, positions, show, user_code, vector
from .curves import Spacing, as_curve

Named = Mapping[str, Any] | Sequence[Any]
# Least distance of a point of a curve from the other points and edges of curves, in spacings.
APART = 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """Points on a curve or crack.

    Attributes:
        name: Name of the part.
        points: Positions [m], shape (M, 2).
        side: Index of the side that begins at or contains each point, shape (M,).
        closed: Whether the last point is joined to the first.
    """

    name: str
    points: np.ndarray
    side: np.ndarray
    closed: bool = True

    @property
    def corners(self) -> np.ndarray:
        """Mask of points at which a side begins, shape (M,); none on a smooth curve."""
        return np.asarray(self.side != np.roll(self.side, 1))

    @property
    def ahead(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the points at both ends of each segment."""
        begin = np.arange(len(self.points) - (not self.closed))
        return begin, (begin + 1) % len(self.points)


def named(kind: str, given: Any) -> list[tuple[str, Any]]:
    """(name, curve) pairs from a user's mapping or list; curves of a list are named by number from 1, as "hole 1"."""
    if isinstance(given, Mapping):
        for name in given:
            if not isinstance(name, str) or not name.strip():
                raise InputError(f"{kind}s: the name {show(name)}: expected text")
        return list(given.items())
    one = "polyline" if kind == "crack" else "curve"
    expected = f"expected a list of {one}s, or a mapping of names to {one}s"
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        raise InputError(f"{kind}s = {show(given)}: {expected}")
    if len(given) and all(_is_point(entry) for entry in given):
        raise InputError(f"{kind}s = {show(given)}: {expected}, got one {one}; write [{one}]")
    return [(f"{kind} {number + 1}", curve) for number, curve in enumerate(given)]


def _is_point(given: Any) -> bool:
    try:
        return len(vector("", given, 2)) == 2
    except InputError:
        return False


def ring(name: str, curve: Any, at: Spacing) -> Line:
    """Points of a closed curve, counter-clockwise."""
    import shapely

    try:
        with user_code(lambda error: f"the curve raised {error!r}: expected points of shape (T, 2)"):
            found, side = as_curve(name, curve).sampled(at)
        points = positions("points of the curve", found)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith((f"{name}:", f"{name} ", "spacing")) else f"{name}: {text}") from None
    if not shapely.LinearRing(points).is_ccw:
        # A side is named by the point that begins it.
        points, side = points[::-1], np.roll(side[::-1], -1)
    return Line(name, points, np.asarray(side, np.int64))


def region(outer: Line, inner: Sequence[Line], rigid: Sequence[Line]) -> Any:
    """The sheet, including inclusions, as a shapely polygon."""
    import shapely

    whole = polygon(outer)
    shapes = [(line.name, polygon(line)) for line in (*inner, *rigid)]
    tree = shapely.STRtree([shape for _, shape in shapes])
    for index, (name, shape) in enumerate(shapes):
        if not shapely.contains_properly(whole, shape):
            spans = tuple(float(f"{bound:.6g}") for bound in shape.bounds)
            raise InputError(f"{name} spans {spans} m: expected a curve inside {outer.name}, away from its edge")
        met = np.sort(tree.query(shape, predicate="intersects"))
        if len(met) and met[0] < index:
            raise InputError(f"{name} meets {shapes[met[0]][0]}: expected separate holes and inclusions")
    return shapely.Polygon(outer.points, [line.points for line in inner])


def polygon(line: Line) -> Any:
    """A closed line as a shapely polygon. Raises InputError if the line crosses or touches itself."""
    import shapely

    found = shapely.Polygon(line.points)
    if not found.is_valid or found.area == 0.0:
        place = re.search(r"\[(\S+) (\S+)\]", shapely.is_valid_reason(found))
        where = "it has no area" if place is None else f"it crosses or touches itself at ({place[1]}, {place[2]}) m"
        raise InputError(f"{line.name}: {where}: expected a closed curve that does not cross itself")
    return found


def require_apart(lines: Sequence[Line], number: np.ndarray, at: Spacing) -> None:
    """Check that curves and cracks leave room for triangles between them.

    Args:
        lines: All curves and cracks.
        number: Index of each of their points, in this order; ends of cracks on a ring have the index of the ring's
            point.
        at: Spacing [m].

    Raises:
        InputError: if points are closer to each other, or to an edge of a curve, than `APART` spacings. Sides of a
            polygon that meet in an acute corner may be closer.
    """
    import shapely

    points = np.concatenate([line.points for line in lines])
    side = np.concatenate([line.side for line in lines])
    owner = np.repeat(np.arange(len(lines)), [len(line.points) for line in lines])
    first = np.cumsum([0, *(len(line.points) for line in lines)])
    begin, end = (
        np.concatenate([start + line.ahead[k] for start, line in zip(first, lines, strict=False)]) for k in (0, 1)
    )
    space = at(points)
    length = np.linalg.norm(points[end] - points[begin], axis=1)
    short = np.flatnonzero(length < APART * space[begin])
    if len(short):
        k = begin[short[0]]
        _refuse_near(lines[owner[k]].name, "itself", length[short[0]] / space[k], points[k])
    segments = shapely.linestrings(np.stack([points[begin], points[end]], axis=1))
    tree = shapely.STRtree(segments)
    k, edge = tree.query(shapely.points(points), predicate="dwithin", distance=APART * (1.0 - 1e-9) * space)
    met = (number[k] != number[begin[edge]]) & (number[k] != number[end[edge]])
    sides = np.array([int(line.side.max()) + 1 for line in lines])[owner[k]]
    step = (side[k] - side[begin[edge]]) % sides
    met &= ~((owner[k] == owner[begin[edge]]) & ((step == 1) | (step == sides - 1)) & (sides > 1))
    if met.any():
        k, edge = k[met][0], edge[met][0]
        one, other = lines[owner[k]].name, lines[owner[begin[edge]]].name
        apart = float(shapely.distance(shapely.Point(points[k]), segments[edge]))
        _refuse_near(one, "itself" if one == other else other, apart / space[k], points[k])


def _refuse_near(one: str, other: str, apart: float, place: np.ndarray) -> None:
    near = [float(f"{value:.6g}") for value in place]
    raise InputError(
        f"{one} comes as near as {apart:.2g} spacings to {other} at {near} m: expected {APART} spacings or more; "
        "take a finer spacing, or smoother curves further apart"
    )


def line_edges(lines: Iterable[Line], number: np.ndarray) -> np.ndarray:
    """Pairs of consecutive points on lines, shape (E, 2); `number` as for `require_apart`."""
    pairs, start = [np.zeros((0, 2), np.int64)], 0
    for line in lines:
        begin, end = line.ahead
        pairs.append(np.column_stack([number[start + begin], number[start + end]]))
        start += len(line.points)
    return np.concatenate(pairs)
