"""Removal of points from a shape."""

from __future__ import annotations

import numpy as np

from .shape import Shape
from .triangulation import Lattice, cell_areas, cell_triangles, point_areas, voronoi_areas, whole_cells


def square_grid(lattice: Lattice) -> np.ndarray | None:
    """Column and row of each point, int32, shape (N, 2); None on a lattice that is not square."""
    if abs(lattice.dx - lattice.dy) > 1e-9 * lattice.dx or lattice.rows == 1:
        return None
    row, column = np.divmod(np.arange(lattice.columns * lattice.rows, dtype=np.int32), np.int32(lattice.columns))
    return np.column_stack([column, row])


def triangulation_without(removed: np.ndarray, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """The triangles that remain when the points of a mask, shape (N,), are removed, and the areas of all points.

    Whole cells of a lattice are removed, and of a grid whose points represent parts of its cells.
    """
    if shape.lattice is not None:
        intact_cells = whole_cells(shape.lattice, removed)
        return cell_triangles(intact_cells), cell_areas(shape.lattice, intact_cells)
    if shape.grid is not None and (shape.grid >= 0).all():
        _, areas = _cells_without(np.zeros(shape.size, bool), shape.grid, shape.spacing)
        if np.allclose(areas, shape.areas, rtol=1e-9, atol=0.0):
            return _cells_without(removed, shape.grid, shape.spacing)
    kept = shape.triangles[~removed[shape.triangles].any(axis=1)]
    if shape.frames is None:
        return kept, point_areas(shape.points, kept)
    # The areas of a tube or sphere are those of the smooth surface.
    return kept, voronoi_areas(shape.points, kept) / voronoi_areas(shape.points, shape.triangles) * shape.areas


def _cells_without(removed: np.ndarray, grid: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the grid cells whose corners all remain, and the areas of points, a quarter of each such cell."""
    low, high = grid.min(axis=0), grid.max(axis=0)
    columns, rows = (high - low + 1).tolist()
    box = Lattice(columns, rows, spacing, spacing)
    place = (grid[:, 1] - low[1]) * columns + grid[:, 0] - low[0]
    absent = np.ones(columns * rows, bool)
    absent[place] = removed
    index = np.full(columns * rows, -1, np.int32)
    index[place] = np.arange(len(grid), dtype=np.int32)
    whole = whole_cells(box, absent)
    return index[cell_triangles(whole)], cell_areas(box, whole)[place]
