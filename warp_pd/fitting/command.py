"""The command warp-pd fit."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..command.arguments import converted
from ..command.scene_files import load_scene, require_settings, written_parameters
from ..device.checks import InputError, one_of
from ..run.folder import claimed_folder, pictures_in, remove_if_empty, results_in, sole_use, writable_folder
from ..viewer.pictures import Drawing, drawing
from .data import LOSSES, read_table

if TYPE_CHECKING:
    from .report import Fit


def fit_scene(
    scene: str, data: Sequence[Path], given: Mapping[str, Any], *, vary: str, measure: str | None,
    bounds: Sequence[str], loss: str, device: str | None, precision: int | None, out: str | None,
) -> Iterator[str]:  # fmt: skip
    """Fit constants of a scene (name or file) to CSV files, save the result, and return the lines to print.

    `given` holds arguments of the scene and initial values of constants, as text or numbers; the others are options of
    the command, as text.
    """
    one_of("--loss", loss, LOSSES)
    limits = _bounds(bounds)
    require_settings(scene, given)
    names = [name.strip().replace("-", "_") for name in vary.split(",") if name.strip()]
    _require_constants(names, limits, written_parameters(scene))
    tables = [read_table(path) for path in data]
    # After what needs neither the scene nor Warp.
    build = load_scene(scene).build
    from .columns import read_tests
    from .experiment import Experiment
    from .least_squares import fit
    from .model import SceneTests
    from .rates import law_tests, read_ramps

    parameters = inspect.signature(build).parameters
    settings = {key: converted(key, value, parameters) for key, value in given.items()}
    tests, ramps = [], []
    for table in tables:
        if (curves := read_ramps(table, measure)) is not None:
            ramps += curves[0]
            yield from curves[1]
            continue
        found, notes = read_tests(table, build, measure, settings)
        tests += found
        yield from notes
    if not (tests or measure is None or any(measure in table.columns for table in tables)):
        raise InputError(
            f"measure = {measure!r}: expected a column of the files; leave --measure out if they name theirs"
        )
    experiments: list[Experiment] = []
    if ramps:
        experiments.append(law_tests(build, ramps, settings))
    if tests:
        experiments.append(SceneTests(build, tests, settings))
    with _folder(Path("runs") / f"{Path(scene).stem}-fit" if out is None else Path(out), out is None) as folder:
        result = fit(experiments, names, bounds=limits, loss=loss, device=device, precision=precision)
        run = run_line(scene, given, result)
        with drawing(Drawing(others=frozenset(path.name for path in pictures_in(folder)))):
            result.save(folder, run)
    yield result.table()
    yield f"results in {folder}"
    yield f"run the fitted scene: {run}"


def _require_constants(
    names: Sequence[str], limits: Mapping[str, Any], parameters: Mapping[str, inspect.Parameter] | None
) -> None:
    """Check the names of the fitted constants, and of those with bounds, against the parameters of the scene."""
    if not names:
        raise InputError("vary = '': expected arguments of the scene, such as mu,lock")
    if parameters is not None and (unknown := [name for name in names if name not in parameters]):
        raise InputError(f"vary = {unknown[0]!r}: expected an argument of the scene: {', '.join(parameters)}")
    for name in limits:
        one_of("--bounds", name, names)


@contextlib.contextmanager
def _folder(wanted: Path, numbered: bool) -> Iterator[Path]:
    """Context with the folder of the results, or the next number of it, and its lock; removed at the end if empty.

    Raises InputError before anything is fitted if it cannot take the results.
    """
    if numbered:
        with claimed_folder(wanted) as folder:
            yield folder
        return
    with contextlib.ExitStack() as stack:
        writable_folder(wanted, resume=False)
        stack.callback(remove_if_empty, wanted)
        stack.enter_context(sole_use(wanted))
        if left := results_in(wanted):
            raise InputError(f"out = {str(wanted)!r}: it contains {left[0]}; expected a folder without results (--out)")
        yield wanted


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
