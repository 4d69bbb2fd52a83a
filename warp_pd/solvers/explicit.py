"""Explicit dynamics: central differences with mass damping."""

from __future__ import annotations

import math
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, count, not_negative, positive
from ..device.fields import assign
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltSolver, DivergedError, FrameSink, StepLimit, System, UnbalancedError
from ..interfaces.solver import FINISHED
from ..step import Phase, explicit_step
from .stepping import FramesInTime, Retries, StableStep, add_motion

# Iterations of the first estimate of the stable step, and of later ones, made so rarely that they cost
# a few per cent of the steps between them.
FIRST_ITERATIONS = 120
LATER_ITERATIONS = 10
STEPS_BETWEEN = 400
# Minimum number of steps in one graph.
MANY = 10
# Step divided by the stable step. Unless bonds can break, any stable step is accurate for slow motion. The ends of a
# breaking bond move within a few steps, and the energy balance of tears needs shorter steps (docs/tearing.md). A slack
# sheet that becomes taut stiffens several times within a few steps, faster than the estimate follows. So does a
# material with an internal variable that begins to unload.
SAFETY, LESS_SAFETY = 0.9, 0.5
# Largest fraction of the velocity that mass damping removes in a step.
MAX_DAMPED = 0.2
# Safety below which it is why a step is short.
SMALL_SAFETY = 0.01
# Power iteration approaches omega_max from below; it was found up to 1.1 % short of it (docs/theory.md).
SHORTFALL = 0.02


@dataclass(frozen=True)
class Explicit(FramesInTime):
    """Central differences in time, with a step that is a fraction of the repeatedly estimated stable step.

    Attributes:
        duration: Simulated time [s].
        frames: Number of equally spaced frames after the first one; or their increasing times [s], the last one equal
            to the duration.
        damping: Mass damping c [1/s]: a force -c m v on every point.
        safety: dt over the estimated stable step 2 / omega_max; by default 0.9, and 0.5 if bonds can break or the
            material goes slack, such as a TensionField, or has an internal variable. A fast ball makes it shorter: no
            step lets a ball move further than a quarter of a spacing, or of its radius; an eighth if bonds can break.
        step: A fixed time step [s] instead; an error is raised if it exceeds either limit.
        history_every: Time between rows of `Result.fine_history` [s], rounded to whole steps; None for no such rows.
            The rows do not change the run. They have energies, losses, contact forces and forces of `Reaction`;
            measures are computed only at frames.
        retries: How many times a frame is computed again, each time with half the step, if the run diverges in it or
            its energy balance changes by more than a hundredth of all energy. The step becomes longer again after some
            frames. 0: never, and no copy of the state is kept. A fixed step is never halved.
    """

    duration: float
    frames: int | Sequence[float] = 100
    damping: float = 0.0
    safety: float | None = None
    step: float | None = None
    history_every: float | None = None
    retries: int = 5
    precision: int = 32

    steps_explicitly: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("duration", self.duration)
        self.check_frames()
        not_negative("damping", self.damping)
        count("retries", self.retries, 0)
        if self.safety is not None and not 0.0 < positive("safety", self.safety) <= 1.2:
            raise InputError(f"safety = {self.safety!r}: expected a number greater than 0 and at most 1.2")
        if self.step is not None:
            positive("step", self.step)
        if self.history_every is not None:
            positive("history_every", self.history_every)

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        return BuiltExplicit(self, context, law)


