"""Error against run time of the force laws: one sheet, one device, one run.

    python tools/law_cost.py                                      # this CPU, 51 points a side
    python tools/law_cost.py --device cuda:0                      # the same sheet there
    python tools/law_cost.py --device cuda:0 --timed-points 1001  # times on a sheet that fills the GPU

Times are those of one evaluation of the internal force, as a step makes it (on CUDA, from its graph); errors those of
the deflection of `pressure_static` (NN 6.1, 20 Pa) at rest, by relaxation, against finite elements. Every call adds or
replaces the device's file in docs/law-cost/ and makes docs/law-cost.png and the table between the marks of
docs/neural-law.md anew, from the files of all devices.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp
from stamp import device_name, one_line, stamp
from tqdm import tqdm

from warp_pd import BondAssociated, Explicit, Fixed, NeoHookean, Neural, Nodal, Pressure, Relaxation, Sheet, Simulation
from warp_pd.forces import ForceLaw
from warp_pd.runner import write_aside

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, FOLDER = DOCS / "neural-law.md", DOCS / "law-cost"
BEGIN, END = "<!-- table of tools/law_cost.py -->", "<!-- end of the table -->"
FE = 0.302585
HORIZONS = (1.5, 2.015, 3.15)
TOLERANCE = {32: 1e-4, 64: 1e-6}
MATERIAL = NeoHookean(mu=1e3, bulk=100e3)


def laws() -> dict[str, ForceLaw]:
    """Every law at every horizon, by name."""
    found: dict[str, ForceLaw] = {}
    for m in HORIZONS:
        found[f"nodal, {m:g}"] = Nodal(MATERIAL, horizon=m)
        found[f"neural (a) Torch, {m:g}"] = Neural(MATERIAL, horizon=m)
        found[f"neural (b) fused, {m:g}"] = Neural(MATERIAL, horizon=m, evaluation="fused")
        found[f"closed form, {m:g}"] = Neural(MATERIAL, horizon=m, evaluation="closed_form")
        for weights in ("published", "plain", "corrected"):
            found[f"bond-associated {weights}, {m:g}"] = BondAssociated(MATERIAL, horizon=m, weights=weights)
    return found


def square(points: int) -> Sheet:
    """The sheet of NN 6.1."""
    return Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)


def time_of(law: ForceLaw, points: int, device: str, bits: int) -> tuple[float, int]:
    """Seconds of one evaluation of the force of a stretched, waved sheet, the least of five rounds; bonds."""
    sheet = square(points)
    built = Simulation(sheet, force=law, solver=Explicit(1.0)).build(device, bits)
    built.workspace.compile()
    x, y = sheet.points.T
    u = np.column_stack([0.1 * x, 0.05 * y, 0.1 * np.sin(6.0 * x) * np.sin(5.0 * y)])
    built.state.displacement.assign(u.astype(built.state.displacement.numpy().dtype))
    force = built.workspace.sequence("setup")
    force.run()
    wp.synchronize_device(built.workspace.device)
    rounds, repeat = [], 1
    while len(rounds) < 5:
        begin = perf_counter()
        for _ in range(repeat):
            force.run()
        wp.synchronize_device(built.workspace.device)
        seconds = perf_counter() - begin
        if seconds < 0.05 and repeat < 1000:
            repeat *= 4
            continue
        rounds.append(seconds / repeat)
    return min(rounds), built.force.families.bond_count


def error_of(law: ForceLaw, points: int, device: str, bits: int) -> float | None:
    """Relative error of the deflection at the centre; None where the sheet found no rest."""
    sheet = square(points)
    centre = sheet.nearest(0.5, 0.5)
    result = Simulation(
        sheet,
        force=law,
        solver=Relaxation(tolerance=TOLERANCE[bits], most_steps=20_000),
        loads=[Fixed(sheet.edges("all")), Pressure(20.0)],
    ).run(device=device, precision=bits)
    if result.status != "finished":
        return None
    return float(result.frame.displacement[centre, 2]) / FE - 1.0


def measure(device: str, points: int, timed: int, only: str) -> dict[str, Any]:
    """All rows of one device."""
    chosen = {name: law for name, law in laws().items() if only in name}
    rows = []
    for name, law in tqdm(chosen.items()):
        for bits in (32, 64):
            seconds, bonds = time_of(law, timed, device, bits)
            error = error_of(law, points, device, bits)
            rows.append({"law": name, "bits": bits, "seconds": seconds, "bonds": bonds, "error": error})
    title = wp.get_device(device).name
    return {"device": title, "made": stamp(title), "points": points, "timed_points": timed, "rows": rows}


def table(runs: list[dict[str, Any]]) -> str:
    """One markdown table: a row a law, columns for each device and precision."""
    names = list(dict.fromkeys(row["law"] for run in runs for row in run["rows"]))
    head, rule = ["law, horizon"], ["---"]
    for run in runs:
        kind = f"{run['device']}, {run['timed_points']}²"
        for bits in (32, 64):
            head += [f"{kind}: ns a bond, float{bits}", "ns a point", f"error ({run['points']}²)"]
            rule += ["---"] * 3
    lines = ["| " + " | ".join(head) + " |", "|" + "|".join(rule) + "|"]
    for name in names:
        cells = [name]
        for run in runs:
            for bits in (32, 64):
                row = next((r for r in run["rows"] if r["law"] == name and r["bits"] == bits), None)
                if row is None:
                    cells += ["", "", ""]
                    continue
                error = "no rest" if row["error"] is None else f"{100.0 * row['error']:+.2f} %"
                nanoseconds = 1e9 * row["seconds"]
                per_point = nanoseconds / run["timed_points"] ** 2
                cells += [f"{nanoseconds / row['bonds']:.3g}", f"{per_point:.3g}", error]
        lines.append("| " + " | ".join(cells) + " |")
    made = ["", *(f"- {run['made']}: errors {run['points']}², times {run['timed_points']}² points." for run in runs)]
    return "\n".join(lines + made) + "\n"


def plot(path: Path, runs: list[dict[str, Any]]) -> None:
    """Error over time a point, a panel for each device and precision."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure, axes = plt.subplots(
        len(runs), 2, figsize=(12.0, 4.8 * len(runs)), layout="constrained", squeeze=False, sharey=True
    )
    kinds = list(dict.fromkeys(row["law"].rsplit(",", 1)[0] for run in runs for row in run["rows"]))
    for across, run in zip(axes, runs, strict=True):
        for ax, bits in zip(across, (32, 64), strict=True):
            for c, kind in enumerate(kinds):
                shown = [
                    (
                        1e9 * r["seconds"] / run["timed_points"] ** 2,
                        100.0 * abs(r["error"]),
                        r["law"].rsplit(", ", 1)[1],
                    )
                    for r in run["rows"]
                    if r["law"].rsplit(",", 1)[0] == kind and r["bits"] == bits and r["error"] is not None
                ]
                if not shown:
                    continue
                x, y, m = zip(*shown, strict=True)
                ax.loglog(x, y, "o-", color=f"C{c}", label=kind)
                for at in zip(x, y, m, strict=True):
                    ax.annotate(at[2], at[:2], fontsize=7, xytext=(3, 3), textcoords="offset points")
            ax.set(title=f"{run['device']}, float{bits}", xlabel="force, ns a point", ylabel="error of deflection (%)")
            ax.xaxis.set(
                major_locator=LogLocator(subs=(1.0, 2.0, 5.0)), major_formatter=StrMethodFormatter("{x:g}"),
                minor_formatter=NullFormatter(),
            )  # fmt: skip
            ax.grid(alpha=0.3, which="both")
    axes[0][0].legend(fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    """Measure, then make table and plot of all devices."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--points", type=int, default=51, help="Points a side of the sheet that is solved.")
    parser.add_argument(
        "--timed-points", type=int, help="Points a side of the sheet that is timed; the same by default."
    )
    parser.add_argument("--only", default="", help="Only laws whose name holds this text.")
    parser.add_argument("--redraw", action="store_true", help="Measure nothing, only make table and plot anew.")
    parser.add_argument("--name", help="Name of the device's file; by default cpu or cuda and the timed points.")
    given = parser.parse_args()
    if not given.redraw:
        wp.init()
        timed = given.timed_points or given.points
        run = measure(given.device, given.points, timed, given.only)
        FOLDER.mkdir(exist_ok=True)
        name = given.name or f"{given.device.split(':')[0]}_{timed}"
        write_aside(FOLDER / f"{name}.json", json.dumps(run, indent=1) + "\n")
    runs = [json.loads(path.read_text()) for path in sorted(FOLDER.glob("*.json"))]
    text = table(runs)
    print(text)
    plot(DOCS / "law-cost.png", runs)
    page = PAGE.read_text() if PAGE.is_file() else f"{BEGIN}\n{END}\n"
    before, rest = page.split(BEGIN)
    write_aside(PAGE, before + BEGIN + "\n\n" + text + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    one_line(main)
