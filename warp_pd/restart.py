"""The restart file: everything that a run needs to go on, bit for bit on the same device."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .checks import InputError

if TYPE_CHECKING:
    from .runner import Recorder
    from .simulation import Built, Simulation

NAME = "restart.npz"
VERSION = 3
STATE = ("displacement", "velocity", "work", "dissipated", "released", "energy_release", "impulse", "time")
NUMBERS = (
    "frame_index", "time", "steps", "dt", "stable_dt", "since_estimate", "step_seconds", "residual", "solve", "history",
)  # fmt: skip
BODIES = ("place", "linear", "angular", "rotation")
# Longer values are kept as their hash; a message names so many that differ.
LONGEST, MOST_NAMED = 60, 4


def parts(simulation: Simulation, built: Built) -> dict[str, str]:
    """All that changes the results: names such as "force.horizon", and values as text."""
    sheet = simulation.sheet
    named = {name: getattr(simulation, name) for name in ("force", "solver", "loads", "contact", "damage")}
    names = ("thickness", "density", "cuts", "points", "areas", "inclusions", "stiffness")
    named |= {f"sheet.{name}": getattr(sheet, name) for name in names}
    return {"precision": str(built.types.bits), **{k: v for name, part in named.items() for k, v in _texts(name, part)}}


def _texts(name: str, part: Any) -> Iterator[tuple[str, str]]:
    """Names and values of a part and of its parts."""
    if isinstance(part, np.ndarray):
        yield name, f"array {part.shape} {_hash(np.ascontiguousarray(part).tobytes())}"
    elif is_dataclass(part):
        yield name, type(part).__name__
        for f in fields(part):
            yield from _texts(f"{name}.{f.name}", getattr(part, f.name))
    elif isinstance(part, list | tuple) and any(is_dataclass(p) or isinstance(p, np.ndarray) for p in part):
        for index, p in enumerate(part):
            yield from _texts(f"{name}.{index}", p)
    else:
        text = repr(getattr(part, "__qualname__", part))
        yield name, text if len(text) <= LONGEST else f"{type(part).__name__} {_hash(text.encode())}"


def _hash(data: bytes) -> str:
    return hashlib.sha1(data).hexdigest()[:12]


def _different(began: dict[str, Any], here: dict[str, Any]) -> str:
    """What differs, then and now; of a part of another kind, only the kind."""
    names = [name for name in {**began, **here} if began.get(name) != here.get(name)]
    whole = [name for name in names if not any(name.startswith(f"{other}.") for other in names)]
    shown = [f"{name} = {began.get(name)}, here {here.get(name)}" for name in whole[:MOST_NAMED]]
    return "; ".join(shown) + (f"; and {len(whole) - MOST_NAMED} more" if len(whole) > MOST_NAMED else "")


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
        "parts": recorder.parts,
        "settings": built.simulation.settings,
        **{name: getattr(recorder, name) for name in NUMBERS},
    }
    arrays["numbers"] = np.frombuffer(json.dumps(numbers).encode(), np.uint8)
    return arrays


def save(path: Path, arrays: dict[str, Any]) -> None:
    """Write what `collect` gave aside, then move it into place."""
    aside = path.with_name(path.name + ".part")
    with aside.open("wb") as stream:
        np.savez(stream, **arrays)
    os.replace(aside, path)


def load(path: Path, wanted: dict[str, str], wanted_settings: dict[str, Any]) -> dict[str, Any]:
    """Arrays and numbers of a restart file of these parts and settings of a scene, some of which only measures read.

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
    if (numbers["parts"], numbers["settings"]) != (wanted, wanted_settings):
        sides = (numbers["settings"], numbers["parts"]), (wanted_settings, wanted)
        # Settings of a scene are what its user knows; where they are the same, the scene itself is another one.
        same = numbers["settings"] == wanted_settings
        other = _different(*(p if same else {**s, "precision": p["precision"]} for s, p in sides))
        raise InputError(
            f"resume from {str(path)!r}: it belongs to other settings ({other}); allowed are those that the run began "
            f"with"
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
    for name in NUMBERS:
        setattr(recorder, name, numbers[name])
