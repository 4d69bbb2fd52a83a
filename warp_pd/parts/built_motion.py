"""Motions of rigid bodies on a device."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..device.schedules import Schedule
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.block_lists import list_marked
from ..kernels.body_contact import Given, PointContact, body_contact
from ..kernels.body_motion import free_motion, path_motion, vec6d
from ..kernels.effects import Kernel
from ..kernels.free_contact import Equations, FreeBody, FreeContact, free_contact

# Lists of points or triangles: number of threads per block on a GPU that work on a list, or make it, and maximum number
# of blocks; more would not run at once.
LANES, LISTING, MOST_BLOCKS = 256, 1024, 128
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


class BlockList:
    """List of the marked points or triangles, in parts that belong to blocks of threads; see kernels/block_lists.py.

    Attributes:
        blocks: Number of blocks.
        size: Entries per block, a multiple of 32.
        entries: Room for a list of each block, int32.
        listed: Number of entries in each list, int32.
        counts, arrived: Room for `sum_of_blocks`.
    """

    def __init__(self, name: str, owner: str, marks: Array, context: Context) -> None:
        self._name, self._owner, self._marks = name, owner, marks
        self._cuda, self._context = context.device.is_cuda, context
        self.blocks = min(MOST_BLOCKS, -(-marks.size // LANES))
        self.size = 32 * -(-marks.size // (32 * self.blocks))
        self.entries = context.array(f"{name}_entries", owner, wp.int32, shape=self.blocks * self.size, per="table")
        self.listed = self.room("listed", wp.int32)
        self.counts = self.room("counts", wp.int32)
        self.arrived = context.array(f"{name}_arrived", owner, wp.int32, shape=1, per="once")

    def room(self, what: str, dtype: Any) -> Array:
        """An array with an entry for each block."""
        return self._context.array(f"{self._name}_{what}", self._owner, dtype, shape=self.blocks, per="block")

    def add(self, stage: Stage, **when: Any) -> None:
        """Add the launch that makes the list."""
        made = {"entries": self.entries, "counts": self.listed}
        self.launch(stage, list_marked, LISTING, marks=self._marks, **made, **when)

    def launch(self, stage: Stage, kernel: Kernel, lanes: int = LANES, /, **arguments: Any) -> None:
        """Add a launch of a kernel on all blocks."""
        # On a CPU a block has one thread.
        threads = self.blocks * (lanes if self._cuda else 1)
        stage.launch(self._owner, kernel, threads, block_dim=lanes, block=self.size, **arguments)


class BuiltMotion:
    """A motion on a device; see kernels/body_motion.py for its arrays.

    Attributes:
        marks: Whether each point may touch a free body, (N,) uint8; see kernels/body_search.py.
        free: Whether the sheet moves the body.
    """

    free: ClassVar[bool] = False

    def __init__(self, name: str, pose: tuple[np.ndarray, np.ndarray], context: Context) -> None:
        """Allocate the arrays of the pose."""
        self.name, self.context = name, context
        points = context.sheet.size
        self.marks = context.array(f"{name}_marks", name, wp.uint8, shape=points) if self.free else None
        place, turned = pose
        self.place = self._array("place", wp.vec3d, np.tile(place, (2, 1)))
        self.rotation = self._array("rotation", wp.quatd, np.tile(turned, (2, 1)))
        self.motion = self._array("motion", wp.vec3d, np.zeros((2 if self.free else 4, 3)))

    def _array(self, name: str, dtype: Any, values: np.ndarray, restart: bool = True, per: str = "body") -> Array:
        return self.context.array(f"{self.name}_{name}", self.name, dtype, values, per=per, restart=restart)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that move the body."""

    def strike(self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any]) -> None:
        """Add the launches of contact with points; `values`: members of the struct of `of`."""
        act, _take = body_contact(of, at_end)
        # Where the step is followed by the next one, the body has already moved on.
        before = {"place": self.place[1:], "rotation": self.rotation[1:], "motion": self.motion[2:]}
        stage.pointwise(
            self.name, act, self.context.sheet.size, late=before if at_end else None, **values
        )  # fmt: skip

    def take(self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any], **when: Any) -> None:
        """Add the launch that applies the impulses of triangles; `when`: options of the launch."""
        _act, take = body_contact(of, at_end)
        stage.pointwise(self.name, take, self.context.sheet.size, **when, **values)

    def found(self) -> dict[str, Array | None]:
        """Arrays of the points in contact with a free body, by their name in the struct of `PointContact`."""
        return dict.fromkeys(("need", "rows", "arms", "slips", "yielded"))

    def free_inertia(self) -> tuple[float, np.ndarray] | None:
        """Mass [kg] and inertia in the body frame [kg m^2], (3, 3); None if the sheet does not move the body."""
        return None

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
        """Add the launch that follows the path; relaxation takes load steps in steps of its clock."""
        phases = (Phase.RIGID_DRIFT,) if self.context.features.dynamic else (Phase.SCHEDULES, Phase.CLOCK)
        if phase in phases:
            clock = self.context.clock
            stage.launch(
                self.name, path_motion(), 1, times=self.knots, places=self.places,
                rotations=self.rotations, time=clock.time, advance=clock.advance, place=self.place,
                rotation=self.rotation, motion=self.motion, early=True,
            )  # fmt: skip


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
        self._sums_given = SUMS if rubs and tracked else SUMS[:-1]
        self.given = self._array("given", wp.float64, np.zeros(len(self._sums_given)))
        assert self.marks is not None
        near = self._near = BlockList(f"{name}_near", name, self.marks, context)

        def room(what: str, dtype: Any, size: Any, per: str = "point") -> Array:
            return context.array(f"{name}_{what}", name, dtype, shape=size, per=per)

        self.changes = room("changes", vec6d, 1, "once")
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
                momenta=self.momenta,
            )  # fmt: skip

    def strike(self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any]) -> None:
        """Add the launches that compute the response of the body to the touching points, and those of contact."""
        kernels = self._kernels(of, at_end)
        if not at_end:
            self._near.add(stage)
        for kernel in (kernels.find, kernels.give_way, kernels.strike):
            self._near.launch(stage, kernel, a=with_values(kernels.struct(), values), body=self._of)

    def take(self, stage: Stage, of: PointContact, at_end: bool, values: Mapping[str, Any], **when: Any) -> None:
        """Add the launch that applies the impulses of triangles."""
        kernels = self._kernels(of, at_end)
        self._near.launch(stage, kernels.take, a=with_values(kernels.struct(), values), body=self._of, **when)

    def _kernels(self, of: PointContact, at_end: bool) -> FreeContact:
        f = self.context.features
        return free_contact(of, f.damped, f.tracked, "slips" in self._found, at_end)

    def found(self) -> dict[str, Array | None]:
        """Arrays of the points in contact."""
        return super().found() | self._found | {"yielded": self.changes}

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
