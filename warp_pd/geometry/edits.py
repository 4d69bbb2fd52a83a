"""Edits of shapes: cutting, punching holes, rotating."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..device.checks import InputError
from .holes import square_grid, triangulation_without
from .shape import Shape
from .topology import boundary_edges
from .triangulation import Segment, crossed_triangles, triangles_near

AnyShape = TypeVar("AnyShape", bound=Shape)


def slit(shape: AnyShape, segment: Segment, name: str) -> AnyShape:
    """Copy a shape with a cut, without the triangles that it crosses.

    Raises:
        InputError: if the segment has no length or crosses no triangle; the message names the cut `name`.
    """
    if segment[0] == segment[1]:
        raise InputError(f"{name}: expected a segment of nonzero length")
    near = triangles_near(shape.points, shape.triangles, segment)
    gone = near[crossed_triangles(shape.points, shape.triangles[near], segment)]
    if not len(gone):
        low, high = shape.points.min(axis=0), shape.points.max(axis=0)
        raise InputError(
            f"{name} crosses no bond: expected segments inside the sheet, "
            f"which spans {low.tolist()} to {high.tolist()}, that pass between points"
        )
    return replace(shape, triangles=np.delete(shape.triangles, gone, 0), cuts=(*shape.cuts, segment))


def turned(shape: AnyShape, degrees: float) -> tuple[AnyShape, np.ndarray]:
    """Copy a shape rotated about its centre, without lattice or grid; also return the rotation, shape (2, 2)."""
    angle = np.deg2rad(degrees)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))

    def turn(p: np.ndarray) -> np.ndarray:
        return np.asarray((p - middle) @ rotation.T + middle)

    cuts = tuple((tuple(turn(np.array(a))), tuple(turn(np.array(b)))) for a, b in shape.cuts)
    return replace(shape, points=turn(shape.points), lattice=None, grid=None, cuts=cuts), rotation


def punched(shape: AnyShape, inside: np.ndarray, name: str) -> tuple[AnyShape, np.ndarray]:
    """Copy a shape without the points of a mask, shape (N,); also return the mask of kept points, shape (N,).

    Raises:
        InputError: if no point is inside or none is left; the message names the hole `name`.
    """
    if not inside.any():
        raise InputError(f"{name} contains no points: expected a larger one")
    triangles, areas = triangulation_without(inside, shape)
    grid = shape.grid if shape.lattice is None else square_grid(shape.lattice)
    kept = np.zeros(shape.size, bool)
    kept[triangles] = True
    if not kept.any():
        raise InputError(f"{name} removes the whole sheet: expected a smaller one")
    renumber = np.cumsum(kept) - 1

    def left(points: np.ndarray) -> np.ndarray:
        return np.asarray(renumber[points[kept[points]]], np.int32)

    old_edges, new_edges = boundary_edges(shape.triangles), boundary_edges(triangles)
    rim = np.setdiff1d(new_edges, old_edges)
    barriers = None
    if shape.barriers is not None:
        size = np.array([shape.size, 1])
        left_over = shape.barriers[kept[shape.barriers].all(axis=1)]
        fresh = new_edges[~np.isin(new_edges @ size, old_edges @ size)]
        barriers = renumber[np.unique(np.concatenate([left_over, fresh]), axis=0)]
    count = next(k for k in range(1, len(shape.parts) + 2) if f"hole {k}" not in shape.parts)
    parts = {part: left(points) for part, points in shape.parts.items()} | {f"hole {count}": left(rim)}
    if "all" in parts:
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
