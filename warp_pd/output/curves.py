"""Plots of the history of a run and of the measures of a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..device.checks import one_of
from ..geometry.picture_files import new_figure, new_panels, save, target
from .plots import STYLES
from .quantities import column_label

# Rows below which every one has a marker.
FEW = 40
# Columns of panels of the picture.
COLUMNS = 3


def plot_history(
    history: Sequence[Mapping[str, float]],
    names: Sequence[str],
    units: Mapping[str, str],
    *,
    against: str,
    path: Any = None,
    title: str = "",
) -> Any:
    """Plot columns of the history, one panel per unit; arguments as for `Result.plot`, `units` by column."""
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


def draw_sweep(path: Path, runs: Sequence[tuple[Mapping[str, str], Mapping[str, Any]]]) -> bool:
    """Draw one panel per measure, with one curve for each combination of the other arguments; whether there was any.

    `runs` are values of the arguments and measures of the summary, for each run with measures.
    """
    names = list(dict.fromkeys(n for _, found in runs for n, m in found.items() if m["value"] is not None))
    if not names:
        return False
    figure, panels = new_panels(len(names), min(len(names), COLUMNS), (4.6, 3.3), (0.0, 0.4))
    varied = [key for key in runs[0][0] if len({values[key] for values, _ in runs}) > 1]
    first, *others = varied or list(runs[0][0])[:1]
    for axes, name in zip(panels, names, strict=True):
        curves: dict[str, list[tuple[Any, float]]] = {}
        for values, found in runs:
            if found.get(name, {}).get("value") is not None:
                label = ", ".join(f"{key}={values[key]}" for key in others)
                curves.setdefault(label, []).append((_across(values[first]), found[name]["value"]))
        for k, (label, points) in enumerate(curves.items()):
            axes.plot(*zip(*points, strict=True), STYLES[k % len(STYLES)] + "o", markersize=4, label=label or None)
        known = {found[name]["reference"] for _, found in runs if found.get(name, {}).get("reference") is not None}
        if len(known) == 1:
            axes.axhline(known.pop(), color="0.4", linewidth=1.0, label="reference")
        unit = next(found[name]["unit"] for _, found in runs if name in found)
        axes.set(xlabel=column_label(first), ylabel=column_label(name) + ("" if unit == "1" else f" ({unit})"))
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=7)
    save(figure, path)
    return True


def _across(text: str) -> Any:
    """Convert text to a number if possible; Matplotlib treats other values as categories."""
    try:
        return float(text)
    except ValueError:
        return text
