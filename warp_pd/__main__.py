"""Command line: warp-pd list, run, sweep, plan, warm, draw, view, fit, info, bench.

Each command imports its dependencies when it runs, so that help texts appear without loading Warp.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import inspect
import json
import sys
from pathlib import Path
from typing import Any

import click

from .command.completion import SceneName, complete_setting
from .command.group import OneLineGroup, open_closed_streams, release_lost_streams, say, tell
from .command.scene_files import (
    build_scene,
    load_scene,
    require_scene,
    require_settings,
    scene_names,
)
from .command.scene_help import SceneCommand
from .device.checks import InputError, count, device_name, one_of, show, vector
from .device.version import __version__

# Objects that Python may create before it looks for garbage. Warp, USD and Matplotlib create hundreds of thousands that
# stay; with Python's own 700 a tenth of a short run goes into looking through them.
COLLECT_AFTER = 10_000


@click.group(cls=OneLineGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def main() -> None:
    """Peridynamics of thin rubber sheets: stretching, wrinkling, tearing and puncture."""
    gc.set_threshold(COLLECT_AFTER)
    open_closed_streams()
    # What is left at the end needs no look: the system takes it back.
    atexit.register(gc.freeze)
    atexit.register(release_lost_streams)


def _bits(value: int | None) -> int | None:
    """The value of --precision."""
    return value if value is None else one_of("precision", value, (32, 64))


DEVICE = click.option(
    "--device", help="cpu, cuda:0, ...; by default CUDA if available.", callback=lambda _, __, name: device_name(name)
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
PRECISION = click.option(
    "--precision",
    type=int,
    help="32 or 64; by default 32 for dynamics, 64 for static solvers.",
    callback=lambda _, __, bits: _bits(bits),
)

PICTURES = click.option(
    "--pictures", help="Format of the pictures: png, pdf, svg, or several such as png,pdf; by default png."
)


def _expect_none(given: dict[str, Any], where: str) -> None:
    """Check that no option is given, by name, where it would be ignored; it is expected only `where`."""
    for option in (name for name, value in given.items() if value is not None):
        raise InputError(f"{option}: expected only {where}")


def _settings(assignments: tuple[str, ...], named: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a scene, from named options and from --set."""
    settings = {key: value for key, value in named.items() if value is not None}
    return settings | _assigned(assignments, settings)


def _scene_settings(scene: str, assignments: tuple[str, ...], named: dict[str, Any], printed: bool) -> dict[str, Any]:
    """Arguments of a scene, checked against its file; with `printed` those of its paper come first."""
    settings = _settings(assignments, named)
    if printed:
        from .papers.as_published import as_published

        require_scene(scene)
        settings = as_published(scene, settings)
    require_settings(scene, settings)
    return settings


def _assigned(assignments: tuple[str, ...], given: dict[str, Any]) -> dict[str, str]:
    """Parse the --set NAME=VALUE assignments; none may repeat an argument in `given`."""
    found: dict[str, str] = {}
    for text in assignments:
        key, separator, value = text.partition("=")
        if not separator or not key.strip():
            raise InputError(f"--set {text!r}: expected name=value")
        name = key.strip().replace("-", "_")
        earlier = given.get(name, found.get(name))
        if earlier is not None:
            raise InputError(f"--set {text}: {name} = {earlier} is already given; expected only one value")
        found[name] = value.strip()
    return found


def _of_a_sweep(command: Any) -> Any:
    """Add the options of `sweep` that take comma-separated values."""
    values = "VALUE,VALUE,..."
    assigned = "Comma-separated values of an argument of the scene; tuples in brackets. May be repeated."
    command = click.option(
        "--set", "assignments", multiple=True, metavar=f"NAME={values}", help=assigned, shell_complete=complete_setting
    )(command)
    for name in ("frames", "duration", "solver", "weights", "force", "horizon", "points"):
        command = click.option(f"--{name}", metavar=values, help=f"As for `run`: {name}.")(command)
    return command


