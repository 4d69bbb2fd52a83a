"""Does an annulus that wrinkles in bending run into the tension field as it becomes thinner?

    python tools/wrinkled_annulus.py --device cpu --jobs 1

The outer rim (100 mm) is fixed, the inner one (20 mm) is pulled inwards by dead radial forces, in three steps that are
held until the sheet rests. Near the inner rim circles become shorter, and the sheet wrinkles along the radii. It is
neo-Hookean and incompressible, mu 1 kPa. Each thickness, and the tension field, is compared with the exact wrinkled
membrane (`membrane`). Prints the tables of docs/bending.md and draws its picture.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from study import DOCS, Row, device_title, in_processes, picture, provenance, run_tool, study_parser, table, whole

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    MooneyRivlin,
    Plate,
    Result,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.parts.loads import ForcesHere

INNER, OUTER, MU = 0.02, 0.1, 1e3
# Pull of the inner rim over its length, thickness and shear modulus.
PULLS = (0.05, 0.10, 0.15)
THICKNESSES = (1e-3, 5e-4, 2.5e-4)
# Radii [m] at which the tables show the radial and the hoop stress.
SHOWN, HOOP_AT = (0.03, 0.04, 0.05), 0.025
# Each pull rises in the first time [s] and is held for the second, with the damping [1/s].
RISE, HOLD, DAMPING = 0.5, 0.7, 6.0
Path = Callable[[float], np.ndarray]


# The exact membrane ------------------------------------------------------------------------------------------


def stresses(stretch: float, hoop: float, mu: float, wrinkles: bool = True) -> tuple[float, float]:
    """Nominal radial and hoop stress [Pa] of a neo-Hookean sheet, wrinkled where circles have become too short."""
    if wrinkles and hoop < stretch**-0.5:
        return mu * (stretch - stretch**-2), 0.0
    return mu * (stretch - stretch**-3 * hoop**-2), mu * (hoop - hoop**-3 * stretch**-2)


def membrane(start: float, pull: float, inner: float, outer: float, mu: float, wrinkles: bool = True) -> Path:
    """Equilibrium d(R P_r)/dR = P_h from the inner rim, which is at `start` [m] under the nominal stress `pull` [Pa].

    Returns:
        Function R -> place r [m] and R P_r [N/m].
    """

    def slopes(radius: float, state: np.ndarray) -> list[float]:
        place, tension = state
        hoop = place / radius
        stretch = brentq(lambda s: stresses(s, hoop, mu, wrinkles)[0] - tension / radius, 0.3, 50.0, xtol=1e-14)
        return [stretch, stresses(stretch, hoop, mu, wrinkles)[1]]

    options = {"rtol": 1e-10, "atol": 1e-13, "dense_output": True, "max_step": 1e-3}
    return solve_ivp(slopes, (inner, outer), [start, pull * inner], **options).sol


def pulled_membrane(pull: float, wrinkles: bool = True) -> Path:
    """The membrane whose outer rim is fixed under a pull [Pa]."""

    def gap(start: float) -> float:
        return float(membrane(start, pull, INNER, OUTER, MU, wrinkles)(OUTER)[0] - OUTER)

    return membrane(brentq(gap, 0.6 * INNER, INNER, xtol=1e-12), pull, INNER, OUTER, MU, wrinkles)


# The sheet ---------------------------------------------------------------------------------------------------


def annulus(around: int, thickness: float) -> Sheet:
    """Circles of `around` points each, whose distance is proportional to their radius."""
    step = 2.0 * np.pi / around
    rings = round(np.log(OUTER / INNER) / (step * np.sqrt(0.75)))
    angles = step * (np.arange(around) + 0.5 * (np.arange(rings + 1)[:, None] % 2))
    radii = INNER * (OUTER / INNER) ** (np.arange(rings + 1)[:, None] / rings)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(-1, 2)
    return Sheet.from_points(points, thickness=thickness, density=1000.0)


def simulation(around: int, thickness: float, relaxed: bool, pulls: Sequence[float] = PULLS) -> Simulation:
    """The sheet with bending, or its tension field; each frame is the end of a hold."""
    sheet = annulus(around, thickness)
    radius = np.linalg.norm(sheet.points, axis=1)
    inside, outside = np.flatnonzero(radius < 1.001 * INNER), np.flatnonzero(radius > 0.999 * OUTER)
    force = np.zeros((len(inside), 3))
    force[:, :2] = -sheet.points[inside] / radius[inside, None] * 2.0 * np.pi * INNER * thickness * MU / len(inside)
    ramp, time = [(0.0, 0.0)], 0.0
    for pull in pulls:
        ramp += [(time + RISE, pull), (time + RISE + HOLD, pull)]
        time += RISE + HOLD
    loads: list[Any] = [Fixed(outside), ForcesHere(inside, force, ramp)]
    start = np.zeros((sheet.size, 3))
    if relaxed:
        loads.append(Fixed(np.setdiff1d(np.arange(sheet.size), outside), "z"))
    else:
        start[:, 2] = 0.02 * thickness * np.random.default_rng(0).normal(size=sheet.size)
        start[outside] = 0.0
        loads.append(Plate())
    material = MooneyRivlin(0.5 * MU)
    law = BondAssociated(TensionField(material) if relaxed else material, horizon=2.015, weights="corrected")
    return Simulation(
        sheet, law, Explicit(time, frames=len(pulls), damping=DAMPING), loads=loads,
        initial_displacement=start, fields=("first_piola",),
        measures=[Measure("shift", "m", lambda built, frame: -float(radial(sheet, frame, inside).mean()))],
    )  # fmt: skip


def radial(sheet: Sheet, frame: Any, points: np.ndarray) -> np.ndarray:
    """Radial displacement of points [m]."""
    outwards = sheet.points[points] / np.linalg.norm(sheet.points[points], axis=1)[:, None]
    return np.einsum("na,na->n", frame.displacement[points, :2], outwards)


def shifts(result: Result) -> list[float]:
    """Inward displacement of the inner rim at the end of each hold [m]."""
    return [row["shift"] for row in result.history[1:]]


def profile(result: Result, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius of each circle [m], and the means of radial and hoop stress over it [Pa] in the last frame."""
    radius = np.linalg.norm(result.built.context.sheet.points, axis=1).reshape(-1, around).mean(axis=1)
    larger, smaller = (result.frame.point_data[f"first_piola_{k}"].reshape(-1, around).mean(axis=1) for k in (1, 2))
    return radius, larger, smaller


