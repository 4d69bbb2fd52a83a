"""Command line: warp-pd list, run, plan, draw, info, bench."""

from __future__ import annotations

import contextlib
import difflib
import functools
import importlib
import importlib.util
import inspect
import os
import pkgutil
import sys
import traceback
from pathlib import Path
from typing import Any

import click

from .checks import InputError, OutputError, count, kind_and_text, one_of, user_code
from .device.crew import LostError
from .run.processes import crew_here, is_first, launch, processes_here
from .simulation import Simulation

WRONG_INPUT, DIVERGED, LOST = 2, 3, 4


class OneLineGroup(click.Group):
    """A group that reports wrong input in one line and exits with code 2."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            where = error.ctx.command_path if error.ctx is not None else "warp-pd"
            _say(f"{error.format_message()} (see {where} --help)")
            ctx.exit(WRONG_INPUT)
        except LostError as error:
            click.echo(f"warp-pd: {error}", err=True)
            sys.stderr.flush()
            # What still waits for the other process would hang.
            os._exit(LOST)
        except (InputError, MemoryError) as error:
            _say(str(error))
            if isinstance(error, OutputError):
                # HDF5 crashes at the exit of a process in which a file could not be written.
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(WRONG_INPUT)
            ctx.exit(WRONG_INPUT)


def _say(text: str) -> None:
    """One line on stderr; of several processes the first says it."""
    if is_first():
        click.echo(f"warp-pd: {text}", err=True)


@click.group(cls=OneLineGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="warp-pd")
def main() -> None:
    """Peridynamics of thin rubber sheets that stretch, wrinkle, tear and get pierced."""


def scene_names() -> list[str]:
    """Names of the scenes that come with the package."""
    package = importlib.import_module("warp_pd.scenes")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


def load_scene(name: str) -> Any:
    """The module of a scene, by name, or by the path of a Python file with a function `build`.

    Raises:
        InputError: if there is none; the message names the nearest one.
    """
    if name.endswith(".py"):
        return _load_file(Path(name))
    return importlib.import_module(f"warp_pd.scenes.{one_of('scene', name, scene_names())}")


def _load_file(path: Path) -> Any:
    if not path.is_file():
        raise InputError(f"scene = {str(path)!r}: the file does not exist")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # As Python does for a script, so that the file can import modules in its folder.
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    with user_code(functools.partial(_said_in, path)):
        try:
            spec.loader.exec_module(module)
        except SyntaxError as error:
            raise InputError(f"scene = {str(path)!r}: line {error.lineno}: {error.msg}") from None
    if not callable(getattr(module, "build", None)):
        raise InputError(f"scene = {str(path)!r}: the file has no function build(...) that returns a Simulation")
    return module


def _said_in(path: Path, error: Exception) -> str:
    """One line on an error in a scene's file, with the last line number of that file in the traceback."""
    steps = traceback.extract_tb(error.__traceback__)
    lines = [step.lineno for step in steps if Path(step.filename).resolve() == path.resolve()]
    where = f"line {lines[-1]}: " if lines else ""
    return f"scene = {str(path)!r}: {where}{kind_and_text(error)}"


def build_scene(name: str, settings: dict[str, Any]) -> Any:
    """The simulation of a scene; `settings` contains text or numbers for the arguments of its `build`.

    Raises:
        InputError: for a name that the scene does not know, or a value that does not fit.
    """
    scene = load_scene(name)
    parameters = inspect.signature(scene.build).parameters
    values = {key: _convert(key, value, parameters) for key, value in settings.items()}
    own = name.endswith(".py")
    with user_code(functools.partial(_said_in, Path(name))) if own else contextlib.nullcontext():
        simulation = scene.build(**values)
    if not isinstance(simulation, Simulation):
        raise InputError(f"scene = {name!r}: build returned {type(simulation).__name__}; expected a Simulation")
    simulation.scene = Path(name).stem
    simulation.file = str(Path(name).resolve()) if own else None
    used = {key: values.get(key, p.default) for key, p in parameters.items()}
    simulation.settings = {k: v for k, v in used.items() if isinstance(v, str | int | float | bool | type(None))}
    return simulation


