"""Seams at any angle: edges whose points are welded one to one, and pillows of two equal halves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, of_kind, point_indices, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltLoad, Load
from ..kernels.contact.weld import weld
from ..shapes.clouds import cloud
from ..shapes.pieces import Place
from ..shapes.sheet import Sheet
from ..shapes.together import placed, together
from .point_pairs import membrane_stiffness

OWNER = "Weld"
# Default stiffness of a pair over thickness times modulus in pure shear, and largest gap at the start, in spacings.
STIFFNESS, COINCIDENT = 10.0, 1e-3


@dataclass(frozen=True, eq=False)
class Weld(Load):
    """A seam that holds: each point of one edge is tied to one of another edge, at which it lies at the start.

    Sheets may meet at any angle, also folded back by 180 degrees, since no family spans the seam. Several seams may
    meet at one edge, as in a T-joint: each is a Weld of its own. The ties are stiff springs, so the seam opens a
    little: with the default by a tenth of what a spacing of the sheet stretches. With all solvers, in one process.

    Attributes:
        first: Indices of points.
        second: As many others; each is tied to the nearest of `first`, which must lie within a thousandth of a spacing.
        stiffness: Force over separation of a pair [N/m]; by default ten times the thickness times the modulus in pure
            shear.

    Raises:
        InputError: if the stiffness is not positive.
    """

    first: Any
    second: Any
    stiffness: float | None = None

    def __post_init__(self) -> None:
        if self.stiffness is not None:
            positive("Weld.stiffness", self.stiffness)

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the weld on a device. Raises InputError for points that do not coincide."""
        return BuiltWeld(self, context, law)


class BuiltWeld(BuiltLoad):
    """A weld on a device."""

    label = "loads: Weld"
    follows_displacement = True
    symmetric = True

    def __init__(self, given: Weld, context: Context, law: BuiltLaw) -> None:
        self.context, sheet, size = context, context.sheet, context.sheet.size
        place = sheet.positions + context.initial_displacement
        first, second = _pairs(given, place, sheet.spacing)
        partner, apart = np.full(size, -1), np.zeros((size, 3))
        partner[first], partner[second] = second, first
        apart[first] = sheet.positions[second] - sheet.positions[first]
        apart[second] = -apart[first]
        self.stiffness = given.stiffness or membrane_stiffness("Weld.stiffness", STIFFNESS, law, sheet)
        self.ties = np.where(partner >= 0, self.stiffness, 0.0)
        self.partner = context.array("weld_partner", OWNER, wp.int32, partner)
        self.apart = context.array("weld_apart", OWNER, context.types.vec3, apart)
        self.joined = context.array("weld_joined", OWNER, context.types.vec3, shape=size)

    def _add(self, stage: Stage, apart: Array, moved: Array, out: Array) -> None:
        stage.launch(
            OWNER, weld(self.context.bits), self.context.sheet.size, partner=self.partner, stiffness=self.stiffness,
            apart=apart, moved=moved, out=out,
        )  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the force of the ties."""
        self._add(stage, self.apart, displacement, out)

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the derivative of the force, which is linear."""
        self._add(stage, self.joined, direction, out)
        return True


def _pairs(given: Weld, place: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points that are tied one to one, each of shape (P,), at the places [m] of all points, (N, 3).

    Raises:
        InputError: for groups of different size or with points in common, and for pairs that do not coincide.
    """
    first, second = (
        np.unique(point_indices(f"Weld.{name}", points, len(place)))
        for name, points in (("first", given.first), ("second", given.second))
    )
    if len(first) != len(second) or np.intersect1d(first, second).size:
        raise InputError(
            f"Weld: {len(first)} points of first and {len(second)} of second: expected as many, and none in common"
        )
    from scipy.spatial import cKDTree

    gap, nearest = cKDTree(place[first]).query(place[second])
    if (gap > COINCIDENT * spacing).any() or len(np.unique(nearest)) < len(first):
        raise InputError(
            f"Weld: points are up to {gap.max():.3g} m apart at the start: expected edges that coincide point by "
            "point, or Joint"
        )
    return first[nearest], second


def pillow(half: Sheet) -> tuple[Sheet, np.ndarray, Weld]:
    """Two equal flat sheets, one on the other with their upper sides outward, welded along all edges.

    Args:
        half: A flat sheet in one piece; the result is two of it, as clouds.

    Returns:
        The sheet of both, whose parts are "sheet 1" above and "sheet 2" below; the displacement that lays one on the
        other [m], shape (N, 3), for `initial_displacement`; and the weld, for `loads`.

    Raises:
        InputError: for a sheet that is curved, prestretched or cut, or has rigid inclusions or pieces.
    """
    of_kind("pillow: half", half, Sheet)
    plain = half.frames is None and half.stretch is None and half.pieces is None and half.spacings is None
    if not plain or half.cuts or half.inclusions or not len(half.triangles):
        raise InputError("pillow: half: expected a flat sheet of uniform spacing without cuts, inclusions and pieces")
    upper = Sheet.of(
        cloud(half.points, half.triangles, None, half.spacing), thickness=half.thickness, density=half.density
    )
    mirrored = cloud(half.points * (1.0, -1.0), half.triangles[:, ::-1], None, half.spacing)
    both = together(upper, Sheet.of(mirrored, thickness=half.thickness, density=half.density))
    start = placed(both, Place(), Place(axis=(1.0, 0.0, 0.0), degrees=180.0))
    rim = np.asarray(half.edges("all"))
    return both, start, Weld(rim, half.size + rim)
