"""The bimodular and wrinkling membranes of the IM paper: its tables and curves, Newton beside relaxation.

    python tools/wrinkling.py                                   # what docs/wrinkling.md holds, at full size
    python tools/wrinkling.py --share 0.5 --only kapton strip   # half as many points along x, two sections

Every section keeps its numbers and pictures in the work folder; the page is put together from all that are there.
Both solvers of a row run one after the other in one process, kernels compiled before. Full size takes about half an
hour on two idle CPU cores, most of it relaxation and the strip.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stamp import device_name, one_line, stamp

from warp_pd.cli import build_scene
from warp_pd.measures import row_at
from warp_pd.output import plots
from warp_pd.runner import Result

INTRODUCTION = "Made by `tools/wrinkling.py`; docs/solvers.md says what these examples taught."
RATIOS = (1.0, 5.0, 10.0, 20.0)
# The paper's tolerance is 1e-5; a beam, soft in bending and stiff along its axis, asks for more before displacements
# agree.
PAPER, FINE = 1e-5, 1e-8


class Page:
    """One section's numbers and pictures on their way to the page.

    Attributes:
        work: Folder of the runs.
        device: Where they run.
        share: Of the scenes' points along x.
        fine: Relative residual at which the solvers are compared on the beam.
    """

    def __init__(self, work: Path, device: str, share: float, fine: float) -> None:
        self.work, self.device, self.share, self.fine = work, device, share, fine

    def points(self, full: int, multiple: int = 1) -> int:
        """Share of `full` points along x, in multiples for which cells are square."""
        return max(20, multiple * max(1, round(self.share * full / multiple)))

    def run(self, scene: str, points: int, pictures: str = "", **settings: Any) -> Result:
        """Run a scene, after a tiny one that compiles its kernels; `pictures` names the folder of its pictures."""
        build_scene(scene, {"points": 20, **settings, "solver": settings.get("solver", "newton")}).run(
            device=self.device
        )
        out = self.work / pictures if pictures else None
        return build_scene(scene, {"points": points, **settings}).run(device=self.device, out=out, usd=False)

    def take(self, folder: str, picture: str) -> str:
        """Copy a scene's picture beside the page; its line there."""
        name = f"wrinkling-{folder}-{picture}"
        shutil.copy(self.work / folder / picture, self.work / name)
        return f"![{folder}: {picture[:-4]}]({name})"


def solve(result: Result) -> dict[str, Any]:
    """What the solver reports."""
    return result.summary["solve"]


def per_load_step(result: Result) -> str:
    """Newton steps of every load step; "-" where one did not converge."""
    cells = []
    for entry in solve(result)["load_steps"]:
        cells.append(str(len(entry["lattices"][-1]["shares"])) if entry["converged"] else "-")
    return " | ".join((cells + ["-"] * 10)[:10])


def largest_difference(a: Result, b: Result) -> float:
    """Of two displacements, over the largest displacement."""
    return float(np.abs(a.frame.displacement - b.frame.displacement).max() / np.abs(a.frame.displacement).max())


def comparison(label: str, newton: Result, relaxed: Result) -> str:
    """A row of the table of both solvers."""
    cells = [label]
    for result in (newton, relaxed):
        found = solve(result)
        each = found["seconds"] / max(1, found["iterations"])
        cells += [result.status, str(found["iterations"]), f"{each:.2g}", f"{found['seconds']:.2f}"]
    cells.append(f"{solve(relaxed)['seconds'] / solve(newton)['seconds']:.1f}")
    return "| " + " | ".join(cells) + " |"


COMPARED = [
    "| case | Newton | steps | s a step | s | relaxation | steps | s a step | s | times faster |",
    "|---|---|---|---|---|---|---|---|---|---|",
]


