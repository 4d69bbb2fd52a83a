"""The points that frames hold: all of the sheet, brought to the first process, or in every process its own."""

from __future__ import annotations

import functools
from typing import Protocol

import numpy as np

from ..device.fields import Array, to_host
from ..interfaces.frame import Frame, Surface
from .built import Built


class Pictured(Protocol):
    """The points that the frames of a run hold.

    Attributes:
        built: The simulation.
        whole: Whether the first process has frames of all points.
        divided: Whether every process has frames of its own points.
        own: Number of points that no other process has in its frames; they are the first ones.
    """

    built: Built
    whole: bool
    divided: bool
    own: int

    @property
    def surface(self) -> Surface:
        """The reference surface of these points."""
        ...

    @property
    def volume(self) -> np.ndarray:
        """Volume of each of these points [m^3]."""
        ...

    @property
    def placement(self) -> np.ndarray | None:
        """What stretched the sheet before it was clamped [m], of these points; or None."""
        ...

    def values(self, array: Array) -> np.ndarray:
        """A copy of a field of points on the host."""
        ...

    def intact(self, array: Array) -> np.ndarray:
        """Which triangles are intact, bool."""
        ...

    def take(self, index: int, now: float) -> Frame | None:
        """The state as a frame, or None in a process that has none. All processes call it."""
        ...


class AllPoints:
    """All points, in the first process."""

    whole, divided = True, False

    def __init__(self, built: Built) -> None:
        self.built, self.own = built, built.context.whole.size

    @functools.cached_property
    def surface(self) -> Surface:
        """The reference surface."""
        sheet = self.built.simulation.sheet
        return surface_of(self.built, sheet.positions, sheet.triangles)

    @property
    def volume(self) -> np.ndarray:
        """Volume of each point [m^3], shape (N,)."""
        return self.built.volume

    @property
    def placement(self) -> np.ndarray | None:
        """What stretched the sheet before it was clamped [m], shape (N, 3); or None."""
        context = self.built.context
        return self.built.simulation.sheet.placement() if context.share else context.placement

    def values(self, array: Array) -> np.ndarray:
        """A copy of a field on the host; with several processes within `Crew.lead` only."""
        return self.built.to_host(array)

    def intact(self, array: Array) -> np.ndarray:
        """Which triangles are intact, shape (F,)."""
        return self.built.to_host(array).view(bool)

    def take(self, index: int, now: float) -> Frame | None:
        """The state as a frame, in the first process."""
        return self.built.context.crew.lead(lambda: snapshot(self, index, now))


class OwnPoints:
    """In every process its own points of a lattice, and after them the corners of its triangles that others own.

    Attributes:
        own: Number of own points.
        first: Number of the first one in the whole sheet.
    """

    whole, divided = False, True

    def __init__(self, built: Built) -> None:
        self.built = built
        context = built.context
        assert context.sheet.lattice is not None
        share, size = context.share, context.sheet.size
        own = slice(0, size) if share is None else share.own
        self.own, self.first = own.stop - own.start, context.number(own.start)
        self._held = slice(own.start, min(own.stop + context.sheet.lattice.columns + 1, size))

    @functools.cached_property
    def surface(self) -> Surface:
        """The reference surface of what this process holds."""
        sheet, held = self.built.simulation.sheet, self._held
        positions = sheet.stored("points")[self.first + np.arange(held.stop - held.start)]
        positions = np.column_stack([positions, np.zeros(len(positions))])
        return surface_of(self.built, positions, self.built.context.sheet.triangles - np.int32(held.start))

    @functools.cached_property
    def volume(self) -> np.ndarray:
        """Volume of each of these points [m^3]."""
        sheet = self.built.context.sheet
        return sheet.stored("areas")[np.arange(self._held.start, self._held.stop)] * sheet.thickness

    @property
    def placement(self) -> np.ndarray | None:
        """What stretched these points before the sheet was clamped [m]; or None."""
        placement = self.built.context.placement
        return None if placement is None else placement[self._held]

    def values(self, array: Array) -> np.ndarray:
        """A copy of a field on the host."""
        return to_host(array[self._held])

    def intact(self, array: Array) -> np.ndarray:
        """Which of the own triangles are intact."""
        return to_host(array).view(bool)

    def take(self, index: int, now: float) -> Frame | None:
        """What this process holds as a frame."""
        return self.built.context.crew.together(lambda: snapshot(self, index, now))


def snapshot(pictured: Pictured, index: int, now: float) -> Frame:
    """The state as a frame of some points; the launches of the stage "frame" have run."""
    built: Built = pictured.built
    shown = {}
    for stored in built.context.fields.shown():
        values = pictured.values(stored.array)
        shown[stored.field.output] = values / pictured.volume if stored.field.density else values
    rupture, placement = built.rupture, pictured.placement
    displacement = shown.pop("displacement")
    if placement is not None:
        # From the sheet as it was clamped, in the same precision.
        displacement = (displacement - placement).astype(displacement.dtype)
    poses = [pose for c in built.contacts if (pose := c.pose()) is not None]
    return Frame(
        index=index,
        time=now,
        displacement=displacement,
        velocity=shown.pop("velocity"),
        intact_faces=None if rupture is None else pictured.intact(rupture.intact_faces),
        damage=None if rupture is None else pictured.values(rupture.damage),
        ball_center=next((centre for c in built.contacts if (centre := c.centre(now)) is not None), None),
        point_data=shown,
        bodies=np.array(poses) if poses else None,
    )


def surface_of(built: Built, positions: np.ndarray, triangles: np.ndarray) -> Surface:
    """A reference surface, as writers need it.

    Args:
        built: The simulation.
        positions: Of its points [m], shape (N, 3).
        triangles: Shape (F, 3).
    """
    scene = built.simulation
    static = {} if scene.load_duration is None else {"load_duration": scene.load_duration}
    return Surface(
        points=positions,
        faces=triangles,
        ball_diameter=next((d for c in built.contacts if (d := c.ball_diameter()) is not None), None),
        title=scene.scene,
        metadata={"scene": scene.scene, "section": scene.section, "units": "SI", **static},
        bodies=tuple(body for c in built.contacts if (body := c.outline()) is not None),
    )
