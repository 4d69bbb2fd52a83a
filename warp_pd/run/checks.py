"""What is wrong or doubtful in a run: notes before its first step, soundness and shape of the sheet at its frames."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..device.clock import Schedule
from ..geometry.triangulation import boundary_edges, doubled_normals, vector_sums
from ..interfaces import DivergedError, UnbalancedError
from ..interfaces.frame import Frame, Surface, format_time
from ..interfaces.scales import HEAVIEST, LIGHTEST, Scales
from ..materials import capabilities, material_doubts, shear_modulus, stability_notes
from .built import Built, held_by_loads
from .scene import Scene

# Sizes that rubber sheets do not have: widths [m], thickness over width, shear modulus [Pa].
WIDEST, THICKEST, SOFTEST, STIFFEST = 50.0, 0.5, 10.0, 1e11
# Step over the time in which a wave passes a spacing, below which a note tells the cause.
TINY_STEP = 1e-3
# Passages of waves and steps from which a run is said to be slow.
MANY_PASSAGES, MANY_STEPS = 300.0, 20_000
# Seconds of steps that are timed, after the first ones.
TIMED = 1.0


def foreseen(built: Built) -> list[str]:
    """Notes on a scene, one line each."""
    scene = built.simulation
    material: Any = getattr(scene.force, "material", None)
    continuum = hasattr(material, "functions") and hasattr(material, "constants")
    notes = stability_notes(material) if continuum else []
    modulus = shear_modulus(material) if continuum else capabilities(material).shear_modulus
    unlikely = list(dict.fromkeys([*_unlikely_sizes(built, modulus), *material_doubts(material)]))
    sizes = [f"sizes: {'; '.join(unlikely)}"] if unlikely else []
    remarks = [remark for part in (*scene.loads, *scene.contacts) for remark in part.remarks()]
    return [*notes, *sizes, *remarks, *_unheld(built), *_held_forces(scene), *dict.fromkeys(_never_reached(built))]


def step_note(built: Built, dt: float) -> str:
    """A note on a step [s] that is far shorter than that of waves, or than what the run is about; or ""."""
    material: Any = getattr(built.simulation.force, "material", None)
    if not built.simulation.solver.dynamic or not built.solver.has_inertia or not hasattr(material, "functions"):
        return ""
    sheet = built.context.whole
    finest = sheet.spacing if sheet.spacings is None else float(sheet.spacings.min())
    wave = finest * math.sqrt(float(np.mean(sheet.density)) / (4.0 * shear_modulus(material)))
    if not 0.0 < dt < TINY_STEP * wave:
        scene = built.simulation
        fast = scene.damage is not None or scene.contacts or scene.sheet.inclusions
        if scene.solver.steps_explicitly and fast:
            return ""
        return _other_solver(built, dt, wave / finest * float(np.ptp(sheet.points, axis=0).max()), wave)
    cause = built.solver.cause_of_step(dt)
    light = float(np.min(sheet.density)) / float(np.mean(sheet.density))
    if not cause:
        cause = "its density varies much" if light < 0.01 else "its stiffness or thickness varies much"
    return f"step: {dt:.3g} s is {wave / dt:.3g} times shorter than a wave takes from point to point: {cause}"


def _other_solver(built: Built, dt: float, passage: float, wave: float) -> str:
    """A note on a solver that is faster by far, or "": by the times [s] in which a wave passes sheet and spacing."""
    scene = built.simulation
    duration = scene.solver.duration
    if not scene.solver.steps_explicitly:
        if dt >= wave or adapts_steps(scene.solver):
            return ""
        return f"step: {dt:.3g} s is shorter than a wave takes from point to point, {wave:.2g} s: Explicit is faster"
    if duration <= MANY_PASSAGES * passage or duration <= MANY_STEPS * dt:
        return ""
    return (
        f"step: {count_text(duration / dt)} steps of {dt:.3g} s follow waves, which pass the sheet in {passage:.2g} s; "
        f"the run takes {duration:g} s: Implicit({duration:g}, tolerance=1e-4) follows what is slow"
    )


def adapts_steps(solver: Any) -> bool:
    """Whether a solver in time adapts its steps to a tolerance, so that their number is not known before."""
    return getattr(solver, "tolerance", None) is not None


def count_text(number: float) -> str:
    """A large number for people, such as "12 000" or "4.9e+07"."""
    return f"{number:,.0f}".replace(",", " ") if number < 1e7 else f"{number:.2g}"


def _unlikely_sizes(built: Built, modulus: float | None) -> Iterator[str]:
    """Sizes of a scene that cannot be meant, each with the likely unit."""
    scene, sheet = built.simulation, built.context.whole
    width, thickness = float(np.ptp(sheet.points, axis=0).max()), float(np.mean(sheet.thickness))
    if width > WIDEST:
        yield f"the sheet is {width:.3g} m wide; are its points in mm? Lengths are in m"
    if thickness > THICKEST * width:
        yield f"the sheet is {thickness:.3g} m thick and {width:.3g} m wide; is the thickness in mm? Lengths are in m"
    density = float(np.mean(sheet.density))
    if scene.solver.dynamic and density < LIGHTEST:
        yield f"the density is {density:.3g} kg/m^3; is it in g/cm^3? Rubber has about 1000 kg/m^3"
    if scene.solver.dynamic and density > HEAVIEST:
        yield f"the density is {density:.3g} kg/m^3, more than of any metal; is it for longer steps?"
    if modulus is not None and not SOFTEST <= modulus <= STIFFEST:
        meant = "MPa" if modulus < SOFTEST else "another unit"
        yield f"the shear modulus is {modulus:.3g} Pa; are the constants in {meant}? Rubber has 1e5 to 1e6 Pa"
        modulus = None
    scales = Scales.of(sheet, modulus, scene.solver.dynamic)
    for part in (*scene.loads, *scene.contacts, *filter(None, [scene.damage])):
        yield from part.doubts(sheet, scales)
    for made in built.parts:
        yield from made.doubts(scales)
    for name, of in (("initial_displacement", scales.of_length), ("initial_velocity", scales.of_speed)):
        if getattr(scene, name) is not None:
            yield from of(f"{name} reaches", float(np.linalg.norm(scene.initial(name), axis=1).max()))


def _unheld(built: Built) -> Iterator[str]:
    """Directions in which no support holds a sheet in static equilibrium."""
    held = functools.reduce(operator.or_, (c.components for c in built.constraints if len(c.points)), 0)
    free = [axis for bit, axis in enumerate("xyz") if not held & (1 << bit)]
    if free and not built.simulation.solver.dynamic and not built.context.whole.inclusions:
        yield (
            f"supports: none holds the sheet along {' and '.join(free)}: expected Fixed or Motion, unless loads that "
            "follow the sheet or bodies hold it"
        )


def _held_forces(scene: Scene) -> Iterator[str]:
    """Point forces that act on supports alone."""
    forces: list[Any] = [load for load in scene.loads if hasattr(load, "forces")]
    if not forces:
        return
    held = held_by_loads(scene)
    for load in forces:
        points, force = load.forces(scene.sheet)
        bits = held[points][:, None] >> np.arange(3) & 1
        if force.any() and bits[force != 0.0].all():
            yield f"{type(load).__name__} {tuple(load.value)} N: supports hold all of its points, and it moves nothing"


def _never_reached(built: Built) -> Iterator[str]:
    """Schedules that change after the end of the run."""
    scene = built.simulation
    end = scene.solver.duration
    for schedule in _schedules(built):
        if schedule.name and schedule.changes_after(end):
            yield _beyond(scene, schedule.name, float(schedule.times[-1]), end)
    for contact in scene.contacts:
        motion = getattr(contact, "motion", None)
        times = getattr(motion, "times", None)
        if times is not None and np.max(times) > end * (1.0 + 1e-9):
            yield _beyond(scene, type(motion).__name__, float(np.max(times)), end)


def _schedules(built: Built) -> Iterator[Schedule]:
    yield from built.context.clock.schedules
    for constraint in built.constraints:
        if constraint.motion is not None:
            yield constraint.motion
        if constraint.turn is not None:
            yield constraint.turn.angle


def _beyond(scene: Scene, name: str, last: float, end: float) -> str:
    if scene.solver.dynamic:
        return f"{name}: it changes until {last:.6g} s, and the run ends at {end:.6g} s"
    solver = type(scene.solver).__name__
    return (
        f"{name}: it changes until {last:.6g} s, and {solver} ends at the load time {end:.6g} s: expected times up to "
        f"that, or {solver}(duration={last:.6g})"
    )


def steps_text(built: Built, dt: float, rate: float | None = None) -> str:
    """Step [s], number of steps, time at a rate [steps/s] and memory, in a line."""
    from ..output.progress import duration_text

    solver, text = built.simulation.solver, f"step {dt:.3g} s"
    if not adapts_steps(solver):
        steps = solver.duration / dt
        text += f", about {count_text(steps)} steps for {solver.duration:g} s"
        text += "" if rate is None else f", about {duration_text(max(1.0, steps / rate))} on this machine"
    else:
        text += " at first, then as the tolerance allows"
        text += "" if rate is None else f", {rate:.3g} steps/s on this machine"
    return f"{text}, {built.context.fields.nbytes / 1e6:.3g} MB"


# Area over that of the stress-free sheet below which a note says so, and distance from a plane [spacings] of a sheet
# that counts as one in a plane.
LEAST_AREA, IN_PLANE = 0.5, 1e-3
# Height of a point over its neighbours from which it is high, and steep [their spacings]; share of such points, and
# root mean square height, from which the sheet is wavy; and likeness of neighbours below which the waves are short:
# 1/3 in waves of four spacings in one direction, 4/5 of eight, near 1 of long ones.
HIGH, STEEP, MANY, WAVY, ALIKE = 0.03, 0.35, 0.2, 0.05, 0.7
# Triangles that are looked at in a frame, at most twice as many; of larger sheets evenly spread ones.
LOOKED_AT = 100_000
# Area over the mean one below which a triangle has no side that one can tell.
NO_AREA = 1e-9


class ShapeWatch:
    """Looks at the shape of the sheet in every frame until it tears; edges of a torn sheet may crumple."""

    def __init__(self, built: Built) -> None:
        self.built = built

    @functools.cached_property
    def _area(self) -> float:
        """Twice the area of the stress-free sheet [m^2]."""
        whole = self.built.context.whole
        return float(np.linalg.norm(doubled_normals(whole.positions, whole.triangles), axis=1).sum())

    def look(self, surface: Surface, frame: Frame, found: dict[str, Any]) -> None:
        """Add to `found` what a frame shows: when triangles turned over or area was lost, the worst, and the last."""
        if not _untorn(surface, frame):
            return
        whole = self.built.context.whole
        positions = frame.positions(surface)
        normals = doubled_normals(positions, np.asarray(surface.faces)[:: max(1, len(surface.faces) // LOOKED_AT)])
        each = len(surface.faces) / len(normals)
        share = each * float(np.linalg.norm(normals, axis=1).sum()) / self._area
        over = 0 if whole.frames is not None else _turned_over(positions, normals, IN_PLANE * whole.spacing)
        over = round(each * over)
        when = format_time(frame.time, self.built.simulation.load_duration)
        for name, value, beyond in (("turned over", over, over > 0), ("area", -share, share < LEAST_AREA)):
            if beyond:
                found.setdefault(name, {"since": when, "worst": value})
            if name in found:
                known = found[name]
                known["worst"], known["last"] = max(known["worst"], value), bool(beyond)

    def notes(self, surface: Surface, last: Frame | None, found: dict[str, Any]) -> list[str]:
        """Notes on what `look` found, and on waves of the last frame."""
        notes = self._notes_on(surface, found) if found else []
        if last is not None and _untorn(surface, last) and not self.built.contacts:
            faces = np.asarray(surface.faces)
            notes += _waves(np.asarray(surface.points, np.float64), last.positions(surface), faces)
        return notes

    def _notes_on(self, surface: Surface, found: dict[str, Any]) -> list[str]:
        """Notes on what `look` found."""
        law, advice, notes = self.built.law, "", []
        if law.goes_slack and law.weights == "plain":
            advice = "; take the weights 'corrected': plain ones do not hold a free edge of a TensionField"
        spans = {
            name: f"from {known['since']} on" if known["last"] else f"first at {known['since']}, not at the end"
            for name, known in found.items()
        }
        if "turned over" in found:
            notes.append(
                f"triangles: {found['turned over']['worst']} of {len(surface.faces)} of the untorn sheet are turned "
                f"over ({spans['turned over']}), so it lies on itself{advice}"
            )
        if "area" in found:
            notes.append(
                f"area: the untorn sheet has less than half of its stress-free area ({spans['area']}), down to "
                f"{-100.0 * found['area']['worst']:.2g} %{advice}"
            )
        return notes


def _untorn(surface: Surface, frame: Frame) -> bool:
    return bool(len(surface.faces)) and (frame.intact_faces is None or bool(frame.intact_faces.all()))


def _waves(start: np.ndarray, end: np.ndarray, faces: np.ndarray) -> list[str]:
    """A note if the points lie in short waves at the end that were not there at the start, both (N, 3)."""
    height = _heights(end, faces)
    if np.ptp(start[:, 2]) > 0.0:
        height -= _heights(start, faces)
    if (np.abs(height) > HIGH).mean() < MANY:
        return []
    # Neighbours on one side alone make no wave.
    height[boundary_edges(faces)] = 0.0
    size = float(np.sqrt((height**2).mean()))
    if size < WAVY or (np.abs(height) > HIGH).mean() < MANY:
        return []
    alike = float(height @ _neighbours(height[:, None], faces)[:, 0]) / (len(height) * size**2)
    if alike > ALIKE and (np.abs(height) > STEEP).mean() < MANY:
        return []
    return [
        f"short waves: points of the untorn sheet end {size:.2g} spacings over or under their neighbours, in waves of "
        "a few spacings, which families average, so that they cost little energy; expected more points, or tension in "
        "every direction"
    ]


def _neighbours(values: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Mean of values (N, C) over the other corners of the triangles of each point, (N, C)."""
    points, others = len(values), values[faces].sum(axis=1)[:, None] - values[faces]
    count = 2 * np.maximum(np.bincount(faces.ravel(), minlength=points), 1)
    sums = [np.bincount(faces.ravel(), others[..., c].ravel(), minlength=points) for c in range(values.shape[1])]
    return np.asarray(np.stack(sums, axis=1) / count[:, None])


