"""What a part is once it is built on a device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..device.fields import Array
from ..device.launches import Stage
from ..phases import Phase

History = list[dict[str, float]]


@dataclass(frozen=True)
class StepLimit:
    """A longest step [s] and, for messages, why: "in which the ball moves 0.25 spacings"."""

    seconds: float
    reason: str


class BuiltPart(Protocol):
    """A part on a device.

    Attributes:
        label: What messages call it, such as "contact = RigidBall".
    """

    label: str = "part"

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase to a stage; nothing where the part has none."""
        return None

    def begin(self) -> None:
        """Work on the host once, at the start of a run that does not resume another."""
        return None

    def sums(self) -> Mapping[str, Array]:
        """Arrays of the points, float64 or vec3, to be summed up at every frame, by name."""
        return {}

    def column_names(self) -> Sequence[str]:
        """Names of the columns that it adds to the history; no measure may take them."""
        return ()

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Columns of the history at a frame, under the names of `column_names`.

        Args:
            totals: Sums of what all parts gave in `sums`; of a vec3 array under name_x, name_y, name_z.
            elapsed: Time since the last frame [s].
        """
        return {}

    def end_frame(self) -> None:
        """Work on the host after a frame has been recorded."""
        return None

    def step_limit(self) -> StepLimit | None:
        """Longest step that the part allows, or None."""
        return None

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """What a user should know of a run that is over, one line each.

        Args:
            history: One row per frame.
            load_duration: Load time of the whole load in static runs [s]; None in dynamics.
        """
        return []
