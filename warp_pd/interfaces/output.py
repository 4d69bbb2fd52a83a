"""Interfaces of writers of frames and reporters of progress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from .frame import Frame


@runtime_checkable
class Writer(Protocol):
    """Receives the frames of a run, for instance to write them to a file."""

    def write(self, frame: Frame) -> None:
        """Receive one frame."""
        ...

    def save(self) -> None:
        """Flush everything written so far to disk, so that a restart can continue from here."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


@dataclass(frozen=True)
class FrameReport:
    """Data for a reporter at a frame.

    Attributes:
        when: Text for the time, such as "t = 0.5 s".
        fraction: Fraction of the run that is done, 0 to 1.
        steps_per_second: Rate of the steps so far.
        frames: Number of frames of the run.
        row: Row of the history.
    """

    when: str
    fraction: float
    steps_per_second: float
    frames: int
    row: Mapping[str, float]


class Reporter(Protocol):
    """Shows the progress of a run."""

    def begin(self, headline: str) -> None:
        """Called when the simulation is built; `headline` names the scene and the device."""
        ...

    def compiled(self, seconds: float) -> None:
        """Called when the kernels are compiled."""
        ...

    def frame(self, report: FrameReport) -> None:
        """Called when a frame has been recorded."""
        ...

    def residual(self, steps: int, residual: float, tolerance: float, round_of: str) -> None:
        """Called between the frames of a static solver; `round_of` as in "round 2 of contact", or ""."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...
