"""The result of a run, its summary.json, and simulations, plans and results as text."""

from __future__ import annotations

import itertools
import os
import platform
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..device import kernel_cache
from ..device.checks import InputError, count, show
from ..device.version import __version__
from ..interfaces import History
from ..interfaces.frame import Frame
from ..interfaces.solver import STOPPED
from ..output.notebook import Page, data_frame, html_table
from . import VIEWERS
from .built import Built
from .recorder import Recorder, commit_of, number_of
from .scene import Outcome, Reported, Scene

if TYPE_CHECKING:
    from ..output.frames import Frames

# Units of columns that belong to no part; measures have their own.
UNITS = {"time": "s", "step": "s", "largest_damage": "1", "mean_damage": "1", "pressure": "Pa", "volume": "m^3"}


def short(part: Any) -> str:
    """A part in one line: point arrays are shown by their size, arguments at their default are omitted."""
    if isinstance(part, np.ndarray | range) or (isinstance(part, Sequence) and not isinstance(part, str | tuple)):
        return f"{len(part)} values"
    if isinstance(part, float):
        return f"{part:.6g}"
    if not is_dataclass(part) or isinstance(part, type):
        return show(part)
    shown: list[str] = []
    for each in fields(part):
        value = getattr(part, each.name)
        if not each.init or not each.repr or _same(value, each.default):
            continue
        text = f"{len(value)} points" if each.name in ("points", "spared") and np.ndim(value) else short(value)
        shown.append(text if not shown else f"{each.name}={text}")
    return f"{type(part).__name__}({', '.join(shown)})"


def _same(value: Any, default: Any) -> bool:
    try:
        return bool(value == default)
    except ValueError:
        return False


def scene_rows(scene: Scene) -> list[tuple[str, str]]:
    """Names and values that describe a scene."""
    rows = [("sheet", repr(scene.sheet)), ("force", short(scene.force)), ("solver", short(scene.solver))]
    rows += [("load", short(part)) for part in scene.loads]
    rows += [("contact", short(part)) for part in scene.contacts]
    rows += [("damage", short(scene.damage))] if scene.damage is not None else []
    rows += [("measures", ", ".join(item.name for item in scene.measures))] if scene.measures else []
    rows += [("outcomes", ", ".join(item.name for item in scene.outcomes))] if scene.outcomes else []
    return rows + ([("fields", ", ".join(scene.fields))] if scene.fields else [])


def result_rows(summary: Mapping[str, Any], folder: Any) -> list[tuple[str, str]]:
    """Names and values that describe how a run ended, and its measures with their references."""
    rows = [("status", summary["status"] + (f": {summary['message']}" if summary["message"] else ""))]
    rows.append(("points", f"{summary['points']}, horizon {summary['horizon']:g}, {summary['weights']} weights"))
    rows.append(("device", f"{summary['device']}, float{summary['precision']}"))
    rows.append(("steps", f"{summary['steps']} in {summary['wall_s']:.3g} s"))
    rows += [(name, measured(found)) for name, found in summary["measures"].items()]
    rows += [("note", note) for note in summary["notes"]]
    return rows + ([("folder", str(folder))] if folder is not None else [])


def measured(found: Mapping[str, Any]) -> str:
    """A reported number with its unit, reference and error."""
    unit = "" if found["unit"] == "1" else f" {found['unit']}"
    if found["value"] is None:
        return "none"
    text = f"{found['value']:.6g}{unit}"
    if found["reference"] is None:
        return text
    error = "" if found["error"] is None else f", error {100.0 * found['error']:+.3g} %"
    return f"{text} (reference {found['reference']:.6g}{unit}{error})"


def units_of(built: Built) -> dict[str, str]:
    """Known units of the columns of the history, by column name."""
    units = dict(UNITS)
    for columns in built.columns:
        units |= columns.units
    return units | {item.name: item.unit for item in built.simulation.measures}


ARRAYS = ("name", "shape", "type", "bytes", "per", "in restart", "asked for by")
LAUNCHES = ("stage", "kernel", "threads", "asked for by", "how often")


def plan(built: Built) -> str:
    """Every array and every launch of a simulation, with the part that owns it, as text.

    The two tables are arrays (name, shape, type, bytes, owner, purpose) and launches (name, threads, owner, frequency).
    """
    context, points = built.context, built.context.sheet.size
    lines = [f"{built.simulation.scene}: {points} points, float{context.bits}"]
    lines += [f"{built.law.label}: {built.law.force_path}", "", "arrays"]
    lines += _table(ARRAYS, _arrays(built))
    total = context.fields.nbytes
    lines += [f"  {total} bytes, {total / points:.1f} per point", "", "launches"]
    return "\n".join(lines + _table(LAUNCHES, _launches(built)))


