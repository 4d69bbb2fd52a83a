"""The writers of the files that hold the frames of a run."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..device.checks import InputError
from ..interfaces.frame import Surface
from ..interfaces.output import Writer

FRAMES = "frames.vtkhdf"


def file_writers(
    folder: Path, surface: Surface, *, append_from: int | None, vtkhdf: bool = True,
    fields: Collection[str] | None = None,
) -> list[Writer]:  # fmt: skip
    """Create the writers of the files in a folder; arguments as for `VtkHdfSeries`."""
    writers: list[Writer] = []
    if vtkhdf:
        from .vtkhdf import VtkHdfSeries

        frames = folder / FRAMES
        if append_from is not None and not frames.is_file():
            raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {frames.name}")
        writers.append(VtkHdfSeries(frames, surface, append_from=append_from, fields=fields))
        if surface.bodies:
            from .body_frames import BodySeries

            writers.append(BodySeries(folder / "bodies.vtkhdf", surface, append_from=append_from))
    return writers