def _convert(key: str, value: Any, parameters: Any) -> Any:
    """`value` in the type of the argument's default."""
    if key not in parameters:
        nearest = difflib.get_close_matches(key, list(parameters), n=1, cutoff=0.6)
        hint = f" (did you mean {nearest[0]!r}?)" if nearest else ""
        if key == "duration" and {"speed", "travel"} <= set(parameters):
            hint = " (the duration is travel / speed)"
        raise InputError(f"{key} is not an argument of this scene: expected one of {', '.join(parameters)}{hint}")
    default = parameters[key].default
    if not isinstance(value, str) or isinstance(default, str):
        return value
    if isinstance(default, bool):
        known = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        return known[one_of(f"--set {key}", value.lower(), known)]
    if isinstance(default, int):
        try:
            return int(value)
        except ValueError:
            raise InputError(f"--set {key} = {value!r}: expected a whole number") from None
    if value.lower() == "none" and default is None:
        return None
    try:
        return float(value)
    except ValueError:
        raise InputError(f"--set {key} = {value!r}: expected a number") from None


def _settings(
    points: int | None, horizon: float | None, force: str | None, weights: str | None, solver: str | None,
    duration: float | None, frames: int | None, assignments: tuple[str, ...],
) -> dict[str, Any]:  # fmt: skip
    named = {
        "points": points, "horizon": horizon, "force": force, "weights": weights, "solver": solver,
        "duration": duration, "frames": frames,
    }  # fmt: skip
    settings = {key: value for key, value in named.items() if value is not None}
    for text in assignments:
        key, separator, value = text.partition("=")
        if not separator or not key.strip():
            raise InputError(f"--set {text!r}: expected name=value")
        name = key.strip().replace("-", "_")
        if name in settings:
            raise InputError(f"--set {text}: {name} = {settings[name]} is given already; expected one value")
        settings[name] = value.strip()
    return settings


def _scene_options(command: Any) -> Any:
    """Options common to `run` and `plan`."""
    options = [
        click.argument("scene"),
        click.option("--points", type=int, help="Points along x."),
        click.option("--horizon", type=float, help="Horizon in spacings, such as 1.5, 2.015 or 3.15."),
        click.option(
            "--force",
            help="bond_associated, nodal, closed_form, neural, neural_fused or a network's file (.npz), in the scenes "
            "of the NN paper; bond_associated, bond_based, bond_based_refitted in `stretch`.",
        ),
        click.option("--weights", help="published, plain, corrected or auto."),
        click.option("--solver", help="explicit, relaxation or newton, in static scenes."),
        click.option("--duration", type=float, help="Simulated time [s], in scenes that take one."),
        click.option("--frames", type=int, help="Number of frames after the first, in dynamic scenes."),
        click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="NAME=VALUE",
            help="A parameter of the scene; may be repeated.",
        ),
        click.option("--device", help="cpu, cuda:0, ...; by default CUDA if available."),
        click.option("--precision", type=int, help="32 or 64; by default 32 for dynamics, 64 for static solvers."),
    ]
    for option in reversed(options):
        command = option(command)
    return command


@main.command("list")
def list_scenes() -> None:
    """List the scenes."""
    for name in scene_names():
        text = inspect.getdoc(load_scene(name)) or ""
        click.echo(f"{name:20s} {text.splitlines()[0]}")