class BuiltExplicit(BuiltSolver):
    """Explicit dynamics on a device.

    Attributes:
        stable_step: Estimate of the stable step.
    """

    label = "solver = Explicit"
    divides = True
    system: System
    stable_step: StableStep

    def __init__(self, solver: Explicit, context: Context, law: BuiltLaw) -> None:
        self.solver, self.context = solver, context
        self._since_estimate = self._since_row = self._place = 0
        default = LESS_SAFETY if context.layout.breakable or law.goes_slack or context.layout.remembers else SAFETY
        self.safety = default if solver.safety is None else solver.safety

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add drift and kick."""
        add_motion(phase, stage, self.context, self.context.state.mass)

    def prepare(self, system: System) -> None:
        """Compose the step."""
        # Which has the solver.
        self.system: System = weakref.proxy(system)
        step = self.context.stage("step", "every step")
        explicit_step(system, step)
        for part in system.parts:
            part.complete(step)
        self.stable_step = StableStep(system, self.context.state.mass)
        limits = [limit for part in system.parts if (limit := part.step_limit()) is not None]
        if self.solver.damping > 0.0:
            limits.append(StepLimit(MAX_DAMPED / self.solver.damping, "in which damping takes a fifth of the velocity"))
        # The largest eigenvalue of a sum is no larger than the sum of the largest (Weyl).
        added = [(frequency, part.label) for part in system.parts if (frequency := part.added_frequency()) > 0.0]
        self._added, self._stiffest = [frequency for frequency, _ in added], max(added, default=None)
        self._exchanging = [part for part in system.parts if part.interval() is not None]
        if self._exchanging:
            self._interval_seconds = self._exchange_interval()
        repeatable = self.solver.step is None and not self._exchanging
        self.retries = Retries(self.context, step, self.solver.retries if repeatable else 0)
        self._limit = min(limits, key=lambda limit: limit.seconds, default=StepLimit(math.inf, ""))

    def _exchange_interval(self) -> float:
        """Time between exchanges with other simulations [s]; a frame is a whole number of these intervals."""
        if not self.solver.equal_frames:
            raise InputError(f"{self._exchanging[0].label}: expected a number of equally spaced frames, got times")
        frame = self.solver.duration / self.solver.frame_count
        longest = min(part.interval() or math.inf for part in self._exchanging)
        return frame / math.ceil(frame / longest * (1.0 - 1e-12))

    def first_step(self, sink: FrameSink) -> float:
        """Estimate the stable step, and set the step that follows [s]."""
        sink.stable_dt = self.estimate(FIRST_ITERATIONS)
        self._check_step(sink.stable_dt)
        stop = self._stops(0.0, self.solver.frame_time(1))[0]
        step = stop / self._steps_to(stop, sink.stable_dt)
        self._set_step(step, 0.0)
        return step

    def run(self, sink: FrameSink) -> str:
        """Run to the end, passing every frame to the sink; return the final status."""
        self._interval = self.context.stages[self.context.prefix + "step"].interval
        self._ones = [self.context.sequence("step", begin=place) for place in range(self._interval)]
        self._many = self.context.sequence("step", repeat=self._interval * math.ceil(MANY / self._interval))
        for index in range(sink.frame_index + 1, self.solver.frame_count + 1):
            self._frame(index, sink)
        return FINISHED

    def _frame(self, index: int, sink: FrameSink) -> None:
        """Compute and record a frame, with a shorter step if the run diverges."""
        self.retries.keep()
        begun, stable = self._progress(), sink.stable_dt
        taken = 0
        while True:
            steps, dt = self._advance(index, sink)
            taken += steps
            if self._recorded(index, taken, dt, sink):
                return
            self.retries.halve()
            self._resume(begun)
            sink.stable_dt = stable
            sink.repeat()

    def _recorded(self, index: int, taken: int, dt: float, sink: FrameSink) -> bool:
        """Record a frame unless it should be computed again with half the step; return whether it is recorded."""
        now, left = self.solver.frame_time(index), self.retries.left
        try:
            sink.frame(index, now, taken, dt, self.retries.strict)
        except UnbalancedError:
            if not left:
                self.retries.give_up()
                sink.frame(index, now, taken, dt)
            return not left
        except DivergedError:
            if not left:
                raise
            return False
        return True

    def _advance(self, index: int, sink: FrameSink) -> tuple[int, float]:
        """Take the steps up to a frame; their number, and the last one [s]."""
        now, end = self.solver.frame_time(index - 1), self.solver.frame_time(index)
        taken, dt, since = 0, 0.0, self._since_estimate
        for stop in self._stops(now, end):
            for part in self._exchanging:
                part.before_interval(self._interval_seconds)
            while now < stop:
                sink.keep_going()
                if since >= STEPS_BETWEEN:
                    sink.stable_dt = self.estimate(LATER_ITERATIONS)
                    since = 0
                assert sink.stable_dt is not None
                left = self._steps_to(stop - now, sink.stable_dt)
                # Long frames are divided, because a sheet may stiffen within a frame and need a shorter step.
                steps = left if left <= 2 * STEPS_BETWEEN else STEPS_BETWEEN
                dt = (stop - now) / left
                if now + dt == now:
                    raise DivergedError(
                        f"diverged: steps of {dt:.3g} s do not change the time of {now:.6g} s; likely cause: "
                        f"{self.cause_of_step(dt) or 'the sheet has become stiff without bound'}"
                    )
                self._set_step(dt, now)
                self._take(steps, dt, now, sink, taken)
                since += steps
                taken += steps
                now = stop if steps == left else now + steps * dt
            for part in self._exchanging:
                part.after_interval()
        self._since_estimate, self._since_row = since, 0
        return taken, dt

    def _steps_to(self, time: float, stable: float) -> int:
        """Number of equal steps for a time [s], if the stable step is `stable` [s]."""
        wanted = self.solver.step if self.solver.step is not None else self.safety * stable
        longest = math.ldexp(min(wanted, self._limit.seconds), -self.retries.halvings)
        return max(1, math.ceil(time / longest * (1.0 - 1e-12)))

    def _stops(self, now: float, end: float) -> list[float]:
        """Times within a frame at which stepping pauses: its end, and the exchanges before it [s]."""
        if not self._exchanging:
            return [end]
        count = round((end - now) / self._interval_seconds)
        return [*(now + k * self._interval_seconds for k in range(1, count)), end]

    def _take(self, steps: int, dt: float, begin: float, sink: FrameSink, before: int) -> None:
        """Take steps after `before` others of the frame, recording history rows between them if requested."""
        every = self.solver.history_every
        apart = steps + self._since_row if every is None else max(1, round(every / dt))
        taken = 0
        while taken < steps:
            # The repeated stage where it ends before the frame and the next row.
            many = self._place == 0 and min(steps - taken, apart - self._since_row) >= self._many.repeat
            sequence = self._many if many else self._ones[self._place]
            sequence.run()
            taken += sequence.repeat
            sink.stepped(begin + taken * dt, dt, before + taken)
            self._place = (self._place + sequence.repeat) % self._interval
            if every is not None:
                self._since_row += sequence.repeat
                if self._since_row >= apart:
                    self._since_row = 0
                    sink.row(begin + taken * dt, dt)

    def estimate(self, iterations: int) -> float:
        """Estimate the stable step [s]; infinite without stiffness."""
        omega = math.hypot(self.stable_step.omega(iterations), *self._added)
        return 2.0 / ((1.0 + SHORTFALL) * omega) if omega > 0.0 else math.inf

    def cause_of_step(self, dt: float) -> str:
        """What the step follows: a setting, a limit of a part, or a stiffness beside the sheet's."""
        solver, longest = self.solver, dt * 1.01
        if solver.step is not None:
            return f"step = {solver.step:g} was given"
        if solver.safety is not None and solver.safety < SMALL_SAFETY:
            return f"safety = {solver.safety:g} was given"
        if self._limit.seconds <= longest:
            damping = f" (damping = {solver.damping:g})" if solver.damping > 0.0 else ""
            return f"it is the time {self._limit.reason}{damping}"
        if self._stiffest is not None and self.safety * 2.0 / self._stiffest[0] <= 2.0 * longest:
            return f"the stiffness of {self._stiffest[1]}"
        return ""

    def _check_step(self, stable: float) -> None:
        step = self.solver.step
        if step is not None and step > stable:
            raise InputError(f"step = {step!r} s: expected at most the stable step, {stable:.4g} s")
        if step is not None and step > self._limit.seconds:
            raise InputError(f"step = {step!r} s: expected at most {self._limit.seconds:.4g} s, {self._limit.reason}")

    def _set_step(self, dt: float, begin: float) -> None:
        assert self.context.state.step is not None
        assign(self.context.state.step, np.array([dt]))
        self.system.set_clock(dt, self.solver.duration, begin)

    def _progress(self) -> dict[str, Any]:
        """Steps since the last estimate and since the last full stage, and the number of estimates."""
        return {
            "since_estimate": self._since_estimate,
            "place": self._place,
            "estimates": self.stable_step.host_state(),
        }

    def _resume(self, progress: Mapping[str, Any]) -> None:
        """Restore the result of `_progress`."""
        self._since_estimate, self._place = progress["since_estimate"], progress["place"]
        self.stable_step.restore(progress["estimates"])

    def host_state(self) -> dict[str, Any]:
        """Where the steps and estimates are, and how often the step is halved."""
        return {**self._progress(), "retries": self.retries.host_state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        self._resume(state)
        self.retries.restore(state["retries"])
