"""Run the scenes and make a page of their numbers.

    python tools/scenes.py --device cuda:0 --jobs 4        docs/scenes.md and docs/ball.png
    python tools/scenes.py --scene puncture trousers       runs these and renews their sections
    python tools/scenes.py --only-page                     from the runs in the work folder

It takes a few minutes on one H200 and some hours on two CPU cores. A section whose run is not in the work folder stays
as it is on the page. `tools/montage.py` makes the picture of all scenes, docs/scenes.png.
"""

from __future__ import annotations

import re
import shutil
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


@dataclass(frozen=True, eq=False)
class SceneCase(Case):
    """A scene with some settings.

    Attributes:
        scene: Name of the scene.
        title: For the page and the picture of all scenes.
        picture: Which of its pictures the picture of all scenes shows; "" for none.
        settings: Arguments of the scene that differ from their defaults.
    """

    scene: str
    title: str
    picture: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    draws_pictures = True


CASES = (
    SceneCase("tension", "BA 6.1 tension", "contraction.png", {"points": 101}),
    SceneCase("pressure", "BA 6.2 pressure", "deflection.png", {"points": 101}),
    SceneCase("double_notch", "BA 6.3 two notches", "damage.png"),
    SceneCase("off_plane_load", "BA 6.4 off-plane load", "sheet.png"),
    SceneCase("off_plane_load", "BA 6.4, plain weights", "", {"weights": "plain"}),
    SceneCase("off_plane_load", "BA 6.4, published weights", "", {"weights": "published"}),
    SceneCase(
        "off_plane_load", "BA 6.4, published weights, boundary force", "",
        {"weights": "published", "boundary_force": 1e16},
    ),
    SceneCase(
        "off_plane_load", "BA 6.4, plain weights, boundary force", "", {"weights": "plain", "boundary_force": 1e16}
    ),
    SceneCase("off_plane_load", "BA 6.4, corrected weights, horizon 2.015", "", {"horizon": 2.015}),
    SceneCase("off_plane_tear", "BA 6.5 off-plane tear", "deflection.png"),
    SceneCase("off_plane_tear", "BA 6.5 off-plane tear, ten times as fast", "", {"speed": 4e-3}),
    SceneCase("pressure_static", "NN 6.1 pressure, 20 Pa", "deflection.png"),
    SceneCase("pressure_static", "NN 6.1 pressure, 10 Pa", "", {"pressure": 10.0}),
    SceneCase("pressure_dynamic", "NN 6.1 sudden pressure", "deflection.png"),
    SceneCase("out_of_plane", "NN 6.2 lifted sheet", "deflection.png"),
    SceneCase("precut_tear", "NN 6.3 running slit", "deflection_at_end.png"),
    SceneCase("ball_penetration", "NN 6.4 ball", "deflection.png"),
    SceneCase("pure_shear_tear", "Pure shear, torn"),
    SceneCase("trousers", "Trousers"),
    SceneCase("edge_notch", "Notch at an edge"),
    SceneCase("running_crack", "Crack that runs along a strip"),
    SceneCase("puncture", "Ball through a slit"),
    SceneCase("bulge_test", "Bulge test"),
    SceneCase("holed_strip", "Strip with a hole"),
    SceneCase("drum", "Drum, struck", "", {"points": 31, "amplitude": 0.01, "duration": 1e-3, "frames": 10}),
    SceneCase("balloon", "Balloon", "", {"points": 10, "stretch": 1.6, "frames": 4}),
    SceneCase("balloon_burst", "Balloon that bursts", "", {"points": 16}),
    SceneCase("tube", "Tube, pulled and inflated", "", {"points": 32, "frames": 3}),
    SceneCase("glove", "Glove from an SVG file", "", {"spacing": 5e-3, "load_steps": 2}),
    SceneCase(
        "dropped_ball", "Ball dropped on a trampoline", "",
        {"points": 25, "horizon": 2.015, "duration": 0.2, "frames": 40},
    ),
    SceneCase("needle", "Needle", "", {"points": 31, "frames": 20}),
    SceneCase("folded_sheet", "Strip that folds", "", {"points": 41, "frames": 40}),
    SceneCase("two_sheets", "A sheet pulled over another one", "", {"points": 17, "frames": 20}),
)  # fmt: skip