@main.command()
@_scene_options
@click.option("--out", help="Folder for the results; by default runs/SCENE, or runs/SCENE-2, ... if it holds some.")
@click.option("--resume", is_flag=True, help="Continue from the last frame in the folder, by default the newest.")
@click.option("--overwrite", is_flag=True, help="Replace the results of another run in the folder.")
@click.option("--no-usd", is_flag=True, help="Do not write animation.usd.")
@click.option("--no-pictures", is_flag=True, help="Do not draw pictures.")
@click.option("--quiet", is_flag=True, help="Do not show progress.")
@click.option(
    "--processes", "--gpus", "processes", type=int, default=1,
    help="Divide the sheet among so many processes, a GPU each; with --device cpu they share the cores.",
)  # fmt: skip
def run(
    scene: str, points: int | None, horizon: float | None, force: str | None, weights: str | None,
    solver: str | None, duration: float | None, frames: int | None, assignments: tuple[str, ...], device: str | None,
    precision: int | None, out: str | None, resume: bool, overwrite: bool, no_usd: bool, no_pictures: bool, quiet: bool,
    processes: int,
) -> None:  # fmt: skip
    """Run SCENE: a name from `warp-pd list`, or a Python file with a function build(...)."""
    if count("processes", processes, 1) > 1 and processes_here() == 1:
        sys.exit(launch(processes, sys.argv[1:]))
    quiet = quiet or not is_first()
    from .output.progress import Progress
    from .run.folder import free_folder, newest_folder
    from .run.report import report
    from .run.runner import DIVERGED as RUN_DIVERGED
    from .run.runner import NOT_CONVERGED, STOPPED, DivergedError

    settings = _settings(points, horizon, force, weights, solver, duration, frames, assignments)
    crew, _ = crew_here(device)
    simulation = crew.together(lambda: build_scene(scene, settings))
    folder: str | Path = Path("runs") / simulation.scene if out is None else out
    if out is None and not overwrite:
        folder = newest_folder(Path(folder)) if resume else free_folder(Path(folder))
    try:
        result = simulation.run(
            out=folder,
            device=device,
            precision=precision,
            resume=resume,
            overwrite=overwrite,
            usd=not no_usd,
            pictures=not no_pictures,
            reporter=Progress(quiet),
        )
    except DivergedError as error:
        _say(str(error))
        sys.exit(DIVERGED)
    except KeyboardInterrupt:
        _say("interrupted before the first frame")
        sys.exit(130)
    if not quiet:
        for line in report(result):
            click.echo(line)
    if result.summary["message"]:
        _say(result.summary["message"])
    if result.status in (RUN_DIVERGED, NOT_CONVERGED):
        sys.exit(DIVERGED)
    if result.status == STOPPED:
        sys.exit(130)


@main.command()
@_scene_options
def plan(
    scene: str, points: int | None, horizon: float | None, force: str | None, weights: str | None,
    solver: str | None, duration: float | None, frames: int | None, assignments: tuple[str, ...], device: str | None,
    precision: int | None,
) -> None:  # fmt: skip
    """Show the arrays and launches of SCENE, and the part that each belongs to."""
    simulation = build_scene(scene, _settings(points, horizon, force, weights, solver, duration, frames, assignments))
    click.echo(simulation.plan(device, precision))


@main.command("draw")
@click.argument("folder", metavar="FOLDER|SCENE", type=click.Path(path_type=Path))
@click.option("--scene", help="The scene's file, if it has moved.")
@click.option("--shape", is_flag=True, help="Draw the sheet of SCENE before it runs.")
@click.option("--points", type=int, help="With --shape: points along x.")
@click.option("--set", "assignments", multiple=True, metavar="NAME=VALUE", help="With --shape: as for `run`.")
@click.option("--out", help="With --shape: the picture, .png, .pdf or .svg; by default SCENE-shape.png.")
def draw(
    folder: Path, scene: str | None, shape: bool, points: int | None, assignments: tuple[str, ...], out: str | None
) -> None:
    """Draw the pictures of a run from its FOLDER again, for runs made with --no-pictures or changed pictures.

    With --shape: draw the sheet of SCENE, a name from `warp-pd list` or a Python file. Nothing is compiled or run.
    """
    if shape:
        if scene is not None:
            raise InputError(f"--scene {scene}: expected it without --shape; name the scene itself")
        settings = _settings(points, None, None, None, None, None, None, assignments)
        simulation = build_scene(str(folder), settings)
        picture = out or f"{simulation.scene}-shape.png"
        simulation.draw(picture)
        click.echo(f"  {picture}")
        return
    given = {"--points": points, "--set": assignments or None, "--out": out}
    for option in (name for name, value in given.items() if value is not None):
        raise InputError(f"{option}: expected it with --shape")
    _draw_again(folder, scene)


