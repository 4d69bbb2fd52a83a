"""The points stored in frames, and the frames, in the first process."""

from __future__ import annotations

import functools

import numpy as np

from ..device.checks import InputError, count
from ..device.fields import Array
from ..geometry.triangulation import CoarseLattice, lattice_triangles
from ..interfaces.frame import Frame, Surface
from .built import Built


class FramePoints:
    """The points stored in frames: all points, or every n-th column and row of a lattice and the last ones.

    With a stride n the surface is that of a coarser lattice; one of its cells is torn if any triangle of the sheet in
    it is torn. With several processes, state arrays are available only within `Communicator.root`.
    """

    def __init__(self, built: Built, stride: int = 1) -> None:
        """Select the points. Raises InputError for a stride that leaves only the edges, or if there is no lattice."""
        self.built, self._coarse, lattice = built, None, built.context.whole.lattice
        if count("stride", stride, 1) == 1:
            return
        if lattice is None or lattice.rows == 1:
            raise InputError(f"stride = {stride}: expected 1 for a sheet that is not a lattice")
        most = (max(lattice.columns, lattice.rows) - 1) // 2
        if stride > most:
            raise InputError(
                f"stride = {stride}: expected at most {most} on a lattice of {lattice.columns} x {lattice.rows} points"
            )
        self._coarse = CoarseLattice(lattice, stride)

    @property
    def all(self) -> bool:
        """Whether frames contain all points."""
        return self._coarse is None

    @functools.cached_property
    def _chosen(self) -> slice | np.ndarray:
        return slice(None) if self._coarse is None else self._coarse.points()

    @property
    def size(self) -> int:
        """Number of points of a frame."""
        whole, coarse = self.built.context.whole, self._coarse
        return whole.size if coarse is None else len(coarse.columns) * len(coarse.rows)

    @functools.cached_property
    def _faces(self) -> np.ndarray:
        """Indices of the triangles of the coarser lattice that no initial cut crosses."""
        coarse, whole = self._coarse, self.built.context.whole
        assert coarse is not None
        if not whole.cuts:
            return np.arange(2 * (len(coarse.columns) - 1) * (len(coarse.rows) - 1))
        return np.flatnonzero(~coarse.cut(whole.triangles))

    @functools.cached_property
    def surface(self) -> Surface:
        """The reference surface of these points."""
        scene, coarse = self.built.simulation, self._coarse
        triangles, places, named = scene.sheet.triangles, scene.sheet.points[self._chosen], {}
        if coarse is not None:
            triangles = lattice_triangles(len(coarse.columns), len(coarse.rows))[self._faces]
            named = {"stride": coarse.stride}
        static = {} if scene.load_duration is None else {"load_duration": scene.load_duration}
        if self.built.solver.turns:
            static["turns"] = 1
        if scene.sheet.origins is not None:
            static["pieces"] = len(scene.sheet.origins)
        return Surface(
            points=np.column_stack([places, np.zeros((len(places), 3 - places.shape[1]))]),
            faces=triangles,
            title=scene.scene,
            metadata={"scene": scene.scene, "section": scene.section, "units": "SI", **static, **named},
            bodies=tuple(body for contact in self.built.contacts if (body := contact.outline()) is not None),
        )

    @functools.cached_property
    def _placement(self) -> np.ndarray | None:
        """Displacement of these points before the sheet was clamped [m], or None."""
        context = self.built.context
        placement = self.built.simulation.sheet.placement() if context.partition else context.placement
        return None if placement is None else placement[self._chosen]

    def _values(self, array: Array) -> np.ndarray:
        """A copy of a field of points on the host."""
        return self.built.context.whole_array(array, self._coarse)

    def _volumes(self, volume: Array | np.ndarray) -> np.ndarray:
        """Volumes of points on the host."""
        if not isinstance(volume, np.ndarray):
            return self._values(volume)
        return volume if self._coarse is None else volume[self._coarse.points()]

    def _intact(self, array: Array) -> np.ndarray:
        """Whether each triangle of the surface is intact."""
        intact = np.asarray(self.built.context.whole_array(array).view(bool))
        if self._coarse is None:
            return intact
        torn = self._coarse.torn(self.built.context.whole.triangles[~intact])
        return np.asarray(~torn[self._faces])

    def frame(self, index: int, now: float) -> Frame:
        """The state as a frame; requires that the launches of the stage "frame" have run."""
        built, shown = self.built, {}
        for stored in built.context.fields.shown():
            values = self._values(stored.array)
            if stored.field.volume is not None:
                volume = self._volumes(stored.field.volume)
                values = np.divide(values, volume, out=np.zeros_like(values), where=volume > 0.0)
            shown[stored.field.output] = values
        rupture, displacement = built.rupture, shown.pop("displacement")
        if self._placement is not None:
            # From the sheet as it was clamped, in the same precision.
            displacement = (displacement - self._placement).astype(displacement.dtype)
        poses = [contact.pose() for contact in built.contacts if contact.outline() is not None]
        return Frame(
            index=index,
            time=now,
            displacement=displacement,
            velocity=shown.pop("velocity"),
            intact_faces=None if rupture is None else self._intact(rupture.intact_faces),
            damage=None if rupture is None else self._values(rupture.damage),
            point_data=shown,
            bodies=np.array(poses) if poses else None,
        )