def _scene_options(command: Any) -> Any:
    """Add the options common to `run` and `plan`."""
    options = [
        click.argument("scene", type=SceneName()),
        click.option("--points", type=int, help="Points along x."),
        click.option("--horizon", type=float, help="Horizon in spacings, such as 1.5, 2.015 or 3.15."),
        click.option(
            "--force",
            help="bond_associated, nodal, closed_form, neural, neural_fused or a network's file (.npz), in the scenes "
            "of the NN paper; bond_associated, bond_based, bond_based_refitted in `stretch`.",
        ),
        click.option("--weights", help="published, plain, corrected or auto."),
        click.option("--solver", help="explicit, relaxation or newton, in static scenes."),
        click.option("--duration", type=float, help="Simulated time [s], in scenes that have this argument."),
        click.option("--frames", type=int, help="Number of frames after the first, in dynamic scenes."),
        click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="NAME=VALUE",
            help="An argument of the scene; may be repeated.",
            shell_complete=complete_setting,
        ),
        click.option(
            "--as-published",
            "printed",
            is_flag=True,
            help="Law, weights, criterion, horizon, sizes and rates as the scene's paper prints them; other options "
            "replace these.",
        ),
        DEVICE,
        PRECISION,
    ]
    for option in reversed(options):
        command = option(command)
    return command


@main.command("list")
@JSON
def list_scenes(as_json: bool) -> None:
    """List the scenes."""
    found = {name: (inspect.getdoc(load_scene(name)) or "").splitlines()[0] for name in scene_names()}
    if as_json:
        _print_json([{"name": name, "description": text} for name, text in found.items()])
        return
    for name, text in found.items():
        click.echo(f"{name:20s} {text}")


def _print_json(values: Any) -> None:
    """Print values as JSON; numbers that are not finite become null."""
    from .output.info import finite_values

    click.echo(json.dumps(finite_values(values), indent=2, allow_nan=False))


