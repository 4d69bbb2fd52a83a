"""The writers of the files that hold the frames of a run."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..device.checks import InputError
from ..interfaces.frame import Surface
from ..interfaces.output import Writer

FRAMES = "frames.vtkhdf"


def file_writers(
    folder: Path, surface: Surface, *, usd: bool, seconds_per_frame: float | None, append_from: int | None,
    vtkhdf: bool = True, fields: Collection[str] | None = None,
) -> list[Writer]:  # fmt: skip
    """Create the writers of the files in a folder; arguments as for `VtkHdfSeries` and `UsdAnimation`."""
    writers: list[Writer] = []
    if vtkhdf:
        from .vtkhdf import VtkHdfSeries

        frames = folder / FRAMES
        if append_from is not None and not frames.is_file():
            raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {frames.name}")
        writers.append(VtkHdfSeries(frames, surface, append_from=append_from, fields=fields))
        if surface.bodies or surface.ball_diameter is not None:
            from .body_frames import BodySeries

            writers.append(BodySeries(folder / "bodies.vtkhdf", surface, append_from=append_from))
    if usd:
        from .usd import UsdAnimation

        path = folder / "animation.usd"
        if append_from is not None and not path.is_file():
            raise InputError(
                f"resume from {str(folder)!r}: expected a folder that still has its {path.name}; "
                f"or continue without it (usd = False, --no-usd)"
            )
        writers.append(UsdAnimation(path, surface, seconds_per_frame=seconds_per_frame, append_from=append_from))
    return writers
