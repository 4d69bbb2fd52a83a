"""The ball scene over horizons, damping and weights: does it run to its end, and how well does its energy balance?

    python tools/ball_stability.py --out docs/ball-stability.md [--points 101] [--safety 0.1] [--device cuda:0]

Writes a table with device, date and commit. Minutes on a GPU, about an hour on two CPU cores at 101 points.
"""

from pathlib import Path

import click
from stamp import one_line, stamp

from warp_pd.cli import build_scene

CASES = [("plain", m, c) for m in (2.015, 3.15, 4.15) for c in (0.0, 2.0)] + [
    ("published", 3.15, c) for c in (0.0, 2.0)
]


def row(
    weights: str, horizon: float, damping: float, points: int, safety: float, device: str | None
) -> tuple[str, str]:
    """One line of the table, and the name of the device."""
    settings = {"weights": weights, "horizon": horizon, "damping": damping, "points": points, "safety": safety}
    result = build_scene("ball_penetration", settings).run(device=device)
    s = result.summary
    worst = max(abs(r["balance_error"]) for r in result.history)
    torn = 1.0 - result.frame.intact_faces.mean()
    line = (
        f"| {weights} | {horizon} | {damping:g} | {s['status']} | {s['time']:.3g} | {s['steps']} | {1e3 * s['dt']:.3g} | "  # noqa: E501
        f"{100 * worst:.2f} | {100 * torn:.2f} | {s['wall_s'] - s['compile_s']:.1f} |"
    )
    return line, s["device"]


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="File of the table; by default it is only printed.")
@click.option("--points", default=101, show_default=True)
@click.option("--safety", default=0.1, show_default=True)
@click.option("--device", default=None)
@click.option("--only", default=None, help="Run one case, counted from 0.", type=int)
@click.option("--commit", "stand", default=None, help="Commit to name, where there is no repository.")
def main(out: Path | None, points: int, safety: float, device: str | None, only: int | None, stand: str | None) -> None:
    """Run the cases and write the table."""
    lines, name = [], "none"
    for case in CASES if only is None else [CASES[only]]:
        line, name = row(*case, points, safety, device)
        click.echo(line)
        lines.append(line)
    head = (
        f"# The ball scene at {points} x {points} points\n\n"
        f"`tools/ball_stability.py --points {points} --safety {safety}`, float32, "
        f"{stamp(name, stand)}. Scene: NN 6.4, critical stretch 1.3, to 4 s.\n\n"
        "| weights | horizon | damping (1/s) | end | time reached (s) | steps | step (ms) | "
        "worst energy balance (%) | torn triangles (%) | seconds |\n|---|---|---|---|---|---|---|---|---|---|\n"
    )
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(head + "\n".join(lines) + "\n")


if __name__ == "__main__":
    one_line(main)
