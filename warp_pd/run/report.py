"""What the command line says of a run that is over, and its exit codes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .result import Result

WRONG_INPUT, DIVERGED, LOST, INTERRUPTED = 2, 3, 4, 130


def report(result: Result) -> Iterator[str]:
    """Notes, reported numbers and files, one line each."""
    notes: list[str] = result.summary["notes"]
    yield from notes
    for name, m in result.summary["measures"].items():
        if m["value"] is None:
            wrong = any(note.startswith((f"Measure {name!r}: missing", f"Outcome {name!r}: ")) for note in notes)
            yield f"{name} = none: {'see above' if wrong else 'it did not happen'}"
            continue
        line = f"{name} = {m['value']:.6g}" + ("" if m["unit"] == "1" else f" {m['unit']}")
        if m["reference"] is not None:
            unit = "" if m["unit"] == "1" else f" {m['unit']}"
            line += f"   reference {m['reference']:.6g}{unit} ({m['source']}), error {100 * m['error']:+.3f} %"
        yield line
    if result.folder is None:
        return
    yield f"results in {result.folder}"
    for path in sorted(result.folder.iterdir()):
        yield f"  {path.name}"