def bar(page: Page) -> list[str]:
    """Section 6.1."""
    lines, rows, compared = ["## Bar of two moduli (6.1)", ""], [], []
    curves = []
    for ratio, colour in zip((1.0, 5.0, 10.0), ("C0", "C1", "C3"), strict=True):
        newton = page.run("bimodular_bar", page.points(200), ratio=ratio, tolerance=FINE)
        relaxed = page.run("bimodular_bar", page.points(200), ratio=ratio, tolerance=FINE, solver="relaxation")
        error = newton.summary["measures"]["displacement_error"]["value"]
        rows.append(
            f"| {ratio:g} | {100 * error:.3f} % | {solve(newton)['iterations']} | "
            f"{largest_difference(newton, relaxed):.1e} |"
        )
        compared.append(comparison(f"c-/c+ = {ratio:g}", newton, relaxed))
        z = newton.built.simulation.sheet.points[:, 0]
        from warp_pd.scenes.bimodular_bar import exact

        curves += [
            (f"exact, c-/c+ = {ratio:g}", z, exact(z, ratio) - exact(z[:1], ratio), f"{colour}-"),
            ("", z, newton.frame.displacement[:, 0], f"{colour}o"),
        ]
    plots.profiles(page.work / "wrinkling-bar.png", curves, "z (m)", "displacement (m)")
    lines += [
        "Displacement of 200 points against the exact solution, one load step (the paper shows a curve).",
        "",
        "| c-/c+ | error (L2) | Newton steps | Newton - relaxation |",
        "|---|---|---|---|",
        *rows,
        "",
        *COMPARED,
        *compared,
        "",
        "![Displacement of the bar, lines exact](wrinkling-bar.png)",
    ]
    return lines


def cantilever(page: Page) -> list[str]:
    """Section 6.2."""
    from warp_pd.scenes.cantilever import HEIGHT

    tables: dict[str, list[str]] = {"constant": [], "tangent": []}
    compared, shapes = [], []
    along: dict[int, list[Any]] = {0: [], 1: []}
    for ratio, colour in zip(RATIOS, ("C0", "C1", "C2", "C3"), strict=True):
        for stiffness, table in tables.items():
            result = page.run(
                "cantilever",
                page.points(200),
                ratio=ratio,
                stiffness=stiffness,
                tolerance=PAPER,
                most_iterations=50,
                most_cuts=0,
            )
            table.append(f"| {ratio:g} | {per_load_step(result)} |")
        newton = page.run(
            "cantilever", page.points(200), pictures=f"cantilever-{ratio:g}", ratio=ratio, tolerance=page.fine
        )
        relaxed = page.run("cantilever", page.points(200), ratio=ratio, tolerance=page.fine, solver="relaxation")
        compared.append(comparison(f"c+/c- = {ratio:g}", newton, relaxed)[:-1])
        measures = newton.summary["measures"]
        shapes.append(
            f"| {ratio:g} | {measures['end_down']['value']:.4f} | {measures['end_in']['value']:.4f} | "
            f"{largest_difference(newton, relaxed):.1e} |"
        )
        points = newton.built.simulation.sheet.points
        line = row_at(points, 0.5 * HEIGHT)
        for c, curves in along.items():
            curves.append((f"Newton, c+/c- = {ratio:g}", points[line, 0], newton.frame.displacement[line, c], colour))
            curves.append(("", points[line, 0], relaxed.frame.displacement[line, c], f"{colour}o"))
    for c, curves in along.items():
        name = "xy"[c]
        plots.profiles(
            page.work / f"wrinkling-cantilever-u{c + 1}.png", curves, "x (m)", f"displacement along {name} (m)"
        )
    head = ["| c+/c- | " + " | ".join(str(k) for k in range(1, 11)) + " |", "|---" * 11 + "|"]
    return [
        "## Cantilever of two moduli (6.2)",
        "",
        'Newton steps of the ten load steps to a relative residual of 1e-5, at most 50; "-": not reached.',
        "",
        "Constant stiffness (the paper's table 1):",
        "",
        *head,
        *tables["constant"],
        "",
        "Tangent stiffness (table 2):",
        "",
        *head,
        *tables["tangent"],
        "",
        f"{page.points(200)} points along the beam. Middle of its free end, relative residual "
        f"{page.fine:g}; finite elements of equal moduli: -0.7690 and -0.1867 m.",
        "",
        "| c+/c- | along y (m) | along x (m) | Newton - relaxation |",
        "|---|---|---|---|",
        *shapes,
        "",
        f"Both solvers to {page.fine:g}. The paper: 2.31 s x about 20 against 0.01 s x 9000 to 13000, two to three",
        "times faster.",
        "",
        *COMPARED,
        *[row + "|" for row in compared],
        "",
        "Middle line, lines by Newton, dots by relaxation:",
        "",
        "![Displacement along x](wrinkling-cantilever-u1.png)",
        "![Displacement along y](wrinkling-cantilever-u2.png)",
        "",
        *[page.take(f"cantilever-{ratio:g}", "deformed.png") for ratio in RATIOS],
    ]


