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
        self.label, self.context = label, context
        held = np.where(ignoring(context.held), 0, context.held & HELD)
        self._points = np.flatnonzero(held)
        self._held = (held[self._points, None] >> np.arange(3)) & 1
        # The root process has not the impulses of the others.
        self._impulse = impulse if context.partition is None else None
        self._largest: Array | None = None
        if self._impulse is not None:
            self._largest = context.array(
                f"{name}_held_push", name, wp.float64, shape=len(self._points), per="table", restart=True
            )

    def end_frame(self, elapsed: float) -> None:
        """Look at the impulses of the `elapsed` seconds [s] since the last frame."""
        if self._impulse is None or self._largest is None or elapsed <= 0.0:
            return
        push = np.linalg.norm(self._held * self._impulse.numpy()[self._points].astype(np.float64), axis=1) / elapsed
        self._largest.assign(np.maximum(self._largest.numpy(), push))

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
        if self._largest is None:
            return "may have pushed points"
        total = float(self._largest.numpy()[np.isin(self._points, points)].sum())
        return f"pushed points with up to {total:.3g} N" if total > 0.0 else ""
