"""The command warp-pd sweep: starting the runs, printing, and writing the table and plot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..device.checks import InputError
from ..geometry.picture_files import Drawing, drawing
from ..interfaces.communicator import LostError
from ..output.curves import draw_sweep
from .divergence import DivergedError
from .folder import run_summary, writable_folder
from .processes import DIVERGED, INTERRUPTED, LOST, WRONG_INPUT, launch
from .runner import FINISHED, STOPPED
from .scene_files import build_scene, load_scene
from .sweep import REFUSED, Row, Start, Task, printed_table, sweep, write_table


def here(options: Mapping[str, Any]) -> Start:
    """Return a function that runs one task of a sweep in this process, with options of `Simulation.run`."""

    def start(task: Task) -> Mapping[str, Any]:
        found = task.simulation.run(out=task.folder, resume=task.resume, overwrite=task.overwrite, **options)
        return dict(found.summary)

    return start


def apart(scene: str, options: Mapping[str, Any], gpus: int, processes: int) -> Start:
    """Return a function that runs one task as a separate `warp-pd run` with --gpus or --processes.

    Args:
        scene: Name or file.
        options: As for `here`.
        gpus: Number of GPUs, or 1.
        processes: Number of processes, or 1.
    """

    def start(task: Task) -> Mapping[str, Any]:
        code = launch(gpus, processes, options["device"], ["run", scene, *_arguments(task, options)])
        return _summary(task.folder, code)

    return start


def _arguments(task: Task, options: Mapping[str, Any]) -> list[str]:
    """Arguments of `warp-pd run` after the scene for a run of a sweep, without the number of processes."""
    given = [f"--set={name}={value}" for name, value in task.values.items()]
    given += [f"--{name}={options[name]}" for name in ("device", "precision") if options[name] is not None]
    given += [f"--pictures={options['pictures']}"] if options["pictures"] else ["--no-pictures"]
    flags = {"usd": "--no-usd", "view": "--no-view"}
    given += [flag for name, flag in flags.items() if not options[name]]
    given += [flag for flag, wanted in (("--resume", task.resume), ("--overwrite", task.overwrite)) if wanted]
    return [*given, f"--out={task.folder}", "--quiet"]


def _summary(folder: Path, code: int) -> Mapping[str, Any]:
    """The summary of a run in other processes, which have already printed any error."""
    if code == WRONG_INPUT:
        raise InputError("refused, see above")
    if code == LOST:
        raise LostError("a process of the run ended; repeat the command to continue")
    summary = run_summary(folder)
    if summary is None and code == INTERRUPTED:
        raise KeyboardInterrupt
    if summary is None:
        raise DivergedError("no frame was written, see above")
    return summary


def run_sweep(
    scene: str, choices: Mapping[str, Sequence[str]], folder: Path, start: Start, device: str | None,
    precision: int | None, overwrite: bool, quiet: bool,
) -> int:  # fmt: skip
    """Run a sweep, print and write its table, draw its plot, and return the exit code of the worst run.

    Arguments are those of `sweep`; `quiet` prints only the table.

    Raises:
        InputError: if the scene does not exist, the folder cannot be written, or it has different runs.
    """
    load_scene(scene)
    writable_folder(folder, resume=False)

    def told(number: int, count: int, row: Row) -> None:
        if not quiet:
            seconds = f" in {row.summary['wall_s']:.1f} s" if row.summary and not row.skipped else ""
            text = f"{row.status}{', done before' if row.skipped else ''}{seconds}"
            click.echo(f"[{number}/{count}] {row.name}: {text}", err=True)

    def build(values: dict[str, str]) -> Any:
        return build_scene(scene, values)

    rows = sweep(build, choices, folder, start, device=device, precision=precision, overwrite=overwrite, told=told)
    for row in rows:
        if row.message:
            click.echo(f"warp-pd: {row.name}: {row.message}", err=True)
    click.echo(printed_table(rows))
    if not write_table(folder / "sweep.csv", rows):
        click.echo(
            f"warp-pd: {folder / 'sweep.csv'}: not replaced, because it has results that the new table lacks", err=True
        )
        return WRONG_INPUT
    with drawing(Drawing(Path(scene).stem)):
        drawn = draw_sweep(folder / "sweep.png", [(row.values, row.summary.get("measures", {})) for row in rows])
    click.echo(f"  {folder / 'sweep.csv'}" + (f", {folder / 'sweep.png'}" if drawn else ""))
    ends = {row.status for row in rows}
    if STOPPED in ends:
        click.echo("warp-pd: interrupted: repeat the command to continue", err=True)
        return INTERRUPTED
    return DIVERGED if ends - {FINISHED, REFUSED} else WRONG_INPUT if REFUSED in ends else 0
