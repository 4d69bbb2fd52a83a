"""The files of the frames of a run: the writer that takes each frame, and what is made from its file at the end."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..device.checks import InputError
from ..interfaces.frame import Surface
from ..interfaces.output import Writer

FRAMES, BODIES, ANIMATION = "frames.vtkhdf", "bodies.vtkhdf", "animation.usd"


def frame_writers(
    folder: Path, surface: Surface, append_from: int | None, fields: Collection[str] | None
) -> list[Writer]:
    """Create the writer of the frames in a folder; arguments as for `VtkHdfSeries`."""
    from .vtkhdf import VtkHdfSeries

    if append_from is not None and not (folder / FRAMES).is_file():
        raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {FRAMES}")
    return [VtkHdfSeries(folder / FRAMES, surface, append_from=append_from, fields=fields)]


def write_derived(folder: Path, usd: bool, seconds_per_frame: float | None) -> None:
    """Write what is made from the frames in a folder: the file of the bodies, if there are some, and the animation."""
    from .body_frames import write_bodies

    write_bodies(folder / BODIES, folder / FRAMES)
    if usd:
        from .usd import write_animation

        write_animation(folder / ANIMATION, folder / FRAMES, seconds_per_frame)
