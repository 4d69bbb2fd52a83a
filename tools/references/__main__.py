"""Solve the references anew, and write stretch.json, visco.json, disc.json and torn.json in tests/references.

    python tools/references                            # all; the sheets take some minutes
    python tools/references --only disc
    python tools/references --only torn                        # energy release rates of scenes that tear
    python tools/references --meshes 4 8 16 --out FOLDER
    python tools/references --only lifted --cells 200 --out tests/papers/references/data    # half an hour

scikit-fem is needed: `pip install -e .[references]`. Other solvers than ours, so that a test can tell an error of the
law from an error of the reference:

- stretched_sheet.py: `stretch.json`, the sheet of scene `stretch` with a hole, a crack or a rigid inclusion. Each
  quantity has its values on the meshes, Richardson's limit, the error estimate and the observed order. Forces in N,
  `opening_x` and `opening_y` in m: how far the rim of the hole, or the middle and the tip of the crack, move.
  `visco.json`, the clamped sheets of Yeoh's material in scenes `visco_hole` and `visco_crack`, likewise.
- shooting.py: `disc.json`, the inflated circular membrane. Tests may also call its functions.
- torn_sheets.py: `torn.json`, the energy release rate of a notched strip, which scene `edge_notch` holds as a table,
  and of trousers over that by the classical formula.
- lifted_sheet.py: `out_of_plane.npz`, fields of the lifted sheet of NN 6.2, only where it is asked for.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

if not __package__:
    # The folder tools/, in place of this one.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import ROOT, at_least_one, run_tool, study_parser

from references import lifted_sheet, shooting, stretched_sheet, torn_sheets

FOLDER = ROOT / "tests" / "references"
STRETCHES = (1.5, 2.0, 2.5, 3.0)
MESHES = (8, 16, 32)
# Uniaxial sheets are compressed across: on finer meshes the rim of the hole finds no equilibrium at 2.5 and more.
COARSE = (2, 4, 8)
# Polyurea of VE table 2 [Pa]; stretches of the figures 9, 10, 12, 13 and 23 and some between.
C10, C20, CRACK = 0.1996e6, 0.0170e6, 0.1
VISCO = {"hole": (1.5, 2.0, 2.5, 3.0, 4.0, 7.0), "crack": (1.5, 2.5, 4.0)}
MATERIALS = {
    "neo-Hookean": shooting.NEO_HOOKEAN,
    "Mooney-Rivlin": shooting.Material(share=0.1),
    "Gent": shooting.Material(limit=30.0),
}
# When fields of the lifted sheet are kept [s], and the elements along a side between whose nodes they are.
SHOWN, KEPT = (1.5, 2.5, 3.5, 4.5), 50
# Lengths of the notch over the width, stretches of the strip, and openings of trousers [m].
RATIOS, TORN = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4), (1.1, 1.15, 1.2, 1.3, 1.5, 2.0, 3.0)
FLAWS, FLAWED = (0.05, 0.1, 0.2, 0.3, 0.5), (1.05, 1.1, 1.2, 1.4, 1.7, 2.0, 3.0)
OPENINGS = (2e-3, 3e-3, 4e-3)
CENTRES = (1.01, 1.05, 1.1, 1.2, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0, 4.0)


def made() -> dict[str, str]:
    """Where numbers come from."""
    versions = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "scikit-fem")}
    return {"date": str(datetime.date.today()), **versions}


def quantity(values: Sequence[float]) -> dict[str, Any]:
    """A quantity with its values on all meshes."""
    limit, error, order = stretched_sheet.richardson(values)
    return {
        "value": limit,
        "error": error,
        "order": None if math.isnan(order) else round(order, 2),
        "meshes": [*values],
    }


def sheets(meshes: Sequence[int]) -> dict[str, Any]:
    """The stretched sheets, by defect, mode, stretch and name of the quantity."""
    found: dict[str, Any] = {}
    for defect in stretched_sheet.DEFECTS[1:]:
        for mode in stretched_sheet.MODES:
            compressed = mode == "uniaxial"
            chosen, step = (COARSE, 0.05) if compressed else (meshes, 0.1)
            solved = stretched_sheet.converged(defect, mode, chosen, STRETCHES, step)
            cases = {f"{s:g}": {name: quantity(v) for name, v in names.items()} for s, names in solved.items()}
            found.setdefault(defect, {})[mode] = cases
            for stretch, names in cases.items():
                force = names["force_x"]
                print(f"{defect} {mode} {stretch}: {force['value']:.3f} +- {force['error']:.1e} N", flush=True)
    return found


def visco(meshes: Sequence[int]) -> dict[str, Any]:
    """The clamped sheets of Yeoh's material, stretched equally along x and y, by defect, stretch and quantity."""
    found: dict[str, Any] = {}
    for defect, stretches in VISCO.items():
        solved = stretched_sheet.converged(
            defect,
            "equibiaxial",
            meshes,
            stretches,
            step=0.25,
            crack=CRACK,
            grip="clamp",
            mu=2.0 * C10,
            stiffening=C20 / C10,
        )
        found[defect] = {f"{s:g}": {n: quantity(v) for n, v in names.items()} for s, names in solved.items()}
    return found


