"""Parts of a scene besides its law: supports, loads, contact and rupture, as a user lists them and on a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.clock import Schedule
from ..device.fields import Array
from ..device.launches import Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from .built_part import BuiltPart
from .frame import Body
from .law import BuiltLaw, Law
from .scales import Scales


@dataclass(frozen=True, eq=False)
class Turn:
    """Rotation of points as one body.

    Attributes:
        angle: Schedule of the angle [rad], in its first column.
        about: A point of the axis [m], shape (3,).
        axis: Its direction, a unit vector, shape (3,).
    """

    angle: Schedule
    about: np.ndarray
    axis: np.ndarray

    def arms(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vectors a, from the axis, and b, across it [m], shape (P, 3): the rotation is (cos - 1) a + sin b."""
        arm = positions - self.about
        across = np.cross(self.axis, arm)
        return np.cross(across, self.axis), across

    def displacement(self, positions: np.ndarray, time: float) -> np.ndarray:
        """Displacement [m] at a time [s] of points at `positions` [m], both of shape (P, 3)."""
        angle = self.angle.at(time)[0]
        away, across = self.arms(positions)
        return np.asarray(-2.0 * np.sin(0.5 * angle) ** 2 * away + np.sin(angle) * across)


# Bits of x, y and z together, and that of points whose slope is held.
HELD, SLOPE = 7, 16


@dataclass(frozen=True, eq=False)
class Constraint:
    """Components of points whose motion a part prescribes.

    Attributes:
        owner: Name of the part, for messages.
        points: Point indices, int32.
        components: Bits: 1, 2, 4 for x, y, z (all: HELD); 8 for points of a rigid inclusion, SLOPE for held slopes.
        motion: Schedule of the displacement [m], or None for points that stay at their initial position.
        turn: Rotation added to the motion, or None.
    """

    owner: str
    points: np.ndarray
    components: int
    motion: Schedule | None = None
    turn: Turn | None = None

    def displacement(self, positions: np.ndarray, time: float) -> np.ndarray:
        """Prescribed displacement [m], shape (P, 3), of its points at `positions` (P, 3) [m] at a time [s].

        Only prescribed components mean anything, and only where there is a motion.
        """
        assert self.motion is not None
        moved = np.tile(self.motion.at(time), (len(positions), 1))
        return moved if self.turn is None else moved + self.turn.displacement(positions, time)

    def top_speed(self, positions: np.ndarray, time: float) -> float:
        """Largest speed [m/s] of its points at `positions` (P, 3) [m] up to a time [s]."""
        speed = 0.0 if self.motion is None else self.motion.top_speed(time)
        if self.turn is None or not len(positions):
            return speed
        radius = np.linalg.norm(self.turn.arms(positions)[1], axis=1).max()
        return float(speed + radius * self.turn.angle.top_speed(time))


@runtime_checkable
class Part(Protocol):
    """A part of a scene: a frozen dataclass with a method `build`.

    Attributes:
        argument: Argument of the scene that takes it: "loads", "contact" or "damage".
        adds_force: Whether it adds to the external force.
        loads_at_rest: Whether static solvers take it as a load, which `build` then returns.
        does_work: Whether it does work on the sheet, for the energy balance.
        unbalanced: Whether it changes energies in ways that nothing counts, so that there is no balance.
        divides: Whether it is the same for the points of one of several processes, because it refers to no points or
            its constraints say which they are.
    """

    argument: ClassVar[str] = "loads"
    adds_force: ClassVar[bool] = False
    loads_at_rest: ClassVar[bool] = False
    does_work: ClassVar[bool] = False
    unbalanced: ClassVar[bool] = False
    divides: ClassVar[bool] = False

    @property
    def only_one(self) -> str:
        """What a scene has only one of, and what is expected; "" if it may have any number of such parts."""
        return ""

    def check(self, others: Sequence[Part]) -> None:
        """Raise InputError for parts that cannot be combined with this one."""
        if self.only_one and any(getattr(other, "only_one", "") == self.only_one for other in others):
            raise InputError(f"{self.argument}: two or more {self.only_one}")

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """Components of points that it holds or moves."""
        return ()

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Sizes of the part that cannot be meant, each with the likely unit, for a note; by default none."""
        return ()

    def remarks(self) -> Sequence[str]:
        """What may be a mistake in the part itself, one note each; by default none."""
        return ()

    def on_partition(self, sheet: Sheet, partition: Partition) -> Part:
        """The part restricted to the points of one of several processes; `sheet` is the whole sheet.

        Raises:
            InputError: by default, unless the part `divides`: others need explicit support for several processes.
        """
        if self.divides:
            return self
        raise InputError(
            f"{self.argument}: {type(self).__name__}: not supported on several processes; expected a run in one process"
        )

    def around(self, law: BuiltLaw, context: Context) -> BuiltLaw:
        """The force law as the part needs it, before any part is built; by default unchanged."""
        return law

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the part on a device: allocate arrays and register schedules; launches are added later."""
        raise NotImplementedError(f"{type(self).__name__}.build: expected an implementation")


class StaticContact(Protocol):
    """Contact in static equilibrium by the augmented Lagrange method, with a multiplier at each point.

    Attributes:
        label: Its name in messages.
        blocks: Derivative of the force on a point by its displacement [N/m], (N,) mat33, see `add_blocks`.
    """

    label: str
    blocks: Array

    def prepare(self) -> None:
        """Compose the stage of `update_multipliers`; static solvers call it once."""
        ...

    def set_stiffness(self, stiffness: float) -> None:
        """Take about the stiffness of the sheet at a point over its area [Pa/m]; called before the first load step."""
        ...

    def add_blocks(self, stage: Stage, displacement: Array) -> None:
        """Add the launch that fills `blocks` at a displacement [m]; called for two stages."""
        ...

    def touches_anew(self) -> bool:
        """Whether other points touch than in `blocks`, so that no step may take a tangent with these as it is."""
        ...

    def update_multipliers(self) -> bool:
        """Update the multipliers in equilibrium; return whether equilibrium must be found again."""
        ...

    def passed(self) -> bool:
        """Whether the body has passed through the sheet, so that the load step must be refused."""
        ...


