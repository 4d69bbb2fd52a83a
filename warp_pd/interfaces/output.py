"""Writers of frames, and reporters of progress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from ..frame import Frame


class Writer(Protocol):
    """Looks at frames from outside; the simulation does not know what becomes of them."""

    def write(self, frame: Frame) -> None:
        """Take one frame."""
        ...

    def save(self) -> None:
        """Bring everything written so far to the disk, so that a restart can go on from here."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


@dataclass(frozen=True)
class FrameReport:
    """What a reporter is told at a frame.

    Attributes:
        when: Words for when it is, such as "t = 0.5 s".
        share: Part of the run that is done, 0 to 1.
        steps_per_second: Rate of the steps so far.
        frames: Number of frames of the run.
        row: Row of the history.
    """

    when: str
    share: float
    steps_per_second: float
    frames: int
    row: Mapping[str, float]


class Reporter(Protocol):
    """Shows the progress of a run."""

    def begin(self, headline: str) -> None:
        """The simulation is built; `headline` says what runs where."""
        ...

    def compiled(self, seconds: float) -> None:
        """Its kernels are compiled."""
        ...

    def frame(self, report: FrameReport) -> None:
        """A frame has been recorded."""
        ...

    def residual(self, steps: int, residual: float, tolerance: float) -> None:
        """A static solver on its way."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...
