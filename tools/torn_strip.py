"""Load at tearing against run time: this code, bond-based, and finite elements with the same phase field.

    OMP_NUM_THREADS=1 taskset -c 0 python tools/torn_strip.py --method elements --rows 8 16 24
    OMP_NUM_THREADS=1 taskset -c 0 python tools/torn_strip.py --method family bonds --rows 12 16 24
    python tools/torn_strip.py --picture

The strip of `pure_shear_tear`, in which G = H W(stretch) is exact: it must tear at G = Gc. A row holds G / Gc when the
tip has moved by ten spacings, and the seconds of this processor for the whole run, without compilation. Every call adds
or replaces rows of docs/torn-strip.json.

Finite elements: quadrilaterals of four nodes, a slit, and the field of kernels/damage_field.py (AT1, four elements a
length, Gc less 3 h / 8 l for its elements), by alternate minimisation at loads that grow by 2 % of Gc.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np
from finite_elements import Membrane, incompressible, rectangle
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu
from skfem import MeshQuad
from study import DOCS, build_scene

from warp_pd import BondBased, CriticalStretch
from warp_pd.materials import Bimodular
from warp_pd.scenes.pure_shear_tear import CUT, HEIGHT, LENGTH, MU, THICKNESS

NUMBERS, PICTURE = DOCS / "torn-strip.json", DOCS / "error-vs-time" / "torn-strip.png"
ENERGY, ADVANCE = 2.0, 10
# Change of the field at which minimisation ends, its most rounds at a load, the stiffness that remains.
SETTLED, ROUNDS, REMAINS = 2e-3, 400, 1e-4


def slit_strip(rows: int) -> MeshQuad:
    """Squares, with nodes of their own above the slit."""
    across = round(LENGTH / HEIGHT * rows)
    mesh = rectangle(np.linspace(0.0, LENGTH, across + 1), np.linspace(0.0, HEIGHT, rows + 1), False)
    p, t = mesh.p, mesh.t.copy()
    twins = np.flatnonzero((abs(p[1] - 0.5 * HEIGHT) < 1e-9) & (p[0] < CUT - 1e-9))
    to = np.arange(p.shape[1])
    to[twins] = p.shape[1] + np.arange(len(twins))
    above = p[1][t].mean(axis=0) > 0.5 * HEIGHT
    t[:, above] = to[t[:, above]]
    return MeshQuad(np.hstack([p, p[:, twins]]), t)


def minimiser(matrix: csc_matrix, load: np.ndarray, least: np.ndarray) -> np.ndarray:
    """The d of least d A d / 2 - b d between `least` and 1, by active sets."""
    field, low, high = least.copy(), np.zeros(len(load), bool), np.zeros(len(load), bool)
    for _ in range(60):
        free = ~(low | high)
        field[low], field[high] = least[low], 1.0
        known = load - matrix[:, ~free] @ field[~free]
        field[free] = splu(csc_matrix(matrix[free][:, free])).solve(known[free])
        slope = matrix @ field - load
        now = (low & (slope > 0.0)) | (free & (field < least)), (high & (slope < 0.0)) | (free & (field > 1.0))
        if np.array_equal(now, (low, high)):
            break
        low, high = now
    return np.clip(field, least, 1.0)


def pure_shear(density: float) -> float:
    """Stretch at which MU / 2 (stretch^2 + stretch^-2 - 2) is a density [J/m^3]."""
    half = 1.0 + density / MU
    return float(np.sqrt(half + np.sqrt(half**2 - 1.0)))


def elements(rows: int) -> float | None:
    """G / Gc at which the tip has moved, with finite elements."""
    spacing = HEIGHT / rows
    length = 4.0 * spacing
    energy, base = ENERGY / (1.0 + 3.0 * spacing / (8.0 * length)), incompressible(MU)
    sheet = Membrane(slit_strip(rows), lambda t, d: tuple(left * w for w in base(t, d)), THICKNESS, 2)
    by_gradient, by_value = sheet._operators
    area = sheet.weights.ravel()
    smooth = by_gradient.T @ diags(0.75 * energy * length * np.repeat(area, 2)) @ by_gradient
    y = sheet.nodes[:, 1]
    held = np.repeat(((y < 1e-9) | (y > HEIGHT - 1e-9))[:, None], 2, axis=1)
    # The profile of a tear around the slit, as TearingEnergy has it.
    apart = np.hypot(np.maximum(sheet.nodes[:, 0] - CUT, 0.0), y - 0.5 * HEIGHT)
    field = np.maximum(1.0 - apart / (2.0 * length), 0.0) ** 2
    left = ((1.0 - by_value @ field) ** 2 + REMAINS).reshape(sheet.weights.shape)
    for ratio in [0.1, 0.25, 0.45, 0.65, *np.arange(0.8, 1.6, 0.02)]:
        goal = np.zeros_like(sheet.displacement)
        goal[:, 1] = (pure_shear(ratio * ENERGY / HEIGHT) - 1.0) * (y - 0.5 * HEIGHT)
        least = field.copy()
        for _ in range(ROUNDS):
            sheet.solve(held, goal, tolerance=1e-5)
            G = sheet.deformation()
            C = np.einsum("eqac,eqbc->eqab", G, G)
            density = (0.5 * MU * (np.trace(C, axis1=2, axis2=3) + 1.0 / np.linalg.det(C) - 3.0)).ravel()
            matrix = smooth + by_value.T @ diags(2.0 * density * area) @ by_value
            before = field
            field = minimiser(
                csc_matrix(matrix), by_value.T @ (area * (2.0 * density - 0.375 * energy / length)), least
            )
            left = ((1.0 - by_value @ field) ** 2 + REMAINS).reshape(sheet.weights.shape)
            if sheet.nodes[field > 0.9, 0].max(initial=0.0) - CUT > ADVANCE * spacing:
                return float(ratio)
            if np.abs(field - before).max() < SETTLED:
                break
    return None


def points(rows: int, law: str, device: str | None) -> tuple[float | None, float]:
    """The same with this package, by families or by bonds, and the seconds of its run."""
    scene = build_scene(
        "pure_shear_tear", {"points": rows, "horizon": 3.15 if law == "bonds" else 2.015, "overload": 2.0}
    )
    if law == "bonds":
        reach = 3.15 * scene.sheet.spacing
        critical = float(np.sqrt(4.0 * np.pi * ENERGY / (9.0 * 3.0 * MU * reach)))
        bonds = BondBased(Bimodular(3.0 * MU), horizon=3.15)
        scene = replace(scene, force=bonds, damage=CriticalStretch(1.0 + critical, spared=scene.damage.spared))
    scene.build(device).context.compile()
    begin = process_time()
    result = scene.run(device=device)
    seconds = process_time() - begin
    row = next((r for r in result.history if r["tip"] > ADVANCE * scene.sheet.spacing), None)
    if row is None:
        return None, seconds
    if law == "family":
        return row["release_ratio"], seconds
    # The mean over directions of 4.5 MU (stretch of a bond - 1)^2: 9/16 E strain^2 while small.
    angle = np.linspace(0.0, np.pi, 400, endpoint=False)
    density = 4.5 * MU * float(((np.hypot(np.cos(angle), row["stretch"] * np.sin(angle)) - 1.0) ** 2).mean())
    return density * HEIGHT / ENERGY, seconds


def picture(rows: list[dict[str, Any]]) -> None:
    """Error of the load at tearing against time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.5, 4.0), layout="constrained")
    axes = figure.subplots()
    for method, mark in (("elements", "s-"), ("family", "o-"), ("bonds", "^-")):
        found = sorted((r["seconds"], abs(r["onset"] - 1.0)) for r in rows if r["method"] == method and r["onset"])
        if found:
            axes.loglog(*np.transpose(found), mark, label=method)
    axes.set(xlabel="time on one core (s)", ylabel="|G / Gc - 1| at tearing")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(PICTURE, dpi=130)


def main() -> None:
    """Run, and keep the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", nargs="*", default=[], choices=["elements", "family", "bonds"])
    parser.add_argument("--rows", type=int, nargs="*", default=[], help="even numbers: rows of points or elements")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--picture", action="store_true")
    options = parser.parse_args()
    rows = json.loads(NUMBERS.read_text()) if NUMBERS.is_file() else []
    for method in options.method:
        for count in options.rows:
            begin = process_time()
            onset, seconds = (None, 0.0) if method == "elements" else points(count, method, options.device)
            if method == "elements":
                onset, seconds = elements(count), process_time() - begin
            row = {"method": method, "rows": count, "onset": onset, "seconds": round(seconds, 2), "on": options.device}
            same = ("method", "rows", "on")
            rows = [r for r in rows if any(r[key] != row[key] for key in same)] + [row]
            print(row, flush=True)
            NUMBERS.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")
    if options.picture:
        picture(rows)


if __name__ == "__main__":
    main()
