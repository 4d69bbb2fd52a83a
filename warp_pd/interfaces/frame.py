"""Data passed to the writers of result files: the surface of the sheet, and the frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

# Fields that frames hold without being asked, where a scene has them.
OWN_FIELDS = ("displacement", "velocity", "damage", "strain_energy_density")


def format_time(time: float, load_duration: float | None) -> str:
    """Text for a time [s], or for the load factor of a static solver with a load time at full load [s]."""
    return f"t = {time:.4g} s" if load_duration is None else f"load factor {time / load_duration:.4g}"


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body, for drawing.

    Attributes:
        name: Its name, unique in a scene.
        kind: "sphere", "capsule", "cylinder", "box", "plane" or "mesh".
        sizes: Radius; radius and half of the length along z; half of the sides [m]; the normal of a plane.
        vertices: Vertices of its surface in the body frame [m], shape (V, 3).
        triangles: Triangles of its surface, counter-clockwise seen from outside, shape (F, 3).
    """

    name: str
    kind: str
    sizes: tuple[float, ...]
    vertices: NDArray[np.floating]
    triangles: NDArray[np.integer]

    def placed(self, pose: NDArray[np.floating]) -> NDArray[np.float64]:
        """Vertices [m], shape (V, 3), for a pose of position [m] and unit quaternion (x, y, z, w), shape (7,)."""
        axis = np.cross(pose[3:6], self.vertices)
        return np.asarray(pose[:3] + self.vertices + 2.0 * (pose[6] * axis + np.cross(pose[3:6], axis)))


@dataclass(frozen=True, eq=False)
class Surface:
    """Data common to all frames.

    Attributes:
        points: Reference positions [m], shape (N, 3).
        faces: Triangles of the reference sheet, three point numbers each, counter-clockwise seen from +z,
            shape (F, 3).
        title: One line that describes the scene.
        metadata: Data to store with the results: configuration, version, units.
        bodies: Rigid bodies.
    """

    points: NDArray[np.floating]
    faces: NDArray[np.integer]
    title: str = ""
    metadata: Mapping[str, str | float | int] = field(default_factory=dict)
    bodies: tuple[Body, ...] = ()


@dataclass(frozen=True, eq=False)
class Frame:
    """The state of the sheet at one time. Writers get numbers in the precision of the run, measures in float64.

    Attributes:
        index: Number of the frame; the first is 0.
        time: Simulated time [s]; with a static solver the load time, see `format_time`.
        displacement: Displacement from the reference positions [m], shape (N, 3).
        velocity: Velocity [m/s], shape (N, 3).
        intact_faces: Mask of faces not cut by a crack, shape (F,); None if bonds cannot break.
        damage: Damage of each point, the broken fraction of its bonds, 0 to 1, shape (N,); None if bonds cannot break.
        point_data: Additional fields by name, each of shape (N,) or (N, 3).
        bodies: Position of the centre [m] and unit quaternion (x, y, z, w) of each rigid body, shape (B, 7); None
            without bodies.
    """

    index: int
    time: float
    displacement: NDArray[np.floating]
    velocity: NDArray[np.floating]
    intact_faces: NDArray[np.bool_] | None = None
    damage: NDArray[np.floating] | None = None
    point_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    bodies: NDArray[np.floating] | None = None

    def in_double(self) -> Frame:
        """The same frame with single-precision numbers converted to double precision."""

        def double(values: Any) -> Any:
            return values.astype(np.float64) if getattr(values, "dtype", None) == np.float32 else values

        return replace(
            self,
            displacement=double(self.displacement),
            velocity=double(self.velocity),
            damage=double(self.damage),
            point_data={name: double(values) for name, values in self.point_data.items()},
        )

    def positions(self, surface: Surface) -> NDArray[np.float64]:
        """Deformed positions [m], shape (N, 3)."""
        return np.asarray(surface.points, np.float64) + self.displacement

    def faces(self, surface: Surface) -> NDArray[np.int32]:
        """Triangles that are not cut by a crack, shape (number of intact faces, 3)."""
        faces = np.asarray(surface.faces, np.int32)
        return faces if self.intact_faces is None else faces[self.intact_faces]


@runtime_checkable
class Writer(Protocol):
    """Receives the frames of a run, for instance to write them to a file."""

    def write(self, frame: Frame) -> None:
        """Receive one frame."""
        ...

    def save(self) -> None:
        """Flush everything written so far to disk, so that a restart can continue from here."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


@dataclass(frozen=True)
class FrameReport:
    """Data for a reporter at a frame.

    Attributes:
        when: Text for the time, such as "t = 0.5 s".
        fraction: Fraction of the run that is done, 0 to 1.
        steps_per_second: Rate of the steps so far.
        frames: Number of frames of the run.
        row: Row of the history.
    """

    when: str
    fraction: float
    steps_per_second: float
    frames: int
    row: Mapping[str, float]
