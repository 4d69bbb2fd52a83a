"""Frames for pictures, read from the file of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..geometry.triangulation import joined_points
from ..interfaces.frame import format_time
from ..output.point_fields import FrameFields
from ..output.vtkhdf import read_frame, read_outlines, read_series

# Fraction of the points, at either end of each direction, that may be far from the others.
FAR = 0.01


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame with the data for pictures.

    Attributes:
        when: Time or load factor as text.
        points: Deformed positions [m], shape (N, 3).
        reference: Reference positions [m], shape (N, 3).
        triangles: Intact triangles, shape (F, 3).
        fields: Point fields by name; u is the size of the displacement, u1, u2, u3 are its components, and
            NAME_1, NAME_2, NAME_3 those of any other vector field NAME. "stress" is the largest principal one,
            Cauchy's if there is one; "thickness" is that over the stress-free one of a material of constant volume.
            Pieces are displaced from where they were placed, which is where they are in the first frame.
        bodies: Vertices [m] and triangles of rigid bodies.
        balls: Centres [m], shape (3,), and diameters [m] of those that are spheres.
        scene: Name of the scene.
        regions: Points of each region with another material, whose outline is drawn.
        held: Points that supports hold or move.
    """

    when: str
    points: np.ndarray
    reference: np.ndarray
    triangles: np.ndarray
    fields: dict[str, np.ndarray]
    bodies: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    balls: Sequence[tuple[np.ndarray, float]] = ()
    scene: str = ""
    regions: Sequence[np.ndarray] = ()
    held: Sequence[int] | np.ndarray = ()

    @cached_property
    def framed(self) -> np.ndarray:
        """Points that a picture and its colours have to show.

        They are those of intact triangles, without pieces that no support holds, if there are supports, and without the
        few that are further from the others than the size of all others.
        """
        if not len(self.triangles):
            return np.arange(len(self.points))
        used = np.unique(self.triangles)
        piece = joined_points(len(self.points), self.triangles)
        held = np.intersect1d(used, np.asarray(self.held, int))
        if len(held):
            used = used[np.isin(piece[used], piece[held])]
        places = self.points[used]
        low, high = np.quantile(places, [FAR, 1.0 - FAR], axis=0)
        room = float((high - low).max())
        near = ((places >= low - room) & (places <= high + room)).all(axis=1)
        return np.asarray(used[near])


def frames_at(folder: Path, times: Sequence[float]) -> list[Shown]:
    """The frames of `folder`/frames.vtkhdf nearest to the given times [s], each at most once."""
    path = folder / "frames.vtkhdf"
    series = read_series(path)
    indices = sorted({int(np.argmin(np.abs(np.asarray(series.times) - t))) for t in times})
    load_duration = series.metadata.get("load_duration")
    placed = read_frame(path, 0)[3]["displacement"] if "pieces" in series.metadata else np.zeros(3, np.float32)
    return [_shown(path, index, load_duration, str(series.metadata.get("scene", "")), placed) for index in indices]


def _shown(path: Path, index: int, load_duration: float | None, scene: str, placed: np.ndarray) -> Shown:
    time, points, triangles, fields = read_frame(path, index)
    moved = fields["displacement"] - placed
    fields |= {"u": np.linalg.norm(moved, axis=1), "u1": moved[:, 0], "u2": moved[:, 1], "u3": moved[:, 2]}
    for name in [n for n, values in fields.items() if values.ndim == 2 and n != "displacement"]:
        for c in range(fields[name].shape[1]):
            fields[f"{name}_{c + 1}"] = fields[name][:, c]
    for name in ("cauchy_1", "first_piola_1", "principal_stress_1"):
        if name in fields:
            fields.setdefault("stress", fields[name])
    if {"stretch_1", "stretch_2"} <= set(fields):
        with np.errstate(divide="ignore", invalid="ignore"):
            fields.setdefault("thickness", 1.0 / (fields["stretch_1"] * fields["stretch_2"]))
    outlines = [(body, poses[index]) for body, poses in read_outlines(path)]
    return Shown(
        when=format_time(time, load_duration),
        points=points,
        reference=points - fields["displacement"],
        triangles=triangles,
        fields=FrameFields(fields),
        bodies=[(body.placed(pose), body.triangles) for body, pose in outlines],
        balls=[(pose[:3], 2.0 * body.sizes[0]) for body, pose in outlines if body.kind == "sphere"],
        scene=scene,
    )
