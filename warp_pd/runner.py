"""Run a simulation: frames, energy balance, outputs, restart."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from . import restart
from .checks import InputError, code_of_a_user, kind_and_text
from .forces.neural import outside_count
from .frame import Frame, moment
from .launches import run_once
from .output.background import Background
from .simulation import Built, Measure, Outcome, Simulation

FINISHED, DIVERGED, NOT_CONVERGED, STOPPED = "finished", "diverged", "not converged", "interrupted"


# Energy out of nowhere, over the most energy or work so far, at which a run counts as diverged.
MOST_GAIN = 0.5
# Restart files of a run, about: each makes the writers bring their files to the disk.
RESTARTS = 40


class Writer(Protocol):
    """Looks at frames from outside; the simulation does not know what becomes of them."""

    def write(self, frame: Frame) -> None:
        """Take one frame."""
        ...

    def save(self) -> None:
        """Bring everything written so far to the disk, so that a restart can go on from here."""
        ...

    def close(self) -> None:
        """The run is over."""
        ...


class DivergedError(RuntimeError):
    """The run stopped being finite; the message says where, when, and the likely cause."""


@dataclass
class Result:
    """What a run leaves.

    Attributes:
        summary: Content of summary.json.
        history: One row a frame: time (at rest the load time), energies, ball reaction, largest damage, measures.
        built: The simulation as it ended.
        frame: The last frame.
        folder: Where the files are, or None.
    """

    summary: dict[str, Any]
    history: list[dict[str, float]]
    built: Built
    frame: Frame
    folder: Path | None = None

    @property
    def status(self) -> str:
        """How the run ended: "finished", "diverged", "not converged" or "interrupted"."""
        return str(self.summary["status"])


@dataclass(eq=False)
class Recorder:
    """Turns the state on the device into frames, and checks it on the way.

    Attributes:
        built: The simulation.
        writers: Take the frames.
        reporter: Shows progress, or None.
        folder: For the restart file and the history, or None.
        parts: What a restart file belongs to, see `restart.parts`.
        files: The one of the writers that works in a thread of its own, which writes the restart file too, or None.
    """

    built: Built
    writers: list[Writer]
    reporter: Any = None
    folder: Path | None = None
    parts: dict[str, str] = field(default_factory=dict)
    files: Background | None = None
    frame_index: int = -1
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0
    stable_dt: float | None = None
    since_estimate: int = 0
    residual: float | None = None
    solve: dict[str, Any] | None = None
    history: list[dict[str, float]] = field(default_factory=list)
    last: Frame | None = None
    step_seconds: float = 0.0
    stop_asked: bool = False
    _clock: float = field(default_factory=perf_counter)

    def progress(self, steps: int, residual: float, tolerance: float) -> None:
        """Report a run at rest on its way; stops it if the user asked for that."""
        if self.stop_asked:
            raise KeyboardInterrupt
        if self.reporter is not None:
            self.reporter.residual(steps, residual, tolerance)

    def frame(self, index: int, now: float, steps: int, dt: float) -> None:
        """Check the state, hand it to the writers, and save it for a restart.

        Raises:
            DivergedError: if it is not finite any more; nothing of it is written.
        """
        built = self.built
        run_once(built.workspace.device, built.workspace.stages["frame"])
        totals = built.totals()
        self._require_finite(index, now, dt, totals)
        self.step_seconds += perf_counter() - self._clock
        elapsed = now - self.time
        frame = snapshot(built, index, now)
        row = self._row(frame, totals, elapsed, dt)
        self._require_no_gain(row, index, dt)
        self.history.append(row)
        self.frame_index, self.time, self.dt = index, now, dt
        self.steps += steps
        for writer in self.writers:
            writer.write(frame)
        self.last = frame
        if self.folder is not None:
            write_history(self.folder / "history.csv", self.history)
            if self._restart_due(index):
                self._save(self.folder / restart.NAME)
        if self.reporter is not None:
            self.reporter.frame(self)
        self._clock = perf_counter()
        if self.stop_asked:
            raise KeyboardInterrupt

    def _save(self, path: Path) -> None:
        for writer in self.writers:
            if writer is not self.files:
                writer.save()
        assert self.files is not None
        self.files.save_then(partial(restart.save, path, restart.collect(self)))

    def _restart_due(self, index: int) -> bool:
        """At the first and last frame, when the user stops the run, and some forty times in between."""
        frames = self.built.simulation.solver.frame_count
        return self.stop_asked or index in (0, frames) or index % max(1, frames // RESTARTS) == 0

    def _require_finite(self, index: int, now: float, dt: float, totals: dict[str, float]) -> None:
        built = self.built
        n = built.simulation.sheet.size
        bad = int(built.not_finite.numpy().min())
        if bad == n and np.isfinite(totals.get("strain", 0.0)):
            self._require_slow(index, now, dt)
            return
        where = f"point {bad} at {built.simulation.sheet.points[bad].tolist()}" if bad < n else "the strain energy"
        between = f"stopped being finite between t = {self.time:.6g} s and t = {now:.6g} s (frame {index})"
        if not built.simulation.solver.in_time:
            between = f"stopped being finite beyond {moment(self.time, built.load_duration)}"
        if index == 0:
            between = "is not finite at the start"
        raise DivergedError(f"diverged: {where} {between}; likely cause: {self._cause(dt)}")

    def _require_slow(self, index: int, now: float, dt: float) -> None:
        built = self.built
        if np.sqrt(built.fastest.numpy().max()) * dt > built.force.families.horizon:
            speed = np.linalg.norm(built.to_numpy(built.state.velocity), axis=1)
            fastest = int(speed.argmax())
            when = moment(now, built.load_duration)
            raise DivergedError(
                f"diverged: point {fastest} moves more than a horizon in one step at {when} "
                f"(|v| = {speed[fastest]:.4g} m/s, frame {index}); likely cause: {self._cause(dt)}"
            )

    def _require_no_gain(self, row: dict[str, float], index: int, dt: float) -> None:
        if row.get("balance_error", 0.0) > MOST_GAIN:
            raise DivergedError(
                f"diverged: at t = {row['time']:.6g} s (frame {index}) the sheet holds more energy than was ever put "
                f"in, balance error {100.0 * row['balance_error']:.0f} %; likely cause: {self._cause(dt)}"
            )

    def _cause(self, dt: float) -> str:
        built = self.built
        if self.last is None:
            return "the initial displacement strains the sheet more than its material bears"
        if not built.simulation.solver.in_time:
            return (
                "no equilibrium near the last good load step, or the load rose faster than the relaxation followed; "
                "try a smaller load, or more load_steps or ramp_steps"
            )
        if self.stable_dt is not None and dt > self.stable_dt * (1.0 + 1e-9):
            return f"the step {dt:.4g} s is above the stable step {self.stable_dt:.4g} s"
        return self._cause_in_law()

    def _cause_in_law(self) -> str:
        built = self.built
        lock = getattr(built.simulation.force.material, "lock", None)
        if lock is not None:
            return f"the Gent lock Jm = {lock:g} was reached, or the sheet stiffened faster than the step followed"
        if built.force.internal and getattr(built.simulation.force, "update", "exact") == "series":
            return "a Prony term relaxed within a step, which the series update does not follow; try update 'exact'"
        if not built.force.has_energy:
            return "the law has no energy: it can pump it in; try damping or the law bond_associated"
        if built.force.weights == "published":
            return "the published weights have no energy: they can pump it in once bonds break; try weights 'plain'"
        torn = ", as torn edges do" if built.breakable else ""
        return f"the sheet stiffened faster than the step followed{torn}; try a smaller safety"

    def _row(self, frame: Frame, totals: dict[str, float], elapsed: float, dt: float) -> dict[str, float]:
        built, state = self.built, self.built.state
        row: dict[str, float] = {"time": frame.time, "step": dt}
        row.update({name: totals[name] for name in ("kinetic", "strain") if name in totals})
        if built.tracked:
            for name in ("external", "damping", "rupture"):
                if name != "rupture" or built.force.has_energy:
                    row[name] = totals.get(name, 0.0)
            if built.force.has_energy:
                if "viscous" in totals:
                    row["viscous"] = totals["viscous"]
                row["balance_error"] = self._balance_error(row)
        if getattr(built.force, "outside", None) is not None:
            row["bonds_outside_training"] = float(outside_count(built.force))
        if state.impulse is not None:
            state.impulse.zero_()
            for name in "xyz":
                row[f"ball_force_{name}"] = -totals[f"impulse_{name}"] / elapsed if elapsed > 0.0 else 0.0
        if frame.damage is not None:
            row["largest_damage"] = float(frame.damage.max())
            row["mean_damage"] = float(frame.damage.mean(dtype=np.float64))
        if built.simulation.measures:
            frame = frame.in_double()
        for measure in built.simulation.measures:
            value = _given(measure, built, frame)
            row[measure.name] = math.nan if value is None else value
        return row

    def _balance_error(self, row: dict[str, float]) -> float:
        """(Energy now - energy first - work + losses) over the largest energy or work so far."""
        first = self.history[0] if self.history else row
        change = row["kinetic"] + row["strain"] - first["kinetic"] - first["strain"]
        error = change - row["external"] + row["damping"] + row["rupture"] + row.get("viscous", 0.0)
        if "viscous" in row:
            error -= first["viscous"]
        rows = [*self.history, row]
        scale = max(max(abs(r["external"]), abs(r["kinetic"] + r["strain"])) for r in rows)
        return error / scale if scale > 0.0 else 0.0


def snapshot(built: Built, index: int, now: float) -> Frame:
    """The state as a frame; the launches of the "frame" stage have run."""
    contact, ball = built.simulation.contact, None
    if contact is not None:
        ball = np.array(contact.start, float) + now * np.array(contact.velocity, float)
    energy = built.strain_energy
    return Frame(
        index=index,
        time=now,
        displacement=built.to_host(built.state.displacement),
        velocity=built.to_host(built.state.velocity),
        intact_faces=None if built.intact is None else built.to_host(built.intact).view(bool),
        damage=None if built.damage is None else built.to_host(built.damage),
        ball_center=ball,
        point_data={
            **({} if energy is None else {"strain_energy_density": energy.numpy() / built.volume}),
            **{name: built.to_host(array) for name, array in built.fields.items()},
        },
    )


def run(
    simulation: Simulation,
    *,
    out: str | Path | None = None,
    device: str | None = None,
    precision: int | None = None,
    resume: bool = False,
    usd: bool = True,
    reporter: Any = None,
    writers: list[Writer] | None = None,
    pictures: bool = True,
) -> Result:
    """Run a simulation to its end.

    Args:
        simulation: What to run.
        out: Folder for frames.vtkhdf, animation.usd, history.csv, restart.npz, summary.json and pictures;
            None writes nothing.
        device: "cpu", "cuda:0", ...; CUDA by default where there is one.
        precision: 32 or 64; by default the solver's.
        resume: Go on from the restart file in `out`.
        usd: Whether to write animation.usd.
        reporter: Shows progress; see `output.progress`.
        writers: More writers of frames.
        pictures: Whether to draw the scene's pictures.

    Raises:
        InputError: for input that cannot be run, before anything is written.
        DivergedError: if not even the first frame is finite; `out` holds nothing then.

    Returns:
        The result; `status` says whether the run finished, diverged, did not converge or was interrupted.
    """
    begin = perf_counter()
    built = simulation.build(device, precision)
    folder = _writable_folder(out, resume)
    parts = restart.parts(simulation, built)
    saved = restart.load(folder / restart.NAME, parts, simulation.settings) if resume and folder is not None else None
    if folder is not None:
        _clear_unfinished(folder)
        if saved is None:
            _clear(folder)
    if reporter is not None:
        reporter.begin(built)
    compile_seconds = built.workspace.compile()
    if reporter is not None:
        reporter.compiled(compile_seconds)
    recorder = Recorder(built, list(writers or []), reporter, folder, parts)
    if saved is not None:
        restart.restore(saved, recorder)
    else:
        built.force.start()
    run_once(built.workspace.device, built.workspace.stages["setup"])
    if folder is not None:
        append_from = None if saved is None else recorder.frame_index + 1
        recorder.files = Background(_file_writers(built, folder, usd, append_from))
        recorder.writers.append(recorder.files)
    setup_seconds = perf_counter() - begin - compile_seconds
    status, message = FINISHED, ""
    restore_signal = _stop_at_frames(recorder)
    try:
        if saved is None:
            recorder._clock = perf_counter()
            recorder.frame(0, 0.0, 0, 0.0)
        else:
            recorder.last = _resumed_frame(recorder)
        recorder._clock = perf_counter()
        status = simulation.solver.march(built, recorder)
        if status == NOT_CONVERGED:
            message = _not_converged(recorder)
    except DivergedError as error:
        status, message = DIVERGED, str(error)
    except KeyboardInterrupt:
        status, message = STOPPED, "interrupted: --resume goes on from here"
    finally:
        restore_signal()
        for writer in recorder.writers:
            writer.close()
        if reporter is not None:
            reporter.close()
    if recorder.last is None:
        raise DivergedError(message) if status == DIVERGED else KeyboardInterrupt
    summary = _summary(recorder, status, message, setup_seconds, compile_seconds, perf_counter() - begin)
    result = Result(summary, recorder.history, built, recorder.last.in_double(), folder)
    if folder is not None:
        before = {p.name: p.stat().st_mtime_ns for p in folder.glob("*.png")}
        # First, so that a picture that cannot be drawn does not take the numbers with it.
        write_aside(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
        if pictures and simulation.pictures is not None:
            draw(simulation, result.history, folder)
        summary["pictures"] = sorted(p.name for p in folder.glob("*.png") if p.stat().st_mtime_ns != before.get(p.name))
        write_aside(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    return result


def draw(simulation: Simulation, history: list[dict[str, float]], folder: Path) -> None:
    """Draw the scene's pictures.

    Raises:
        InputError: if its function raises, as on frames that are damaged.
    """
    assert simulation.pictures is not None
    with code_of_a_user(lambda error: f"pictures: {kind_and_text(error)}; the results are in {folder}"):
        simulation.pictures(history, folder)


def _not_converged(recorder: Recorder) -> str:
    assert recorder.solve is not None
    return (
        f"not converged: the residual is {recorder.residual:.3g} after {recorder.solve['iterations']} iterations; "
        f"the last good load step is at {100.0 * recorder.solve['reached']:.4g} % of the path"
    )


def _stop_at_frames(recorder: Recorder) -> Callable[[], None]:
    """Make Ctrl-C (or SIGTERM) end the run at the next frame, a second one at once; returns what undoes this."""
    if threading.current_thread() is not threading.main_thread():
        return lambda: None
    earlier = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}

    def ask(number: int, stack: Any) -> None:
        if recorder.stop_asked:
            raise KeyboardInterrupt
        recorder.stop_asked = True

    def undo() -> None:
        for number, handler in earlier.items():
            signal.signal(number, handler)

    for number in earlier:
        signal.signal(number, ask)
    return undo


def _resumed_frame(recorder: Recorder) -> Frame:
    run_once(recorder.built.workspace.device, recorder.built.workspace.stages["frame"])
    return snapshot(recorder.built, recorder.frame_index, recorder.time)


def _writable_folder(out: str | Path | None, resume: bool) -> Path | None:
    if out is None:
        if resume:
            raise InputError("resume = True: allowed only with a folder that holds a restart file")
        return None
    if not str(out):
        raise InputError("out = '': allowed is a folder that can be written")
    folder = Path(out)
    if resume and not folder.is_dir():
        raise InputError(f"resume from {str(folder)!r}: the folder does not exist; allowed is that of an earlier run")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".probe"
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise InputError(f"out = {str(folder)!r}: allowed is a folder that can be written ({error.strerror})") from None
    return folder


def _clear(folder: Path) -> None:
    """Remove what an earlier run left: it must not pass for this one's."""
    drawn: list[str] = []
    with contextlib.suppress(OSError, ValueError, AttributeError):
        drawn = json.loads((folder / "summary.json").read_text()).get("pictures", [])
    for name in ("summary.json", "history.csv", restart.NAME, "frames.vtkhdf", "animation.usd", *drawn):
        (folder / Path(name).name).unlink(missing_ok=True)


