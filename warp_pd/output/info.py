"""Short descriptions of result files; their contents for JSON, which knows neither NaN nor infinity."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..device.checks import InputError
from ..interfaces.frame import format_time


def finite_values(value: Any) -> Any:
    """Convert a value for JSON: NaN and infinity become None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite_values(item) for key, item in value.items()}
    return [finite_values(item) for item in value] if isinstance(value, list | tuple) else value


NUMBER = int | float
# Types of the entries of a summary.json that the package reads: those of every run, those that may be missing, also in
# its identity, and those of a measure.
ENTRIES = {"scene": str, "status": str, "settings": dict, "measures": dict}
MORE = {
    "message": str, "file": str | None, "section": str, "points": int, "horizon": NUMBER,
    "weights": str, "wall_s": NUMBER,
    "units": dict, "pictures": list, "made": list, "notes": list, "identity": dict,
}  # fmt: skip
OF_AN_IDENTITY = {"parts": dict, "sources": dict, "own": dict, "code": str}
OF_A_MEASURE = {"value": NUMBER | None, "unit": str, "reference": NUMBER | None, "error": NUMBER | None}


def describe(path: Path) -> str:
    """Describe a frames.vtkhdf, animation.usd or summary.json, or a folder with these files, in a few lines."""
    if not path.exists():
        raise InputError(f"file = {str(path)!r}: the file does not exist")
    if path.is_dir():
        known = [p for p in sorted(path.iterdir()) if p.suffix in (".vtkhdf", ".usd") or p.name == "summary.json"]
        if not known:
            raise InputError(
                f"file = {str(path)!r}: expected a folder with frames.vtkhdf, animation.usd or summary.json"
            )
        return "\n".join(describe(p) for p in known)
    if path.suffix == ".vtkhdf":
        return _vtkhdf(path)
    if path.suffix in (".usd", ".usda", ".usdc"):
        from .usd import describe_animation

        return describe_animation(path)
    if path.suffix == ".json":
        return _summary(path)
    raise InputError(f"file = {str(path)!r}: expected a .vtkhdf, .usd or .json file")


def values(path: Path) -> dict[str, Any]:
    """The contents of the same files: of a frames.vtkhdf without the frames, a summary.json, or a folder by file name.

    Of an animation only its description.
    """
    if path.is_dir():
        describe(path)
        known = [p for p in sorted(path.iterdir()) if p.suffix in (".vtkhdf", ".usd") or p.name == "summary.json"]
        return {p.name: values(p) for p in known}
    text = describe(path)
    if path.suffix == ".json":
        return read_summary(path) or {}
    if path.suffix == ".vtkhdf":
        from .vtkhdf import read_series

        found = read_series(path)
        return {
            "frames": found.frames, "points": found.points, "times": found.times.tolist(),
            "faces": found.faces.tolist(), "fields": list(found.fields), "metadata": found.metadata,
        }  # fmt: skip
    return {"description": text}


def _vtkhdf(path: Path) -> str:
    from .vtkhdf import read_series

    try:
        series = read_series(path)
    except ValueError as error:
        raise InputError(str(error)) from None
    lines = [f"{path}: {series.frames} frames of {series.points} points"]
    if series.frames:
        first, last = (format_time(float(t), series.metadata.get("load_duration")) for t in series.times[[0, -1]])
        lines.append(f"  {first} to {last}")
    lines.append(f"  fields {', '.join(series.fields)}")
    lines += [f"  {key} {value}" for key, value in series.metadata.items() if value != ""]
    return "\n".join(lines)


def read_summary(path: Path) -> dict[str, Any] | None:
    """The contents of a summary.json; None if it cannot be read, or lacks an entry that the package needs."""
    try:
        found = json.loads(path.read_text("utf-8"), parse_int=_whole)
    except (OSError, ValueError, RecursionError):
        return None
    if not _has(found, ENTRIES) or not _has_some(found, MORE):
        return None
    known = (
        _has_some(found.get("identity", {}), OF_AN_IDENTITY)
        and all(isinstance(unit, str) for unit in found.get("units", {}).values())
        and all(_has(measure, OF_A_MEASURE) for measure in found["measures"].values())
    )
    return found if known else None


def _whole(text: str) -> int | float:
    """A whole number; one that is larger than any float can be neither printed nor drawn, and becomes infinite."""
    return int(text) if len(text) < 300 else float(text)


def _has(found: Any, entries: Mapping[str, Any]) -> bool:
    """Whether `found` is a dict with these entries, of these types."""
    return isinstance(found, dict) and all(
        name in found and isinstance(found[name], kind) for name, kind in entries.items()
    )


def _has_some(found: Any, entries: Mapping[str, Any]) -> bool:
    """Whether those of these entries that the dict `found` has are of these types."""
    return _has(found, {name: kind for name, kind in entries.items() if name in found})


def _summary(path: Path) -> str:
    summary = read_summary(path)
    if summary is None:
        raise InputError(f"file = {str(path)!r}: expected a summary.json of a run")
    section = f" ({summary['section']})" if summary.get("section") else ""
    lines = [f"{path}: {summary['scene']}{section}, {summary['status']}"]
    if {"points", "horizon", "weights"} <= summary.keys():
        lines.append(f"  {summary['points']} points, horizon {summary['horizon']}, {summary['weights']} weights")
    for name, measure in summary["measures"].items():
        value = "none" if measure["value"] is None else f"{measure['value']:.6g} {measure['unit']}".removesuffix(" 1")
        lines.append(f"  {name} = {value}")
    return "\n".join(lines)
