"""What every part is on a device: the launches that it adds, its columns of the history, its limits and notes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from ..device.fields import Array
from ..device.launches import Stage
from ..step import Phase
from .scales import Scales

History = list[dict[str, float]]


@dataclass(frozen=True)
class StepLimit:
    """A maximum step [s] and the reason, for messages, such as "in which the ball moves 0.25 spacings"."""

    seconds: float
    reason: str


def _no_values(*of: object) -> dict[str, float]:
    return {}


@dataclass(frozen=True, eq=False)
class Columns:
    """What a part adds to the history.

    Attributes:
        names: Names of its columns besides energies, which measures must not use.
        at_frame: (totals, elapsed) -> values of these columns at a frame, by name. `totals` are the sums of all parts,
            `elapsed` is the time since the last frame [s].
        between: (before, totals, elapsed) -> values in a row between frames, computed only from sums: those at the
            previous row (empty at the first row after a frame) and at this one, and the time between the two [s].
        units: SI units of its columns, by name, as far as known.
        sums: Point arrays (float64 or vec3) to sum at every frame, by name; a vec3 array has the sums name_x, name_y,
            name_z.
        stored: Energy that the part stores now [J], by column: (N,) float64 arrays, summed at every frame. The history
            shows these columns, and the energy balance counts them.
        lost: Energy lost to the part since the start of the run [J], likewise.
    """

    names: Sequence[str] = ()
    at_frame: Callable[[Mapping[str, float], float], dict[str, float]] = _no_values
    between: Callable[[Mapping[str, float], Mapping[str, float], float], dict[str, float]] = _no_values
    units: Mapping[str, str] = field(default_factory=dict)
    sums: Mapping[str, Array] = field(default_factory=dict)
    stored: Mapping[str, Array] = field(default_factory=dict)
    lost: Mapping[str, Array] = field(default_factory=dict)


class BuiltPart(Protocol):
    """A part on a device.

    Attributes:
        label: Name of the part in messages, such as "contact = RigidBall".
    """

    label: str = "part"

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase to a stage, if the part has any."""
        return None

    def complete(self, step: Stage) -> None:
        """Do host work that needs all launches of an explicit step, once it is composed."""
        return None

    def begin(self) -> None:
        """Do host work once, at the start of a run that does not resume another."""
        return None

    def columns(self) -> Columns:
        """What the part adds to the history; asked once, when all parts are built."""
        return Columns()

    def end_frame(self) -> None:
        """Do host work after a frame has been recorded."""
        return None

    def step_limit(self) -> StepLimit | None:
        """Maximum step that the part allows, or None."""
        return None

    def interval(self) -> float | None:
        """Longest time between two exchanges with another simulation [s], which steps by itself; None without one."""
        return None

    def before_interval(self, seconds: float) -> None:
        """Let the other simulation take a step of `seconds`, the same each time, before the sheet does."""
        return None

    def after_interval(self) -> None:
        """Take from the sheet what the next step of the other simulation needs."""
        return None

    def added_frequency(self) -> float:
        """Upper bound of the frequency of forces that begin later, such as contact, for the stable step [rad/s]."""
        return 0.0

    def doubts(self, scales: Scales) -> Sequence[str]:
        """Sizes that cannot be meant and that only the built part knows, for a note; by default none."""
        return ()

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes for the user on a finished run, one line each.

        Args:
            history: One row per frame.
            load_duration: Load time of the full load in static runs [s]; None in dynamics.
        """
        return []
