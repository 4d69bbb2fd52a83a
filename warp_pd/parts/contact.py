"""Contact with a rigid body on a prescribed path, and the ball."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError, positive, resolved, said, vector
from ..device.fields import Array
from ..device.launches import Stage
from ..device.schedules import Schedule
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..interfaces import BuiltContact, BuiltLaw, Contact, StepLimit
from ..interfaces.context import Context
from ..interfaces.frame import Body
from ..interfaces.phases import Phase
from ..kernels.contact import ShapeFactory, ball, rigid_contact
from .body_shapes import Sphere

# Maximum motion of a body in a step, over the spacing or its radius: beyond it the body can pass points unnoticed. If
# bonds can break it is half of that, so that a bond opens in several steps.
MAX_TRAVEL = 0.25
# Smallest diameter in spacings, and the depth over the radius at which a point counts as inside at the start.
MIN_DIAMETER, TOUCHING = 1.42, 1e-6


@dataclass(frozen=True)
class RigidBall(Contact):
    """A rigid, frictionless ball that moves at a prescribed constant velocity.

    Points inside it are moved to the nearest point of its surface and lose the velocity component into the ball. The
    reaction on the ball is the momentum that they lose. Points held by a support or in a rigid inclusion ignore the
    ball. Source: NN paper, section 6.4.

    Attributes:
        diameter: Diameter [m].
        start: Position of the centre at time 0 [m].
        velocity: Velocity [m/s].

    Raises:
        InputError: if the diameter is not positive, or a vector does not have three finite components.
    """

    diameter: float
    start: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        positive("RigidBall.diameter", self.diameter)
        vector("RigidBall.start", self.start, 3)
        vector("RigidBall.velocity", self.velocity, 3)

    def centre(self, time: float) -> np.ndarray:
        """Position of the centre at a time [m], shape (3,)."""
        return np.array(self.start, float) + time * np.array(self.velocity, float)

    def on_partition(self, sheet: Sheet, partition: Partition) -> Contact:
        """The same part: it refers to no points of the sheet."""
        return self

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the ball on a device."""
        return BuiltBall(self, context)


class ForceColumns(BuiltContact):
    """Contact whose history has mean forces on a body (base class), from impulses since the last frame."""

    # Sum of impulses and unit of each column.
    _forces: Mapping[str, tuple[str, str]]

    def set_forces(self, *vectors: tuple[str, str, str]) -> None:
        """Set the prefix of the columns, the name of the impulses and the unit of each force or torque."""
        self._forces = {f"{name}_{c}": (f"{impulse}_{c}", unit) for name, impulse, unit in vectors for c in "xyz"}

    def column_names(self) -> Sequence[str]:
        """Components of the forces."""
        return list(self._forces)

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Mean forces since the last frame."""
        return self.row_columns({}, totals, elapsed)

    def row_columns(self, before: Mapping[str, float], totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Mean forces since the previous row."""
        return {
            column: -(totals[name] - before.get(name, 0.0)) / elapsed if elapsed > 0.0 else 0.0
            for column, (name, _) in self._forces.items()
        }

    def column_units(self) -> Mapping[str, str]:
        """Units of the forces."""
        return {column: unit for column, (_, unit) in self._forces.items()}


