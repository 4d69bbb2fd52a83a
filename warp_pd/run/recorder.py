"""The recorder: turns the state on the device into frames and rows of the history."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Protocol

from ..device.checks import InputError, kind_and_text, user_code
from ..interfaces import FrameReport, History, Reporter, Writer
from ..interfaces.frame import Frame, format_time
from .built import Built
from .divergence import Soundness
from .energy_balance import balance_error
from .fine_history import FineHistory
from .frame_points import AllPoints, Pictured, snapshot
from .scene import Measure, Outcome

# Restart files of a run, about: each makes the writers bring their files to the disk.
RESTARTS = 40
# Seconds that a frame may take to end after the user asked to stop.
PATIENCE = 5.0


class Joint(Protocol):
    """Writes what every process has a part of; all call the same methods."""

    def write(self, frame: Frame | None) -> None:
        """Write a frame of the own points, where processes have one."""
        ...

    def save(self) -> None:
        """Save the state for a restart."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


@dataclass(eq=False)
class Recorder:
    """Takes frames of a run, checks them, and hands them to the writers; see `interfaces.FrameSink`.

    Attributes:
        built: The simulation.
        writers: Take the frames.
        reporter: Shows progress, or None.
        saved: Called after a frame whose restart file is due; or None.
        kept: Called after every frame, with the history; or None.
        solve: Report of a static solver, or None.
        history: One row per frame.
        last: The last frame, or None.
        step_seconds: Seconds spent in steps.
        fine: Rows between frames, or None.
        stop_asked: Whether the user asked to stop.
        pictured: The points that frames hold.
        joint: Writes frames that every process holds a part of, and their restart files; or None.
    """

    built: Built
    writers: list[Writer]
    reporter: Reporter | None = None
    saved: Callable[[], None] | None = None
    kept: Callable[[History], None] | None = None
    frame_index: int = -1
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0
    stable_dt: float | None = None
    residual: float | None = None
    solve: dict[str, Any] | None = None
    history: History = field(default_factory=list)
    last: Frame | None = None
    step_seconds: float = 0.0
    fine: FineHistory | None = None
    stop_asked: bool = False
    pictured: Pictured = field(init=False)
    joint: Joint | None = None

    def __post_init__(self) -> None:
        """Begin to look at the state."""
        self.soundness = Soundness(self.built)
        self.pictured = AllPoints(self.built)
        if getattr(self.built.simulation.solver, "history_every", None) is not None:
            self.fine = FineHistory(self.built)
        self._clock = self._asked_at = perf_counter()

    def start_clock(self) -> None:
        """Count the seconds of the steps from now on."""
        self._clock = perf_counter()

    def progress(self, steps: int, residual: float, tolerance: float) -> None:
        """Report a static solver on its way; stops it if the user asked for that."""
        if self.built.context.crew.any(self.stop_asked):
            raise KeyboardInterrupt
        if self.reporter is not None:
            self.reporter.residual(steps, residual, tolerance)

    def ask_to_stop(self) -> None:
        """Let the run end at the next frame, or in the middle of a long one."""
        self.stop_asked, self._asked_at = True, perf_counter()

    def row(self, now: float, dt: float) -> None:
        """Keep a row of the finer history."""
        if self.fine is not None:
            self.fine.keep(now, dt)

    def keep_going(self) -> None:
        """End a frame that takes long after the user asked to stop; what it computed is repeated when resumed."""
        if self.built.context.crew.any(self.stop_asked and perf_counter() - self._asked_at > PATIENCE):
            raise KeyboardInterrupt

    def frame(self, index: int, now: float, steps: int, dt: float) -> None:
        """Check the state, hand it to the writers, and save it for a restart.

        Raises:
            DivergedError: if it is NaN or Inf; nothing of it is written.
        """
        crew = self.built.context.crew
        self.stop_asked = crew.any(self.stop_asked)
        self.built.context.run("frame")
        self.step_seconds += perf_counter() - self._clock
        row = crew.lead(lambda: self._look(index, now, dt))
        frame = self.pictured.take(index, now)
        measured = frame if self.pictured.whole or not self.built.simulation.measures else self._whole(index, now)
        for part in self.built.parts:
            part.end_frame()
        crew.lead(lambda: None if row is None else self._judge(measured, row, index, dt))
        if self.joint is not None:
            self.joint.write(frame)
        crew.lead(lambda: None if frame is None or row is None else self._record(frame, row, index, steps, dt))
        if self.joint is not None and self._restart_due(index):
            self.joint.save()
        if self.fine is not None and not crew.leads:
            self.fine.forget()
        self.accept(frame)
        self.frame_index, self.time, self.dt = index, now, dt
        self.start_clock()
        if self.stop_asked:
            raise KeyboardInterrupt

    def _look(self, index: int, now: float, dt: float) -> dict[str, float]:
        """The row of the history without measures, of a state that is sound."""
        built = self.built
        totals = built.sums.totals()
        self.soundness.stable_dt = self.stable_dt
        self.soundness.require_finite(index, now, dt, totals)
        if self.fine is not None:
            self.fine.end_frame(now, dt, totals, self.time)
        return self._row(now, totals, now - self.time, dt)

    def _whole(self, index: int, now: float) -> Frame | None:
        """A frame of all points, for measures, in the first process."""
        return self.built.context.crew.lead(lambda: snapshot(AllPoints(self.built), index, now))

    def _judge(self, frame: Frame | None, row: dict[str, float], index: int, dt: float) -> None:
        """Measure, and refuse a frame that holds more energy than was put in."""
        if frame is not None:
            self._measure(frame, row)
        self.soundness.require_no_gain(row, index, dt)

    def _record(self, frame: Frame, row: dict[str, float], index: int, steps: int, dt: float) -> None:
        """Hand a frame to the writers, and save it for a restart."""
        self.history.append(row)
        self.frame_index, self.time, self.dt = index, frame.time, dt
        self.steps += steps
        for writer in self.writers:
            writer.write(frame)
        self.accept(frame)
        if self.kept is not None:
            self.kept(self.history)
        if self.saved is not None and self._restart_due(index):
            self.saved()
        if self.reporter is not None:
            self.reporter.frame(self._report(row))

    def _report(self, row: dict[str, float]) -> FrameReport:
        scene = self.built.simulation
        rate = self.steps / self.step_seconds if self.step_seconds > 0.0 else 0.0
        share = min(1.0, self.time / scene.solver.duration)
        when = format_time(self.time, scene.load_duration)
        return FrameReport(when, share, rate, scene.solver.frame_count, row)

    def accept(self, frame: Frame | None) -> None:
        """Take a sound frame as the last one; None where another process has it."""
        if frame is not None:
            self.last, self.soundness.last_time = frame, frame.time

    def _restart_due(self, index: int) -> bool:
        """At the first and last frame, when the user stops the run, and some forty times in between."""
        frames = self.built.simulation.solver.frame_count
        return self.stop_asked or index in (0, frames) or index % max(1, frames // RESTARTS) == 0

    def _row(self, now: float, totals: dict[str, float], elapsed: float, dt: float) -> dict[str, float]:
        built = self.built
        row: dict[str, float] = {"time": now, "step": dt}
        row |= built.energy.columns(totals, elapsed)
        if "rupture" in row:
            row["balance_error"] = balance_error(self.history, row)
        for part in built.parts:
            for name, value in part.columns(totals, elapsed).items():
                if name in row:
                    raise InputError(f"history: two parts report {name!r}: expected one")
                row[name] = value
        return row

    def _measure(self, frame: Frame, row: dict[str, float]) -> None:
        """Add what the scene measures to a row."""
        built = self.built
        if built.simulation.measures:
            frame = frame.in_double()
        for measure in built.simulation.measures:
            reported = number_of(measure, built, frame)
            row[measure.name] = math.nan if reported is None else reported


def number_of(item: Measure | Outcome, *arguments: Any) -> float | None:
    """What the function of a reported number gives.

    Raises:
        InputError: if it raises, or gives neither a number nor None.
    """
    what = f"{type(item).__name__} {item.name!r}"
    with user_code(lambda error: f"{what}: {kind_and_text(error)}"):
        value = item.value(*arguments)
    try:
        return None if value is None else float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} gives {value!r}: expected a number") from None
