"""What a bond law made for one mode of loading costs: HE chapter 5 by the bond laws and the bond-associated law.

    python tools/stretch.py --device cuda:0 --jobs 4 --out docs/stretch.md
    python tools/stretch.py --points 40 --only-page

Runs the scene `stretch` without a defect and with a hole, a crack and an inclusion, in each mode, by each law, and
with the published law of the other modes. Then it writes the page and its pictures. Full size is 100 points along a
side, and 50 in uniaxial runs, whose horizon is 9.015: some minutes on one H200, hours on two CPU cores. There 40 points
take a quarter of an hour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from stretch_cases import FIRST, SIZES, StretchCase, cases, refined
from study import (
    DOCS,
    REFERENCES,
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

from warp_pd.__main__ import load_scene
from warp_pd.materials.bond_neo_hookean import MODES, BondNeoHookean, exact_traction, traction
from warp_pd.run.folder import read_history

DEFECTS = ("none", "hole", "crack", "inclusion")
STRETCHES = (1.5, 2.0, 2.5, 3.0)
ORDER_TEXT = (
    "Error of the force of the bond-associated law at a stretch of 1.5, one load step, by points along a side. *Order* "
    "is the slope of its logarithm over that of the spacing by least squares, with the noise of the layouts in it; it "
    "has no meaning where the error changes sign (-). At a tip the deformation gradient grows without bound, and the "
    "law averages it over about a horizon: a crack acts longer by a part of the horizon, and its error falls "
    "with the first power of the spacing. That part is about 0.27 spacings at each tip at a horizon of 3.15, and 0.04 "
    "at 2.015; it follows from the force that the crack takes, which grows with the square of its length."
)
FINITE_ELEMENTS = REFERENCES / "stretch_hole.npz"


def end_of(case: StretchCase, work: Path) -> str:
    """How a run ended, in a cell of a table."""
    summary = case.summary(work)
    return "not run" if summary is None else str(summary["status"])


def history_by_stretch(case: StretchCase, work: Path, column: str = "edge_force") -> dict[float, float]:
    """A column of the history by stretch; empty if the case has not been run."""
    if case.summary(work) is None:
        return {}
    rows = read_history(work / case.name / "history.csv")
    return {round(row["stretch"], 6): row[column] for row in rows}


def reference_force(case: StretchCase, stretch: float) -> float | None:
    """Force on an edge [N] that the case is compared with.

    It is the exact one without a defect, and that of finite elements with one.
    """
    known = load_scene("stretch").reference(case.mode, case.defect, "roller", stretch)[0]
    return None if known is None else float(known)


def force_error(case: StretchCase, work: Path, stretch: float, digits: int = 2) -> str:
    """The relative error of the edge force, in a cell of a table; "-" if there is none."""
    reference, found = reference_force(case, stretch), history_by_stretch(case, work).get(stretch)
    return "-" if reference is None or found is None else f"{100.0 * (found / reference - 1.0):+.{digits}f} %"


def cost_table(everything: Sequence[StretchCase], work: Path) -> list[str]:
    """Errors of the edge force of every law in every mode, without a defect and with each."""
    head = ["mode", "defect", "law", *(f"{s:g}" for s in STRETCHES), "displacement", "end"]
    rows = [
        [
            mode, defect, case.label, *(force_error(case, work, s) for s in STRETCHES), displacement_error(case, work),
            end_of(case, work),
        ]
        for defect in DEFECTS
        for mode in MODES
        for case in everything
        if case.mode == mode and case.defect == defect
    ]  # fmt: skip
    return table(head, rows)


def hole_area_error(points: int) -> float:
    """Area of the points that the hole takes from a sheet of bond laws over that of the circle, minus 1."""
    scene = load_scene("stretch")
    whole = scene.whole_sheet(points, 1.0, "uniaxial")
    taken = whole.size - scene.with_defect(whole, "hole").size
    return float(taken * whole.areas[0] / (np.pi * scene.RADIUS**2) - 1.0)


def order_table(finer: Sequence[StretchCase], work: Path) -> list[str]:
    """Errors at a stretch of 1.5 by points along a side, and the order that they show."""
    sizes = sorted({case.points for case in finer})
    rows = []
    for horizon, defect, mode in dict.fromkeys((c.horizon, c.defect, c.mode) for c in finer):
        row = {c.points: c for c in finer if (c.horizon, c.defect, c.mode) == (horizon, defect, mode)}
        errors = [force_error(row[size], work, FIRST, digits=3) for size in sizes]
        rows.append([defect, mode, f"{horizon:g}", *errors, observed_order(row, work)])
    return table(["defect", "mode", "horizon", *(str(size) for size in sizes), "order"], rows)


def observed_order(row: Mapping[int, StretchCase], work: Path) -> str:
    """Slope of the logarithm of the error over that of the spacing, by least squares; "-" if errors change sign."""
    errors = {}
    for size, case in row.items():
        reference, found = reference_force(case, FIRST), history_by_stretch(case, work).get(FIRST)
        if reference is not None and found is not None:
            errors[size] = found / reference - 1.0
    if len(errors) < 2 or len({error > 0.0 for error in errors.values()}) > 1:
        return "-"
    spacings = 1.0 / (np.array(list(errors)) - 1.0)
    return f"{np.polyfit(np.log(spacings), np.log(np.abs(list(errors.values()))), 1)[0]:.1f}"


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


def frame(case: StretchCase, work: Path, stretch: float) -> Any:
    """The frame of a run at a stretch, without the layers outside; None if the run did not reach it."""
    from warp_pd.output import plots

    if stretch not in history_by_stretch(case, work):
        return None
    time = (stretch - 1.0) / (case.last_stretch - 1.0)
    shown = plots.frames_at(work / case.name, [time])[0]
    inside = (np.abs(shown.reference[:, :2]) < load_scene("stretch").HALF * (1.0 + 1e-6)).all(axis=1)
    return replace(shown, triangles=shown.triangles[inside[shown.triangles].all(axis=1)])


def displacement_error(case: StretchCase, work: Path) -> str:
    """Root mean square distance from the finite elements at the last stretch, over the largest displacement."""
    found = elements(case.mode, STRETCHES[-1]) if case.defect == "hole" else None
    shown = frame(case, work, STRETCHES[-1]) if found is not None else None
    if found is None or shown is None:
        return "-"
    from scipy.interpolate import LinearNDInterpolator

    points = np.unique(shown.triangles)
    expected = LinearNDInterpolator(*found)(shown.reference[points, :2])
    apart = (shown.points - shown.reference)[points, :2] - expected
    # Points of the lattice inside the round hole have no counterpart.
    known = np.isfinite(apart).all(axis=1) & (np.hypot(*shown.reference[points, :2].T) >= load_scene("stretch").RADIUS)
    largest = np.linalg.norm(found[1], axis=1).max()
    return f"{100.0 * np.sqrt((apart[known] ** 2).sum(axis=1).mean()) / largest:.2f} %"


def draw_contours(mode: str, defect: str, everything: Sequence[StretchCase], work: Path, path: Path) -> bool:
    """Contours of the displacement on the deformed sheet, one row per stretch, one column per law.

    Returns:
        Whether there was anything to draw.
    """
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


def draw_curves(everything: Sequence[StretchCase], work: Path, path: Path) -> None:
    """Force over stretch of the sheet without a defect in the three modes, and its error."""
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
            found = {x: f for x, f in history_by_stretch(case, work).items() if x > 1.0}
            if not found:
                continue
            x, f = np.array(list(found)), np.array(list(found.values()))
            upper.plot(x, f / 1e3, markers[case.force], mfc="none", label=case.label)
            expected = unit * np.array([exact_traction(mode, v) for v in x])
            lower.plot(x, 100.0 * (f / expected - 1.0), markers[case.force], mfc="none", label=case.label)
        upper.set(title=mode, ylabel="force on the right edge (kN)")
        lower.set(xlabel="stretch", ylabel="error (%)", ylim=(-6.0, 36.0 if mode == "uniaxial" else 16.0))
        lower.axhline(0.0, color="k", linewidth=0.8)
        for axis in (upper, lower):
            axis.grid(alpha=0.3)
    for axis in axes[:, 0]:
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=70)
    plt.close(figure)


def page(
    everything: Sequence[StretchCase], finer: Sequence[StretchCase], work: Path, out: Path, header: str, points: int
) -> str:
    """The whole page as markdown; draws its pictures of displacements."""
    uniaxial = next((c.points for c in everything if c.mode == "uniaxial"), 0)
    lines = [
        "# Stretched sheets: errors of laws made for one mode of loading",
        "",
        *paragraph(
            f"{header} Scene `stretch`, {points} points along a side ({uniaxial} uniaxial), float64, edges on rollers. "
            "The bond laws are those of HE chapter 3 with surface correction, horizon 3.015 (9.015 uniaxial), with "
            "layers outside the sheet. The bond-associated law has corrected weights, a horizon of 2.015, and sheets "
            "by `Sheet.outline`, with points on the hole, the crack and the inclusion. The paper takes 100 points "
            "(50 uniaxial)."
        ),
        "## Force over stretch, no defect",
        "",
        "![force over stretch](stretch-force.png)",
        "",
        *paragraph(
            "These are HE figures 5.2, 5.22 and 5.42. The paper reports 1.75 to 3 %, about 5 % and 1.5 to 10 % against "
            "its elements. Dotted lines are the formula in the limit of many bonds, each sheet as wide as its law "
            "makes it."
        ),
        "## Errors",
        "",
        *paragraph(
            "Error of the force on an edge at four stretches. Sheets without a defect are compared with the exact "
            "solution, the others with plane finite elements (`tests/references`), which resist compression. "
            "*Displacement* is the root mean square distance from the finite elements at the last stretch, over the "
            "largest displacement. The bond laws leave out the points in the hole, as the paper does. The area of this "
            f"staircase is off by {100.0 * hole_area_error(points):+.1f} % "
            f"({100.0 * hole_area_error(uniaxial):+.1f} % uniaxial), which explains part of the difference with a hole."
        ),
        *cost_table(everything, work),
        "",
        *width_lines(everything, work),
        "",
    ]
    if finer:
        lines += ["## How the error falls", "", *paragraph(ORDER_TEXT), *order_table(finer, work), ""]
    for defect in (d for d in DEFECTS if d != "none" and any(c.defect == d for c in everything)):
        lines += [f"## {defect.capitalize()}", ""]
        for mode in MODES:
            picture = f"stretch-{mode}-{defect}.png"
            if draw_contours(mode, defect, everything, work, out.parent / picture):
                lines += [f"![{mode}, {defect}]({picture})", ""]
    lines += paragraph(
        "A uniaxial sheet with a defect is compressed across over 17 to 58 % of its area. A real sheet wrinkles there. "
        "Plane solutions, these and those of the paper, are then no longer physical."
    )
    return "\n".join(lines)


def width_lines(everything: Sequence[StretchCase], work: Path) -> list[str]:
    """How far the uniaxial sheet contracts."""
    lines = ["The uniaxial sheet should contract to 1/sqrt(stretch) of its width. Its middle line contracts to", ""]
    for case in (c for c in everything if c.mode == "uniaxial" and c.defect == "none" and c.law == "auto"):
        widths = history_by_stretch(case, work, "stretch_across")
        cells = [
            f"{widths[s]:.3f} at {s:g} ({100.0 * (widths[s] * s**0.5 - 1.0):+.1f} %)" for s in STRETCHES if s in widths
        ]
        lines.append(f"- {case.label}: {', '.join(cells) or 'not run'}")
    return lines


def main() -> None:
    """Run what is missing, then write the page and its pictures."""
    parser = study_parser(
        __doc__, device="cpu", jobs=1, work=RUNS / "stretch", out=DOCS / "stretch.md", only_page=False, commit=None
    )
    parser.add_argument(
        "--points", type=at_least_one, default=100, help="along a side; half as many, but at least 30, uniaxial"
    )
    parser.add_argument(
        "--sizes", nargs="*", type=at_least_one, default=list(SIZES), help="points along a side that show the order"
    )
    parser.add_argument("--defects", nargs="*", default=list(DEFECTS), choices=DEFECTS)
    options = parser.parse_args()
    everything = cases(options.points, options.defects)
    finer = refined(options.defects, options.sizes)
    execute_all([*everything, *finer], options)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    draw_curves(everything, options.work, options.out.parent / "stretch-force.png")
    device = devices_of((case.summary(options.work) for case in everything), options.device)
    header = page_header("stretch.py", device, options.commit)
    write_page(options.out, page(everything, finer, options.work, options.out, header, options.points))


if __name__ == "__main__":
    run_tool(main)
