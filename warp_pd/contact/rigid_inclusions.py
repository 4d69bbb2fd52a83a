"""Rigid inclusions of a sheet: points that move as one rigid body under the sum of the forces on them."""

from __future__ import annotations

import functools
import operator
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
from ..interfaces import HELD, BuiltLaw, BuiltPart, Columns, Constraint, Part
from ..kernels.contact.rigid import held_inclusions, rigid_inclusions
from ..kernels.integrate import RIGID
from ..step import Phase

OWNER = "rigid inclusions"
# Largest deviation of displacements or velocities of an inclusion from those of a rigid body, over the largest of them.
RIGID_WITHIN = 1e-6
# Deviation that is rounding, over the largest of all points.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class RigidInclusions(Part):
    """Rigid inclusions that the sheet moves, see `Sheet.rigid`; a `Fixed` may hold components of all their points.

    Attributes:
        groups: Point indices of each inclusion.
        names: Prefixes of its columns.
        held: Bits of its components that supports hold. Of a body with one, only the turn about that axis is free.
        velocity: Velocity of all points of the sheet at time 0 [m/s], shape (N, 3).
    """

    groups: Sequence[np.ndarray]
    names: Sequence[str]
    held: Sequence[int]
    velocity: np.ndarray

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """Constraints on all components of the points of each inclusion."""
        return [Constraint("rigid inclusion", members, RIGID) for members in self.groups]

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the bodies on a device."""
        return FreeInclusions(self, context)


@dataclass(frozen=True, eq=False)
class GivenInclusions(RigidInclusions):
    """Rigid inclusions that a `Fixed` or a `Motion` holds or moves; they add only columns to the history."""

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """None: those of the supports are enough."""
        return ()

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the sums on a device."""
        return BuiltInclusions(self, context)


def inclusions_of(sheet: Sheet, constraints: Sequence[Constraint], velocity: np.ndarray) -> list[Part]:
    """The parts of the rigid inclusions of a sheet, given what the supports hold and the initial velocity [m/s].

    Raises:
        InputError: if supports hold some points of an inclusion only, or move it in some components only.
    """
    names = _names(sheet, sheet.inclusions)
    bits: list[int] = []
    for name, members in zip(names, sheet.inclusions, strict=True):
        touching = [c for c in constraints if np.isin(members, c.points).any()]
        whole = [c for c in touching if np.isin(members, c.points).all()]
        bits.append(HELD & functools.reduce(operator.or_, (c.components for c in whole), 0))
        if bits[-1] == HELD:
            continue
        for constraint in touching:
            moves = constraint.motion is not None
            if moves or all(constraint is not each for each in whole):
                held = "".join(c for k, c in enumerate("xyz") if bits[-1] & 1 << k) or "only some of its points"
                expected = "x, y and z (0.0 holds one)" if moves else "any components"
                raise InputError(
                    f"{constraint.owner}.points contains points of the rigid inclusion {name!r}, but holds {held}: "
                    f"expected all points of the inclusion and {expected}, or none of them"
                )
    kinds: list[tuple[type[RigidInclusions], bool]] = [(RigidInclusions, False), (GivenInclusions, True)]
    parts: list[Part] = []
    for part, given in kinds:
        chosen = [k for k, held in enumerate(bits) if (held == HELD) == given]
        if chosen:
            groups = [sheet.inclusions[k] for k in chosen]
            parts.append(part(groups, [names[k] for k in chosen], [bits[k] for k in chosen], velocity))
    return parts


