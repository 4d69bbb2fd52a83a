"""The formats that a run writes frames in."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..device.checks import InputError
from ..interfaces import Writer
from ..interfaces.frame import Surface


def file_writers(
    folder: Path, surface: Surface, *, usd: bool, seconds_per_frame: float | None, append_from: int | None,
    vtkhdf: bool = True, fields: Collection[str] | None = None,
) -> list[Writer]:  # fmt: skip
    """Writers of the files in a folder.

    Args:
        folder: The folder of the run.
        surface: The reference surface.
        usd: Whether to write animation.usd.
        seconds_per_frame: Time between frames [s], if that is always the same.
        append_from: Index of the first frame of a resumed run, or None.
        vtkhdf: Whether to write frames.vtkhdf.
        fields: Names of the point fields of frames.vtkhdf besides the displacement; None: all.

    Raises:
        InputError: if a resumed run has lost its frames.
    """
    writers: list[Writer] = []
    if vtkhdf:
        from .vtkhdf import VtkHdfSeries

        frames = folder / "frames.vtkhdf"
        if append_from is not None and not frames.is_file():
            raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {frames.name}")
        writers.append(VtkHdfSeries(frames, surface, append_from=append_from, fields=fields))
    if usd:
        from .usd import UsdAnimation

        path = folder / "animation.usd"
        if append_from is not None and not path.is_file():
            raise InputError(
                f"resume from {str(folder)!r}: expected a folder that still has its {path.name}; "
                f"go on without it (usd = False, --no-usd)"
            )
        writers.append(UsdAnimation(path, surface, seconds_per_frame=seconds_per_frame, append_from=append_from))
    return writers
