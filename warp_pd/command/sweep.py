"""Parameter sweep: a scene run for all combinations of values, a folder for each, with a table and a plot."""

from __future__ import annotations

import contextlib
import csv
import gc
import hashlib
import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import click

from ..device.checks import DIVERGED as DIVERGED_CODE
from ..device.checks import WRONG_INPUT, InputError
from ..interfaces import DivergedError
from ..interfaces.solver import DIVERGED, ENDED, FINISHED, NOT_CONVERGED, STOPPED
from ..run import restart
from ..run.built import compose
from ..run.folder import RESTART, remove_if_empty, require_free, run_summary, sole_use, writable_folder, write_csv
from ..run.recorder import code_version
from ..run.stopping import deadline
from ..viewer.curves import draw_sweep
from ..viewer.pictures import Drawing, drawing
from .scene_files import build_scene, load_scene

REFUSED = "refused"
# Length of the name of a folder whose values take more; file systems take 255 bytes.
LONGEST_NAME = 200
# A number in a note.
NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")
# Runs that are over: to run them again would give the same.
OVER = (FINISHED, DIVERGED, NOT_CONVERGED, ENDED)


@dataclass(frozen=True)
class Row:
    """A run of a sweep and its results.

    Attributes:
        values: Values of the swept arguments, as given.
        folder: Folder of its files.
        status: Status of the run, or "refused" for invalid input.
        message: Why it did not finish, or "".
        summary: Contents of its summary.json; empty for a refused run.
        skipped: Whether the results already existed.
    """

    values: Mapping[str, str]
    folder: Path
    status: str
    message: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    skipped: bool = False

    @property
    def name(self) -> str:
        """Name such as "points=51, horizon=3.15"."""
        return ", ".join(f"{key}={value}" for key, value in self.values.items())


def combinations(choices: Mapping[str, Sequence[str]]) -> Iterator[dict[str, str]]:
    """All combinations of the values of the arguments; the last argument changes fastest."""
    for values in itertools.product(*choices.values()):
        yield dict(zip(choices, values, strict=True))


def folder_name(values: Mapping[str, str]) -> str:
    """Name of the folder of a run: no two runs share one.

    Characters of a value that a file system may refuse or take for others are percent-encoded. A name that is too long
    ends with a hash of its values, and only such names have that length.
    """
    name = ",".join(f"{key}={quote(value, safe='()[]+')}" for key, value in values.items())
    if len(name) < LONGEST_NAME:
        return name
    number = hashlib.sha256(name.encode()).hexdigest()[:32]
    return f"{name[: LONGEST_NAME - len(number) - 1]}-{number}"


def sweep(
    build: Callable[[dict[str, str]], Any],
    choices: Mapping[str, Sequence[str]],
    out: Path,
    options: Mapping[str, Any],
    *,
    overwrite: bool = False,
    told: Callable[[int, int, Row], None] | None = None,
) -> list[Row]:
    """Run all combinations of values one after the other, skipping runs that an earlier call finished.

    Args:
        build: Function values -> simulation.
        choices: Values of each argument.
        out: Parent folder of the folders of the runs.
        options: Options of `Simulation.run` of all runs, such as device and precision.
        overwrite: Whether to run everything again.
        told: Callback (index, number of runs, row) after each run.

    Returns:
        One row per run, in order. A failed run does not stop the others. If the user stops a run, its row is the last.
    """
    everything = list(combinations(choices))
    # Of all folders first, so that a refused sweep leaves them and the table as they are.
    same = {
        folder_name(values)
        for values in (everything if not overwrite else ())
        if _require_same(build, values, out / folder_name(values), options)
    }
    rows = []
    for number, values in enumerate(everything, start=1):
        name = folder_name(values)
        row = _run(build, values, out / name, options, overwrite, known=name in same)
        rows.append(row)
        if told is not None:
            told(number, len(everything), row)
        if number == 1:
            # What the first run has imported and compiled stays: later collections of garbage leave it out.
            gc.collect()
            gc.freeze()
        if row.status == STOPPED:
            break
    return rows


def _require_same(
    build: Callable[[dict[str, str]], Any], values: dict[str, str], folder: Path, options: Mapping[str, Any]
) -> bool:
    """Check that a run in the folder has the same settings and code as these values give now; False without a run."""
    earlier = run_summary(folder)
    if earlier is None:
        return False
    simulation = build(values)
    here = restart.identity(simulation, compose(simulation, options["device"], options["precision"]))
    told = earlier.get("identity", {})
    parts, sources, own = (told.get(name, {}) for name in ("parts", "sources", "own"))
    began, now = told.get("code", "unknown"), code_version()
    other = restart.difference(restart.Identity(parts, earlier["settings"], sources, own), here)
    if not other and began == now:
        return True
    what = f"other {other}" if other else f"other code ({began}, here {now})"
    raise InputError(f"{str(folder)!r} contains a run with {what}; expected another folder (--out) or --overwrite")


