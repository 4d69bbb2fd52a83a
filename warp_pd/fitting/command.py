"""The command warp-pd fit."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..device.checks import InputError, one_of
from ..run.arguments import converted
from ..run.folder import free_folder
from ..run.scene_files import load_scene
from .columns import read_tests
from .data import Test
from .least_squares import LOSSES, fit
from .model import SceneTests
from .report import Fit


@dataclass(frozen=True)
class FitOptions:
    """Options of the command.

    Attributes:
        vary: Comma-separated names of the constants.
        measure: The measure of the scene to compare with the data; None for the column's name.
        bounds: Texts of the form NAME=LOW:HIGH.
        loss: One of LOSSES.
        device: "cpu", "cuda:0", ...; None for CUDA if available.
        precision: 32 or 64; None for the solver's.
        out: Folder for the results; None for runs/SCENE-fit, or the first free of runs/SCENE-fit-2, ...
    """

    vary: str
    measure: str | None = None
    bounds: Sequence[str] = ()
    loss: str = "linear"
    device: str | None = None
    precision: int | None = None
    out: str | None = None


def fit_scene(scene: str, data: Sequence[Path], given: Mapping[str, Any], options: FitOptions) -> Iterator[str]:
    """Fit constants of a scene to tests, save the result, and return the lines to print.

    Args:
        scene: Name or file.
        data: CSV files of the tests.
        given: Arguments of the scene and initial values of constants, as text or numbers.
        options: Options of the command.

    Raises:
        InputError: if files, names or values are invalid.
    """
    one_of("--loss", options.loss, LOSSES)
    bounds = _bounds(options.bounds)
    build = load_scene(scene).build
    parameters = inspect.signature(build).parameters
    settings = {key: converted(key, value, parameters) for key, value in given.items()}
    tests: list[Test] = []
    for path in data:
        found, notes = read_tests(path, build, options.measure, settings)
        tests += found
        yield from notes
    names = [name.strip().replace("-", "_") for name in options.vary.split(",") if name.strip()]
    result = fit(
        SceneTests(build, tests, settings), names, bounds=bounds, loss=options.loss, device=options.device,
        precision=options.precision,
    )  # fmt: skip
    run = run_line(scene, given, result)
    folder = free_folder(Path("runs") / f"{Path(scene).stem}-fit") if options.out is None else Path(options.out)
    result.save(folder, run)
    yield result.table()
    yield f"results in {folder}"
    yield f"run the fitted scene: {run}"


def run_line(scene: str, given: Mapping[str, Any], result: Fit) -> str:
    """The command that runs the fitted scene."""
    kept = {name: value for name, value in given.items() if name not in result.names}
    size = ["--points", str(kept.pop("points"))] if "points" in kept else []
    values = {**kept, **{name: f"{value:.9g}" for name, value in result.estimates.items()}}
    return " ".join(["warp-pd", "run", scene, *size, *(f"--set {name}={value}" for name, value in values.items())])


def _bounds(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Bounds by name. Raises InputError for text other than NAME=LOW:HIGH."""
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