@main.command(cls=SceneCommand)
@_scene_options
@click.option("--out", help="Folder for the results; by default runs/SCENE, or runs/SCENE-2, ... if results exist.")
@click.option(
    "--resume",
    is_flag=True,
    help="Continue the run in the folder, by default in the newest one, from its restart file.",
)
@click.option("--overwrite", is_flag=True, help="Replace the results of another run in the folder.")
@click.option("--no-usd", is_flag=True, help="Do not write animation.usd.")
@click.option("--no-vtkhdf", is_flag=True, help="Do not write frames.vtkhdf, nor what is made from it.")
@click.option(
    "--fields",
    help="Point fields of frames.vtkhdf besides the displacement, with commas: such as damage,stretch,first_piola.",
)
@PICTURES
@click.option("--no-pictures", is_flag=True, help="Do not draw pictures.")
@click.option("--history-every", type=float, help="Time between rows of fine_history.csv [s], in dynamic scenes.")
@click.option("--stride", type=int, help="Store only every n-th column and row of a lattice in frames.")
@click.option("--no-restart", is_flag=True, help="Do not write restart.npz; the run cannot be resumed.")
@click.option("--no-view", is_flag=True, help="Do not write view.html, the page for a browser.")
@click.option("--live", is_flag=True, help="Show the run in a browser on this machine, pause and stop it there.")
@click.option("--quiet", is_flag=True, help="Do not show progress; notes (on stderr) and results are still printed.")
@click.option("--json", "as_json", is_flag=True, help="Print the contents of summary.json and the folder as JSON.")
@click.option("--gpus", type=int, default=1, help="Divide the sheet among this number of GPUs.")
@click.option(
    "--processes",
    type=int,
    default=1,
    help="Divide the sheet among this number of processes; with --device cpu they share the cores.",
)
def run(
    scene: str, assignments: tuple[str, ...], printed: bool, device: str | None, precision: int | None, out: str | None,
    resume: bool, overwrite: bool, no_usd: bool, no_vtkhdf: bool, fields: str | None, pictures: str | None,
    no_pictures: bool, history_every: float | None, no_view: bool, quiet: bool, gpus: int, processes: int,
    stride: int | None, no_restart: bool, as_json: bool, live: bool, **named: Any,
) -> None:  # fmt: skip
    """Run SCENE: a name from `warp-pd list`, or a Python file with a function build(...)."""
    from .device.checks import DIVERGED
    from .distributed import processes_here
    from .distributed.launch import is_first, launch
    from .run.folder import picture_formats

    require_scene(scene)
    if live and (asked := max(gpus, processes, processes_here())) > 1:
        raise InputError(f"--live: expected one process, got {asked}")
    if max(count("gpus", gpus, 1), count("processes", processes, 1)) > 1 and processes_here() == 1:
        sys.exit(launch(gpus, processes, device, sys.argv[1:]))
    if no_pictures:
        _expect_none({"--pictures": pictures}, "without --no-pictures")
    if no_vtkhdf:
        _expect_none({"--fields": fields, "--pictures": pictures, "--stride": stride}, "without --no-vtkhdf")
    stride, pictures = 1 if stride is None else stride, "png" if pictures is None else pictures
    count("stride", stride, 1)
    picture_formats(pictures)
    quiet = quiet or not is_first()
    settings = _scene_settings(scene, assignments, named, printed)
    from .run.built import communicator_here

    communicator, _ = communicator_here(device)
    simulation = communicator.barrier(lambda: build_scene(scene, settings))
    # After the scene, so that a refused one need not wait for these.
    from .interfaces.solver import FINISHED, STOPPED, DivergedError
    from .output.progress import Progress
    from .run.folder import claimed_folder, newest_folder
    from .run.result import report
    from .viewer.beside import number_beside, processes_beside

    folder: str | Path = Path("runs") / simulation.scene if out is None else out
    if out is None and resume:
        folder = newest_folder(Path(folder))
    drawn = is_first() and not (no_pictures or no_vtkhdf)
    try:
        with contextlib.ExitStack() as stack:
            if out is None and not resume and not overwrite and is_first():
                folder = stack.enter_context(claimed_folder(Path(folder)))
            stack.enter_context(processes_beside(number_beside(simulation.sheet.size) if drawn else 0))
            reporter, watching = Progress(quiet), []
            if live:
                from .viewer.live import LiveRun

                reporter = page = LiveRun(quiet)
                stack.callback(page.end)
                watching.append(page)
                tell(f"live: {page.address}", err=True)
            result = simulation.run(
                out=folder,
                device=device,
                precision=precision,
                resume=resume,
                overwrite=overwrite,
                usd=not (no_usd or no_vtkhdf),
                vtkhdf=not no_vtkhdf,
                fields=None if fields is None else [name.strip() for name in fields.split(",") if name.strip()],
                pictures=False if no_pictures or no_vtkhdf else pictures,
                view=not (no_view or no_vtkhdf),
                history_every=history_every,
                stride=stride,
                restarts=not no_restart,
                reporter=reporter,
                writers=watching,
            )
    except DivergedError as error:
        say(str(error))
        sys.exit(DIVERGED)
    if as_json and is_first():
        _print_json({**result.summary, "folder": str(result.folder)})
    elif is_first():
        told = reporter.noted if quiet else ()
        for note in result.summary["notes"]:
            if note not in told:
                tell(note, err=True)
        for line in report(result):
            tell(line)
    if result.summary["message"]:
        say(result.summary["message"])
    if result.status == STOPPED:
        from .run.stopping import deadline

        sys.exit(deadline.exit_code)
    if result.status != FINISHED:
        sys.exit(DIVERGED)


