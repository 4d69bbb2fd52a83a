"""The plan of a simulation: every array and every launch, and who asked for it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from .simulation import Built

STAGES = {
    "start": "once at the start",
    "setup": "once at the start or a restart",
    "clock": "whenever the host moves the time or the step",
    "step": "every step",
    "estimate": "each iteration of the stable step",
    "density": "every 300 steps of relaxation",
    "residual": "every 50 steps of relaxation",
    "rupture": "whenever the sheet is at rest",
    "evaluate": "every residual of Newton",
    "linearise": "every tangent of Newton",
    "product": "every iteration of the linear solve",
    "down 0": "every V-cycle, downwards",
    "up 0": "every V-cycle, upwards",
    "frame": "every frame",
}


def describe(built: Built) -> str:
    """Two tables: arrays (name, shape, type, bytes, owner) and launches (name, threads, owner, how often)."""
    points = built.simulation.sheet.size
    lines = [f"{built.simulation.scene}: {points} points, float{built.types.bits}", "", "arrays"]
    rows = [
        (use.name, "x".join(map(str, use.array.shape)), _type_name(use.array.dtype), f"{use.nbytes}", use.owner)
        for use in built.workspace.arrays
    ]
    lines += _table(("name", "shape", "type", "bytes", "asked for by"), rows)
    total = built.workspace.array_bytes()
    lines += [f"  {total} bytes, {total / points:.1f} a point", "", "launches"]
    launches = []
    for stage, when in STAGES.items():
        counted = Counter((x.name, x.threads, x.owner) for x in built.workspace.stages.get(stage, []))
        for (name, threads, owner), times in counted.items():
            launches.append((name, f"{threads}", owner, when if times == 1 else f"{when}, {times} times"))
    for turn in built.workspace.turns.values():
        launches.append((turn.name, f"{turn.threads}", turn.owner, "between two steps, for the end and the beginning"))
    lines += _table(("kernel", "threads", "asked for by", "how often"), launches)
    return "\n".join(lines)


def _type_name(dtype: object) -> str:
    name = getattr(dtype, "__name__", str(dtype))
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
