"""Cracks as lines of points, clipped to the sheet and connected to its edge where they start there."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..device.checks import InputError, positions, show
from .curves import Spacing, spread_on_segment
from .lines import Line, polygon

# In spacings: an end so near to the edge of the sheet is on it; ends inside, and inclusions, must be further away.
ON_EDGE, CLEAR = 0.01, 0.7
# Cracks are further from each other than this, in spacings.
BETWEEN = 0.5
# An end within this distance, in spacings, of a point on the edge takes its place; further away it is one more point.
TAKEN = 0.3


def crack_lines(
    given: Sequence[tuple[str, Any]], sheet: Any, rings: Sequence[Line], rigid: Sequence[Line], at: Spacing
) -> tuple[list[Line], list[Line]]:
    """The points of cracks, given by name and corners; and the rings with points where cracks end on them.

    `sheet` is a shapely polygon close to the true curves, `rings` the outline and holes, `rigid` the inclusions.
    """
    import shapely

    rings = list(rings)
    bodies = [
        (line.name, polygon(line), CLEAR, "expected cracks outside inclusions, 0.7 spacings away") for line in rigid
    ]
    found: list[Line] = []
    for name, path in given:
        corners = _corners(name, path)
        corners, mouths = _clipped(name, corners, sheet, at)
        line = shapely.LineString(corners)
        for other, shape, least, expected in bodies:
            nearest = np.array(shapely.shortest_line(line, shape).coords)[:1]
            if shapely.distance(line, shape) < least * float(at(nearest)[0]):
                raise InputError(f"{name} meets {other}: {expected}")
        pieces = [spread_on_segment(a, b, at) for a, b in itertools.pairwise(corners)]
        points = np.concatenate([*(piece[:-1] for piece in pieces), corners[-1:]])
        if len(points) < 3:
            raise InputError(
                f"{name} is as long as {len(points) - 1} spacing: expected 2 or more; take a finer spacing"
            )
        for end, is_mouth in zip((0, -1), mouths, strict=True):
            if is_mouth:
                _put_on_ring(rings, points[end], at)
        found.append(Line(name, points, np.zeros(len(points), np.int64), closed=False))
        bodies.append((name, line, BETWEEN, "expected cracks more than half a spacing apart"))
    return found, rings


def _corners(name: str, path: Any) -> np.ndarray:
    import shapely

    corners = positions(name, path, 2)
    if not (np.linalg.norm(np.diff(corners, axis=0), axis=1) > 0.0).all():
        raise InputError(f"{name} = {show(corners.tolist())}: expected two or more distinct points")
    line = shapely.LineString(corners)
    if not line.is_simple:
        raise InputError(f"{name} crosses itself: expected a line that does not")
    if line.is_closed:
        raise InputError(f"{name} ends where it begins: expected an open line; use a hole for a closed curve")
    return corners


def _clipped(name: str, corners: np.ndarray, sheet: Any, at: Spacing) -> tuple[np.ndarray, tuple[bool, bool]]:
    """The part of a crack inside the sheet, and whether it starts and ends at the edge."""
    import shapely

    line, edge = shapely.LineString(corners), sheet.boundary
    pieces = [piece for piece in shapely.get_parts(line.intersection(sheet)) if piece.length > 0.0]
    # A tiny piece comes from an end on the edge that is outside by round-off.
    longest = max((piece.length for piece in pieces), default=0.0)
    pieces = [piece for piece in pieces if piece.length > 1e-6 * longest]
    if len(pieces) != 1:
        raise InputError(f"{name} = {show(corners.tolist())}: expected a line that enters the sheet only once")
    clipped = np.array(pieces[0].coords)
    if line.project(shapely.Point(clipped[0])) > line.project(shapely.Point(clipped[-1])):
        clipped = clipped[::-1]
    clipped = clipped[np.append(True, np.linalg.norm(np.diff(clipped, axis=0), axis=1) > 1e-9 * longest)]
    mouths = []
    for end in (0, -1):
        tip = corners[end]
        space = float(at(tip[None])[0])
        apart = shapely.distance(shapely.Point(tip), edge)
        inside = np.array_equal(clipped[end], tip) or bool(shapely.contains_xy(sheet, *tip))
        if apart <= ON_EDGE * space:
            clipped[end] = tip
        elif inside and apart < CLEAR * space:
            raise InputError(
                f"{name} ends at {tip.tolist()}, less than {CLEAR} spacings from the edge: "
                "expected an end on the edge, or further inside"
            )
        mouths.append(apart <= ON_EDGE * space or not inside)
    middle = 0.5 * (clipped[1:] + clipped[:-1])
    touching = shapely.distance(shapely.points(np.vstack([middle, clipped[1:-1]])), edge)
    if (touching <= ON_EDGE * at(np.vstack([middle, clipped[1:-1]]))).any():
        raise InputError(
            f"{name} = {show(corners.tolist())}: expected a line inside the sheet that touches the edge only with its "
            "ends"
        )
    return clipped, (mouths[0], mouths[1])


def _put_on_ring(rings: list[Line], tip: np.ndarray, at: Spacing) -> None:
    """Move the nearest ring point that is not a corner to the mouth of a crack, or add a point."""
    import shapely

    place = shapely.Point(tip)
    which = int(np.argmin([shapely.distance(shapely.LinearRing(ring.points), place) for ring in rings]))
    ring = rings[which]
    apart = np.linalg.norm(ring.points - tip, axis=1)
    nearest, space = int(np.argmin(apart)), float(at(tip[None])[0])
    if apart[nearest] <= 1e-9 * space:
        tip[:] = ring.points[nearest]
    elif apart[nearest] <= TAKEN * space and not ring.corners[nearest]:
        points = ring.points.copy()
        points[nearest] = tip
        rings[which] = replace(ring, points=points)
    else:
        begin, end = ring.ahead
        segments = shapely.linestrings(np.stack([ring.points[begin], ring.points[end]], axis=1))
        before = int(np.argmin(shapely.distance(segments, place)))
        rings[which] = replace(
            ring,
            points=np.insert(ring.points, before + 1, tip, axis=0),
            side=np.insert(ring.side, before + 1, ring.side[before]),
        )
