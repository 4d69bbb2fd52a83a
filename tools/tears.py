"""Do sheets tear at their tearing energy, whatever the grid and the spacing?

    python tools/tears.py strips --missing --device cuda:0 --jobs 14 --out docs/tear-strips.json    all 336
    python tools/tears.py strips --rows 20 --energies 1 4 --grids 0 45 --horizons 2.015     a few, on a CPU
    python tools/tears.py scenes --device cuda:0 --jobs 3 --out runs/tears.json
    python tools/tears.py scenes --only puncture --device cuda:0
    python tools/tears.py scenes --only ball_penetration --coarsest 1                       a minute or two on a CPU
    python tools/tears.py flaws --device cuda:0
    python tools/tears.py perforated --device cuda:0 --jobs 6

`strips` are those of `pure_shear_tear`, in which G = H W(stretch) is exact: of all SERIES, or, where one of --rows,
--horizons, --energies or --grids is given, of all their combinations. A row holds G / Gc when the tip has
moved by 1, 3, 6 and 10 spacings. `scenes` are others with a tear: their load at a fixed damage length, or G / Gc, at
four spacings and on grids of five kinds. `flaws` are those of `flaw_sensitivity`. `perforated` are lines of slits
across a sheet (docs/cookbook/perforated.py), whose bridges take Gc times what is not cut. The file is written after
each run and keeps the rows of earlier calls; a row of the same settings is replaced, or, with --missing, not run again.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from study import (
    DivergedError,
    InputError,
    Row,
    at_least_one,
    build_scene,
    device_title,
    in_processes,
    load_rows,
    provenance,
    run_tool,
    save_rows,
    study_parser,
    table,
    whole,
)

from warp_pd.scenes import pure_shear_tear

GRIDS: dict[str, dict[str, float]] = {
    "0": {}, "15": {"turn": 15.0}, "30": {"turn": 30.0}, "45": {"turn": 45.0}, "jittered": {"jitter": 0.25}
}  # fmt: skip
ADVANCES = (1, 3, 6, 10)
# With a free end ahead of the tear G is less than H W.
HELD = {"far_end": "held"}
# Rows, horizons in spacings, tearing energies [J/m^2] (40 is mu H) and grids of the strips of every material.
SERIES: tuple[tuple[Sequence[int], Sequence[float], Sequence[float], Sequence[str]], ...] = (
    ((48, 80, 96, 160), (2.015,), (4.0, 20.0, 40.0), ("0",)),
    ((48, 96), (2.015,), (20.0,), ("15", "30", "45")),
    ((48, 96), (1.5, 4.15), (4.0, 20.0), ("0",)),
    ((48, 96), (2.015, 3.15), (4.0, 20.0), ("0", "jittered")),
    ((96,), (1.5, 4.15), (20.0,), ("jittered",)),
    ((24,), (2.015, 3.15), (4.0, 20.0), ("0", "jittered")),
)


@dataclass(frozen=True)
class Tear:
    """A scene with a tear, at several spacings and on several grids.

    Attributes:
        scene: Its name.
        number: The outcome that is read.
        points: Numbers of points, from the coarsest; the grids are compared at the last but one.
        settings: Other arguments. A damage length is that of the material: 2 to 3 spacings of the coarsest grid.
    """

    scene: str
    number: str
    points: tuple[int, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def by_points(self) -> list[dict[str, Any]]:
        """Settings of the runs at all spacings."""
        return [{"points": points, **self.settings} for points in self.points]

    def by_grid(self) -> list[dict[str, Any]]:
        """Settings of the runs on all grids."""
        return [{"points": self.points[-2], **self.settings, **grid} for grid in GRIDS.values()]


# Those that have a truth for a short length take the default one, four spacings.
TEARS = (
    Tear("trousers", "tear_ratio", (30, 40, 60, 80)),
    # Its largest load is that of a frame: 150 of them would round G to 2 %.
    Tear("edge_notch", "onset_ratio", (60, 80, 120, 160), {"frames": 900}),
    Tear("running_crack", "released_ratio", (40, 60, 80, 120), {"overload": 1.5}),
    Tear(
        "double_notch", "largest_load", (80, 112, 160, 224),
        {"duration": 1.3, "frames": 300, "tearing_energy": 0.9, "damage_length": 7.5e-4},
    ),
    Tear(
        "off_plane_tear", "load_while_tearing", (60, 84, 120, 168),
        {"speed": 8e-3, "travel": 0.06, "frames": 300, "tearing_energy": 1.5, "damage_length": 3.5e-3},
    ),
    Tear(
        "precut_tear", "largest_pull", (60, 84, 120, 168),
        {"frames": 300, "tearing_energy": 2.43, "damage_length": 0.05},
    ),
    Tear("puncture", "puncture_force", (61, 85, 121, 171), {"frames": 200, "damage_length": 3e-3}),
    Tear(
        "ball_penetration", "largest_ball_force", (101, 141, 201, 285),
        {"frames": 300, "tearing_energy": 8.0, "damage_length": 0.021},
    ),
)  # fmt: skip


# Points, flaw and damage length [mm], and strength over that of the length, of `flaw_sensitivity`.
FLAWS = (
    (121, 0.0, 10.0, 1.0), (241, 1.0, 10.0, 1.0), (121, 3.0, 10.0, 1.0), (121, 10.0, 10.0, 1.0), (121, 10.0, 3.4, 1.0),
    (121, 30.0, 3.4, 1.0), (161, 40.0, 2.5, 1.0), (241, 40.0, 1.25, 1.0), (241, 45.0, 0.9, 1.0), (541, 47.0, 0.47, 1.0),
    (121, 0.0, 3.4, 0.3), (121, 3.0, 3.4, 0.3), (121, 10.0, 3.4, 0.3), (121, 40.0, 3.4, 0.3),
)  # fmt: skip
GC, WEAKENED = 4.0, "strength"
PERFORATED = "docs/cookbook/perforated.py"


def strips(options: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Runs of the strips: the scene and its settings.

    In each series the first strip of each kind of kernels comes first, so that processes compile different ones; then
    the largest, since they take longest.
    """
    given = (options.rows, options.horizons, options.energies, options.grids)
    series = SERIES
    if any(some is not None for some in given):
        series = (tuple(some or default for some, default in zip(given, SERIES[0], strict=True)),)  # type: ignore[assignment]
    seen, compiled = [], set()
    for rows, horizons, energies, grids in series:
        chosen = itertools.product(rows, horizons, energies, grids, options.materials or pure_shear_tear.MATERIALS)
        first, later = [], []
        for n, m, energy, grid, material in sorted(chosen, key=lambda settings: -settings[0] * settings[1]):
            named = {} if material == "neo_hookean" else {"material": material}
            settings = {"points": n, "horizon": m, "tearing_energy": energy, **named, **GRIDS[grid], **HELD}
            settings |= further(options)
            if settings not in seen:
                (later if (material, m, grid == "0") in compiled else first).append(settings)
                seen.append(settings)
                compiled.add((material, m, grid == "0"))
        yield from (("pure_shear_tear", settings) for settings in first + later)


