"""Explicit dynamics: central differences with mass damping."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import InputError, count, not_negative, numbers, positive
from .stable_step import StableStep

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built, Simulation

# Iterations of the first estimate of the stable step, and of later ones, made so rarely that they cost
# a few per cent of the steps between them.
FIRST_ITERATIONS = 120
LATER_ITERATIONS = 10
STEPS_BETWEEN = 400
# Power iteration comes to omega_max from below; it was found up to 1.1 % short of it (docs/stability.md).
SHORTFALL = 0.02
# Most that a ball moves in a step, over the spacing or its radius: at more it can pass points unnoticed.
BALL_TRAVEL = 0.25


@dataclass(frozen=True)
class Explicit:
    """Central differences in time, dt a share of the stable step, estimated anew as the sheet stiffens.

    Attributes:
        duration: Time to simulate [s].
        frames: Number of frames after the first one, equally spaced; or their times [s], rising, the last one
            the duration: frames close together show what happens fast.
        damping: Mass damping c [1/s]: a force -c m v on every point.
        safety: dt over the estimated stable step 2 / omega_max. A fast ball makes it shorter: no step lets a ball move
            further than a quarter of a spacing, or of its radius.
        step: A fixed dt [s] instead; refused if it is above either.
    """

    duration: float
    frames: int | Sequence[float] = 100
    damping: float = 0.0
    safety: float = 0.9
    step: float | None = None
    precision: int = 32

    adaptive_damping = False
    in_time = True
    steps_explicitly = True

    def __post_init__(self) -> None:
        positive("duration", self.duration)
        if isinstance(self.frames, Sequence):
            times = numbers("frames", self.frames)
            if times.size == 0 or not (np.diff(times, prepend=0.0) > 0.0).all() or times[-1] != self.duration:
                raise InputError(
                    f"frames = {list(self.frames)!r}: allowed are rising times above 0, the last one the duration, "
                    f"{self.duration!r}"
                )
        else:
            count("frames", self.frames, 1)
        not_negative("damping", self.damping)
        if not 0.0 < positive("safety", self.safety) <= 1.2:
            raise InputError(f"safety = {self.safety!r}: allowed is a share above 0, up to 1.2")
        if self.step is not None:
            positive("step", self.step)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first one."""
        return len(self.frames) if isinstance(self.frames, Sequence) else self.frames

    def frame_time(self, index: int) -> float:
        """Time of a frame [s]; that of frame 0 is 0."""
        if isinstance(self.frames, Sequence):
            return float(self.frames[index - 1]) if index > 0 else 0.0
        return self.duration * index / self.frames

    def check(self, simulation: Simulation) -> None:
        """Nothing: any parts will do."""

    def inertia(self, built: Built) -> Any:
        """The mass [kg]."""
        return built.mass

    def add(self, built: Built) -> None:
        """Add what this solver needs besides the common step."""
        built.stable_step = StableStep(built)

    def add_before_kick(self, built: Built) -> None:
        """Nothing: the damping is constant."""

    def march(self, built: Built, recorder: Recorder) -> str:
        """Run to the end, handing every frame to the recorder; returns the final status."""
        one, ten = built.workspace.sequence("step"), built.workspace.sequence("step", repeat=10)
        since, ball_step = 0, _ball_step(built)
        if recorder.stable_dt is None:
            recorder.stable_dt = self.estimate(built, FIRST_ITERATIONS)
            self._check_step(built, recorder.stable_dt)
        else:
            since = recorder.since_estimate
        for index in range(recorder.frame_index + 1, self.frame_count + 1):
            now, end = self.frame_time(index - 1), self.frame_time(index)
            taken, dt = 0, 0.0
            while now < end:
                if since >= STEPS_BETWEEN:
                    recorder.stable_dt = self.estimate(built, LATER_ITERATIONS)
                    since = 0
                wanted = self.step if self.step is not None else self.safety * recorder.stable_dt
                left = max(1, math.ceil((end - now) / min(wanted, ball_step) * (1.0 - 1e-12)))
                # A frame may be long: a sheet that stiffens within it must not outrun the step.
                steps = left if left <= 2 * STEPS_BETWEEN else STEPS_BETWEEN
                dt = (end - now) / left
                self._set_step(built, dt, now)
                for _ in range(steps // 10):
                    ten.run()
                for _ in range(steps % 10):
                    one.run()
                since += steps
                taken += steps
                now = end if steps == left else now + steps * dt
            recorder.since_estimate = since
            recorder.frame(index, end, taken, dt)
        return "finished"

    def estimate(self, built: Built, iterations: int) -> float:
        """Stable step [s], a bound of it from below; infinite if nothing resists."""
        assert built.stable_step is not None
        omega = built.stable_step.omega(iterations)
        return 2.0 / ((1.0 + SHORTFALL) * omega) if omega > 0.0 else math.inf

    def _check_step(self, built: Built, stable: float) -> None:
        if self.step is not None and self.step > stable:
            raise InputError(f"step = {self.step!r} s: allowed is at most the stable step, {stable:.4g} s")
        if self.step is not None and self.step > _ball_step(built):
            raise InputError(
                f"step = {self.step!r} s: allowed is at most {_ball_step(built):.4g} s, "
                f"in which the ball moves {BALL_TRAVEL} spacings"
            )

    def _set_step(self, built: Built, dt: float, begin: float) -> None:
        built.step.assign(np.array([dt], dtype=built.step.numpy().dtype))
        built.set_clock(dt, self.duration, begin)


def _ball_step(built: Built) -> float:
    """Longest step [s] in which the ball cannot pass points unnoticed; infinite without a ball, or for one at rest."""
    ball = built.simulation.contact
    speed = 0.0 if ball is None else math.hypot(*ball.velocity)
    if ball is None or speed == 0.0:
        return math.inf
    return BALL_TRAVEL * min(built.simulation.sheet.spacing, 0.5 * ball.diameter) / speed