def _draw_again(folder: Path, scene: str | None) -> None:
    from .run.folder import read_history, run_summary
    from .run.runner import draw as draw_pictures

    summary = run_summary(folder)
    if summary is None:
        raise InputError(f"folder = {str(folder)!r}: expected one with the summary.json of a run")
    if scene is not None and Path(scene).stem != summary["scene"]:
        raise InputError(f"scene = {scene!r}: expected {summary['scene']!r}, the scene of this run")
    simulation = build_scene(scene or summary.get("file") or summary["scene"], summary["settings"])
    if simulation.pictures is None:
        raise InputError(f"scene = {simulation.scene!r}: it draws no pictures")
    draw_pictures(simulation, read_history(folder / "history.csv"), folder)
    for path in sorted(folder.glob("*.png")):
        click.echo(f"  {path.name}")


@main.command()
@click.argument("file", metavar="FILE|FOLDER", type=click.Path(path_type=Path))
def info(file: Path) -> None:
    """Show the contents of a frames.vtkhdf, an animation.usd, a summary.json, or a folder of them."""
    from .output.info import describe

    click.echo(describe(file))


@main.command()
@click.option("--points", type=int, multiple=True, default=(101,), help="Points along a side; may be repeated.")
@click.option("--horizon", type=float, multiple=True, default=(2.015, 3.15), help="In spacings; may be repeated.")
@click.option("--law", default="bond_associated", help="bond_associated or bond_based.")
@click.option("--precision", type=int, default=32, help="32 or 64.")
@click.option("--features", default="", help="supports, pressure, contact, rupture, energy, damping; or all.")
@click.option("--layout", default="lattice", help="lattice, hole, cloud, or tube: a curved cloud.")
@click.option("--damaged", type=float, default=0.0, help="Fraction of the points that have lost a bond, with rupture.")
@click.option("--plain", is_flag=True, help="Use the reference kernels.")
@click.option("--seconds", type=float, default=1.0, help="Measured time of each case.")
@click.option("--device", help="Such as cpu or cuda:0.")
def bench(
    points: tuple[int, ...], horizon: tuple[float, ...], law: str, precision: int, features: str, layout: str,
    damaged: float, plain: bool, seconds: float, device: str | None,
) -> None:  # fmt: skip
    """Time the steps of a sheet, and print a table."""
    from .bench import FEATURES, Case, arithmetic_rate, copy_rate, measure, table
    from .checks import count, positive
    from .device.context import find_device

    one_of("precision", precision, (32, 64))
    positive("seconds", seconds)
    chosen = FEATURES if features == "all" else tuple(name.strip() for name in features.split(",") if name.strip())
    cases = [
        Case(
            count("points", n, 3),
            positive("horizon", m),
            precision,
            chosen,
            layout,
            damaged=damaged,
            fast=not plain,
            law=law,
        )
        for m in horizon
        for n in points
    ]
    where = find_device(device)
    copied = copy_rate(where, 1024 if where.is_cuda else 64)
    counted = {precision: arithmetic_rate(where, precision)} if where.is_cuda else None
    click.echo(f"{where.name}: copies {copied / 1e9:.0f} GB/s, read and written")
    click.echo(table([measure(case, str(where), seconds) for case in cases], copied, counted))


if __name__ == "__main__":
    main()
