"""Run the scenes of VE. Makes a page of their numbers and one picture of all of them.

python tools/visco.py --device cuda:0          docs/visco.md and docs/visco.png, at the sizes of the paper
python tools/visco.py --points 24              anywhere, minutes on two CPU cores
python tools/visco.py --only-page              from the runs in the work folder
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from identify_material import NAMES, NOISES, RATES, TABLES, identify, synthetic
from study import (
    DOCS,
    RUNS,
    at_least_one,
    devices_of,
    execute_all,
    page_header,
    paragraph,
    run_tool,
    study_parser,
    table,
    write_page,
)

from scenes import SceneCase, picture_of_all, sections

# Scene, title, picture, settings. Each run gets a number of points too.
RUNS_OF_VE: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("visco_sheet", "VE 6.1 sheet, no Prony term, stretch 4", "", {"viscous": False, "stretch": 4.0}),
    ("visco_sheet", "VE 6.1, published law", "", {"viscous": False, "stretch": 4.0, "law": "published"}),
    ("visco_sheet", "VE 6.5 sheet, 0.15 /s", "stress.png", {}),
    ("visco_sheet", "VE 6.5, published law", "", {"law": "published"}),
    ("visco_sheet", "VE 6.5 a hundred times as fast", "", {"rate": 15.0, "density": 1100.0}),
    ("visco_hole", "VE 6.2 hole, stretch 4", "displacement_x.png", {}),
    ("visco_hole", "VE 6.2 hole, stretch 4, staircase", "", {"rim": "staircase"}),
    ("visco_hole", "VE 6.2 hole, stretch 4, published law", "", {"law": "published"}),
    ("visco_hole", "VE 6.2 hole, stretch 7", "", {"stretch": 7.0, "load_steps": 24}),
    ("visco_hole", "VE 6.6 hole, 0.15 /s to 2.5", "displacement_x.png", {"viscous": True, "stretch": 2.5}),
    ("visco_hole", "VE 6.6 hole, 0.15 /s to 3", "", {"viscous": True, "stretch": 3.0}),
    ("visco_crack", "VE 6.3 crack, stretch 1.5", "displacement_x.png", {}),
    ("visco_crack", "VE 6.3 crack, stretch 1.5, published law", "", {"law": "published"}),
    ("visco_crack", "VE 6.3 crack, stretch 4", "", {"stretch": 4.0, "load_steps": 20}),
    ("visco_crack", "VE 6.7 crack, 0.15 /s to 2.5", "", {"viscous": True, "stretch": 2.5}),
    ("visco_crack", "VE 6.3 crack that runs, Gc as printed", "", {"failure": True, "energy": 6.69, "law": "published"}),
    ("visco_crack", "VE 6.3 crack that runs, published law", "damage.png", {"failure": True, "law": "published"}),
    ("visco_crack", "VE 6.3 crack that runs, stress-free law", "damage.png", {"failure": True}),
    (
        "visco_crack", "VE 6.3 crack that runs, stress-free law that resists compression", "",
        {"failure": True, "wrinkles": "resolved"},
    ),
    (
        "visco_crack", "VE 6.7 crack that runs, published law", "damage.png",
        {"failure": True, "viscous": True, "law": "published"},
    ),
    ("visco_crack", "VE 6.7 crack that runs, stress-free law", "", {"failure": True, "viscous": True}),
    ("metamaterial", "VE 6.4 inclusions, stretch 1.5", "displacement_x.png", {}),
    ("metamaterial", "VE 6.4 inclusions and crack", "displacement_y.png", {"crack": True}),
    ("metamaterial", "VE 6.8 inclusions, 0.15 /s", "", {"viscous": True}),
    ("metamaterial", "VE 6.8 inclusions and crack, 0.15 /s to 1.2", "", {"viscous": True, "crack": True}),
    (
        "metamaterial", "VE 6.4 inclusions and a crack that runs", "damage.png",
        {"crack": True, "failure": True, "law": "published"},
    ),
    ("metamaterial", "VE 6.4 inclusions and a crack that runs, stress-free law", "", {"crack": True, "failure": True}),
    (
        "metamaterial", "VE 6.8 inclusions and a crack that runs", "damage.png",
        {"crack": True, "failure": True, "viscous": True, "law": "published"},
    ),
)  # fmt: skip
# Points along a side as in the paper, where they are not 100.
PAPER_POINTS = {"metamaterial": 120}


def cases(points: int | None) -> list[SceneCase]:
    """All runs with so many points along a side; None takes those of the paper."""
    return [
        SceneCase(scene, title, picture, {"points": points or PAPER_POINTS.get(scene, 100), **settings})
        for scene, title, picture, settings in RUNS_OF_VE
    ]


def identification() -> list[str]:
    """Lines of markdown: the constants of tables 1 and 2, recovered from synthetic curves."""
    rows = []
    for name, wanted in TABLES.items():
        for noise in NOISES:
            found = identify(synthetic(wanted, RATES[name], noise))
            errors = [f"{100.0 * (f / w - 1.0):+.2f} %" for f, w in zip(found, wanted, strict=True)]
            rows.append([name, f"{100.0 * noise:g} %", *errors])
    return [
        "## Identification",
        "",
        *paragraph(
            "`tools/identify_material.py --recover` makes uniaxial curves with the constants of the tables and fits "
            "them. The table shows how far the fitted constants are off. Noise is relative to the largest stress of a "
            "curve."
        ),
        *table(["table", "noise", *NAMES], rows),
        "",
    ]


def page(chosen: list[SceneCase], work: Path, commit: str | None) -> str:
    """The numbers of all runs as markdown."""
    summaries = {case: case.summary(work) for case in chosen}
    lines = [
        "# Visco-hyperelastic sheets",
        "",
        page_header("visco.py", devices_of(summaries.values()), commit),
        "",
        *paragraph(
            "These are the scenes of VE, with the polyurea of its table 2. The docstrings of the scenes say what the "
            "paper leaves open and where its laws and numbers contradict each other. A run that diverged keeps its "
            "earlier frames."
        ),
        "![Scenes](visco.png)",
        "",
    ]
    return "\n".join(lines + sections(summaries) + identification())


def main() -> None:
    """Run what is missing, then write the page and its picture."""
    parser = study_parser(
        __doc__, device="cpu", jobs=1, work=RUNS / "visco", out=DOCS / "visco.md", only_page=False, commit=None
    )
    parser.add_argument("--points", type=at_least_one, help="along a side; by default those of the paper")
    options = parser.parse_args()
    chosen = cases(options.points)
    execute_all(chosen, options)
    write_page(options.out, page(chosen, options.work, options.commit))
    picture_of_all(options.work, options.out.with_suffix(".png"), chosen)


if __name__ == "__main__":
    run_tool(main)
