"""Time and schedules, the piecewise linear functions of time, on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..kernels.integrate import clock
from ..kernels.numeric import Numeric
from .checks import InputError, vector
from .fields import Array, Field, FieldRegister
from .graph import LaunchSequence
from .launches import Stage


@dataclass(frozen=True, eq=False)
class Schedule:
    """A piecewise linear function of time, constant before its first and after its last knot.

    Attributes:
        times: Knots [s], increasing, shape (K,).
        values: Values at the knots, shape (K, 3).
        name: What it is of, for messages.
    """

    times: np.ndarray
    values: np.ndarray
    name: str = ""

    def at(self, time: float) -> np.ndarray:
        """Values at a time [s], shape (3,)."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        if k < 0 or k + 1 == len(self.times):
            return np.array(self.values[max(k, 0)])
        slope = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
        return np.asarray(self.values[k] + slope * (time - self.times[k]))

    def repeated(self, number: int) -> Schedule:
        """The same from its first to its last time, so often one after the other.

        Raises:
            InputError: if its values at the last time are not those at the first.
        """
        if number == 1:
            return self
        first, last = self.values[0], self.values[-1]
        if len(self.times) < 2 or np.abs(last - first).max() > 1e-12 * np.abs(self.values).max():
            raise InputError(
                f"{self.name}.repeat = {number}: expected the values of the first time at the last time, got "
                f"{first.tolist()} and {last.tolist()}"
            )
        cycle = self.times[1:] - self.times[0]
        times = np.concatenate([self.times[:1], *(self.times[0] + n * cycle[-1] + cycle for n in range(number))])
        return Schedule(times, np.concatenate([self.values[:1], np.tile(self.values[1:], (number, 1))]), self.name)

    def changes_after(self, time: float) -> bool:
        """Whether its values change after a time [s]."""
        later = self.values[self.times > time * (1.0 + 1e-9)]
        return bool((later != self.at(time)).any())

    @property
    def shortest_change(self) -> float:
        """Shortest time between knots of different values [s]; infinite if the values are constant."""
        changes = (np.diff(self.values, axis=0) != 0.0).any(axis=1)
        return float(np.diff(self.times)[changes].min(initial=np.inf))

    def top_speed(self, time: float) -> float:
        """Largest rate of change up to a time [1/s]."""
        rates = np.diff(self.values, axis=0) / np.diff(self.times)[:, None]
        return float(np.linalg.norm(rates[self.times[:-1] < time], axis=1).max(initial=0.0))

    def largest_jump(self, end: float, from_rest: bool = True) -> tuple[float, float]:
        """Largest jump of the rate of change before `end` [1/s], to rest at the last time, and its time [s].

        Without `from_rest` neither the first time counts nor any up to 0.
        """
        rates = np.diff(self.values, axis=0) / np.diff(self.times)[:, None]
        jumps = np.linalg.norm(np.diff(rates, axis=0, prepend=0.0, append=0.0), axis=1)
        jumps = np.where(self.times < end * (1.0 - 1e-9), jumps, 0.0)
        if not from_rest:
            jumps = np.where(self.times > max(self.times[0], 0.0), jumps, 0.0)
        return float(jumps.max()), float(self.times[jumps.argmax()])


def schedule(name: str, times: np.ndarray, values: np.ndarray) -> Schedule:
    """Create a schedule from checked times, shape (K,), and values, shape (K, 3)."""
    if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
        raise InputError(f"{name} times = {times.tolist()}: expected one or more increasing times")
    return Schedule(times, values, name)


def proportional(duration: float) -> Schedule:
    """The factor of a load that grows with the load factor, 0 to 1 over a load time [s]."""
    return Schedule(np.array([0.0, duration]), np.repeat([[0.0], [1.0]], 3, axis=1))


def factor_schedule(name: str, ramp: Sequence[tuple[float, float]] | None) -> Schedule | None:
    """Schedule of a factor from pairs (time, factor); None, for a constant load, stays None."""
    if ramp is None:
        return None
    try:
        pairs = np.array([vector(f"{name} ramp", pair, 2) for pair in ramp])
    except TypeError:
        raise InputError(f"{name} ramp = {ramp!r}: expected pairs (time, factor)") from None
    if len(pairs) == 0:
        raise InputError(f"{name} ramp = {ramp!r}: expected at least one pair (time, factor)")
    return schedule(f"{name} ramp", pairs[:, 0], np.repeat(pairs[:, 1:], 3, axis=1))


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

    def factor(self, index: int | None) -> float:
        """The present first value of a schedule, 1 without one."""
        return 1.0 if index is None or self.scheduled is None else float(self.scheduled.numpy()[index, 0])

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
