"""The recorder turns the state on the device into frames and rows of the history."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import math
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..device.checks import InputError, count, kind_and_text, show, user_code
from ..device.fields import Array
from ..device.version import __version__
from ..geometry.triangulation import CoarseLattice, lattice_triangles
from ..interfaces import FrameReport, History, Writer
from ..interfaces.frame import Frame, Surface, format_time
from ..kernels import numeric
from ..parts.frame_checks import placing_noise
from . import stopping
from .built import Built
from .checks import TIMED, ShapeWatch, Soundness, adapts_steps
from .scene import Measure, Reported

if TYPE_CHECKING:
    from ..output.progress import Progress

PACKAGE = Path(__file__).parents[1]


@functools.cache
def code_version() -> str:
    """Text such as "warp-pd 1.0.0 3f2a91c07b4e, Warp 1.19.0"; the hash is that of the package and its kernels.

    Scenes are left out: their own hash is compared.
    """
    text = hashlib.sha1()
    for folder in (PACKAGE, Path(numeric.__file__).parent):
        for file in sorted(folder.rglob("*.py")):
            name = file.relative_to(folder).as_posix()
            if not name.startswith(("scenes/", "kernels/")):
                text.update(f"{name}\n".encode() + file.read_bytes().replace(b"\r\n", b"\n"))
    return f"warp-pd {__version__} {text.hexdigest()[:12]}, Warp {wp.config.version}"


@functools.cache
def commit_of(checkout: Path) -> str | None:
    """The git commit of a checkout or a worktree when first asked for; None for another folder, or without git."""
    if not (checkout / ".git").exists():
        return None
    command = ["git", "-c", "safe.directory=*", "-C", str(checkout), "rev-parse", "HEAD"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        return subprocess.run(command, capture_output=True, encoding="ascii", check=True).stdout.strip()
    return None


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
    def _selection(self) -> slice | np.ndarray:
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
        triangles, places, named = scene.sheet.triangles, scene.sheet.points[self._selection], {}
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
        return None if placement is None else placement[self._selection]

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


# Restart files of a run, at most about, and seconds between two of a dynamic run: each makes the writers bring their
# files to the disk, and copies the animation.
RESTARTS, SECONDS_BETWEEN = 40, 1.0
# Seconds between two reports within a frame, and steps after which the time left is known.
SECONDS_SHOWN, STEPS_TIMED = 2.0, 100
# Error of the time left, as it was told, from which it is told again: seconds, and as a share of the longer one.
FAR_OFF = 10.0, 0.5
# Share of the time left that frames must have taken before it is checked: other programs slow a machine for moments.
ENOUGH = 0.05
# Errors of a measure that asks for what does not exist, and so fails in every frame; others, such as a division by
# zero, may be those of the first alone.
ALWAYS = (AttributeError, ImportError, LookupError, NameError, TypeError)


class FineHistory:
    """Rows of the history between frames; the sums stay on the device until the host reads them at the next frame.

    Attributes:
        rows: Rows so far, including those at frames.
    """

    def __init__(self, built: Built) -> None:
        self.built, self.rows = built, History()
        self._waiting: list[tuple[float, float, Array]] = []

    def keep(self, now: float, dt: float) -> None:
        """Store the sums at time `now` [s], after a step of dt [s], on the device."""
        # The row at a frame comes from the frame.
        self.built.context.run("frame")
        self._waiting.append((now, dt, self.built.sums.keep()))

    def end_frame(self, now: float, dt: float, totals: dict[str, float], begin: float) -> None:
        """Read the rows since the last frame, which was at time `begin` [s], and append the row of this frame."""
        before: dict[str, float] = {}
        kept = [(time, step, self.built.sums.totals(sums)) for time, step, sums in self._waiting]
        self._waiting = []
        last = now * (1.0 - 1e-12)
        for time, step, found in [*(row for row in kept if row[0] < last), (now, dt, totals)]:
            row: dict[str, float] = {"time": time, "step": step}
            for columns in self.built.columns:
                row |= columns.between(before, found, time - begin)
            self.rows.append(row)
            before, begin = found, time

    def forget(self) -> None:
        """Discard the rows since the last frame; the root process reads them."""
        self._waiting = []

    def resume(self, rows: History, now: float) -> None:
        """Take over the rows of a run resumed at time `now` [s]."""
        self.rows = [row for row in rows if row["time"] <= now * (1.0 + 1e-12)]


class TimeLeft:
    """Reports the progress between frames, and how long the run takes, unless its steps adapt.

    That is told once, and again where frames have become much slower or faster.
    """

    def __init__(self, built: Built, reporter: Progress) -> None:
        self._built, self._reporter, solver = built, reporter, built.simulation.solver
        # Time in the run [s] and clock from which on steps are timed; whether their result has been told.
        self._timed: tuple[float, float] | None = None
        self._told = adapts_steps(solver) or not solver.dynamic
        self._shown_at = perf_counter()
        # Clock at the end of the run, as it was told. Clock at the begin of the frame; seconds and time [s] of frames
        # since the last check.
        self._ends: float | None = None
        self.begin_frame(again=True)

    def show(self, now: float, dt: float, steps: int, since: float) -> None:
        """Show the progress after `steps` steps of a frame, begun at the clock `since` [s]; not too often."""
        clock = perf_counter()
        if clock < self._shown_at + SECONDS_SHOWN or steps < STEPS_TIMED:
            return
        self._shown_at = clock
        rate = steps / max(clock - since, 1e-9)
        duration = self._built.simulation.solver.duration
        self._reporter.between(now / duration, format_time(now, None), rate, (duration - now) / dt / rate)

    def foretell(self, now: float) -> None:
        """Once some steps have been timed, tell how long the run takes."""
        clock = perf_counter()
        if self._told or (self._timed is not None and (now <= self._timed[0] or clock < self._timed[1] + TIMED)):
            return
        # A GPU runs behind its launches.
        wp.synchronize_device(self._built.context.device)
        clock = perf_counter()
        if self._timed is None:
            # The first steps take longer.
            self._timed = now, clock
            return
        begun, at = self._timed
        self._told = True
        self._tell((self._built.simulation.solver.duration - now) * (clock - at) / (now - begun), clock)

    def begin_frame(self, again: bool = False) -> None:
        """A frame begins; with `again` it is computed again, in other steps than those before."""
        self._frame_at = perf_counter()
        if again:
            self._seconds, self._time = 0.0, 0.0

    def end_frame(self, before: float, now: float) -> None:
        """A frame from `before` to `now` [s] is computed: tell the time left again if it is far from what was told."""
        clock = perf_counter()
        self._seconds += clock - self._frame_at
        self._time += now - before
        if self._ends is not None:
            told = max(0.0, self._ends - clock)
            if self._seconds < max(TIMED, ENOUGH * told) or self._time <= 0.0:
                return
            left = (self._built.simulation.solver.duration - now) * self._seconds / self._time
            least, share = FAR_OFF
            if left > least and abs(left - told) > max(least, share * max(left, told)):
                self._tell(left, clock, " at the pace of the last frames")
        self._seconds, self._time = 0.0, 0.0

    def _tell(self, seconds: float, clock: float, how: str = "") -> None:
        from ..output.progress import duration_text

        self._ends = clock + seconds
        self._reporter.say(f"about {duration_text(max(1.0, seconds))} to go on this machine{how}")


@dataclass(eq=False)
class Recorder:
    """Records the frames of a run, checks them, and passes them to the writers; see `interfaces.FrameSink`.

    Attributes:
        reporter: Shows progress, or None.
        saved: Called after a frame whose restart file is due; or None.
        kept: Called after every frame, with the history; or None.
        solve: Report of a static solver, or None.
        last: The last frame, or None.
        step_seconds: Seconds spent in steps.
        fine: Rows between frames, or None.
        stop_asked: Whether the user asked to stop.
        finishing: Whether a frame is being recorded, after which a run that was asked to stop ends; or the run ends.
        repeated: Number of times that a frame was computed again.
        missing: For each measure that failed, the number of frames and the first reason.
        others: Names of pictures that were in the folder before the run.
        codes: Versions of the code that computed the run, each with the time from which on.
        shape: What frames show of the shape of the sheet; see `ShapeWatch`.
        notes: What is known about the run before it begins, one line each.
        points: The points stored in frames.
    """

    built: Built
    writers: list[Writer]
    reporter: Progress | None = None
    saved: Callable[[], None] | None = None
    kept: Callable[[History], None] | None = None
    frame_index: int = -1
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0
    stable_dt: float | None = None
    residual: float | None = None
    solve: dict[str, Any] | None = None
    history: History = field(default_factory=list)
    last: Frame | None = None
    step_seconds: float = 0.0
    fine: FineHistory | None = None
    stop_asked: bool = False
    finishing: bool = False
    repeated: int = 0
    missing: dict[str, dict[str, Any]] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)
    codes: list[list[str]] = field(default_factory=list)
    shape: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    points: FramePoints = field(init=False)

    def __post_init__(self) -> None:
        """Create the soundness checks."""
        self.soundness = Soundness(self.built)
        self.points = FramePoints(self.built)
        self._watch = ShapeWatch(self.built)
        placed, context = self.built.simulation.initial("initial_displacement"), self.built.context
        self._noise = placing_noise(context.whole, placed, context.bits)
        if self.built.simulation.has_fine_history:
            self.fine = FineHistory(self.built)
        self._clock = self._asked_at = perf_counter()
        self._saved_at = -math.inf
        self._left = None if self.reporter is None else TimeLeft(self.built, self.reporter)
        self.note_code()

    def note_code(self) -> None:
        """Remember the code that computes the run from now on."""
        now = code_version()
        if not self.codes or self.codes[-1][0] != now:
            self.codes.append([now, format_time(self.time, self.built.simulation.load_duration)])

    def start_clock(self) -> None:
        """Start counting the seconds spent in steps."""
        self._clock = perf_counter()

    def progress(self, steps: int, residual: float, tolerance: float, round_of: str = "") -> None:
        """Report the progress of a static solver, and stop it if the user asked to."""
        if self.built.context.communicator.any(self.stop_asked):
            raise KeyboardInterrupt
        if self.reporter is not None:
            self.reporter.residual(steps, residual, tolerance, round_of)

    def say(self, line: str) -> None:
        """Tell the user something during the run."""
        if self.reporter is not None:
            self.reporter.note(line)

    @property
    def restarts(self) -> bool:
        """Whether a restart file may follow a frame."""
        return self.saved is not None

    @property
    def alone(self) -> bool:
        """Whether no other process shares the sheet."""
        return self.built.context.communicator.size == 1

    def ask_to_stop(self) -> None:
        """Make the run end at the next frame, or during a long one."""
        self.stop_asked, self._asked_at = True, perf_counter()
        if self.reporter is not None:
            self.reporter.stops()

    def row(self, now: float, dt: float) -> None:
        """Record a row of the finer history."""
        if self.fine is not None:
            self.fine.keep(now, dt)

    def balance(self, now: float, dt: float) -> float | None:
        """Error of the energy balance after a step of dt [s] between frames, as in the history; None without one."""
        built = self.built
        if not built.energy.balances:
            return None
        built.context.run("frame")
        row = {"time": now, "step": dt} | built.columns[0].at_frame(built.sums.totals(), now - self.time)
        return built.energy.error(self.history, row, self._least_energy(now, dt))

    def stepped(self, now: float, dt: float, steps: int) -> None:
        """Show the progress and the time left between frames, from time to time."""
        if self._left is not None:
            self._left.foretell(now)
            self._left.show(now, dt, steps, self._clock)

    def keep_going(self) -> None:
        """Abort a long frame after the user asked to stop; a resumed run repeats its computation."""
        if self.built.context.communicator.any(self.stop_asked and perf_counter() - self._asked_at > stopping.PATIENCE):
            raise KeyboardInterrupt

    def repeat(self) -> None:
        """Forget what came after the last recorded frame: the solver computes the frame again."""
        self.repeated += 1
        if self.fine is not None:
            self.fine.forget()
        if self._left is not None:
            self._left.begin_frame(again=True)
        self.start_clock()

    def frame(self, index: int, now: float, steps: int, dt: float, strict: bool = False) -> None:
        """Check the state, pass it to the writers, and save it for a restart.

        Raises:
            DivergedError: if it is not sound; it is then not recorded.
            UnbalancedError: if `strict` and the energy balance changed much since the last frame; likewise.
        """
        self.finishing = True
        try:
            self._frame(index, now, steps, dt, strict)
        finally:
            self.finishing = False
        if self.stop_asked:
            raise KeyboardInterrupt

    def _frame(self, index: int, now: float, steps: int, dt: float, strict: bool) -> None:
        communicator = self.built.context.communicator
        self.stop_asked = communicator.any(self.stop_asked)
        self.built.context.run("frame")
        self.step_seconds += perf_counter() - self._clock
        self.start_clock()
        taken = communicator.root(lambda: self._take(index, now, dt, strict))
        if self._left is not None:
            self._left.end_frame(self.time, now)
        for part in self.built.parts:
            part.end_frame()
        communicator.root(lambda: None if taken is None else self._record(*taken, steps, dt))
        if self.fine is not None and not communicator.is_root:
            self.fine.forget()
        if self._left is not None:
            if index > 0:
                self._left.foretell(now)
            self._left.begin_frame()
        self.frame_index, self.time, self.dt = index, now, dt
        self.start_clock()

    def _take(self, index: int, now: float, dt: float, strict: bool) -> tuple[dict[str, float], Frame, Frame]:
        """The row of the history without measures, the frame to write, and the frame of all points for the measures."""
        totals = self.built.sums.totals()
        self.soundness.stable_dt = self.stable_dt
        self.soundness.require_finite(index, now, dt, totals)
        row = self._row(now, totals, now - self.time, dt)
        self.soundness.require_no_gain(row, index, dt)
        if strict and self.built.energy.balances:
            gain = self.built.energy.gain(self.history, row, self._least_energy(now, dt))
            self.soundness.require_balance(gain, row["balance_error"], index)
        if self.fine is not None:
            self.fine.end_frame(now, dt, totals, self.time)
        frame = measured = self.points.frame(index, now)
        if self.built.simulation.measures and not self.points.all:
            measured = FramePoints(self.built).frame(index, now)
        return row, frame, measured

    def _record(self, row: dict[str, float], frame: Frame, measured: Frame, steps: int, dt: float) -> None:
        """Evaluate the measures, pass the frame to the writers, and save it for a restart."""
        self._measure(measured, row)
        self.history.append(row)
        self.frame_index, self.time, self.dt = frame.index, frame.time, dt
        self.steps += steps
        for writer in self.writers:
            writer.write(frame)
        self.accept(frame)
        self._watch.look(self.points.surface, frame, self.shape)
        if self.kept is not None:
            self.kept(self.history)
        if self.saved is not None and self._restart_due(frame.index):
            self.saved()
            self._saved_at = perf_counter()
        if self.reporter is not None:
            self.reporter.frame(self._report(row))

    def _report(self, row: dict[str, float]) -> FrameReport:
        scene = self.built.simulation
        rate = self.steps / self.step_seconds if self.step_seconds > 0.0 else 0.0
        fraction = min(1.0, self.time / scene.solver.duration)
        if self.built.solver.turns:
            fraction = self.frame_index / scene.solver.frame_count
        when = format_time(self.time, scene.load_duration)
        return FrameReport(when, fraction, rate, scene.solver.frame_count, row)

    def shape_notes(self, interrupted: bool) -> list[str]:
        """Notes on the shape of the sheet; those on its end take seconds of a large sheet, and only a finished run."""
        return self._watch.notes(self.points.surface, None if interrupted else self.last, self.shape)

    def accept(self, frame: Frame) -> None:
        """Store a frame that has passed the checks as the last good one."""
        self.last, self.soundness.last_time = frame, frame.time

    def _restart_due(self, index: int) -> bool:
        """Whether to write a restart file: at the first and last frame, when stopped, and from time to time between."""
        solver = self.built.simulation.solver
        if self.stop_asked or index in (0, solver.frame_count):
            return True
        # What a load step costs is worth a restart file; and a search that fails leaves the last step to start from.
        waited = not solver.dynamic or perf_counter() - self._saved_at >= SECONDS_BETWEEN
        return waited and index % max(1, solver.frame_count // RESTARTS) == 0

    def _row(self, now: float, totals: dict[str, float], elapsed: float, dt: float) -> dict[str, float]:
        built = self.built
        row: dict[str, float] = {"time": now, "step": dt}
        balance, *of_parts = built.columns
        row |= balance.at_frame(totals, elapsed)
        if built.energy.balances:
            row["balance_error"] = built.energy.error(self.history, row, self._least_energy(now, dt))
        for columns in of_parts:
            for name, value in columns.at_frame(totals, elapsed).items():
                if name in row:
                    raise InputError(f"history: two parts report {name!r}: expected one")
                row[name] = value
        return row

    def _least_energy(self, now: float, dt: float) -> float:
        """Energy that round-off of the initial displacement may add until `now` [s] in steps of `dt` [s]."""
        return self._noise * (1.0 + now / dt) / dt**2 if dt > 0.0 else 0.0

    def _measure(self, frame: Frame, row: dict[str, float]) -> None:
        """Add the measures of the scene to a row."""
        built = self.built
        if built.simulation.measures:
            frame = frame.in_double()
        for measure in built.simulation.measures:
            try:
                reported = number_of(measure, built, frame)
            except InputError as error:
                if frame.index == 0 and _always_fails(error.__cause__):
                    raise InputError(f"Measure {measure.name!r}: {error}") from error
                # The other numbers of the run must not go with this one.
                reported = None
                self._miss(measure, frame, error)
            row[measure.name] = math.nan if reported is None else reported

    def _miss(self, measure: Measure, frame: Frame, error: InputError) -> None:
        """Count the frames in which a measure failed, and remember the first reason."""
        found = self.missing.setdefault(measure.name, {"frames": 0, "why": ""})
        found["frames"] += 1
        if found["frames"] == 1:
            when = format_time(frame.time, self.built.simulation.load_duration)
            found["why"] = f"first at {when} (frame {frame.index}): {error}"


def _always_fails(cause: BaseException | None) -> bool:
    """Whether a measure that failed in the first frame will fail in all others, too.

    A sum with None, or an entry of an empty array, may be one of a number that comes later.
    """
    of_none = isinstance(cause, TypeError) and "NoneType" in str(cause)
    of_nothing = isinstance(cause, IndexError) and str(cause).endswith("with size 0")
    return isinstance(cause, ALWAYS) and not of_none and not of_nothing


def number_of(item: Reported, *arguments: Any) -> float | None:
    """Evaluate the function of a measure or an outcome."""
    with user_code(kind_and_text):
        value = item.value(*arguments)
    single = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    try:
        if isinstance(single, str | bytes | bytearray):
            raise TypeError("text")
        return None if value is None else float(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"it returned {show(value)}: expected a number") from error
