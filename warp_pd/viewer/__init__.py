"""What is looked at: the page of a run, pictures, plots."""

from __future__ import annotations

from typing import Any

from ..run import VIEWERS


class PagesAndPictures:
    """What runs, results and sheets ask of the viewer."""

    def after_run(self, *arguments: Any) -> None:
        """Write the summary, pictures and page of a run."""
        from .after_run import show

        show(*arguments)

    def plot_history(self, *arguments: Any, **options: Any) -> Any:
        """Plot columns of a history."""
        from .curves import plot_history

        return plot_history(*arguments, **options)

    def page(self, folder: Any) -> str:
        """The page of the run in a folder."""
        from .view import page

        return page(folder)

    def draw_sheet(self, sheet: Any, path: Any, title: str, regions: Any) -> Any:
        """Draw an undeformed sheet."""
        from .shape_plot import draw_sheet

        return draw_sheet(sheet, path, title=title, regions=regions)


VIEWERS.append(PagesAndPictures())
