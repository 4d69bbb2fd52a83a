"""Does a sheet with a tearing energy tear at that energy? Makes docs/tearing-energy.md.

python tools/tear_strips.py --device cuda:0 --jobs 3 --out docs/tear-strips.json     the strips, ten minutes
python tools/tearing_energy.py --device cuda:0 --jobs 3      all other runs, five minutes on one H200, and the page
python tools/tearing_energy.py --only-page                   the page from the two JSON files
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from study import (
    DOCS,
    in_processes,
    page_header,
    paragraph,
    run_tool,
    study_parser,
    table,
    write_page,
    write_runs,
)
from tearing import GRIDS, spread

from warp_pd.parts.tearing_energy import BEGIN, END, GRADUAL_HORIZONS, GRADUAL_WIDTHS

OVERLOADS = (1.3, 1.6, 2.0, 3.0, 4.0)
# Scene, what is read, settings, points at which the grids are compared, all points.
TEARS: tuple[tuple[str, str, dict[str, Any], int, tuple[int, ...]], ...] = (
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
)  # fmt: skip
STRIPS, RUNS = DOCS / "tear-strips.json", DOCS / "tearing-energy.json"


def cases() -> Iterator[tuple[str, dict[str, Any]]]:
    """All runs: the scene and its settings."""
    for scene, _, settings, middle, points in TEARS:
        for change in GRIDS.values():
            yield scene, {"points": middle, **settings, **change}
        for number in points:
            if number != middle:
                yield scene, {"points": number, **settings}
    for overload in OVERLOADS:
        yield "running_crack", {"points": 40, "overload": overload}
    for change in GRIDS.values():
        if change:
            yield "running_crack", {"points": 40, "overload": 2.0, **change}
    for horizon in (2.015, 4.15):
        yield "running_crack", {"points": 40, "overload": 2.0, "horizon": horizon}
    yield "running_crack", {"points": 80, "overload": 2.0}


def run(scene: str, settings: dict[str, Any], device: str) -> dict[str, Any]:
    """One run: its status and the values of its measures."""
    from warp_pd.__main__ import build_scene

    summary = build_scene(scene, dict(settings)).run(device=device, usd=False, pictures=False).summary
    measures = {name: found["value"] for name, found in summary["measures"].items()}
    return {"scene": scene, "settings": settings, "status": summary["status"], **measures}


def found(rows: Sequence[Mapping[str, Any]], scene: str, settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """The row of a run; empty if it has not been run."""
    return next((row for row in rows if row["scene"] == scene and row["settings"] == settings), {})


def shown(value: float | None) -> str:
    """A number in a cell."""
    return "-" if value is None else f"{value:.4g}"


def listed(numbers: Sequence[float], form: str) -> str:
    """Text like "1, 2 and 3"."""
    *first, last = (format(number, form) for number in numbers)
    return f"{', '.join(first)} and {last}"


def strips_table(strips: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lowest, mean and largest G / Gc at onset over grids and critical stretches."""
    rows = []
    for horizon, number in sorted({(strip["horizon"], strip["points"]) for strip in strips}):
        some = [strip for strip in strips if (strip["horizon"], strip["points"]) == (horizon, number)]
        cells = []
        for advance in (3, 12):
            values = [strip[f"onset_{advance}"] for strip in some if strip[f"onset_{advance}"] is not None]
            cells.append(f"{min(values):.2f}, {sum(values) / len(values):.2f}, {max(values):.2f}")
        worst = max(strip["balance"] for strip in some)
        ended = sum(strip["status"] == "finished" for strip in some)
        rows.append([f"{horizon}", f"{number}", f"{len(some)}", f"{ended}", *cells, f"{worst:.2%}".replace("%", " %")])
    head = ["horizon", "rows", "strips", "finished", "G / Gc after 3 spacings", "after 12", "worst energy balance"]
    return table(head, rows)


def tears_table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """One line a scene: what is read at all spacings and on all grids."""
    lines = []
    for scene, name, settings, middle, points in TEARS:
        by_points = [found(rows, scene, {"points": n, **settings}).get(name) for n in points]
        by_grid = [found(rows, scene, {"points": middle, **settings, **change}).get(name) for change in GRIDS.values()]
        last = math.nan
        if by_points[-1] and by_points[-2]:
            last = abs(by_points[-1] / by_points[-2] - 1.0)
        across = spread([math.nan if value is None else value for value in by_grid])
        lines.append([
            scene, name, ", ".join(f"{n}: {shown(v)}" for n, v in zip(points, by_points, strict=True)),
            f"{100 * last:.1f} %", ", ".join(shown(value) for value in by_grid), f"{100 * across:.0f} %",
        ])  # fmt: skip
    head = ["scene", "number", "points: value", "last change", f"on grids of {', '.join(GRIDS)}", "spread"]
    return table(head, lines)


