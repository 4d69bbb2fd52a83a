"""The restart file: everything that a run needs to go on, bit for bit on the same device."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .checks import InputError

if TYPE_CHECKING:
    from .runner import Recorder
    from .simulation import Built, Simulation

NAME = "restart.npz"
VERSION = 2
STATE = ("displacement", "velocity", "work", "dissipated", "released", "energy_release", "impulse", "time")
BODIES = ("place", "linear", "angular", "rotation")


def digest(simulation: Simulation, built: Built) -> str:
    """A number that changes with anything that changes the results."""
    parts: list[Any] = [VERSION, built.types.bits, _describe(simulation.force), _describe(simulation.solver)]
    parts += [_describe(load) for load in simulation.loads]
    parts += [_describe(simulation.contact), _describe(simulation.damage)]
    sheet = simulation.sheet
    parts += [sheet.thickness, sheet.density, sheet.cuts, _describe(sheet.points), _describe(sheet.areas)]
    parts += [_describe(i) for i in sheet.inclusions]
    return hashlib.sha1(repr(parts).encode()).hexdigest()


def settings(built: Built) -> dict[str, Any]:
    """The scene's numbers and the precision, to name what differs where the digests do."""
    return {**built.simulation.settings, "precision": built.types.bits}


def _describe(part: Any) -> Any:
    if isinstance(part, np.ndarray):
        return hashlib.sha1(np.ascontiguousarray(part).tobytes()).hexdigest()
    if is_dataclass(part):
        return [type(part).__name__, [(f.name, _describe(getattr(part, f.name))) for f in fields(part)]]
    if isinstance(part, list | tuple):
        return [_describe(p) for p in part]
    return getattr(part, "__qualname__", part)


def collect(recorder: Recorder) -> dict[str, Any]:
    """Copies of all that a restart file holds."""
    built = recorder.built
    copied = {name: getattr(built.state, name) for name in STATE if getattr(built.state, name) is not None}
    copied |= {f"body_{name}": array for name, array in zip(BODIES, built.state.bodies, strict=False)}
    if built.force.alive is not None:
        copied["alive"] = built.force.alive
    copied |= {f"internal_{name}": array for name, array in built.force.internal.items()}
    if built.stable_step is not None:
        copied["direction"] = built.stable_step.direction
    arrays = {name: built.to_host(array) for name, array in copied.items()}
    if built.stable_step is not None:
        arrays["noise"] = np.frombuffer(json.dumps(built.stable_step.noise_state()).encode(), np.uint8)
    numbers = {
        "version": VERSION,
        "digest": recorder.digest,
        "settings": settings(built),
        "frame_index": recorder.frame_index,
        "time": recorder.time,
        "steps": recorder.steps,
        "dt": recorder.dt,
        "stable_dt": recorder.stable_dt,
        "since_estimate": recorder.since_estimate,
        "step_seconds": recorder.step_seconds,
        "history": recorder.history,
    }
    arrays["numbers"] = np.frombuffer(json.dumps(numbers).encode(), np.uint8)
    return arrays


def save(path: Path, arrays: dict[str, Any]) -> None:
    """Write what `collect` gave aside, then move it into place."""
    aside = path.with_name(path.name + ".part")
    with aside.open("wb") as stream:
        np.savez(stream, **arrays)
    os.replace(aside, path)


def load(path: Path, wanted: str, wanted_settings: dict[str, Any]) -> dict[str, Any]:
    """Arrays and numbers of a restart file that belongs to this digest; the settings are for the message.

    Raises:
        InputError: if it is missing, damaged, of another version, or of another simulation.
    """
    if not path.exists():
        raise InputError(f"resume from {str(path)!r}: the file does not exist; allowed is the folder of an earlier run")
    try:
        with np.load(path) as stored:
            data = {name: stored[name] for name in stored.files}
        numbers = json.loads(bytes(data.pop("numbers")))
        if "noise" in data:
            data["noise"] = json.loads(bytes(data["noise"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"resume from {str(path)!r}: the file is damaged ({type(error).__name__})") from None
    if numbers.get("version") != VERSION:
        raise InputError(f"resume from {str(path)!r}: it is of version {numbers.get('version')}, allowed is {VERSION}")
    if numbers["digest"] != wanted:
        began = numbers["settings"]
        other = [
            f"{key} = {began.get(key)!r}, here {wanted_settings.get(key)!r}"
            for key in {**began, **wanted_settings}
            if began.get(key) != wanted_settings.get(key)
        ]
        raise InputError(
            f"resume from {str(path)!r}: it belongs to other settings ({'; '.join(other) or 'of another scene'}); "
            f"allowed are those that the run began with"
        )
    return {**data, "numbers": numbers}


def restore(data: dict[str, Any], recorder: Recorder) -> None:
    """Put a loaded state back on the device and into the recorder."""
    built, numbers = recorder.built, data["numbers"]
    for name in STATE:
        if name in data:
            getattr(built.state, name).assign(data[name])
    for name, array in zip(BODIES, built.state.bodies, strict=False):
        array.assign(data[f"body_{name}"])
    if built.force.alive is not None:
        built.force.alive.assign(data["alive"])
    for name, array in built.force.internal.items():
        array.assign(data[f"internal_{name}"])
    if built.stable_step is not None:
        built.stable_step.direction.assign(data["direction"])
        built.stable_step.restore_noise(data["noise"])
    for name in ("frame_index", "time", "steps", "dt", "stable_dt", "since_estimate", "step_seconds", "history"):
        setattr(recorder, name, numbers[name])
