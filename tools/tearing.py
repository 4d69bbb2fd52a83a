"""Do cracks know the grid, does a tear converge, does its energy balance? Runs every scene that breaks, many times.

    python tools/tearing.py --device cuda:0 --jobs 3 --out docs/tearing.md

Each scene runs on a square grid turned by 0, 15, 30 and 45 degrees against the sheet and on a jittered one, at
three horizons; then at three spacings whose points lie alike: a row on the cut at all, or at none. Runs that are
complete in the work folder are not repeated. On one H200 all of it takes about 20 minutes, on two CPU cores most of a
day: `--scenes` and `--share` make it less.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stamp import device_name, one_line, stamp

GRIDS: dict[str, dict[str, float]] = {
    "0°": {},
    "15°": {"turn": 15.0},
    "30°": {"turn": 30.0},
    "45°": {"turn": 45.0},
    "jittered": {"jitter": 0.25},
}
HORIZONS = (2.015, 3.15, 4.15)


@dataclass(frozen=True)
class Study:
    """What is asked of one scene.

    Attributes:
        scene: Its name.
        points: At which the grids are compared.
        spacings: Numbers of points for the convergence, each twice as fine, rows of points alike to the cut.
        settings: What differs from the scene's defaults, and why it may: see `notes`.
        length: Measure of the crack length.
        load: Outcome that stands for the load.
        scalar: Outcome whose convergence is reported.
        notes: For the page.
    """

    scene: str
    points: int
    spacings: tuple[int, int, int]
    settings: dict[str, float | str] = field(default_factory=dict)
    length: str = "crack_length"
    load: str = "largest_load"
    scalar: str = "largest_load"
    notes: str = ""


STUDIES = (
    Study(
        "double_notch", 60, (30, 60, 120), {"duration": 1.8, "frames": 180},
        notes="A clean cut across would be 15 mm long. On the grid of 0° a row of points lies on the line of the "
        "notches and belongs to its upper side, at every spacing.",
    ),
    Study(
        "off_plane_tear", 80, (20, 40, 80), {"speed": 8e-3, "travel": 0.075, "weights": "plain", "frames": 500},
        load="load_when_tear_begins", scalar="tear_begins",
        notes="Plain weights, for comparison with the other scenes; the scene itself takes corrected ones "
        "(docs/scenes.md). Pulled at 8 mm/s, twenty times as fast as in the scene, still slow against waves of "
        "1 m/s; to 75 mm. Load: when the tear begins, a time known to 19 ms, the interval of frames. The grid of 45° "
        "is symmetric to the cut but for a row of points on the cut, which belongs to its lower side.",
    ),
    Study(
        "precut_tear", 120, (60, 120, 240), length="crack_growth", load="largest_pull", scalar="largest_pull",
        notes="Crack length without the torn faces within 0.2 m of the middle of the pulled edge, where bonds break "
        "early; other torn patches of more than a few faces do count: a slack sheet that crumples has many.",
    ),
    Study(
        "ball_penetration", 101, (51, 101, 201), load="largest_ball_force", scalar="largest_ball_force",
        notes="101 points across the sheet and a clamp as wide as the horizon around it. A star has no direction.",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """One run and where its results are."""

    scene: str
    points: int
    horizon: float
    settings: dict[str, float | str]
    folder: Path

    def summary(self) -> dict[str, Any] | None:
        """Its summary.json, or None if it has not come to an end."""
        path = self.folder / "summary.json"
        return json.loads(path.read_text()) if path.is_file() else None

    def execute(self, device: str) -> None:
        """Run it, unless it has been run."""
        if self.summary() is not None:
            return
        command = [
            sys.executable, "-m", "warp_pd.cli", "run", self.scene, "--points", str(self.points),
            "--horizon", str(self.horizon), "--device", device, "--out", str(self.folder), "--no-usd",
            "--no-pictures", "--quiet",
        ]  # fmt: skip
        for key, value in self.settings.items():
            command += ["--set", f"{key}={value}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        print(f"{self.folder.name}: exit {done.returncode} {done.stderr.strip()[-200:]}", flush=True)

    def value(self, name: str) -> float:
        """A measure or outcome; NaN if there is none."""
        summary = self.summary()
        value = summary["measures"].get(name, {}).get("value") if summary else None
        return float("nan") if value is None else float(value)


def grid_runs(study: Study, work: Path, share: float) -> dict[tuple[float, str], Run]:
    """Runs of a scene by horizon and grid."""
    points = max(15, round(share * study.points))
    return {
        (m, grid): Run(
            study.scene, points, m, {**study.settings, **change}, work / f"{study.scene}-{points}-{m}-{grid[:-1]}"
        )
        for m in HORIZONS
        for grid, change in GRIDS.items()
    }


def spacing_runs(study: Study, work: Path, share: float) -> list[Run]:
    """Runs of a scene at its default horizon and three spacings."""
    return [
        Run(study.scene, points, 3.15, dict(study.settings), work / f"{study.scene}-{points}-spacing")
        for points in (max(15, round(share * p)) for p in study.spacings)
    ]


def spread(values: Sequence[float]) -> float:
    """(Largest - smallest) / mean."""
    known = [v for v in values if math.isfinite(v)]
    return (max(known) - min(known)) / (sum(known) / len(known)) if known and sum(known) else float("nan")


def turn_between(a: float, b: float) -> float:
    """Smallest angle between two undirected directions [degrees]."""
    return abs((a - b + 90.0) % 180.0 - 90.0)


def number(value: float, form: str) -> str:
    """The value in a cell of a table; "-" if there is none."""
    return format(value, form) if math.isfinite(value) else "-"


def grid_table(study: Study, runs: dict[tuple[float, str], Run]) -> list[str]:
    """One row a run, and one line a horizon about the spread."""
    rows = [
        "| horizon | grid | crack length (m) | direction (degrees) | along the grid | load (N) | tear begins (s) "
        "| energy balance | end |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (m, grid), run in runs.items():
        summary = run.summary()
        ended = f"{summary['status']} at {summary['time']:.3g} s" if summary else "not run"
        forms = {
            study.length: ".4g", "crack_direction": ".1f", "crack_alignment": "+.2f", study.load: ".4g",
            "tear_begins": ".4g", "worst_energy_balance": ".2%",
        }  # fmt: skip
        cells = [number(run.value(name), form).replace("%", " %") for name, form in forms.items()]
        rows.append(f"| {m} | {grid} | {' | '.join(cells)} | {ended} |")
    rows.append("")
    for m in HORIZONS:
        here = [runs[m, grid] for grid in GRIDS]
        through = [r for r in here if (r.summary() or {}).get("status") == "finished"]
        turned = [r for r in here[:-1] if r in through]
        line = (
            f"- horizon {m}: {len(through)} of {len(here)} runs finished; among them, spread of the crack length "
            f"{number(100 * spread([r.value(study.length) for r in through]), '.1f')} %, of the load "
            f"{number(100 * spread([r.value(study.load) for r in through]), '.1f')} %"
        )
        directions = [r.value("crack_direction") for r in through if math.isfinite(r.value("crack_direction"))]
        if directions:
            line += f", of the direction {max(turn_between(a, b) for a in directions for b in directions):.1f}°"
        alignment = sum(r.value("crack_alignment") for r in turned) / len(turned) if turned else float("nan")
        line += f"; mean alignment with the four square grids, that of 0° included, {number(alignment, '+.2f')}."
        rows.append(line)
    return rows


def convergence_row(study: Study, runs: list[Run]) -> str:
    """Values at three spacings, and the order that their differences show, "none" if these differ in sign or grow."""
    values = [run.value(study.scalar) for run in runs]
    first, second = values[1] - values[0], values[2] - values[1]
    order = f"{math.log2(first / second):.2f}" if first * second > 0.0 and abs(first) > abs(second) else "none"
    cells = " | ".join(f"{r.points}: {number(v, '.5g')}" for r, v in zip(runs, values, strict=True))
    return f"| {study.scene} | {study.scalar} | {cells} | {order} |"


def page(studies: Sequence[Study], work: Path, share: float, device: str, stand: str | None, remark: str) -> str:
    """The whole page as markdown."""
    summaries = [r.summary() for s in studies for r in grid_runs(s, work, share).values()]
    name = next((s["device"] for s in summaries if s), device)
    weights = " and ".join(sorted({s["weights"] for s in summaries if s})) or "no"
    lines = [
        "# Tearing: what the grid, the horizon and the spacing do to it",
        "",
        f"Made by `tools/tearing.py` {stamp(name, stand)}.",
        f"{weights.capitalize()} weights, float32. Horizons are in spacings.",
        "",
        "Crack length: half the length of the free edges that tearing made, stairs averaged out",
        "(`warp_pd/measures.py`). *Along the grid*: mean of cos 8(angle) of the crack faces to the grid; 1 along its",
        "axes and diagonals, 0 without preference. *Load*: the largest force, if nothing else is said.",
        "*Energy balance*: the largest error of",
        "external work = kinetic + strain + damping + broken bonds, at any frame, over the largest energy.",
        "",
        "Pictures: damage on the reference sheet at the end of each run. White are torn faces and those that a cut",
        "crosses; white specks are faces with a single broken bond along an edge. A patch of them smaller than four",
        "squared spacings does not count as a crack.",
        "",
        *([remark, ""] if remark else []),
    ]
    for study in studies:
        lines += [
            f"## {study.scene}",
            "",
            *([study.notes, ""] if study.notes else []),
            f"![crack paths](tearing-{study.scene}.png)",
            "",
        ]
        lines += [*grid_table(study, grid_runs(study, work, share)), ""]
    lines += [
        "## Spacing",
        "",
        "Horizon 3.15 spacings: horizon and spacing shrink together. Order: from the differences of neighbours; none",
        "where these differ in sign or grow.",
        "",
        "| scene | number | coarse | middle | fine | order |",
        "|---|---|---|---|---|---|",
        *[convergence_row(s, spacing_runs(s, work, share)) for s in studies],
        "",
    ]
    return "\n".join(lines)


def draw_paths(study: Study, runs: dict[tuple[float, str], Run], path: Path) -> None:
    """Damage on the reference sheet at the end, one row a horizon, one column a grid; nothing if frames are missing."""
    if not all((run.folder / "frames.vtkhdf").is_file() for run in runs.values()):
        return
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection

    from warp_pd.output.vtkhdf import read_frame, read_series

    figure, axes = plt.subplots(
        len(HORIZONS), len(GRIDS), figsize=(3.0 * len(GRIDS) + 1.0, 3.0 * len(HORIZONS)), layout="constrained"
    )
    for axis, ((m, grid), run) in zip(axes.flat, runs.items(), strict=True):
        axis.set(aspect="equal", title=f"horizon {m}, grid {grid}")
        axis.label_outer()
        file = run.folder / "frames.vtkhdf"
        _, points, triangles, fields = read_frame(file, read_series(file).frames - 1)
        flat = (points - fields["displacement"])[:, :2]
        values = fields["damage"][triangles].mean(axis=1)
        faces = PolyCollection(list(flat[triangles]), array=values, cmap="inferno_r", clim=(0.0, 1.0))
        axis.add_collection(faces)
        axis.autoscale_view()
    figure.supxlabel("x (m)")
    figure.supylabel("y (m)")
    figure.colorbar(faces, ax=axes, label="damage", shrink=0.6)
    figure.savefig(path, dpi=70)
    plt.close(figure)


def main() -> None:
    """Run what is missing, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--scenes", nargs="*", default=[s.scene for s in STUDIES])
    parser.add_argument("--share", type=float, default=1.0, help="share of the points along a side")
    parser.add_argument("--work", type=Path, default=Path("runs/tearing"), help="folder of the runs")
    parser.add_argument("--out", type=Path, default=Path("docs/tearing.md"), help="the page; pictures go beside it")
    parser.add_argument("--only-page", action="store_true", help="run nothing; runs that are missing say so")
    parser.add_argument("--remark", default="", help="a paragraph for the page")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    studies = [s for s in STUDIES if s.scene in options.scenes]
    runs = [
        run
        for study in studies
        for run in [
            *grid_runs(study, options.work, options.share).values(),
            *spacing_runs(study, options.work, options.share),
        ]
    ]
    if not options.only_page:
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda run: run.execute(options.device), runs))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    for study in studies:
        draw_paths(
            study, grid_runs(study, options.work, options.share), options.out.parent / f"tearing-{study.scene}.png"
        )
    options.out.write_text(page(studies, options.work, options.share, options.device, options.stand, options.remark))
    print(f"wrote {options.out}")


if __name__ == "__main__":
    one_line(main)
