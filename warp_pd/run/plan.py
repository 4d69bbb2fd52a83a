"""The plan of a simulation: every array and every launch, and who asked for it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from .built import Built


def describe(built: Built) -> str:
    """Two tables: arrays (name, shape, type, bytes, owner, what for) and launches (name, threads, owner, how often)."""
    context, points = built.context, built.context.sheet.size
    lines = [f"{built.simulation.scene}: {points} points, float{context.bits}", "", "arrays"]
    rows = [
        (
            s.name, "x".join(map(str, s.array.shape)), _type_name(s.array.dtype), f"{s.nbytes}", s.field.per,
            "yes" if s.field.restart else "", s.owner,
        )
        for s in context.fields
    ]  # fmt: skip
    lines += _table(("name", "shape", "type", "bytes", "per", "in restart", "asked for by"), rows)
    total = context.fields.nbytes
    lines += [f"  {total} bytes, {total / points:.1f} per point", "", "launches"]
    launches = []
    for stage in context.stages.values():
        counted = Counter((x.name, x.threads, x.owner) for x in stage)
        for (name, threads, owner), times in counted.items():
            often = stage.when if times == 1 else f"{stage.when}, {times} times"
            launches.append((stage.name, name, f"{threads}", owner, often))
        if stage.wraparound is not None:
            joined = stage.wraparound
            when = "between two steps, for the end and the beginning"
            launches.append((stage.name, joined.name, f"{joined.threads}", joined.owner, when))
    lines += _table(("stage", "kernel", "threads", "asked for by", "how often"), launches)
    return "\n".join(lines)


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
