"""Loads and supports: fixed points, prescribed motion, pressure, body and point forces, boundary force.

Everything that changes in time is a schedule: a piecewise linear function that the device evaluates itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .checks import InputError, finite, not_negative, numbers, one_of, point_indices, vector
from .sheet import Sheet


@dataclass(frozen=True, eq=False)
class Schedule:
    """A piecewise linear function of time; before its first knot and after its last one it is constant.

    Attributes:
        times: Knots [s], rising, shape (K,).
        values: shape (K, 3).
    """

    times: np.ndarray
    values: np.ndarray

    def at(self, time: float) -> np.ndarray:
        """Values at a time [s], shape (3,)."""
        return np.array([np.interp(time, self.times, self.values[:, c]) for c in range(3)])


def schedule(name: str, times: np.ndarray, values: np.ndarray) -> Schedule:
    """A checked schedule of finite numbers: times, shape (K,), and values, shape (K, 3).

    Raises:
        InputError: unless the times rise.
    """
    if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
        raise InputError(f"{name} times = {times.tolist()}: allowed are rising times, at least one")
    return Schedule(times, values)


def factor_schedule(name: str, ramp: Sequence[tuple[float, float]] | None) -> Schedule | None:
    """Schedule of a factor from pairs (time, factor); None stays None: the load is constant."""
    if ramp is None:
        return None
    try:
        pairs = np.array([vector(f"{name} ramp", pair, 2) for pair in ramp])
    except TypeError:
        raise InputError(f"{name} ramp = {ramp!r}: allowed are pairs (time, factor)") from None
    if len(pairs) == 0:
        raise InputError(f"{name} ramp = {ramp!r}: allowed is at least one pair (time, factor)")
    return schedule(f"{name} ramp", pairs[:, 0], np.repeat(pairs[:, 1:], 3, axis=1))


def _components(name: str, value: str) -> int:
    if not value or any(c not in "xyz" for c in value):
        raise InputError(f"{name} = {value!r}: allowed are letters out of 'xyz'")
    return sum(1 << "xyz".index(c) for c in set(value))


@dataclass(frozen=True, eq=False)
class Fixed:
    """Points that keep their place.

    Attributes:
        points: Point indices.
        components: Which components are held, letters out of "xyz".
    """

    points: Any
    components: str = "xyz"

    def mask(self) -> int:
        """Bits of the held components.

        Raises:
            InputError: for other letters.
        """
        return _components("Fixed.components", self.components)


@dataclass(frozen=True, eq=False)
class Motion:
    """Points that move together as prescribed, component by component.

    Each of x, y, z is None (free), a number (held at that displacement [m]) or one displacement a time.

    Attributes:
        points: Point indices.
        times: Knots of the piecewise linear motion [s].
        x: Displacement along x [m].
        y: Displacement along y [m].
        z: Displacement along z [m].
    """

    points: Any
    times: Sequence[float]
    x: float | Sequence[float] | None = None
    y: float | Sequence[float] | None = None
    z: float | Sequence[float] | None = None

    def mask(self) -> int:
        """Bits of the prescribed components.

        Raises:
            InputError: if there is none.
        """
        bits = sum(1 << c for c, value in enumerate((self.x, self.y, self.z)) if value is not None)
        if bits == 0:
            raise InputError("Motion x = y = z = None: allowed is at least one prescribed component")
        return bits

    def schedule(self) -> Schedule:
        """The motion as a schedule; free components are zero."""
        times = np.atleast_1d(numbers("Motion.times", self.times))
        knots = times.size
        columns = []
        for name, value in (("x", self.x), ("y", self.y), ("z", self.z)):
            column = np.atleast_1d(numbers(f"Motion.{name}", 0.0 if value is None else value))
            if column.shape == (1,):
                column = np.repeat(column, knots)
            if column.shape != (knots,):
                raise InputError(f"Motion.{name} has {len(column)} values: allowed are 1 or {knots}, one a time")
            columns.append(column)
        return schedule("Motion", times, np.column_stack(columns))


def stretching_edges(sheet: Sheet, half: float, times: Sequence[float], stretches: Sequence[float]) -> list[Motion]:
    """Edges of a square about the origin and all points outside, moved in the plane as an equal stretch of it.

    Args:
        sheet: The sheet, with layers of points outside the square.
        half: Half the side of the square [m].
        times: Rising [s].
        stretches: One a time.
    """
    outside = np.flatnonzero((np.abs(sheet.points) > half - 1e-3 * sheet.spacing).any(axis=1))
    motions = []
    for axis, name in enumerate("xy"):
        across = sheet.points[outside, axis]
        for place in np.unique(across.round(12)):
            path = [float((stretch - 1.0) * place) for stretch in stretches]
            points = outside[np.abs(across - place) < 1e-3 * sheet.spacing]
            motions.append(Motion(points, times, **{name: path}))
    return motions


@dataclass(frozen=True)
class Pressure:
    """Pressure on one side of the sheet, positive towards the side of +z.

    Attributes:
        value: [Pa].
        follower: Whether it turns and grows with the surface (F e1 x F e2), or stays vertical on the
            reference area (dead).
        ramp: Pairs (time [s], factor), or None for a constant pressure from the start.
    """

    value: float
    follower: bool = True
    ramp: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        finite("Pressure.value", self.value)
        one_of("Pressure.follower", self.follower, (True, False))

    def schedule(self) -> Schedule | None:
        """Schedule of the factor."""
        return factor_schedule("Pressure", self.ramp)

    def dead_forces(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Points and their forces [N] if the pressure is dead."""
        force = np.zeros((sheet.size, 3))
        force[:, 2] = self.value * sheet.areas
        return np.arange(sheet.size, dtype=np.int32), force


