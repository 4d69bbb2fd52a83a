"""Free bodies, which the sheet pushes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, numbers, positive, show, vector
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..kernels.contact.body_contact import Given, PointContact
from ..kernels.contact.body_motion import free_motion, vec6d
from ..kernels.contact.free_contact import Equations, FreeBody, free_contact, marking
from ..step import Phase
from .block_list import BlockList
from .body_motion import NOT_TURNED, BodyMotion, BuiltMotion, unit_quaternion
from .body_shapes import BodyShape, rotation_matrix

# Momentum that a free body gives to the sheet, and energy losses; the last one only with friction.
SUMS = (*(f"{name}_{c}" for name in ("impulse", "turn") for c in "xyz"), "loss", "rubbed")
# Smallest least eigenvalue of an inertia over the largest.
LEAST_INERTIA = 1e-9


@dataclass(frozen=True)
class Free(BodyMotion):
    """Free motion under gravity and the forces of the sheet. Bodies do not interact with each other.

    Attributes:
        mass: Mass [kg].
        position: Position of the centre of mass at time 0 [m].
        rotation: Unit quaternion (x, y, z, w) at time 0, from the frame of the body.
        velocity: Velocity at time 0 [m/s].
        spin: Angular velocity at time 0 [1/s], in the coordinates of the sheet.
        inertia: Moments of inertia in the frame of the body [kg m^2], three numbers or a symmetric matrix; None for
            uniform density.
        gravity: Acceleration of gravity [m/s^2].
    """

    mass: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = NOT_TURNED
    inertia: Any = None
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)

    free: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("Free.mass", self.mass)
        for name in ("position", "velocity", "spin", "gravity"):
            vector(f"Free.{name}", getattr(self, name), 3)
        unit_quaternion("Free.rotation", self.rotation)
        if self.inertia is not None:
            self._given_inertia()

    def _given_inertia(self) -> np.ndarray:
        found = numbers("Free.inertia", self.inertia)
        matrix = np.diag(found) if found.shape == (3,) else found
        if matrix.shape != (3, 3) or not np.allclose(matrix, matrix.T):
            raise InputError(f"Free.inertia = {show(self.inertia)}: expected three moments or a symmetric matrix")
        return _require_positive(f"Free.inertia = {show(self.inertia)}", matrix)

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and quaternion at time 0; later poses are known only to the run."""
        return np.array(self.position, float), unit_quaternion("Free.rotation", self.rotation)

    def speed(self, radius: float) -> float:
        """Largest speed [m/s], at time 0, of a point of the body at the distance `radius` [m] from its centre."""
        return float(np.linalg.norm(self.velocity) + radius * np.linalg.norm(self.spin))

    def weight(self) -> float:
        """Mass times gravity [N]."""
        return self.mass * float(np.linalg.norm(self.gravity))

    def check(self, shape: BodyShape) -> None:
        """Check that the shape has a finite mass and positive moments of inertia."""
        if not shape.bounded:
            raise InputError(f"motion = Free: a {shape.kind} has no finite mass; expected a BodyPath")
        if self.inertia is None:
            _require_positive(f"Free.inertia = None: that of the {shape.kind}", shape.inertia())

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build the motion on a device."""
        inertia = self.mass * shape.inertia() if self.inertia is None else self._given_inertia()
        return InFlight(name, self.pose(0.0), self, inertia, context, friction)


def _require_positive(where: str, matrix: np.ndarray) -> np.ndarray:
    """Return an inertia with positive moments. Raises InputError, which begins with `where`, for any other."""
    values = np.linalg.eigvalsh(matrix)
    if not values[0] > LEAST_INERTIA * max(values[-1], 0.0) or not values[0] > 0.0:
        raise InputError(f"{where}: expected positive moments, got {', '.join(f'{v:.4g}' for v in values)}")
    return matrix


class InFlight(BuiltMotion):
    """A free body on a device.

    Attributes:
        changes: Change of velocity and spin in the last half step [m/s, 1/s], (1,) vec6d.
    """

    free = True

    def __init__(
        self,
        name: str,
        pose: tuple[np.ndarray, np.ndarray],
        body: Free,
        inertia: np.ndarray,
        context: Context,
        friction: float,
    ) -> None:
        super().__init__(name, pose, context)
        points, tracked = context.sheet.size, context.options.tracked
        self.body, self.inertia = body, inertia
        turn = rotation_matrix(pose[1])
        angular = turn @ inertia @ turn.T @ np.array(body.spin, float)
        start = [body.velocity, angular, body.velocity, body.spin]
        self.motion.assign(np.array([body.velocity, body.spin], float))
        self.momenta = self._array("momenta", wp.vec3d, np.array(start, float))
        rubs = friction > 0.0
        self._sums_given = SUMS if rubs and tracked else SUMS[:-1]
        self.given = self._array("given", wp.float64, np.zeros(len(self._sums_given)))
        assert self.marks is not None
        near = self._near = BlockList(f"{name}_near", name, self.marks, context)

        def room(what: str, dtype: Any, size: Any, per: str = "point") -> Array:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self.changes = room("changes", vec6d, 1, "once")
        self.any_near = room("any_near", wp.int32, 1, "once")
        # Speed into the body that each point must lose [m/s], -1 for none; normal, and arm x normal.
        self._found = {"need": room("need", wp.float64, points), "rows": room("rows", vec6d, points)}
        if rubs:
            # Vector from the centre [m], and velocity relative to the body [m/s].
            self._found |= {what: room(what, wp.vec3d, points) for what in ("arms", "slips")}
        numbers = {
            "mass": float(body.mass), "inertia": wp.mat33d(*inertia.ravel().tolist()),
            "inverse_inertia": wp.mat33d(*np.linalg.inv(inertia).ravel().tolist()),
            "gravity": wp.vec3d(*map(float, body.gravity)),
        }  # fmt: skip
        arrays = {
            "place": self.place, "rotation": self.rotation, "motion": self.motion, "momenta": self.momenta,
            "changes": self.changes, "given": self.given, "equations": near.room("equations", Equations),
            "impulses": near.room("impulses", Given), "counts": near.counts, "arrived": near.arrived,
            "entries": near.entries, "listed": near.listed,
        }  # fmt: skip
        self._of = with_values(FreeBody(), {**numbers, **arrays})

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch of the first half kick and the drift."""
        if phase is Phase.RIGID_DRIFT:
            of = self._of
            stage.launch(
                self.name, free_motion(self.context.bits), 1, inverse_inertia=of.inverse_inertia, gravity=of.gravity,
                step=self.context.state.step, place=self.place, rotation=self.rotation, motion=self.motion,
                momenta=self.momenta, any_near=self.any_near, changes=self.changes, radius=self.extent[0],
                margin=self.extent[1], slack=self.extent[2], counts=self.counts, travelled=self.travelled,
            )  # fmt: skip

    def add_contact(
        self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any], pushed: Mapping[str, Any] | None
    ) -> None:
        """Add the launches that find the response of the body to the touching points, and those of contact."""
        near = self._near
        kernels = free_contact(of, self.context.options, "slips" in self._found)
        both = {"a": with_values(kernels.struct(), values), "body": self._of, "at_end": int(at_end)}
        if pushed is not None:
            near.launch(stage, kernels.take, **both, **pushed)
        if not at_end:
            stage.pointwise(self.name, marking(of.search), self.context.sheet.size, **values)
        for kernel in (kernels.find, kernels.give_way, kernels.strike):
            near.launch(stage, kernel, **both)

    def found(self) -> dict[str, Array | None]:
        """Arrays of the points in contact."""
        return super().found() | self._found | {"yielded": self.changes, "any_near": self.any_near}

    def free_inertia(self) -> tuple[float, np.ndarray] | None:
        """Mass [kg] and inertia in its frame [kg m^2], (3, 3)."""
        return float(self.body.mass), self.inertia

    def sums(self) -> dict[str, Array]:
        """Momentum and angular momentum given to the sheet since the last frame; total energies lost in contact."""
        return {f"{self.name}_{name}": self.given[k : k + 1] for k, name in enumerate(self._sums_given)}

    def columns(self) -> dict[str, float]:
        """Columns of the history, with the energies [J]."""
        row = super().columns()
        velocity, spin = self.motion.numpy()
        turn = rotation_matrix(self.rotation.numpy()[0])
        angular = turn @ self.inertia @ turn.T @ spin
        kinetic = 0.5 * (self.body.mass * velocity @ velocity + spin @ angular)
        height = -self.body.mass * np.array(self.body.gravity, float) @ self.place.numpy()[0]
        return {**row, f"{self.name}_kinetic": float(kinetic), f"{self.name}_potential": float(height)}

    def end_frame(self) -> None:
        """Reset the sums of a frame, but not the energies lost in contact."""
        given = self.given.numpy().copy()
        given[:6] = 0.0
        self.given.assign(given)
