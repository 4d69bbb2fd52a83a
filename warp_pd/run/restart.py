"""The restart file: everything needed to resume a run, bit for bit on the same device.

It has the arrays that the field registry marks for restarts, and the numbers of the recorder and the solver.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, kind_and_text, show, user_code
from ..device.fields import host_shape
from ..output.background import as_output_error
from .built import Built
from .own_code import own_code
from .recorder import Recorder
from .scene import Scene

VERSION = 13
# Numbers of the recorder that a restart keeps, and their types; those that are finite; arrays that are.
NUMBERS: dict[str, Any] = {
    "frame_index": int, "time": int | float, "steps": int, "dt": int | float, "stable_dt": int | float | None,
    "step_seconds": int | float, "residual": int | float | None, "solve": dict | None, "history": list, "missing": dict,
    "repeated": int, "codes": list, "others": list, "shape": dict,
}  # fmt: skip
FORCES = ("force", "external")
FINITE, STATE = ("time", "dt", "step_seconds"), ("displacement", "velocity", *FORCES)
# Attributes of a scene that do not affect the state of a run; names of measures are compared separately.
REPORTED = ("measures", "outcomes", "scene", "file", "section", "pictures", "notes", "settings", "sources")
# What may differ in a run that goes on for longer.
LONGER = ("duration", "frames", "solver.duration", "solver.frames")
# Longest value kept as text, longer ones as their hash; and most differences that a message names.
MAX_LENGTH, MAX_NAMED = 60, 4


@dataclass(frozen=True)
class Identity:
    """Identifies the run that a restart file belongs to.

    Attributes:
        parts: Everything that affects the state: names such as "force.horizon", and values as text.
        settings: Arguments of the scene's `build`, some of which affect only measures.
        sources: Hashes of the scene's file and of the modules beside it; empty without a file.
        own: Hashes of the user's functions and classes in the scene, and the values that they read; see `own_code`.
    """

    parts: dict[str, str]
    settings: dict[str, Any]
    sources: dict[str, str]
    own: dict[str, str]


def identity(scene: Scene, built: Built) -> Identity:
    """The identity of this run."""
    named = {f.name: getattr(scene, f.name) for f in fields(Scene) if f.name not in REPORTED}
    if named["chosen_fields"] is None:
        # Files of earlier versions have no such entry.
        del named["chosen_fields"]
    texts = {key: text for name, part in named.items() for key, text in _texts(name, part)}
    # Rows between frames change nothing of the state.
    texts.pop("solver.history_every", None)
    measures = ", ".join(measure.name for measure in scene.measures)
    functions = built.law.fingerprint() + ("" if built.rupture is None else built.rupture.fingerprint())
    also = {"measures": measures, "functions": functions}
    own = {key: text for name, value in own_code(scene) for key, text in _texts(name, value)}
    return Identity({"precision": str(built.context.bits), **texts, **also}, scene.settings, scene.sources, own)


def _texts(name: str, part: Any) -> Iterator[tuple[str, str]]:
    """Names and values of a part and, recursively, of its parts."""
    if isinstance(part, np.ndarray):
        yield name, f"array {part.shape} {_hash(np.ascontiguousarray(part).data)}"
    elif is_dataclass(part):
        yield name, type(part).__name__
        for f in fields(part):
            yield from _texts(f"{name}.{f.name}", getattr(part, f.name))
    elif isinstance(part, list | tuple) and _holds_parts(part):
        for index, p in enumerate(part):
            yield from _texts(f"{name}.{index}", p)
    else:
        # The text of an object with a call has its address, which no two processes share.
        named = type(part) if callable(part) else part
        text = repr(getattr(part, "__qualname__", getattr(named, "__qualname__", part)))
        yield name, text if len(text) <= MAX_LENGTH else f"{type(part).__name__} {_hash(text.encode())}"


def _holds_parts(part: Any) -> bool:
    """Whether it is a part, an array, or a list of lists that hold one."""
    if isinstance(part, list | tuple):
        return any(_holds_parts(each) for each in part)
    return is_dataclass(part) or isinstance(part, np.ndarray)


def _hash(data: bytes | memoryview) -> str:
    return hashlib.sha1(data).hexdigest()[:12]


def _changed(began: dict[str, Any], here: dict[str, Any]) -> list[str]:
    """Names of the differing values; of a part of a different type, only that of the type."""
    names = [name for name in {**began, **here} if began.get(name) != here.get(name)]
    return [name for name in names if not any(name.startswith(f"{other}.") for other in names)]


def _different(began: dict[str, Any], here: dict[str, Any], allowed: tuple[str, ...]) -> str:
    """The differing values, before and now, but for those allowed to differ."""
    names = [name for name in _changed(began, here) if name not in allowed]
    shown = [f"{name} = {began.get(name)}, here {here.get(name)}" for name in names[:MAX_NAMED]]
    return "; ".join(shown) + (f"; and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else "")


def difference(began: Identity, here: Identity, longer: bool = False) -> str:
    """What differs between two runs, such as "settings (pressure = 5.0, here 15.0)"; "" if nothing does.

    Code is "code (helper.py has changed)". With `longer`, more frames at the same interval are no difference.
    """
    allowed = LONGER if longer and _goes_on(began, here) else ()
    # Settings of a scene are what its user knows; where they are the same, the scene itself differs.
    settings = _different(began.settings, here.settings, allowed)
    if settings and began.parts.get("precision") != here.parts["precision"]:
        settings = f"{settings}; precision = {began.parts.get('precision')}, here {here.parts['precision']}"
    if other := settings or _different(began.parts, here.parts, allowed):
        return f"settings ({other})"
    if files := _changed(began.sources, here.sources):
        return f"code ({', '.join(files)} {'has' if len(files) == 1 else 'have'} changed)"
    own = _different(began.own, here.own, ())
    return f"code ({own})" if own else ""


def _goes_on(began: Identity, here: Identity) -> bool:
    """Whether a run takes more frames than an earlier one, at the same interval."""
    try:
        (long, many), (longer, more) = (
            (float(run.parts["solver.duration"]), int(run.parts["solver.frames"])) for run in (began, here)
        )
    except (KeyError, ValueError):
        return False
    return more > many and math.isclose(long / many, longer / more, rel_tol=1e-12)


def collect(recorder: Recorder, known: Identity) -> dict[str, Any]:
    """Copies of the contents of a restart file: arrays, and all else as the bytes of a JSON text."""
    built = recorder.built
    arrays: dict[str, Any] = {name: built.to_host(array) for name, array in built.context.fields.in_restart().items()}
    numbers = {
        "version": VERSION,
        "parts": known.parts,
        "settings": known.settings,
        "sources": known.sources,
        "own": known.own,
        "solver": built.solver.host_state(),
        **{name: getattr(recorder, name) for name in NUMBERS},
    }
    return {**arrays, "numbers": np.frombuffer(json.dumps(numbers).encode(), np.uint8)}


def save(path: Path, arrays: dict[str, Any]) -> None:
    """Write the result of `collect` atomically."""
    part = path.with_name(path.name + ".part")
    with as_output_error(path):
        with part.open("wb") as stream:
            np.savez(stream, **arrays)
        os.replace(part, path)


def load(path: Path, known: Identity, most: int) -> dict[str, Any]:
    """Load the arrays and numbers of a restart file of this run, of at most `most` bytes."""
    where = f"resume from {str(path)!r}"
    from ..device.npz import read_arrays

    data: dict[str, Any] = read_arrays(where, path, most)
    with user_code(lambda error: f"{where}: the file is damaged ({type(error).__name__})"):
        numbers = dict(json.loads(bytes(data.pop("numbers"))))
    if numbers.get("version") != VERSION:
        raise InputError(f"{where}: expected a file of version {VERSION}, got version {numbers.get('version')}")
    _require_sound(where, numbers)
    began = Identity(**{each.name: numbers[each.name] for each in fields(Identity)})
    if other := difference(began, known, longer=True):
        longer = ", or a longer duration with frames at the same interval" if "duration" in other else ""
        raise InputError(
            f"{where}: it was written with different {other}; expected the {other.partition(' ')[0]} of the earlier run"
            + longer
        )
    return {**data, "numbers": numbers}


def _require_sound(where: str, numbers: dict[str, Any]) -> None:
    """Check that all numbers are there and of their types, and that the last row of the history is that of the time."""
    for name, kind in {**dict.fromkeys(("parts", "settings", "sources", "own", "solver"), dict), **NUMBERS}.items():
        found = numbers.get(name, ...)
        if not isinstance(found, kind) or (name in FINITE and not math.isfinite(found)):
            raise InputError(f"{where}: the file is damaged: {name} = {'missing' if found is ... else show(found)}")
    codes = all(isinstance(code, list) and [type(text) for text in code] == [str, str] for code in numbers["codes"])
    missing = all(
        isinstance(found, dict) and {"frames", "why"} <= found.keys() for found in numbers["missing"].values()
    )
    shape = all(
        isinstance(found, dict) and {"since", "worst", "last"} == found.keys() for found in numbers["shape"].values()
    )
    if not (codes and missing and shape):
        raise InputError(f"{where}: the file is damaged: its versions or notes cannot be read")
    history, time = numbers["history"], numbers["time"]
    if not history or not all(isinstance(row, dict) for row in history) or history[-1].get("time") != time:
        raise InputError(f"{where}: the file is damaged: its history does not end at {time} s")


def restore(data: dict[str, Any], recorder: Recorder) -> None:
    """Copy a loaded state to the device, the recorder and the solver."""
    with user_code(lambda error: f"resume: the restart file is damaged ({kind_and_text(error)})"):
        _restore(data, recorder)


def restore_forces(data: dict[str, Any], built: Built) -> None:
    """Copy the loaded forces to the device again, after the launches of `step.begin`, which recompute them.

    The next explicit step begins with the forces at the end of the last one. Those of Maxwell elements belong to half a
    step before it, those beside a `Mirror` to an earlier displacement of its points.
    """
    for stored in built.context.fields:
        if stored.field.restart and stored.name in FORCES:
            stored.array.assign(built.context.values_here(stored, data[stored.name]))


def _restore(data: dict[str, Any], recorder: Recorder) -> None:
    built, numbers = recorder.built, data["numbers"]
    for stored in built.context.fields:
        name, array = stored.name, stored.array
        if not stored.field.restart:
            continue
        found = data.get(name)
        values = None if found is None else built.context.values_here(stored, found)
        if values is None or values.shape != host_shape(array):
            raise InputError(f"resume: the restart file has no {name!r} of shape {array.shape}; it is damaged")
        if name in STATE and not np.isfinite(values).all():
            raise InputError(f"resume: the restart file has {name!r} with numbers that are not finite; it is damaged")
        array.assign(values)
    for name in NUMBERS:
        setattr(recorder, name, numbers[name])
    built.solver.restore(numbers["solver"])
    recorder.note_code()
