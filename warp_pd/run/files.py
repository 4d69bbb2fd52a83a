"""The files of a run that grow with its frames: frames, history, restart files; of a large sheet in parallel.

A sheet that several processes share goes through the first of them, frame by frame, up to `GATHERED` points. Of a
larger one every process writes its own points (output/partitions.py, restart_parts.py).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..device.checks import InputError
from ..interfaces import History, Writer
from ..interfaces.frame import Frame
from ..output.background import Background
from ..output.formats import file_writers
from ..output.series import FOLDER, Segment, file_of
from . import restart
from .built import Built
from .contents import Files
from .folder import FINE, read_history, require_room, write_history
from .frame_points import AllPoints, OwnPoints, Pictured
from .recorder import Recorder
from .restart_parts import remove_others
from .stride import CoarserPoints

FRAMES = "frames.vtkhdf"
# Points of a sheet on several processes up to which its frames go through the first process.
GATHERED = 2**24
# Bytes that a frame takes per point, in both formats, those of a triangle, and those of history and summary.
BYTES_OF_POINT, BYTES_OF_FACE, SMALL_FILES = 400, 32, 1_000_000


def is_large(built: Built) -> bool:
    """Whether every process writes what it has of the sheet: many points, which follow each other in it."""
    share = built.context.share
    return share is not None and share.owners is None and built.context.whole.size > GATHERED


def is_divided(built: Built, begun: list[Segment] | None) -> bool:
    """Whether every process writes frames of its own points: as the run began, or by their number."""
    return is_large(built) if begun is None else bool(begun)


def pictured(built: Built, begun: list[Segment] | None, stride: int) -> Pictured:
    """The points that frames hold; all processes call it.

    Args:
        built: The simulation.
        begun: See `begun_segments`.
        stride: Of the columns and rows that frames hold.
    """
    if stride > 1:
        return CoarserPoints(built, stride)
    if not is_divided(built, begun):
        return AllPoints(built)
    # Own triangles must follow each other in the sheet, too.
    share = built.context.share
    faces = None if share is None else share.faces
    gaps = faces is not None and len(faces) > 0 and faces[-1] + 1 - faces[0] != len(faces)
    return AllPoints(built) if built.context.crew.any(gaps) else OwnPoints(built)


def begun_segments(folder: Path | None, resumed: bool) -> list[Segment] | None:
    """Files of the processes that wrote the frames of a run that goes on, none if one wrote all.

    None for a new run, or one without frames.
    """
    from ..output.partitions import segments_of

    path = None if folder is None else folder / FRAMES
    return (segments_of(path) or []) if resumed and path is not None and path.is_file() else None


def add_files(
    recorder: Recorder, folder: Path | None, known: restart.Identity | None, chosen: Files,
    held: frozenset[str] | None, append_from: int | None, begun: list[Segment] | None,
) -> None:  # fmt: skip
    """Let the recorder write frames, history and restart files; all processes call it.

    Args:
        recorder: Of the run.
        folder: Of its files; None writes none.
        known: What its restart files belong to.
        chosen: Which files are wanted.
        held: Names of the fields that frames.vtkhdf holds; None for all.
        append_from: Number of the first frame that a run which goes on writes; None for a new one.
        begun: Files of the processes that wrote its earlier frames.

    Raises:
        InputError: for writers of frames that no process holds whole.
    """
    crew, shown = recorder.built.context.crew, recorder.pictured
    if shown.divided and crew.any(bool(recorder.writers)):
        raise InputError(f"writers: expected none for more than {GATHERED} points on several processes, or a stride")
    if not shown.divided:
        crew.lead(lambda: _add_gathered(recorder, folder, known, chosen, held, append_from))
    folder = crew.spread(None if folder is None else folder.resolve())
    if folder is None or not (shown.divided or (chosen.restarts and is_large(recorder.built))):
        return
    there, series = folder, None
    crew.together(lambda: (there / FOLDER).mkdir(exist_ok=True) if crew.leads else None)
    if shown.divided:
        if chosen.vtkhdf:
            series = _series(recorder, there, held, append_from, begun)
        crew.together(lambda: _add_history(recorder, there, append_from) if crew.leads else None)
    recorder.saved = None
    room = _room_divided(recorder.built, held, shown.divided, chosen.restarts)
    recorder.joint = DividedFiles(recorder, there, known, series, chosen.restarts, room)


def _add_gathered(
    recorder: Recorder, folder: Path | None, known: restart.Identity | None, chosen: Files,
    held: frozenset[str] | None, append_from: int | None,
) -> None:  # fmt: skip
    """Frames of all points and restart files, in a thread beside the computation."""
    if folder is None or known is None:
        return
    scene = recorder.built.simulation
    equal = scene.solver.duration / scene.solver.frame_count if scene.solver.equal_frames else None
    room = partial(_require_room, folder, _room_of_a_frame(recorder, chosen.restarts))
    room()
    _require_same_stride(recorder.pictured, folder / FRAMES, append_from)
    writers = file_writers(
        folder, recorder.pictured.surface, usd=chosen.usd, seconds_per_frame=equal, append_from=append_from,
        vtkhdf=chosen.vtkhdf, fields=held,
    )  # fmt: skip
    files = Background(writers, room)
    others = list(recorder.writers)
    recorder.writers.append(files)
    _add_history(recorder, folder, append_from)

    def save() -> None:
        for writer in others:
            writer.save()
        files.save_then(partial(restart.save, folder / restart.NAME, restart.collect(recorder, known)))

    recorder.saved = save if chosen.restarts else None


def _require_same_stride(shown: Pictured, path: Path, append_from: int | None) -> None:
    """Refuse to go on with frames of other points."""
    from ..output.vtkhdf import read_series

    if append_from is not None and path.is_file():
        held, given = read_series(path).metadata.get("stride", 1), shown.surface.metadata.get("stride", 1)
        if held != given:
            raise InputError(f"stride = {given}: expected {held}, as the run in {str(path.parent)!r} began")


def _add_history(recorder: Recorder, folder: Path, append_from: int | None) -> None:
    """The history after every frame."""
    fine = recorder.fine
    if fine is not None and append_from is not None and (folder / FINE).is_file():
        fine.resume(read_history(folder / FINE), recorder.time)

    def keep(history: History) -> None:
        write_history(folder / "history.csv", history)
        if fine is not None:
            write_history(folder / FINE, fine.rows)

    recorder.kept = keep


class DividedFiles:
    """Frames and restart files of which every process writes what it owns; see `recorder.Joint`."""

    def __init__(
        self,
        recorder: Recorder,
        folder: Path,
        known: restart.Identity | None,
        series: Writer | None,
        restarts: bool,
        room: int,
    ) -> None:
        self._recorder, self._folder, self._known, self._series = recorder, folder, known, series
        self._restarts, self._room = restarts, room

    def write(self, frame: Frame | None) -> None:
        """Write a frame of the own points, where processes have one."""
        crew = self._recorder.built.context.crew
        crew.together(lambda: require_room(self._folder, self._room) if crew.leads else None)
        if self._series is not None and frame is not None:
            self._series.write(frame)

    def save(self) -> None:
        """Save the state for a restart."""
        if not self._restarts:
            return
        known = self._recorder.built.context.crew.spread(self._known)
        assert known is not None
        restart.save_divided(self._folder, self._recorder, known)

    def close(self) -> None:
        """The run is over."""
        if self._series is not None:
            self._series.close()


def _series(
    recorder: Recorder, folder: Path, held: frozenset[str] | None, append_from: int | None,
    begun: list[Segment] | None,
) -> Writer:  # fmt: skip
    """Frames of the own points; all processes call it."""
    from ..output.partitions import JoinedSeries, join
    from ..output.vtkhdf import VtkHdfSeries

    crew, shown = recorder.built.context.crew, recorder.pictured
    first, path = append_from or 0, folder / FRAMES
    kept = [segment for segment in begun or () if segment.first < first]
    own = crew.gather(shown.own)
    segment = Segment(first, tuple(file_of(first, rank) for rank in range(crew.size)), tuple(own))

    def begin() -> None:
        if first:
            if not kept:
                raise InputError(f"resume from {str(folder)!r}: expected a folder that still has its {path.name}")
            # Frames after the restart file are written anew.
            join(path, kept, first)
        remove_others(folder, "frames", [name for s in kept for name in s.files])

    crew.together(lambda: begin() if crew.leads else None)
    made = crew.together(lambda: VtkHdfSeries(folder / segment.files[crew.rank], shown.surface, fields=held))
    return JoinedSeries(path, made, [*kept, segment], crew.leads, crew.together)


def _room_of_a_frame(recorder: Recorder, restarts: bool) -> int:
    """Room for two frames of the points that they hold, restart files and the small files [bytes]."""
    surface = recorder.pictured.surface
    frame = BYTES_OF_POINT * len(surface.points) + 12 * len(surface.faces)
    return int(2 * frame + (2 * _restart_bytes(recorder.built) if restarts else 0) + SMALL_FILES)


def _restart_bytes(built: Built) -> int:
    """Size of a restart file [bytes], of all processes together."""
    kept = built.context.fields.kept().values()
    return int(sum(array.capacity for array in kept)) * built.context.crew.size


def _room_divided(built: Built, held: frozenset[str] | None, frames: bool, restarts: bool) -> int:
    """Room for a frame, if there are any of all points, and a restart file beside the last one [bytes]."""
    saved = (_restart_bytes(built) if restarts else 0) + SMALL_FILES
    if not frames:
        return saved
    whole, shown = built.context.whole, built.context.fields.shown()
    # Positions and the displacement; damage is a number.
    named = [s for s in shown if s.field.output != "displacement" and (held is None or s.field.output in held)]
    point = 24 + 4 + sum(12 if getattr(s.array.dtype, "_shape_", ()) else 4 for s in named)
    faces = BYTES_OF_FACE * len(whole.stored("triangles"))
    return int(point * whole.size + faces + saved)


def _require_room(folder: Path, needed: int) -> None:
    """Check that the disk has room [bytes], and for a copy of the animation as it is now.

    Raises:
        OutputError: otherwise.
    """
    copied = sum(path.stat().st_size for path in folder.glob(".animation.*.usdc"))
    require_room(folder, needed + copied)


def notes_of_divided(recorder: Recorder, chosen: Files) -> list[str]:
    """What a run does not write of a sheet whose frames every process has a part of."""
    if not recorder.pictured.divided:
        return []
    left = [name for name, wanted in (("animation.usd", chosen.usd), ("pictures", bool(chosen.pictures))) if wanted]
    what = f"{' and '.join(left)}: not written for more than {GATHERED} points on several processes"
    return [what] if left else []
