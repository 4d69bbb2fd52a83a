"""Do viscoelastic strips that wrinkle and tear run at every rate, and at which stretch do they tear?

    python tools/visco_strips.py --device cuda:0 --jobs 8 --out docs/visco-strips.json      all 40, on an H200
    python tools/visco_strips.py --rates 100 --materials yeoh --only-aligned                 one, on a CPU

Rows are saved as they come, beside those of earlier calls.

The strips of `pure_shear_tear` (40 mm high, with a cut), 24 rows, mu = 0.4 MPa, Gc = 8 kJ/m^2, with a Maxwell element
of mu and 1 ms and one of mu and 50 ms. They are pulled at a constant rate to twice the elastic energy at which
Griffith's criterion of Shrimali and Lopez-Pamies (Extreme Mech. Lett. 58, 2023) lets them tear, H W_eq = Gc, and held
for 20 ms. `onset` is the stretch at which the tip has moved by three spacings.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

from study import (
    Row,
    at_least_one,
    device_title,
    in_processes,
    load_rows,
    provenance,
    run_tool,
    save_rows,
    study_parser,
    table,
)

MU, ENERGY, HOLD, ROWS = 0.4e6, 8e3, 0.02, 24
RATES = (0.1, 1.0, 10.0, 100.0, 1000.0)
GRIDS: dict[str, dict[str, float]] = {"aligned": {}, "turned, jittered": {"turn": 37.0, "jitter": 0.2}}
# Of the estimated stable step; where waves run through the strip the energy balance needs more than stability.
SAFETY, FAST, FAST_SAFETY = 0.3, 100.0, 0.1


def run(rate: float, material: str, grid: str, device: str | None, precision: int) -> Row:
    """One strip: how its run ended, its energy balance, losses, and stretch at the onset."""
    import numpy as np

    from warp_pd import (
        Explicit,
        Gent,
        Maxwell,
        Measure,
        Motion,
        NeoHookean,
        Ogden,
        Simulation,
        TearingEnergy,
        TensionField,
        Visco,
        Yeoh,
    )
    from warp_pd.geometry.roughness import rough_surface
    from warp_pd.measures import TearLine, worst_balance
    from warp_pd.scenes.pure_shear_tear import CUT, HEIGHT, LENGTH, stretch_at, strip

    materials = {
        "neo_hookean": NeoHookean(MU, 100.0 * MU), "gent": Gent(MU, 100.0 * MU, 60.0),
        "ogden": Ogden((1.2 * MU, 0.01 * MU), (1.3, 5.0)), "yeoh": Yeoh(0.5 * MU, 0.01 * MU),
    }  # fmt: skip
    rubber = TensionField(materials[material])
    sheet, top, bottom = strip(ROWS, LENGTH, CUT, seed=1, **GRIDS[grid])
    grips, line = np.concatenate([top, bottom]), TearLine(sheet)
    critical, most = (stretch_at(rubber, level * ENERGY / HEIGHT) for level in (1.0, 2.0))
    end = (most - 1.0) / rate
    times, up = [0.0, end, end + HOLD], [0.0, *2 * [0.5 * (most - 1.0) * HEIGHT]]
    tip, ahead = (CUT, 0.5 * HEIGHT), (LENGTH, 0.5 * HEIGHT)
    result = Simulation(
        sheet,
        Visco(rubber, 2.015, branches=(Maxwell(MU, 1e-3), Maxwell(MU, 5e-2))),
        Explicit(times[-1], frames=100, safety=FAST_SAFETY if rate >= FAST else SAFETY),
        loads=[
            Motion(top, times=times, x=0.0, y=up, z=0.0),
            Motion(bottom, times=times, x=0.0, y=[-y for y in up], z=0.0),
        ],
        damage=TearingEnergy(ENERGY, spared=grips),
        initial_displacement=rough_surface(sheet, 1e-3, 0, grips),
        measures=[Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead))],
    ).run(device=device, precision=precision)
    rows, last = result.history, result.history[-1]
    onset = next((1.0 + min(rate * r["time"], most - 1.0) for r in rows if r["tip"] > 3.0 * sheet.spacing), None)
    viscous = np.array([row["viscous"] for row in rows])
    return {
        "rate": rate, "material": material, "grid": grid, "precision": precision, "status": result.status,
        "balance": worst_balance(rows), "onset": onset, "griffith": critical, "most": most, "tip": last["tip"],
        "viscous": last["viscous"], "rupture": last["rupture"], "external": last["external"],
        "least_loss": float(np.diff(viscous).min() / viscous.max()),
    }  # fmt: skip


def main() -> None:
    """Run the strips and print a table."""
    parser = study_parser(__doc__, device=None, jobs=1, out=Path("runs/visco-strips.json"))
    parser.add_argument("--rates", type=float, nargs="+", default=RATES)
    parser.add_argument("--materials", nargs="+", default=("neo_hookean", "gent", "ogden", "yeoh"))
    parser.add_argument("--only-aligned", action="store_true")
    parser.add_argument("--precision", type=at_least_one, default=32, choices=(32, 64))
    options = parser.parse_args()
    grids = list(GRIDS)[: 1 if options.only_aligned else None]
    # The shortest first.
    cases = itertools.product(
        sorted(options.rates, reverse=True), options.materials, grids, [options.device], [options.precision]
    )
    rows: list[dict[str, Any]] = load_rows(options.out)
    for _case, row in in_processes(run, list(cases), options.jobs):
        same = [r for r in rows if all(r[k] == row[k] for k in ("rate", "material", "grid", "precision"))]
        rows = [r for r in rows if r not in same] + [row]
        print(row, flush=True)
        save_rows(options.out, rows)
    rows.sort(key=lambda row: (row["rate"], row["material"], row["grid"]))
    lines = []
    for rate in sorted({row["rate"] for row in rows}):
        some = [row for row in rows if row["rate"] == rate]
        ratios = [row["onset"] / row["griffith"] for row in some if row["onset"]]
        spread = f"{min(ratios):.3f} to {max(ratios):.3f}" if ratios else ""
        ended = sum(row["status"] == "finished" for row in some)
        worst = f"{100.0 * max(row['balance'] or 0.0 for row in some):.2f} %"
        share = max(row["viscous"] / row["external"] for row in some)
        lines.append([f"{rate:g}", f"{ended} of {len(some)}", worst, f"{100.0 * share:.0f} %", spread])
    print(f"\n{provenance(device_title(options.device))}\n")
    head = ["rate (1/s)", "finished", "worst energy balance", "largest viscous loss over work"]
    print("\n".join(table([*head, "stretch at onset over Griffith's"], lines)))


if __name__ == "__main__":
    run_tool(main)
