"""The bimodular and wrinkling membranes of the IM paper: its tables and curves, and Newton against relaxation.

    python tools/wrinkling.py                                   # docs/wrinkling.md at full size
    python tools/wrinkling.py --share 0.5 --only kapton strip   # half as many points along x, two sections

Every section keeps its numbers and pictures in the work folder. The page is put together from all sections there. The
two solvers of a row run one after the other in one process, with compiled kernels. Full size takes about half an hour
on two idle CPU cores, mostly for relaxation and the strip.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from study import DOCS, RUNS, paragraph, provenance, run_tool, study_parser, table, write_page

from warp_pd import Bimodular, BondBased, Fixed, Motion, Newton, Result, Sheet, Simulation
from warp_pd.__main__ import build_scene
from warp_pd.interfaces.context import find_device
from warp_pd.measures import row_at
from warp_pd.output import plots
from warp_pd.run.folder import write_atomically

RATIOS = (1.0, 5.0, 10.0, 20.0)
# The tolerance of the paper is 1e-5. A beam is soft in bending and stiff along its axis: its displacements agree only
# at a finer one.
PAPER, FINE = 1e-5, 1e-8
TENSION_STRAIN = 1e-3
# Points along x that all scenes accept.
SMALLEST = 40


class Page:
    """Runs the scenes of a section and keeps its pictures.

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
        return max(SMALLEST, multiple * max(1, round(self.share * full / multiple)))

    def run(self, scene: str, points: int, pictures: str = "", **settings: Any) -> Result:
        """Run a scene, after a tiny one that compiles its kernels; `pictures` names the folder of its pictures."""
        build_scene(scene, {"points": SMALLEST, **settings, "solver": settings.get("solver", "newton")}).run(
            device=self.device
        )
        out = self.work / pictures if pictures else None
        return build_scene(scene, {"points": points, **settings}).run(device=self.device, out=out, usd=False)

    def picture(self, folder: str, picture: str) -> str:
        """Keep a picture of a run for the page; its line there."""
        name = f"wrinkling-{folder}-{picture}"
        shutil.copy(self.work / folder / picture, self.work / name)
        return f"![{folder}: {picture[:-4]}]({name})"


def solve(result: Result) -> dict[str, Any]:
    """The report of the solver."""
    return result.summary["solve"]


def values(result: Result) -> dict[str, float]:
    """Measures of a run by name."""
    return {name: entry["value"] for name, entry in result.summary["measures"].items()}


def per_load_step(result: Result) -> list[str]:
    """Newton steps of every load step; "-" where one did not converge."""
    cells = []
    for entry in solve(result)["load_steps"]:
        cells.append(str(len(entry["lattices"][-1]["shares"])) if entry["converged"] else "-")
    return (cells + ["-"] * 10)[:10]


def largest_difference(a: Result, b: Result) -> float:
    """Of two displacements, over the largest displacement."""
    return float(np.abs(a.frame.displacement - b.frame.displacement).max() / np.abs(a.frame.displacement).max())


COMPARED = ["case", "Newton", "steps", "s a step", "s", "relaxation", "steps", "s a step", "s", "times faster"]


def comparison(label: str, newton: Result, relaxed: Result) -> list[str]:
    """A row of the table that compares the solvers."""
    cells = [label]
    for result in (newton, relaxed):
        found = solve(result)
        each = found["seconds"] / max(1, found["iterations"])
        cells += [result.status, str(found["iterations"]), f"{each:.2g}", f"{found['seconds']:.2f}"]
    return [*cells, f"{solve(relaxed)['seconds'] / solve(newton)['seconds']:.1f}"]


