"""Run the ball scene with several weights, horizons and dampings: which runs finish, and does their energy balance?

    python tools/ball_stability.py --out docs/ball-stability.md [--points 101] [--safety 0.1] [--device cuda:0]

Prints the table, and writes it to --out with device, date and commit. It takes minutes on a GPU and about an hour on
two CPU cores with 101 points.
"""

from study import page_header, paragraph, run_tool, study_parser, table, table_row, write_page

from warp_pd.__main__ import build_scene

# Weights, horizon over the spacing, damping [1/s].
CASES = [("plain", m, c) for m in (2.015, 3.15, 4.15) for c in (0.0, 2.0)] + [
    ("published", 3.15, c) for c in (0.0, 2.0)
]
HEAD = [
    "weights", "horizon", "damping (1/s)", "end", "time reached (s)", "steps", "step (ms)",
    "worst energy balance (%)", "torn triangles (%)", "seconds",
]  # fmt: skip


def row(
    weights: str, horizon: float, damping: float, points: int, safety: float, device: str | None
) -> tuple[list[str], str]:
    """Cells of one line of the table, and the name of the device."""
    settings = {"weights": weights, "horizon": horizon, "damping": damping, "points": points, "safety": safety}
    result = build_scene("ball_penetration", settings).run(device=device)
    s = result.summary
    worst = max(abs(r["balance_error"]) for r in result.history)
    torn = 1.0 - result.frame.intact_faces.mean()
    cells = [
        weights, f"{horizon}", f"{damping:g}", s["status"], f"{s['time']:.3g}", f"{s['steps']}", f"{1e3 * s['dt']:.3g}",
        f"{100 * worst:.2f}", f"{100 * torn:.2f}", f"{s['wall_s'] - s['compile_s']:.1f}",
    ]  # fmt: skip
    return cells, s["device"]


def main() -> None:
    """Run the cases and write the table."""
    parser = study_parser(__doc__, device=None, out=None, commit=None)
    parser.add_argument("--points", type=int, default=101, help="along a side")
    parser.add_argument("--safety", type=float, default=0.1, help="time step over the stable step")
    parser.add_argument("--only", type=int, choices=range(len(CASES)), help="one case, counted from 0")
    options = parser.parse_args()
    rows, device = [], ""
    for case in CASES if options.only is None else [CASES[options.only]]:
        cells, device = row(*case, options.points, options.safety, options.device)
        print(table_row(cells), flush=True)
        rows.append(cells)
    if options.out is not None:
        lines = [
            f"# The ball scene with {options.points} x {options.points} points",
            "",
            *paragraph(
                f"{page_header('ball_stability.py', device, options.commit)} Scene of NN 6.4, critical stretch 1.3, up "
                f"to 4 s, safety {options.safety:g}, float32."
            ),
            *table(HEAD, rows),
            "",
        ]
        write_page(options.out, "\n".join(lines))


if __name__ == "__main__":
    run_tool(main)