# The study ---------------------------------------------------------------------------------------------------


def run(around: int, thickness: float, relaxed: bool, device: str | None) -> Row:
    """One sheet, its displacements and its last state."""
    result = whole(simulation(around, thickness, relaxed).run(device=device, precision=32))
    assert result.status == "finished", result.summary["message"]
    radius, across, along = profile(result, around)
    points, height = result.built.context.sheet.points, result.frame.displacement[:, 2]
    spectrum = np.abs(np.fft.rfft(height[:around]))
    return {
        "thickness": thickness, "relaxed": relaxed, "points": len(height), "shifts": shifts(result),
        "waves": int(spectrum.argmax()), "amplitude": 0.5 * float(np.ptp(height[:around])),
        "kinetic": result.history[-1]["kinetic"] / result.history[-1]["strain"],
        "radius": radius, "radial": across, "hoop": along, "points_flat": points, "height": height,
        "triangles": result.built.context.sheet.triangles,
    }  # fmt: skip


def draw(rows: Sequence[Row]) -> None:
    """Heights of the thickest and the thinnest sheet, and the radial stress of all but for two circles at each rim."""
    bent = [row for row in rows if not row["relaxed"]]
    exact, flat = (pulled_membrane(PULLS[-1] * MU, wrinkles) for wrinkles in (True, False))
    with picture(DOCS / "bending-annulus.png", columns=3, size=(3.4, 3.1)) as axes:
        *seen, curves = axes.flat
        most = max(np.abs(row["height"]).max() for row in bent)
        for axis, row in zip(seen, (bent[0], bent[-1]), strict=True):
            x, y = 1e3 * row["points_flat"].T
            axis.tripcolor(x, y, row["triangles"], 1e3 * row["height"], cmap="RdBu", vmin=-1e3 * most, vmax=1e3 * most)
            axis.set_title(f"{1e3 * row['thickness']:g} mm", fontsize=9)
            axis.set_aspect("equal")
            axis.axis("off")
        for row in rows:
            name = "tension field" if row["relaxed"] else f"{1e3 * row['thickness']:g} mm"
            radius, stress = row["radius"][2:-2], row["radial"][2:-2]
            curves.plot(1e3 * radius, radius * stress / (INNER * MU), label=name, lw=1.2)
        radii = np.linspace(INNER, OUTER, 100)
        for path, style, name in ((exact, "k--", "exact"), (flat, "k:", "flat, exact")):
            curves.plot(1e3 * radii, [path(r)[1] / (INNER * MU) for r in radii], style, label=name, lw=1.0)
        curves.set_xlabel("R (mm)")
        curves.set_ylabel("R P_r / (mu a)")
        curves.legend(fontsize=7, loc=(0.52, 0.2))


