"""Times of the frames of solvers that step in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..device.checks import InputError, count, numbers
from ..device.schedules import Schedule


class FramesInTime:
    """Base class of solvers with the attributes `duration` [s], `frames` (their number or times [s]), `damping`."""

    duration: float
    frames: int | Sequence[float]
    damping: float

    dynamic: ClassVar[bool] = True
    default_ramp: ClassVar[Schedule | None] = None

    def check_frames(self) -> None:
        """Check the number or times of the frames."""
        if isinstance(self.frames, Sequence):
            times = numbers("frames", self.frames)
            if times.size == 0 or not (np.diff(times, prepend=0.0) > 0.0).all() or times[-1] != self.duration:
                raise InputError(
                    f"frames = {list(self.frames)!r}: expected increasing times greater than 0, the last one equal to "
                    "the duration, "
                    f"{self.duration!r}"
                )
        else:
            count("frames", self.frames, 1)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first one."""
        return len(self.frames) if isinstance(self.frames, Sequence) else self.frames

    @property
    def equal_frames(self) -> bool:
        """Whether the frames are equally spaced."""
        return self.frame_count == 1 or not isinstance(self.frames, Sequence)

    @property
    def mass_damping(self) -> float | None:
        """The damping, unless it is zero [1/s]."""
        return self.damping if self.damping > 0.0 else None

    def frame_time(self, index: int) -> float:
        """Time of a frame [s]; frame 0 is at time 0."""
        if isinstance(self.frames, Sequence):
            return float(self.frames[index - 1]) if index > 0 else 0.0
        return self.duration * index / self.frames
