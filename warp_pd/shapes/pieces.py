"""Shapes that consist of several pieces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..device.checks import InputError, finite, vector
from ..geometry.sheet import Shape, edge_names
from ..geometry.triangulation import moved_cut

# Gap between pieces that lie side by side, in spacings of the wider one.
GAP = 4.0


@dataclass(frozen=True)
class Place:
    """Initial placement of a piece: rotated about its origin, then shifted.

    Attributes:
        offset: Shift [m].
        axis: Axis of the rotation [-].
        degrees: Angle of the rotation, counter-clockwise about the axis.

    Raises:
        InputError: if a vector does not have three finite components, the axis is zero, or the angle is not finite.
    """

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    degrees: float = 0.0

    def __post_init__(self) -> None:
        """Check the vectors and the angle."""
        finite("Place.degrees", self.degrees)
        vector("Place.offset", self.offset, 3)
        if not np.linalg.norm(vector("Place.axis", self.axis, 3)) > 0.0:
            raise InputError(f"Place.axis = {self.axis!r}: expected a nonzero vector")

    def of(self, positions: np.ndarray) -> np.ndarray:
        """Positions [m], shape (N, 3), after the rotation and the offset."""
        from scipy.spatial.transform import Rotation

        axis = np.asarray(self.axis, float)
        turn = Rotation.from_rotvec(np.deg2rad(self.degrees) * axis / np.linalg.norm(axis))
        return np.asarray(turn.apply(positions) + np.asarray(self.offset, float))


def side_by_side(shapes: Sequence[Shape]) -> Shape:
    """Join shapes as pieces side by side along x.

    Names of parts are prefixed with the piece, such as "sheet 1 outline"; "sheet 1" is the set of all its points.
    """
    if len(shapes) < 2:
        raise InputError(f"sheets: expected two or more sheets, got {len(shapes)}")
    curved = shapes[0].frames is not None
    for index, shape in enumerate(shapes):
        if (shape.frames is not None) != curved:
            kind, expected = ("flat", "curved") if curved else ("curved", "flat")
            raise InputError(f"sheets[{index}] is {kind}: expected {expected}, like sheets[0]")
        if shape.pieces is not None or len(shape.triangles) == 0:
            raise InputError(f"sheets[{index}]: expected a sheet with one piece and with triangles")
    widest = max(shape.spacing for shape in shapes)
    moves = np.zeros((len(shapes), shapes[0].points.shape[1]))
    for k in range(1, len(shapes)):
        right = shapes[k - 1].points[:, 0].max() + moves[k - 1, 0]
        moves[k, 0] = right + GAP * widest - shapes[k].points[:, 0].min()
    first = np.concatenate([[0], np.cumsum([shape.size for shape in shapes])]).astype(np.int32)
    return _joined(shapes, moves, first)


def _joined(shapes: Sequence[Shape], moves: np.ndarray, first: np.ndarray) -> Shape:
    parts: dict[str, np.ndarray] = {}
    for k, shape in enumerate(shapes):
        name = f"sheet {k + 1}"
        parts[name] = np.arange(first[k], first[k + 1], dtype=np.int32)
        own = edge_names(shape)
        parts |= {f"{name} {part}": np.asarray(points + first[k], np.int32) for part, points in own.items()}
    parts["all"] = np.concatenate([parts[f"sheet {k + 1} all"] for k in range(len(shapes))])
    numbered = list(enumerate(shapes))
    barriers = [shape.barriers + first[k] for k, shape in numbered if shape.barriers is not None]
    spacings = [np.full(s.size, s.spacing) if s.spacings is None else s.spacings for s in shapes]
    alike = all(s.spacings is None and math.isclose(s.spacing, shapes[0].spacing, rel_tol=1e-9) for s in shapes)
    frames = [shape.frames for shape in shapes if shape.frames is not None]
    return Shape(
        points=np.concatenate([shape.points + moves[k] for k, shape in numbered]),
        areas=np.concatenate([shape.areas for shape in shapes]),
        triangles=np.concatenate([shape.triangles + first[k] for k, shape in numbered]).astype(np.int32),
        spacing=max(shape.spacing for shape in shapes),
        cuts=tuple(moved_cut(cut, partial(np.add, moves[k])) for k, shape in numbered for cut in shape.cuts),
        tips=tuple(tip for shape in shapes for tip in shape.tips),
        inclusions=tuple(np.asarray(m + first[k], np.int32) for k, shape in numbered for m in shape.inclusions),
        spacings=None if alike else np.concatenate(spacings),
        frames=np.concatenate(frames) if frames else None,
        barriers=np.concatenate(barriers).astype(np.int32) if barriers else None,
        bodies=_bodies(shapes),
        parts=parts,
        pieces=np.repeat(np.arange(1, len(shapes) + 1, dtype=np.int32), np.diff(first)),
        origins=moves,
        notes=tuple(dict.fromkeys(note for shape in shapes for note in shape.notes)),
    )


def _bodies(shapes: Sequence[Shape]) -> np.ndarray | None:
    """Indices of rigid inclusions, numbered across all shapes."""
    if all(shape.bodies is None for shape in shapes):
        return None
    found, last = [], 0
    for shape in shapes:
        own = np.zeros(shape.size, np.int32) if shape.bodies is None else shape.bodies
        found.append(np.where(own > 0, own + last, 0))
        last += int(own.max(initial=0))
    return np.concatenate(found).astype(np.int32)
