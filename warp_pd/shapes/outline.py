"""Shapes from an outline, with points exactly on holes, cracks and inclusions."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from ..device.checks import InputError, positive, show, user_code
from ..geometry.sheet import Shape
from ..geometry.triangulation import cell_triangles, directed_edges, signed_areas, triangles_of, whole_cells
from .assembly import Part, assembled
from .crack_lines import crack_lines
from .curves import Spacing
from .filling import fill_evenly, fill_graded
from .lines import Line, Named, line_edges, named, region, require_apart, ring

# Most points of an outline: beyond, arrays of the triangulation leave the memory of common machines.
MAX_POINTS = 100_000_000
# Round-off of coordinates, over the spacing, up to which points on the grid are told from others.
ROUND_OFF = 2.5e-7
# Cracks are clipped by curves whose points are so much nearer to each other than those of the sheet.
FINER = 16


def outline(boundary: Any, holes: Named, cracks: Named, inclusions: Named, spacing: Any) -> Shape:
    """The shape; arguments as for `Sheet.outline`."""
    import shapely

    at, least = _spacing(spacing)
    curves = [("outline", boundary), *named("hole", holes)]
    rings = [ring(name, curve, at) for name, curve in curves]
    rigid = [ring(name, curve, at) for name, curve in named("inclusion", inclusions)]
    sheet = region(rings[0], rings[1:], rigid)
    _require_size(sheet, at, least)
    paths = named("crack", cracks)
    slits: list[Line] = []
    if paths:
        finer = [ring(name, curve, lambda points: at(points) / FINER) for name, curve in curves]
        slits, rings = crack_lines(paths, region(finer[0], finer[1:], ()), rings, rigid, at)
        sheet = region(rings[0], rings[1:], rigid)
    lines = [*rings, *rigid, *slits]
    # Ends of cracks may be points of rings.
    fixed, which = np.unique(np.concatenate([line.points for line in lines]), axis=0, return_inverse=True)
    which = which.ravel()
    require_apart(lines, which, at)
    edges = line_edges(lines, which)
    drawn = shapely.multilinestrings(shapely.linestrings(fixed[edges]))
    shapely.prepare(drawn)
    filling = (
        fill_graded(sheet, fixed, drawn, at) if callable(spacing) else fill_evenly(sheet, fixed, drawn, least)
    )  # fmt: skip
    points, grid = np.vstack([fixed, filling.points]), np.vstack([filling.fixed_grid, filling.grid])
    # Those on the grid first, row by row.
    order = np.lexsort([grid[:, 0], grid[:, 1], grid[:, 0] < 0])
    points, grid, number = points[order], grid[order], np.argsort(order)
    least = least or float(at(points).min())
    triangles = _triangles(points, grid, sheet, least)
    _require_edges(triangles, number[edges], points)
    ends = np.cumsum([0, *(len(line.points) for line in lines)])
    members = [number[which[a:b]] for a, b in itertools.pairwise(ends)]
    spacings = at(points) if callable(spacing) else None
    base = Shape(
        points=points, areas=np.zeros(len(points)), triangles=triangles, spacing=least, grid=grid, spacings=spacings
    )  # fmt: skip
    parts = [Part(line.name, line.side, at_points) for line, at_points in zip(lines, members, strict=True)]
    outer, inner = len(rings), len(rings) + len(rigid)
    return assembled(base, parts[:outer], parts[outer:inner], parts[inner:])


def _require_size(sheet: Any, at: Spacing, least: float) -> None:
    """Check that a sheet has a sensible number of points."""
    low, high = np.reshape(sheet.bounds, (2, 2))
    longest, space = float((high - low).max()), least or float(at(np.array([[*sheet.centroid.coords[0]]]))[0])
    far = float(np.abs([low, high]).max())
    if np.spacing(far) > ROUND_OFF * space:
        raise InputError(
            f"boundary: coordinates up to {far:.4g} m have no digits for a spacing of {space:.4g} m: expected the "
            "sheet nearer to the origin; subtract its middle"
        )
    if longest < 2.0 * space:
        raise InputError(f"spacing is {space:.4g} m in a sheet {longest:.4g} m long: expected at most half of that")
    if least and sheet.area > MAX_POINTS * least**2:
        raise InputError(
            f"spacing = {least:g}: expected {np.sqrt(sheet.area / MAX_POINTS):.3g} m or more, for at most "
            f"{MAX_POINTS} points"
        )


def _spacing(spacing: Any) -> tuple[Spacing, float]:
    """Spacing as a function of points, and its minimum (for a function a guess that is corrected later)."""
    if not callable(spacing):
        number = positive("spacing", spacing)
        return lambda points: np.full(len(points), number), number

    def at(points: np.ndarray) -> np.ndarray:
        with user_code(lambda error: f"spacing(x, y) raised {error!r}: expected spacings [m]"):
            given = np.asarray(spacing(points[:, 0], points[:, 1]))
            found = np.broadcast_to(given, len(points))
        if given.dtype.kind not in "iuf":
            raise InputError(f"spacing(x, y) = {show(given)}: expected numbers")
        if not (np.isfinite(found) & (found > 0.0)).all():
            bad = int(np.flatnonzero(~(np.isfinite(found) & (found > 0.0)))[0])
            raise InputError(
                f"spacing(x, y) = {found[bad]:g} at {points[bad].tolist()} m: expected finite numbers above zero"
            )
        return found

    return at, 0.0


def _triangles(points: np.ndarray, grid: np.ndarray, sheet: Any, least: float) -> np.ndarray:
    """Two triangles per grid cell away from other points, and Delaunay triangles between."""
    import shapely
    from scipy.spatial import cKDTree

    cells, covered = _grid_cells(points, grid, least)
    rest = np.flatnonzero(~covered)
    found = rest[triangles_of(points[rest])] if len(rest) else np.zeros((0, 3), np.int64)
    middle = points[found].mean(axis=1)
    shapely.prepare(sheet)
    kept = shapely.contains_xy(sheet, *middle.T)
    if len(cells):
        centres = cKDTree(points[cells.reshape(-1, 6)].mean(axis=1))
        inside = centres.query(middle, p=np.inf, distance_upper_bound=0.5 * least * (1.0 + 1e-6))[0]
        kept &= ~np.isfinite(inside)
    found = found[kept]
    turned = signed_areas(points, found) < 0.0
    found[turned] = found[turned][:, ::-1]
    # Slivers along a straight side have no area, but that of round-off.
    round_off = 8.0 * float(np.spacing(np.abs(points).max()))
    sliver = signed_areas(points, found) < least * (1e-9 * least + round_off)
    triangles = np.concatenate([cells, found[~sliver]]).astype(np.int32)
    total = float(signed_areas(points, triangles).sum())
    if abs(total - sheet.area) > 1e-9 * sheet.area + round_off * sheet.length:
        raise InputError(
            f"spacing: triangles cover {total:.6g} of {sheet.area:.6g} m^2; expected a finer spacing, with at least "
            "two points across every gap between curves"
        )
    return triangles


def _grid_cells(points: np.ndarray, grid: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of grid cells away from other points, and a mask of the points surrounded by such cells."""
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
    whole = whole_cells(usable)
    covered[on] = whole_cells(np.pad(whole, 1))[grid[on, 1], grid[on, 0]]
    return number.ravel()[cell_triangles(whole)].astype(np.int64), covered


def _require_edges(triangles: np.ndarray, edges: np.ndarray, points: np.ndarray) -> None:
    """Check that curves and cracks are edges of triangles. Raises InputError if they are not."""
    on = np.zeros(len(points), bool)
    on[edges] = True
    sides = directed_edges(triangles)
    sides = np.sort(sides[on[sides].all(axis=1)].astype(np.int64), axis=1)
    key = np.array([len(points), 1])
    there = np.isin(np.sort(edges, axis=1) @ key, sides @ key)
    if not there.all():
        at = points[edges[~there][0]].mean(axis=0)
        raise InputError(f"spacing: too coarse for the curves near {at.tolist()}; expected a finer spacing")
