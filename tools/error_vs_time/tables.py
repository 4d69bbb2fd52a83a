"""Tables and pictures of the page."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from study import Row, picture, table

from .studies import ELEMENTS, STUDIES
from .sweep import ONE_CORE

Number = Callable[[Row], float]
TARGETS = (0.03, 0.01, 0.003, 0.001)
# Sections of docs/error-vs-time.md; a page elsewhere has all.
ON_PAGE = ("### pressure on CPU, one core", "### Times of finite elements and of this code")
# Errors at which finite elements and this code are compared.
ELEMENT_TARGETS = (0.01, 0.001, 0.0001)


def with_errors(rows: Sequence[Row]) -> list[Row]:
    """Rows that have an error."""
    return [row for row in rows if row["field"] is not None and np.isfinite(row["field"])]


def field_of(row: Row) -> float:
    """Error of the field."""
    return float(row["field"])


def seconds_of(row: Row) -> float:
    """Time of the run [s]."""
    return float(row["seconds"])


def front(rows: Sequence[Row], error: Number, cost: Number) -> list[Row]:
    """Rows that no other row beats in both error and cost, by rising cost."""
    best: list[Row] = []
    for row in sorted(with_errors(rows), key=lambda r: (cost(r), error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


def name_of(row: Row) -> str:
    """A run in words, without its scene."""
    if row["law"] in ELEMENTS:
        return f"finite elements, {ELEMENTS[row['law']]} nodes each, {row['points']} along a side"
    return f"{row['law']}, {row['horizon']:g}, {row['points']} points, {row['solver']}, float{row['precision']}"


def front_table(rows: Sequence[Row]) -> list[str]:
    """The front of field error over time."""
    cells = [
        [
            name_of(row), f"{100 * field_of(row):.3g} %", f"{100 * row['scalar']:+.3g} %", f"{row['seconds']:.3g}",
            f"{row['point_steps']:.2g}",
        ]
        for row in front(rows, field_of, seconds_of)
    ]  # fmt: skip
    return table(["fastest up to this error", "field", "scalar", "time s", "point-steps"], cells)


def orders(rows: Sequence[Row]) -> list[str]:
    """Observed orders of the field error in the spacing, from the most precise runs of each law and horizon.

    Empty if no law was run at two spacings.
    """
    groups: dict[tuple[str, float], dict[int, Row]] = {}
    for row in sorted(with_errors(rows), key=lambda r: (r["precision"], r["solver"] != "newton")):
        found = groups.setdefault((row["law"], row["horizon"]), {})
        if row["precision"] == 64 or row["points"] not in found:
            found[row["points"]] = row
    cells = []
    for (law, horizon), found in sorted(groups.items()):
        if len(found) < 2:
            continue
        ladder = [(n, field_of(found[n])) for n in sorted(found)]
        rates = [np.log(e / f) / np.log((m - 1) / (n - 1)) for (n, e), (m, f) in itertools.pairwise(ladder)]
        errors = ", ".join(f"{n}: {100 * e:.3g} %" for n, e in ladder)
        cells.append([law, f"{horizon:g}", errors, ", ".join(f"{rate:.1f}" for rate in rates)])
    return table(["law", "horizon", "points: field error", "orders"], cells) if cells else []


def by_scene_and_device(rows: Sequence[Row]) -> list[tuple[str, str, list[Row]]]:
    """Rows with an error of every scene on every device."""
    devices = sorted({row["device"] for row in rows})
    groups = itertools.product([study.scene for study in STUDIES], devices)
    return [(s, d, [r for r in with_errors(rows) if (r["scene"], r["device"]) == (s, d)]) for s, d in groups]


def fastest(rows: Sequence[Row], target: float) -> Row | None:
    """The fastest run whose field error is at most the target."""
    return min((row for row in rows if field_of(row) <= target), key=seconds_of, default=None)


def choices(rows: Sequence[Row]) -> list[str]:
    """The fastest run with a field error of at most 3, 1, 0.3 and 0.1 %, by scene and device."""
    cells = [
        [scene, device, f"{100 * target:g} %", name_of(best), f"{best['seconds']:.3g}"]
        for scene, device, here in by_scene_and_device(rows)
        for target in TARGETS
        if (best := fastest(here, target)) is not None
    ]
    return table(["scene", "device", "error", "fastest", "time s"], cells)


def against_elements(rows: Sequence[Row]) -> list[str]:
    """The fastest run of this code and of finite elements to some errors of the field, where a device has both."""
    cells = []
    for scene, device, here in by_scene_and_device(rows):
        kinds = [[r for r in here if (r["law"] in ELEMENTS) == wanted] for wanted in (True, False)]
        for target in ELEMENT_TARGETS if all(kinds) else ():
            elements, own = (fastest(kind, target) for kind in kinds)
            times = [f"{name_of(row)}: {row['seconds']:.3g} s" if row else "-" for row in (elements, own)]
            factor = f"{own['seconds'] / elements['seconds']:.1f}" if own and elements else "-"
            cells.append([scene, device, f"{100 * target:g} %", *times, factor])
    return table(["scene", "device", "error", "finite elements", "this code", "times as long"], cells)


def sections(rows: Sequence[Row], page: Path, only: Sequence[str] = ()) -> dict[str, list[str]]:
    """Sections of a page by heading, all or only some; draws their pictures beside the page."""
    found = {}
    for scene, device, here in by_scene_and_device(rows):
        everything = [row for row in rows if (row["scene"], row["device"]) == (scene, device)]
        heading = f"### {scene} on {device}"
        if not everything or (only and heading not in only):
            continue
        kind = "one-core" if device.endswith(ONE_CORE) else device.removeprefix("NVIDIA ").split()[0].lower()
        lines = [f"Measured: {'; '.join(sorted({row['made'] for row in everything}))}.", ""]
        if here:
            drawn = f"error-vs-time/{scene}-{kind}.png"
            draw(here, page.parent / drawn)
            lines += [f"![{scene} on {device}]({drawn})", ""]
            lines += [] if only else [*front_table(here), ""]
        failed = [f"- {name_of(row)}: {row['status']}" for row in everything if row["field"] is None]
        lines += ["Runs without a result:", "", *failed, ""] if failed else []
        lines += ["Observed orders in the spacing:", "", *ordered] if (ordered := orders(here)) else []
        found[heading] = lines
    found["### Times of finite elements and of this code"] = against_elements(rows)
    return found if only else {**found, "### The fastest": choices(rows)}


def draw(rows: Sequence[Row], path: Path) -> None:
    """Work-precision diagrams of one scene and device: errors over time and over point-steps, with their fronts."""
    from matplotlib import colormaps

    panels: tuple[tuple[Number, str, Number, str], ...] = (
        (lambda r: abs(r["scalar"]), "error of the scalar", seconds_of, "time of the run (s)"),
        (field_of, "L2 error of the field", seconds_of, "time of the run (s)"),
        (field_of, "L2 error of the field", lambda r: r["point_steps"], "point-steps"),
    )
    laws = sorted({law for study in STUDIES for law in study.laws})
    # Dark colours first: those of "tab20" are pairs of dark and light.
    colours = {law: colormaps["tab20"](2 * k % 20 + k // 10) for k, law in enumerate(laws)}
    marks = {"newton": "o", "relaxation": "s", "explicit": "^"}
    with picture(path, 1, 3, (5.0, 5.0)) as axes:
        for panel, (error, ylabel, cost, xlabel) in zip(axes.flat, panels, strict=True):
            for law, (solver, mark) in itertools.product(laws, marks.items()):
                some = [r for r in rows if (r["law"], r["solver"]) == (law, solver)]
                if some:
                    panel.scatter(
                        [cost(r) for r in some], [error(r) for r in some], marker=mark, s=22, alpha=0.75,
                        color=colours[law], label=f"{law}, {solver}",
                    )  # fmt: skip
            best = front(rows, error, cost)
            panel.plot([cost(r) for r in best], [error(r) for r in best], color="black", lw=1, label="front", zorder=0)
            panel.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
        axes.flat[-1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