def _clear_unfinished(folder: Path) -> None:
    """Remove what a killed run was about to write; no resumed one reads it."""
    for pattern in (".animation.*.usdc", ".frames.vtkhdf.unfinished", "summary.json.part", "history.csv.part",
                    f"{restart.NAME}.part", "*.png.part"):  # fmt: skip
        for path in folder.glob(pattern):
            path.unlink()


def _file_writers(built: Built, folder: Path, usd: bool, append_from: int | None) -> list[Writer]:
    from .output.vtkhdf import VtkHdfSeries

    surface, frames = built.surface(), folder / "frames.vtkhdf"
    if append_from is not None and not frames.is_file():
        raise InputError(f"resume from {str(folder)!r}: allowed is a folder that still has its {frames.name}")
    writers: list[Writer] = [VtkHdfSeries(frames, surface, append_from=append_from)]
    if usd:
        from .output.usd import UsdAnimation

        solver = built.simulation.solver
        equal = solver.in_time and (solver.frame_count == 1 or isinstance(getattr(solver, "frames", None), int))
        per_frame = solver.duration / solver.frame_count if equal else None
        writers.append(
            UsdAnimation(folder / "animation.usd", surface, seconds_per_frame=per_frame, append_from=append_from)
        )
    return writers


def read_history(path: Path) -> list[dict[str, float]]:
    """What `write_history` wrote.

    Raises:
        InputError: if it is not there or not whole.
    """
    try:
        with path.open(newline="") as stream:
            history = [{key: float(text) for key, text in row.items()} for row in csv.DictReader(stream)]
    except (OSError, ValueError, TypeError):
        history = []
    if not history:
        raise InputError(f"file = {str(path)!r}: allowed is the history.csv of a run")
    return history


