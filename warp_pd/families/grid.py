"""Families of a square grid with gaps: one row for all points deep inside it, and one for every other point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError
from ..geometry.couplings import distance_from_segments
from ..geometry.sheet import Sheet
from .cloud import find_neighbours, point_rows, refuse_lone_points
from .tables import TOLERANCE, Families, Horizon, InfluenceFunction, pack

# Relative difference of areas that counts as none.
ALIKE = 1e-9
# A point closer than this to its place on the grid, in spacings, counts as on it; less than `TOLERANCE` allows bonds.
OFF_PLACE = 3e-10


def grid_families(
    sheet: Sheet, horizon: Horizon, function: InfluenceFunction, corrected: bool, intersections: bool
) -> Families:
    """Families of a grid with gaps; arguments as for `build_families`.

    Points are deep, and share row 0, if their family and those of all members are complete: every point of the stencil
    exists and represents one cell, and no other points are near. Members and reverse bonds of a deep point then have
    the indices of the stencil. Corrected weights also differ around unbalanced points: where rows are needed for them
    (`corrected`), the members of deep points must be deep in the above sense, too.
    """
    stencil = Stencil.within(horizon, sheet.spacing)
    image = _Image.of(sheet, stencil)
    deep = _deep_points(sheet, image, stencil, horizon, corrected)
    own, band = np.flatnonzero(~deep), image.around(~deep)
    neighbours, reverses, incomplete = find_neighbours(sheet, band, horizon)
    place = np.searchsorted(band, own)
    neighbours, reverses, incomplete = neighbours[place], reverses[place], incomplete[place]
    refuse_lone_points(sheet, own, neighbours, horizon)
    members = max(len(stencil.steps), int((neighbours >= 0).sum(axis=1).max(initial=0)))
    neighbours, reverses = widened(neighbours, members, -1), widened(reverses, members, 0)
    # Most bonds of a deep point are not among those found: its members have the numbers of the stencil.
    row, k = np.nonzero((neighbours >= 0) & deep[neighbours])
    reverses[row, k] = stencil.number(image.grid[own[row]] - image.grid[neighbours[row, k]])
    rows = point_rows(sheet, own, neighbours, reverses, incomplete, horizon, function, intersections)
    return _with_stencil(rows, sheet, deep, own, image, stencil, function)


@dataclass(frozen=True)
class Stencil:
    """Steps to the members of a complete family, row by row, shape (n, 2), and the largest step."""

    steps: np.ndarray
    reach: int

    @staticmethod
    def within(horizon: Horizon, step: float) -> Stencil:
        """The stencil of a horizon on a square grid of that step [m]."""
        reach = horizon.reach(step)
        y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        length = np.hypot(x, y)
        inside = (length > 0.0) & (step * length <= horizon.length * (1.0 + TOLERANCE))
        return Stencil(np.column_stack([x[inside], y[inside]]), reach)

    def image(self) -> np.ndarray:
        """Mask of a family and its point, in the middle, shape (2 reach + 1, 2 reach + 1)."""
        found = np.zeros((2 * self.reach + 1, 2 * self.reach + 1), bool)
        found[tuple((np.vstack([self.steps, [0, 0]]) + self.reach).T[::-1])] = True
        return found

    def number(self, steps: np.ndarray) -> np.ndarray:
        """Member indices of steps of the stencil, shape (..., 2)."""
        numbers = np.zeros((2 * self.reach + 1, 2 * self.reach + 1), np.int32)
        numbers[tuple((self.steps + self.reach).T)] = np.arange(len(self.steps))
        return np.asarray(numbers[steps[..., 0] + self.reach, steps[..., 1] + self.reach])


@dataclass(frozen=True)
class _Image:
    """The grid as an image with the point index at each place (-1 for none) and a margin of `reach`.

    Attributes:
        index: int32, shape (rows + 2 reach, columns + 2 reach).
        grid: Column and row in the image of each point, shape (N, 2); of the nearest place for points off the grid.
        on: Mask of points on the grid, shape (N,).
        reach: The margin.
    """

    index: np.ndarray
    grid: np.ndarray
    on: np.ndarray
    reach: int

    @staticmethod
    def of(sheet: Sheet, stencil: Stencil) -> _Image:
        assert sheet.grid is not None
        on = np.asarray((sheet.grid >= 0).all(axis=1))
        spacing, reach = sheet.spacing, stencil.reach
        places = np.zeros(sheet.points.shape)
        if on.any():
            places = (sheet.points - np.median(sheet.points[on] - spacing * sheet.grid[on], axis=0)) / spacing
            on &= np.asarray(np.abs(places - sheet.grid).max(axis=1) <= OFF_PLACE)
        if not on.any():
            return _Image(np.full((1, 1), -1, np.int32), np.zeros((sheet.size, 2), np.int64), on, reach)
        low, high = sheet.grid[on].min(axis=0), sheet.grid[on].max(axis=0)
        grid = np.rint(np.clip(places, low - reach, high + reach)).astype(np.int64) - low + reach
        columns, rows = high - low + 1 + 2 * reach
        if (np.diff(grid[on, 1] * columns + grid[on, 0]) <= 0).any():
            raise InputError("sheet.grid: expected points on the grid in order, row by row, each at a different place")
        index = np.full((rows, columns), -1, np.int32)
        index[grid[on, 1], grid[on, 0]] = np.flatnonzero(on)
        return _Image(index, grid, on, reach)

    def at_points(self, image: np.ndarray) -> np.ndarray:
        """Values of an image at each point, shape (N,); points off the grid get the value of their cell."""
        return np.asarray(image[self.grid[:, 1], self.grid[:, 0]])

    def marked(self, points: np.ndarray) -> np.ndarray:
        """Image of the places nearest to some points, bool."""
        image = np.zeros(self.index.shape, bool)
        image[self.grid[points, 1], self.grid[points, 0]] = True
        return image

    def step(self, image: np.ndarray, x: int, y: int) -> np.ndarray:
        """View of the interior of an image, shifted by (x, y) cells."""
        r, (rows, columns) = self.reach, image.shape
        return image[r + y : rows - r + y, r + x : columns - r + x]

    def around(self, points: np.ndarray) -> np.ndarray:
        """Ascending indices of the points within family reach of a mask, and of all points off the grid."""
        near = dilated(self.marked(np.flatnonzero(points)), self.reach)
        return np.flatnonzero(self.at_points(near) | ~self.on)


def _deep_points(sheet: Sheet, image: _Image, stencil: Stencil, horizon: Horizon, corrected: bool) -> np.ndarray:
    """Mask of the points that share row 0, shape (N,)."""
    from scipy.ndimage import binary_erosion

    if not image.on.any():
        return image.on
    cell = sheet.spacing**2
    whole_cell = image.on & (np.abs(sheet.areas - cell) <= ALIKE * cell)
    inner = image.marked(np.flatnonzero(whole_cell)) & (image.index >= 0)
    reach = horizon.length * (1.0 + 1e-6)
    near_cuts = distance_from_segments(sheet.points, np.array(sheet.cuts), reach) <= reach
    apart = image.marked(np.flatnonzero(image.on & near_cuts))
    apart |= image.marked(_near_points_off_grid(sheet, image, reach))
    if sheet.barriers is not None and len(sheet.barriers):
        longest = np.linalg.norm(np.diff(sheet.points[sheet.barriers], axis=1), axis=-1).max() / sheet.spacing
        # A bond of the family that crosses a barrier does so within reach, half a barrier at most from an end of it,
        # which is marked half a cell at most from its place.
        apart |= dilated(image.marked(np.unique(sheet.barriers)), int(np.ceil(image.reach + 0.5 * longest + 0.499)))
    if sheet.bodies is not None:
        body = np.zeros(image.index.shape, np.int32)
        body[image.grid[image.on, 1], image.grid[image.on, 0]] = sheet.bodies[image.on]
        for x, y in stencil.steps:
            apart_here = image.step(apart, 0, 0)
            apart_here |= image.step(body, x, y) != image.step(body, 0, 0)
    # A place stays if the mask holds it and all members of its family.
    family = stencil.image()
    complete = binary_erosion(inner, family) & ~apart
    complete = binary_erosion(complete, family, iterations=2 if corrected else 1)
    deep: np.ndarray = image.on & image.at_points(complete & _in_line(image, stencil.steps))
    if (factors := sheet.factors) is not None and deep.any():
        different, count = np.unique(factors[deep], return_counts=True)
        deep &= factors == different[count.argmax()]
    return np.asarray(deep)


def _near_points_off_grid(sheet: Sheet, image: _Image, reach: float) -> np.ndarray:
    """Indices of the points on the grid within a distance [m] of a point off it."""
    from scipy.spatial import cKDTree

    off = np.flatnonzero(~image.on)
    around = np.flatnonzero(image.on & image.at_points(dilated(image.marked(off), image.reach + 1)))
    if not len(around):
        return around
    distance, _ = cKDTree(sheet.points[off]).query(sheet.points[around], distance_upper_bound=2.0 * reach)
    return np.asarray(around[distance <= reach])


def _in_line(image: _Image, steps: np.ndarray) -> np.ndarray:
    """Mask of the places whose members in each grid line have consecutive indices."""
    straight = np.zeros(image.index.shape, bool)
    found = np.ones_like(image.step(straight, 0, 0))
    for x, y in steps:
        found &= image.step(image.index, x, y) == image.step(image.index, 0, y) + x
    image.step(straight, 0, 0)[...] = found
    return straight


def dilated(mask: np.ndarray, distance: int) -> np.ndarray:
    """Dilate a mask by a distance along x and y."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(mask.view(np.uint8), 2 * distance + 1, mode="constant").view(bool))


