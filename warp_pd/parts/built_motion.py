"""Motions of rigid bodies on a device."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..device.schedules import Schedule
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.body_motion import Equations, Given, free_motion, path_motion, vec6d

# Number of points from which those that may touch are marked first; on smaller sheets the extra launches cost more.
MARKED_FROM = 2**17
# Sums over points: number of threads per block on a GPU, and maximum number of blocks.
LANES, MOST_BLOCKS = 256, 512
# Momentum that a free body gives to the sheet, and energy losses; the last one only with friction.
SUMS = (*(f"{name}_{c}" for name in ("impulse", "turn") for c in "xyz"), "loss", "rubbed")


class Thrown(Protocol):
    """Initial state of a free body; see `body_motion.Free`."""

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        ...

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity at time 0 [m/s]."""
        ...

    @property
    def spin(self) -> tuple[float, float, float]:
        """Angular velocity at time 0 [1/s]."""
        ...

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity [m/s^2]."""
        ...


class BuiltMotion:
    """A motion on a device; see kernels/body_motion.py for its arrays.

    Attributes:
        marks: Whether each point may touch, (N,) uint8, on large sheets; see kernels/body_search.py.
    """

    def __init__(self, name: str, pose: tuple[np.ndarray, np.ndarray], context: Context) -> None:
        """Allocate the arrays of the pose."""
        self.name, self.context = name, context
        points = context.sheet.size
        # The size of the whole sheet decides, so that several processes use the same kernels as one.
        large = context.whole.size >= MARKED_FROM
        self.marks = context.array(f"{name}_marks", name, wp.uint8, shape=points) if large else None
        place, turned = pose
        self.place = self._array("place", wp.vec3d, np.tile(place, (2, 1)))
        self.rotation = self._array("rotation", wp.quatd, np.tile(turned, (2, 1)))
        self.motion = self._array("motion", wp.vec3d, np.zeros((2, 3)))

    def _array(self, name: str, dtype: Any, values: np.ndarray, restart: bool = True, per: str = "body") -> Array:
        return self.context.array(f"{self.name}_{name}", self.name, dtype, values, per=per, restart=restart)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that move the body."""

    def yields(self, stage: Stage, at_end: bool) -> None:
        """Add launches between the search for touching points and their projection (`at_end`: their separation)."""

    def free_inertia(self) -> tuple[float, np.ndarray] | None:
        """Mass [kg] and inertia in the body frame [kg m^2], (3, 3); None if the sheet does not move the body."""
        return None

    def after(self, stage: Stage, at_end: bool, **when: Any) -> None:
        """Add launches after the points have received their impulses; `when`: options of these launches."""

    def sums(self) -> dict[str, Array]:
        """Momentum given to the sheet since the last frame, and losses, by name; empty if not computed here."""
        return {}

    def columns(self) -> dict[str, float]:
        """Columns of the history."""
        place, moving = self.place.numpy()[0], self.motion.numpy()
        row = {f"{self.name}_position_{c}": float(x) for c, x in zip("xyz", place, strict=True)}
        row |= {f"{self.name}_velocity_{c}": float(x) for c, x in zip("xyz", moving[0], strict=True)}
        return row | {f"{self.name}_spin_{c}": float(x) for c, x in zip("xyz", moving[1], strict=True)}

    def end_frame(self) -> None:
        """Reset the sums of a frame."""