def bar(page: Page) -> list[str]:
    """Section 6.1."""
    from warp_pd.scenes.bimodular_bar import exact

    rows, compared, curves = [], [], []
    for ratio, colour in zip((1.0, 5.0, 10.0), ("C0", "C1", "C3"), strict=True):
        newton = page.run("bimodular_bar", page.points(200), ratio=ratio, tolerance=FINE)
        relaxed = page.run("bimodular_bar", page.points(200), ratio=ratio, tolerance=FINE, solver="relaxation")
        rows.append([
            f"{ratio:g}", f"{100 * values(newton)['displacement_error']:.3f} %", str(solve(newton)["iterations"]),
            f"{largest_difference(newton, relaxed):.1e}",
        ])  # fmt: skip
        compared.append(comparison(f"c-/c+ = {ratio:g}", newton, relaxed))
        z = newton.built.simulation.sheet.points[:, 0]
        curves += [
            (f"exact, c-/c+ = {ratio:g}", z, exact(z, ratio) - exact(z[:1], ratio), f"{colour}-"),
            ("", z, newton.frame.displacement[:, 0], f"{colour}o"),
        ]
    plots.profiles(page.work / "wrinkling-bar.png", curves, "z (m)", "displacement (m)")
    return [
        "## Bar of two moduli (6.1)",
        "",
        *paragraph(
            f"Displacement of {page.points(200)} points against the exact solution, one load step. The paper shows a "
            "curve."
        ),
        *table(["c-/c+", "error (L2)", "Newton steps", "Newton - relaxation"], rows),
        "",
        *table(COMPARED, compared),
        "",
        "![Displacement of the bar, lines exact](wrinkling-bar.png)",
    ]


def cantilever(page: Page) -> list[str]:
    """Section 6.2."""
    from warp_pd.scenes.cantilever import HEIGHT

    steps: dict[str, list[list[str]]] = {"constant": [], "tangent": []}
    compared, ends = [], []
    along: dict[int, list[Any]] = {0: [], 1: []}
    for ratio, colour in zip(RATIOS, ("C0", "C1", "C2", "C3"), strict=True):
        for stiffness, rows in steps.items():
            result = page.run(
                "cantilever",
                page.points(200),
                ratio=ratio,
                stiffness=stiffness,
                tolerance=PAPER,
                most_iterations=50,
                most_cuts=0,
            )
            rows.append([f"{ratio:g}", *per_load_step(result)])
        newton = page.run(
            "cantilever", page.points(200), pictures=f"cantilever-{ratio:g}", ratio=ratio, tolerance=page.fine
        )
        relaxed = page.run("cantilever", page.points(200), ratio=ratio, tolerance=page.fine, solver="relaxation")
        compared.append(comparison(f"c+/c- = {ratio:g}", newton, relaxed))
        ends.append([
            f"{ratio:g}", f"{values(newton)['end_down']:.4f}", f"{values(newton)['end_in']:.4f}",
            f"{largest_difference(newton, relaxed):.1e}",
        ])  # fmt: skip
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
    head = ["c+/c-", *map(str, range(1, 11))]
    return [
        "## Cantilever of two moduli (6.2)",
        "",
        'Newton steps of the ten load steps to a relative residual of 1e-5, at most 50; "-" if not reached.',
        "",
        "Constant stiffness (table 1 of the paper):",
        "",
        *table(head, steps["constant"]),
        "",
        "Tangent stiffness (table 2 of the paper):",
        "",
        *table(head, steps["tangent"]),
        "",
        *paragraph(
            f"The next table is of {page.points(200)} points along the beam: displacement of the middle of its free "
            f"end at a relative residual of {page.fine:g}. Finite elements of equal moduli give -0.7690 and -0.1867 m."
        ),
        *table(["c+/c-", "along y (m)", "along x (m)", "Newton - relaxation"], ends),
        "",
        *paragraph(
            f"Both solvers run to {page.fine:g}. The paper takes 2.31 s x about 20 against 0.01 s x 9000 to 13000, two "
            "to three times faster."
        ),
        *table(COMPARED, compared),
        "",
        "Middle line; lines are by Newton, dots by relaxation:",
        "",
        "![Displacement along x](wrinkling-cantilever-u1.png)",
        "![Displacement along y](wrinkling-cantilever-u2.png)",
        "",
        *[page.picture(f"cantilever-{ratio:g}", "deformed.png") for ratio in RATIOS],
    ]


