"""Text descriptions of simulations, plans and results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ..device.checks import said
from .built import Built
from .scene import Scene

# Units of columns that belong to no part; measures have their own.
UNITS = {"time": "s", "step": "s", "largest_damage": "1", "mean_damage": "1", "pressure": "Pa", "volume": "m^3"}


def short(part: Any) -> str:
    """A part in one line: point arrays are shown by their size, arguments at their default are omitted."""
    if isinstance(part, np.ndarray | range) or (isinstance(part, Sequence) and not isinstance(part, str | tuple)):
        return f"{len(part)} values"
    if isinstance(part, float):
        return f"{part:.6g}"
    if not is_dataclass(part) or isinstance(part, type):
        return said(part)
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
