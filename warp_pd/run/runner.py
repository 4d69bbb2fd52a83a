"""Run a scene: frames, files, restart, summary."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from ..device.checks import InputError, count
from ..interfaces import DivergedError, History, Writer
from ..interfaces.frame import Frame, format_time
from ..interfaces.solver import DIVERGED, ENDED, FINISHED, NOT_CONVERGED, STOPPED
from ..laws.point_fields import GROUPS
from ..output.background import Background, as_output_error, require_room
from . import VIEWERS, restart
from .built import Built, communicator_here, compose, partition_of
from .checks import foreseen, free_motions, step_note, steps_text
from .folder import (
    ANIMATION,
    BODIES,
    FINE,
    FRAMES,
    MADE_AT_END,
    RESTART,
    clear,
    clear_unfinished,
    picture_formats,
    pictures_in,
    read_history,
    remove_if_empty,
    require_free,
    results_in,
    save_summary,
    sole_use,
    writable_folder,
    write_history,
)
from .recorder import FramePoints, Recorder
from .result import Result, Seconds, summary_of
from .scene import Scene, check_writers
from .stopping import stopping_at_frames

if TYPE_CHECKING:
    from ..output.progress import Progress
    from ..output.vtkhdf import VtkHdfSeries

# Points of a sheet, or of its frames, that the first process can hold: 200 bytes each.
MOST_POINTS = 2**27
# Bytes that a frame takes per point, in both formats, and those of history and summary.
BYTES_OF_POINT, SMALL_FILES = 400, 1_000_000
# Bytes of the history in a restart file, at most.
HISTORY_BYTES = 500_000_000


@dataclass(frozen=True)
class Files:
    """The files that a run writes besides history and summary.

    Attributes:
        usd: Whether to write animation.usd, from frames.vtkhdf.
        vtkhdf: Whether to write frames.vtkhdf, and bodies.vtkhdf if there are bodies.
        pictures: Formats of the pictures; empty for none.
        view: Whether to write view.html.
        restarts: Whether to write restart files.
        fine: Whether to write fine_history.csv.
    """

    usd: bool = True
    vtkhdf: bool = True
    pictures: tuple[str, ...] = ()
    view: bool = True
    restarts: bool = True
    fine: bool = False

    def require_same(self, folder: Path) -> None:
        """Check that a resumed run writes the same files as before; otherwise they would be silently incomplete."""
        # The writer of the frames reports missing ones.
        if (folder / FRAMES).is_file() and not self.vtkhdf:
            raise InputError(
                f"resume in {str(folder)!r}: it holds {FRAMES}; expected vtkhdf = True, without --no-vtkhdf, as at the "
                "start"
            )
        if (folder / FINE).is_file() and not self.fine:
            raise InputError(
                f"resume in {str(folder)!r}: it holds {FINE}; expected history_every (--history-every), as at the "
                "start, or that file removed"
            )


def stored_fields(built: Built) -> frozenset[str] | None:
    """Names of the point fields stored in files besides the displacement; None for all fields of a frame."""
    scene = built.simulation
    there = [stored.field.output for stored in built.context.fields.shown()]
    if built.rupture is not None:
        there.append("damage")
    asked = [*scene.fields, *(scene.chosen_fields or ())]
    for name in asked:
        if name not in there and name not in GROUPS:
            known = ", ".join(sorted({*there, *built.law.field_names()}))
            raise InputError(f"fields = {name!r}: the frames of this scene have no such field; expected one of {known}")
    return None if scene.chosen_fields is None else frozenset(arrays_of(asked))


def arrays_of(names: Sequence[str]) -> list[str]:
    """Names of the arrays of the given fields: "stretch" gives "stretch_1" and "stretch_2"."""
    return [array for name in names for array in GROUPS.get(name, (name,))]


def require_gatherable(points: FramePoints, restarts: bool, most: int = MOST_POINTS) -> None:
    """Check that frames, restart files and measures need no more points than the first process can gather."""
    built = points.built
    size = built.context.whole.size
    for what, number, instead in (
        ("frames", points.size, "choose a larger stride (--stride)"),
        ("restart files", size if restarts else 0, "write none (--no-restart)"),
        ("measures", size if built.simulation.measures else 0, "leave them out"),
    ):
        if number > most:
            raise InputError(f"{what} of {number} points: expected at most {most} in one process; {instead}")


def add_files(
    recorder: Recorder, folder: Path | None, known: restart.Identity | None, chosen: Files,
    fields: frozenset[str] | None, append_from: int | None,
) -> None:  # fmt: skip
    """Make the recorder of the first process write frames, history and restart files, in a separate thread.

    Without a folder nothing is written. `fields` are those of frames.vtkhdf, None for all; `append_from` is the first
    frame that a resumed run writes.
    """
    if folder is None or known is None:
        return
    require_room(folder, _room_of_a_frame(recorder, chosen.restarts))
    if append_from is not None and (folder / FRAMES).is_file():
        _require_same_stride(recorder.points, folder / FRAMES)
    surface = recorder.points.surface
    series: list[VtkHdfSeries] = []
    if chosen.vtkhdf:
        from ..output.vtkhdf import BodySeries, VtkHdfSeries

        for name in (FRAMES, BODIES) if surface.bodies else (FRAMES,):
            if append_from is not None and not (folder / name).is_file():
                raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {name}")
        series = [VtkHdfSeries(folder / FRAMES, surface, append_from=append_from, fields=fields)]
        if surface.bodies:
            series.append(BodySeries(folder / BODIES, surface, append_from=append_from))

    def write(frame: Frame) -> None:
        for file in series:
            file.write(frame)

    files = Background(write)
    others = list(recorder.writers)
    recorder.writers.append(files)
    _add_history(recorder, folder, append_from)

    def save() -> None:
        for writer in others:
            writer.save()
        files.then(partial(restart.save, folder / RESTART, restart.collect(recorder, known)))

    recorder.saved = save if chosen.restarts else None


def _require_same_stride(points: FramePoints, path: Path) -> None:
    """Check that a resumed run stores the same points in its frames."""
    from ..output.vtkhdf import read_series

    begun, given = read_series(path).metadata.get("stride", 1), points.surface.metadata.get("stride", 1)
    if begun != given:
        raise InputError(
            f"stride = {given}: expected {begun}, the stride with which the run in {str(path.parent)!r} began"
        )


def _add_history(recorder: Recorder, folder: Path, append_from: int | None) -> None:
    """Write the history after every frame."""
    fine = recorder.fine
    if fine is not None and append_from is not None and (folder / FINE).is_file():
        fine.resume(read_history(folder / FINE), recorder.time)

    def keep(history: History) -> None:
        write_history(folder / "history.csv", history)
        if fine is not None:
            write_history(folder / FINE, fine.rows)

    recorder.kept = keep


def _room_of_a_frame(recorder: Recorder, restarts: bool) -> int:
    """Disk space for two frames, restart files and the small files [bytes]."""
    surface = recorder.points.surface
    frame = BYTES_OF_POINT * len(surface.points) + 12 * len(surface.faces)
    return int(2 * frame + (2 * restart_bytes(recorder.built) if restarts else 0) + SMALL_FILES)


def restart_bytes(built: Built) -> int:
    """Size of the arrays of a restart file, at most [bytes]."""
    context = built.context
    return int(sum(array.capacity for array in context.fields.in_restart().values()) * context.communicator.size)


# For those who use the library: its notes are warnings. Without a handler of theirs nothing is printed.
LOG = logging.getLogger("warp_pd")
LOG.addHandler(logging.NullHandler())

# Advice if the search stopped between no load and the full load.
LIMIT_POINT = (
    "if the load has its maximum there (a limit point), no equilibrium exists beyond it: follow the path with the "
    "solver ArcLength, prescribe the displacement (Motion) or the volume (EnclosedVolume) instead of the load, or "
    "follow the jump with Explicit and damping; "
    "otherwise try more load_steps"
)
# The same if supports alone move the sheet, and if the first load step fails.
MOVED = (
    "supports alone move the sheet, which may buckle, fold or tear there: try more load_steps, or follow it with "
    "Explicit and damping"
)
AT_ONCE = "the first load step fails: try a smaller load or motion, or more load_steps"

STOPPED_MESSAGE = "interrupted: continue with --resume"


def run(
    scene: Scene,
    *,
    out: str | Path | None = None,
    device: str | None = None,
    precision: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    usd: bool | None = None,
    reporter: Progress | None = None,
    writers: list[Writer] | None = None,
    pictures: bool | str = False,
    vtkhdf: bool = True,
    fields: Sequence[str] | None = None,
    view: bool = False,
    history_every: float | None = None,
    stride: int = 1,
    restarts: bool = True,
) -> Result:
    """Run a scene.

    Pictures and page are made if asked for, as `warp-pd run` does.

    Args:
        scene: What to run.
        out: Folder for frames.vtkhdf, animation.usd, history.csv, restart.npz and summary.json; None writes nothing.
        device: "cpu", "cuda:0", ...; by default CUDA if available.
        precision: 32 or 64; by default the solver's.
        resume: Continue from the restart file in `out`.
        overwrite: Replace the results of another run in `out`; otherwise such a folder raises InputError.
        usd: Whether to write animation.usd at the end, from frames.vtkhdf; by default where there are such frames.
        reporter: Shows the progress.
        writers: Additional writers of frames.
        pictures: Whether to draw pictures (True: "png"), or their format: "pdf", "svg", or several such as "png,pdf".
        vtkhdf: Whether to write frames.vtkhdf, which animation, pictures and view.html need.
        fields: Names of the point fields stored in frames.vtkhdf besides the displacement and the scene's `fields`,
            such as ("damage", "stretch"); by default velocity, damage and strain energy density.
        view: Whether to write view.html, a page for a browser; for large sheets a note tells how to write it later.
        history_every: Time between rows of the finer history [s], overriding the solver's; see `Explicit`.
        stride: Frames store only every `stride`-th column and row of a lattice and the last ones, for sheets too large
            to draw. Restart files and measures use all points.
        restarts: Whether to write restart files, which `resume` needs.

    Raises:
        InputError: for input that cannot be run, before anything is written.
        DivergedError: if the first frame is already NaN or infinite; nothing is written.

    Returns:
        The result; its `status` tells whether the run finished, diverged, did not converge or was interrupted.
    """
    check_writers(writers or [])
    count("stride", stride, 1)
    communicator, device = communicator_here(device)
    if fields is not None:
        scene = replace(scene, chosen_fields=fields)
    if history_every is not None:
        scene = with_fine_history(scene, history_every)
    formats = picture_formats(pictures)
    for name, asked in (("usd", usd), ("pictures", formats), ("view", view)):
        if asked and (out is None or not vtkhdf):
            raise InputError(f"{name}: made from frames.vtkhdf; expected a folder (out=), and vtkhdf = True")
    usd = usd if usd is not None else out is not None and vtkhdf
    files = Files(usd, vtkhdf, formats, view, restarts, scene.has_fine_history)
    # Files and progress are those of the first process.
    new = communicator.is_root and isinstance(out, str | Path) and not Path(out).exists()
    folder = communicator.barrier(lambda: writable_folder(out, resume, overwrite) if communicator.is_root else None)
    given, shown = (list(writers or []), reporter) if communicator.is_root else ([], None)
    with contextlib.ExitStack() as stack:
        if new and folder is not None:
            stack.callback(remove_if_empty, folder)
        communicator.barrier(lambda: stack.enter_context(sole_use(folder)))
        if not resume:
            communicator.barrier(lambda: None if folder is None else require_free(folder, overwrite))
        begin = perf_counter()
        if communicator.size > 1:
            communicator.set_partition(communicator.barrier(lambda: partition_of(scene, communicator)))
        built = communicator.barrier(lambda: compose(scene, device, precision, communicator, runs=True))
        return _run(built, folder, begin, resume, files, shown, given, stride)


def with_fine_history(scene: Scene, every: float) -> Scene:
    """Copy a scene with a solver that also records a history row every `every` seconds, between frames."""
    solver: Any = scene.solver
    if not hasattr(solver, "history_every"):
        raise InputError(f"history_every = {every!r}: expected the solver Explicit, got {type(solver).__name__}")
    return replace(scene, solver=replace(solver, history_every=every))


def _run(
    built: Built, folder: Path | None, begin: float, resume: bool, files: Files, reporter: Progress | None,
    writers: list[Writer], stride: int,
) -> Result:  # fmt: skip
    """Run a built simulation in a locked folder; `begin` is the time at which building started."""
    scene, communicator = built.simulation, built.context.communicator
    fields, points = stored_fields(built), FramePoints(built, stride)
    communicator.barrier(lambda: require_gatherable(points, folder is not None and files.restarts))
    known = None if folder is None else restart.identity(scene, built)
    saved = communicator.broadcast(communicator.barrier(lambda: _saved(folder, known, resume, files, built)))
    LOG.info("%s", headline(built))
    if reporter is not None:
        reporter.begin(headline(built))
    compile_seconds = communicator.root_first(built.context.compile)
    if reporter is not None:
        reporter.compiled(compile_seconds)
    recorder = Recorder(built, writers, reporter)
    recorder.points = points
    if reporter is not None:
        reporter.shows(points.surface)
    foreseen_notes = communicator.broadcast(communicator.root(lambda: foreseen(built)))
    recorder.notes = foreseen_notes or []
    if folder is not None:
        recorder.others = [path.name for path in pictures_in(folder)]
    communicator.barrier(lambda: _begin(recorder, saved))
    append_from = None if saved is None else recorder.frame_index + 1
    communicator.root(lambda: add_files(recorder, folder, known, files, fields, append_from))
    setup_seconds = perf_counter() - begin - compile_seconds
    before = len(recorder.history)

    def result_of(status: str, message: str, last: Frame) -> Result:
        seconds = Seconds(setup_seconds, compile_seconds, perf_counter() - begin)
        result = Result(summary_of(recorder, status, message, seconds), recorder.history, built, last, folder)
        result.fine_history = [] if recorder.fine is None else recorder.fine.rows
        if known is not None:
            code = recorder.codes[-1][0]
            result.summary["identity"] = {
                "parts": known.parts, "sources": known.sources, "own": known.own, "code": code,
            }  # fmt: skip
        return result

    def last_words() -> None:
        if folder is not None and recorder.last is not None:
            write_summary(result_of(STOPPED, STOPPED_MESSAGE, recorder.last), folder)

    with stopping_at_frames(recorder, last_words):
        status, message = _march(recorder, saved is not None)
    if saved is not None and status == FINISHED and len(recorder.history) == before:
        message = "the run had already finished: nothing to do"
    last = communicator.broadcast(recorder.last)
    if last is None:
        raise DivergedError(message) if status == DIVERGED else KeyboardInterrupt

    def finish() -> tuple[dict[str, Any], History, History, Path | None]:
        result = result_of(status, message, last)
        if folder is not None:
            with as_output_error(folder):
                _finish(result, folder, files, recorder.others)
        return result.summary, result.history, result.fine_history, folder

    summary, history, fine, folder = communicator.broadcast(communicator.root(finish)) or ({}, [], [], None)
    for note in summary.get("notes", ()):
        LOG.warning("%s", note)
    LOG.info("%s: %s", status, message)
    result = Result(summary, history, built, last.in_double(), folder)
    result.fine_history = fine
    return result


def _saved(
    folder: Path | None, known: restart.Identity | None, resume: bool, files: Files, built: Built
) -> dict[str, Any] | None:
    """The contents of the restart file if the run is resumed, otherwise None.

    Removes files that could be mistaken for results of this run.
    """
    if folder is None or known is None:
        return None
    saved = restart.load(folder / RESTART, known, 2 * restart_bytes(built) + HISTORY_BYTES) if resume else None
    if saved is not None:
        files.require_same(folder)
        clear(folder, MADE_AT_END)
    elif results_in(folder):
        clear(folder)
    clear_unfinished(folder)
    return saved


def _begin(recorder: Recorder, saved: dict[str, Any] | None) -> None:
    """Set the state to the start of the run or to the restart."""
    built = recorder.built
    if saved is not None:
        restart.restore(saved, recorder)
    else:
        built.context.run("start")
        for part in built.parts:
            part.begin()
    built.context.run("setup")
    if saved is not None:
        restart.restore_forces(saved, built)


def _march(recorder: Recorder, resumed: bool) -> tuple[str, str]:
    """Run to the end and return the status and a message."""
    built, status, message = recorder.built, FINISHED, ""
    try:
        recorder.start_clock()
        if resumed:
            built.context.run("frame")
            frame = built.context.communicator.root(lambda: recorder.points.frame(recorder.frame_index, recorder.time))
            if frame is not None:
                recorder.accept(frame)
        else:
            recorder.frame(0, 0.0, 0, built.solver.first_step(recorder))
        if note := step_note(built, recorder.dt):
            recorder.notes.append(note)
        if not resumed:
            _say_what_comes(recorder)
        recorder.start_clock()
        status = built.solver.run(recorder)
        if status in (NOT_CONVERGED, ENDED):
            message = _not_converged(recorder)
        elif status == DIVERGED:
            when = format_time(recorder.time, built.simulation.load_duration)
            cause = recorder.soundness.cause(recorder.dt, recorder.time)
            message = f"diverged: the residual is {recorder.residual} beyond {when}; likely cause: {cause}"
    except DivergedError as error:
        status, message = DIVERGED, str(error)
    except KeyboardInterrupt:
        status, message = STOPPED, STOPPED_MESSAGE
    finally:
        recorder.finishing = True
        for writer in recorder.writers:
            writer.close()
        if recorder.reporter is not None:
            recorder.reporter.close()
    return status, message


def _say_what_comes(recorder: Recorder) -> None:
    """Report the first step, the number of steps and the notes that are known, before any other step."""
    built, dt = recorder.built, recorder.dt
    if recorder.reporter is None:
        return
    if built.simulation.solver.dynamic and dt > 0.0:
        recorder.reporter.say(steps_text(built, dt))
    recorder.reporter.note(*recorder.notes)


def _finish(result: Result, folder: Path, files: Files, others: Sequence[str]) -> None:
    """Write the summary, draw the pictures beside those of others, write the page and the animation.

    Of an interrupted run only the summary, so that it ends at once.
    """
    if result.status == STOPPED:
        write_summary(result, folder)
        return
    animation = _animation(result, folder) if files.usd else None
    if files.pictures or files.view:
        VIEWERS[-1].after_run(result, folder, files, others, animation)
        return
    result.summary["pictures"] = []
    write_summary(result, folder)
    if animation is not None:
        animation()


def _animation(result: Result, folder: Path) -> Callable[[], None]:
    """Writes the animation of the frames."""
    from ..output.usd import write_animation

    solver = result.built.simulation.solver
    equal = solver.duration / solver.frame_count if solver.equal_frames else None
    return partial(write_animation, folder / ANIMATION, folder / FRAMES, equal)


def write_summary(result: Result, folder: Path) -> None:
    """Write summary.json; that of an interrupted run says what is missing."""
    if result.status == STOPPED:
        file = result.summary["file"]
        draw_again = f"warp-pd draw {folder}" + (f" --scene {file}" if file else "")
        result.summary["pictures"] = []
        result.summary["notes"].append(
            f"files: pictures, page and animation of an interrupted run are not written; `{draw_again}` draws, "
            f"`warp-pd view {folder}` writes the page, and a run that --resume finishes writes all"
        )
    save_summary(folder, result.summary)


def headline(built: Built) -> str:
    """One line on the scene, its size and the device."""
    scene, processes = built.simulation, built.context.communicator.size
    return (
        f"{scene.scene}: {scene.sheet.size} points, {built.law.families.bond_count} bonds, horizon "
        f"{scene.force.horizon:g} spacings, {built.law.weights} weights, float{built.context.bits}, on "
        f"{built.context.device.name}" + (f", {processes} processes" if processes > 1 else "")
    )


def _not_converged(recorder: Recorder) -> str:
    assert recorder.solve is not None
    reached = recorder.solve["reached"]
    if recorder.solve.get("ended"):
        cause = recorder.solve["ended"]
        return f"the path ends at load factor {reached:.4g}: even the shortest step failed, as {cause}"
    text = (
        f"not converged: the residual is {recorder.residual:.3g} after {recorder.solve['iterations']} iterations; "
        f"the last good load step is at load factor {reached:.4g}"
    )
    if recorder.solve.get("lost"):
        text = f"{text}; {recorder.solve['lost']}"
    free = free_motions(recorder.built) if reached == 0.0 else 0
    if free:
        return (
            f"{text}; likely cause: the supports leave {free} of 6 rigid-body motions free; expected supports "
            "(Fixed, Motion) that prevent them"
        )
    if recorder.solve.get("lost") or reached >= 1.0:
        return text
    return f"{text}; {AT_ONCE if reached == 0.0 else LIMIT_POINT if recorder.built.context.options.loaded else MOVED}"
