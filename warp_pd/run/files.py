"""The files of a run: their formats and fields, and how they are written frame by frame, by the root process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..device.checks import InputError
from ..interfaces import History
from ..laws.point_fields import GROUPS
from ..output.background import Background, require_room
from ..output.file_writers import FRAMES, frame_writer
from . import restart
from .built import Built
from .folder import FINE, RESTART, read_history, write_history
from .frame_points import FramePoints
from .recorder import Recorder

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
    room = partial(require_room, folder, _room_of_a_frame(recorder, chosen.restarts))
    room()
    _require_same_stride(recorder.points, folder / FRAMES, append_from)
    surface = recorder.points.surface
    write = frame_writer(folder, surface, append_from, fields) if chosen.vtkhdf else lambda frame: None
    files = Background(write, room)
    others = list(recorder.writers)
    recorder.writers.append(files)
    _add_history(recorder, folder, append_from)

    def save() -> None:
        for writer in others:
            writer.save()
        files.then(partial(restart.save, folder / RESTART, restart.collect(recorder, known)))

    recorder.saved = save if chosen.restarts else None


def _require_same_stride(points: FramePoints, path: Path, append_from: int | None) -> None:
    """Check that a resumed run stores the same points in its frames."""
    from ..output.vtkhdf import read_series

    if append_from is not None and path.is_file():
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
    return int(sum(array.capacity for array in context.fields.kept().values()) * context.communicator.size)