def _heights(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Height of each point under the mean of its neighbours along its normal, over their spacing [-], (N,)."""
    areas = doubled_normals(positions, faces)
    normals = vector_sums(areas, faces, len(positions))
    size = np.linalg.norm(normals, axis=1)
    unit = normals / np.where(size > 0.0, size, 1.0)[:, None]
    around = np.bincount(faces.ravel(), np.repeat(np.linalg.norm(areas, axis=1), 3), minlength=len(positions))
    spacing = np.sqrt(around / np.maximum(np.bincount(faces.ravel(), minlength=len(positions)), 1))
    height = ((_neighbours(positions, faces) - positions) * unit).sum(axis=1)
    return np.asarray(height / np.where(spacing > 0.0, spacing, 1.0))


def _turned_over(positions: np.ndarray, normals: np.ndarray, tolerance: float) -> int:
    """Number of triangles whose side differs from that of most, if the points are in a plane within a tolerance [m]."""
    centred = positions - positions.mean(axis=0)
    across = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    if np.abs(centred @ across).max() > tolerance:
        return 0
    seen = normals @ across
    least = NO_AREA * np.abs(seen).mean()
    return int(min((seen > least).sum(), (seen < -least).sum()))


# Energy out of nowhere, over the largest energy or work so far, at which a run counts as diverged.
MAX_GAIN = 0.5
# A step so much shorter than the stable one is not why a run diverged.
SHORT = 1.0 / 16.0
# Mean square of a motion that moves nothing, over the square of the size of the sheet; angle of a large turn.
NOTHING, LARGE_TURN = 1e-12, 0.5
# Change of the energy balance between two frames, over the same, above which the steps are too long; and the change
# above which they are if the balance is off by more than MAX_CHANGE already, and becomes worse.
MAX_CHANGE, MAX_DRIFT = 0.01, 0.001


class Soundness:
    """Checks the state of a run at its frames.

    Attributes:
        stable_dt: Latest stable step [s], or None.
        last_time: Time of the last sound frame [s]; None before the first.
    """

    def __init__(self, built: Built) -> None:
        self.built = built
        self.stable_dt: float | None = None
        self.last_time: float | None = None

    def require_finite(self, index: int, now: float, dt: float, totals: Mapping[str, float]) -> None:
        """Raise DivergedError if the state is NaN or Inf, or a point moves more than a horizon in a step."""
        built = self.built
        bad = built.checks.first_not_finite()
        if bad is None and np.isfinite(totals.get("strain", 0.0)):
            # Implicit steps have no stable step, and may be long.
            moved = 0.0 if self.stable_dt is None else built.checks.top_speed() * dt
            if moved > built.law.families.horizon:
                raise self._too_fast(index, now, dt)
            return
        raise self._not_finite(bad, index, now, dt)

    def _not_finite(self, bad: int | None, index: int, now: float, dt: float) -> DivergedError:
        built = self.built
        sheet = built.context.whole
        where = "the strain energy" if bad is None else f"point {bad} at {sheet.points[bad].tolist()}"
        last, load_duration = self.last_time or 0.0, built.simulation.load_duration
        if index == 0:
            between = "is NaN or Inf at the start"
        elif load_duration is None:
            between = f"became NaN or Inf between t = {last:.6g} s and t = {now:.6g} s (frame {index})"
        else:
            between = f"became NaN or Inf beyond {format_time(last, load_duration)}"
        return DivergedError(f"diverged: {where} {between}; likely cause: {self.cause(dt, now)}")

    def _too_fast(self, index: int, now: float, dt: float) -> DivergedError:
        built = self.built
        speed = np.linalg.norm(built.to_numpy(built.state.velocity), axis=1)
        fastest = int(speed.argmax())
        when = format_time(now, built.simulation.load_duration)
        return DivergedError(
            f"diverged: point {fastest} moves more than a horizon in one step at {when} "
            f"(|v| = {speed[fastest]:.4g} m/s, frame {index}); likely cause: {self.cause(dt, now)}"
        )

    def require_no_gain(self, row: Mapping[str, float], index: int, dt: float) -> None:
        """Raise DivergedError if the sheet has more energy than was ever put in."""
        if row.get("balance_error", 0.0) > MAX_GAIN:
            raise DivergedError(
                f"diverged: at t = {row['time']:.6g} s (frame {index}) the sheet has more energy than was ever put "
                f"in, balance error {100.0 * row['balance_error']:.0f} %; likely cause: {self.cause(dt, row['time'])}"
            )

    def require_balance(self, gain: float, error: float, index: int) -> None:
        """Raise UnbalancedError if `gain`, the energy gained since the last frame over the largest, is not small.

        `error` is the energy gained since the start, over the same.
        """
        drifts = abs(error) > MAX_CHANGE and abs(gain) > MAX_DRIFT and gain * error > 0.0
        if abs(gain) > MAX_CHANGE or drifts:
            raise UnbalancedError(f"the energy balance changes by {100.0 * gain:+.2g} % in frame {index}")

    def cause(self, dt: float, now: float) -> str:
        """Likely cause of divergence at time `now` [s] with the step dt [s]."""
        if self.last_time is None:
            return "the initial displacement strains the sheet more than its material allows"
        if self.built.simulation.load_duration is not None:
            ramp = getattr(self.built.simulation.solver, "ramp_steps", None)
            slower = "" if ramp is None else f", or more ramp_steps, over which a load step is applied (here {ramp})"
            return (
                "no equilibrium near the last good load step, or the load rose faster than the solver followed; "
                f"try a smaller load, or more load_steps{slower}"
            )
        if self.stable_dt is not None and dt > self.stable_dt * (1.0 + 1e-9):
            return f"the step {dt:.4g} s is above the stable step {self.stable_dt:.4g} s"
        if self.stable_dt is not None:
            # Nothing passes more than a horizon in a stable step.
            wave = self.built.law.families.horizon / self.stable_dt
            at = self.built.context.clamped_positions
            speed = max((c.top_speed(at[c.points], now) for c in self.built.constraints), default=0.0)
            if speed > wave:
                return (
                    f"supports move points at {speed:.4g} m/s, faster than any wave in this sheet (below {wave:.4g} "
                    "m/s); "
                    "try a slower motion"
                )
        if self.stable_dt is not None and dt <= SHORT * self.stable_dt and self._pressed_apart():
            return (
                "a load that follows the sheet pulls what is left of it apart without end; let it fall after the burst "
                "(ramp), take an EnclosedGas with a leak, or end the run before"
            )
        # Half the step; where nothing resisted so far no step was unstable.
        return self.built.law.likely_cause(max(0.5 * dt / (self.stable_dt or dt), 0.01))

    def _pressed_apart(self) -> bool:
        """Whether the sheet is torn and loaded by forces that depend on its displacement."""
        rupture = self.built.rupture
        return rupture is not None and bool(self.built.external.following) and not rupture.intact_faces.numpy().all()


def free_motions(built: Built) -> int:
    """Number of rigid-body motions that the supports leave free, 0 to 6; a turn is free if it may be large.

    Of the sheet where it starts: its pieces may be placed, and flat ones arched.
    """
    at = built.context.given.positions + built.simulation.initial("initial_displacement")
    at = at - at.mean(axis=0)
    at = at / max(float(np.abs(at).max()), 1e-300)
    held = np.zeros(at.shape, bool)
    for constraint in built.constraints:
        held[constraint.points] |= [bool(constraint.components & (1 << c)) for c in range(3)]
    shift = np.broadcast_to(np.eye(3)[:, None], (3, *at.shape))
    modes = np.concatenate([shift, np.cross(np.eye(3)[:, None], at[None])]).reshape(6, -1)
    free = _unmoved(modes[:, held.ravel()])
    # Points on a line do not notice a turn about it.
    unseen = _unmoved(modes)
    free = free - unseen @ (unseen.T @ free)
    free = np.linalg.svd(free, full_matrices=False)[0][:, : free.shape[1] - unseen.shape[1]]
    # Free translations first: what is left of each other motion turns the sheet.
    combined = np.linalg.svd(free[3:])[2].T if free.shape[1] else np.zeros((0, 0))
    motions = [free @ combined[:, k] for k in range(free.shape[1])]
    return sum(_stays_free(motion[:3], motion[3:], at, held) for motion in motions)


def _unmoved(modes: np.ndarray) -> np.ndarray:
    """Combinations of six motions, one a column, that move none of the components; `modes` has shape (6, K)."""
    values, vectors = np.linalg.eigh(modes @ modes.T / max(modes.shape[1], 1))
    return np.asarray(vectors[:, values < NOTHING])


def _stays_free(shift: np.ndarray, turn: np.ndarray, at: np.ndarray, held: np.ndarray) -> bool:
    """Whether a motion that moves no held component if it is small moves none if it is large."""
    size = float(np.linalg.norm(turn))
    if size < 1e-6 * float(np.linalg.norm(shift)):
        return True
    axis = turn / size
    foot = np.cross(axis, shift) / size
    along = float(shift @ axis) / size
    arm = at - foot
    across = np.cross(axis, arm)
    moved = (
        np.sin(LARGE_TURN) * across + (1.0 - np.cos(LARGE_TURN)) * np.cross(axis, across) + along * LARGE_TURN * axis
    )
    return float(np.abs(moved[held]).max(initial=0.0)) < 1e-6