def running_table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Speed and energy of running cracks."""
    lines = [
        [
            ", ".join(f"{name} {value:g}" for name, value in row["settings"].items()), shown(row["crack_speed"]),
            shown(row["released_ratio"]), f"{100 * row['worst_energy_balance']:.2f} %",
        ]
        for row in rows
        if row["scene"] == "running_crack"
    ]  # fmt: skip
    return table(["settings", "speed over wave speed", "released energy over Gc", "energy balance"], lines)


def page(strips: Mapping[str, Any], runs: Mapping[str, Any]) -> str:
    """The whole page."""
    rows = sorted(runs["runs"], key=lambda row: (row["scene"], str(row["settings"])))
    ended = sum(row["status"] == "finished" for row in rows)
    worst = max(row["worst_energy_balance"] for row in rows)
    return "\n".join([
        "# Tearing energy: prescribed and measured",
        "",
        *paragraph(page_header("tearing_energy.py", runs["device"], runs["commit"])),
        *paragraph(
            f"`TearingEnergy` takes the weight of bonds gradually, between {BEGIN} and {END} times the elongation of "
            "the critical stretch s_c that stands for the tearing energy Gc: Gc = kappa dx W(s_c), with the spacing dx "
            f"and the energy density W of pure shear. kappa is {listed(GRADUAL_WIDTHS, '.2f')} at horizons of "
            f"{listed(GRADUAL_HORIZONS, 'g')} spacings, linear in between. It was chosen so that the strips below "
            "tear at Gc on average; all other scenes are predictions."
        ),
        "## Pure shear strips",
        "",
        *paragraph(
            "`pure_shear_tear`, in which G = H W(stretch) is exact: lowest, mean and largest G / Gc when the tip has "
            "moved by 3 and by 12 spacings, over grids of 0, 15, 30, 45 degrees and jittered by 0.3 spacings, and "
            f"s_c from 1.5 to 6. Neo-Hookean, relaxed, the default step, float32; {strips['device']}, commit "
            f"{strips['commit']}."
        ),
        *strips_table(strips["strips"]),
        "",
        "## Other tears",
        "",
        *paragraph(
            "Trousers and edge notch give G / Gc by their closed forms. All others give the load at tearing, which "
            "must not depend on spacing or grid. *Spread* is (largest - smallest) / mean. The sheet of "
            "`ball_penetration` has no crack to begin with: there a tearing energy gives no strength, and a critical "
            f"stretch is the criterion to take (docs/tearing.md). {ended} of {len(rows)} runs of this page finished, "
            f"with a worst energy balance of {100 * worst:.2f} %."
        ),
        *tears_table(rows),
        "",
        "## Running cracks",
        "",
        *paragraph(
            "`running_crack`: a strip stretched until G is `overload` times Gc (2 if not given), then let go. The wave "
            "speed is that of shear waves, which no crack in plane may pass. The energy that broken bonds take grows "
            "with G: a fast tip breaks more bonds beside its path than a slow one, so that a crack far above Gc is "
            "slower than one that takes Gc alone would be."
        ),
        *running_table(rows),
        "",
        "## What does not work yet",
        "",
        *paragraph(
            "At a horizon of 2.015 the scatter over grids is twice that at 3.15. Trousers on turned and jittered "
            "grids: the tear leaves its line and is stopped by the bonds that do not break. The edge notch tears "
            "at 0.8 of its closed form: in the model, the strip of 60 points with this notch has 1.19 times the "
            "energy release rate of the closed form (by the difference of the energies of two notches), partly "
            "because a crack acts as if it were half a spacing to a spacing longer: its opening, with a half "
            "length of 12 spacings, is 7.8 % above the exact one if it was torn and 5.1 % if it was cut (horizon "
            "3.15; 4.9 and 2.7 % at 2.015). Breaking adds energy now and then, by at most 0.4 % of what it takes."
        ),
    ])  # fmt: skip


def main() -> None:
    """Run what is asked for, then write the page."""
    parser = study_parser(__doc__, device="cpu", jobs=1, only_page=False, commit=None)
    options = parser.parse_args()
    if not options.only_page:
        rows = in_processes(run, [(*case, options.device) for case in cases()], options.jobs)
        write_runs(RUNS, "runs", rows, options)
    write_page(DOCS / "tearing-energy.md", page(json.loads(STRIPS.read_text()), json.loads(RUNS.read_text())))


if __name__ == "__main__":
    run_tool(main)
