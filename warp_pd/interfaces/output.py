"""Interface of writers of frames, and what progress shows of a frame."""

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