def widened(table: np.ndarray, members: int, value: int) -> np.ndarray:
    """Pad a table with `value`, or cut off empty columns, to have `members` columns."""
    table = table[:, :members]
    return np.pad(table, ((0, 0), (0, members - table.shape[1])), constant_values=value)


def _with_stencil(
    rows: Families,
    sheet: Sheet,
    deep: np.ndarray,
    own: np.ndarray,
    image: _Image,
    stencil: Stencil,
    function: InfluenceFunction,
) -> Families:
    """The rows of a grid: the row of its deep points, followed by those of all others."""
    steps, n, wide = stencil.steps, len(stencil.steps), rows.members
    bonds = np.zeros((wide, 2))
    bonds[:n] = steps * sheet.spacing / rows.horizon
    exists = np.arange(wide) < n
    influence, areas, reverses = np.zeros(wide), np.zeros(wide), np.zeros(wide, np.int32)
    influence[:n] = function(np.minimum(np.linalg.norm(bonds[:n], axis=1), 1.0))
    area = sheet.spacing**2 / rows.reference_area
    areas[:n], reverses[:n] = area, stencil.number(-steps)
    common = rows.common
    if common.size:
        apart = np.linalg.norm(bonds[:, None] - bonds[None], axis=-1)
        common = _below(pack((apart <= 1.0 + TOLERANCE) & exists[:, None] & exists), common)
    family_class = np.zeros(sheet.size, np.int32)
    family_class[own] = 1 + np.arange(len(own))
    centres = np.zeros((2 * stencil.reach + 1, sheet.size), np.int32)
    inside = np.flatnonzero(deep)
    for line, y in enumerate(range(-stencil.reach, stencil.reach + 1)):
        centres[line, inside] = image.index[image.grid[inside, 1] + y, image.grid[inside, 0]]
    factors = None if sheet.factors is None else sheet.factors[inside[:1]] if len(inside) else np.ones(1)
    assert rows.neighbours is not None and rows.severed is not None
    return Families(
        horizon=rows.horizon,
        reference_area=rows.reference_area,
        exists=_below(exists, rows.exists),
        bonds=_below(bonds, rows.bonds),
        influence=_below(influence, rows.influence),
        common=common,
        member_areas=_below(areas, rows.member_areas),
        areas=np.append(area, rows.areas),
        reverses=_below(reverses, rows.reverses),
        family_class=family_class,
        neighbours=_below(np.full(wide, -1, np.int32), rows.neighbours),
        steps=steps,
        centres=centres,
        first=np.append(inside[0] if len(inside) else 0, own),
        severed=np.append(False, rows.severed),
        factors=None if factors is None or rows.factors is None else np.append(factors, rows.factors),
    )


def _below(first: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Stack a row on top of others."""
    return np.concatenate([first[None], others])