def write_aside(path: Path, text: str) -> None:
    """Write a file beside its place and move it there when it is whole."""
    aside = path.with_name(path.name + ".part")
    aside.write_text(text)
    os.replace(aside, path)


def write_history(path: Path, history: list[dict[str, float]]) -> None:
    """History as CSV, one row a frame."""
    aside = path.with_name(path.name + ".part")
    with aside.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(history[-1]))
        writer.writeheader()
        writer.writerows(history)
    os.replace(aside, path)


def _notes(built: Built, history: list[dict[str, float]]) -> list[str]:
    """What a user should know of this run, one line each."""
    notes = list(built.simulation.notes)
    if not built.force.has_energy:
        notes.append("energy: the law has no potential, so there is no strain energy and no balance to report")
    left = [row.get("bonds_outside_training", 0.0) for row in history]
    if left and max(left) > 0.0:
        worst = history[left.index(max(left))]
        least, most = built.simulation.force.loaded.stretches  # type: ignore[union-attr]
        notes.append(
            f"training range: up to {max(left):.0f} of {built.force.families.bond_count} bonds (at "
            f"{moment(worst['time'], built.load_duration)}) were outside the principal stretches {least:g} to {most:g} "
            f"that the network knows"
        )
    return notes


def _given(item: Measure | Outcome, *arguments: Any) -> float | None:
    """What the function of a reported number gives.

    Raises:
        InputError: if it raises, or gives neither a number nor None.
    """
    what = f"{type(item).__name__} {item.name!r}"
    with code_of_a_user(lambda error: f"{what}: {kind_and_text(error)}"):
        value = item.value(*arguments)
    try:
        return None if value is None else float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} gives {value!r}: allowed is a number") from None


