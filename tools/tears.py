"""Do sheets tear at their tearing energy, whatever the grid and the spacing?

    python tools/tears.py strips --device cuda:0 --jobs 12 --out docs/tear-strips.json      all 225, on an H200
    python tools/tears.py strips --rows 20 --stretches 1.5 3 --grids 0 45 --horizons 3.15   a few, on a CPU
    python tools/tears.py scenes --device cuda:0 --jobs 3 --out runs/tears.json             five minutes on an H200

`strips` are those of `pure_shear_tear`, in which G = H W(stretch) is exact. The tearing energy Gc is the one that
stands for a critical stretch, unless `--set` says otherwise. A row holds G / Gc when the tip has moved by 1, 3, 6 and
12 spacings. `scenes` are all others with a tear: their load or G / Gc on grids of five kinds and at several spacings.
A file keeps the rows of earlier calls; a row of the same settings is replaced.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from study import (
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
)

GRIDS: dict[str, dict[str, float]] = {
    "0": {}, "15": {"turn": 15.0}, "30": {"turn": 30.0}, "45": {"turn": 45.0}, "jittered": {"jitter": 0.25}
}  # fmt: skip
ADVANCES = (1, 3, 6, 12)
# Scene, what is read, settings, points at which the grids are compared, all points.
SCENES: tuple[tuple[str, str, dict[str, Any], int, tuple[int, ...]], ...] = (
    ("trousers", "tear_ratio", {}, 40, (20, 40, 80)),
    ("edge_notch", "onset_ratio", {}, 60, (30, 60, 120)),
    ("double_notch", "largest_load", {"duration": 1.8, "frames": 60, "tearing_energy": 0.784}, 60, (30, 60, 120, 240)),
    (
        "off_plane_tear", "load_when_tear_begins",
        {"speed": 8e-3, "travel": 0.075, "weights": "plain", "frames": 150, "tearing_energy": 2.95}, 80, (20, 40, 80),
    ),
    ("precut_tear", "largest_pull", {"frames": 100, "tearing_energy": 2.43}, 120, (60, 120, 240)),
    ("puncture", "puncture_force", {}, 61, (31, 61, 121, 241)),
    ("ball_penetration", "largest_ball_force", {"tearing_energy": 2.89}, 101, (51, 101, 201)),
    ("running_crack", "released_ratio", {"overload": 2.0}, 40, (20, 40, 80)),
)  # fmt: skip


def strips(options: Any) -> Iterator[dict[str, Any]]:
    """Settings of the strips."""
    extra = dict(item.split("=", 1) for item in options.set)
    for rows, m, stretch, grid in itertools.product(options.rows, options.horizons, options.stretches, options.grids):
        yield {"points": rows, "horizon": m, "critical_stretch": stretch, **GRIDS[grid], **extra}


def tears() -> Iterator[tuple[str, dict[str, Any]]]:
    """All runs of the other scenes: the scene and its settings."""
    for scene, _, settings, middle, points in SCENES:
        for change in GRIDS.values():
            yield scene, {"points": middle, **settings, **change}
        for number in points:
            if number != middle:
                yield scene, {"points": number, **settings}


def run(scene: str, settings: dict[str, Any], device: str | None) -> Row:
    """One run: its status, the values of its measures, and the onset of a strip."""
    strip = {"overload": 1.8, "duration": 6.0, "frames": 100} if scene == "pure_shear_tear" else {}
    simulation = build_scene(scene, strip | settings)
    result = simulation.run(device=device, usd=False, pictures=False)
    measures = {name: found["value"] for name, found in result.summary["measures"].items()}
    onset = {
        f"onset_{n}": next(
            (r["release_ratio"] for r in result.history if r["tip"] > n * simulation.sheet.spacing), None
        )
        for n in (ADVANCES if strip else ())
    }
    return {"scene": scene, "settings": settings, "status": result.status, **measures, **onset}


def found(rows: Sequence[Row], scene: str, settings: dict[str, Any]) -> Row:
    """The row of a run; empty if it has not been run."""
    return next((row for row in rows if row["scene"] == scene and row["settings"] == settings), {})


def strips_table(rows: Sequence[Row]) -> list[str]:
    """Lowest, mean and largest G / Gc at onset over grids and critical stretches."""
    lines = []
    for horizon, points in sorted({(row["settings"]["horizon"], row["settings"]["points"]) for row in rows}):
        some = [row for row in rows if (row["settings"]["horizon"], row["settings"]["points"]) == (horizon, points)]
        cells = []
        for advance in (3, 12):
            values = [row[f"onset_{advance}"] for row in some if row[f"onset_{advance}"] is not None]
            known = (min(values), sum(values) / len(values), max(values)) if values else ()
            cells.append(", ".join(f"{value:.2f}" for value in known))
        worst = max((row["worst_energy_balance"] or 0.0 for row in some), default=0.0)
        ended = sum(row["status"] == "finished" for row in some)
        lines.append([f"{horizon:g}", f"{points}", f"{len(some)}", f"{ended}", *cells, f"{100.0 * worst:.2f} %"])
    head = ["horizon", "rows", "strips", "finished", "G / Gc after 3 spacings", "after 12", "worst energy balance"]
    return table(head, lines)


def scenes_table(rows: Sequence[Row]) -> list[str]:
    """One line a scene: what is read at all spacings and on all grids, and how far the grids spread."""
    lines = []
    for scene, name, settings, middle, points in SCENES:
        by_points = [found(rows, scene, {"points": n, **settings}).get(name) for n in points]
        by_grid = [found(rows, scene, {"points": middle, **settings, **change}).get(name) for change in GRIDS.values()]
        known = [value for value in by_grid if value is not None]
        spread = (max(known) - min(known)) / (sum(known) / len(known)) if known and sum(known) else math.nan
        lines.append([
            scene, name, ", ".join(f"{n}: {shown(v)}" for n, v in zip(points, by_points, strict=True)),
            ", ".join(map(shown, by_grid)), "-" if math.isnan(spread) else f"{100 * spread:.0f} %",
        ])  # fmt: skip
    return table(["scene", "number", "points: value", f"on grids of {', '.join(GRIDS)}", "spread"], lines)


def shown(value: float | None) -> str:
    """A number in a cell."""
    return "-" if value is None else f"{value:.4g}"


def main() -> None:
    """Run, keep the rows, print the table."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, only_page=False, commit=None)
    parser.add_argument("kind", choices=("strips", "scenes"))
    parser.add_argument("--rows", type=at_least_one, nargs="+", default=[20, 40, 80], help="of points in a strip")
    parser.add_argument("--horizons", type=float, nargs="+", default=[2.015, 3.15, 4.15])
    parser.add_argument("--stretches", type=float, nargs="+", default=[1.5, 2.0, 3.0, 4.0, 6.0], help="critical ones")
    parser.add_argument("--grids", nargs="+", default=list(GRIDS), choices=list(GRIDS))
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="further arguments of the strips")
    options = parser.parse_args()
    path: Path | None = options.out
    rows = [] if path is None else load_rows(path)
    if not options.only_page:
        chosen = [("pure_shear_tear", s) for s in strips(options)] if options.kind == "strips" else list(tears())
        made = provenance(device_title(options.device), options.commit)
        for (scene, settings, _), row in in_processes(run, [(*c, options.device) for c in chosen], options.jobs):
            rows = [r for r in rows if (r["scene"], r["settings"]) != (scene, settings)] + [{**row, "made": made}]
            print(json.dumps(rows[-1]), flush=True)
            if path is not None:
                save_rows(path, rows)
    strip_rows = [row for row in rows if row["scene"] == "pure_shear_tear"]
    print("\n".join(strips_table(strip_rows) if options.kind == "strips" else scenes_table(rows)))


if __name__ == "__main__":
    run_tool(main)
