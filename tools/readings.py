"""Readings that the text of BA and NN allows: which area a point on an edge has, and what a family counts.

    python tools/readings.py --device cuda:0 --points 101 --out docs/papers/readings.json     for docs/papers/ba.md
    python tools/readings.py --points 51 --out runs/readings.json                             a few minutes on a CPU

Published weights at a horizon of 3.15, beside corrected ones and the finite elements. `whole`: every point has the area
of a cell, as papers with one volume a point count. `shared`: half and quarter areas on edges and corners. `own point`:
the areas of BA eq. 39 have that of the family's own point; NN has no such fractions.
"""

from __future__ import annotations

from dataclasses import replace
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
    whole,
)

# Name, scene, measure or outcome, number that the paper prints, other settings.
EXAMPLES: tuple[tuple[str, str, str, str, dict[str, Any]], ...] = (
    ("BA 6.1, contraction", "tension", "edge_contraction", "14.06 mm", {}),
    ("BA 6.2, deflection", "pressure", "center_deflection", "16.19 mm", {}),
    ("NN 6.1, static", "pressure_static", "center_deflection", "a curve", {"force": "closed_form"}),
    ("NN 6.1, 1 s after a sudden pressure", "pressure_dynamic", "largest_deflection_at_1_s", "within 5 %",
     {"force": "closed_form"}),
)  # fmt: skip
READINGS: dict[str, dict[str, Any]] = {
    "published, whole areas": {"weights": "published", "areas": "whole"},
    "published, shared areas": {"weights": "published", "areas": "shared"},
    "whole areas, own point": {"weights": "published", "areas": "whole", "own_point": True},
    "corrected": {"weights": "corrected"},
}


def run(scene: str, name: str, settings: dict[str, Any], device: str | None) -> Row:
    """One run: its number, and how far this is from the finite elements."""
    built_from = {key: value for key, value in settings.items() if key != "own_point"}
    simulation = build_scene(scene, built_from)
    if "own_point" in settings:
        simulation = replace(simulation, force=replace(simulation.force, own_point=settings["own_point"]))
    result = whole(simulation.run(device=device, usd=False, pictures=False))
    found = result.summary["measures"][name]
    return {"scene": scene, "settings": settings, "status": result.status, **found}


def page(rows: list[Row], points: int) -> list[str]:
    """The table: an example a row, a reading a column."""
    lines = []
    for title, scene, _name, printed, further in EXAMPLES:
        cells, reference = [], "-"
        for reading in READINGS.values():
            wanted = {"points": points, "horizon": 3.15, **further, **reading}
            row = next((row for row in rows if row["scene"] == scene and row["settings"] == wanted), None)
            cells.append("-" if row is None else f"{row['value']:.5g} m, {100.0 * row['error']:+.2f} %")
            reference = reference if row is None else f"{row['reference']:.5g} m"
        lines.append([title, printed, *cells, reference])
    return table(["example", "printed", *READINGS, "finite elements"], lines)


def main() -> None:
    """Run, keep the rows, print the table."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, only_page=False, missing=False)
    parser.add_argument("--points", type=at_least_one, default=101, help="points along a side")
    options = parser.parse_args()
    rows = [] if options.out is None else load_rows(options.out)
    if not options.only_page:
        made = provenance(device_title(options.device))
        cases = [
            (scene, name, {"points": options.points, "horizon": 3.15, **further, **reading}, options.device)
            for _title, scene, name, _printed, further in EXAMPLES
            for reading in READINGS.values()
            if scene in ("tension", "pressure") or "own_point" not in reading
        ]
        if options.missing:
            known = [(row["scene"], row["settings"]) for row in rows]
            cases = [case for case in cases if (case[0], case[2]) not in known]
        for (scene, _name, settings, _device), row in in_processes(run, cases, options.jobs):
            rows = [r for r in rows if (r["scene"], r["settings"]) != (scene, settings)] + [{**row, "made": made}]
            if options.out is not None:
                save_rows(options.out, rows)
    print("\n".join(page(rows, options.points)))


if __name__ == "__main__":
    run_tool(main)
