"""Edits of shapes: cuts, holes, rotation."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..device.checks import InputError
from ..geometry.couplings import distance_from_segments
from ..geometry.sheet import Shape, edge_names, whole_edge
from ..geometry.triangulation import (
    Lattice,
    Segment,
    boundary_edges,
    cell_areas,
    cell_triangles,
    crosses,
    moved_cut,
    point_areas,
    voronoi_areas,
    whole_cells,
)

# A point so near to a segment, in spacings, is on it.
ON_SEGMENT = 1e-6

AnyShape = TypeVar("AnyShape", bound=Shape)


def slit(shape: AnyShape, segment: Segment, name: str) -> AnyShape:
    """Copy a shape with a cut, without the triangles that it crosses."""
    if segment[0] == segment[1]:
        raise InputError(f"{name}: expected a segment of nonzero length")
    for cut in shape.cuts:
        apart = distance_from_segments(np.array(segment), np.array([cut]), ON_SEGMENT * shape.spacing)
        if (apart <= ON_SEGMENT * shape.spacing).all():
            raise InputError(f"{name} lies on an earlier cut from {cut[0]} to {cut[1]}: expected each cut once")
    corners = shape.points[shape.triangles]
    # Only sides near the segment are tried.
    low, high = np.min(segment, axis=0), np.max(segment, axis=0)
    margin = 1e-6 * float((high - low).max())
    near = ((corners.max(axis=1) >= low - margin) & (corners.min(axis=1) <= high + margin)).all(axis=1)
    tried = corners[near]
    tips = tips_of(shape, segment)
    crossed = crosses(tried, np.roll(tried, -1, axis=1), segment, tips[-1])
    gone = np.flatnonzero(near)[crossed.any(axis=1)]
    if not len(gone):
        low, high = shape.points.min(axis=0), shape.points.max(axis=0)
        raise InputError(
            f"{name} crosses no bond: expected segments inside the sheet, "
            f"which spans {low.tolist()} to {high.tolist()}, that pass between points"
        )
    ends = shape.triangles[near]
    shape.require_beside_bodies(name, ends[crossed], np.roll(ends, -1, axis=1)[crossed])
    return replace(
        shape,
        triangles=np.delete(shape.triangles, gone, 0),
        cuts=(*shape.cuts, segment),
        tips=tips,
        parts=shape.parts if shape.lattice is not None else {**shape.parts, "all": whole_edge(shape)},
    )


def tips_of(shape: Shape, segment: Segment) -> tuple[tuple[bool, bool], ...]:
    """Tips of the cuts of a shape and of one more: no end on the edge of the shape or on another cut is one."""
    within = ON_SEGMENT * shape.spacing
    ends = np.array([*shape.cuts, segment])
    edges = np.zeros((0, 2, 2))
    if shape.whole_lattice is not None or not len(shape.triangles):
        low, high = shape.points.min(axis=0), shape.points.max(axis=0)
        corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    else:
        edges = shape.points[boundary_edges(shape.triangles)]
    own = distance_from_segments(ends[-1], np.concatenate([ends[:-1], edges]), within) > within
    met = distance_from_segments(ends[:-1].reshape(-1, 2), ends[-1:], within).reshape(-1, 2) <= within
    old = np.array(shape.tips, bool).reshape(-1, 2) & ~met
    return tuple((bool(first), bool(last)) for first, last in [*old, own])


def turned(shape: AnyShape, degrees: float) -> tuple[AnyShape, np.ndarray]:
    """Copy a shape rotated about its centre, without lattice or grid; also return the rotation, shape (2, 2)."""
    angle = np.deg2rad(degrees)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))

    def turn(p: np.ndarray) -> np.ndarray:
        return np.asarray((p - middle) @ rotation.T + middle)

    cuts = tuple(moved_cut(cut, turn) for cut in shape.cuts)
    parts = edge_names(shape)
    return replace(shape, points=turn(shape.points), lattice=None, grid=None, cuts=cuts, parts=parts), rotation


def punched(shape: AnyShape, inside: np.ndarray, name: str) -> tuple[AnyShape, np.ndarray]:
    """Copy a shape without the points of a mask, shape (N,); also return the mask of kept points, shape (N,)."""
    if not inside.any():
        raise InputError(f"{name} contains no points of the sheet: expected a larger one, or one inside the sheet")
    triangles, areas = _triangulation_without(inside, shape)
    grid = shape.grid if shape.lattice is None else _square_grid(shape.lattice)
    kept = np.zeros(shape.size, bool)
    kept[triangles] = True
    if not kept.any():
        raise InputError(f"{name} removes the whole sheet: expected a smaller one")
    renumber = np.cumsum(kept) - 1

    def left(points: np.ndarray) -> np.ndarray:
        return np.asarray(renumber[points[kept[points]]], np.int32)

    old_edges, new_edges = boundary_edges(shape.triangles), boundary_edges(triangles)
    size = np.array([shape.size, 1])
    fresh = new_edges[~np.isin(new_edges @ size, old_edges @ size)]
    barriers = None
    if shape.barriers is not None:
        left_over = shape.barriers[kept[shape.barriers].all(axis=1)]
        barriers = renumber[np.unique(np.concatenate([left_over, fresh]), axis=0)]
    known = edge_names(shape)
    rim = np.setdiff1d(fresh, known["all"])
    count = next(k for k in range(1, len(shape.parts) + 2) if f"hole {k}" not in shape.parts)
    parts = {part: left(points) for part, points in known.items()} | {f"hole {count}": left(rim)}
    parts["all"] = np.union1d(parts["all"], left(rim)).astype(np.int32)
    smaller = replace(
        shape,
        points=shape.points[kept],
        areas=areas[kept],
        triangles=renumber[triangles].astype(np.int32),
        lattice=None,
        grid=None if grid is None else grid[kept],
        spacings=None if shape.spacings is None else shape.spacings[kept],
        frames=None if shape.frames is None else shape.frames[kept],
        bodies=None if shape.bodies is None else shape.bodies[kept],
        pieces=None if shape.pieces is None else shape.pieces[kept],
        barriers=None if barriers is None else barriers.astype(np.int32),
        inclusions=tuple(left(members) for members in shape.inclusions),
        parts=parts,
    )
    return smaller, kept


def stepped_rim(before: AnyShape, after: AnyShape, touched: np.ndarray, radius: float) -> str:
    """Say how much larger than its circle a hole is, if by more than 2 %; empty on curved sheets, and at an edge.

    `touched` is the mask of the points of `before` whose areas changed, shape (N,).
    """
    if before.points.shape[1] != 2 or touched[boundary_edges(before.triangles)].any():
        return ""
    ratio = float(before.areas.sum() - after.areas.sum()) / (np.pi * radius**2)
    if abs(ratio - 1.0) <= 0.02:
        return ""
    return f"its rim has steps and encloses {ratio:.2f} times its circle; a Circle of Sheet.outline has points on it"


def _square_grid(lattice: Lattice) -> np.ndarray | None:
    """Column and row of each point, int32, shape (N, 2); None on a lattice that is not square."""
    if abs(lattice.dx - lattice.dy) > 1e-9 * lattice.dx or lattice.rows == 1:
        return None
    row, column = np.divmod(np.arange(lattice.columns * lattice.rows, dtype=np.int32), np.int32(lattice.columns))
    return np.column_stack([column, row])


def _triangulation_without(removed: np.ndarray, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """The triangles that remain when the points of a mask, shape (N,), are removed, and the areas of all points.

    Whole cells of a lattice are removed, and of a grid whose points represent parts of its cells.
    """
    if shape.lattice is not None:
        intact_cells = whole_cells(~removed.reshape(shape.lattice.rows, shape.lattice.columns))
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
    kept = np.zeros(columns * rows, bool)
    kept[place] = ~removed
    index = np.full(columns * rows, -1, np.int32)
    index[place] = np.arange(len(grid), dtype=np.int32)
    whole = whole_cells(kept.reshape(rows, columns))
    return index[cell_triangles(whole)], cell_areas(box, whole)[place]
