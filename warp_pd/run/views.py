"""What a run needs of a viewer."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from ..geometry.sheet import Sheet
    from ..interfaces import History
    from .files import Files
    from .result import Result


class Viewer(Protocol):
    """Draws and shows runs, their histories and sheets."""

    def after_run(
        self, result: Result, folder: Path, files: Files, others: Sequence[str], derived: Callable[[], None]
    ) -> None:
        """Write the summary, pictures and page of a run.

        Args:
            result: The result.
            folder: Its folder.
            files: Which files it has.
            others: Names of pictures in the folder that are not of this run.
            derived: Writes the files that are made from its frames; to be called once.
        """
        ...

    def plot_history(
        self,
        history: History,
        names: Sequence[str],
        units: Mapping[str, str],
        *,
        against: str,
        path: Any,
        title: str,
        load_duration: float | None,
    ) -> Any:
        """Plot columns of a history with their units; arguments as for `Result.plot`."""
        ...

    def page(self, folder: Path) -> str:
        """The page of the run in a folder, as HTML."""
        ...

    def draw_sheet(
        self, sheet: Sheet, path: str | os.PathLike[str] | None, title: str, regions: Sequence[tuple[Any, Any]]
    ) -> Any:
        """Draw an undeformed sheet and the regions of its materials; see `warp_pd.draw_sheet`."""
        ...


# What draws and shows runs; the last one is used. A viewer adds itself when it is imported, which the package does.
VIEWERS: list[Viewer] = []


def viewer() -> Viewer:
    """The viewer of this package, or the one that was added last."""
    return VIEWERS[-1]
