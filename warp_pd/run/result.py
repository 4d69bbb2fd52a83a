"""What a run leaves."""

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

if TYPE_CHECKING:
    from ..output.frames import Frames


@dataclass(repr=False)
class Result:
    """What a run leaves.

    Attributes:
        summary: Content of summary.json.
        history: One row per frame: time (load time of a static solver), energies, ball reaction, largest damage,
            measures.
        built: The simulation as it ended.
        frame: The last frame, of the points that frames hold (`run(stride=)`).
        folder: Where the files are, or None.
        fine_history: Rows between frames as well, of `Explicit(history_every=)`: time, energies, losses, contact
            forces and those of `Reaction`. Otherwise empty.
    """

    summary: dict[str, Any]
    history: History
    built: Built
    frame: Frame
    folder: Path | None = None
    fine_history: History = field(default_factory=list)

    def __repr__(self) -> str:
        """One line: all arrays of a simulation would fill a notebook."""
        numbers = ", ".join(f"{name} = {found['value']}" for name, found in self.summary["measures"].items())
        return f"Result({self.summary['scene']}: {self.status}, {len(self.history)} frames; {numbers or 'no measures'})"

    def _repr_html_(self) -> str:
        """How the run ended, and its measures beside their references, for a notebook."""
        return html_table(self.summary["scene"], result_rows(self.summary, self.folder))

    @property
    def status(self) -> str:
        """How the run ended: "finished", "diverged", "not converged" or "interrupted"."""
        return str(self.summary["status"])

    @property
    def frames(self) -> Frames:
        """The frames in the folder, each read when it is asked for.

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        from ..output.frames import Frames

        return Frames(self._folder("frames"))

    def table(self, fine: bool = False) -> Any:
        """The history as a `pandas.DataFrame`, one row per frame.

        Args:
            fine: Whether to take `fine_history`.

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self._rows(fine))

    def plot(
        self, *names: str, against: str = "time", path: str | os.PathLike[str] | None = None, fine: bool = False
    ) -> Any:
        """Draw columns of the history, a panel for each unit.

        Args:
            names: Columns, such as "load"; by default the measures.
            against: Column along the horizontal axis.
            path: Of the picture, .png, .pdf or .svg; None to write none.
            fine: Whether to take the columns of `fine_history`.

        Returns:
            The `matplotlib.figure.Figure`, which a notebook shows.

        Raises:
            InputError: for a column that the history does not have, or no column at all.
        """
        from ..output.curves import plot_history

        scene = self.built.simulation
        shown = names or tuple(measure.name for measure in scene.measures)
        if not shown:
            raise InputError(f"plot: the scene has no measures; expected columns of {', '.join(self.history[0])}")
        rows, units = self._rows(fine), units_of(self.built)
        return plot_history(rows, shown, units, against=against, path=path, title=scene.scene)

    def show(self, height: int = 700) -> Page:
        """The page of the run, which a notebook shows: the sheet in space, its fields, its curves.

        Args:
            height: Of the page in the notebook [pixels].

        Raises:
            InputError: for a run without `out`, or without frames.vtkhdf.
        """
        from .view import page

        return Page(page(self._folder("show")), count("height", height, 100))

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
    """Notes, reported numbers and files, one line each, for the command line."""
    notes: list[str] = result.summary["notes"]
    yield from notes
    for name, m in result.summary["measures"].items():
        if m["value"] is None:
            wrong = any(note.startswith((f"Measure {name!r}: missing", f"Outcome {name!r}: ")) for note in notes)
            yield f"{name} = none: {'see above' if wrong else 'it did not happen'}"
            continue
        line = f"{name} = {m['value']:.6g}" + ("" if m["unit"] == "1" else f" {m['unit']}")
        if m["reference"] is not None:
            unit = "" if m["unit"] == "1" else f" {m['unit']}"
            line += f"   reference {m['reference']:.6g}{unit} ({m['source']}), error {100 * m['error']:+.3f} %"
        yield line
    if result.folder is None:
        return
    yield f"results in {result.folder}"
    for path in sorted(result.folder.iterdir()):
        yield f"  {path.name}"