def plan_values(built: Built) -> dict[str, Any]:
    """The contents of `plan`: entries "scene", "points", "precision", "force_path", "bytes", "arrays", "launches"."""
    context = built.context
    return {
        "scene": built.simulation.scene,
        "points": context.sheet.size,
        "precision": context.bits,
        "force_path": f"{built.law.label}: {built.law.force_path}",
        "bytes": context.fields.nbytes,
        "arrays": [dict(zip(ARRAYS, row, strict=True)) for row in _arrays(built)],
        "launches": [dict(zip(LAUNCHES, row, strict=True)) for row in _launches(built)],
    }


def _arrays(built: Built) -> list[tuple[str, ...]]:
    return [
        (
            s.name, "x".join(map(str, s.array.shape)), _type_name(s.array.dtype), f"{s.nbytes}", s.field.per,
            "yes" if s.field.restart else "", s.owner,
        )
        for s in built.context.fields
    ]  # fmt: skip


def _launches(built: Built) -> list[tuple[str, ...]]:
    launches: list[tuple[str, ...]] = []
    for stage in built.context.stages.values():
        counted = Counter((x.name, x.threads, x.owner, x.every, x.since) for x in stage)
        for (name, threads, owner, every, since), times in counted.items():
            often = stage.when if every == 1 else f"{stage.when}, once in {every}"
            often = f"{often}, from {since}" if since else often
            often = often if times == 1 else f"{often}, {times} times"
            launches.append((stage.name, name, f"{threads}", owner, often))
        if stage.wraparound is not None:
            joined = stage.wraparound
            when = "between two steps, for the end and the beginning"
            launches.append((stage.name, joined.name, f"{joined.threads}", joined.owner, when))
    return launches


def _type_name(dtype: object) -> str:
    name = str(getattr(dtype, "__name__", dtype))
    length = getattr(dtype, "_shape_", None)
    if length is not None:
        scalar = getattr(dtype, "_wp_scalar_type_", None)
        return f"{getattr(scalar, '__name__', '')}[{'x'.join(map(str, length))}]"
    return name


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(r[c]) for r in [header, *rows]) for c in range(len(header))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(r, widths, strict=True)).rstrip() for r in [header, *rows]
    ]


# What an outcome is of; a measure is of the last frame.
WHOLE_RUN = "whole run"
# Error of the energy balance, and energy that breaking bonds adds over the largest energy, from which a note says so.
WORST_BALANCE, WORST_GAIN = 0.01, 0.01
# Change of the velocity of a motion at once, over the largest velocity, that is a jump.
ABRUPT = 0.5


@dataclass(frozen=True)
class Seconds:
    """Wall time of a run [s]: to build it, to compile or load its kernels, and in total."""

    setup: float
    compile: float
    wall: float


def notes_of(recorder: Recorder, interrupted: bool = False) -> list[str]:
    """Notes for the user on this run, one line each."""
    built = recorder.built
    notes = [*kernel_cache.notes(), *built.simulation.notes, *built.simulation.sheet.notes, *recorder.notes]
    if not built.law.has_energy:
        notes.append("energy: the law has no potential, so there is no strain energy and no balance to report")
    unbalanced = [type(load).__name__ for load in built.simulation.loads if load.unbalanced]
    if unbalanced:
        notes.append(f"energy: {', '.join(unbalanced)} changes energies in ways that nothing counts: no balance")
    for part in built.parts:
        notes += part.notes(recorder.history, built.simulation.load_duration)
    for name, found in recorder.missing.items():
        frames = "one frame" if found["frames"] == 1 else f"{found['frames']} frames"
        notes.append(f"Measure {name!r}: missing in {frames}, {found['why']}")
    if len(recorder.codes) > 1:
        versions = "; ".join(f"{code} from {when} on" for code, when in recorder.codes)
        notes.append(f"resumed by another version: {versions}; the bits may differ from those of one version alone")
    if recorder.repeated:
        times = "once" if recorder.repeated == 1 else f"{recorder.repeated} times"
        notes.append(f"steps: a frame or load step was computed again {times}, each time with half the step")
    return notes + recorder.shape_notes(interrupted) + _energy_notes(recorder)


def _jump_notes(built: Built) -> list[str]:
    """A note on a jump of the velocity of supports."""
    solver = built.simulation.solver
    if not solver.dynamic or not built.solver.has_inertia:
        return []
    moved = [(c.motion, "m/s") for c in built.constraints if c.motion is not None]
    moved += [(c.turn.angle, "rad/s") for c in built.constraints if c.turn is not None]
    for schedule, unit in moved:
        jump, when = schedule.largest_jump(solver.duration)
        if jump > ABRUPT * schedule.top_speed(solver.duration):
            return [
                f"{schedule.name}: its velocity jumps by {jump:.3g} {unit} at {when:.6g} s, which sets off waves as "
                "short as the spacing: expected a change over several steps (more times, or a function of them)"
            ]
    return []


