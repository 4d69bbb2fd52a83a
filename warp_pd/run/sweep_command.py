"""The command warp-pd sweep: runs, printing, and writing the table and plot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..device.checks import DIVERGED, INTERRUPTED, WRONG_INPUT
from ..geometry.picture_files import Drawing, drawing
from ..output.curves import draw_sweep
from .folder import remove_if_empty, writable_folder
from .runner import FINISHED, STOPPED
from .scene_files import build_scene, load_scene
from .sweep import REFUSED, Row, printed_table, sweep, write_table


def run_sweep(
    scene: str, choices: Mapping[str, Sequence[str]], folder: Path, options: Mapping[str, Any], overwrite: bool,
    quiet: bool,
) -> int:  # fmt: skip
    """Run a sweep, print and write its table, draw its plot, and return the exit code of the worst run.

    Arguments are those of `sweep`; `quiet` prints only the table.
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

    rows = sweep(build, choices, folder, options, overwrite=overwrite, told=told)
    for row in rows:
        if row.message:
            click.echo(f"warp-pd: {row.name}: {row.message}", err=True)
    click.echo(printed_table(rows))
    if not write_table(folder / "sweep.csv", rows):
        if (folder / "sweep.csv").is_file():
            click.echo(
                f"warp-pd: {folder / 'sweep.csv'}: not replaced: it has results that the new table lacks", err=True
            )
        remove_if_empty(folder)
        return WRONG_INPUT
    with drawing(Drawing(Path(scene).stem)):
        drawn = draw_sweep(folder / "sweep.png", [(row.values, row.summary.get("measures", {})) for row in rows])
    click.echo(f"  {folder / 'sweep.csv'}" + (f", {folder / 'sweep.png'}" if drawn else ""))
    ends = {row.status for row in rows}
    if STOPPED in ends:
        click.echo("warp-pd: interrupted: repeat the command to continue", err=True)
        return INTERRUPTED
    return DIVERGED if ends - {FINISHED, REFUSED} else WRONG_INPUT if REFUSED in ends else 0