def _compared(item: Measure | Outcome, value: float | None, of: str) -> dict[str, Any]:
    """Value, unit and reference of a reported number; a number that does not exist (yet) is None."""
    if value is not None and not np.isfinite(value):
        value = None
    known = item.reference is not None and value is not None
    return {
        "value": value,
        "unit": item.unit,
        "of": of,
        "reference": item.reference,
        "source": item.source,
        "error": value / item.reference - 1.0 if known else None,  # type: ignore[operator]
    }


def _summary(
    recorder: Recorder, status: str, message: str, setup: float, compiling: float, wall: float
) -> dict[str, Any]:
    built, simulation = recorder.built, recorder.built.simulation
    row = recorder.history[-1] if recorder.history else {}
    force = built.force
    energy = {
        "kinetic": row.get("kinetic"),
        "strain": row.get("strain"),
        "external": row.get("external"),
        "dissipated": {name: row[name] for name in ("damping", "rupture", "viscous") if name in row}
        if built.tracked
        else None,
        "balance_error": row.get("balance_error"),
    }
    # The start of a search that found nothing is no result.
    found = recorder.frame_index > 0 or simulation.solver.in_time
    measures = {m.name: _compared(m, row.get(m.name) if found else None, "last frame") for m in simulation.measures}
    notes = _notes(built, recorder.history)
    for outcome in simulation.outcomes:
        value = None
        try:
            value = _given(outcome, recorder.history) if found else None
        except InputError as error:
            # The run is over: the other numbers must not go with this one.
            notes.append(str(error))
        measures[outcome.name] = _compared(outcome, value, "whole run")
    rate = built.simulation.sheet.size * recorder.steps / recorder.step_seconds if recorder.step_seconds else 0.0
    return {
        "scene": simulation.scene,
        "file": simulation.file,
        "section": simulation.section,
        "status": status,
        "message": message,
        "settings": simulation.settings,
        "device": str(built.workspace.device.name),
        "precision": built.types.bits,
        "force": type(simulation.force).__name__,
        "weights": force.weights,
        "horizon": simulation.force.horizon,
        "points": simulation.sheet.size,
        "bonds": force.families.bond_count,
        "steps": recorder.steps,
        "time": recorder.time if built.load_duration is None else None,
        "load_share": None if built.load_duration is None else recorder.time / built.load_duration,
        "dt": recorder.dt,
        "stable_dt": recorder.stable_dt,
        "residual": recorder.residual,
        "solve": recorder.solve,
        "wall_s": wall,
        "setup_s": setup,
        "compile_s": compiling,
        "point_steps_per_s": rate,
        "bytes_per_point": built.workspace.array_bytes() / simulation.sheet.size,
        "correction": force.correction,
        "energy": energy,
        "notes": notes,
        "measures": measures,
    }