def _energy_notes(recorder: Recorder) -> list[str]:
    """Notes on a poor energy balance."""
    history, notes = recorder.history, []
    worst = max((row["balance_error"] for row in history if "balance_error" in row), key=abs, default=0.0)
    if abs(worst) > WORST_BALANCE:
        notes.append(f"energy: the balance is off by {100.0 * worst:+.2g} %; try smaller steps")
        notes += _jump_notes(recorder.built)
    lost = [row["rupture"] for row in history if "rupture" in row]
    gained = max((before - after for before, after in itertools.pairwise(lost)), default=0.0)
    scale = max((abs(row["kinetic"] + row.get("strain", 0.0)) for row in history), default=0.0)
    if gained > WORST_GAIN * scale:
        notes.append(f"energy: breaking bonds added {gained:.3g} J between two frames; expected only losses")
    return notes


def _compared(item: Reported, value: float | None, of: str) -> dict[str, Any]:
    """Value, unit and reference of a measure or outcome; the value is None if it does not exist (yet)."""
    if value is not None and not np.isfinite(value):
        value = None
    # Of zero there is no relative error.
    error = None if not item.reference or value is None else value / item.reference - 1.0
    return {
        "value": value,
        "unit": item.unit,
        "of": of,
        "reference": item.reference,
        "source": item.source,
        "error": error,
    }


def _measures(recorder: Recorder, notes: list[str]) -> dict[str, Any]:
    """Measures and outcomes by name; errors are added to the notes."""
    scene = recorder.built.simulation
    row = recorder.history[-1] if recorder.history else {}
    # The start of a search that found nothing is no result.
    found = recorder.frame_index > 0 or scene.solver.dynamic
    reported = {m.name: _compared(m, row.get(m.name) if found else None, "last frame") for m in scene.measures}
    for outcome in scene.outcomes:
        value = None
        try:
            rows = _fine_rows(outcome, recorder, notes) if outcome.fine else recorder.history
            value = number_of(outcome, rows) if found else None
        except InputError as error:
            # The run is over: the other numbers must not go with this one.
            notes.append(f"Outcome {outcome.name!r}: {error}")
        reported[outcome.name] = _compared(outcome, value, WHOLE_RUN)
    return reported


def _fine_rows(outcome: Outcome, recorder: Recorder, notes: list[str]) -> History:
    """The rows between frames, or, with a note, those of the frames if there are none."""
    if recorder.fine is not None:
        return recorder.fine.rows
    if recorder.built.simulation.solver.dynamic:
        notes.append(
            f"{outcome.name}: computed from frames only; history_every (--history-every) adds rows between frames"
        )
    return recorder.history


def summary_of(recorder: Recorder, status: str, message: str, seconds: Seconds) -> dict[str, Any]:
    """The summary of a finished run: lengths [m], density [kg/m^3], times [s], horizon in spacings, energies [J].

    A varying thickness or density is given by its minimum and maximum.
    """
    built, notes = recorder.built, notes_of(recorder, status == STOPPED)
    measures = _measures(recorder, notes)
    scene, context, law = built.simulation, built.context, built.law
    row = recorder.history[-1] if recorder.history else {}
    losses = {name: row[name] for name in ("damping", "rupture", *built.energy.lost) if name in row}
    load_duration, points = scene.load_duration, context.whole.size
    return {
        "scene": scene.scene,
        "file": scene.file,
        "section": scene.section,
        "status": status,
        "message": message,
        "settings": scene.settings,
        "version": __version__,
        "commit": commit_of(Path(__file__).parents[2]),
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "machine": platform.node(),
        "device": str(context.device.name),
        "precision": context.bits,
        "force": type(scene.force).__name__,
        "material": show(scene.force.material),
        "thickness": _range(context.whole.thickness),
        "density": _range(context.whole.density),
        "spacing": context.sheet.spacing,
        "weights": law.weights,
        "horizon": scene.force.horizon,
        "points": points,
        "bonds": law.families.bond_count,
        "steps": recorder.steps,
        "repeated": recorder.repeated,
        "time": recorder.time if load_duration is None else None,
        "load_share": None if load_duration is None else recorder.time / load_duration,
        "dt": recorder.dt,
        "stable_dt": recorder.stable_dt,
        "residual": recorder.residual,
        "solve": recorder.solve,
        "wall_s": seconds.wall,
        "setup_s": seconds.setup,
        "compile_s": seconds.compile,
        "point_steps_per_s": points * recorder.steps / recorder.step_seconds if recorder.step_seconds else 0.0,
        "bytes_per_point": context.fields.nbytes / context.sheet.size,
        "correction": law.correction,
        "energy": {
            **{name: row.get(name) for name in ("kinetic", "strain", "external")},
            "dissipated": losses if context.options.tracked else None,
            "balance_error": row.get("balance_error"),
        },
        "notes": notes,
        "measures": measures,
        "units": {name: unit for name, unit in units_of(built).items() if name in row},
    }