def main() -> None:
    """Run the sheets, print the tables and draw the picture."""
    parser = study_parser(__doc__, device=None, jobs=1)
    parser.add_argument("--around", type=int, default=120)
    options = parser.parse_args()
    cases = [(options.around, h, False, options.device) for h in THICKNESSES]
    cases.append((options.around, THICKNESSES[0], True, options.device))
    found = dict(in_processes(run, cases, options.jobs))
    rows = [found[case] for case in cases]
    exact, flat = ([pulled_membrane(p * MU, w) for p in PULLS] for w in (True, False))
    moved = [[INNER - float(path(INNER)[0]) for path in paths] for paths in (exact, flat)]
    lines = []
    for row in rows:
        name = "tension field" if row["relaxed"] else f"{1e3 * row['thickness']:g} mm"
        waves = ["", ""] if row["relaxed"] else [str(row["waves"]), f"{1e3 * row['amplitude']:.2f}"]
        over = [f"{s / e:.4f}" for s, e in zip(row["shifts"], moved[0], strict=True)]
        stress = [f"{_over_exact(row, exact[-1], r):.3f}" for r in SHOWN]
        stress.append(f"{np.interp(HOOP_AT, row['radius'], row['hoop']) / MU:.4f}")
        lines.append([name, *over, *waves, *stress])
    over = [f"{f / e:.4f}" for f, e in zip(moved[1], moved[0], strict=True)]
    stress = [f"{flat[-1](r)[1] / exact[-1](r)[1]:.3f}" for r in SHOWN]
    lines.append(["flat, exact", *over, "", "", *stress, f"{_hoop(flat[-1], HOOP_AT) / MU:.4f}"])
    print(f"{rows[0]['points']} points, {provenance(device_title(options.device))}")
    print("largest kinetic over strain energy at the end", max(row["kinetic"] for row in rows))
    head = [
        "",
        *(f"u at {p:g}" for p in PULLS),
        "waves",
        "amplitude (mm)",
        *(f"R P_r at {1e3 * r:g} mm" for r in SHOWN),
        "P_h / mu",
    ]
    print("\n".join(table(head, lines)))
    draw(rows)


def _over_exact(row: Row, path: Path, radius: float) -> float:
    """R P_r at a radius over that of the exact membrane."""
    return float(np.interp(radius, row["radius"], row["radius"] * row["radial"]) / path(radius)[1])


def _hoop(path: Path, radius: float) -> float:
    """Hoop stress of a flat membrane at a radius [Pa]."""
    place, tension = path(radius)
    hoop = place / radius
    stretch = brentq(lambda s: stresses(s, hoop, MU, False)[0] - tension / radius, 0.3, 50.0)
    return stresses(stretch, hoop, MU, False)[1]


if __name__ == "__main__":
    run_tool(main)
