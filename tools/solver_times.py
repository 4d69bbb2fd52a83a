"""Times and iterations of the solvers at rest, as a markdown table for one device.

    python tools/solver_times.py                         # what docs/solvers.md holds
    python tools/solver_times.py --device cuda:0 --points 1001 --solvers newton --scenes pressure

Every row is one run after a small one that compiled the kernels; seconds are those of the solve, the time before
the first step (families, corrected weights) stands beside them.
"""

from __future__ import annotations

import argparse
import time

from stamp import device_name, one_line, stamp

from warp_pd.cli import build_scene


def row(scene: str, points: int, solver: str, device: str, tolerance: float) -> str:
    """One line of the table."""
    settings = {"points": points, "horizon": 2.015, "solver": solver, "tolerance": tolerance}
    build_scene(scene, {**settings, "points": 21}).run(device=device)
    begin = time.perf_counter()
    result = build_scene(scene, settings).run(device=device)
    wall = time.perf_counter() - begin
    summary = result.summary
    solve = summary["solve"]
    measure, found = next(iter(summary["measures"].items()))
    return (
        f"| {scene} | {points} | {solver} | {summary['status']} | {solve['iterations']} | {solve.get('products', '')} "
        f"| {summary['residual']:.1e} | {solve['seconds']:.2f} | {wall - solve['seconds']:.2f} "
        f"| {measure} {100.0 * found['error']:+.3f} % |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--points", type=int, nargs="+", default=[51, 101])
    parser.add_argument("--scenes", nargs="+", default=["pressure", "tension"])
    parser.add_argument("--solvers", nargs="+", default=["relaxation", "newton"])
    parser.add_argument("--tolerance", type=float, default=1e-8)
    given = parser.parse_args()
    print(f"Measured {stamp(given.device)}, horizon 2.015, tolerance {given.tolerance:g}.\n")
    print(
        "| scene | points a side | solver | status | iterations | products | residual | solve s | rest s | against FE |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for scene in given.scenes:
        for points in given.points:
            for solver in given.solvers:
                print(row(scene, points, solver, given.device, given.tolerance), flush=True)


if __name__ == "__main__":
    one_line(main)
