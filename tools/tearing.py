"""Study how the grid, the horizon and the spacing affect tears, and whether the energy of tears balances.

    python tools/tearing.py --device cuda:0 --jobs 3 --out docs/tearing.md

Each scene that tears runs at three horizons on a square grid turned by 0, 15, 30 and 45 degrees against the sheet, and
on a jittered one. Then it runs at three spacings whose points lie alike to the cut: each of them has a row of points on
the cut, or none has. On one H200 all of it takes about 20 minutes, on two CPU cores most of a day. `--scenes` and
`--share` make it less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from study import (
    DOCS,
    RUNS,
    Case,
    devices_of,
    execute_all,
    page_header,
    paragraph,
    run_tool,
    study_parser,
    table,
    write_page,
)

GRIDS: dict[str, dict[str, float]] = {
    "0°": {},
    "15°": {"turn": 15.0},
    "30°": {"turn": 30.0},
    "45°": {"turn": 45.0},
    "jittered": {"jitter": 0.25},
}
HORIZONS = (2.015, 3.15, 4.15)
HEAD = [
    "horizon", "grid", "crack length (m)", "direction (degrees)", "along the grid", "load (N)", "tear begins (s)",
    "energy balance", "end",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Study:
    """How one scene is studied.

    Attributes:
        scene: Its name.
        points: Along a side, where grids are compared.
        spacings: Numbers of points for the convergence, each twice as fine, with points that lie alike to the cut.
        settings: What differs from the defaults of the scene; `notes` say why.
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
        "notches, at every spacing. It belongs to the upper side.",
    ),
    Study(
        "off_plane_tear", 80, (20, 40, 80), {"speed": 8e-3, "travel": 0.075, "weights": "plain", "frames": 500},
        load="load_when_tear_begins", scalar="tear_begins",
        notes="Plain weights, for comparison with the other scenes; the scene itself takes corrected weights "
        "(docs/scenes.md). The sheet is pulled to 75 mm at 8 mm/s. This is twenty times as fast as in the scene, but "
        "still slow against waves of 1 m/s. The load is that at the beginning of the tear. This time is known to 19 "
        "ms, the interval of frames. The grid of 45° is symmetric to the cut except for a row of points on the cut, "
        "which belongs to its lower side.",
    ),
    Study(
        "precut_tear", 120, (60, 120, 240), length="crack_growth", load="largest_pull", scalar="largest_pull",
        notes="The crack length leaves out torn faces within 0.2 m of the middle of the pulled edge, where bonds break "
        "early. Other torn patches of more than a few faces count; a slack sheet that crumples has many.",
    ),
    Study(
        "ball_penetration", 101, (51, 101, 201), load="largest_ball_force", scalar="largest_ball_force",
        notes="There are 101 points across the sheet. The clamp around it is as wide as the horizon. A star-shaped "
        "tear has no direction.",
    ),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class TearCase(Case):
    """One run.

    Attributes:
        scene: Name of the scene.
        settings: Arguments of the scene that differ from their defaults.
        folder: Name of the folder of its results.
        work: Folder of all runs.
    """

    scene: str
    settings: Mapping[str, Any]
    folder: str
    work: Path

    @property
    def name(self) -> str:
        """Name of the folder of its results."""
        return self.folder

    @property
    def points(self) -> int:
        """Along a side."""
        return int(self.settings["points"])

    def found(self) -> dict[str, Any] | None:
        """Its summary, or None if it has not been run."""
        return self.summary(self.work)

    def value(self, name: str) -> float:
        """A measure or outcome; NaN if there is none."""
        summary = self.found()
        value = summary["measures"].get(name, {}).get("value") if summary else None
        return float("nan") if value is None else float(value)


def grid_runs(study: Study, work: Path, share: float) -> dict[tuple[float, str], TearCase]:
    """Runs of a scene by horizon and grid."""
    points = max(15, round(share * study.points))
    return {
        (m, grid): TearCase(
            study.scene, {"points": points, "horizon": m, **study.settings, **change},
            f"{study.scene}-{points}-{m}-{grid.rstrip('°')}", work,
        )
        for m in HORIZONS
        for grid, change in GRIDS.items()
    }  # fmt: skip


