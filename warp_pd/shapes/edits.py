"""Shapes that are cut, punched and turned."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..checks import InputError
from .shape import Shape
from .triangulation import Segment, crossed_triangles, triangulation_without

AnyShape = TypeVar("AnyShape", bound=Shape)


def slit(shape: AnyShape, segment: Segment, name: str) -> AnyShape:
    """A copy with a cut and without the triangles that it crosses.

    Raises:
        InputError: for a segment of no length, or one that crosses no triangle; it calls the cut `name`.
    """
    if segment[0] == segment[1]:
        raise InputError(f"{name}: expected a segment of some length")
    gone = crossed_triangles(shape.points, shape.triangles, segment)
    if not gone.any():
        low, high = shape.points.min(axis=0), shape.points.max(axis=0)
        raise InputError(
            f"{name} crosses no bond: expected segments inside the sheet, "
            f"which spans {low.tolist()} to {high.tolist()}, that pass between points"
        )
    return replace(shape, triangles=shape.triangles[~gone], cuts=(*shape.cuts, segment))


def turned(shape: AnyShape, degrees: float) -> tuple[AnyShape, np.ndarray]:
    """A copy that is turned about its middle and forgets its lattice; the rotation, shape (2, 2)."""
    angle = np.deg2rad(degrees)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))

    def turn(p: np.ndarray) -> np.ndarray:
        return np.asarray((p - middle) @ rotation.T + middle)

    cuts = tuple((tuple(turn(np.array(a))), tuple(turn(np.array(b)))) for a, b in shape.cuts)
    return replace(shape, points=turn(shape.points), lattice=None, cuts=cuts), rotation


def punched(shape: AnyShape, inside: np.ndarray, name: str) -> tuple[AnyShape, np.ndarray]:
    """A copy without the points of a mask, shape (N,); which points it kept, shape (N,).

    Raises:
        InputError: if none is inside or none is left; it calls the hole `name`.
    """
    if not inside.any():
        raise InputError(f"{name} holds no point: expected a larger one")
    triangles, areas = triangulation_without(inside, shape.points, shape.triangles, shape.lattice)
    kept = np.zeros(shape.size, bool)
    kept[triangles] = True
    if not kept.any():
        raise InputError(f"{name} leaves no sheet: expected a smaller one")
    renumber = np.cumsum(kept) - 1
    smaller = replace(
        shape,
        points=shape.points[kept],
        areas=areas[kept],
        triangles=renumber[triangles].astype(np.int32),
        lattice=None,
        inclusions=tuple(renumber[i[kept[i]]].astype(np.int32) for i in shape.inclusions),
    )
    return smaller, kept
