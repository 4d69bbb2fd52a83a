"""Tables and pictures of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from small_pictures import limit, shrunk
from study import Row, table

from .studies import ELEMENTS, STUDIES
from .sweep import ONE_CORE

Number = Callable[[Row], float]
# Errors at which runs are compared.
TARGETS = (0.01, 0.001)
# Horizons in spacings whose orders no table shows.
WIDE = 2.5
BONDS = ("bond_based", "bonds", "bonds_refitted", "breaking_bonds", "bimodular", "visco_bonds")
# Lines of the picture, from bottom to top: name, colour, marker, laws.
METHODS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("finite elements", "0.45", "s", tuple(ELEMENTS)),
    ("bonds (IM, HE, VE)", "#d62728", "v", BONDS),
    ("published (BA)", "#ff9d1c", "D", ("published",)),
    ("nodal", "#9467bd", "P", ("nodal",)),
    ("network in Torch (NN)", "#8c564b", "X", ("neural",)),
    ("network in a kernel (NN)", "#e377c2", "*", ("neural_fused",)),
    ("closed form (NN)", "#2ca02c", "^", ("closed_form",)),
    ("plain weights", "#7fc7f5", "o", ("plain",)),
    ("corrected weights", "#1f5fb4", "o", ("corrected", "visco")),
)  # fmt: skip


def with_errors(rows: Sequence[Row]) -> list[Row]:
    """Rows that have an error."""
    return [row for row in rows if row["scalar"] is not None and np.isfinite(error_of(row))]


def error_of(row: Row) -> float:
    """Error of the field, or of the scalar where the scene has no field to compare with."""
    return float(abs(row["scalar"]) if row["field"] is None else row["field"])


def seconds_of(row: Row) -> float:
    """Time of the run [s]."""
    return float(row["seconds"])


def front(rows: Sequence[Row], error: Number = error_of, cost: Number = seconds_of) -> list[Row]:
    """Rows that no other row beats in both error and cost, by rising cost."""
    best: list[Row] = []
    for row in sorted(with_errors(rows), key=lambda r: (cost(r), error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


def name_of(row: Row) -> str:
    """A run in words, without its scene."""
    if row["law"] in ELEMENTS:
        return f"{ELEMENTS[row['law']]} nodes each, {row['points']} along"
    return f"{row['law']} {row['horizon']:g}, {row['points']}, {row['solver']}, float{row['precision']}"


def front_table(rows: Sequence[Row]) -> list[str]:
    """The front of the error over time."""
    cells = [
        [name_of(row), f"{100 * error_of(row):.3g} %", f"{row['seconds']:.3g}", f"{row['point_steps']:.2g}"]
        for row in front(rows)
    ]
    return table(["fastest up to this error", "error", "time s", "point-steps"], cells)


def orders(rows: Sequence[Row]) -> list[str]:
    """The error of each law and horizon on its finest grid, and its order between the last two grids, by scene.

    Of the most precise runs of horizons that are not wide, where a scene has an error of the field. Empty if no law was
    run at two spacings.
    """
    groups: dict[tuple[str, str, float], dict[int, Row]] = {}
    known = [row for row in with_errors(rows) if row["field"] is not None and row["horizon"] < WIDE]
    for row in sorted(known, key=lambda r: (r["precision"], r["solver"] != "newton")):
        found = groups.setdefault((row["scene"], row["law"], row["horizon"]), {})
        if row["precision"] == 64 or row["points"] not in found:
            found[row["points"]] = row
    scenes = [s.scene for s in STUDIES if any(scene == s.scene and len(f) > 1 for (scene, *_), f in groups.items())]
    kinds = sorted({(law, horizon) for scene, law, horizon in groups if len(groups[scene, law, horizon]) > 1})
    cells = [
        [law, f"{horizon:g}" if horizon else "-", *(_order(groups.get((scene, law, horizon), {})) for scene in scenes)]
        for law, horizon in kinds
    ]
    return table(["law", "horizon", *scenes], cells) if cells else []


def _order(found: Mapping[int, Row]) -> str:
    if len(found) < 2:
        return ""
    coarse, fine = sorted(found)[-2:]
    errors = error_of(found[coarse]), error_of(found[fine])
    rate = np.log(errors[0] / max(errors[1], 1e-9)) / np.log((fine - 1) / (coarse - 1))
    return f"{100 * errors[1]:.2g} % ({fine}), {rate:.1f}"


def by_scene(rows: Sequence[Row], device: str) -> list[tuple[str, list[Row]]]:
    """Rows with an error of every scene on a device."""
    here = [row for row in with_errors(rows) if row["device"] == device]
    found = [(s.scene, [row for row in here if row["scene"] == s.scene]) for s in STUDIES]
    return [(scene, some) for scene, some in found if some]


def fastest(rows: Sequence[Row], target: float) -> Row | None:
    """The fastest run whose error is at most the target."""
    return min((row for row in rows if error_of(row) <= target), key=seconds_of, default=None)


def costs(rows: Sequence[Row], device: str) -> list[str]:
    """The fastest run of this code to 1 and 0.1 %, and beside it finite elements, if the device ran them.

    Where this code has no run of 1 %, its least error takes that place.
    """
    cells = []
    both = any(row["law"] in ELEMENTS and row["device"] == device for row in rows)
    for scene, here in by_scene(rows, device):
        kinds = [[r for r in here if (r["law"] in ELEMENTS) == wanted] for wanted in (False, True)]
        least = min(map(error_of, kinds[0]), default=0.0)
        for target in TARGETS if least <= TARGETS[0] else (least,):
            own, elements = (fastest(kind, target) for kind in kinds)
            if own is None:
                continue
            times = [f"{name_of(row)}: {row['seconds']:.2g} s" if row else "-" for row in (own, elements)]
            factor = f"{own['seconds'] / elements['seconds']:.1f}" if elements else ""
            cells.append([scene, f"{100 * target:.2g} %", *([*times, factor] if both else times[:1])])
    beside = ["finite elements", "times as long"] if both else []
    return table(["scene", "error", "this code", *beside], cells)


def sections(rows: Sequence[Row], page: Path) -> dict[str, list[str]]:
    """Sections of a page by heading, one for each device, and the picture of the one core beside the page."""
    found = {}
    for device in sorted({row["device"] for row in rows}, key=lambda name: (not name.endswith(ONE_CORE), name)):
        here = [row for row in rows if row["device"] == device]
        lines = [f"Measured: {'; '.join(sorted({row['made'] for row in here}))}.", ""]
        if device.endswith(ONE_CORE):
            drawn = "error-vs-time/one-core.png"
            draw(here, page.parent / drawn)
            lines += [f"![Error against run time on {device}]({drawn})", ""]
        lines += costs(rows, device)
        failed = [f"{row['scene']}, {name_of(row)}: {row['status']}" for row in here if row["scalar"] is None]
        lines += ["", "Runs without a result:", "", *(f"- {line}" for line in failed)] if failed else []
        found[f"## On {device}"] = lines
        if device.endswith(ONE_CORE) and (ordered := orders(here)):
            found["## Orders"] = [
                "Error on the finest grid (its points), and the order between the last two grids.", "", *ordered
            ]  # fmt: skip
    return found


def draw(rows: Sequence[Row], path: Path) -> None:
    """Work-precision diagrams of the scenes: the front of every method, errors over the time of the run."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    scenes = [(study, [r for r in with_errors(rows) if r["scene"] == study.scene]) for study in STUDIES]
    scenes = [(study, some) for study, some in scenes if some]
    across = min(4, len(scenes))
    down = -(-len(scenes) // across)
    figure = Figure(figsize=(3.5 * across, 3.1 * down + 0.5), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False)
    shown: dict[str, object] = {}
    for panel, (study, here) in zip(axes.flat, scenes, strict=False):
        for name, colour, marker, laws in METHODS:
            some = [r for r in here if r["law"] in laws]
            # Errors of a load change their sign on the way: a front would end where one happens to be zero.
            best = sorted(some, key=seconds_of) if study.energies else front(some)
            if best:
                (shown[name],) = panel.plot(
                    [seconds_of(r) for r in best], [100.0 * error_of(r) for r in best],
                    marker=marker, color=colour, markersize=5, linewidth=1.4,
                )  # fmt: skip
        panel.set_title(study.title, fontsize=9)
        panel.set(xscale="log", yscale="log")
        for axis, limits in (("x", panel.get_xlim()), ("y", panel.get_ylim())):
            low, high = np.floor(np.log10(limits[0]) + 0.1), np.ceil(np.log10(limits[1]) - 0.1)
            panel.set(**{f"{axis}lim": (10.0 ** min(low, high - 1.0), 10.0**high)})
        panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} %"))
        panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} s"))
        panel.tick_params(labelsize=8, which="major")
        panel.tick_params(which="minor", labelleft=False, labelbottom=False)
        panel.grid(alpha=0.25)
    for panel in axes.flat[len(scenes) :]:
        panel.set_axis_off()
    named = [name for name, *_ in reversed(METHODS) if name in shown]
    figure.legend(
        [shown[name] for name in named],
        named,
        loc="outside lower center",
        ncols=min(5, len(named)),
        frameon=False,
        fontsize=9,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    path.write_bytes(shrunk(path, limit(path)))