def square(page: Page) -> list[str]:
    """Section 6.3."""
    rows = []
    for horizon, force in ((3.0, 5.0), (3.0, 0.05), (1.5, 5.0), (1.0, 5.0)):
        folder = f"square-{horizon:g}-{force:g}"
        result = page.run(
            "square_wrinkles", page.points(100), pictures=folder, horizon=horizon, pull=force, tolerance=PAPER
        )
        m = values(result)
        rows.append([
            f"{horizon:g}", f"{force:g} N", result.status, str(solve(result)["iterations"]),
            f"{m['corner_displacement']:.4f}", f"{m['mean_wrinkle_level']:.3f}", f"{m['wrinkled_share']:.3f}",
            f"{solve(result)['seconds']:.1f}",
        ])  # fmt: skip
    head = [
        "horizon", "force", "status", "Newton steps", "corner displacement (m)", "mean wrinkle level",
        "wrinkled share", "s",
    ]  # fmt: skip
    shown = ("wrinkles.png", "stress.png", "stress_directions.png", "u1.png", "u2.png")
    return [
        "## Square pulled at its corners (6.3)",
        "",
        "One load step to 1e-5; the paper took 6 steps. At the printed horizon of one spacing nothing wrinkles.",
        "",
        *table(head, rows),
        "",
        *[page.picture("square-3-5", name) for name in shown],
    ]


def kapton(page: Page) -> list[str]:
    """Section 6.4."""
    from warp_pd.scenes.kapton_shear import HEIGHT

    rows, curves = [], []
    for horizon, colour in zip((2.0, 3.0, 4.0), ("C0", "C2", "C3"), strict=True):
        result = page.run(
            "kapton_shear", page.points(380, 95), pictures=f"kapton-{horizon:g}", horizon=horizon, tolerance=PAPER
        )
        m = values(result)
        rows.append([
            f"{horizon:g}", result.status, str(solve(result)["iterations"]), f"{m['prestress'] / 1e6:.3f}",
            f"{m['middle_largest_stress'] / 1e6:.2f}", f"{m['middle_smallest_stress'] / 1e6:.2f}",
            f"{m['mean_wrinkle_level']:.3f}", f"{solve(result)['seconds']:.0f}",
        ])  # fmt: skip
        points = result.built.simulation.sheet.points
        line = row_at(points, 0.5 * HEIGHT)
        stress = result.frame.point_data["principal_stress"][line] / 1e6
        curves.append((f"largest, horizon {horizon:g}", points[line, 0], stress[:, 0], f"{colour}-"))
        curves.append((f"smallest, horizon {horizon:g}", points[line, 0], stress[:, 1], f"{colour}--"))
    plots.profiles(page.work / "wrinkling-kapton.png", curves, "x (m)", "principal stress on the middle line (MPa)")
    head = [
        "horizon", "status", "Newton steps", "prestress (MPa)", "largest (MPa)", "smallest (MPa)", "wrinkle level", "s",
    ]  # fmt: skip
    return [
        "## Sheared Kapton membrane (6.4)",
        "",
        *paragraph(
            f"{page.points(380, 95)} points along x. Prestress and shear take one load step each, to 1e-5; the paper "
            "took 16 steps for both. Stresses are means over the middle half of the middle line."
        ),
        *table(head, rows),
        "",
        "![Principal stresses on the middle line](wrinkling-kapton.png)",
        *[page.picture("kapton-3", name) for name in ("wrinkles.png", "stress.png", "stress_directions.png")],
    ]


