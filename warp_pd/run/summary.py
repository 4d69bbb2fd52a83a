"""The summary of a run, i.e. the contents of summary.json."""

from __future__ import annotations

import itertools
import platform
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..device import kernel_cache
from ..device.checks import InputError, said
from ..device.version import __version__
from ..interfaces import History
from ..interfaces.solver import STOPPED
from .built import Built
from .description import units_of
from .recorder import Recorder, number_of
from .scene import Outcome, Reported
from .version import commit_of

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
    return notes + recorder.shape_notes(interrupted) + _energy_notes(recorder) + _jump_notes(built, recorder.history)


def _worst_balance(history: History) -> float:
    """Largest error of the energy balance, over the largest energy."""
    return max((row["balance_error"] for row in history if "balance_error" in row), key=abs, default=0.0)


def _jump_notes(built: Built, history: History) -> list[str]:
    """A note on a jump of the velocity of supports, where the energy balance is off."""
    solver = built.simulation.solver
    if abs(_worst_balance(history)) <= WORST_BALANCE or not solver.dynamic or not built.solver.has_inertia:
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
    worst = _worst_balance(history)
    if abs(worst) > WORST_BALANCE:
        notes.append(f"energy: the balance is off by {100.0 * worst:+.2g} %; try smaller steps")
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
            value = number_of(outcome, _rows_for(outcome, recorder, notes)) if found else None
        except InputError as error:
            # The run is over: the other numbers must not go with this one.
            notes.append(f"Outcome {outcome.name!r}: {error}")
        reported[outcome.name] = _compared(outcome, value, WHOLE_RUN)
    return reported


def _rows_for(outcome: Outcome, recorder: Recorder, notes: list[str]) -> History:
    """The history rows for an outcome; adds a note if it needs rows between frames and there are none."""
    if not outcome.fine:
        return recorder.history
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
        "material": said(scene.force.material),
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