def _range(values: float | np.ndarray) -> float | list[float]:
    return [float(np.min(values)), float(np.max(values))] if np.ndim(values) else float(values)


@dataclass(repr=False)
class Result:
    """The result of a run.

    Attributes:
        summary: Content of summary.json.
        history: One row per frame: time (load time of a static solver), energies, ball reaction, largest damage,
            measures.
        built: The simulation in its final state.
        frame: The last frame, with the points selected by `run(stride=)`.
        folder: Folder of the files, or None.
        fine_history: With `Explicit(history_every=)`, rows at and between frames: time, energies, losses, contact
            forces and forces of `Reaction`. Otherwise empty.
    """

    summary: dict[str, Any]
    history: History
    built: Built
    frame: Frame
    folder: Path | None = None
    fine_history: History = field(default_factory=list)

    def __repr__(self) -> str:
        """One line instead of the default text with all arrays."""
        numbers = ", ".join(f"{name} = {found['value']}" for name, found in self.summary["measures"].items())
        return f"Result({self.summary['scene']}: {self.status}, {len(self.history)} frames; {numbers or 'no measures'})"

    def _repr_html_(self) -> str:
        """HTML for a notebook: how the run ended, and its measures with their references."""
        return html_table(self.summary["scene"], result_rows(self.summary, self.folder))

    @property
    def status(self) -> str:
        """How the run ended: "finished", "diverged", "not converged", "ended early" (a path) or "interrupted"."""
        return str(self.summary["status"])

    @property
    def frames(self) -> Frames:
        """The frames in the folder, each read on access.

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        from ..output.frames import Frames

        return Frames(self._folder("frames"))

    def table(self, fine: bool = False) -> Any:
        """The history as a `pandas.DataFrame`, one row per frame.

        Args:
            fine: Whether to use `fine_history`.

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self._rows(fine))

    def plot(
        self, *names: str, against: str = "time", path: str | os.PathLike[str] | None = None, fine: bool = False
    ) -> Any:
        """Plot columns of the history, one panel per unit.

        Args:
            names: Columns, such as "load"; by default the measures.
            against: Column along the horizontal axis.
            path: File of the picture (.png, .pdf or .svg); None writes no file.
            fine: Whether to use `fine_history`.

        Returns:
            The `matplotlib.figure.Figure`; a notebook displays it.

        Raises:
            InputError: if the history lacks a column, or there is no column to plot.
        """
        scene = self.built.simulation
        shown = names or tuple(measure.name for measure in scene.measures)
        if not shown:
            raise InputError(f"plot: the scene has no measures; expected columns of {', '.join(self.history[0])}")
        rows, units = self._rows(fine), units_of(self.built)
        return VIEWERS[-1].plot_history(
            rows, shown, units, against=against, path=path, title=scene.scene, load_duration=scene.load_duration
        )

    def show(self, height: int = 700) -> Page:
        """The interactive page of the run for a notebook: the sheet in 3D, its fields and curves.

        Args:
            height: Height of the page [pixels].

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        return Page(VIEWERS[-1].page(self._folder("show")), count("height", height, 100))

    def _rows(self, fine: bool) -> History:
        if not fine:
            return self.history
        if not self.fine_history:
            raise InputError("fine = True: expected a run with Explicit(history_every=...)")
        return self.fine_history

    def _folder(self, what: str) -> Path:
        if self.folder is None:
            raise InputError(f"{what}: expected a run with a folder, such as run(out='runs/mine')")
        return self.folder


def report(result: Result) -> Iterator[str]:
    """Reported numbers and files of a run for the command line, one line each."""
    notes: list[str] = result.summary["notes"]
    for name, m in result.summary["measures"].items():
        if m["value"] is None:
            wrong = any(note.startswith((f"Measure {name!r}: missing", f"Outcome {name!r}: ")) for note in notes)
            missing = "the event did not occur" if m["of"] == WHOLE_RUN else "no number in the last frame"
            yield f"{name} = none: {'see above' if wrong else missing}"
            continue
        unit = "" if m["unit"] == "1" else f" {m['unit']}"
        line = f"{name} = {m['value']:.6g}{unit}"
        if m["reference"] is not None:
            source = f" ({m['source']})" if m["source"] else ""
            # Of zero there is no relative error.
            error = f"{100 * m['error']:+.3f} %" if m["error"] is not None else f"{m['value']:+.3g}{unit}"
            line += f"   reference {m['reference']:.6g}{unit}{source}, error {error}"
        yield line
    if result.folder is None:
        return
    yield f"results in {result.folder}"
    for path in sorted(result.folder.iterdir()):
        yield f"  {path.name}"