class OnPath(BuiltMotion):
    """A prescribed motion on a device."""

    def __init__(
        self,
        name: str,
        pose: tuple[np.ndarray, np.ndarray],
        knots: tuple[np.ndarray, ...],
        context: Context,
        led: bool = False,
    ) -> None:
        """Allocate the knots; `led`: another simulation writes new ones during the run."""
        super().__init__(name, pose, context)
        times, positions, rotations = knots
        per = "body" if led else "table"
        self.knots = self._array("times", wp.float64, times, led, per)
        self.places = self._array("places", wp.vec3d, positions, led, per)
        self.rotations = self._array("rotations", wp.quatd, rotations, led, per)
        # The clock runs only if there is a schedule.
        context.clock.register(Schedule(np.array([0.0]), positions[:1]))

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that follows the path."""
        if phase is (Phase.RIGID_DRIFT if self.context.features.dynamic else Phase.SCHEDULES):
            clock = self.context.clock
            stage.launch(
                self.name, path_motion(), 1, times=self.knots, places=self.places,
                rotations=self.rotations, time=clock.time, advance=clock.advance, place=self.place,
                rotation=self.rotation, motion=self.motion,
            )  # fmt: skip


class InFlight(BuiltMotion):
    """A free body on a device.

    Attributes:
        changes: Change of velocity and spin in the last half step [m/s, 1/s], (1,) vec6d.
        need: Speed into the body that each point must lose [m/s], -1 for none, (N,) float64.
        rows: Normal, and arm x normal, of these points, (N,) vec6d.
        push: Impulse on each point in the last half step [N s], (N,) vec3d.
        arms: Vector from the centre to each point [m], (N,) vec3d.
        slips: Velocity of these points relative to the body [m/s], (N,) vec3d, or None without friction.
        push_work: Work of `push` [J], (N,) float64, or None.
        rub: The part of `push` caused by friction [N s], (N,) vec3d, or None.
        rub_work: Work of `rub` [J], (N,) float64, or None.
    """

    def __init__(
        self,
        name: str,
        pose: tuple[np.ndarray, np.ndarray],
        body: Thrown,
        inertia: np.ndarray,
        context: Context,
        friction: float,
    ) -> None:
        super().__init__(name, pose, context)
        points, tracked = context.sheet.size, context.features.tracked
        self.body, self.inertia = body, inertia
        turn = _matrix(pose[1])
        angular = turn @ inertia @ turn.T @ np.array(body.spin, float)
        start = [body.velocity, angular, body.velocity, body.spin]
        self.motion.assign(np.array([body.velocity, body.spin], float))
        self.momenta = self._array("momenta", wp.vec3d, np.array(start, float))
        rubs = friction > 0.0
        self._friction, self._rubs = friction, rubs and tracked
        self._sums_given = SUMS if self._rubs else SUMS[:-1]
        self.given = self._array("given", wp.float64, np.zeros(len(self._sums_given)))
        blocks = min(MOST_BLOCKS, -(-points // LANES))
        self._block = -(-points // blocks)
        self._lanes = LANES if context.device.is_cuda else 1
        self._threads = blocks * self._lanes

        def room(what: str, dtype: Any, size: Any, per: str = "point") -> Array:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self.need, self.rows = room("need", wp.float64, points), room("rows", vec6d, points)
        self.push, self.arms = room("push", wp.vec3d, points), room("arms", wp.vec3d, points)
        self.slips = room("slips", wp.vec3d, points) if rubs else None
        self.push_work = room("push_work", wp.float64, points) if tracked else None
        self.rub = room("rub", wp.vec3d, points) if self._rubs else None
        self.rub_work = room("rub_work", wp.float64, points) if self._rubs else None
        self._sums = room("sums", Equations, blocks, "block")
        self._sums_of_given = room("sums_of_given", Given, blocks, "block")
        self.changes = room("changes", vec6d, 1, "once")
        self._inertia = wp.mat33d(*inertia.ravel().tolist())
        self._inverse = wp.mat33d(*np.linalg.inv(inertia).ravel().tolist())
        self._gravity = wp.vec3d(*map(float, body.gravity))
        self._kernels = free_motion(context.bits, context.features.damped, tracked, rubs, self.marks is not None)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that kick and drift the body."""
        step = self.context.state.step
        if phase is Phase.RIGID_DRIFT:
            stage.launch(
                self.name, self._kernels.move, 1, inverse_inertia=self._inverse, gravity=self._gravity, step=step,
                place=self.place, rotation=self.rotation, motion=self.motion, momenta=self.momenta,
            )  # fmt: skip
        elif phase is Phase.RIGID_KICK:
            stage.launch(
                self.name, self._kernels.kick, 1, gravity=self._gravity, step=step, motion=self.motion,
                momenta=self.momenta,
            )  # fmt: skip

    def free_inertia(self) -> tuple[float, np.ndarray] | None:
        """Mass [kg] and inertia in its frame [kg m^2], (3, 3)."""
        return float(self.body.mass), self.inertia

    def yields(self, stage: Stage, at_end: bool) -> None:
        """Add the launches that compute the response of the body to the touching points, and move it."""
        state = self.context.state
        # The second time leaves out points that would have to be pulled.
        for again in (0, 1):
            stage.launch(
                self.name, self._kernels.gather, self._threads, block_dim=LANES, mass=state.mass, marks=self.marks,
                need=self.need, rows=self.rows, arms=self.arms, slips=self.slips, friction=self._friction,
                changes=self.changes, use_changes=again, at_end=int(at_end), step=state.step,
                damping=state.damping, block=self._block, sums=self._sums,
            )  # fmt: skip
            stage.launch(
                self.name, self._kernels.solve, self._lanes, block_dim=LANES, sums=self._sums,
                mass=float(self.body.mass), inertia=self._inertia, use_changes=again, at_end=int(at_end),
                step=state.step, changes=self.changes, place=self.place, rotation=self.rotation, motion=self.motion,
            )  # fmt: skip

    def after(self, stage: Stage, at_end: bool, **when: Any) -> None:
        """Add the launches that subtract the points' impulses from the body."""
        # Before the end of the step, the internal force does not need their results.
        beside: dict[str, Any] = {"block_dim": LANES, "side_stream": not at_end and not when, **when}
        stage.launch(
            self.name, self._kernels.gather_given, self._threads, **beside, marks=self.marks, push=self.push,
            arms=self.arms, push_work=self.push_work, rub=self.rub, rub_work=self.rub_work, block=self._block,
            sums=self._sums_of_given,
        )  # fmt: skip
        stage.launch(
            self.name, self._kernels.give, self._lanes, **beside, sums=self._sums_of_given,
            mass=float(self.body.mass), inverse_inertia=self._inverse, rotation=self.rotation, motion=self.motion,
            momenta=self.momenta, given=self.given,
        )  # fmt: skip

    def sums(self) -> dict[str, Array]:
        """Momentum and angular momentum given to the sheet since the last frame; total energies lost in contact."""
        return {f"{self.name}_{name}": self.given[k : k + 1] for k, name in enumerate(self._sums_given)}

    def columns(self) -> dict[str, float]:
        """Columns of the history, with the energies [J]."""
        row = super().columns()
        velocity, spin = self.motion.numpy()
        turn = _matrix(self.rotation.numpy()[0])
        angular = turn @ self.inertia @ turn.T @ spin
        kinetic = 0.5 * (self.body.mass * velocity @ velocity + spin @ angular)
        height = -self.body.mass * np.array(self.body.gravity, float) @ self.place.numpy()[0]
        return {**row, f"{self.name}_kinetic": float(kinetic), f"{self.name}_potential": float(height)}

    def end_frame(self) -> None:
        """Reset the sums of a frame, but not the energies lost in contact."""
        given = self.given.numpy().copy()
        given[:6] = 0.0
        self.given.assign(given)


def _matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion (x, y, z, w)."""
    axis, w = q[:3], q[3]
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * (w * cross + cross @ cross))