def discs() -> dict[str, Any]:
    """The inflated discs: materials, their points of the curve, and the maximum of pressure where there is one."""
    found: dict[str, Any] = {}
    for name, material in MATERIALS.items():
        curve = []
        for stretch in CENTRES:
            fine, coarse = (shooting.at_stretch(stretch, material, tolerance) for tolerance in (1e-11, 1e-9))
            error = max(abs(coarse.pressure / fine.pressure - 1.0), abs(coarse.deflection / fine.deflection - 1.0))
            curve.append({**numbers(fine), "error": error})
        found[name] = {"share": material.share, "limit": material.limit if name == "Gent" else None, "curve": curve}
    found["neo-Hookean"]["maximum"] = numbers(shooting.maximum())
    return found


def numbers(disc: shooting.Disc) -> dict[str, float]:
    """A disc without its profile."""
    return {name: getattr(disc, name) for name in ("pressure", "stretch", "deflection", "volume", "energy")}


def torn() -> dict[str, Any]:
    """Factors k = G / (2 a W) of notched strips by ratio, and G of trousers over that of the classical formula."""
    strips = {f"{ratio:g}": torn_sheets.notched(ratio, TORN) for ratio in RATIOS}
    return {
        "stretches": TORN,
        "full_energy": {ratio: [round(full, 3) for full, _ in values] for ratio, values in strips.items()},
        "tension_field": {ratio: [round(relaxed, 3) for _, relaxed in values] for ratio, values in strips.items()},
        "squares": {f"{ratio:g}": [round(c, 3) for c in torn_sheets.flawed(ratio, FLAWED)] for ratio in FLAWS},
        "square_stretches": FLAWED,
        "trousers": [
            {"rate": rate, "over_formula": rate / formula} for rate, formula in map(torn_sheets.trousers, OPENINGS)
        ],
    }


def lifted(cells: int) -> dict[str, Any]:
    """Displacements of the lifted sheet [m], (3, along x, along y), by time; those of the relaxed energy too."""
    found: dict[str, Any] = {"x": np.linspace(0.0, lifted_sheet.SIDE, KEPT + 1)}
    for name, relaxed in (("", False), ("relaxed_", True)):
        fields = lifted_sheet.snapshots(lifted_sheet.lifted(cells, relaxed), SHOWN)
        every, found[f"{name}cells"] = cells // KEPT, cells
        found |= {f"{name}u_t{t:g}": u[:, ::every, ::every].astype("f4") for t, u in zip(SHOWN, fields, strict=True)}
    return found


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__)
    parser.add_argument("--only", choices=("stretch", "visco", "disc", "torn", "lifted"), help="solve only these")
    parser.add_argument("--meshes", type=at_least_one, nargs="+", default=MESHES, help="cells; each twice the last")
    parser.add_argument("--cells", type=at_least_one, default=200, help="of the lifted sheet along a side")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder of the numbers")
    options = parser.parse_args(arguments)
    doubled = all(b == 2 * a for a, b in zip(options.meshes, options.meshes[1:], strict=False))
    if len(options.meshes) < 3 or not doubled:
        parser.error("--meshes: expected three or more, each twice the last")
    if options.cells % KEPT:
        parser.error(f"--cells: expected a multiple of {KEPT}")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve and write."""
    options = parsed(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.only == "lifted":
        np.savez_compressed(options.out / "out_of_plane.npz", **lifted(options.cells))
        return
    sheet = {
        "side": 2.0 * stretched_sheet.HALF, "thickness": stretched_sheet.THICKNESS, "mu": stretched_sheet.MU,
        "radius": stretched_sheet.RADIUS, "crack": stretched_sheet.CRACK, "meshes": [*options.meshes],
        "uniaxial_meshes": COARSE,
    }  # fmt: skip
    if options.only in (None, "stretch"):
        write(options.out / "stretch.json", {"made": made(), **sheet, **sheets(options.meshes)})
    if options.only in (None, "visco"):
        content = {"made": made(), "c10": C10, "c20": C20, "crack": CRACK, "meshes": [*options.meshes]}
        write(options.out / "visco.json", content | visco(options.meshes))
    if options.only in (None, "disc"):
        write(options.out / "disc.json", {"made": made(), **discs()})
    if options.only in (None, "torn"):
        write(options.out / "torn.json", {"made": made(), **torn()})


def write(path: Path, content: dict[str, Any]) -> None:
    """Write numbers as JSON and say so."""
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {path}")


if __name__ == "__main__":
    run_tool(main)
