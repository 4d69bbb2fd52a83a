"""Supports: fixed points, and points with a prescribed motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, count, evaluate, numbers, one_of, point_indices, show, vector
from ..device.clock import Schedule, schedule
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..interfaces import SLOPE, BuiltLaw, BuiltPart, Constraint, Part, Turn
from ..interfaces.scales import Scales
from ..kernels.integrate import RIGID, prescribed_motion
from ..step import Phase

AXES = "xyz"
# A value of a motion.
InTime = float | Sequence[float] | Sequence[Sequence[float]] | Callable[[np.ndarray], np.ndarray] | None
# Angle [rad] from which a multiple of 5 is in degrees.
DEGREES = 30.0


class Support(Part):
    """A part that only holds or moves points (base class); MovedPoints does the device work for all supports."""

    does_work = True
    divides = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build a placeholder: MovedPoints does the work."""
        return BuiltSupport()


class BuiltSupport(BuiltPart):
    """A support on a device; it adds no launches, see MovedPoints."""


@dataclass(frozen=True, eq=False)
class Fixed(Support):
    """Points held at their initial positions.

    Attributes:
        points: Point indices.
        components: Held components, letters from "xyz".
        slope: Whether the slope of a sheet with a `Plate` is held there, too, as in a clamp; all components must be.
    """

    points: Any
    components: str = AXES
    slope: bool = False

    def __post_init__(self) -> None:
        names = self.components
        if not isinstance(names, str) or not names or set(names) - set(AXES) or len(set(names)) < len(names):
            raise InputError(f"Fixed.components = {show(names)}: expected distinct letters from 'xyz'")
        if one_of("Fixed.slope", self.slope, (True, False)) and len(names) < len(AXES):
            raise InputError(f"Fixed.slope = True with components = {show(names)}: expected 'xyz'")

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """The held components. Raises InputError if a point does not exist, or for slopes of a prestretched sheet."""
        if self.slope and sheet.stretch is not None:
            raise InputError(
                "Fixed.slope = True: not supported on a prestretched sheet; expected a second row of held points"
            )
        bits = sum(1 << AXES.index(c) for c in set(self.components)) | (SLOPE if self.slope else 0)
        return [Constraint("Fixed", point_indices("Fixed.points", self.points, sheet.size), bits)]


