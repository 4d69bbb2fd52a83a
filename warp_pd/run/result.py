"""The result of a run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..device.checks import InputError, count
from ..interfaces import History
from ..interfaces.frame import Frame
from ..output.notebook import Page, data_frame, html_table
from .built import Built
from .description import result_rows, units_of
from .summary import WHOLE_RUN
from .views import viewer

if TYPE_CHECKING:
    from ..output.frames import Frames


@dataclass(repr=False)
class Result:
    """The result of a run.

    Attributes:
        summary: Content of summary.json.
        history: One row per frame: time (load time of a static solver), energies, ball reaction, largest damage,
            measures.
        built: The simulation in its final state.
        frame: The last frame, with the points selected by `run(stride=)`.
        folder: Folder of the files, or None.
        fine_history: With `Explicit(history_every=)`, rows at and between frames: time, energies, losses, contact
            forces and forces of `Reaction`. Otherwise empty.
    """

    summary: dict[str, Any]
    history: History
    built: Built
    frame: Frame
    folder: Path | None = None
    fine_history: History = field(default_factory=list)

    def __repr__(self) -> str:
        """One line instead of the default text with all arrays."""
        numbers = ", ".join(f"{name} = {found['value']}" for name, found in self.summary["measures"].items())
        return f"Result({self.summary['scene']}: {self.status}, {len(self.history)} frames; {numbers or 'no measures'})"

    def _repr_html_(self) -> str:
        """HTML for a notebook: how the run ended, and its measures with their references."""
        return html_table(self.summary["scene"], result_rows(self.summary, self.folder))

    @property
    def status(self) -> str:
        """How the run ended: "finished", "diverged", "not converged", "ended early" (a path) or "interrupted"."""
        return str(self.summary["status"])

    @property
    def frames(self) -> Frames:
        """The frames in the folder, each read on access.

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        from ..output.frames import Frames

        return Frames(self._folder("frames"))

    def table(self, fine: bool = False) -> Any:
        """The history as a `pandas.DataFrame`, one row per frame.

        Args:
            fine: Whether to use `fine_history`.

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self._rows(fine))

    def plot(
        self, *names: str, against: str = "time", path: str | os.PathLike[str] | None = None, fine: bool = False
    ) -> Any:
        """Plot columns of the history, one panel per unit.

        Args:
            names: Columns, such as "load"; by default the measures.
            against: Column along the horizontal axis.
            path: File of the picture (.png, .pdf or .svg); None writes no file.
            fine: Whether to use `fine_history`.

        Returns:
            The `matplotlib.figure.Figure`; a notebook displays it.

        Raises:
            InputError: if the history lacks a column, or there is no column to plot.
        """
        scene = self.built.simulation
        shown = names or tuple(measure.name for measure in scene.measures)
        if not shown:
            raise InputError(f"plot: the scene has no measures; expected columns of {', '.join(self.history[0])}")
        rows, units = self._rows(fine), units_of(self.built)
        return viewer().plot_history(
            rows, shown, units, against=against, path=path, title=scene.scene, load_duration=scene.load_duration
        )

    def show(self, height: int = 700) -> Page:
        """The interactive page of the run for a notebook: the sheet in 3D, its fields and curves.

        Args:
            height: Height of the page [pixels].

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        return Page(viewer().page(self._folder("show")), count("height", height, 100))

    def _rows(self, fine: bool) -> History:
        if not fine:
            return self.history
        if not self.fine_history:
            raise InputError("fine = True: expected a run with Explicit(history_every=...)")
        return self.fine_history

    def _folder(self, what: str) -> Path:
        if self.folder is None:
            raise InputError(f"{what}: expected a run with a folder, such as run(out='runs/mine')")
        return self.folder


def report(result: Result) -> Iterator[str]:
    """Notes, reported numbers and files of a run for the command line, one line each."""
    notes: list[str] = result.summary["notes"]
    yield from notes
    for name, m in result.summary["measures"].items():
        if m["value"] is None:
            wrong = any(note.startswith((f"Measure {name!r}: missing", f"Outcome {name!r}: ")) for note in notes)
            missing = "the event did not occur" if m["of"] == WHOLE_RUN else "no number in the last frame"
            yield f"{name} = none: {'see above' if wrong else missing}"
            continue
        unit = "" if m["unit"] == "1" else f" {m['unit']}"
        line = f"{name} = {m['value']:.6g}{unit}"
        if m["reference"] is not None:
            source = f" ({m['source']})" if m["source"] else ""
            # Of zero there is no relative error.
            error = f"{100 * m['error']:+.3f} %" if m["error"] is not None else f"{m['value']:+.3g}{unit}"
            line += f"   reference {m['reference']:.6g}{unit}{source}, error {error}"
        yield line
    if result.folder is None:
        return
    yield f"results in {result.folder}"
    for path in sorted(result.folder.iterdir()):
        yield f"  {path.name}"