@dataclass(frozen=True)
class BodyForce:
    """A constant force per reference volume.

    Attributes:
        value: [N/m^3]; gravity is density times acceleration.
        ramp: Pairs (time [s], factor), or None.
    """

    value: tuple[float, float, float]
    ramp: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        vector("BodyForce.value", self.value, 3)

    def schedule(self) -> Schedule | None:
        """Schedule of the factor."""
        return factor_schedule("BodyForce", self.ramp)

    def dead_forces(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Points and their forces [N]."""
        force = np.outer(sheet.areas * sheet.thickness, np.array(self.value, dtype=np.float64))
        return np.arange(sheet.size, dtype=np.int32), force


@dataclass(frozen=True, eq=False)
class PointForce:
    """A constant force, shared by the given points in proportion to their areas.

    Attributes:
        points: Point indices.
        value: Total force [N].
        ramp: Pairs (time [s], factor), or None.
    """

    points: Any
    value: tuple[float, float, float]
    ramp: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        vector("PointForce.value", self.value, 3)

    def schedule(self) -> Schedule | None:
        """Schedule of the factor."""
        return factor_schedule("PointForce", self.ramp)

    def dead_forces(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Points and their forces [N]."""
        points = point_indices("PointForce.points", self.points, sheet.size)
        share = sheet.areas[points] / sheet.areas[points].sum()
        return points, np.outer(share, np.array(self.value, dtype=np.float64))


BOUNDARY_FORMS = ("normal", "printed")


@dataclass(frozen=True, eq=False)
class BoundaryForce:
    """The empirical force that pulls edge points back to their local plane (BA eq. 45).

    Each bond of a point i that carries it has the force density w_ij A (Y_ij . d_i) n, with d_i the unit normal
    of the deformation gradient of the whole family of i. As ever, it acts on both points with opposite signs.
    The energy balance counts its work as external.

    Attributes:
        value: A [N/m^7], 0 or more; empirical, the paper gives none.
        points: Indices of the points that carry it, or None: those less than one horizon away from an edge,
            clamped or free, a hole or a cut. Where bonds can break, points that lost one always join.
        form: Direction n of the force.
            "normal": n = d_i, which is what the paper says in words: perpendicular to the local plane. It
                restores, and is linear in small deflections, with a symmetric tangent. Forces that are not
                central conserve angular momentum to second order in the deflection, not to round-off.
            "printed": n = Y_ij / |Y_ij|, as in the formula. Its normal component A w (Y . d)^2 / |Y| is never
                negative, so it pushes to the side of d, up, whichever way the point lies off the plane; to first
                order in a deflection it acts in the plane instead. The mirrored state has minus the mirrored
                force: the choice of the sheet's upper side decides. Offered for comparison.
    """

    value: float
    points: Any = None
    form: str = "normal"

    def __post_init__(self) -> None:
        not_negative("BoundaryForce.value", self.value)
        one_of("BoundaryForce.form", self.form, BOUNDARY_FORMS)

    def schedule(self) -> Schedule | None:
        """None: it does not change in time."""
        return None

    def carriers(self, sheet: Sheet, horizon: float) -> np.ndarray:
        """Indices of the points that carry it while nothing is broken, shape (P,), int32.

        Args:
            sheet: The sheet.
            horizon: [m].

        Raises:
            InputError: if there is no point, or an index does not exist.
        """
        if self.points is None:
            return near_edges(sheet, horizon)
        return point_indices("BoundaryForce.points", self.points, sheet.size)


def near_edges(sheet: Sheet, distance: float) -> np.ndarray:
    """Indices of the points less than `distance` [m] away from the edges of the sheet, shape (P,), int32.

    Edges are the sides that one triangle alone has, so those of holes and cuts count. The family of a point at
    just one horizon from an edge is whole, hence "less than".
    """
    from scipy.spatial import cKDTree

    sides = np.sort(sheet.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, uses = np.unique(sides, axis=0, return_counts=True)
    tail, head = sheet.points[unique[uses == 1, 0]], sheet.points[unique[uses == 1, 1]]
    along = head - tail
    length = np.linalg.norm(along, axis=1)
    close = cKDTree(sheet.points).query_ball_point(0.5 * (tail + head), distance + 0.5 * length)
    side = np.repeat(np.arange(len(close)), [len(points) for points in close])
    point = np.concatenate([np.asarray(points, dtype=np.int64) for points in close])
    arm = sheet.points[point] - tail[side]
    share = np.clip((arm * along[side]).sum(axis=1) / length[side] ** 2, 0.0, 1.0)
    apart = np.linalg.norm(arm - share[:, None] * along[side], axis=1)
    return np.unique(point[apart < distance * (1.0 - 1e-9)]).astype(np.int32)


Load = Fixed | Motion | Pressure | BodyForce | PointForce | BoundaryForce


@dataclass(eq=False)
class ScheduleTable:
    """All schedules of a simulation, as the device reads them."""

    schedules: list[Schedule] = field(default_factory=list)

    def add(self, item: Schedule) -> int:
        """Index of the schedule in the table."""
        self.schedules.append(item)
        return len(self.schedules) - 1

    def tables(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First knot of each schedule and the end, knots, values: shapes (S + 1,), (K,), (K, 3)."""
        begins = np.concatenate([[0], np.cumsum([len(s.times) for s in self.schedules])]).astype(np.int32)
        return begins, np.concatenate([s.times for s in self.schedules]), np.vstack([s.values for s in self.schedules])
