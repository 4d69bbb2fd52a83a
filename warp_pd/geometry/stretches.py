"""Shapes before a uniform stretch."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..device.checks import InputError
from .shape import Shape
from .triangulation import Lattice, moved_cut

AnyShape = TypeVar("AnyShape", bound=Shape)


def before_stretch(shape: AnyShape, gradient: np.ndarray) -> AnyShape:
    """The shape that becomes `shape` by a uniform stretch about its centre.

    `gradient` is the deformation gradient in the plane, shape (2, 2); a multiple of the identity for a curved shape.
    """
    even = bool(np.array_equal(gradient, gradient[0, 0] * np.eye(2)))
    if shape.inclusions:
        raise InputError(
            f"prestretched: the sheet has {len(shape.inclusions)} rigid inclusions, which do not stretch: expected none"
        )
    if len(shape.triangles) == 0:
        raise InputError("prestretched: the sheet is a bar: expected a sheet with an area; take `initial_displacement`")
    if shape.points.shape[1] == 3 and not even:
        raise InputError(
            f"prestretched: gradient = {gradient.tolist()}: expected one stretch in all directions for a curved sheet"
        )
    inverse = np.linalg.inv(gradient) if shape.points.shape[1] == 2 else np.eye(3) / gradient[0, 0]
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))

    def back(place: np.ndarray) -> np.ndarray:
        return np.asarray((place - middle) @ inverse.T + middle)

    area, lattice = float(np.linalg.det(gradient)), shape.lattice
    if lattice is not None:
        dx, dy = lattice.dx / gradient[0, 0], lattice.dy / gradient[1, 1]
        diagonal = gradient[0, 1] == gradient[1, 0] == 0.0
        lattice = Lattice(lattice.columns, lattice.rows, float(dx), float(dy)) if diagonal else None
    return replace(
        shape,
        points=back(shape.points),
        areas=shape.areas / area,
        spacing=shape.spacing / float(np.sqrt(area)),
        lattice=lattice,
        cuts=tuple(moved_cut(cut, back) for cut in shape.cuts),
        grid=shape.grid if even else None,
        spacings=None if shape.spacings is None else shape.spacings / np.sqrt(area),
    )
