"""Follow the energy of the scene dropped_ball over a hundred bounces, without friction.

    python tools/bouncing_ball.py                    # prints a table
    python tools/bouncing_ball.py --points 21 --duration 24

The error is the change of all energies and losses (those of the ball, of the sheet, and what contact lost) over the
energy with which the ball arrives. A bounce is a frame in which the ball is touched after one in which it is not.
"""

from __future__ import annotations

import os
from itertools import pairwise
from typing import Any

from study import in_processes, provenance, run_tool, study_parser, table

from warp_pd.interfaces.context import find_device
from warp_pd.scenes import dropped_ball

HEAD = ["precision", "step over the stable step", "bounces", "largest error", "error at the end", "lost in contact"]
PARTS = ("ball_kinetic", "ball_potential", "ball_loss", "half_step_kinetic", "strain")


def bounced(precision: int, safety: float, points: int, duration: float, device: str) -> dict[str, Any]:
    """Bounces, and errors over the energy of the ball."""
    scene = dropped_ball.build(
        points=points, horizon=2.015, diameter=0.12, duration=duration, frames=round(100 * duration), safety=safety
    )
    rows = scene.run(device=device, precision=precision).history
    totals = [sum(row[name] for name in PARTS) for row in rows]
    energy = max(row["ball_kinetic"] for row in rows)
    touched = [row["ball_force_z"] != 0.0 for row in rows]
    return {
        "precision": precision,
        "safety": safety,
        "bounces": sum(now and not before for before, now in pairwise(touched)),
        "largest": max(abs(total - totals[0]) for total in totals) / energy,
        "last": (totals[-1] - totals[0]) / energy,
        "lost": rows[-1]["ball_loss"] / energy,
    }


def main() -> None:
    """Run all cases and print the table."""
    parser = study_parser(__doc__, device="cpu", jobs=1, commit=None)
    parser.add_argument("--points", type=int, default=15, help="along a side")
    parser.add_argument("--duration", type=float, default=20.0, help="[s]; a bounce takes about 0.2 s, later ones less")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    cases = [(64, 0.25), (64, 0.15), (64, 0.1), (32, 0.15)]
    arguments = [(*case, options.points, options.duration, options.device) for case in cases]
    runs = in_processes(bounced, arguments, options.jobs)
    rows = [
        [
            f"float{run['precision']}", f"{run['safety']:g}", f"{run['bounces']}", f"{run['largest']:.1e}",
            f"{run['last']:+.1e}", f"{run['lost']:.2f}",
        ]
        for run in sorted(runs, key=lambda run: (-run["precision"], -run["safety"]))
    ]  # fmt: skip
    print(*table(HEAD, rows), sep="\n")
    measured = provenance(find_device(options.device).name, options.commit)
    print(f"\n{options.points} x {options.points} points, {options.duration:g} s, {measured}.")


if __name__ == "__main__":
    run_tool(main)
