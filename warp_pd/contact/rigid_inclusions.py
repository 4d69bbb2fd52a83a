"""Rigid inclusions of a sheet: points that move as one rigid body under the sum of the forces on them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.launches import Stage, with_values
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltPart, Columns, Constraint, Part
from ..kernels.contact.rigid import rigid_inclusions
from ..kernels.integrate import RIGID
from ..step import Phase

OWNER = "rigid inclusions"
# Largest deviation of displacements or velocities of an inclusion from those of a rigid body, over the largest of them.
RIGID_WITHIN = 1e-6
# Deviation that is rounding, over the largest of all points.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class RigidInclusions(Part):
    """The rigid inclusions of a sheet, see `Sheet.inclusion`.

    Attributes:
        groups: Point indices of each inclusion.
        velocity: Velocity of all points of the sheet at time 0 [m/s], shape (N, 3).
    """

    groups: tuple[np.ndarray, ...]
    velocity: np.ndarray

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """Constraints on all components of the points of each inclusion."""
        return [Constraint("rigid inclusion", members, RIGID) for members in self.groups]

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the bodies on a device."""
        return BuiltInclusions(self.groups, self.velocity, context)


class BuiltInclusions(BuiltPart):
    """The bodies on a device: masses, arms, positions, momenta and rotations.

    The history has columns of each: its centre of mass NAME_position_x [m] to z, its rotation vector NAME_rotation_x
    [rad], the force of the sheet on it, NAME_force_x [N], and its torque about the centre, NAME_torque_x [N m]; in
    dynamics also NAME_velocity_x [m/s] and NAME_spin_x [rad/s]. NAME is that of the largest part of the sheet within
    the inclusion, or "inclusion_" and its number.

    Attributes:
        names: Prefixes of the columns.
        push: Force of the sheet on each body at the last frame [N], vec3d.
        turn: Torque of the sheet about each centre of mass at the last frame [N m], vec3d.
    """

    label = "sheet.inclusions"

    def __init__(self, groups: tuple[np.ndarray, ...], velocity: np.ndarray, context: Context) -> None:
        self.context, self.count = context, len(groups)
        sheet = context.sheet
        self.names = _names(sheet, groups)
        mass = sheet.areas * sheet.thickness * sheet.density
        arms, masses, inertia, place, rotation, linear, angular = [], [], [], [], [], [], []
        for members in groups:
            m, X = mass[members], sheet.positions[members]
            arm = X - m @ X / m.sum()
            arms.append(arm)
            masses.append(m.sum())
            inertia.append(np.linalg.inv(((arm**2).sum(axis=1) * m).sum() * np.eye(3) - (arm.T * m) @ arm))
            u, v = context.initial_displacement[members], velocity[members]
            place.append(m @ u / m.sum())
            turned = _rotation(arm, u - place[-1], m)
            rotation.append(turned)
            _require_rigid(
                "initial_displacement", context.initial_displacement, place[-1] + arm @ turned.T - arm, members
            )
            arm = arm @ turned.T
            linear.append(m @ v)
            angular.append(m @ np.cross(arm, v))
            omega = turned @ inertia[-1] @ turned.T @ angular[-1]
            _require_rigid("initial_velocity", velocity, linear[-1] / masses[-1] + np.cross(omega, arm), members)
        begins = np.concatenate([[0], np.cumsum([len(g) for g in groups])])

        def table(name: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(name, OWNER, dtype, values, per="table")

        def body(name: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(name, OWNER, dtype, values, per="body", restart=True)

        self._bodies = {
            "begins": table("inclusion begins", wp.int32, begins),
            "members": table("inclusion members", wp.int32, np.concatenate(groups)),
            "arms": table("inclusion arms", wp.vec3d, np.vstack(arms)),
            "masses": table("inclusion masses", wp.float64, np.array(masses)),
            "inverse_inertia": table("inclusion inverse_inertia", wp.mat33d, np.array(inertia)),
        }
        self.place = body("inclusion place", wp.vec3d, np.array(place))
        self.linear = body("inclusion linear", wp.vec3d, np.array(linear))
        self.angular = body("inclusion angular", wp.vec3d, np.array(angular))
        self.rotation = body("inclusion rotation", wp.mat33d, np.array(rotation))
        self._centres = np.array([mass[g] @ sheet.positions[g] / mass[g].sum() for g in groups])
        self._masses, self._inverse_inertia = np.array(masses), np.array(inertia)
        self.push, self.turn = (
            context.array(f"inclusion {name}", OWNER, wp.vec3d, shape=self.count, per="body")
            for name in ("push", "turn")
        )

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that drift and kick the bodies, and at frames those of the forces on them."""
        if phase not in (Phase.RIGID_DRIFT, Phase.RIGID_KICK, Phase.FRAME):
            return
        context, state = self.context, self.context.state
        kernels = rigid_inclusions(context.options)
        bodies = with_values(kernels.struct(), {
            **self._bodies, "step": state.step, "damping": state.damping, "force": state.force,
            "external": state.external, "linear": self.linear, "angular": self.angular, "rotation": self.rotation,
            "velocity": state.velocity, "displacement": state.displacement, "place": self.place,
        })  # fmt: skip
        if phase is Phase.FRAME:
            stage.launch(OWNER, kernels.show, self.count, a=bodies, push=self.push, turn=self.turn)
        else:
            stage.launch(OWNER, kernels.move if phase is Phase.RIGID_DRIFT else kernels.kick, self.count, a=bodies)

    def _quantities(self) -> list[str]:
        moving = ["velocity", "spin"] if self.context.dynamic else []
        return ["position", "rotation", *moving, "force", "torque"]

    def columns(self) -> Columns:
        """Components of the motion and the forces of each body; units of the others are known by their names."""
        units = {f"{name}_rotation_{c}": "rad" for name in self.names for c in "xyz"}
        return Columns(self._column_names(), self._row, units=units)

    def _column_names(self) -> list[str]:
        return [f"{name}_{what}_{c}" for name in self.names for what in self._quantities() for c in "xyz"]

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Motion and forces of each body, see the class."""
        from scipy.spatial.transform import Rotation

        turned = self.rotation.numpy()
        about = np.einsum("bij,bjk,blk,bl->bi", turned, self._inverse_inertia, turned, self.angular.numpy())
        values = {
            "position": self._centres + self.place.numpy(), "rotation": Rotation.from_matrix(turned).as_rotvec(),
            "velocity": self.linear.numpy() / self._masses[:, None], "spin": about,
            "force": self.push.numpy(), "torque": self.turn.numpy(),
        }  # fmt: skip
        rows = np.stack([values[what] for what in self._quantities()], axis=1)
        return dict(zip(self._column_names(), rows.ravel().tolist(), strict=True))


def _names(sheet: Sheet, groups: tuple[np.ndarray, ...]) -> list[str]:
    """Prefixes of the columns of each inclusion, all different."""
    names: list[str] = []
    for number, members in enumerate(groups, start=1):
        inside = [name for name, points in sheet.parts.items() if len(points) and np.isin(points, members).all()]
        largest = max(inside, key=lambda name: len(sheet.parts[name]), default=f"inclusion {number}")
        name = re.sub(r"\W", "_", largest)
        names.append(name if name not in names else f"{name}_{number}")
    return names


def _rotation(arms: np.ndarray, shift: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """The rotation that best fits the shifted arms (mass-weighted), exactly the identity for zero shift."""
    if not shift.any():
        return np.eye(3)
    from scipy.spatial.transform import Rotation

    found, _ = Rotation.align_vectors(arms + shift, arms, masses)
    return np.asarray(found.as_matrix())


def _require_rigid(name: str, every: np.ndarray, rigid: np.ndarray, members: np.ndarray) -> None:
    """Check the values of an inclusion's points, `members`, among those of all points, but for rounding."""
    given = every[members]
    off = np.linalg.norm(given - rigid, axis=1)
    worst = int(off.argmax())
    largest, own = (np.linalg.norm(values, axis=1).max() for values in (every, given))
    if off[worst] > max(RIGID_WITHIN * own, ROUNDING * largest):
        raise InputError(
            f"{name} of point {members[worst]} = {given[worst]}: expected a rigid motion of its rigid inclusion, "
            f"which is {rigid[worst]} there"
        )