class RigidContact(ForceColumns):
    """Contact with a rigid body that moves at constant velocity.

    Attributes:
        column: Prefix of the history columns of the force on the body.
        impulse: Impulse on each point since the last frame [N s], vec3.
    """

    column = "contact_force"

    def __init__(
        self,
        owner: str,
        context: Context,
        shape: ShapeFactory,
        constants: tuple[float, ...],
        start: np.ndarray,
        velocity: np.ndarray,
    ) -> None:
        """Allocate the arrays, and register the path as a schedule of the clock.

        Args:
            owner: Name of the body.
            context: Context in which arrays are allocated.
            shape: Factory of the shape, see kernels/contact.py.
            constants: At most four constants of the shape.
            start: Position of its centre at time 0 [m], shape (3,).
            velocity: Its velocity [m/s], shape (3,).
        """
        self.label, self.owner, self.context, self.shape = f"contact = {owner}", owner, context, shape
        self.set_forces((self.column, "impulse", "N"))
        types = context.types
        self._constants = types.parameters(*constants, *[0.0] * (4 - len(constants)))
        self._velocity = types.vec3(*velocity)
        last = max(context.clock.duration, 1e-300)
        path = Schedule(np.array([0.0, last]), np.vstack([start, start + last * velocity]))
        self._path = context.clock.register(path)
        self._curved = context.sheet.frames is not None
        self._reference = context.array(
            "reference", owner, types.vec3 if self._curved else types.vec2, context.sheet.points
        )
        self.impulse = context.array("impulse", owner, types.vec3, shape=context.sheet.size, restart=True)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the pointwise stages of contact."""
        if phase not in (Phase.PROJECT, Phase.SEPARATE):
            return
        context, state, clock = self.context, self.context.state, self.context.clock
        kernels = rigid_contact(context.step_options, self.shape, self._curved)
        assert self._path is not None
        project = phase is Phase.PROJECT
        stage.pointwise(
            self.owner, kernels.project if project else kernels.separate, context.sheet.size,
            reference=self._reference, mass=state.mass, held_mask=state.held_mask, centre=clock.scheduled,
            schedule=clock.soon(self._path) if project else self._path, body_velocity=self._velocity,
            constants=self._constants, step=state.step, damping=state.damping, force=state.force,
            external=state.external, displacement=state.displacement, velocity=state.velocity, impulse=self.impulse,
            work=state.work, dissipated=state.dissipated,
        )  # fmt: skip

    def sums(self) -> Mapping[str, Array]:
        """The impulse."""
        return {"impulse": self.impulse}

    def end_frame(self) -> None:
        """Reset the sums of a frame."""
        self.impulse.zero_()


class BuiltBall(RigidContact):
    """A ball on a device."""

    column = "ball_force"

    def __init__(self, body: RigidBall, context: Context) -> None:
        super().__init__(
            "RigidBall", context, ball, (0.5 * body.diameter,), body.centre(0.0), np.array(body.velocity, float)
        )
        self.body = body
        # A smaller ball passes between points.
        resolved("RigidBall.diameter", body.diameter, context.whole.widest_spacing, MIN_DIAMETER)
        self._check_apart()

    def _check_apart(self) -> None:
        """Check that the ball does not touch the sheet at the start."""
        sheet, radius = self.context.sheet, 0.5 * self.body.diameter
        place = sheet.positions + self.context.initial_displacement
        depth = radius - np.linalg.norm(place - self.body.centre(0.0), axis=1)
        deepest = int(depth.argmax())
        if depth[deepest] > TOUCHING * radius:
            raise InputError(
                f"RigidBall.start = {said(tuple(self.body.start))}: expected a ball outside the sheet, but point "
                f"{self.context.number(deepest)} is {depth[deepest]:.3g} m inside it"
            )

    def step_limit(self) -> StepLimit | None:
        """Time in which the ball moves a quarter (an eighth if bonds can break) of a spacing or of its radius."""
        speed = math.hypot(*self.body.velocity)
        if speed == 0.0:
            return None
        smaller = min(self.context.sheet.spacing, 0.5 * self.body.diameter)
        travel = 0.5 * MAX_TRAVEL if self.context.features.breakable else MAX_TRAVEL
        return StepLimit(travel * smaller / speed, f"in which the ball moves {travel} spacings")

    def outline(self) -> Body:
        """Surface for drawing."""
        return Body("ball", "sphere", (0.5 * self.body.diameter,), *Sphere(self.body.diameter).outline(0.0))

    def pose(self) -> np.ndarray:
        """Position of the centre [m] and a quaternion without rotation, shape (7,)."""
        assert self.context.clock.time is not None
        return np.append(self.body.centre(float(self.context.clock.time.numpy()[0])), [0.0, 0.0, 0.0, 1.0])
