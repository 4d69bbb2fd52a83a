"""Rows of the history between frames: sums that the device keeps until the host reads them at the next frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..device.checks import InputError
from ..device.fields import Array
from ..interfaces import History
from .built import Built
from .scene import Scene


def with_fine_history(scene: Scene, every: float) -> Scene:
    """A scene whose solver records rows between frames.

    Args:
        scene: The scene.
        every: Time between rows [s].

    Raises:
        InputError: for a solver whose frames are its rows, or a time that is not above zero.
    """
    solver: Any = scene.solver
    if not hasattr(solver, "history_every"):
        raise InputError(f"history_every = {every!r}: expected the solver Explicit, got {type(solver).__name__}")
    return replace(scene, solver=replace(solver, history_every=every))


class FineHistory:
    """Rows of one run.

    Attributes:
        rows: Rows so far, those at frames among them.
    """

    def __init__(self, built: Built) -> None:
        self.built, self.rows = built, History()
        self._waiting: list[tuple[float, float, Array]] = []

    def keep(self, now: float, dt: float) -> None:
        """Keep the sums at a time [s], after a step of dt [s], on the device."""
        # The row at a frame comes from the frame.
        self.built.context.run("frame")
        self._waiting.append((now, dt, self.built.sums.keep()))

    def end_frame(self, now: float, dt: float, totals: dict[str, float], begin: float) -> None:
        """Read the rows since the last frame, at the time `begin` [s], and add that of this one."""
        before: dict[str, float] = {}
        kept = [(time, step, self.built.sums.totals(sums)) for time, step, sums in self._waiting]
        self._waiting = []
        last = now * (1.0 - 1e-12)
        for time, step, found in [*(row for row in kept if row[0] < last), (now, dt, totals)]:
            row: dict[str, float] = {"time": time, "step": step}
            for part in (self.built.energy, *self.built.parts):
                row |= part.row_columns(before, found, time - begin)
            self.rows.append(row)
            before, begin = found, time

    def forget(self) -> None:
        """Drop the rows since the last frame: another process reads them."""
        self._waiting = []

    def resume(self, rows: History, now: float) -> None:
        """Take the rows of a run that goes on from a time [s]."""
        self.rows = [row for row in rows if row["time"] <= now * (1.0 + 1e-12)]
