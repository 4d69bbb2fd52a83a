"""Curves of the history of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..device.checks import one_of
from ..geometry.picture_files import new_figure, save
from ..geometry.shape_plot import target

# Rows below which every one has a marker.
FEW = 40


def plot_history(
    history: Sequence[Mapping[str, float]],
    names: Sequence[str],
    units: Mapping[str, str],
    *,
    against: str,
    path: Any = None,
    title: str = "",
) -> Any:
    """Columns of the history in one picture, a panel for each unit.

    Args:
        history: One row per frame.
        names: Columns to draw.
        units: Unit of each column, as far as it is known.
        against: Column along the horizontal axis.
        path: Of the picture, .png, .pdf or .svg; None to write none.
        title: First line.

    Returns:
        The `matplotlib.figure.Figure`.

    Raises:
        InputError: for a column that the history does not have.
    """
    columns = [column for column in history[0] if column != against]
    for name in names:
        one_of("column", name, columns)
    one_of("against", against, history[0])
    written = None if path is None else target(path)
    panels = list(dict.fromkeys(units.get(name, "") for name in names))
    figure = new_figure(6.0, 1.2 + 2.6 * len(panels))
    across = [row[against] for row in history]
    for k, unit in enumerate(panels):
        axes = figure.add_subplot(len(panels), 1, k + 1)
        shown = [name for name in names if units.get(name, "") == unit]
        marker = "." if len(history) < FEW else ""
        for name in shown:
            axes.plot(across, [row[name] for row in history], label=_words(name), marker=marker)
        axes.set(xlabel=_label(against, units), ylabel=_label(shown[0], units) if len(shown) == 1 else f"[{unit}]")
        axes.grid(alpha=0.3)
        if len(shown) > 1:
            axes.legend(fontsize=8)
    if title:
        figure.suptitle(title, fontsize=10)
    if written is not None:
        save(figure, written)
    return figure


def _words(name: str) -> str:
    return name.replace("_", " ")


def _label(name: str, units: Mapping[str, str]) -> str:
    unit = units.get(name, "")
    return _words(name) + (f" [{unit}]" if unit and unit != "1" else "")
