"""Fields of peridynamics beside those of finite elements, and their difference, as the papers show them.

    python -m tools.fields                               all cases: docs/papers/fields.png and the table of docs/papers
    python -m tools.fields --only tension --points 101 --out /tmp/tension.md

A case is a scene whose displacement is known from membrane finite elements, which are solved here or come from
tests/papers/references. A panel shows a component of the displacement on the deformed sheet, from above; the difference
is divided by the largest value of the finite elements.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parent)

from error_vs_time.elements import NEAR, square
from error_vs_time.errors import Field, distance, dynamic_field, interpolated, mirrored, pressure_field, tension_field
from finite_elements import Membrane, neo_hookean
from references.stretched_sheet import RADIUS, Quarter, grid
from small_pictures import limit, shrunk
from study import (
    DOCS,
    at_least_one,
    build_scene,
    device_title,
    load_scene,
    provenance,
    renew,
    run_tool,
    study_parser,
    table,
    whole,
)

Array = npt.NDArray[np.float64]
PAGE, HEADING = DOCS / "papers" / "index.md", "## Fields beside finite elements"
REFERENCES = DOCS.parent / "tests" / "papers" / "references" / "data"
# Elements along a radius of a defect, longest step of the stretch.
CELLS, STEP = 12, 0.1


def inflated(points: Array) -> Array:
    """Scene `pressure_static` at 20 Pa, (n, 3): 24 x 24 elements of nine nodes, from a dome."""
    sheet = Membrane(square(49, 1.0, nine=True), neo_hookean(1e3, 100e3), 0.01, 3, pressure=20.0)
    sheet.displacement[:, 2] = 0.3 * 16.0 * np.prod(sheet.nodes * (1.0 - sheet.nodes), axis=1)
    edge = ((sheet.nodes < NEAR) | (sheet.nodes > 1.0 - NEAR)).any(axis=1)
    sheet.solve(np.repeat(edge[:, None], 3, axis=1))
    return interpolated(sheet.nodes, sheet.displacement, points)


def lifted(points: Array) -> Array:
    """Scene `out_of_plane` at 2.5 s in tension field theory, (n, 3)."""
    data = np.load(REFERENCES / "out_of_plane.npz")
    x, y = np.meshgrid(data["x"], data["x"], indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel()])
    return interpolated(nodes, data["relaxed_u_t2.5"].reshape(3, -1).T, points)


def stretched(points: Array, defect: str, stretch: float, **settings: Any) -> Array:
    """A square with a defect that is stretched alike along both sides, (n, 2); a quarter of it is solved."""
    quarter = Quarter(grid(defect, CELLS), defect, "equibiaxial", **settings)
    for part in np.linspace(1.0, stretch, round((stretch - 1.0) / STEP) + 1)[1:]:
        quarter.stretch_to(float(part))
    sheet = quarter.membrane
    found = mirrored(sheet.nodes, sheet.displacement, points, (0.0, 0.0), np.array([1, 1]))
    # An inclusion is rigid and stays where it is; elements end at its rim.
    found[(defect == "inclusion") & (np.hypot(*points.T) < RADIUS)] = 0.0
    return found


def polyurea(points: Array) -> Array:
    """Scene `visco_hole` at a stretch of 4, (n, 2)."""
    rubber = load_scene("visco_hole").POLYUREA
    material = {"mu": 2.0 * rubber.c10, "stiffening": rubber.c20 / rubber.c10}
    return stretched(points, "hole", 4.0, grip="clamp", **material)


@dataclass(frozen=True)
class Case:
    """A scene and its finite elements.

    Attributes:
        scene: Its name.
        figure: Where the paper shows the field.
        component: Of the displacement: 0, 1, 2.
        elements: Points (n, 2) [m] -> displacements [m], (n, 2 or 3).
        settings: Of the scene.
        points: Along a side.
    """

    scene: str
    figure: str
    component: int
    elements: Field
    settings: Mapping[str, Any] = field(default_factory=dict)
    points: int = 51


CASES: dict[str, Case] = {
    "tension": Case("tension", "BA 6.1", 1, tension_field),
    "pressure": Case("pressure", "BA 6.2", 2, pressure_field),
    "pressure_static": Case("pressure_static", "NN 6.1, figure 6", 2, inflated, {"horizon": 2.015}),
    "pressure_dynamic": Case(
        "pressure_dynamic", "NN 6.1, figure 8, 1 s", 2, partial(dynamic_field, time=1.0),
        {"frames": 4, "horizon": 2.015},
    ),
    "out_of_plane": Case(
        "out_of_plane", "NN 6.2, figure 10, 2.5 s", 2, lifted,
        {"wrinkles": "relaxed", "duration": 2.5, "frames": 5, "horizon": 1.5},
    ),
    **{
        defect: Case(
            "stretch", f"HE 5.1, {defect}", 0, partial(stretched, defect=defect, stretch=2.0),
            {"force": "bond_associated", "stretch": 2.0, "defect": defect},
        )
        for defect in ("hole", "crack", "inclusion")
    },
    "visco_hole": Case("visco_hole", "VE 6.2, figure 9", 0, polyurea, {"horizon": 2.015}),
}  # fmt: skip


@dataclass(frozen=True)
class Fields:
    """Both fields at the points of a sheet.

    Attributes:
        case: What was run.
        points: Of the sheet, (n, 2) [m].
        triangles: Of the sheet, (m, 3).
        here, elements: Displacements [m], (n, 3) and (n, 2 or 3).
        areas: Of the points [m^2], (n,).
    """

    case: Case
    points: Array
    triangles: npt.NDArray[np.int32]
    here: Array
    elements: Array
    areas: Array

    @property
    def largest(self) -> float:
        """Largest value of the component in the finite elements [m]."""
        return float(np.nanmax(np.abs(self.elements[:, self.case.component])))

    @property
    def difference(self) -> Array:
        """Of the component, over its largest value, (n,)."""
        c = self.case.component
        return (self.here[:, c] - self.elements[:, c]) / self.largest

    def row(self) -> Sequence[str]:
        """Cells of the table."""
        count = self.elements.shape[1]
        whole_field = distance(self.here[:, :count], self.elements, self.areas)
        return [
            self.case.figure, f"`{self.case.scene}`", f"u{self.case.component + 1}",
            f"{100 * whole_field:.2g} %", f"{100 * np.nanmax(np.abs(self.difference)):.2g} %",
        ]  # fmt: skip


def fields_of(case: Case, points: int | None, device: str | None) -> Fields:
    """Run a case and its finite elements."""
    settings = {**case.settings, "points": points or case.points}
    result = whole(build_scene(case.scene, settings).run(device=device))
    sheet = result.built.simulation.sheet
    flat = np.ascontiguousarray(sheet.points[:, :2])
    elements = case.elements(towards_triangles(flat, sheet.triangles))
    return Fields(case, flat, sheet.triangles, result.frame.displacement, elements, sheet.areas)


def towards_triangles(points: Array, triangles: npt.NDArray[np.int32]) -> Array:
    """Points moved by a millionth towards their triangles, so that those on a crack are on their own side of it."""
    middles, inwards = points[triangles].mean(axis=1), np.zeros_like(points)
    for corner in triangles.T:
        np.add.at(inwards, corner, middles - points[corner])
    return points + 1e-6 * inwards


def draw(found: Sequence[Fields], path: Path) -> None:
    """Three panels a case, two cases a row: here, finite elements, difference."""
    from matplotlib.figure import Figure

    down = -(-len(found) // 2)
    figure = Figure(figsize=(13.0, 2.25 * down), layout="constrained")
    axes = figure.subplots(down, 6, squeeze=False)
    for panel in axes.flat:
        panel.set_axis_off()
    for k, shown in enumerate(found):
        panels = axes[k // 2, 3 * (k % 2) : 3 * (k % 2) + 3]
        c, most = shown.case.component, 100.0 * float(np.nanmax(np.abs(shown.difference)))
        values = shown.here[:, c], shown.elements[:, c]
        low, high = float(np.nanmin(values[1])), float(np.nanmax(values[1]))
        moved = shown.points + shown.here[:, :2], shown.points + shown.elements[:, :2]
        name = f"u{c + 1} (m)"
        parts: tuple[tuple[str, Array, Array, str, float, float], ...] = (
            (f"{shown.case.figure}\nhere, {name}", moved[0], values[0], "viridis", low, high),
            (f"finite elements\n{name}", moved[1], values[1], "viridis", low, high),
            ("difference\n(% of the largest)", moved[1], 100.0 * shown.difference, "RdBu_r", -most, most),
        )
        for panel, (title, places, value, colours, first, last) in zip(panels, parts, strict=True):
            known = np.isfinite(value)[shown.triangles].all(axis=1) & np.isfinite(places).all(axis=1)[
                shown.triangles
            ].all(axis=1)
            drawn = panel.tripcolor(
                *np.nan_to_num(places).T, shown.triangles[known], np.nan_to_num(value), shading="gouraud", cmap=colours,
                vmin=first, vmax=last, rasterized=True,
            )  # fmt: skip
            panel.set_title(title, fontsize=8)
            panel.set_aspect("equal")
            figure.colorbar(drawn, ax=panel, shrink=0.75).ax.tick_params(labelsize=7)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=70)
    path.write_bytes(shrunk(path, limit(path)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases, draw their fields, renew the section of the page."""
    parser = study_parser(__doc__, device=None, out=PAGE)
    parser.add_argument("--only", nargs="+", default=list(CASES), choices=list(CASES), metavar="CASE")
    parser.add_argument("--points", type=at_least_one, default=None, help="along a side; by default 51")
    options = parser.parse_args(arguments)
    if options.out == PAGE and (options.only != list(CASES) or options.points):
        parser.error("--only, --points: expected --out FILE too, as the page shows all cases at their own size")
    found = []
    for name in options.only:
        found.append(fields_of(CASES[name], options.points, options.device))
        print(f"{name}: {', '.join(found[-1].row()[-2:])}", flush=True)
    draw(found, options.out.parent / "fields.png")
    lines = [
        f"By `python -m tools.fields`; {provenance(device_title(options.device))}. Corrected weights, "
        f"{options.points or 51} points along a side. Differences: the L2 norm of all components over that of the "
        "displacement, and the largest one of the component that is shown, over its largest value.",
        "", "![Fields beside finite elements](fields.png)", "",
        *table(["where", "scene", "shown", "whole field", "largest"], [shown.row() for shown in found]),
    ]  # fmt: skip
    renew(options.out, {HEADING: lines})


if __name__ == "__main__":
    run_tool(main)
