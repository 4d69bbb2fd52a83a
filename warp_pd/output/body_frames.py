"""Rigid bodies of a run in one VTKHDF file, which ParaView can show together with the sheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..interfaces.frame import Frame, Surface
from .vtkhdf import VtkHdfSeries, read_outlines, read_series


def write_bodies(path: Path, frames: Path) -> None:
    """Write the outlines of the bodies in a file of frames, frame by frame, as `VtkHdfSeries` writes the sheet.

    The point field `body` is the index of the body, in the order of the scene. Without bodies there is no file.
    """
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