def _run(
    build: Callable[[dict[str, str]], Any], values: dict[str, str], folder: Path, options: Mapping[str, Any],
    overwrite: bool, known: bool,
) -> Row:  # fmt: skip
    """Run one combination, or take over its results; `known` tells whether those were compared with the values."""
    try:
        earlier = None if overwrite else run_summary(folder)
        if earlier is not None and earlier["status"] in OVER:
            # A file system may take two names for one.
            if not known:
                _require_same(build, values, folder, options)
            return Row(values, folder, earlier["status"], earlier.get("message", ""), earlier, skipped=True)
        simulation = build(values)
        goes_on = not overwrite and (folder / RESTART).is_file()
        found = simulation.run(out=folder, resume=goes_on, overwrite=overwrite or not goes_on, **options).summary
    except (InputError, MemoryError) as error:
        return Row(values, folder, REFUSED, str(error))
    except DivergedError as error:
        return Row(values, folder, DIVERGED, str(error))
    except KeyboardInterrupt:
        return Row(values, folder, STOPPED, "interrupted before the first frame")
    return Row(values, folder, found["status"], found["message"], found)


def table(rows: Sequence[Row]) -> tuple[list[str], list[list[Any]]]:
    """Header and cells of the table of a sweep: values, status, points, seconds, measures and their errors.

    Missing numbers are None.
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
    """Write the table as CSV with full precision; a missing number is an empty cell. Returns whether it was written.

    A table of refused runs alone is not written, and one with some does not replace a table that has results for them.
    """
    head, cells = table(rows)
    kept = {tuple(row.values.values()) for row in rows if row.status != REFUSED}
    if len(kept) < len(rows) and not (kept and _has_no_others(path, list(rows[0].values), kept)):
        return False
    write_csv(path, head, cells)
    return True


def _has_no_others(path: Path, names: Sequence[str], kept: set[tuple[str, ...]]) -> bool:
    """Whether an earlier table has no results for other values of the named arguments; False if it cannot be read."""
    if not path.is_file():
        return True
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (ValueError, csv.Error):
        return False
    return {tuple(row.get(name) for name in names) for row in rows if row.get("status") != REFUSED} <= kept


def printed_table(rows: Sequence[Row]) -> str:
    """The table as aligned text for a terminal."""
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


def notes_of(rows: Sequence[Row]) -> list[str]:
    """Every note of the runs once, with the number of runs that have it; notes may differ in their numbers."""
    found: dict[str, dict[int, str]] = {}
    for number, row in enumerate(rows):
        for note in row.summary.get("notes", ()):
            found.setdefault(NUMBER.sub("#", note), {}).setdefault(number, note)
    lines = []
    for texts in found.values():
        first, note = next(iter(texts.items()))
        where = "" if len(set(texts.values())) == 1 else f"as at {rows[first].name}, with other numbers elsewhere: "
        lines.append(f"{note} ({where}{len(texts)} of {len(rows)} runs)")
    return lines


def run_sweep(
    scene: str, choices: Mapping[str, Sequence[str]], folder: Path, options: Mapping[str, Any], overwrite: bool,
    quiet: bool,
) -> int:  # fmt: skip
    """Run a sweep, print and write its table, draw its plot, and return the exit code of the worst run.

    Arguments are those of `sweep`; `quiet` prints only notes and the table.
    """
    load_scene(scene)
    with contextlib.ExitStack() as stack:
        writable_folder(folder, resume=False)
        stack.callback(remove_if_empty, folder)
        stack.enter_context(sole_use(folder))
        require_free(folder, overwrite=False)
        return _run_sweep(scene, choices, folder, options, overwrite, quiet)


def _run_sweep(
    scene: str, choices: Mapping[str, Sequence[str]], folder: Path, options: Mapping[str, Any], overwrite: bool,
    quiet: bool,
) -> int:  # fmt: skip
    def told(number: int, count: int, row: Row) -> None:
        if not quiet:
            seconds = f" in {row.summary['wall_s']:.1f} s" if row.summary and not row.skipped else ""
            text = f"{row.status}{', done before' if row.skipped else ''}{seconds}"
            click.echo(f"[{number}/{count}] {row.name}: {text}", err=True)

    def build(values: dict[str, str]) -> Any:
        return build_scene(scene, values)

    rows = sweep(build, choices, folder, options, overwrite=overwrite, told=told)
    for row in rows:
        if row.message:
            click.echo(f"warp-pd: {row.name}: {row.message}", err=True)
    for note in notes_of(rows):
        click.echo(note, err=True)
    click.echo(printed_table(rows))
    if not write_table(folder / "sweep.csv", rows):
        if (folder / "sweep.csv").is_file():
            click.echo(
                f"warp-pd: {folder / 'sweep.csv'}: not replaced: it has results that the new table lacks", err=True
            )
        return WRONG_INPUT
    with drawing(Drawing(Path(scene).stem)):
        drawn = draw_sweep(folder / "sweep.png", [(row.values, row.summary.get("measures", {})) for row in rows])
    click.echo(f"  {folder / 'sweep.csv'}" + (f", {folder / 'sweep.png'}" if drawn else ""))
    ends = {row.status for row in rows}
    if STOPPED in ends:
        click.echo("warp-pd: interrupted: repeat the command to continue", err=True)
        return deadline.exit_code
    return DIVERGED_CODE if ends - {FINISHED, REFUSED} else WRONG_INPUT if REFUSED in ends else 0
