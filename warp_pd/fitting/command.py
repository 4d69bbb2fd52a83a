"""The command warp-pd fit."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from ..device.checks import InputError
from ..run.arguments import converted
from ..run.folder import free_folder
from ..run.scene_files import load_scene
from ..run.scene_help import SceneCommand
from .columns import read_tests
from .data import Test
from .least_squares import LOSSES, fit
from .model import SceneTests
from .report import Fit

# Points and assignments "name=value" -> settings of a scene, as text.
Settings = Callable[[int | None, tuple[str, ...]], dict[str, Any]]


def fit_command(settings_of: Settings) -> click.Command:
    """The command, which reads the settings of a scene by `settings_of`."""

    @click.command("fit", cls=SceneCommand)
    @click.argument("scene")
    @click.argument("data", nargs=-1, required=True, metavar="DATA.csv...", type=click.Path(path_type=Path))
    @click.option("--vary", required=True, metavar="NAME,...", help="Arguments of the scene that are fitted.")
    @click.option("--measure", help="The measure of the scene that was measured; by default the column's name.")
    @click.option("--bounds", multiple=True, metavar="NAME=LOW:HIGH", help="Bounds of a constant; may be repeated.")
    @click.option("--loss", default="linear", help="linear, or soft_l1 for data with outliers.")
    @click.option("--points", type=int, help="Points along x.")
    @click.option(
        "--set", "assignments", multiple=True, metavar="NAME=VALUE",
        help="A parameter of the scene, or the start value of a constant; may be repeated.",
    )  # fmt: skip
    @click.option("--device", help="cpu, cuda:0, ...; by default CUDA if available.")
    @click.option("--precision", type=int, help="32 or 64; by default the solver's.")
    @click.option("--out", help="Folder for the results; by default runs/SCENE-fit, or runs/SCENE-fit-2, ...")
    def command(
        scene: str, data: tuple[Path, ...], vary: str, measure: str | None, bounds: tuple[str, ...], loss: str,
        points: int | None, assignments: tuple[str, ...], device: str | None, precision: int | None, out: str | None,
    ) -> None:  # fmt: skip
        """Fit constants of SCENE to tests: CSV files with units in the header, all at once.

        A curve has a column for what was controlled, an argument of the scene such as "pressure [kPa]", "time [s]" or
        "load_factor [1]", and one for what was measured. Columns x, y, u, v (w) are displacements at places.
        """
        if loss not in LOSSES:
            raise InputError(f"--loss = {loss!r}: expected one of {', '.join(LOSSES)}")
        build = load_scene(scene).build
        parameters = inspect.signature(build).parameters
        given = settings_of(points, assignments)
        settings = {key: converted(key, value, parameters) for key, value in given.items()}
        tests: list[Test] = []
        for path in data:
            found, notes = read_tests(path, build, measure, settings)
            tests += found
            for note in notes:
                click.echo(note)
        names = [name.strip().replace("-", "_") for name in vary.split(",") if name.strip()]
        result = fit(
            SceneTests(build, tests, settings), names, bounds=_bounds(bounds), loss=loss, device=device,
            precision=precision,
        )  # fmt: skip
        run = run_line(scene, points, assignments, result)
        folder = free_folder(Path("runs") / f"{Path(scene).stem}-fit") if out is None else Path(out)
        result.save(folder, run)
        click.echo(result.table())
        click.echo(f"results in {folder}")
        click.echo(f"run the fitted scene: {run}")

    return command


def run_line(scene: str, points: int | None, assignments: Sequence[str], result: Fit) -> str:
    """The command that runs the fitted scene."""
    kept = [text for text in assignments if text.partition("=")[0].strip().replace("-", "_") not in result.names]
    values = [f"{name}={value:.9g}" for name, value in result.estimates.items()]
    size = [] if points is None else ["--points", str(points)]
    return " ".join(["warp-pd", "run", scene, *size, *(f"--set {text}" for text in (*kept, *values))])


def _bounds(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Bounds by name.

    Raises:
        InputError: for text that is no NAME=LOW:HIGH.
    """
    found = {}
    for text in texts:
        name, _, limits = text.partition("=")
        low, separator, high = limits.partition(":")
        try:
            if not separator:
                raise ValueError
            found[name.strip()] = (float(low or "-inf"), float(high or "inf"))
        except ValueError:
            raise InputError(f"--bounds {text!r}: expected NAME=LOW:HIGH") from None
        if not found[name.strip()][0] < found[name.strip()][1]:
            raise InputError(f"--bounds {text!r}: expected LOW below HIGH")
    return found
