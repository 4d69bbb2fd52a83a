"""Run every scene at its full size, and put their numbers on one page and their pictures on one sheet.

    python tools/scenes.py --device cuda:0 --jobs 4        docs/scenes.md, docs/scenes.png and docs/ball.png
    python tools/scenes.py --only-page                     from runs that are there already

A few minutes on one H200, some hours on two CPU cores. Runs that are complete in the work folder are not repeated.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stamp import device_name, one_line, stamp


@dataclass(frozen=True, eq=False)
class Case:
    """A scene with some settings.

    Attributes:
        scene: Its name.
        title: For the page and the contact sheet.
        picture: Which of its pictures stands for it on the contact sheet, or "" for none.
        settings: What differs from its defaults.
    """

    scene: str
    title: str
    picture: str = ""
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the folder of its results."""
        return "-".join([self.scene, *(f"{key}={value}" for key, value in self.settings.items())])


CASES = (
    Case("tension", "BA 6.1 tension", "contraction.png", {"points": 101}),
    Case("pressure", "BA 6.2 pressure", "deflection.png", {"points": 101}),
    Case("double_notch", "BA 6.3 two notches", "damage.png"),
    Case("off_plane_load", "BA 6.4 off-plane load", "sheet.png"),
    Case("off_plane_load", "BA 6.4, plain weights", "", {"weights": "plain"}),
    Case("off_plane_load", "BA 6.4, published weights", "", {"weights": "published"}),
    Case(
        "off_plane_load", "BA 6.4, published weights, boundary force", "",
        {"weights": "published", "boundary_force": 1e16},
    ),
    Case(
        "off_plane_load", "BA 6.4, plain weights, boundary force", "", {"weights": "plain", "boundary_force": 1e16}
    ),
    Case("off_plane_load", "BA 6.4, corrected weights, horizon 2.015", "", {"horizon": 2.015}),
    Case("off_plane_tear", "BA 6.5 off-plane tear, ten times as fast", "deflection.png", {"speed": 4e-3}),
    Case("pressure_static", "NN 6.1 pressure, 20 Pa", "deflection.png"),
    Case("pressure_static", "NN 6.1 pressure, 10 Pa", "", {"pressure": 10.0}),
    Case("pressure_dynamic", "NN 6.1 sudden pressure", "deflection.png"),
    Case("out_of_plane", "NN 6.2 lifted sheet", "deflection.png"),
    Case("precut_tear", "NN 6.3 running slit", "deflection_at_end.png"),
    Case("ball_penetration", "NN 6.4 ball", "deflection.png"),
)  # fmt: skip


def execute(case: Case, work: Path, device: str) -> None:
    """Run a case, unless it has been run."""
    folder = work / case.name
    if (folder / "summary.json").is_file():
        return
    command = [
        sys.executable, "-m", "warp_pd.cli", "run", case.scene, "--device", device, "--out", str(folder), "--no-usd",
        "--quiet",
    ]  # fmt: skip
    for key, value in case.settings.items():
        command += ["--set", f"{key}={value}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    print(f"{case.name}: exit {done.returncode} {done.stderr.strip()[-200:]}", flush=True)


def page(work: Path, stand: str | None) -> str:
    """The numbers of all runs as markdown."""
    summaries = {c: read_summary(work / c.name) for c in CASES}
    devices = sorted({s["device"] for s in summaries.values() if s})
    lines = [
        "# Every scene at its full size",
        "",
        f"Made by `tools/scenes.py` {stamp(', '.join(devices), stand)}.",
        "",
        "Seconds are those of the whole run without compiling kernels, runs side by side on one device; *of* says",
        "whether a number is that of the last frame or of the whole run. The sections are those of the papers in the",
        "README.",
        "",
    ]
    return "\n".join(lines + sections(summaries))


def sections(summaries: dict[Case, dict[str, Any] | None]) -> list[str]:
    """Lines of markdown with the numbers of every run; None stands for one that was not made."""
    lines = []
    for case, summary in summaries.items():
        lines += [f"## {case.title}", ""]
        if summary is None:
            lines += ["Not run.", ""]
            continue
        settings = "".join(f" --set {key}={value}" for key, value in case.settings.items())
        lines += [
            f"`warp-pd run {case.scene}{settings}`: {summary['points']} points, horizon {summary['horizon']}, "
            f"{summary['weights']} weights, float{summary['precision']}, {summary['steps']} steps in "
            f"{summary['wall_s'] - summary['compile_s']:.1f} s (and {summary['compile_s']:.1f} s of compiling); "
            f"{summary['status']} {summary['message']}".rstrip(),
            "",
            "| number | of | value | reference | error |",
            "|---|---|---|---|---|",
        ]
        for name, m in summary["measures"].items():
            value = "none" if m["value"] is None else f"{m['value']:.5g} {m['unit'] if m['unit'] != '1' else ''}"
            known = m["reference"] is not None
            reference = f"{m['reference']:.6g} ({m['source']})" if known else ""
            error = f"{100.0 * m['error']:+.3f} %" if known and m["error"] is not None else ""
            lines.append(f"| {name} | {m['of']} | {value} | {reference} | {error} |")
        lines.append("")
    return lines


def contact_sheet(work: Path, path: Path, cases: Sequence[Case] = CASES) -> None:
    """One picture of all scenes."""
    import matplotlib.pyplot as plt

    shown = [c for c in cases if c.picture and (work / c.name / c.picture).is_file()]
    columns = 3
    rows = -(-len(shown) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(5.0 * columns, 4.2 * rows), layout="constrained")
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, case in zip(axes.flat, shown, strict=False):
        axis.imshow(plt.imread(work / case.name / case.picture))
        axis.set_title(case.title)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def ball_picture(work: Path, path: Path) -> None:
    """The picture of the ball in the README; nothing if it has not been run."""
    drawn = work / "ball_penetration" / "damage.png"
    if drawn.is_file():
        shutil.copyfile(drawn, path)


def read_summary(folder: Path) -> dict[str, Any] | None:
    """Content of a run's summary.json, or None."""
    path = folder / "summary.json"
    return json.loads(path.read_text()) if path.is_file() else None


def main() -> None:
    """Run what is missing, then write page and contact sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--work", type=Path, default=Path("runs/scenes"), help="folder of the runs")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of scenes.md and scenes.png")
    parser.add_argument("--only-page", action="store_true", help="run nothing")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    if not options.only_page:
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda case: execute(case, options.work, options.device), CASES))
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "scenes.md").write_text(page(options.work, options.stand))
    contact_sheet(options.work, options.out / "scenes.png")
    ball_picture(options.work, options.out / "ball.png")
    print(f"wrote {options.out / 'scenes.md'} and {options.out / 'scenes.png'}")


if __name__ == "__main__":
    one_line(main)