@main.command("sweep", cls=SceneCommand)
@click.argument("scene", type=SceneName())
@_of_a_sweep
@DEVICE
@PRECISION
@click.option("--out", help="Folder for the runs, the table and the plot; by default runs/SCENE-sweep.")
@click.option("--overwrite", is_flag=True, help="Run everything again.")
@click.option("--usd", is_flag=True, help="Write animation.usd in every folder.")
@click.option("--pictures", help="Draw the pictures of every run: png, pdf or svg.")
@click.option("--quiet", is_flag=True, help="Print only notes (on stderr) and the table.")
def sweep_values(
    scene: str, assignments: tuple[str, ...], device: str | None, precision: int | None, out: str | None,
    overwrite: bool, usd: bool, pictures: str | None, quiet: bool, **named: str | None,
) -> None:  # fmt: skip
    """Run SCENE for all combinations of values: --set horizon=2.015,3.15 --points 51,101.

    The runs are executed one after the other, each in a separate folder. Repeating the command continues an interrupted
    sweep and skips finished runs. A failed run does not stop the others: the table shows its status, and the exit code
    is that of the worst run.
    """
    from .command.arguments import split_values
    from .run.folder import picture_formats

    require_scene(scene)
    if pictures is not None:
        picture_formats(pictures)
    choices = {key: split_values(text) for key, text in named.items() if text is not None}
    for name, text in _assigned(assignments, choices).items():
        choices[name] = split_values(text)
    if not choices:
        raise InputError("sweep: expected values, such as --points 51,101 or --set horizon=2.015,3.15")
    for name, values in choices.items():
        for value in values:
            require_settings(scene, {**{key: texts[0] for key, texts in choices.items()}, name: value}, values=False)
    # After the arguments, so that a mistyped one need not wait for these.
    from .command.sweep import run_sweep

    folder = Path("runs") / f"{Path(scene).stem}-sweep" if out is None else Path(out)
    options = {"device": device, "precision": precision, "usd": usd, "pictures": pictures or False, "view": False}
    sys.exit(run_sweep(scene, choices, folder, options, overwrite, quiet))


@main.command(cls=SceneCommand)
@_scene_options
@JSON
@click.option(
    "--time/--no-time", "timed", default=None, help="Whether to time a run, by a second of its steps; by default yes."
)
def plan(
    scene: str, assignments: tuple[str, ...], printed: bool, device: str | None, precision: int | None, as_json: bool,
    timed: bool | None, **named: Any,
) -> None:  # fmt: skip
    """Show the arrays and launches of SCENE, each with the part that owns it, and how long a run takes here."""
    if as_json:
        _expect_none({"--time": timed or None}, "without --json")
    settings = _scene_settings(scene, assignments, named, printed)
    simulation = build_scene(scene, settings)
    if as_json:
        from .run.result import plan_values

        _print_json(plan_values(simulation.build(device, precision)))
    else:
        click.echo(simulation.plan(device, precision))
        if timed is not False:
            from .command.trial import foretold

            click.echo(foretold(simulation.build(device, precision)))


@main.command("warm")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...", type=SceneName())
@DEVICE
@PRECISION
@click.option("--quiet", is_flag=True, help="Do not show progress.")
def warm_kernels(scenes: tuple[str, ...], device: str | None, precision: int | None, quiet: bool) -> None:
    """Compile what SCENES use, by default all that are shipped, so that their first run need not.

    They are built without arguments: another horizon or law may have kernels of its own. Nothing is run.
    """
    from .command.warm import warm

    done, seconds = warm(scenes, device, precision, quiet)
    click.echo(f"kernels of {done} scene{'s' * (done != 1)} in {seconds:.1f} s")


