"""Points inside an outline: a square grid where it fits, and relaxed points between it and the curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import signed_areas, triangles_of
from .curves import Spacing

# In spacings: least distance of a point of the grid from a curve; the band along curves in which points relax.
CLEAR = 0.7
BAND = 2.6
# Rounds of relaxation; the triangulation is renewed in each, and serves a few moves.
ROUNDS, MOVES = 8, 4
GRADED_ROUNDS, RENEWED = 30, 5
# Edges shorter than the first, and circles around triangles wider in radius than the second, in spacings, are mended.
NARROW, WIDE = 0.7, 0.8
# Least and most divisions of the cells of a graded sheet, and most of them.
COARSEST, DIVISIONS, MAX_CELLS = 5, 20, 40_000_000


@dataclass(frozen=True, eq=False)
class Filling:
    """Points inside an outline.

    Attributes:
        points: Positions [m], shape (M, 2).
        grid: Column and row of the points on the square grid, -1 for the others, int32, shape (M, 2).
        fixed_grid: The same for the points on curves, shape (B, 2).
    """

    points: np.ndarray
    grid: np.ndarray
    fixed_grid: np.ndarray


def fill_evenly(region: Any, fixed: np.ndarray, curves: Any, spacing: float) -> Filling:
    """Fill a region with a square grid, and with relaxed points where it does not fit the curves through `fixed`."""
    import shapely
    from scipy.spatial import cKDTree

    low, high = np.reshape(region.bounds, (2, 2))
    cells = np.maximum(1, np.round((high - low) / spacing)).astype(int)
    origin = 0.5 * (low + high) - 0.5 * spacing * cells
    column, row = (index.ravel() for index in np.meshgrid(*(np.arange(-1, n + 2) for n in cells)))
    candidates = origin + spacing * np.column_stack([column, row])
    place = np.round((fixed - origin) / spacing).astype(np.int32)
    fits = np.abs(fixed - origin - spacing * place).max(axis=1) < 1e-6 * spacing
    fixed_grid = np.where(fits[:, None], place + 1, -1).astype(np.int32)

    shapely.prepare(region)
    near = cKDTree(fixed).query(candidates, distance_upper_bound=2.0 * spacing)[0] < 2.0 * spacing
    kept = shapely.contains_xy(region, *candidates.T)
    at = np.flatnonzero(kept & near)
    kept[at] = shapely.distance(shapely.points(candidates[at]), curves) > CLEAR * spacing
    points, grid = candidates[kept], np.column_stack([column, row])[kept].astype(np.int32) + 1

    if not fits.all():
        apart = cKDTree(fixed[~fits]).query(points, distance_upper_bound=(BAND + 3.0) * spacing)[0]
        loose, around = apart < BAND * spacing, np.isfinite(apart)
        grid[loose] = -1
        points[loose] = _relaxed(
            np.vstack([points[loose], fixed, points[around & ~loose]]), int(loose.sum()), region, None, ROUNDS
        )
    return Filling(points, grid, fixed_grid)


def fill_graded(region: Any, fixed: np.ndarray, curves: Any, spacing: Spacing) -> Filling:
    """Fill a region with points of variable spacing; arguments as for `fill_evenly`."""
    seeds = _seeds(region, curves, spacing)
    points = _relaxed(np.vstack([seeds, fixed]), len(seeds), region, spacing, GRADED_ROUNDS)
    return Filling(points, np.full(points.shape, -1, np.int32), np.full(fixed.shape, -1, np.int32))


def _seeds(region: Any, curves: Any, spacing: Spacing) -> np.ndarray:
    """Initial points [m], shape (M, 2), with a density given by the spacing.

    Cells narrower than half a spacing are traversed along a Morton curve; a point is placed whenever their accumulated
    area reaches that of one point. A strip of half a spacing along curves belongs to the points on them.
    """
    import shapely

    low, high = np.reshape(region.bounds, (2, 2))
    centres, sizes = _cells(low, float((high - low).max()), spacing)
    shapely.prepare(region)
    inside = shapely.contains_xy(region, *centres.T)
    centres, sizes = centres[inside], sizes[inside]
    here = spacing(centres)
    clear = shapely.distance(shapely.points(centres), curves) > 0.5 * here
    centres, sizes, here = centres[clear], sizes[clear], here[clear]
    order = np.argsort(_morton(centres - low, float((high - low).max())))
    count = np.floor(np.cumsum((sizes / here)[order] ** 2) + 0.5)
    return np.asarray(centres[order[np.diff(count, prepend=0.0) > 0.0]])


def _morton(places: np.ndarray, size: float) -> np.ndarray:
    """Morton codes of places in a square, uint64, shape (P,)."""
    whole = np.clip(places / size * 2**DIVISIONS, 0, 2**DIVISIONS - 1).astype(np.uint64)
    key = np.zeros(len(whole), np.uint64)
    for bit in range(DIVISIONS):
        for axis in range(2):
            key |= ((whole[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(2 * bit + axis)
    return key


def _cells(low: np.ndarray, size: float, spacing: Spacing) -> tuple[np.ndarray, np.ndarray]:
    """Centres of square cells, shape (P, 2), and their widths [m]: cells wider than half the spacing are divided."""
    centres, found, sizes = low[None] + 0.5 * size, [], []
    # Some divisions at least: a function may be fine in a small place.
    for depth in range(DIVISIONS + 1):
        wide = (size > 0.5 * spacing(centres)) | (depth < COARSEST)
        found.append(centres[~wide])
        sizes.append(np.full(len(found[-1]), size))
        size *= 0.5
        corners = 0.5 * size * np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])
        needed = float(np.sum((2.0 * size / spacing(centres[wide])) ** 2)) if depth >= COARSEST else 0.0
        if needed > MAX_CELLS or (depth == DIVISIONS and wide.any()):
            raise InputError(
                f"spacing(x, y) is {float(spacing(centres).min()):.3g} m: expected larger spacings; "
                "for a sheet of millions of points give a number in place of the function"
            )
        centres = (centres[wide][:, None] + corners).reshape(-1, 2)
        if not len(centres):
            break
    return np.concatenate(found), np.concatenate(sizes)


def _relaxed(points: np.ndarray, free: int, region: Any, spacing: Spacing | None, rounds: int) -> np.ndarray:
    """Repeatedly move each of the first `free` points to the centroid of the triangles around it.

    With a spacing, triangles are weighted with its inverse fourth power, so that their size follows it. Points are also
    added in large triangles and removed from small ones.
    """
    import shapely

    points = points.copy()
    for number in range(rounds):
        triangles = triangles_of(points)
        middle = points[triangles].mean(axis=1)
        triangles = triangles[shapely.contains_xy(region, *middle.T)]
        if spacing is not None and number % RENEWED == RENEWED - 1 and number < rounds - RENEWED:
            moved = _renewed(points, free, triangles, spacing)
            points, free = np.vstack([moved, points[free:]]), len(moved)
            continue
        for _ in range(MOVES):
            middle = points[triangles].mean(axis=1)
            weight = np.abs(signed_areas(points, triangles))
            if spacing is not None:
                weight = weight / spacing(middle) ** 4
            corner = triangles.ravel()
            total = np.bincount(corner, np.repeat(weight, 3), len(points))
            sums = [np.bincount(corner, np.repeat(weight * m, 3), len(points))[:free] for m in middle.T]
            moved = np.column_stack(sums) / np.maximum(total[:free], 1e-300)[:, None]
            points[:free] = np.where(total[:free, None] > 0.0, moved, points[:free])
    return points[:free]


def _renewed(points: np.ndarray, free: int, triangles: np.ndarray, spacing: Spacing) -> np.ndarray:
    """Remove free points that are too close to others, and add one in the middle of each large triangle."""
    sides = points[triangles] - points[np.roll(triangles, -1, axis=1)]
    here = spacing(points[triangles].mean(axis=1))
    length = np.linalg.norm(sides, axis=2) / here[:, None]
    narrow = np.argwhere(length < NARROW)
    narrow = narrow[np.argsort(length[tuple(narrow.T)], kind="stable")]
    touched, gone = np.zeros(len(points), bool), np.zeros(len(points), bool)
    for one, other in np.column_stack(
        [triangles[tuple(narrow.T)], np.roll(triangles, -1, axis=1)[tuple(narrow.T)]]
    ).tolist():
        crowding = one if one < free else other
        if crowding < free and not touched[[one, other]].any():
            gone[crowding] = touched[one] = touched[other] = True
    area = np.maximum(np.abs(signed_areas(points, triangles)) / here**2, 1e-300)
    radius = length.prod(axis=1) / (4.0 * area)
    wide = np.flatnonzero((radius > WIDE) & (area > 0.5 * NARROW**2))
    more = []
    for triangle in wide[np.argsort(-radius[wide], kind="stable")].tolist():
        if not touched[triangles[triangle]].any():
            touched[triangles[triangle]] = True
            more.append(points[triangles[triangle]].mean(axis=0))
    return np.vstack([points[:free][~gone[:free]], *more])
