"""Plots of the history of a run and of the measures of a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from ..device.checks import one_of
from ..output.quantities import column_label, with_unit
from .pictures import new_figure, new_panels, save, target
from .plots import FEW, STYLES, part_ticks

# Columns of panels of the picture; letters along a side of a panel, and width of a letter of the legend [inches].
COLUMNS, WRAPPED, LETTER = 3, 36, 0.062


def plot_history(
    history: Sequence[Mapping[str, float]],
    names: Sequence[str],
    units: Mapping[str, str],
    *,
    against: str,
    path: Any = None,
    title: str = "",
    load_duration: float | None = None,
) -> Any:
    """Plot columns of the history, one panel per unit; arguments as for `Result.plot`, `units` by column.

    The load time of a static run, whose full load takes `load_duration` [s], is drawn as the load factor.
    """
    columns = [column for column in history[0] if column != against]
    for name in names:
        one_of("column", name, columns)
    one_of("against", against, history[0])
    written = None if path is None else target(path)
    duration = load_duration if against == "time" else None
    xlabel = _label(against, units) if duration is None else "load factor"
    panels = list(dict.fromkeys(units.get(name, "") for name in names))
    figure = new_figure(6.0, 1.2 + 2.6 * len(panels))
    across = [row[against] / (duration or 1.0) for row in history]
    for k, unit in enumerate(panels):
        axes = figure.add_subplot(len(panels), 1, k + 1)
        shown = [name for name in names if units.get(name, "") == unit]
        marker = "." if len(history) < FEW else ""
        for name in shown:
            axes.plot(across, [row[name] for row in history], label=column_label(name), marker=marker)
        several = "" if unit in ("", "1", "-") else f"({unit})"
        axes.set(xlabel=xlabel, ylabel=_label(shown[0], units) if len(shown) == 1 else several)
        axes.grid(alpha=0.3)
        if len(shown) > 1:
            axes.legend(fontsize=8)
    if title:
        figure.suptitle(title, fontsize=10)
    if written is not None:
        save(figure, written)
    return figure


def _label(name: str, units: Mapping[str, str]) -> str:
    return with_unit(name, units.get(name, ""))


def draw_sweep(path: Path, runs: Sequence[tuple[Mapping[str, str], Mapping[str, Any]]]) -> bool:
    """Draw one panel per measure, a curve for each combination of the other arguments; return whether there was any.

    `runs` are values of the arguments and measures of the summary, for each run with measures.
    """
    names = list(dict.fromkeys(n for _, found in runs for n, m in found.items() if m["value"] is not None))
    if not names:
        return False
    varied = [key for key in runs[0][0] if len({values[key] for values, _ in runs}) > 1]
    first, *others = varied or list(runs[0][0])[:1]
    labels = list(dict.fromkeys(_described(values, others) for values, _ in runs))
    known = [
        {m["reference"] for _, found in runs if (m := found.get(name)) and m["reference"] is not None} for name in names
    ]
    compared = any(len(references) == 1 for references in known)
    longest = max(map(len, labels)) if others else len("reference") if compared else 0
    figure, panels = new_panels(
        len(names), min(len(names), COLUMNS), (4.6, 3.3), (0.6 + LETTER * longest if longest else 0.0, 0.4)
    )
    legend: dict[str, Any] = {}
    for axes, name, references in zip(panels, names, known, strict=True):
        curves: dict[str, list[tuple[Any, float]]] = {}
        for values, found in runs:
            if found.get(name, {}).get("value") is not None:
                place = (_across(values[first]), found[name]["value"])
                curves.setdefault(_described(values, others), []).append(place)
        for label, points in curves.items():
            k = labels.index(label)
            style = {"linestyle": STYLES[k % len(STYLES)], "color": f"C{k % 10}", "marker": "o", "markersize": 4}
            legend[label] = axes.plot(*zip(*points, strict=True), label=label or None, **style)[0]
        if len(references) == 1:
            legend["reference"] = axes.axhline(*references, color="0.4", linewidth=1.0, label="reference")
        unit = next(found[name]["unit"] for _, found in runs if name in found)
        axes.set(xlabel=fill(column_label(first), WRAPPED), ylabel=fill(with_unit(name, unit), WRAPPED))
        axes.grid(alpha=0.3)
        _part_ticks(axes, [values[first] for values, _ in runs])
    legend.pop("", None)
    if legend:
        # Beside the panels, where it hides no curve.
        figure.legend(legend.values(), legend.keys(), loc="outside right upper", fontsize=7)
    save(figure, path)
    return True


def _described(values: Mapping[str, str], keys: Sequence[str]) -> str:
    return ", ".join(f"{key}={values[key]}" for key in keys)


def _part_ticks(axes: Any, texts: Sequence[str]) -> None:
    """Keep the labels along the horizontal axis apart: few numbers, and names that are turned if they are long."""
    if isinstance(_across(texts[0]), float):
        part_ticks(axes)
    elif sum(len(text) + 2 for text in dict.fromkeys(texts)) > WRAPPED:
        axes.tick_params("x", labelrotation=30.0)
        for label in axes.get_xticklabels():
            label.set(horizontalalignment="right", rotation_mode="anchor")


def _across(text: str) -> Any:
    """Convert text to a number if possible; Matplotlib treats other values as categories."""
    try:
        return float(text)
    except ValueError:
        return text
