"""What a law made for one mode of loading costs: HE chapter 5 with the laws of bonds and the bond-associated one.

    python tools/stretch.py --device cuda:0 --jobs 4 --out docs/stretch.md
    python tools/stretch.py --points 40 --only-page

Runs the scene `stretch` whole, with a hole, a crack and an inclusion, in each mode, by each law, and with the published
law of the other modes; then writes the page and its pictures. Runs that are complete in the work folder are not
repeated. Full size is 100 points along a side and, uniaxial at a horizon of 9.015, 50: some minutes on one H200, hours
on two CPU cores, where 40 points take a quarter of an hour.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stamp import device_name, one_line, stamp

from warp_pd.bond_neo_hookean import MODES, BondNeoHookean, exact_traction, traction
from warp_pd.cli import load_scene
from warp_pd.runner import read_history

LAWS = {
    "bond_based": "published",
    "bond_based_refitted": "refitted",
    "bond_associated": "bond-associated",
}
DEFECTS = ("none", "hole", "crack", "inclusion")
STRETCHES = (1.5, 2.0, 2.5, 3.0)
FINITE_ELEMENTS = Path(__file__).parents[1] / "tests" / "validation" / "data" / "stretch_hole.npz"


@dataclass(frozen=True)
class Case:
    """One run of the scene.

    Attributes:
        mode: How the sheet is loaded.
        defect: What is in its middle.
        force: Force law.
        law: Mode that the law is made for, if another one.
        points: Along a side.
    """

    mode: str
    defect: str
    force: str
    points: int
    law: str = "auto"

    @property
    def name(self) -> str:
        """Name of the folder of its results."""
        return f"{self.mode}-{self.defect}-{self.force}-{self.law}-{self.points}"

    @property
    def label(self) -> str:
        """The law in words."""
        return LAWS[self.force] + ("" if self.law == "auto" else f", {self.law} law")

    @property
    def stretch(self) -> float:
        """The last one: a sheet without defect, whose exact force is known, goes further."""
        return 4.0 if self.defect == "none" else 3.0


def cases(points: int, defects: tuple[str, ...]) -> list[Case]:
    """All runs, the quick ones first."""
    found = []
    for mode in MODES:
        here = points if mode != "uniaxial" else max(30, points // 2)
        for defect in defects:
            found += [Case(mode, defect, force, here) for force in LAWS]
            if defect in ("none", "hole"):
                found += [Case(mode, defect, "bond_based", here, law) for law in MODES if law != mode]
    return sorted(found, key=lambda case: case.mode == "uniaxial")


def execute(case: Case, work: Path, device: str) -> None:
    """Run a case, unless it has been run."""
    folder = work / case.name
    if (folder / "summary.json").is_file():
        return
    command = [
        sys.executable, "-m", "warp_pd.cli", "run", "stretch", "--points", str(case.points), "--force", case.force,
        "--set", f"mode={case.mode}", "--set", f"defect={case.defect}", "--set", f"law={case.law}",
        "--set", f"stretch={case.stretch}", "--device", device, "--out", str(folder), "--no-usd", "--no-pictures",
        "--quiet",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    print(f"{case.name}: exit {done.returncode} {done.stderr.strip()[-200:]}", flush=True)


def summary(case: Case, work: Path) -> dict[str, Any] | None:
    """Its summary.json, or None if it has not come to an end."""
    path = work / case.name / "summary.json"
    return json.loads(path.read_text()) if path.is_file() else None


def forces(case: Case, work: Path, column: str = "edge_force") -> dict[float, float]:
    """A column of its history by stretch; empty if it has not been run."""
    if summary(case, work) is None:
        return {}
    rows = read_history(work / case.name / "history.csv")
    return {round(row["stretch"], 6): row[column] for row in rows}


def wanted(case: Case, work: Path, stretch: float) -> float | None:
    """Force on an edge [N] that the case is compared with.

    Exact without a defect, finite elements with a hole; without either, the bond-associated law.
    """
    scene = load_scene("stretch")
    known = scene.reference(case.mode, case.defect, "roller", stretch)[0]
    if known is not None:
        return float(known)
    other = Case(case.mode, case.defect, "bond_associated", case.points)
    return None if other == case else forces(other, work).get(stretch)


def error(case: Case, work: Path, stretch: float) -> str:
    """The relative error in a cell of a table; "-" if there is none."""
    reference, found = wanted(case, work, stretch), forces(case, work).get(stretch)
    return "-" if reference is None or found is None else f"{100.0 * (found / reference - 1.0):+.2f} %"


def cost_table(everything: list[Case], work: Path) -> list[str]:
    """Errors of the edge force, whole and with a hole, of every law in every mode."""
    lines = [
        "| mode | defect | law | " + " | ".join(f"{s:g}" for s in STRETCHES) + " | displacement | end |",
        "|---|---|---|" + "---|" * (len(STRETCHES) + 2),
    ]
    for defect in ("none", "hole"):
        for mode in MODES:
            for case in (c for c in everything if c.mode == mode and c.defect == defect):
                run = summary(case, work)
                end = "not run" if run is None else run["status"]
                cells = " | ".join(error(case, work, s) for s in STRETCHES)
                off = displacement_error(case, work)
                lines.append(f"| {mode} | {defect} | {case.label} | {cells} | {off} | {end} |")
    return lines


def hole_area_error(points: int) -> float:
    """Area of the points that the hole takes from a sheet of bonds over that of the circle, minus 1."""
    scene = load_scene("stretch")
    whole = scene.whole_sheet(points, 1.0, "uniaxial", True)
    taken = whole.size - scene.with_defect(whole, "hole", True).size
    return float(taken * whole.areas[0] / (np.pi * scene.RADIUS**2) - 1.0)


def force_table(everything: list[Case], work: Path, defect: str) -> list[str]:
    """Edge forces of a defect that has no reference [kN]."""
    lines = [
        "| mode | law | " + " | ".join(f"{s:g}" for s in STRETCHES) + " | end |",
        "|---|---|" + "---|" * (len(STRETCHES) + 1),
    ]
    for case in (c for c in everything if c.defect == defect and c.law == "auto"):
        run, found = summary(case, work), forces(case, work)
        cells = " | ".join(f"{found[s] / 1e3:.1f}" if s in found else "-" for s in STRETCHES)
        lines.append(f"| {case.mode} | {case.label} | {cells} | {'not run' if run is None else run['status']} |")
    return lines


# Displacements -----------------------------------------------------------------------------------------


def elements(mode: str, stretch: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Nodes [m] and displacements [m] of the finite elements with a hole, mirrored to the whole sheet."""
    with np.load(FINITE_ELEMENTS) as data:
        key = f"{mode}_x_lam{stretch:g}"
        if key not in data:
            return None
        nodes, moved = data[f"{mode}_X"], data[key] - data[f"{mode}_X"]
    signs = [np.array(s) for s in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    nodes, moved = np.vstack([s * nodes for s in signs]), np.vstack([s * moved for s in signs])
    _, first = np.unique(nodes.round(9) + 0.0, axis=0, return_index=True)
    return nodes[first], moved[first]


def frame(case: Case, work: Path, stretch: float) -> Any:
    """The frame of a run at a stretch, without the layers outside; None if it was not reached."""
    from dataclasses import replace

    from warp_pd.output import plots

    if stretch not in forces(case, work):
        return None
    time = (stretch - 1.0) / (case.stretch - 1.0)
    shown = plots.frames_at(work / case.name, [time])[0]
    inside = (np.abs(shown.reference[:, :2]) < load_scene("stretch").HALF * (1.0 + 1e-6)).all(axis=1)
    return replace(shown, triangles=shown.triangles[inside[shown.triangles].all(axis=1)])


def displacement_error(case: Case, work: Path) -> str:
    """Root mean square distance from the finite elements at the last stretch, over the largest displacement."""
    found = elements(case.mode, STRETCHES[-1]) if case.defect == "hole" else None
    shown = frame(case, work, STRETCHES[-1]) if found is not None else None
    if found is None or shown is None:
        return "-"
    from scipy.interpolate import LinearNDInterpolator

    points = np.unique(shown.triangles)
    wanted_at = LinearNDInterpolator(*found)(shown.reference[points, :2])
    apart = (shown.points - shown.reference)[points, :2] - wanted_at
    # Points of the lattice inside the round hole have no counterpart.
    known = np.isfinite(apart).all(axis=1) & (np.hypot(*shown.reference[points, :2].T) >= load_scene("stretch").RADIUS)
    largest = np.linalg.norm(found[1], axis=1).max()
    return f"{100.0 * np.sqrt((apart[known] ** 2).sum(axis=1).mean()) / largest:.2f} %"


def draw_contours(mode: str, defect: str, everything: list[Case], work: Path, path: Path) -> bool:
    """Contours of the displacement on the deformed sheet: a row a stretch, a column a law; whether there are any."""
    import matplotlib.pyplot as plt
    from matplotlib.tri import Triangulation

    chosen = [c for c in everything if c.mode == mode and c.defect == defect and c.law == "auto"]
    panels: dict[tuple[float, str], tuple[Any, np.ndarray]] = {}
    for stretch in STRETCHES:
        for case in chosen:
            shown = frame(case, work, stretch)
            if shown is not None:
                mesh = Triangulation(*shown.points[:, :2].T, shown.triangles)
                panels[stretch, case.label] = (mesh, shown.points - shown.reference)
        found = elements(mode, stretch) if defect == "hole" else None
        if found is not None:
            nodes, moved = found
            flat = Triangulation(*nodes.T)
            centres = nodes[flat.triangles].mean(axis=1)
            faces = flat.triangles[np.hypot(*centres.T) > load_scene("stretch").RADIUS * (1.0 - 1e-3)]
            panels[stretch, "finite elements"] = (Triangulation(*(nodes + moved).T, faces), moved)
    if not panels:
        return False
    columns = list(dict.fromkeys(label for _, label in panels))
    components = (0,) if mode == "planar" else (0, 1)
    wide = [(label, c) for label in columns for c in components]
    tall = 1.8 if mode == "planar" else 2.6
    figure, axes = plt.subplots(
        len(STRETCHES), len(wide), figsize=(2.6 * len(wide) + 1.0, tall * len(STRETCHES)), layout="constrained",
        squeeze=False,
    )  # fmt: skip
    for row, stretch in zip(axes, STRETCHES, strict=True):
        here = {label: panel for (s, label), panel in panels.items() if s == stretch}
        reach = max((np.abs(moved[:, components]).max() for _, moved in here.values()), default=0.0)
        drawn = None
        for axis, (label, c) in zip(row, wide, strict=True):
            axis.set_aspect("equal")
            axis.set_title(f"{label}, u{c + 1}, {stretch:g}", fontsize=8)
            axis.tick_params(labelsize=7)
            axis.locator_params(nbins=4)
            if label not in here:
                axis.set_axis_off()
                continue
            mesh, moved = here[label]
            drawn = axis.tricontourf(mesh, moved[:, c], levels=np.linspace(-reach, reach, 12), cmap="coolwarm")
        if drawn is not None:
            figure.colorbar(drawn, ax=row.tolist(), label="m", format="%.2f").ax.tick_params(labelsize=7)
    figure.suptitle(f"{mode}, {defect}: displacement on the deformed sheet", fontsize=10)
    figure.savefig(path, dpi=60)
    plt.close(figure)
    return True


def draw_curves(everything: list[Case], work: Path, path: Path) -> None:
    """Force over stretch of the whole sheet in the three modes, and its error."""
    import matplotlib.pyplot as plt

    scene = load_scene("stretch")
    unit = scene.MU * scene.SIDE * scene.THICKNESS
    s = np.linspace(1.0, 4.0, 61)[1:]
    figure, axes = plt.subplots(2, 3, figsize=(12.0, 7.0), layout="constrained", sharex=True)
    for k, mode in enumerate(MODES):
        upper, lower = axes[:, k]
        exact = np.array([exact_traction(mode, x) for x in s])
        upper.plot(s, unit * exact / 1e3, "k-", label="exact")
        for fit, style in (("published", "C0:"), ("refitted", "C1:")):
            p = BondNeoHookean(1.0, mode, fit).coefficients
            law = np.array([traction(p, mode, x) for x in s])
            lower.plot(s, 100.0 * (law / exact - 1.0), style, label=f"{fit}, many bonds")
        markers = {"bond_based": "C0o", "bond_based_refitted": "C1s", "bond_associated": "C2^"}
        for case in (c for c in everything if c.mode == mode and c.defect == "none" and c.law == "auto"):
            found = {x: f for x, f in forces(case, work).items() if x > 1.0}
            if not found:
                continue
            x, f = np.array(list(found)), np.array(list(found.values()))
            upper.plot(x, f / 1e3, markers[case.force], mfc="none", label=case.label)
            even = unit * np.array([exact_traction(mode, v) for v in x])
            lower.plot(x, 100.0 * (f / even - 1.0), markers[case.force], mfc="none", label=case.label)
        upper.set(title=mode, ylabel="force on the right edge (kN)")
        lower.set(xlabel="stretch", ylabel="error (%)", ylim=(-6.0, 36.0 if mode == "uniaxial" else 16.0))
        lower.axhline(0.0, color="k", linewidth=0.8)
        for axis in (upper, lower):
            axis.grid(alpha=0.3)
    for axis in axes[:, 0]:
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=70)
    plt.close(figure)


