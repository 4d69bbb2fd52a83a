"""The empirical boundary force of the BA paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, not_negative, one_of, point_indices
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..geometry.triangulation import boundary_edges
from ..interfaces import BuiltLaw, BuiltLoad, Load
from ..kernels.papers.boundary_force import boundary_force

FORMS = ("normal", "printed")
OWNER = "BoundaryForce"


@dataclass(frozen=True, eq=False)
class BoundaryForce(Load):
    """The empirical force that pulls edge points back to their local plane (BA eq. 45).

    Each bond of a point i with the force has the force density w_ij A (Y_ij . d_i) n, where d_i is the unit normal of
    the deformation gradient of the complete family of i. It acts on both points with opposite signs. The energy balance
    counts its work as external.

    Attributes:
        value: A [N/m^7], at least 0. Empirical: the paper gives no value.
        points: Indices of the points with the force. None selects the points less than one horizon from an edge
            (clamped or free), a hole or a cut. Points with a broken bond always get the force.
        form: Direction n of the force.
            "normal": n = d_i, perpendicular to the local plane, as the text of the paper says. The force is restoring
                and, for small deflections, linear with a symmetric tangent. It is not central, so it conserves angular
                momentum to second order in the deflection, not to round-off.
            "printed": n = Y_ij / |Y_ij|, as in the printed formula. Its normal component A w (Y . d)^2 / |Y| is never
                negative, so it pushes towards the upper side (along d), whichever side of the plane the point is on; to
                first order in the deflection it acts in the plane. The force thus depends on which side of the sheet is
                the upper one. Offered for comparison.
    """

    only_one: ClassVar[str] = "BoundaryForce: expected one with all the points"

    value: float
    points: Any = None
    form: str = "normal"

    def __post_init__(self) -> None:
        not_negative("BoundaryForce.value", self.value)
        one_of("BoundaryForce.form", self.form, FORMS)

    def carriers(self, sheet: Sheet, horizon: float) -> np.ndarray:
        """Indices of the points on which the force acts while no bond is broken, int32, (P,); `horizon` [m]."""
        if self.points is None:
            return near_edges(sheet, horizon)
        return point_indices("BoundaryForce.points", self.points, sheet.size)

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the force on a device."""
        return BuiltBoundaryForce(self, context, law)


class BuiltBoundaryForce(BuiltLoad):
    """The boundary force on a device."""

    follows_displacement = True

    def __init__(self, load: BoundaryForce, context: Context, law: BuiltLaw) -> None:
        self.label, self.context, self.law, self.load = f"loads: {OWNER}", context, law, load
        if context.sheet.frames is not None:
            raise InputError("loads: BoundaryForce: expected a flat sheet, got a curved one")
        self.breakable = law.intact is not None
        n, families = context.sheet.size, law.families
        carriers = load.carriers(context.sheet, families.horizon)
        self._normals = context.array("edge_normals", OWNER, context.types.vec3, shape=n, halo=True)
        self._points: Array | None = None
        self._reach: Array | None = None
        self._mask: Array | None = None
        self._threads = (n, n)
        if self.breakable:
            mask = np.zeros(n, np.uint8)
            mask[carriers] = 1
            self._mask = context.array("edge_mask", OWNER, wp.uint8, mask)
            return
        reach = np.unique(np.append(families.members_of(carriers), carriers))
        reach = reach[reach >= 0]
        self._points = context.array("edge_points", OWNER, wp.int32, carriers, per="table")
        self._reach = context.array("edge_reach", OWNER, wp.int32, reach, per="table")
        self._threads = (len(carriers), len(reach))

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that find the normals and add the force."""
        context, law = self.context, self.law
        find, push = boundary_force(context.layout, self.load.form)
        family = {"family": law.struct, "displacement": displacement}
        stage.launch(
            OWNER, find, self._threads[0], **family, points=self._points, marked=self._mask,
            normals=self._normals,
        )  # fmt: skip
        stage.launch(
            OWNER, push, self._threads[1], **family, normals=self._normals, points=self._reach,
            unit_force=self.load.value * law.unit_volume**2, external=out,
        )  # fmt: skip


def near_edges(sheet: Sheet, distance: float) -> np.ndarray:
    """Indices of the points less than `distance` [m] away from the edges of the sheet, shape (P,), int32.

    Edges are the sides that belong to only one triangle, including those of holes and cuts. The family of a point
    exactly one horizon from an edge is complete, hence "less than".
    """
    from scipy.spatial import cKDTree

    tail, head = sheet.points[boundary_edges(sheet.triangles).T]
    along = head - tail
    length = np.linalg.norm(along, axis=1)
    close = cKDTree(sheet.points).query_ball_point(0.5 * (tail + head), distance + 0.5 * length)
    side = np.repeat(np.arange(len(close)), [len(points) for points in close])
    point = np.concatenate([np.asarray(points, dtype=np.int64) for points in close])
    arm = sheet.points[point] - tail[side]
    fraction = np.clip((arm * along[side]).sum(axis=1) / length[side] ** 2, 0.0, 1.0)
    apart = np.linalg.norm(arm - fraction[:, None] * along[side], axis=1)
    return np.unique(point[apart < distance * (1.0 - 1e-9)]).astype(np.int32)
