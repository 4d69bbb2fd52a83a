"""The clock as a part of the step."""

from __future__ import annotations

from ..context import Context
from ..device.launches import Stage
from ..interfaces import BuiltPart
from ..step import Phase


class Ticking(BuiltPart):
    """Advances the time between the motions and the loads of a step, and evaluates the schedules."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch of the clock, unless a body on a path counts the time."""
        if phase is Phase.CLOCK and self.context.dynamic and self.context.clock.counted_by is not None:
            return
        if phase in (Phase.CLOCK, Phase.SCHEDULES):
            self.context.clock.add_tick(stage, steps=1 if phase is Phase.CLOCK else 0)