def page(everything: list[Case], work: Path, out: Path, device: str, stand: str | None, points: int) -> str:
    """The whole page as markdown."""
    runs = [run for run in (summary(case, work) for case in everything) if run]
    name = ", ".join(sorted({run["device"] for run in runs})) or device
    uniaxial = next((c.points for c in everything if c.mode == "uniaxial"), 0)
    lines = [
        "# Stretched sheets: what a law for one mode of loading costs",
        "",
        f"Made by `tools/stretch.py` {stamp(name, stand)}.",
        f"Scene `stretch`, {points} points along a side ({uniaxial} uniaxial), float64, edges on rollers. Laws of",
        "bonds: HE chapter 3 with surface correction, horizon 3.015 (9.015 uniaxial), layers outside the sheet.",
        "Bond-associated: corrected weights, plain ones at cracks, horizon 2.015. The paper",
        "takes 100 points (50).",
        "",
        "## Force over stretch, whole sheet",
        "",
        "![force over stretch](stretch-force.png)",
        "",
        "HE figures 5.2, 5.22 and 5.42; the paper reads 1.75 to 3 %, about 5 % and 1.5 to 10 % off its elements.",
        "Dotted: the formula in the limit of many bonds, each sheet with the width that its law gives it.",
        "",
        "## The cost",
        "",
        "Error of the force on an edge at four stretches: whole sheet against the exact solution, with a hole against",
        "finite elements (tests/validation/data); uniaxial with a hole against the bond-associated law instead.",
        "*Displacement*: root mean square distance from the finite elements at the last stretch, over the largest",
        "displacement. Laws of bonds leave out the points in the hole, as in the paper. The area of that staircase is",
        f"off by {100.0 * hole_area_error(points):+.1f} % ({100.0 * hole_area_error(uniaxial):+.1f} % uniaxial): "
        "part of what differs with a hole.",
        "",
        *cost_table(everything, work),
        "",
        *width_lines(everything, work),
        "",
    ]
    for defect in (d for d in DEFECTS if d != "none" and any(c.defect == d for c in everything)):
        lines += [f"## {defect.capitalize()}", ""]
        if defect != "hole":
            lines += ["Force on an edge (kN); no reference.", "", *force_table(everything, work, defect), ""]
        for mode in MODES:
            picture = f"stretch-{mode}-{defect}.png"
            if draw_contours(mode, defect, everything, work, out.parent / picture):
                lines += [f"![{mode}, {defect}]({picture})", ""]
    lines += [
        "A uniaxial sheet with a defect is compressed across over 17 to 58 % of its area. A real one wrinkles there,",
        "and plane solutions, these and the paper's, stop being physical.",
        "",
    ]
    return "\n".join(lines)


