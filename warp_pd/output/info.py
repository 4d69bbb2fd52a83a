"""Short descriptions of result files."""

from __future__ import annotations

import json
from pathlib import Path

from ..device.checks import InputError
from ..interfaces.frame import format_time


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


def _summary(path: Path) -> str:
    try:
        summary = json.loads(path.read_text())
    except (ValueError, UnicodeDecodeError):
        raise InputError(f"file = {str(path)!r}: expected a summary.json of a run") from None
    if not isinstance(summary, dict) or "scene" not in summary:
        raise InputError(f"file = {str(path)!r}: expected a summary.json of a run")
    section = f" ({summary['section']})" if summary["section"] else ""
    lines = [f"{path}: {summary['scene']}{section}, {summary['status']}"]
    lines.append(f"  {summary['points']} points, horizon {summary['horizon']}, {summary['weights']} weights")
    for name, measure in summary["measures"].items():
        value = "none" if measure["value"] is None else f"{measure['value']:.6g} {measure['unit']}".removesuffix(" 1")
        lines.append(f"  {name} = {value}")
    return "\n".join(lines)
