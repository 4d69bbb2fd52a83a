"""How long a run will take on this machine: its first steps, timed and thrown away."""

from __future__ import annotations

from time import perf_counter

from ..interfaces import DivergedError, FrameSink
from ..run.built import Built
from ..run.checks import TIMED, step_note, steps_text


class _EnoughError(Exception):
    """Ends the short run that tells how long a whole one takes."""


class _Trial(FrameSink):
    """Counts steps against the clock, from the first report on."""

    def __init__(self) -> None:
        self._before, self._begun = 0, (0, perf_counter())
        self.counted, self.seconds, self._reports = 0, 0.0, 0

    def frame(self, index: int, now: float, steps: int, dt: float, strict: bool = False) -> None:
        """Take over the steps of a frame."""
        self._count(steps)
        self._before += steps
        self.frame_index, self.time = index, now

    def stepped(self, now: float, dt: float, steps: int) -> None:
        """Count the steps of a frame so far."""
        self._count(steps)

    def _count(self, steps: int) -> None:
        done, clock = self._before + steps, perf_counter()
        self._reports += 1
        if self._reports == 2:
            # The first steps measure on how many cores their launches run.
            self._begun = (done, clock)
        self.counted, self.seconds = done - self._begun[0], clock - self._begun[1]
        if self._reports > 2 and self.seconds > TIMED:
            raise _EnoughError


def foretold(built: Built) -> str:
    """Step, number of steps, time on this machine and memory of a run in time, and what is known of its step.

    The simulation is of no use afterwards; "" for static solvers.
    """
    solver = built.simulation.solver
    if not solver.dynamic:
        return ""
    context, trial = built.context, _Trial()
    context.compile()
    for stage in ("start", "setup"):
        context.run(stage)
    for part in built.parts:
        part.begin()
    try:
        dt = built.solver.first_step(trial)
        built.solver.run(trial)
    except _EnoughError:
        pass
    except DivergedError as error:
        return str(error)
    rate = trial.counted / trial.seconds if trial.counted and trial.seconds > 0.0 else None
    note = step_note(built, dt)
    return steps_text(built, dt, rate) + (f"\n{note}" if note else "")