def width_lines(everything: list[Case], work: Path) -> list[str]:
    """How far the uniaxial sheet contracts."""
    lines = ["The uniaxial sheet should contract to 1/sqrt(stretch) of its width; in its middle line it has", ""]
    for case in (c for c in everything if c.mode == "uniaxial" and c.defect == "none" and c.law == "auto"):
        widths = forces(case, work, "stretch_across")
        cells = [
            f"{widths[s]:.3f} at {s:g} ({100.0 * (widths[s] * s**0.5 - 1.0):+.1f} %)" for s in STRETCHES if s in widths
        ]
        lines.append(f"- {case.label}: {', '.join(cells) or 'not run'}")
    return lines


def main() -> None:
    """Run what is missing, then write the page and its pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--points", type=int, default=100, help="along a side; half as many uniaxial, 30 at least")
    parser.add_argument("--defects", nargs="*", default=list(DEFECTS), choices=DEFECTS)
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--work", type=Path, default=Path("runs/stretch"), help="folder of the runs")
    parser.add_argument("--out", type=Path, default=Path("docs/stretch.md"), help="the page; pictures go beside it")
    parser.add_argument("--only-page", action="store_true", help="run nothing; runs that are missing say so")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    everything = cases(options.points, tuple(options.defects))
    if not options.only_page:
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda case: execute(case, options.work, options.device), everything))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    draw_curves(everything, options.work, options.out.parent / "stretch-force.png")
    text = page(everything, options.work, options.out, options.device, options.stand, options.points)
    options.out.write_text(text)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    one_line(main)