def square(page: Page) -> list[str]:
    """Section 6.3."""
    rows = []
    for horizon, force in ((3.0, 5.0), (3.0, 0.05), (1.5, 5.0), (1.0, 5.0)):
        folder = f"square-{horizon:g}-{force:g}"
        result = page.run(
            "square_wrinkles", page.points(100), pictures=folder, horizon=horizon, pull=force, tolerance=PAPER
        )
        m = {name: entry["value"] for name, entry in result.summary["measures"].items()}
        rows.append(
            f"| {horizon:g} | {force:g} N | {result.status} | {solve(result)['iterations']} | "
            f"{m['corner_displacement']:.4f} | {m['mean_wrinkle_level']:.3f} | {m['wrinkled_share']:.3f} | "
            f"{solve(result)['seconds']:.1f} |"
        )
    return [
        "## Square pulled at its corners (6.3)",
        "",
        "One load step to 1e-5; the paper took 6 steps. At the printed horizon of one spacing nothing wrinkles.",
        "",
        "| horizon | force | status | Newton steps | corner moves (m) | mean wrinkle level | wrinkled share | s |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
        "",
        *[
            page.take("square-3-5", name)
            for name in ("wrinkles.png", "stress.png", "stress_directions.png", "u1.png", "u2.png")
        ],
    ]


def kapton(page: Page) -> list[str]:
    """Section 6.4."""
    from warp_pd.scenes.kapton_shear import HEIGHT

    rows, curves = [], []
    for horizon, colour in zip((2.0, 3.0, 4.0), ("C0", "C2", "C3"), strict=True):
        result = page.run(
            "kapton_shear", page.points(380, 95), pictures=f"kapton-{horizon:g}", horizon=horizon, tolerance=PAPER
        )
        m = {name: entry["value"] for name, entry in result.summary["measures"].items()}
        rows.append(
            f"| {horizon:g} | {result.status} | {solve(result)['iterations']} | {m['prestress'] / 1e6:.3f} | "
            f"{m['middle_largest_stress'] / 1e6:.2f} | {m['middle_smallest_stress'] / 1e6:.2f} | "
            f"{m['mean_wrinkle_level']:.3f} | {solve(result)['seconds']:.0f} |"
        )
        points = result.built.simulation.sheet.points
        line = row_at(points, 0.5 * HEIGHT)
        stress = result.frame.point_data["principal_stress"][line] / 1e6
        curves.append((f"largest, horizon {horizon:g}", points[line, 0], stress[:, 0], f"{colour}-"))
        curves.append((f"smallest, horizon {horizon:g}", points[line, 0], stress[:, 1], f"{colour}--"))
    plots.profiles(page.work / "wrinkling-kapton.png", curves, "x (m)", "principal stress on the middle line (MPa)")
    return [
        "## Sheared Kapton membrane (6.4)",
        "",
        f"{page.points(380, 95)} points along x, prestress and shear in one load step each, to 1e-5; the",
        "paper took 16 steps for both. Stresses are means over the middle half of the middle line.",
        "",
        "| horizon | status | Newton steps | prestress (MPa) | largest (MPa) | smallest (MPa) | wrinkle level | s |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
        "",
        "![Principal stresses on the middle line](wrinkling-kapton.png)",
        *[page.take("kapton-3", name) for name in ("wrinkles.png", "stress.png", "stress_directions.png")],
    ]


def strip(page: Page) -> list[str]:
    """Section 6.5, and what a membrane of this law does in plain tension."""
    result = page.run("notched_strip", page.points(200, 10), pictures="strip", tolerance=PAPER)
    rows = [
        f"| {1e4 * row['end_displacement']:.2f} | {1e3 * row['load']:.3f} | {1e3 * row['crack_length']:.2f} | "
        f"{row['mean_wrinkle_level']:.3f} | {row['largest_damage']:.2f} |"
        for row in result.history[1:]
    ]
    found = solve(result)
    return [
        "## Notched strip (6.5)",
        "",
        f"{page.points(200, 10)} points along x; {result.summary['message'] or result.status};",
        f"{found['iterations']} Newton steps in {len(found['load_steps'])} equilibria, {found['seconds']:.0f} s.",
        "",
        "| Ux (1e-4 m) | load (mN) | crack (mm) | mean wrinkle level | largest damage |",
        "|---|---|---|---|---|",
        *rows,
        "",
        *[page.take("strip", name) for name in ("damage.png", "wrinkles.png", "load.png")],
    ]


