"""The clock: time and schedules on the device."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..kernels.clock import clock
from ..kernels.numeric import Numeric
from .fields import Array, Field, FieldRegister
from .graph import LaunchSequence
from .launches import Stage
from .schedules import Schedule

OWNER = "schedules"


@dataclass(eq=False)
class Clock:
    """Time and schedules of one simulation. Parts register schedules while they are built, then arrays are allocated.

    Attributes:
        duration: Simulated time, or load time at full load [s].
        default_ramp: Schedule of the factor of loads without a schedule; None if these are constant.
        schedules: All schedules.
        scheduled: Current values of all schedules, then values one step later, vec3; None without schedules.
        time: Time [s], one float64; None without schedules.
        advance: Time per step and the last time [s], two float64; None without schedules.
    """

    duration: float
    default_ramp: Schedule | None = None
    schedules: list[Schedule] = field(default_factory=list)
    scheduled: Array | None = None
    time: Array | None = None
    advance: Array | None = None
    _timed: list[str] = field(default_factory=list)

    def register(self, schedule: Schedule | None) -> int | None:
        """Register a schedule and return its index; without a schedule return None."""
        if schedule is None:
            return None
        self.schedules.append(schedule)
        return len(self.schedules) - 1

    def keep_time(self, part: str) -> None:
        """Run the clock for the time alone; of several parts, the one that asks last can count it in a step."""
        self.register(Schedule(np.array([0.0]), np.zeros((1, 3))))
        self._timed.append(part)

    @property
    def counted_by(self) -> str | None:
        """The part that can count the time in a step; None if there are schedules, which the clock evaluates."""
        return self._timed[-1] if 0 < len(self._timed) == len(self.schedules) else None

    def soon(self, index: int) -> int:
        """Entry of `scheduled` with the value of a schedule one step later."""
        return len(self.schedules) + index

    def allocate(self, fields: FieldRegister, types: Numeric) -> None:
        """Copy all schedules to the device; does nothing without schedules."""
        if not self.schedules:
            return
        begins = np.concatenate([[0], np.cumsum([len(s.times) for s in self.schedules])]).astype(np.int32)
        knots = np.concatenate([s.times for s in self.schedules])
        values = np.vstack([s.values for s in self.schedules])
        self._begins = fields.allocate(Field("schedule_begins", OWNER, "table"), wp.int32, begins)
        self._knots = fields.allocate(Field("schedule_knots", OWNER, "table"), wp.float64, knots)
        self._values = fields.allocate(Field("schedule_values", OWNER, "table"), wp.vec3d, values)
        shape = 2 * len(self.schedules)
        self.scheduled = fields.allocate(Field("scheduled", OWNER, "once"), types.vec3, shape=shape)
        self.time = fields.allocate(Field("time", OWNER, "once", restart=True), wp.float64, shape=1)
        self.advance = fields.allocate(Field("advance", OWNER, "once"), wp.float64, np.array([0.0, self.duration]))
        self._tick = clock(types.bits)

    def add_tick(self, stage: Stage, steps: int) -> None:
        """Add the launch that advances time by `steps` steps and evaluates the schedules; none without schedules."""
        if self.scheduled is None:
            return
        stage.launch(
            OWNER, self._tick, 1, side_stream=True,
            advance=self.advance, begins=self._begins, knots=self._knots, values=self._values,
            steps=steps, time=self.time, scheduled=self.scheduled,
        )  # fmt: skip

    def set(self, evaluate: LaunchSequence, advance: float, end: float, now: float | None = None) -> None:
        """Set time per step, end and, unless None, time now [s]; `evaluate` are the launches of SCHEDULES."""
        if self.advance is None or self.time is None:
            return
        self.advance.assign(np.array([advance, end]))
        if now is not None:
            self.time.assign(np.array([now]))
        evaluate.run()