def tears(options: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Runs of other scenes: the scene and its settings."""
    for tear in TEARS:
        if tear.scene in options.only:
            chosen = tear.by_points() + tear.by_grid()[1:]
            for settings in chosen[: options.coarsest]:
                yield tear.scene, {**settings, **further(options)}


def flaws(options: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Sheets with flaws from none to a hundred damage lengths."""
    for points, flaw, length, weaker in FLAWS:
        settings = {"points": points, "flaw": 1e-3 * flaw, "damage_length": 1e-3 * length, "tearing_energy": GC}
        if weaker < 1.0:
            settings[WEAKENED] = round(weaker * 3.0 * GC / (16.0 * settings["damage_length"]), 3)
        yield "flaw_sensitivity", {**settings, **further(options)}


def perforated(options: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Perforated lines: slits and bridges of 2, 4 and 8 mm at spacings of 0.25, 0.5 and 1 mm."""
    for points, size in itertools.product((257, 129, 65), (2e-3, 4e-3, 8e-3)):
        yield PERFORATED, {"points": points, "size": size, "frames": 100, **further(options)}


def further(options: Any) -> dict[str, str]:
    """Arguments of all runs that the command line gives."""
    return dict(item.split("=", 1) for item in options.set)


def run(scene: str, settings: dict[str, Any], device: str | None) -> Row:
    """One run: its status, the values of its measures, and the onset of a strip. Others go on if one fails."""
    simulation = build_scene(scene, settings)
    try:
        result = whole(simulation.run(device=device, usd=False, pictures=False))
    except (InputError, DivergedError) as error:
        return {"scene": scene, "settings": settings, "status": "failed", "notes": [str(error)]}
    measures = {name: found["value"] for name, found in result.summary["measures"].items()}
    onset = {
        f"onset_{n}": next(
            (r["release_ratio"] for r in result.history if r["tip"] > n * simulation.sheet.spacing), None
        )
        for n in (ADVANCES if scene == "pure_shear_tear" else ())
    }
    notes = [note for note in result.summary["notes"] if "two cuts" in note]
    return {"scene": scene, "settings": settings, "status": result.status, "notes": notes, **measures, **onset}


def found(rows: Sequence[Row], scene: str, settings: dict[str, Any]) -> Row:
    """The row of a run; empty if it has not been run."""
    return next((row for row in rows if row["scene"] == scene and row["settings"] == settings), {})


def kind_of_strip(row: Row) -> tuple[str, float, int]:
    """Material, horizon in spacings and rows of points of a strip."""
    settings = row["settings"]
    return settings.get("material", "neo_hookean"), settings["horizon"], settings["points"]


def strips_table(rows: Sequence[Row]) -> list[str]:
    """Lowest, mean and largest G / Gc at onset and released, over grids and tearing energies; then the page's table."""
    lines = []
    rows = [row for row in rows if row["scene"] == "pure_shear_tear"]
    for material, horizon, points in sorted(set(map(kind_of_strip, rows))):
        some = [row for row in rows if kind_of_strip(row) == (material, horizon, points)]
        cells = []
        for number in ("onset_3", "onset_10", "released_ratio"):
            values = [row[number] for row in some if row.get(number) is not None]
            known = (min(values), sum(values) / len(values), max(values)) if values else ()
            cells.append(", ".join(f"{value:.3f}" for value in known))
        worst = max((row.get("worst_energy_balance") or 0.0 for row in some), default=0.0)
        ended = sum(row["status"] == "finished" for row in some)
        lines.append(
            [material, f"{horizon:g}", f"{points}", f"{len(some)}", f"{ended}", *cells, f"{100.0 * worst:.2f} %"]
        )
    head = ["material", "horizon", "rows", "strips", "finished", "G / Gc after 3 spacings", "after 10", "released"]
    head.append("worst energy balance")
    return [*strips_at_a_glance(rows), "", *table(head, lines)]


def strips_at_a_glance(rows: Sequence[Row]) -> list[str]:
    """Lowest to largest G / Gc after ten spacings, a line a material, a column a horizon and number of rows.

    What is released is that of strips of 40 rows and more: coarser ones soften as a whole before they tear.
    """

    def between(some: Sequence[Row], number: str) -> str:
        values = [row[number] for row in some if row.get(number) is not None]
        return f"{min(values):.3f}-{max(values):.3f}" if values else ""

    grids = sorted({kind_of_strip(row)[1:] for row in rows})
    lines = []
    for material in sorted({kind_of_strip(row)[0] for row in rows}):
        of_material = [row for row in rows if kind_of_strip(row)[0] == material]
        cells = [between([r for r in of_material if kind_of_strip(r)[1:] == grid], "onset_10") for grid in grids]
        fine = [row for row in of_material if kind_of_strip(row)[2] >= 40]
        lines.append([material, *cells, between(fine, "released_ratio")])
    return table(["material", *(f"{horizon:g}: {points}" for horizon, points in grids), "released"], lines)


def scenes_table(rows: Sequence[Row]) -> list[str]:
    """One line a scene: what is read at all spacings and on all grids, its last change and how far the grids spread."""
    lines = []
    for tear in TEARS:
        values, on_grids = (
            [found(rows, tear.scene, settings).get(tear.number) for settings in runs]
            for runs in (tear.by_points(), tear.by_grid())
        )
        lines.append([
            tear.scene, tear.number,
            ", ".join(f"{n}: {shown(v)}" for n, v in zip(tear.points, values, strict=True)), apart(values[-2:]),
            ", ".join(map(shown, on_grids)), apart(on_grids),
        ])  # fmt: skip
    head = ["scene", "number", "points: value", "last change", f"on grids of {', '.join(GRIDS)}", "spread"]
    return table(head, lines)


def flaws_table(rows: Sequence[Row]) -> list[str]:
    """One line a flaw: its length over that of the field, and what it breaks at over the strength and Griffith's."""
    lines = []
    for row in (row for row in rows if row["scene"] == "flaw_sensitivity"):
        settings = row["settings"]
        flaw, length = float(settings["flaw"]), float(settings["damage_length"])
        numbers = (flaw / length, row["stress_at_break"], row["strength_ratio"], row["griffith_ratio"])
        strength = f"{settings[WEAKENED]:g}" if WEAKENED in settings else "of the length"
        lines.append([f"{1e3 * flaw:g}", f"{1e3 * length:g}", strength, *map(shown, numbers)])
    head = ["flaw (mm)", "length (mm)", "strength (J/m^3)", "flaw / length", "stress at break (Pa)", "W / strength"]
    return table([*head, "G / Gc"], lines)


def perforated_table(rows: Sequence[Row]) -> list[str]:
    """One line each: torn energy over Gc times what is not cut, the largest pull, and whether a note tells of it."""
    lines = []
    for row in (row for row in rows if row["scene"] == PERFORATED):
        settings = row["settings"]
        numbers = map(shown, (row["torn_ratio"], row["peak"], row["worst_energy_balance"]))
        spacing = 64.0 / (settings["points"] - 1)
        lines.append([f"{1e3 * settings['size']:g}", f"{spacing:g}", *numbers, "yes" if row["notes"] else "no"])
    head = ["slits and bridges (mm)", "spacing (mm)", "torn energy / (Gc uncut area)", "largest pull (N)"]
    return table([*head, "energy balance", "note"], sorted(lines))


def apart(values: Sequence[float | None]) -> str:
    """How far values lie apart, over their mean; of those that there are."""
    known = [value for value in values if value is not None]
    return f"{100 * (max(known) - min(known)) / abs(sum(known) / len(known)):.1f} %" if len(known) > 1 else "-"


def shown(value: float | None) -> str:
    """A number in a cell."""
    return "-" if value is None else f"{value:.4g}"


KINDS = {
    "strips": (strips, strips_table), "scenes": (tears, scenes_table), "flaws": (flaws, flaws_table),
    "perforated": (perforated, perforated_table),
}  # fmt: skip


def main() -> None:
    """Run, keep the rows, print the table."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, only_page=False, missing=False)
    parser.add_argument("kind", choices=tuple(KINDS))
    parser.add_argument("--rows", type=at_least_one, nargs="+", help="of points in a strip")
    parser.add_argument("--horizons", type=float, nargs="+")
    parser.add_argument("--energies", type=float, nargs="+", help="Gc [J/m^2]")
    parser.add_argument("--grids", nargs="+", choices=list(GRIDS))
    parser.add_argument("--materials", nargs="+", choices=list(pure_shear_tear.MATERIALS))
    names = [tear.scene for tear in TEARS]
    parser.add_argument("--only", nargs="+", default=names, choices=names, help="scenes to run")
    parser.add_argument("--coarsest", type=at_least_one, help="run each scene at so many spacings alone")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="further arguments of all runs")
    options = parser.parse_args()
    path: Path | None = options.out
    rows = [] if path is None else load_rows(path)
    if not options.only_page:
        chosen = [c for c in KINDS[options.kind][0](options) if not (options.missing and found(rows, *c))]
        made = provenance(device_title(options.device))
        for (scene, settings, _), row in in_processes(run, [(*c, options.device) for c in chosen], options.jobs):
            rows = [r for r in rows if (r["scene"], r["settings"]) != (scene, settings)] + [{**row, "made": made}]
            print(json.dumps(rows[-1]), flush=True)
            if path is not None:
                save_rows(path, rows)
    print("\n".join(KINDS[options.kind][1](rows)))


if __name__ == "__main__":
    run_tool(main)
