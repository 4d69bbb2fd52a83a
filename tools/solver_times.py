"""Times and iterations of the static solvers, as a markdown table for one device.

    python tools/solver_times.py                         # the tables of docs/solvers.md
    python tools/solver_times.py --device cuda:0 --points 1001 --solvers newton --scenes pressure
    python tools/solver_times.py --points 501 --solvers newton --scenes pressure --cloud

Every row is one run, after a small one that compiled the kernels. "Solve s" are the seconds of the solve, "other s"
those before the first step (families, corrected weights).
"""

from __future__ import annotations

import time
from dataclasses import replace

from study import build_scene, device_title, provenance, run_tool, study_parser, table, table_row, whole

from warp_pd import Result, Simulation

HEAD = [
    "scene", "points a side", "solver", "status", "iterations", "products", "residual", "solve s", "other s",
    "against FE",
]  # fmt: skip


def row(scene: str, points: int, solver: str, device: str, tolerance: float, cloud: bool) -> list[str]:
    """Cells of one line of the table."""
    settings = {"points": points, "horizon": 2.015, "solver": solver, "tolerance": tolerance}
    run(build_scene(scene, {**settings, "points": 47 if cloud else 21}), device, cloud)
    begin = time.perf_counter()
    result = run(build_scene(scene, settings), device, cloud)
    wall = time.perf_counter() - begin
    summary = result.summary
    solve = summary["solve"]
    measure, found = next(iter(summary["measures"].items()))
    error = "none" if found["error"] is None else f"{100.0 * found['error']:+.3f} %"
    return [
        scene, str(points), solver, summary["status"], str(solve["iterations"]), str(solve.get("products", "")),
        f"{summary['residual']:.1e}", f"{solve['seconds']:.2f}", f"{wall - solve['seconds']:.2f}", f"{measure} {error}",
    ]  # fmt: skip


def run(scene: Simulation, device: str, cloud: bool) -> Result:
    """Run a scene, with its lattice or as a cloud."""
    return whole((replace(scene, sheet=scene.sheet.as_cloud()) if cloud else scene).run(device=device))


def main() -> None:
    """Print the table."""
    parser = study_parser(__doc__, device="cpu")
    parser.add_argument("--points", type=int, nargs="+", default=[51, 101], help="along a side")
    parser.add_argument("--scenes", nargs="+", default=["pressure", "tension"])
    parser.add_argument("--solvers", nargs="+", default=["relaxation", "newton"])
    parser.add_argument("--tolerance", type=float, default=1e-8, help="relative residual")
    parser.add_argument("--cloud", action="store_true", help="the points of the lattice as a cloud")
    options = parser.parse_args()
    measured = provenance(device_title(options.device))
    print(f"Measured on {measured}, horizon 2.015, tolerance {options.tolerance:g}.\n")
    print(*table(HEAD, []), sep="\n")
    for scene in options.scenes:
        for points in options.points:
            for solver in options.solvers:
                cells = row(scene, points, solver, options.device, options.tolerance, options.cloud)
                print(table_row(cells), flush=True)


if __name__ == "__main__":
    run_tool(main)
