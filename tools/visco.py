"""Run the scenes of VE, and put their numbers on docs/visco.md and their pictures on docs/visco.png.

    python tools/visco.py --device cuda:0          at the paper's sizes; runs write no USD, so usd-core is not needed
    python tools/visco.py --points 24              anywhere, minutes on two CPU cores
    python tools/visco.py --only-page              from runs that are there already

Runs that are complete in the work folder are not repeated.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import identify_material
from stamp import device_name, one_line, stamp

from scenes import Case, contact_sheet, execute, read_summary, sections

# Scene, title, picture, settings; a size is added to each.
RUNS: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("visco_sheet", "VE 6.1 sheet, no Prony term, stretch 4", "", {"viscous": False, "stretch": 4.0}),
    ("visco_sheet", "VE 6.1, published law", "", {"viscous": False, "stretch": 4.0, "law": "published"}),
    ("visco_sheet", "VE 6.5 sheet, 0.15 /s", "stress.png", {}),
    ("visco_sheet", "VE 6.5, published law", "", {"law": "published"}),
    ("visco_sheet", "VE 6.5 a hundred times as fast", "", {"rate": 15.0, "density": 1100.0}),
    ("visco_hole", "VE 6.2 hole, stretch 4", "displacement_x.png", {}),
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
    ("visco_crack", "VE 6.3 crack that runs, stress-free law", "", {"failure": True}),
    (
        "visco_crack", "VE 6.7 crack that runs, published law", "damage.png",
        {"failure": True, "viscous": True, "law": "published"},
    ),
    ("metamaterial", "VE 6.4 inclusions, stretch 1.5", "displacement_x.png", {}),
    ("metamaterial", "VE 6.4 inclusions and crack", "displacement_y.png", {"crack": True}),
    ("metamaterial", "VE 6.8 inclusions, 0.15 /s", "", {"viscous": True}),
    ("metamaterial", "VE 6.8 inclusions and crack, 0.15 /s to 1.2", "", {"viscous": True, "crack": True}),
    (
        "metamaterial", "VE 6.4 inclusions and a crack that runs", "damage.png",
        {"crack": True, "failure": True, "law": "published"},
    ),
)  # fmt: skip
PAPER = {"metamaterial": 120}


def cases(points: int | None) -> list[Case]:
    """All runs at a size, or at the paper's."""
    return [
        Case(scene, title, picture, {"points": points or PAPER.get(scene, 100), **settings})
        for scene, title, picture, settings in RUNS
    ]


def identification() -> list[str]:
    """Lines of markdown: constants of tables 1 and 2, recovered from curves made with them."""
    lines = ["## Identification", "", "Differences from the tables, of constants found from uniaxial curves"]
    lines += ["made with them (`tools/identify_material.py --recover`); noise over the largest stress of a curve.", ""]
    lines += ["| table | noise | " + " | ".join(identify_material.NAMES) + " |", "|---" * 8 + "|"]
    for name, wanted in identify_material.TABLES.items():
        for noise in (0.0, 0.002, 0.01):
            found = identify_material.identify(identify_material.made(wanted, identify_material.RATES[name], noise))
            off = " | ".join(f"{100.0 * (f / w - 1.0):+.2f} %" for f, w in zip(found, wanted, strict=True))
            lines.append(f"| {name} | {100.0 * noise:g} % | {off} |")
    return [*lines, ""]


def page(chosen: list[Case], work: Path, stand: str | None) -> str:
    """The numbers of all runs as markdown."""
    summaries = {c: read_summary(work / c.name) for c in chosen}
    devices = sorted({s["device"] for s in summaries.values() if s})
    lines = [
        "# Visco-hyperelastic sheets",
        "",
        f"Made by `tools/visco.py` {stamp(', '.join(devices), stand)}.",
        "",
        "The scenes of VE, polyurea of its table 2. What its laws and numbers leave open, and where they do not fit",
        "together, is said in the scenes' docstrings. A run that ends as diverged keeps its frames before.",
        "",
        "![Scenes](visco.png)",
        "",
    ]
    return "\n".join(lines + sections(summaries) + identification())


def main() -> None:
    """Run what is missing, then write page and picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--points", type=int, help="points along a side, by default the paper's")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--work", type=Path, default=Path("runs/visco"), help="folder of the runs")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of visco.md and visco.png")
    parser.add_argument("--only-page", action="store_true", help="run nothing")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    chosen = cases(options.points)
    if not options.only_page:
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda case: execute(case, options.work, options.device), chosen))
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "visco.md").write_text(page(chosen, options.work, options.stand))
    contact_sheet(options.work, options.out / "visco.png", chosen)
    print(f"wrote {options.out / 'visco.md'}")


if __name__ == "__main__":
    one_line(main)
