"""The page and its pictures."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from study import bullet, paragraph

from .results import Row
from .studies import STUDIES, Study
from .sweep import ONE_CORE
from .tables import (
    against_elements,
    choices,
    failures,
    field_of,
    front,
    front_table,
    orders,
    published_text,
    scalar_of,
    seconds_of,
    with_errors,
)

FOLDER = "error-vs-time"
ADVICE = (
    "For static scenes take corrected weights and the smallest horizon (1.5 or 2.015; 2.015 beside a hole). Take "
    "Newton's method in float64 on a CPU or for the last digits, and relaxation in float32 on a GPU up to some "
    "100 points a side. Above "
    "2.015, wider horizons cost more a step and have a larger error at the same spacing. Refine the spacing, not the "
    "horizon: corrected weights are second order, the others first or less, and published weights at 1.5 do not "
    "converge under pressure. In dynamics take corrected weights at 2.015, explicit, float32. A horizon of 3.15 "
    "pays where "
    "the sheet tears, because cracks follow the grid below it ([tearing](tearing.md)). float32 is enough down to "
    "errors of 0.002 % (tension) to 0.04 % (pressure). Laws without intersections (closed form, bond-based) pay only "
    "if an error of several percent will do. A scene with few rows on a device says little: the H200 has only plain "
    "weights for stretch.",
    "The finite elements are known at their nodes. Splines between them have an error of 1e-5 of the field. Rows of "
    "commits 9970489 and b1e4704 took other cubics with an error of 2e-4: their field errors cannot be smaller.",
)
ORDERS = (
    "Corrected weights are second order and the others first, where nothing else is in the way. Orders below that have "
    "these reasons:",
    "*The reference ends.* No row can come below its error: 0.001 % by the splines between nodes, 0.02 % in rows of "
    "commits 9970489 and b1e4704, 0.01 % with a hole, 0.5 % under sudden pressure. It shows in the last sizes of "
    "corrected weights (1.4 to -0.2), of nine nodes an element (0.8, 0.1), and of plain weights with 401 points.",
    "*Another material.* `bond_based` (0.0 to 0.6) tends to the sheet of its own Poisson's ratio. The bond laws of one "
    "mode (0.0 to 0.5) are not the reference's material beside a hole, which they have as a staircase of cells.",
    "*Published weights under pressure* at 1.5 (-0.1, 0.0) tend to another field, 4.4 % off, and at 2.015 (0.6) the "
    "runs end by diverging; under tension at 1.5 they are first order. Why 1.5 differs is open.",
    "*A hole at a horizon of 1.5* (-0.3, 0.3, 0.8): points lie irregularly beside it, where some families are "
    "too small "
    "to have one equilibrium. With 51 points Newton's method and relaxation, both converged, differ by 9 mm or 0.9 "
    "spacings at a point 25 mm from the rim, and by 0.2 % of the field; at 2.015 they agree to 5e-7 (CPU, 2026-11-22, "
    "commit fd8b08e). Elsewhere beside holes orders carry the noise of the layouts.",
    "*Nodal correspondence at 3.15* (0.5 to 0.2): open; its zero-energy modes were not separated from its error.",
)

BESIDE = (
    "`tools/error_vs_time/membrane.py` solves the static scenes with quadrilaterals of four and nine nodes: meshes, "
    "shape functions and quadrature of scikit-fem, the exact tangent, sparse LU, the whole sheet, and one load step "
    "from a guess as a user would make it (a dome; a uniform stretch). Times are CPU time on one core, as others used "
    "the machine, with all set-up in them. The reference is made of finite elements too, finer ones, converged to 1e-6 "
    "and 1e-5, for the hole to 1e-4.",
    "**For a static sheet that does not tear, take membrane finite elements**: for the shape and the stress of an "
    "inflated, stretched or holed sheet, and wherever errors below 0.1 % count. They are faster in every row below, as "
    "they need fewer nodes and have a sparser tangent, and sparse LU is no obstacle at these sizes (10 000 nodes take "
    "0.5 to 2 s). Between 1 and 0.1 % the choice costs tenths of a second on the two sheets without a hole. This code "
    "is the tool where a sheet tears, where cracks start, branch and meet, or where flaps and balls touch it: finite "
    "elements then need remeshing, cohesive zones or erosion of elements, and none of that is compared here. Dynamics "
    "without tears (`pressure_dynamic`) were not compared either; explicit elements of four nodes cost less a node "
    "than a family of 12 or 28 bonds, so expect the same answer there.",
)


def page(rows: Sequence[Row], docs: Path) -> str:
    """The page, from the rows of all devices. Its pictures go to error-vs-time/ in `docs`."""
    (docs / FOLDER).mkdir(parents=True, exist_ok=True)
    lines = [
        "# Error against run time",
        "",
        *paragraph(
            f"Made by `tools/error_vs_time`. The numbers of every run are in `docs/{FOLDER}/`. Time is that of a whole "
            "run without files, with set-up and without compilation, the median of repeated runs. Point-steps are "
            "points times force evaluations. Errors are relative to finite elements. The field error is the L2 norm "
            "of the difference of the displacements over that of the displacement. `published`, `plain` and "
            "`corrected` are weights of the bond-associated law. `bond_based` is linear (E = 3 mu, Poisson's ratio "
            "1/3), which is another material at large strain. The number after a law is its horizon in spacings."
        ),
    ]
    for study in STUDIES:
        here = [row for row in rows if row.case.scene == study.scene]
        if not here:
            continue
        lines += [f"## {study.scene}", "", *paragraph(study.about)]
        for device in sorted({row.device for row in here}):
            lines += device_section(study, device, [row for row in here if row.device == device], docs)
    lines += [
        "## What the orders say",
        "",
        *paragraph(ORDERS[0]),
        *(line for text in ORDERS[1:] for line in bullet(text)),
        "",
    ]
    lines += ["## Membrane finite elements beside this code", ""]
    lines += [line for text in BESIDE for line in paragraph(text)]
    lines += [*against_elements(rows), "", "## What to choose", ""]
    return "\n".join([*lines, *(line for text in ADVICE for line in paragraph(text)), *choices(rows), ""])


def device_section(study: Study, device: str, rows: Sequence[Row], docs: Path) -> list[str]:
    """Lines about a scene on a device; draws its picture."""
    scene = study.scene
    kind = ("one-core" if device.endswith(ONE_CORE) else "cpu") if "cpu" in device.lower() else "gpu"
    picture = f"{FOLDER}/{scene}-{kind}.png"
    made = "; ".join(sorted({row.made.removeprefix("on ") for row in rows}))
    lines = [f"### On {device}", "", *paragraph(f"Measured: {made}."), *paragraph(published_text(rows))]
    if with_errors(rows):
        draw(rows, docs / picture)
        lines += [f"![{scene} on {device}]({picture})", "", *front_table(rows), ""]
    if failed := failures(rows):
        lines += ["Runs without a result:", "", *failed, ""]
    # A run of this code as the reference shows no order.
    if study.finer is not None:
        return lines
    found = orders(rows)
    return [*lines, *(["Observed orders in the spacing:", "", *found, ""] if found else [])]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Work-precision diagrams of one scene and device: errors over time and over point-steps, with their fronts."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(15, 5), layout="constrained")
    panels = [
        (scalar_of, "error of the scalar", seconds_of, "time of the run (s)"),
        (field_of, "L2 error of the field", seconds_of, "time of the run (s)"),
        (field_of, "L2 error of the field", lambda r: r.point_steps, "point-steps"),
    ]
    laws = sorted({law for study in STUDIES for law in study.laws})
    marks = {"newton": "o", "relaxation": "s", "explicit": "^"}
    for axes, (error, ylabel, cost, xlabel) in zip(figure.subplots(1, 3), panels, strict=True):
        for law, (solver, mark) in itertools.product(laws, marks.items()):
            some = [r for r in with_errors(rows) if r.case.law == law and r.case.solver == solver]
            if some:
                axes.scatter(
                    [cost(r) for r in some], [error(r) for r in some], marker=mark, s=22, alpha=0.75,
                    color=f"C{laws.index(law)}", label=f"{law}, {solver}",
                )  # fmt: skip
        best = front(rows, error, cost)
        axes.plot([cost(r) for r in best], [error(r) for r in best], color="black", lw=1, label="front", zorder=0)
        axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
        low, high = axes.get_xlim()
        if high > 10.0 * low:
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    figure.axes[-1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=110)