def strip(page: Page) -> list[str]:
    """Section 6.5."""
    result = page.run("notched_strip", page.points(200, 10), pictures="strip", tolerance=PAPER)
    rows = [
        [
            f"{1e4 * row['end_displacement']:.2f}", f"{1e3 * row['load']:.3f}", f"{1e3 * row['crack_length']:.2f}",
            f"{row['mean_wrinkle_level']:.3f}", f"{row['largest_damage']:.2f}",
        ]
        for row in result.history[1:]
    ]  # fmt: skip
    found = solve(result)
    return [
        "## Notched strip (6.5)",
        "",
        *paragraph(
            f"{page.points(200, 10)} points along x; {result.summary['message'] or result.status}; "
            f"{found['iterations']} Newton steps in {len(found['load_steps'])} equilibria, {found['seconds']:.0f} s."
        ),
        *table(["Ux (1e-4 m)", "load (mN)", "crack (mm)", "mean wrinkle level", "largest damage"], rows),
        "",
        *[page.picture("strip", name) for name in ("damage.png", "wrinkles.png", "load.png")],
    ]


def tension(page: Page) -> list[str]:
    """How stiff a membrane without compressive modulus is in uniaxial tension."""
    rows = []
    for horizon in (1.5, 2.015, 3.0, 4.0):
        cells = [f"{horizon:g}"]
        for compression in (1e5, 0.0):
            result = strip_in_tension(horizon, compression).run(device=page.device)
            force = result.built.to_numpy(result.built.state.force)
            right = result.built.simulation.sheet.edges("right")
            stiffness = -force[right, 0].sum() / (1e5 * 1e-3 * 0.02 * TENSION_STRAIN)
            side = result.built.simulation.sheet.nearest(0.05, 0.02)
            contraction = -result.frame.displacement[side, 1] / (0.01 * TENSION_STRAIN)
            cells += [f"{stiffness:.3f}", f"{contraction:.2f}", result.status]
        rows.append(cells)
    return [
        "## A strip in tension, with and without compressive modulus",
        "",
        *paragraph(
            f"The strip is 0.1 x 0.02 m and has 80 x 16 points. Its ends move apart by a strain of {TENSION_STRAIN:g} "
            "and are free to contract. The table holds force over E x section x strain, and contraction over strain."
        ),
        *table(["horizon", "E- = E+: force", "contraction", "", "E- = 0: force", "contraction", ""], rows),
    ]


def strip_in_tension(horizon: float, compression: float) -> Simulation:
    """A strip whose ends move apart and may contract."""
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
    """Run the chosen sections, then put the page together."""
    parser = study_parser(
        __doc__, device="cpu", work=RUNS / "wrinkling", out=DOCS / "wrinkling.md", only_page=False, commit=None
    )
    parser.add_argument("--share", type=float, default=1.0, help="of the scenes' points along x")
    parser.add_argument("--fine", type=float, default=FINE, help="relative residual of the beam's comparison")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    page = Page(options.work, options.device, options.share, options.fine)
    for name in () if options.only_page else options.only:
        load = os.getloadavg()[0]
        title, *lines = SECTIONS[name](page)
        made = provenance(find_device(options.device).name, options.commit)
        measured = f"Measured {made}; {os.cpu_count()} CPU cores, load {load:.1f} before."
        text = "\n".join([title, "", measured, *lines, ""])
        write_atomically(options.work / f"{name}.json", json.dumps({"text": text}))
        print(f"{name} done", flush=True)
    files = [options.work / f"{name}.json" for name in SECTIONS]
    parts = [json.loads(file.read_text())["text"] for file in files if file.is_file()]
    head = paragraph(
        "Made by `tools/wrinkling.py`. [solvers.md](solvers.md) has the conclusions, [papers/im.md](papers/im.md) "
        "later runs of the cantilever, the Kapton membrane and the strip at full size and with other laws."
    )
    write_page(options.out, "\n".join(["# Bimodular and wrinkling membranes (IM)", "", *head, *parts]))
    for picture in options.work.glob("wrinkling-*.png"):
        shutil.copy(picture, options.out.with_name(picture.name))


if __name__ == "__main__":
    run_tool(main)