def tension(page: Page) -> list[str]:
    """How stiff a membrane without compressive modulus is in uniaxial tension."""
    rows = []
    for horizon in (1.5, 2.015, 3.0, 4.0):
        cells = []
        for compression in (1e5, 0.0):
            result = strip_in_tension(horizon, compression).run(device=page.device)
            force = result.built.to_numpy(result.built.state.force)
            right = result.built.simulation.sheet.edges("right")
            stiffness = -force[right, 0].sum() / (1e5 * 1e-3 * 0.02 * TENSION_STRAIN)
            sides = result.built.simulation.sheet.nearest(0.05, 0.02)
            narrower = -result.frame.displacement[sides, 1] / (0.01 * TENSION_STRAIN)
            cells.append(f"{stiffness:.3f} | {narrower:.2f} | {result.status}")
        rows.append(f"| {horizon:g} | " + " | ".join(cells) + " |")
    return [
        "## A strip in tension, with and without compressive modulus",
        "",
        f"0.1 x 0.02 m, 80 x 16 points, ends moved apart by a strain of {TENSION_STRAIN:g} and free to contract: force "
        "over E x section x strain, and contraction over strain.",
        "",
        "| horizon | E- = E+: force | contraction | | E- = 0: force | contraction | |",
        "|---|---|---|---|---|---|---|",
        *rows,
    ]


TENSION_STRAIN = 1e-3


def strip_in_tension(horizon: float, compression: float) -> Any:
    """A strip whose ends move apart and may contract."""
    from warp_pd import Bimodular, BondBased, Fixed, Motion, Newton, Sheet, Simulation

    sheet = Sheet.rectangle(0.1, 0.02, thickness=1e-3, density=1000.0, points=(80, 16), centred=True)
    left, right = sheet.edges("left"), sheet.edges("right")
    travel = TENSION_STRAIN * (0.1 - sheet.spacing)
    middles = [sheet.nearest(x, 0.01) for x in (0.0, 0.1)]
    return Simulation(
        sheet,
        BondBased(Bimodular(1e5, compression), horizon=horizon),
        Newton(tolerance=1e-6, most_iterations=100),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(middles, "y"),
            Fixed(left, "x"),
            Motion(right, [0.0, 1.0], x=[0.0, travel]),
        ],
    )


SECTIONS: dict[str, Callable[[Page], list[str]]] = {
    "bar": bar, "cantilever": cantilever, "square": square, "kapton": kapton, "strip": strip, "tension": tension,
}  # fmt: skip


def main() -> None:
    """Run the sections asked for, then put the page together."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--share", type=float, default=1.0, help="of the scenes' points along x")
    parser.add_argument("--fine", type=float, default=FINE, help="relative residual of the beam's comparison")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    parser.add_argument("--work", type=Path, default=Path("runs/wrinkling"), help="folder of the runs")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of wrinkling.md and its pictures")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    for name in given.only:
        page = Page(given.work, given.device, given.share, given.fine)
        before = os.getloadavg()[0]
        lines = SECTIONS[name](page)
        where = f"Measured {stamp(given.device, given.stand)}; {os.cpu_count()} CPU cores, load {before:.1f} before."
        text = "\n".join([lines[0], "", where, *lines[1:], ""])
        (given.work / f"{name}.json").write_text(json.dumps({"text": text}))
        print(f"{name} done", flush=True)
    parts = [
        json.loads((given.work / f"{name}.json").read_text())["text"]
        for name in SECTIONS
        if (given.work / f"{name}.json").is_file()
    ]
    given.out.mkdir(parents=True, exist_ok=True)
    head = f"# Bimodular and wrinkling membranes (IM)\n\n{INTRODUCTION}\n"
    (given.out / "wrinkling.md").write_text("\n".join([head, *parts]))
    for picture in given.work.glob("wrinkling-*.png"):
        shutil.copy(picture, given.out / picture.name)
    print(f"wrote {given.out / 'wrinkling.md'}")


if __name__ == "__main__":
    one_line(main)
