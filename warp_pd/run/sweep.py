"""A sweep: a scene run for all combinations of some values, each in a folder of its own, and one table of them."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..device.checks import InputError
from . import restart
from .built import compose
from .divergence import DivergedError
from .folder import run_summary, write_atomically
from .runner import DIVERGED, FINISHED, NOT_CONVERGED, STOPPED

REFUSED = "refused"
# Runs that are over: to run them again would give the same.
OVER = (FINISHED, DIVERGED, NOT_CONVERGED)


@dataclass(frozen=True)
class Task:
    """A run of a sweep that is to start.

    Attributes:
        simulation: What is run.
        values: Its values of the arguments that the sweep changes, as they were given.
        folder: Of its files.
        resume: Whether it goes on from the last frame in the folder.
        overwrite: Whether it replaces what is in the folder.
    """

    simulation: Any
    values: Mapping[str, str]
    folder: Path
    resume: bool
    overwrite: bool


# Runs a task, and gives the content of its summary.json.
Start = Callable[[Task], Mapping[str, Any]]


@dataclass(frozen=True)
class Row:
    """A run of a sweep.

    Attributes:
        values: The values that it has of the arguments that the sweep changes, as they were given.
        folder: Of its files.
        status: How it ended: as a run does, or "refused" for wrong input.
        message: Why it did not finish, or "".
        summary: Content of its summary.json; empty for a run that was refused.
        skipped: Whether it was there already.
    """

    values: Mapping[str, str]
    folder: Path
    status: str
    message: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    skipped: bool = False

    @property
    def name(self) -> str:
        """Such as "points=51, horizon=3.15"."""
        return ", ".join(f"{key}={value}" for key, value in self.values.items())


def combinations(choices: Mapping[str, Sequence[str]]) -> Iterator[dict[str, str]]:
    """All combinations of the values of some arguments; the last argument changes fastest."""
    for values in itertools.product(*choices.values()):
        yield dict(zip(choices, values, strict=True))


def folder_name(values: Mapping[str, str]) -> str:
    """Name of the folder of a run."""
    return ",".join(f"{key}={value}" for key, value in values.items()).replace("/", "_").replace(" ", "")


def sweep(
    build: Callable[[dict[str, str]], Any],
    choices: Mapping[str, Sequence[str]],
    out: Path,
    start: Start,
    *,
    device: str | None = None,
    precision: int | None = None,
    overwrite: bool = False,
    told: Callable[[int, int, Row], None] | None = None,
) -> list[Row]:
    """Run all combinations of values, one after the other. What an earlier call finished is not run again.

    Args:
        build: Gives the simulation for some values.
        choices: Values of each argument.
        out: Folder that holds the folders of the runs.
        start: Runs a simulation.
        device: Of all runs; None for CUDA where there is one.
        precision: Of all runs; None for the solver's.
        overwrite: Run everything again.
        told: Called after each run with its number, the number of all runs, and its row.

    Raises:
        InputError: if a folder holds a run of another scene, other settings or other code; nothing has run then.

    Returns:
        A row for each run, in order. A run that fails does not stop the others. If the user stops a run, its row is
        the last one.
    """
    everything = list(combinations(choices))
    for values in everything if not overwrite else ():
        _require_same(build, values, out / folder_name(values), device, precision)
    rows = []
    for number, values in enumerate(everything, start=1):
        row = _run(build, values, out / folder_name(values), start, overwrite)
        rows.append(row)
        if told is not None:
            told(number, len(everything), row)
        if row.status == STOPPED:
            break
    return rows


def _require_same(
    build: Callable[[dict[str, str]], Any], values: dict[str, str], folder: Path, device: str | None,
    precision: int | None,
) -> None:  # fmt: skip
    """Refuse a folder with a run that is not the one which these values stand for now.

    Raises:
        InputError: for the first thing that differs, or a scene that refuses values which it took before.
    """
    earlier = run_summary(folder)
    if earlier is None:
        return
    simulation = build(values)
    here = restart.identity(simulation, compose(simulation, device, precision))
    told = earlier.get("identity", {"parts": {}, "sources": {}})
    other = restart.difference(restart.Identity(told["parts"], earlier["settings"]), here)
    sources = {**told["sources"], **simulation.sources}
    changed = [name for name in sources if told["sources"].get(name) != simulation.sources.get(name)]
    if other or changed:
        what = f"other settings ({other})" if other else f"other code ({', '.join(changed)} has changed)"
        raise InputError(f"{str(folder)!r} holds a run with {what}; expected another folder (--out), or --overwrite")


def _run(
    build: Callable[[dict[str, str]], Any], values: dict[str, str], folder: Path, start: Start, overwrite: bool
) -> Row:  # fmt: skip
    try:
        earlier = None if overwrite else run_summary(folder)
        if earlier is not None and earlier["status"] in OVER:
            return Row(values, folder, earlier["status"], earlier["message"], earlier, skipped=True)
        simulation = build(values)
        goes_on = not overwrite and (folder / restart.NAME).is_file()
        found = start(Task(simulation, values, folder, goes_on, overwrite or not goes_on))
    except (InputError, MemoryError) as error:
        return Row(values, folder, REFUSED, str(error))
    except DivergedError as error:
        return Row(values, folder, DIVERGED, str(error))
    except KeyboardInterrupt:
        return Row(values, folder, STOPPED, "interrupted before the first frame")
    return Row(values, folder, found["status"], found["message"], found)


def table(rows: Sequence[Row]) -> tuple[list[str], list[list[Any]]]:
    """Head and cells of the table of a sweep: values, status, points, seconds, measures and their errors.

    A number that a run does not have is None.
    """
    measures = list(dict.fromkeys(name for row in rows for name in row.summary.get("measures", {})))
    compared = {
        name for row in rows for name, m in row.summary.get("measures", {}).items() if m["reference"] is not None
    }
    head = [*rows[0].values, "status", "seconds"]
    for name in measures:
        head += [name, f"{name} error"] if name in compared else [name]
    cells = []
    for row in rows:
        line: list[Any] = [*row.values.values(), row.status, row.summary.get("wall_s")]
        for name in measures:
            found = row.summary.get("measures", {}).get(name, {})
            line += [found.get("value"), found.get("error")] if name in compared else [found.get("value")]
        cells.append(line)
    return head, cells


def write_table(path: Path, rows: Sequence[Row]) -> bool:
    """The table as CSV, with all digits; a number that does not exist is an empty cell.

    Returns:
        Whether it was written: a table with refused runs does not replace one that holds results which it lacks.
    """
    head, cells = table(rows)
    names = list(rows[0].values)
    if any(row.status == REFUSED for row in rows):
        kept = {tuple(row.values.values()) for row in rows if row.status != REFUSED}
        if not _results_in(path, names) <= kept:
            return False
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(head)
    writer.writerows(cells)
    write_atomically(path, text.getvalue())
    return True


def _results_in(path: Path, names: Sequence[str]) -> set[tuple[str | None, ...]]:
    """Values of some arguments in the rows of an earlier table that are not refused."""
    if not path.is_file():
        return set()
    with path.open(newline="", encoding="utf-8") as stream:
        return {
            tuple(row.get(name) for name in names) for row in csv.DictReader(stream) if row.get("status") != REFUSED
        }


def printed_table(rows: Sequence[Row]) -> str:
    """The table for a terminal, in columns."""
    head, cells = table(rows)
    texts = [head, *([_text(name, cell) for name, cell in zip(head, line, strict=True)] for line in cells)]
    widths = [max(len(line[k]) for line in texts) for k in range(len(head))]
    return "\n".join("  ".join(text.rjust(w) for text, w in zip(line, widths, strict=True)) for line in texts)


def _text(name: str, cell: Any) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, str):
        return cell
    if name.endswith(" error"):
        return f"{100.0 * cell:+.3f} %"
    return f"{cell:.1f}" if name == "seconds" else f"{cell:.6g}"