@main.command("draw")
@click.argument("folder", metavar="FOLDER|SCENE", type=click.Path(path_type=Path))
@click.option("--scene", help="The scene's Python file, which is run; nothing in FOLDER is.")
@click.option("--shape", is_flag=True, help="Draw the undeformed sheet of SCENE.")
@click.option("--points", type=int, help="With --shape: points along x.")
@click.option("--set", "assignments", multiple=True, metavar="NAME=VALUE", help="With --shape: as for `run`.")
@PICTURES
@click.option("--out", help="With --shape: the picture, .png, .pdf or .svg; by default SCENE-shape.png.")
def draw(
    folder: Path, scene: str | None, shape: bool, points: int | None, assignments: tuple[str, ...],
    pictures: str | None, out: str | None,
) -> None:  # fmt: skip
    """Redraw the pictures of a run from its FOLDER, for example after --no-pictures or if the drawing code changed.

    With --shape: draw the undeformed sheet of SCENE, a name from `warp-pd list` or a Python file, without running it.
    """
    if shape:
        if scene is not None:
            raise InputError(f"--scene {scene}: expected only without --shape; give the scene as the argument instead")
        _expect_none({"--pictures": pictures}, "without --shape; the suffix of --out is the format")
        settings = _settings(assignments, {"points": points})
        require_settings(str(folder), settings)
        simulation = build_scene(str(folder), settings)
        picture = out or f"{simulation.scene}-shape.png"
        simulation.draw(picture)
        click.echo(f"  {picture}")
        return
    _expect_none({"--points": points, "--set": assignments or None, "--out": out}, "with --shape")
    _draw_again(folder, scene, "png" if pictures is None else pictures)


@main.command("film")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="The film; by default FOLDER/film.gif.")
@click.option("--field", help="Field of the colours; by default that of sheet.png.")
@click.option("--every", type=int, default=1, help="Show one in so many frames.")
@click.option("--rate", type=float, default=20.0, help="Pictures a second.")
@click.option("--view", help="Elevation and azimuth of the viewpoint in degrees, such as 28,-60.")
@click.option("--cut", help="What is cut away [m], such as y<0.05.")
def film(
    folder: Path, out: Path | None, field: str | None, every: int, rate: float, view: str | None, cut: str | None
) -> None:
    """Make a film of all frames of a run in FOLDER: .gif or .webp, and .mp4 or .webm where ffmpeg is installed."""
    from .run.folder import FILM, remember
    from .viewer.film import film as make

    if not (folder / "frames.vtkhdf").is_file():
        raise InputError(f"folder = {str(folder)!r}: expected the folder of a run that contains frames.vtkhdf")
    path = out or folder / FILM
    angles = None
    if view is not None:
        elevation, azimuth = vector("--view", view.split(","), 2)
        angles = (elevation, azimuth)
    pictures = make(folder, path, field, every=count("--every", every, 1), rate=rate, view=angles, cut=cut)
    remember(folder, path)
    click.echo(f"  {path}: {pictures} picture{'s' * (pictures != 1)}, {pictures / rate:.3g} s")


def _draw_again(folder: Path, scene: str | None, pictures: str) -> None:
    from .run.folder import picture_formats, run_summary

    formats, summary = picture_formats(pictures), run_summary(folder)
    if summary is None:
        raise InputError(f"folder = {str(folder)!r}: expected a folder with the summary.json of a run, or --shape")
    if scene is not None and Path(scene).stem != summary["scene"]:
        raise InputError(f"scene = {scene!r}: expected {summary['scene']!r}, the scene of this run")
    if scene is None and (summary.get("file") is not None or summary["scene"] not in scene_names()):
        raise InputError(
            f"folder = {str(folder)!r}: its scene is {show(summary.get('file') or summary['scene'])}, and a folder's "
            "word is not enough to run a file: expected --scene FILE.py"
        )
    simulation = build_scene(scene or summary["scene"], summary["settings"])
    from .viewer.after_run import redraw

    redraw(simulation, folder, summary, formats)
    for name in summary["pictures"]:
        click.echo(f"  {name}")


@main.command("view")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", help="The file; by default view.html in FOLDER.")
@click.option("--points", type=int, help="Largest number of points to draw; by default 40000.")
@click.option("--frames", type=int, help="Largest number of frames; by default as many as keep the page small.")
def view(folder: Path, out: str | None, points: int | None, frames: int | None) -> None:
    """Write the page of a run from its FOLDER: one HTML file for any browser, without server or network."""
    from .run.folder import remember
    from .viewer.view import write_page

    path = write_page(folder, out, points, frames)
    remember(folder, path)
    click.echo(f"  {path} ({path.stat().st_size / 1e6:.3g} MB)")


