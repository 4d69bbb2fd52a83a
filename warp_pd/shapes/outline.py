"""Shapes from an outline: holes, cracks and inclusions where they were asked for, points exactly on them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import InputError, positions, positive, said, user_code
from .assembly import Part, assembled
from .curves import Spacing, as_curve, spread_on_segment
from .filling import Filling, fill_evenly, fill_graded
from .shape import Shape
from .triangulation import cell_triangles, signed_areas

Named = Mapping[str, Any] | Sequence[Any]


@dataclass(frozen=True, eq=False)
class Line:
    """Points on a curve or crack.

    Attributes:
        name: Of the part.
        points: [m], shape (M, 2).
        side: Number of the side of each, shape (M,).
    """

    name: str
    points: np.ndarray
    side: np.ndarray


def outline(boundary: Any, holes: Named, cracks: Named, inclusions: Named, spacing: Any) -> Shape:
    """The shape; arguments as for `Sheet.outline`."""
    at, least = _spacing(spacing)
    outer = _ring("outline", boundary, at)
    inner = [_ring(name, curve, at) for name, curve in _named("hole", holes)]
    rigid = [_ring(name, curve, at) for name, curve in _named("inclusion", inclusions)]
    region = _region(outer, inner, rigid)
    slits, rings = _cracks(cracks, region, [outer, *inner], at)
    lines = [*rings, *rigid, *slits]
    fixed = np.concatenate([line.points for line in lines])
    fixed, which = _merged(fixed, least)
    edges = _edges([*rings, *rigid], slits, which)
    filling = _fill(region, fixed, edges, spacing, at, least)
    points, grid = np.vstack([fixed, filling.points]), np.vstack([filling.fixed_grid, filling.grid])
    order = _order(grid)
    points, grid, number = points[order], grid[order], np.argsort(order)
    least = least or float(at(points).min())
    triangles = _triangles(points, grid, region, least)
    _require_edges(triangles, number[edges], points)
    ends = np.cumsum([0, *(len(line.points) for line in lines)])
    members = [number[which[a:b]] for a, b in itertools.pairwise(ends)]
    spacings = at(points) if callable(spacing) else None
    base = Shape(
        points=points, areas=np.zeros(len(points)), triangles=triangles, spacing=least, grid=grid, spacings=spacings
    )  # fmt: skip
    parts = [
        Part(line.name, line.side, at_points) for line, at_points in zip(lines, members, strict=True)
    ]  # fmt: skip
    return assembled(
        base, parts[: len(rings)], parts[len(rings) : len(rings) + len(rigid)], parts[len(rings) + len(rigid) :]
    )


def _spacing(spacing: Any) -> tuple[Spacing, float]:
    """Spacing as a function of points, and the number, or a guess of the least one that is corrected later."""
    if not callable(spacing):
        number = positive("spacing", spacing)
        return lambda points: np.full(len(points), number), number

    def at(points: np.ndarray) -> np.ndarray:
        with user_code(lambda error: f"spacing(x, y) raised {error!r}: expected spacings [m]"):
            found = np.broadcast_to(np.asarray(spacing(points[:, 0], points[:, 1]), np.float64), len(points))
        if not (np.isfinite(found) & (found > 0.0)).all():
            raise InputError(f"spacing(x, y) gives {said(found)}: expected finite numbers above zero")
        return found

    return at, 0.0


def _named(kind: str, given: Named) -> list[tuple[str, Any]]:
    """Pairs of a name and a curve; without names they are numbered from 1."""
    if isinstance(given, Mapping):
        return [(str(name), curve) for name, curve in given.items()]
    return [(f"{kind} {number + 1}", curve) for number, curve in enumerate(given)]


def _ring(name: str, curve: Any, at: Spacing) -> Line:
    """Points of a closed curve, counter-clockwise."""
    points, side = as_curve(name, curve).sampled(at)
    x, y = points.T
    if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() < 0.0:
        # A side is named by the point that begins it.
        points, side = points[::-1], np.roll(side[::-1], -1)
    return Line(name, points, side)


def _region(outer: Line, inner: Sequence[Line], rigid: Sequence[Line]) -> Any:
    """The sheet as a shapely polygon, inclusions in it.

    Raises:
        InputError: for curves that cross themselves or each other, or holes outside the outline.
    """
    import shapely

    def polygon(line: Line) -> Any:
        found = shapely.Polygon(line.points)
        if not found.is_valid:
            raise InputError(
                f"{line.name}: {shapely.is_valid_reason(found)}; expected a curve that does not cross itself"
            )
        return found

    whole = polygon(outer)
    shapes = [(line.name, polygon(line)) for line in (*inner, *rigid)]
    for index, (name, shape) in enumerate(shapes):
        if not shapely.contains_properly(whole, shape):
            raise InputError(f"{name} spans {said(shape.bounds)} m: expected it inside the outline, clear of its edge")
        for other, other_shape in shapes[:index]:
            if shapely.intersects(shape, other_shape):
                raise InputError(f"{name} meets {other}: expected holes and inclusions apart from each other")
    return shapely.Polygon(outer.points, [line.points for line in inner])


def _cracks(given: Named, region: Any, rings: Sequence[Line], at: Spacing) -> tuple[list[Line], list[Line]]:
    """Points of the cracks; the rings, with points where cracks end on them."""
    import shapely

    rings = list(rings)
    found: list[Line] = []
    paths: list[Any] = []
    for name, path in _named("crack", given):
        corners = positions(name, path, 2)
        if not (np.linalg.norm(np.diff(corners, axis=0), axis=1) > 0.0).all():
            raise InputError(f"{name} = {said(corners.tolist())}: expected two or more distinct points")
        line = shapely.LineString(corners)
        if not line.is_simple:
            raise InputError(f"{name} crosses itself: expected a line that does not")
        for other, earlier in zip(found, paths, strict=True):
            if shapely.distance(line, earlier) < 0.5 * float(at(corners[:1])[0]):
                raise InputError(f"{name} meets {other.name}: expected cracks more than half a spacing apart")
        corners = _ended(name, corners, region, rings, at)
        pieces = [spread_on_segment(a, b, at) for a, b in itertools.pairwise(corners)]
        points = np.concatenate([*(piece[:-1] for piece in pieces), corners[-1:]])
        if len(points) < 3:
            raise InputError(
                f"{name} is as long as {len(points) - 1} spacing: expected 2 or more; take a finer spacing"
            )
        found.append(Line(name, points, np.zeros(len(points), np.int64)))
        paths.append(line)
    return found, rings


def _ended(name: str, corners: np.ndarray, region: Any, rings: list[Line], at: Spacing) -> np.ndarray:
    """The corners of a crack, its ends at or beyond the edge of the sheet moved onto it: rings get a point there."""
    import shapely

    corners = corners.copy()
    edge = region.boundary
    inside = shapely.LineString(corners).intersection(region)
    if inside.geom_type != "LineString" or inside.length == 0.0:
        raise InputError(f"{name} = {said(corners.tolist())}: expected one piece of it inside the sheet")
    clipped = np.array(inside.coords)
    if len(clipped) != len(corners) or np.linalg.norm(clipped[0] - corners[0]) > np.linalg.norm(
        clipped[0] - corners[-1]
    ):
        clipped = clipped[::-1]
    for end in (0, -1):
        tip = clipped[end]
        space = float(at(tip[None])[0])
        if shapely.distance(shapely.Point(tip), edge) > 1e-6 * space:
            if shapely.distance(shapely.Point(tip), edge) < 0.7 * space:
                raise InputError(
                    f"{name} ends at {tip.tolist()}, nearer to the edge than 0.7 spacings: "
                    "expected it on the edge, or further from it"
                )
            continue
        distances = [np.linalg.norm(ring.points - tip, axis=1).min() for ring in rings]
        which = int(np.argmin(distances))
        ring = rings[which]
        nearest = int(np.argmin(np.linalg.norm(ring.points - tip, axis=1)))
        points = ring.points.copy()
        points[nearest] = tip
        rings[which] = Line(ring.name, points, ring.side)
        clipped[end] = tip
    return np.asarray(clipped)


def _merged(points: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Distinct points [m], and the number of each given one: ends of cracks are points of rings."""
    scale = 1e-7 * (least or float(np.ptp(points, axis=0).max()) * 1e-3)
    _, first, inverse = np.unique(
        np.round(points / scale).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return points[first], inverse.ravel()


def _edges(closed: Sequence[Line], slits: Sequence[Line], which: np.ndarray) -> np.ndarray:
    """Pairs of points that follow each other on a curve, shape (E, 2)."""
    pairs, begin = [], 0
    for lines, is_closed in ((closed, True), (slits, False)):
        for line in lines:
            at = which[begin : begin + len(line.points)]
            begin += len(line.points)
            ahead = np.roll(at, -1) if is_closed else at[1:]
            pairs.append(np.column_stack([at if is_closed else at[:-1], ahead]))
    return np.concatenate(pairs)


def _fill(region: Any, fixed: np.ndarray, edges: np.ndarray, spacing: Any, at: Spacing, least: float) -> Filling:
    import shapely

    curves = shapely.MultiLineString(list(fixed[edges]))
    shapely.prepare(curves)
    if callable(spacing):
        return fill_graded(region, fixed, curves, at)
    return fill_evenly(region, fixed, curves, least)


def _order(grid: np.ndarray) -> np.ndarray:
    """Points on the grid first, row by row; then the others."""
    return np.lexsort([grid[:, 0], grid[:, 1], grid[:, 0] < 0])


def _triangles(points: np.ndarray, grid: np.ndarray, region: Any, least: float) -> np.ndarray:
    """Two triangles for each cell of the grid far from others, Delaunay's triangles between.

    Raises:
        InputError: where the triangles do not follow the curves.
    """
    import shapely
    from scipy.spatial import Delaunay, cKDTree

    cells, covered = _grid_cells(points, grid, least)
    rest = np.flatnonzero(~covered)
    found = rest[Delaunay(points[rest]).simplices] if len(rest) else np.zeros((0, 3), np.int64)
    middle = points[found].mean(axis=1)
    shapely.prepare(region)
    kept = shapely.contains_xy(region, *middle.T)
    if len(cells):
        centres = cKDTree(points[cells.reshape(-1, 6)].mean(axis=1))
        inside = centres.query(middle, p=np.inf, distance_upper_bound=0.5 * least * (1.0 + 1e-6))[0]
        kept &= ~np.isfinite(inside)
    found = found[kept]
    turned = signed_areas(points, found) < 0.0
    found[turned] = found[turned][:, ::-1]
    # Slivers along a straight side have no area.
    sliver = signed_areas(points, found) < 1e-9 * (least or 1.0) ** 2
    triangles = np.concatenate([cells, found[~sliver]]).astype(np.int32)
    total = float(signed_areas(points, triangles).sum())
    if abs(total - region.area) > 1e-9 * region.area:
        raise InputError(
            f"spacing: triangles cover {total:.6g} of {region.area:.6g} m^2; expected a finer spacing, with at least "
            "two points across every gap between curves"
        )
    return triangles


def _grid_cells(points: np.ndarray, grid: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of cells that are clear of points off the grid; which points have such cells all around."""
    from scipy.spatial import cKDTree

    on = grid[:, 0] >= 0
    covered = np.zeros(len(points), bool)
    if not on.any():
        return np.zeros((0, 3), np.int64), covered
    columns, rows = grid[on].max(axis=0) + 1
    number = np.full((rows, columns), -1, np.int64)
    number[grid[on, 1], grid[on, 0]] = np.flatnonzero(on)
    clear = on.copy()
    if not on.all():
        others = cKDTree(points[~on]).query(points[on], distance_upper_bound=1.6 * least)[0]
        clear[on] = ~np.isfinite(others)
    usable = np.zeros((rows, columns), bool)
    usable[grid[on, 1], grid[on, 0]] = clear[on]
    whole = usable[:-1, :-1] & usable[1:, :-1] & usable[:-1, 1:] & usable[1:, 1:]
    row, column = grid[on, 1], grid[on, 0]
    padded = np.pad(whole, 1)
    covered[on] = padded[row, column] & padded[row + 1, column] & padded[row, column + 1] & padded[row + 1, column + 1]
    return number.ravel()[cell_triangles(int(columns), whole)].astype(np.int64), covered


def _require_edges(triangles: np.ndarray, edges: np.ndarray, points: np.ndarray) -> None:
    """Check that curves and cracks are edges of triangles.

    Raises:
        InputError: otherwise.
    """
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    size = len(points)
    there = np.isin(np.sort(edges, axis=1) @ np.array([size, 1]), sides.astype(np.int64) @ np.array([size, 1]))
    if not there.all():
        at = points[edges[~there][0]].mean(axis=0)
        raise InputError(f"spacing: too coarse for the curves near {at.tolist()}; expected a finer spacing")
