"""Rigid inclusions of a sheet: points that move as one rigid body under the sum of the forces on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.launches import Stage, with_values
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltPart, Constraint, Part
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.integrate import RIGID
from ..kernels.rigid import rigid_inclusions

OWNER = "rigid inclusions"
# Largest deviation of displacements or velocities of an inclusion from those of a rigid body, over the largest of them.
RIGID_WITHIN = 1e-6


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
    """The bodies on a device: masses, arms, positions, momenta and rotations."""

    label = "sheet.inclusions"

    def __init__(self, groups: tuple[np.ndarray, ...], velocity: np.ndarray, context: Context) -> None:
        self.context, self.count = context, len(groups)
        sheet = context.sheet
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
            _require_rigid("initial_displacement", u, place[-1] + arm @ turned.T - arm, members)
            arm = arm @ turned.T
            linear.append(m @ v)
            angular.append(m @ np.cross(arm, v))
            omega = turned @ inertia[-1] @ turned.T @ angular[-1]
            _require_rigid("initial_velocity", v, linear[-1] / masses[-1] + np.cross(omega, arm), members)
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

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that drift and kick the bodies."""
        if phase not in (Phase.RIGID_DRIFT, Phase.RIGID_KICK):
            return
        context, state = self.context, self.context.state
        kernels = rigid_inclusions(context.step_options)
        bodies = with_values(kernels.struct(), {
            **self._bodies, "step": state.step, "damping": state.damping, "force": state.force,
            "external": state.external, "linear": self.linear, "angular": self.angular, "rotation": self.rotation,
            "velocity": state.velocity, "displacement": state.displacement, "place": self.place,
        })  # fmt: skip
        stage.launch(OWNER, kernels.move if phase is Phase.RIGID_DRIFT else kernels.kick, self.count, a=bodies)


def _rotation(arms: np.ndarray, shift: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """The rotation that best fits the shifted arms (mass-weighted), exactly the identity for zero shift."""
    if not shift.any():
        return np.eye(3)
    from scipy.spatial.transform import Rotation

    found, _ = Rotation.align_vectors(arms + shift, arms, masses)
    return np.asarray(found.as_matrix())


def _require_rigid(name: str, given: np.ndarray, rigid: np.ndarray, members: np.ndarray) -> None:
    off = np.linalg.norm(given - rigid, axis=1)
    worst = int(off.argmax())
    if off[worst] > RIGID_WITHIN * np.linalg.norm(given, axis=1).max():
        raise InputError(
            f"{name} of point {members[worst]} = {given[worst]}: expected a rigid motion of its rigid inclusion, "
            f"which is {rigid[worst]} there"
        )
