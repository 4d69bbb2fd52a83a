"""The files of the frames of a run: the writer that takes each frame, and what is made from its file at the end."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np

from ..device.checks import InputError
from ..interfaces.frame import Frame, Surface

FRAMES, BODIES, ANIMATION = "frames.vtkhdf", "bodies.vtkhdf", "animation.usd"


def frame_writer(
    folder: Path, surface: Surface, append_from: int | None, fields: Collection[str] | None
) -> Callable[[Frame], None]:
    """Create the function that writes frames in a folder; arguments as for `VtkHdfSeries`."""
    from .vtkhdf import VtkHdfSeries

    if append_from is not None and not (folder / FRAMES).is_file():
        raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {FRAMES}")
    return VtkHdfSeries(folder / FRAMES, surface, append_from=append_from, fields=fields).write


def write_derived(folder: Path, usd: bool, seconds_per_frame: float | None) -> None:
    """Write what is made from the frames in a folder: the file of the bodies, if there are some, and the animation."""
    write_bodies(folder / BODIES, folder / FRAMES)
    if usd:
        from .usd import write_animation

        write_animation(folder / ANIMATION, folder / FRAMES, seconds_per_frame)


def write_bodies(path: Path, frames: Path) -> None:
    """Write the outlines of the bodies in a file of frames, frame by frame, as `VtkHdfSeries` writes the sheet.

    The point field `body` is the index of the body, in the order of the scene. Without bodies there is no file.
    """
    from .vtkhdf import VtkHdfSeries, read_outlines, read_series

    info, outlines = read_series(frames), read_outlines(frames)
    if not outlines:
        return
    first = np.cumsum([0, *(len(body.vertices) for body, _ in outlines)])
    points = np.concatenate([body.vertices for body, _ in outlines])
    field = {"body": np.repeat(np.arange(len(outlines)), np.diff(first))}
    title, names = info.metadata.pop("title"), ", ".join(body.name for body, _ in outlines)
    faces = np.concatenate([body.triangles + n for (body, _), n in zip(outlines, first, strict=False)])
    surface = Surface(points, faces, f"bodies of {title}", {**info.metadata, "bodies": names})
    series = VtkHdfSeries(path, surface, fields=("body",))
    for index, time in enumerate(info.times):
        moved = np.concatenate([body.placed(poses[index]) for body, poses in outlines]) - points
        series.write(Frame(index, float(time), moved, np.zeros_like(moved), point_data=field))
