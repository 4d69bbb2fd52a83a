"""Pure shear tear strips: does any diverge, and at which energy release rate do they tear?

    python tools/tear_strips.py --device cuda:0 --jobs 12 --out docs/tear-strips.json   # all 225, on an H200
    python tools/tear_strips.py --rows 20 --stretches 1.5 3 --grids 0 45 --horizons 3.15   # a few, on a CPU

The scene is `pure_shear_tear` with the tearing energy Gc that stands for a critical stretch. A row of the result holds
G / Gc when the tip has moved by 1, 3, 6 and 12 spacings, the worst energy balance and the status. With `--at-once`
bonds break at once at the critical stretch, instead of losing their weight gradually.
"""

from __future__ import annotations

import itertools
from typing import Any

from study import in_processes, run_tool, study_parser, write_runs

GRIDS: dict[str, dict[str, float]] = {
    "0": {}, "15": {"turn": 15.0}, "30": {"turn": 30.0}, "45": {"turn": 45.0}, "jittered": {"jitter": 0.3}
}  # fmt: skip
ADVANCES = (1, 3, 6, 12)


def main() -> None:
    """Run the strips and write their rows."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, commit=None)
    parser.add_argument("--rows", type=int, nargs="+", default=[20, 40, 80])
    parser.add_argument("--horizons", type=float, nargs="+", default=[2.015, 3.15, 4.15])
    parser.add_argument("--stretches", type=float, nargs="+", default=[1.5, 2.0, 3.0, 4.0, 6.0])
    parser.add_argument("--grids", nargs="+", default=list(GRIDS), choices=list(GRIDS))
    parser.add_argument("--materials", nargs="+", default=["neo_hookean"])
    parser.add_argument("--at-once", action="store_true", help="bonds break at once at the critical stretch")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="further arguments of the scene")
    options = parser.parse_args()
    extra = dict(item.split("=", 1) for item in options.set)
    strips = [
        {
            "points": rows,
            "horizon": m,
            "material": material,
            "critical_stretch": s,
            "gradual": not options.at_once,
            **GRIDS[grid],
            **extra,
        }
        for rows in sorted(options.rows, reverse=True)
        for material, m, grid, s in itertools.product(
            options.materials, options.horizons, options.grids, options.stretches
        )
    ]
    found = in_processes(_run, [(strip, options.device) for strip in strips], options.jobs)
    diverged = sum(row["status"] != "finished" for row in found)
    worst = max((row["balance"] for row in found if row["balance"] is not None), default=float("nan"))
    print(f"{len(found)} strips, {diverged} not finished, worst energy balance {worst:.2%}")
    if options.out is not None:
        write_runs(options.out, "strips", found, options)


def _run(settings: dict[str, Any], device: str | None) -> dict[str, Any]:
    from warp_pd.__main__ import build_scene

    scene = build_scene("pure_shear_tear", {"overload": 1.8, "duration": 6.0, "frames": 100, **settings})
    result = scene.run(device=device)
    history, spacing = result.history, scene.sheet.spacing
    onset = {
        f"onset_{n}": next((r["release_ratio"] for r in history if r["tip"] > n * spacing), None) for n in ADVANCES
    }
    measures = result.summary["measures"]
    used = {name: scene.settings[name] for name in settings}
    return {
        **used, **onset, "status": result.status, "balance": measures["worst_energy_balance"]["value"],
        "speed": measures["crack_speed"]["value"], "steps": result.summary["steps"],
        "wall_s": result.summary["wall_s"], "least_rupture": min(
            (b["rupture"] - a["rupture"] for a, b in itertools.pairwise(history)), default=0.0
        ),
    }  # fmt: skip


if __name__ == "__main__":
    run_tool(main)