class BuiltInclusions(BuiltPart):
    """The bodies on a device: masses, arms, positions, momenta and rotations; their points give these at frames.

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
    restart = False

    def __init__(self, given: RigidInclusions, context: Context) -> None:
        groups, velocity = given.groups, given.velocity
        self.context, self.count, self.names = context, len(groups), given.names
        sheet, positions = context.sheet, context.clamped_positions
        mass = sheet.areas * sheet.thickness * sheet.density
        placement = 0.0 if context.placement is None else context.placement
        start = context.initial_displacement - placement
        arms, masses, inertia, place, rotation, linear, angular = [], [], [], [], [], [], []
        for members, held in zip(groups, given.held, strict=True):
            m, X = mass[members], positions[members]
            arm = X - m @ X / m.sum()
            arms.append(arm)
            # What a guide holds has no velocity, as if its mass were infinite.
            guided = [held != HELD and bool(held & 1 << k) for k in range(3)]
            masses.append(np.where(guided, np.inf, m.sum()))
            u, v = start[members], velocity[members]
            place.append(m @ u / m.sum())
            turned = _rotation(arm, u - place[-1], m)
            rotation.append(turned)
            tensor = ((arm**2).sum(axis=1) * m).sum() * np.eye(3) - (arm.T * m) @ arm
            inertia.append(_mobility(tensor, turned.T @ np.eye(3)[:, guided]))
            _require_rigid("initial_displacement", start, place[-1] + arm @ turned.T - arm, members)
            arm = arm @ turned.T
            linear.append(m @ v)
            angular.append(m @ np.cross(arm, v))
            omega = turned @ inertia[-1] @ turned.T @ angular[-1]
            _require_rigid("initial_velocity", velocity, linear[-1] / masses[-1] + np.cross(omega, arm), members)
        begins = np.concatenate([[0], np.cumsum([len(g) for g in groups])])
        kind = "inclusion" if self.restart else "given inclusion"

        def table(name: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(f"{kind} {name}", OWNER, dtype, values, per="table")

        def body(name: str, dtype: Any, values: np.ndarray) -> Any:
            return context.array(f"{kind} {name}", OWNER, dtype, values, per="body", restart=self.restart)

        self._points = {
            "begins": table("begins", wp.int32, begins),
            "members": table("members", wp.int32, np.concatenate(groups)),
            "arms": table("arms", wp.vec3d, np.vstack(arms)),
            "masses": table("masses", wp.vec3d, np.array(masses)),
        }
        self._origins = self._points["arms"]
        if context.placement is not None:
            shifts = np.vstack([context.placement[members] for members in groups])
            self._origins = table("origins", wp.vec3d, np.vstack(arms) - shifts)
        self.place = body("place", wp.vec3d, np.array(place))
        self.linear = body("linear", wp.vec3d, np.array(linear))
        self.angular = body("angular", wp.vec3d, np.array(angular))
        self.rotation = body("rotation", wp.mat33d, np.array(rotation))
        self._centres = np.array([mass[g] @ positions[g] / mass[g].sum() for g in groups])
        self._masses, self._inverse_inertia = np.array(masses), np.array(inertia)
        self.push, self.turn = (
            context.array(f"{kind} {name}", OWNER, wp.vec3d, shape=self.count, per="body") for name in ("push", "turn")
        )

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch of frames: where the bodies are, and the forces on them."""
        if phase is Phase.FRAME:
            state = self.context.state
            stage.launch(
                OWNER, held_inclusions(self.context.bits), self.count, **self._points, origins=self._origins,
                mass=state.mass, displacement=state.displacement, velocity=state.velocity, force=state.force,
                place=self.place, linear=self.linear, angular=self.angular, moments=self.rotation, push=self.push,
                turn=self.turn,
            )  # fmt: skip

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

        turned = self._rotations()
        about = np.einsum("bij,bjk,blk,bl->bi", turned, self._inverse_inertia, turned, self.angular.numpy())
        values = {
            "position": self._centres + self.place.numpy(), "rotation": Rotation.from_matrix(turned).as_rotvec(),
            "velocity": self.linear.numpy() / self._masses, "spin": about,
            "force": self.push.numpy(), "torque": self.turn.numpy(),
        }  # fmt: skip
        rows = np.stack([values[what] for what in self._quantities()], axis=1)
        return dict(zip(self._column_names(), rows.ravel().tolist(), strict=True))

    def _rotations(self) -> np.ndarray:
        """Rotation of each body, (B, 3, 3): the one that best fits its points (Kabsch 1976)."""
        u, _, vt = np.linalg.svd(self.rotation.numpy())
        u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
        return np.asarray(u @ vt)


class FreeInclusions(BuiltInclusions):
    """Bodies that the sheet moves, integrated with its points."""

    label = "sheet.inclusions that no Fixed or Motion holds"
    restart = True

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._inertia = self.context.array(
            "inclusion inverse_inertia", OWNER, wp.mat33d, self._inverse_inertia, per="table"
        )

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that drift and kick the bodies, and at frames those of the forces on them."""
        if phase not in (Phase.RIGID_DRIFT, Phase.RIGID_KICK, Phase.FRAME):
            return
        context, state = self.context, self.context.state
        kernels = rigid_inclusions(context.options)
        bodies = with_values(kernels.struct(), {
            **self._points, "origins": self._origins, "inverse_inertia": self._inertia, "step": state.step,
            "damping": state.damping, "force": state.force, "external": state.external, "linear": self.linear,
            "angular": self.angular, "rotation": self.rotation, "velocity": state.velocity,
            "displacement": state.displacement, "place": self.place,
        })  # fmt: skip
        if phase is Phase.FRAME:
            stage.launch(OWNER, kernels.show, self.count, a=bodies, push=self.push, turn=self.turn)
        else:
            stage.launch(OWNER, kernels.move if phase is Phase.RIGID_DRIFT else kernels.kick, self.count, a=bodies)

    def _rotations(self) -> np.ndarray:
        """Rotation of each body, (B, 3, 3)."""
        return np.asarray(self.rotation.numpy())


def _names(sheet: Sheet, groups: Sequence[np.ndarray]) -> list[str]:
    """Prefixes of the columns of each inclusion, all different."""
    names: list[str] = []
    for number, members in enumerate(groups, start=1):
        inside = [name for name, points in sheet.parts.items() if len(points) and np.isin(points, members).all()]
        largest = max(inside, key=lambda name: len(sheet.parts[name]), default=f"inclusion {number}")
        name = re.sub(r"\W", "_", largest)
        names.append(name if name not in names else f"{name}_{number}")
    return names


def _mobility(tensor: np.ndarray, guides: np.ndarray) -> np.ndarray:
    """Spin over angular momentum [1/(kg m^2)], (3, 3), of a body with an inertia, held along `guides`, (3, G).

    A guide along one axis leaves the turn about it, more leave none. All in the frame of the body.
    """
    if guides.shape[1] == 0:
        return np.asarray(np.linalg.inv(tensor))
    axis = guides[:, 0] * (guides.shape[1] == 1)
    return np.outer(axis, axis) / float(guides[:, 0] @ tensor @ guides[:, 0])


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