@main.command()
@click.argument("file", metavar="FILE|FOLDER", type=click.Path(path_type=Path))
@JSON
def info(file: Path, as_json: bool) -> None:
    """Show the contents of a frames.vtkhdf, animation.usd or summary.json, or of a folder with these files."""
    from .output.info import describe, values

    if as_json:
        _print_json(values(file))
    else:
        click.echo(describe(file))


@main.command()
@click.option("--points", type=int, multiple=True, default=(101,), help="Points along a side; may be repeated.")
@click.option(
    "--horizon", type=float, multiple=True, default=(2.015, 3.15), help="Horizon in spacings; may be repeated."
)
@click.option("--law", default="bond_associated", help="bond_associated or bond_based.")
@click.option("--precision", type=int, default=32, help="32 or 64.", callback=lambda _, __, bits: _bits(bits))
@click.option("--features", default="", help="supports, pressure, contact, rupture or damage_field, ...")
@click.option("--layout", default="lattice", help="lattice, hole, cloud, or tube: a curved cloud.")
@click.option("--damaged", type=float, default=0.0, help="Fraction of the points that are damaged.")
@click.option("--plain", is_flag=True, help="Use the reference kernels.")
@click.option("--seconds", type=float, default=1.0, help="Duration of the measurement of each case [s].")
@DEVICE
def bench(
    points: tuple[int, ...], horizon: tuple[float, ...], law: str, precision: int, features: str, layout: str,
    damaged: float, plain: bool, seconds: float, device: str | None,
) -> None:  # fmt: skip
    """Measure the time per step of a sheet, and print a table."""
    from .device.checks import positive

    positive("seconds", seconds)
    for n in points:
        count("points", n, 3)
    for m in horizon:
        positive("horizon", m)
    from .command.bench import Case, chosen_features, report

    cases = [
        Case(n, m, precision, chosen_features(features), layout, damaged=damaged, fast=not plain, law=law)
        for m in horizon
        for n in points
    ]
    click.echo(report(cases, device, seconds))


@main.command(cls=SceneCommand)
@click.argument("scene", type=SceneName())
@click.argument("data", nargs=-1, required=True, metavar="DATA.csv...", type=click.Path(path_type=Path))
@click.option("--vary", required=True, metavar="NAME,...", help="Arguments of the scene to fit.")
@click.option(
    "--measure", help="Measure of the scene to compare with the data; by default the one named like the column."
)
@click.option("--bounds", multiple=True, metavar="NAME=LOW:HIGH", help="Bounds of a fitted constant; may be repeated.")
@click.option("--loss", default="linear", help="linear, or soft_l1 for data with outliers.")
@click.option("--points", type=int, help="Points along x.")
@click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME=VALUE",
    help="As for `run`, or an initial value.",
    shell_complete=complete_setting,
)
@DEVICE
@PRECISION
@click.option("--out", help="Folder for the results; by default runs/SCENE-fit, or runs/SCENE-fit-2, ...")
def fit(
    scene: str, data: tuple[Path, ...], vary: str, measure: str | None, bounds: tuple[str, ...], loss: str,
    points: int | None, assignments: tuple[str, ...], device: str | None, precision: int | None, out: str | None,
) -> None:  # fmt: skip
    """Fit constants of SCENE to one or more tests, CSV files with units in the header.

    A curve has a column for the controlled quantity ("time [s]", "load_factor [1]", or an argument of the scene such as
    "pressure [kPa]") and one for the measured quantity. Columns x, y, u, v (w) are measured displacements at positions.
    A column uniaxial, equibiaxial or planar is the stretch of a uniform test, which needs no simulation; beside it are
    its stress and, if wanted, its rate [1/s].
    """
    from .fitting.command import fit_scene

    given = _settings(assignments, {"points": points})
    for line in fit_scene(
        scene, data, given, vary=vary, measure=measure, bounds=bounds, loss=loss, device=device, precision=precision,
        out=out,
    ):  # fmt: skip
        click.echo(line)


if __name__ == "__main__":
    main()