def spacing_runs(study: Study, work: Path, share: float) -> list[TearCase]:
    """Runs of a scene at three spacings, with its default horizon."""
    return [
        TearCase(
            study.scene, {"points": points, "horizon": 3.15, **study.settings}, f"{study.scene}-{points}-spacing", work
        )
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


def grid_table(study: Study, runs: Mapping[tuple[float, str], TearCase]) -> list[str]:
    """One row per run, and below the table a line per horizon about the spread."""
    forms = {
        study.length: ".4g", "crack_direction": ".1f", "crack_alignment": "+.2f", study.load: ".4g",
        "tear_begins": ".4g", "worst_energy_balance": ".2%",
    }  # fmt: skip
    rows = []
    for (m, grid), run in runs.items():
        summary = run.found()
        end = f"{summary['status']} at {summary['time']:.3g} s" if summary else "not run"
        cells = [number(run.value(name), form).replace("%", " %") for name, form in forms.items()]
        rows.append([f"{m}", grid, *cells, end])
    return [*table(HEAD, rows), "", *(spread_line(study, m, [runs[m, grid] for grid in GRIDS]) for m in HORIZONS)]


def spread_line(study: Study, horizon: float, runs: Sequence[TearCase]) -> str:
    """How far the grids of one horizon differ; the jittered one is the last of the runs."""
    finished = [r for r in runs if (r.found() or {}).get("status") == "finished"]
    lengths, loads = ([r.value(name) for r in finished] for name in (study.length, study.load))
    line = (
        f"- Horizon {horizon}: {len(finished)} of {len(runs)} runs finished. Their crack lengths spread by "
        f"{number(100 * spread(lengths), '.1f')} %, their loads by {number(100 * spread(loads), '.1f')} %"
    )
    directions = [r.value("crack_direction") for r in finished if math.isfinite(r.value("crack_direction"))]
    if directions:
        line += f", their directions by {max(turn_between(a, b) for a in directions for b in directions):.1f}°"
    square = [r for r in runs[:-1] if r in finished]
    alignment = sum(r.value("crack_alignment") for r in square) / len(square) if square else float("nan")
    return f"{line}. Mean alignment with the four square grids: {number(alignment, '+.2f')}."


def convergence_row(study: Study, runs: Sequence[TearCase]) -> list[str]:
    """Cells: values at three spacings, and the order of their differences, "none" if these change sign or grow."""
    values = [run.value(study.scalar) for run in runs]
    first, second = values[1] - values[0], values[2] - values[1]
    order = f"{math.log2(first / second):.2f}" if first * second > 0.0 and abs(first) > abs(second) else "none"
    shown = [f"{r.points}: {number(v, '.5g')}" for r, v in zip(runs, values, strict=True)]
    return [study.scene, study.scalar, *shown, order]


def page(
    studies: Sequence[Study],
    work: Path,
    share: float,
    device: str,
    commit: str | None,
    remark: str,
    drawn: Sequence[Study] = (),
) -> str:
    """The whole page as markdown; `drawn` are the studies with a picture."""
    summaries = [run.found() for study in studies for run in grid_runs(study, work, share).values()]
    weights = " and ".join(sorted({s["weights"] for s in summaries if s})) or "no"
    header = page_header("tearing.py", devices_of(summaries, device), commit)
    lines = [
        "# Tearing: effects of grid, horizon and spacing",
        "",
        *paragraph(f"{header} {weights.capitalize()} weights, float32. Horizons are in spacings."),
        *paragraph(
            "*Crack length* is half the length of the free edges that tearing made, with the stairs smoothed "
            "(`warp_pd/measures.py`). *Along the grid* is the mean of cos 8(angle) between the crack faces and the "
            "grid: 1 along its axes and diagonals, 0 without a preferred direction. *Load* is the largest force unless "
            "the text says otherwise. *Energy balance* is the largest error at any frame of external work = kinetic + "
            "strain + damping + broken bonds, over the largest energy."
        ),
        *paragraph(
            "Pictures, if the frames of all runs were at hand, show the damage on the reference sheet at the end of "
            "each run. Torn faces and those that a cut crosses are white. White specks are faces with a single broken "
            "bond along an edge. A patch of them smaller than four squared spacings does not count as a crack."
        ),
        *(paragraph(remark) if remark else []),
    ]
    for study in studies:
        lines += [f"## {study.scene}", ""]
        lines += paragraph(study.notes) if study.notes else []
        if study in drawn:
            lines += [f"![crack paths](tearing-{study.scene}.png)", ""]
        lines += [*grid_table(study, grid_runs(study, work, share)), ""]
    lines += [
        "## Spacing",
        "",
        *paragraph(
            "The horizon is 3.15 spacings, so horizon and spacing shrink together. The order follows from the "
            "differences of neighbours. There is none where these change sign or grow."
        ),
        *table(
            ["scene", "number", "coarse", "middle", "fine", "order"],
            [convergence_row(study, spacing_runs(study, work, share)) for study in studies],
        ),
        "",
    ]
    return "\n".join(lines)


def draw_paths(runs: Mapping[tuple[float, str], TearCase], path: Path) -> bool:
    """Damage on the reference sheet at the end, a row per horizon, a column per grid.

    Returns:
        Whether it was drawn; not without all frames.
    """
    files = {key: run.work / run.name / "frames.vtkhdf" for key, run in runs.items()}
    if not all(file.is_file() for file in files.values()):
        return False
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection

    from warp_pd.output.vtkhdf import read_frame, read_series

    figure, axes = plt.subplots(
        len(HORIZONS), len(GRIDS), figsize=(3.0 * len(GRIDS) + 1.0, 3.0 * len(HORIZONS)), layout="constrained"
    )
    for axis, ((m, grid), file) in zip(axes.flat, files.items(), strict=True):
        axis.set(aspect="equal", title=f"horizon {m}, grid {grid}")
        axis.label_outer()
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
    return True


def main() -> None:
    """Run what is missing, then write the page."""
    parser = study_parser(
        __doc__, device="cpu", jobs=1, work=RUNS / "tearing", out=DOCS / "tearing.md", only_page=False, commit=None
    )
    names = [study.scene for study in STUDIES]
    parser.add_argument("--scenes", nargs="*", default=names, choices=names)
    parser.add_argument("--share", type=float, default=1.0, help="share of the points along a side")
    parser.add_argument("--remark", default="", help="a paragraph for the page")
    options = parser.parse_args()
    studies = [study for study in STUDIES if study.scene in options.scenes]
    grids = {study: grid_runs(study, options.work, options.share) for study in studies}
    runs = [
        run for study in studies for run in [*grids[study].values(), *spacing_runs(study, options.work, options.share)]
    ]
    execute_all(runs, options)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    drawn = [s for s in studies if draw_paths(grids[s], options.out.parent / f"tearing-{s.scene}.png")]
    text = page(studies, options.work, options.share, options.device, options.commit, options.remark, drawn)
    write_page(options.out, text)


if __name__ == "__main__":
    run_tool(main)