@dataclass(frozen=True, eq=False)
class Motion(Support):
    """Points that move as one body on a prescribed path, component by component, and may turn.

    Each of x, y, z is None (free), a number (constant displacement [m]), one displacement per time, or one per time and
    point, shape (K, P): each point then has its own path. A function of the times may give these, such as
    lambda t: 0.01 * numpy.sin(t). With an `angle` the points also turn about an axis, which moves with them; None then
    means 0 for the components that turn.

    Attributes:
        points: Point indices, or a mask of all points.
        times: Knots of the piecewise linear motion [s], shape (K,).
        x: Displacement along x [m]. Columns of shape (K, P) are in the order of `points`.
        y: Displacement along y [m].
        z: Displacement along z [m].
        angle: Angle [rad], a number or one per time, counter-clockwise seen against the axis; None for no turn.
        about: A point of the axis [m], (x, y, z), or (x, y) for z = 0.
        axis: Direction of the axis, any length.
        repeat: How often the motion is repeated from the last time on, where it must be as at the first time.
    """

    points: Any
    times: Sequence[float]
    x: InTime = None
    y: InTime = None
    z: InTime = None
    angle: InTime = None
    about: Sequence[float] = (0.0, 0.0, 0.0)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    repeat: int = 1

    def constraints(self, sheet: Sheet) -> Sequence[Constraint]:
        """The moved components."""
        bits = sum(1 << c for c, value in enumerate((self.x, self.y, self.z)) if value is not None)
        turn = self.turn()
        if turn is not None:
            bits |= sum(1 << c for c in range(3) if abs(turn.axis[c]) < 1.0)
        if bits == 0:
            raise InputError("Motion x = y = z = angle = None: expected at least one prescribed component")
        points, paths = point_indices("Motion.points", self.points, sheet.size), self.paths()
        if len(paths) == 1:
            return [Constraint("Motion", points, bits, paths[0], turn)]
        # A path is evaluated once for all points that share it.
        listed = np.asarray(self.points)
        listed = np.flatnonzero(listed) if listed.dtype == bool else listed.ravel()
        if len(points) != len(listed) or len(paths) != len(listed):
            raise InputError(
                f"Motion.points = {show(self.points)}: expected {len(paths)} different points, one for each path, "
                f"got {len(points)}"
            )
        shared = np.unique([path.values.ravel() for path in paths], axis=0, return_inverse=True)[1].ravel()
        alike = [np.flatnonzero(shared == k) for k in range(shared.max() + 1)]
        return [Constraint("Motion", np.sort(listed[at]).astype(np.int32), bits, paths[at[0]], turn) for at in alike]

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it moves its points very far or fast, or turns them by degrees."""
        paths, turn = self.paths(), self.turn()
        furthest = max(float(np.linalg.norm(path.values, axis=1).max()) for path in paths)
        found = scales.of_length("Motion moves its points by", furthest)
        found += scales.of_speed("Motion moves its points at", max(path.top_speed(math.inf) for path in paths))
        angles = np.zeros(1) if turn is None else np.abs(turn.angle.values[:, 0])
        angle = float(angles.max())
        if angle >= DEGREES and not angle % 5.0:
            found.append(
                f"Motion.angle reaches {angle:g} rad; is it in degrees? They are {math.radians(angle):.4g} rad"
            )
        return found

    def paths(self) -> list[Schedule]:
        """The motion as a schedule of all points, or one for each point; free components are zero."""
        return self._in_time({"x": self.x, "y": self.y, "z": self.z})

    def turn(self) -> Turn | None:
        """The rotation, or None."""
        if self.angle is None:
            return None
        about = (*self.about, 0.0) if np.shape(self.about) == (2,) else self.about
        axis = np.array(vector("Motion.axis", self.axis, 3))
        length = float(np.linalg.norm(axis))
        if length == 0.0:
            raise InputError(f"Motion.axis = {show(self.axis)}: expected a direction, such as (0, 0, 1)")
        return Turn(self._in_time({"angle": self.angle})[0], np.array(vector("Motion.about", about, 3)), axis / length)

    def _in_time(self, values: Mapping[str, Any]) -> list[Schedule]:
        """Schedules of up to three values by name, each as the class says; others are zero."""
        times = np.atleast_1d(numbers("Motion.times", self.times))
        knots = times.size
        columns = [np.zeros((knots, 1))] * 3
        for c, (name, value) in enumerate(values.items()):
            given = evaluate(f"Motion.{name}", value, [times]) if callable(value) else value
            column = np.atleast_1d(numbers(f"Motion.{name}", 0.0 if given is None else given))
            if column.shape == (1,):
                column = np.repeat(column, knots)
            if column.ndim == 2 and name != "angle" and len(column) == knots and column.shape[1] > 0:
                columns[c] = column
            elif column.shape == (knots,):
                columns[c] = column[:, None]
            else:
                by_point = "" if name == "angle" else f", or shape ({knots}, points)"
                raise InputError(
                    f"Motion.{name} has {len(column)} values, shape {column.shape}: expected 1 or {knots}, one per "
                    f"time{by_point}"
                )
        paths = {column.shape[1] for column in columns} - {1}
        if len(paths) > 1:
            raise InputError(
                f"Motion has paths of {' and '.join(map(str, sorted(paths)))} points: expected as many each"
            )
        whole = np.stack(np.broadcast_arrays(*columns), axis=2)
        repeat = count("Motion.repeat", self.repeat, 1)
        return [schedule("Motion", times, whole[:, point]).repeated(repeat) for point in range(whole.shape[1])]


def stretching_edges(sheet: Sheet, half: float, times: Sequence[float], stretches: Sequence[float]) -> list[Motion]:
    """Motions of the edges of a square about the origin, and of all points outside it, for an equibiaxial stretch.

    `half` is half the side of the square [m]; there is one stretch per time.
    """
    outside = np.flatnonzero((np.abs(sheet.points) > half - 1e-3 * sheet.spacing).any(axis=1))
    motions = []
    for axis, name in enumerate("xy"):
        across = sheet.points[outside, axis]
        for place in np.unique(across.round(12)):
            path: Any = [float((stretch - 1.0) * place) for stretch in stretches]
            points = outside[np.abs(across - place) < 1e-3 * sheet.spacing]
            motions.append(Motion(points, times, **{name: path}))
    return motions


def held_components(sheet: Sheet, constraints: Sequence[Constraint]) -> np.ndarray:
    """Bits of held components of every point, uint8, shape (N,)."""
    held, moved = np.zeros(sheet.size, np.uint8), np.zeros(sheet.size, np.uint8)
    for constraint in constraints:
        rigid = bool(constraint.components & RIGID)
        moves = rigid or constraint.motion is not None
        # Supports may share points; what moves must be alone.
        others = held if moves else moved
        clash = others[constraint.points] & (constraint.components | (RIGID if moves else 0))
        if clash.any():
            at = int(np.flatnonzero(clash)[0])
            _refuse_clash(constraint.owner, sheet, int(constraint.points[at]), int(clash[at]))
        held[constraint.points] |= constraint.components
        if moves:
            moved[constraint.points] |= constraint.components
    return held


def _refuse_clash(name: str, sheet: Sheet, point: int, clash: int) -> None:
    """Raise an error that names a point constrained by two parts."""
    place = ", ".join(f"{x:.4g}" for x in sheet.points[point])
    other = "a rigid inclusion" if clash & RIGID else "another support or motion"
    what = "" if clash & RIGID else f" component {next(c for k, c in enumerate(AXES) if clash & 1 << k)} of"
    raise InputError(
        f"{name}.points contains point {point} at ({place}) m, but {other} already has{what} it: "
        f"expected one part per component; remove shared points, such as corners, with numpy.setdiff1d"
    )


class MovedPoints(BuiltPart):
    """All prescribed motions on a device.

    A point has one row per motion that moves it: two edges may move different components of their common corner.
    """

    def __init__(self, context: Context, constraints: Sequence[Constraint]) -> None:
        self.context = context
        self._moving = [(c, c.motion) for c in constraints if c.motion is not None]
        self._schedules = [context.clock.register(motion) for _, motion in self._moving]
        angles = [None if constraint.turn is None else constraint.turn.angle for constraint, _ in self._moving]
        self._turns = [context.clock.register(angle) for angle in angles]

    def refuse_held_slopes(self) -> None:
        """Check that no slope is held, on a sheet without bending stiffness."""
        if (self.context.held & SLOPE).any():
            raise InputError("Fixed.slope = True: expected a Plate() among the loads; a membrane has no slope to hold")

    def check_begin(self, horizon: float) -> None:
        """Check that no motion begins more than a horizon [m] from a point: no step can close the gap."""
        for constraint, motion in self._moving:
            self._check_begin(constraint, motion, horizon)

    def _check_begin(self, constraint: Constraint, motion: Schedule, horizon: float) -> None:
        there = self.context.initial_displacement
        if self.context.placement is not None:
            there = there - self.context.placement
        begin, points = motion.at(0.0), constraint.points
        moved = constraint.displacement(self.context.clamped_positions[points], 0.0)
        apart = np.abs(moved - there[points])
        for c in (c for c in range(3) if constraint.components & (1 << c)):
            jump = float(apart[:, c].max(initial=0.0))
            if jump > horizon:
                turned = "" if constraint.turn is None else f" and angle {constraint.turn.angle.at(0.0)[0]:.6g} rad"
                raise InputError(
                    f"{constraint.owner}.{AXES[c]} is {begin[c]:.6g} m{turned} at t = 0, {jump:.3g} m from its "
                    f"points; expected at most the horizon, {horizon:.3g} m"
                )

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that gives moved points their velocity."""
        if phase is Phase.PRESCRIBE and self._moving:
            self._prescribe(stage)

    def _prescribe(self, stage: Stage) -> None:
        context, state = self.context, self.context.state
        points = np.unique(np.concatenate([constraint.points for constraint, _ in self._moving]))
        schedules = np.full((len(points), 3), -1, np.int32)
        turns, away, across = np.full(len(points), -1, np.int32), *np.zeros((2, len(points), 3))
        for (constraint, _), index, turn in zip(self._moving, self._schedules, self._turns, strict=True):
            assert index is not None
            moved = [c for c in range(3) if constraint.components & (1 << c)]
            at = np.searchsorted(points, constraint.points)
            schedules[at[:, None], moved] = context.clock.soon(index)
            if constraint.turn is not None and turn is not None:
                turns[at] = context.clock.soon(turn)
                away[at], across[at] = constraint.turn.arms(context.clamped_positions[constraint.points])
        rows = np.full(context.sheet.size, -1, np.int32)
        rows[points] = np.arange(len(points))
        arguments: dict[str, Any] = {
            "rows": context.array("moved_rows", "Motion", wp.int32, rows),
            "schedules": context.array("moved_schedules", "Motion", wp.vec3i, schedules, per="table"),
            "scheduled": context.clock.scheduled, "step": state.step, "displacement": state.displacement,
            "velocity": state.velocity,
        }  # fmt: skip
        placed, turned, vec3 = context.placement is not None, bool((turns >= 0).any()), context.types.vec3
        arguments |= dict.fromkeys(("origins", "turns", "away", "across"))
        if placed:
            arguments["origins"] = context.array("moved_origins", "Motion", vec3, context.placement)
        if turned:
            arguments |= {
                "turns": context.array("moved_turns", "Motion", wp.int32, turns, per="table"),
                "away": context.array("moved_away", "Motion", vec3, away, per="table"),
                "across": context.array("moved_across", "Motion", vec3, across, per="table"),
            }
        stage.pointwise("Motion", prescribed_motion(context.bits, placed, turned), len(rows), **arguments)
