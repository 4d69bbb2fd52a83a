"""The push of a body along components of points that supports hold, which forces of supports leave out in steps."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..context import Context
from ..device.fields import Array
from ..interfaces import HELD
from .body_checks import ignoring


class HeldPush:
    """The largest push that each point got along its held components, and the note on forces of supports without it.

    Contact in steps is by impulses, which are in no force on a point.
    """

    def __init__(self, name: str, label: str, context: Context, impulse: Array | None) -> None:
        """`impulse` is that of the body on each point since the last frame [N s], None for a free body."""
        self.label, self.context, self._impulse = label, context, impulse
        held = np.where(ignoring(context.held), 0, context.held & HELD)
        self._points = np.flatnonzero(held)
        self._held = (held[self._points, None] >> np.arange(3)) & 1
        self._largest: Array | None = None
        if impulse is not None:
            n = context.sheet.size
            self._largest = context.array(f"{name}_held_push", name, wp.float64, shape=n, restart=True)
            # Time of the last frame [s]: processes but the root do not know it otherwise.
            self._last = context.array(f"{name}_last_frame", name, wp.float64, shape=1, per="once", restart=True)

    def end_frame(self) -> None:
        """Look at the impulses since the last frame."""
        time = self.context.clock.time
        if self._impulse is None or self._largest is None or time is None:
            return
        now = time.numpy()
        elapsed = float(now[0] - self._last.numpy()[0])
        self._last.assign(now)
        if elapsed > 0.0:
            impulse = self._impulse.numpy()[self._points].astype(np.float64)
            largest = self._largest.numpy()
            largest[self._points] = np.maximum(
                largest[self._points], np.linalg.norm(self._held * impulse, axis=1) / elapsed
            )
            self._largest.assign(largest)

    def notes(self) -> list[str]:
        """A note if a `Reaction` or a measure gives the force of supports on points that the body may have pushed."""
        found = {name: self._pushed(points) for name, points in self.context.support_readers.items() if len(points)}
        return [
            f"{self.label} {pushed} along components that a support holds: {name} leaves that out; static solvers and "
            "Implicit count it"
            for name, pushed in found.items()
            if pushed
        ]

    def _pushed(self, points: np.ndarray) -> str:
        """How much it pushed these points, in words; "" if it did not."""
        # The root process has not the numbers of the others at the end of a run.
        if self._largest is None or self.context.partition is not None:
            return "may have pushed points"
        total = float(self._largest.numpy()[points].sum())
        return f"pushed points with up to {total:.3g} N" if total > 0.0 else ""