class BuiltLoad(BuiltPart, Protocol):
    """A load on a device. Every solver calls the same `add_force`.

    Attributes:
        follows_displacement: Whether the force depends on the displacement.
        coarsens: Whether a displacement-dependent load can be built on coarser sheets, for multigrid.
        symmetric: Whether the tangent of a displacement-dependent load is symmetric.
        at_rest: The load as contact in static equilibrium, or None.
        ties: Stiffness by which it holds each point to others [N/m], (N,), of which a factorisation takes the diagonal;
            or None.
    """

    follows_displacement: bool = False
    coarsens: bool = False
    symmetric: bool = False
    at_rest: StaticContact | None = None
    ties: np.ndarray | None = None

    def constant_force(self) -> np.ndarray | None:
        """The force [N], shape (N, 3), if it is constant; `add_force` is then not called. Otherwise None."""
        return None

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that add the force at a displacement [m] to `out` [N], both (N,) vec3."""
        raise NotImplementedError(f"{type(self).__name__}.add_force: expected an implementation, or a constant_force")

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the launches that add the derivative of the force along a direction [m] to `out` [N].

        It is called for loads that depend on the displacement.

        Returns:
            False if there is no tangent: Newton's method then refuses the load.
        """
        return False

    def tangent_matrix(self, displacement: np.ndarray) -> Any:
        """Derivative of the force [N/m], sparse, shape (3 N, 3 N), at a displacement [m], shape (N, 3).

        It is called by the adjoint method, for loads with an unsymmetric tangent.

        Returns:
            None by default; derivatives then take one solve per constant.
        """
        return None

    def on_coarser(self, context: Context, law: BuiltLaw) -> BuiltLoad | None:
        """Build the same load on a coarser sheet, for multigrid; None if not supported.

        It is called for displacement-dependent loads. The load on the coarser sheet shares the schedules of this one.
        """
        return None


class Load(Part, Protocol):
    """A part that adds to the external force."""

    adds_force: ClassVar[bool] = True
    does_work: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """The load on a device."""
        raise NotImplementedError(f"{type(self).__name__}.build: expected an implementation")


class BuiltContact(BuiltPart, Protocol):
    """Contact on a device."""

    def checks(self, contacts: Sequence[BuiltContact]) -> Sequence[BuiltPart]:
        """Parts that check at frames what all contacts of its kind do not prevent; of the first of the kind alone."""
        return ()

    def outline(self) -> Body | None:
        """The surface of the body that it is with, for drawing, or None."""
        return None

    def pose(self) -> np.ndarray:
        """Position of the centre of that body [m] and unit quaternion (x, y, z, w) at a frame, shape (7,)."""
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@runtime_checkable
class Contact(Part, Protocol):
    """Contact with a body, or of the sheet with itself.

    The energy balance takes velocities at half steps: `half_step` in kernels/integrate.py says which work and losses
    belong to an impulse, kernels/contact/body_contact.py sums them up.
    """

    argument: ClassVar[str] = "contact"
    does_work: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """The contact on a device."""
        raise NotImplementedError(f"{type(self).__name__}.build: expected an implementation")


class BuiltRupture(BuiltPart, Protocol):
    """Rupture on a device.

    Attributes:
        damage: Damage of each point at the last frame, 0 to 1, (N,) float32.
        intact_faces: Whether each triangle is not cut by a crack at the last frame, (F,) uint8.
        close_enough: Relative residual of an equilibrium to which breaking is applied; 0 for the solver's tolerance.
        tear_energy: Energy of a tear as long as the damage field's length [J]; 0 without a damage field.
    """

    damage: Array
    intact_faces: Array
    close_enough: float = 0.0
    tear_energy: float = 0.0

    def prepare_at_rest(self, moved: Array | None = None) -> None:
        """Compose the stages of `break_at_rest`; solvers that seek equilibrium call it once.

        `moved`: displacement since the begin of a time step [m], (N,) vec3; None without time.
        """
        ...

    def break_at_rest(self, again: bool) -> bool:
        """Break the bonds that exceed the criterion at the current displacement; return whether there were any.

        `again`: whether bonds have already broken at the current loads, or in this time step.
        """
        ...

    def energy_at_rest(self, again: bool | None) -> float:
        """Energy of the damage field [J] that `break_at_rest` would find, or for None as it is; 0 without one."""
        return 0.0

    def fingerprint(self) -> str:
        """Hash of values of user functions, which a restart file must match in addition to the settings."""
        return ""


@runtime_checkable
class Rupture(Part, Protocol):
    """A rupture criterion.

    Attributes:
        spared: Points whose bonds never break, such as those in a clamp; None for none.
        is_field: Whether a damage field reduces the stiffness of families.
        layers: Number of additional point layers (neighbours in triangles) around the halo of each of several
            processes.
    """

    argument: ClassVar[str] = "damage"
    is_field: ClassVar[bool] = False
    layers: ClassVar[int] = 0
    spared: Any

    def law(self, force: Law, context: Context) -> Law:
        """The force law of the scene as the criterion needs it; by default unchanged."""
        return force

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """The criterion on a device."""
        raise NotImplementedError(f"{type(self).__name__}.build: expected an implementation")
