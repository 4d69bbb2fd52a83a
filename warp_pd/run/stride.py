"""Frames of some of the points of a lattice: every so many-th column and row, and the last ones."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import warp as wp

from ..device.checks import InputError, count
from ..device.fields import Array, to_host
from ..geometry.on_demand import entries
from ..geometry.triangulation import lattice_triangles
from ..interfaces.frame import Frame, Surface
from .built import Built
from .frame_points import snapshot, surface_of


class CoarserPoints:
    """Every so many-th column and row of a lattice, brought to the first process.

    The surface between them is that of a coarser lattice: a cell is torn where any triangle of the sheet in it is.

    Attributes:
        built: The simulation.
        own: Number of points of the frames.
    """

    whole, divided = False, False

    def __init__(self, built: Built, stride: int) -> None:
        """Choose the points.

        Raises:
            InputError: for a sheet that is no lattice.
        """
        lattice = built.context.whole.lattice
        if lattice is None or lattice.rows == 1:
            raise InputError(f"stride = {stride}: expected 1 for a sheet that is not a lattice")
        self.built, self._stride, self._lattice = built, count("stride", stride, 1), lattice
        self._columns = _every(lattice.columns, stride)
        self._rows = _every(lattice.rows, stride)
        kept = (lattice.columns * self._rows[:, None] + self._columns).ravel()
        self.own = len(kept)
        share = built.context.share
        own = slice(0, built.context.sheet.size) if share is None else share.own
        self._first = built.context.number(own.start)
        here = kept[slice(*np.searchsorted(kept, [self._first, self._first + own.stop - own.start]))]
        self._kept, self._held = kept, here - built.context.number(0)
        self._indices: Array = wp.array(self._held.astype(np.int32), dtype=wp.int32, device=built.context.device)

    @functools.cached_property
    def _faces(self) -> np.ndarray:
        """Numbers of the triangles of the coarser lattice that no cut has taken, shape (F,)."""
        cells = (len(self._columns) - 1) * (len(self._rows) - 1)
        torn = self._cells_of(*self._cut_triangles())
        return np.flatnonzero(np.repeat(~np.isin(np.arange(cells), torn), 2))

    def _cut_triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Column and row of the cell of each triangle of the lattice that the sheet does not have."""
        sheet, lattice = self.built.context.whole, self._lattice
        triangles = sheet.stored("triangles")
        held = entries(triangles)
        gone = held.left_out()
        if gone is not None:
            return _cells(held.at(gone), lattice.columns)
        columns, cells = lattice.columns - 1, (lattice.columns - 1) * (lattice.rows - 1)
        column, row = _cells(np.asarray(triangles), lattice.columns)
        lost = np.flatnonzero(np.bincount(columns * row + column, minlength=cells) < 2)
        return lost % columns, lost // columns

    def _cells_of(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Cells of the coarser lattice in which some cells of the lattice are, each once."""
        across = np.searchsorted(self._columns, columns, side="right") - 1
        along = np.searchsorted(self._rows, rows, side="right") - 1
        return np.unique((len(self._columns) - 1) * along + across)

    @functools.cached_property
    def surface(self) -> Surface:
        """The reference surface of the coarser lattice."""
        sheet = self.built.simulation.sheet
        positions = sheet.stored("points")[self._kept]
        positions = np.column_stack([positions, np.zeros(len(positions))])
        triangles = lattice_triangles(len(self._columns), self._faces)
        made = surface_of(self.built, positions, triangles)
        return replace(made, metadata={**made.metadata, "stride": self._stride})

    @functools.cached_property
    def volume(self) -> np.ndarray:
        """Volume of each of these points here [m^3]."""
        sheet = self.built.context.sheet
        return sheet.stored("areas")[self._held] * sheet.thickness

    @property
    def placement(self) -> np.ndarray | None:
        """What stretched these points here before the sheet was clamped [m]; or None."""
        placement = self.built.context.placement
        return None if placement is None else placement[self._held]

    def values(self, array: Array) -> np.ndarray:
        """A copy of a field at these points here, on the host; chosen on the device."""
        return to_host(wp.indexedarray(array, [self._indices]).contiguous())

    def intact(self, array: Array) -> np.ndarray:
        """Cells of the coarser lattice in which a triangle here is torn."""
        torn = np.flatnonzero(to_host(array) == 0)
        corners = self.built.context.sheet.stored("triangles")[torn] + np.int64(self.built.context.number(0))
        return self._cells_of(*_cells(corners, self._lattice.columns))

    def take(self, index: int, now: float) -> Frame | None:
        """The state as a frame, in the first process."""
        crew = self.built.context.crew
        parts = crew.gather(crew.together(lambda: snapshot(self, index, now)))
        if not crew.leads:
            return None
        first, intact = parts[0], None
        if first.intact_faces is not None:
            torn = np.concatenate([part.intact_faces for part in parts if part.intact_faces is not None])
            intact = ~np.isin(self._faces // 2, torn)
        damage = [part.damage for part in parts if part.damage is not None]
        return replace(
            first,
            displacement=np.concatenate([part.displacement for part in parts]),
            velocity=np.concatenate([part.velocity for part in parts]),
            intact_faces=intact,
            damage=np.concatenate(damage) if damage else None,
            point_data={name: np.concatenate([part.point_data[name] for part in parts]) for name in first.point_data},
        )


def _every(number: int, stride: int) -> np.ndarray:
    """0, stride, 2 stride, ... and the last of a number of columns or rows."""
    return np.unique(np.append(np.arange(0, number, stride), number - 1))


def _cells(triangles: np.ndarray, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Column and row of the cell of a lattice in which each triangle is."""
    row, column = np.divmod(np.asarray(triangles, np.int64), columns)
    return column.min(axis=1), row.min(axis=1)
