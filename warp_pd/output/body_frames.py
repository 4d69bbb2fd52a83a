"""Rigid bodies of a run in one VTKHDF file, which ParaView can show together with the sheet."""

from __future__ import annotations

import os

import numpy as np

from ..interfaces.frame import Frame, Surface
from .vtkhdf import VtkHdfSeries

FILE = "bodies.vtkhdf"


class BodySeries:
    """Writes the outlines of bodies, frame by frame, as `VtkHdfSeries` writes the sheet.

    The point field `body` is the index of the body, in the order of the scene.
    """

    def __init__(self, path: str | os.PathLike[str], surface: Surface, *, append_from: int | None = None) -> None:
        """Begin or continue a file, as `VtkHdfSeries`; the surface has at least one body."""
        self._bodies = surface.bodies
        first = np.cumsum([0, *(len(body.vertices) for body in self._bodies)])
        self._body = np.repeat(np.arange(len(self._bodies)), np.diff(first))
        drawn = Surface(
            points=np.concatenate([body.vertices for body in self._bodies]),
            faces=np.concatenate([body.triangles + n for body, n in zip(self._bodies, first, strict=False)]),
            title=f"bodies of {surface.title}",
            metadata={**surface.metadata, "bodies": ", ".join(body.name for body in self._bodies)},
        )
        self._series = VtkHdfSeries(path, drawn, append_from=append_from, fields=("body",))

    def write(self, frame: Frame) -> None:
        """Add the bodies of the next frame."""
        assert frame.bodies is not None
        placed = np.concatenate([body.placed(pose) for body, pose in zip(self._bodies, frame.bodies, strict=True)])
        moved = placed - self._series.surface.points
        self._series.write(Frame(frame.index, frame.time, moved, np.zeros_like(moved), point_data={"body": self._body}))

    def save(self) -> None:
        """Do nothing, because every frame is already on disk."""

    def close(self) -> None:
        """Nothing to do, as for `save`."""