def page(work: Path, commit: str | None, earlier: str = "") -> str:
    """The numbers of all runs as markdown; sections of the earlier page for those that do not exist."""
    summaries = {case: case.summary(work) for case in CASES}
    kept = dict(re.findall(r"^## (.*?)\n\n(.*?)\n*(?=^## |\Z)", earlier, re.DOTALL | re.MULTILINE))
    header = page_header("scenes.py", devices_of(summaries.values()), commit)
    before = re.search(r"^Made by .*$", earlier, re.MULTILINE)
    lines = [
        "# Every scene in numbers",
        "",
        before[0]
        if before and any(case.title in kept for case, found in summaries.items() if found is None)
        else header,
        "",
        *paragraph(
            "A section that names another machine was run there, small; the others are full-size runs. Seconds are "
            "those of the whole run without compilation; runs may have shared the device. The column *of* says whether "
            "a number belongs to the last frame or to the whole run. Sections are those of [the "
            "papers](papers/index.md)."
        ),
        "![All scenes, from small runs](scenes.png)",
        "",
    ]
    for case, summary in summaries.items():
        if summary is None and case.title in kept:
            lines += [f"## {case.title}", "", kept[case.title], ""]
        else:
            lines += sections({case: summary})
    return "\n".join(lines)


def sections(summaries: Mapping[SceneCase, Mapping[str, Any] | None]) -> list[str]:
    """Lines of markdown with the numbers of every run; None stands for a run that does not exist."""
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
            f"{summary['wall_s'] - summary['compile_s']:.1f} s (and {summary['compile_s']:.1f} s of compilation); "
            f"{summary['status']} {summary['message']}".rstrip()
            + f", on {summary['device']}, {summary['date'][:10]}",
            "",
            *table(
                ["number", "of", "value", "reference", "error"],
                [cells(name, measure) for name, measure in summary["measures"].items()],
            ),
            "",
        ]
    return lines


def cells(name: str, measure: Mapping[str, Any]) -> list[str]:
    """Cells of a reported number, beside its reference if it has one."""
    unit = "" if measure["unit"] == "1" else f" {measure['unit']}"
    value = "none" if measure["value"] is None else f"{measure['value']:.5g}{unit}"
    known = measure["reference"] is not None
    reference = f"{measure['reference']:.6g} ({measure['source']})" if known else ""
    error = f"{100.0 * measure['error']:+.3f} %" if known and measure["error"] is not None else ""
    return [name, measure["of"], value, reference, error]


def picture_of_all(work: Path, path: Path, cases: Sequence[SceneCase]) -> None:
    """One picture of all scenes; nothing if none has been run."""
    import matplotlib.pyplot as plt

    shown = [c for c in cases if c.picture and (work / c.name / c.picture).is_file()]
    if not shown:
        return
    columns = 3
    rows = -(-len(shown) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(5.0 * columns, 4.2 * rows), layout="constrained", squeeze=False
    )  # fmt: skip
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


def main() -> None:
    """Run what is missing, then write the page and its pictures."""
    parser = study_parser(
        __doc__, device="cpu", jobs=1, work=RUNS / "scenes", out=DOCS / "scenes.md", only_page=False, commit=None
    )
    names = sorted({case.scene for case in CASES})
    parser.add_argument("--scene", nargs="+", choices=names, default=names, help="run these alone")
    options = parser.parse_args()
    execute_all([case for case in CASES if case.scene in options.scene], options)
    earlier = options.out.read_text() if options.out.is_file() else ""
    write_page(options.out, page(options.work, options.commit, earlier))
    ball_picture(options.work, options.out.with_name("ball.png"))


if __name__ == "__main__":
    run_tool(main)
