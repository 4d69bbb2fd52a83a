"""Error against run time of the force laws: one sheet on one device.

    python tools/law_cost.py                                      # this CPU, 51 points a side
    python tools/law_cost.py --device cuda:0                      # the same sheet on a GPU
    python tools/law_cost.py --device cuda:0 --timed-points 1001  # times on a sheet that fills the GPU

Times are those of one evaluation of the internal force, as a step does it (on CUDA from its graph). Errors are those
of the static deflection of `pressure_static` (NN 6.1, 20 Pa) by relaxation, against finite elements. Every call adds
or replaces the file of its device in law-cost/ beside the page. Then it draws law-cost.png and rewrites the table
between the marks of the page, from the files of all devices.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp
from study import DOCS, provenance, run_tool, study_parser, table, write_page
from tqdm import tqdm

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    InputError,
    NeoHookean,
    Neural,
    Nodal,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.interfaces import Law
from warp_pd.interfaces.context import find_device
from warp_pd.run.folder import write_atomically

PAGE = DOCS / "neural-law.md"
BEGIN, END = "<!-- table of tools/law_cost.py -->", "<!-- end of the table -->"
# Deflection of the centre by finite elements [m].
FE = 0.302585
HORIZONS = (1.5, 2.015, 3.15)
TOLERANCE = {32: 1e-4, 64: 1e-6}
MATERIAL = NeoHookean(mu=1e3, bulk=100e3)


def laws() -> dict[str, Law]:
    """Every law at every horizon, by name."""
    found: dict[str, Law] = {}
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


def time_of(law: Law, points: int, device: str, bits: int) -> tuple[float, int]:
    """Seconds of one evaluation of the force of a stretched and waved sheet, the least of five rounds; and bonds."""
    sheet = square(points)
    built = Simulation(sheet, force=law, solver=Explicit(1.0)).build(device, bits)
    built.context.compile()
    x, y = sheet.points.T
    u = np.column_stack([0.1 * x, 0.05 * y, 0.1 * np.sin(6.0 * x) * np.sin(5.0 * y)])
    built.state.displacement.assign(u.astype(built.state.displacement.numpy().dtype))
    force = built.context.sequence("setup")
    force.run()
    wp.synchronize_device(built.context.device)
    rounds, repeat = [], 1
    while len(rounds) < 5:
        begin = perf_counter()
        for _ in range(repeat):
            force.run()
        wp.synchronize_device(built.context.device)
        seconds = perf_counter() - begin
        if seconds < 0.05 and repeat < 1000:
            repeat *= 4
            continue
        rounds.append(seconds / repeat)
    return min(rounds), built.law.families.bond_count


def error_of(law: Law, points: int, device: str, bits: int) -> float | None:
    """Relative error of the deflection of the centre; None if no static equilibrium was found."""
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


def measure(device: str, points: int, timed: int, only: str, commit: str | None) -> dict[str, Any]:
    """All rows of one device."""
    chosen = {name: law for name, law in laws().items() if only in name}
    rows = []
    for name, law in tqdm(chosen.items()):
        for bits in (32, 64):
            seconds, bonds = time_of(law, timed, device, bits)
            error = error_of(law, points, device, bits)
            rows.append({"law": name, "bits": bits, "seconds": seconds, "bonds": bonds, "error": error})
    title = find_device(device).name
    return {"device": title, "made": provenance(title, commit), "points": points, "timed_points": timed, "rows": rows}


def laws_table(runs: list[dict[str, Any]]) -> str:
    """One markdown table: a row per law, columns for each device and precision."""
    names = list(dict.fromkeys(row["law"] for run in runs for row in run["rows"]))
    head = ["law, horizon"]
    for run in runs:
        where = f"{run['device']}, {run['timed_points']}²"
        for bits in (32, 64):
            head += [f"{where}: ns a bond, float{bits}", "ns a point", f"error ({run['points']}²)"]
    rows = [[name, *(cell for run in runs for bits in (32, 64) for cell in cells(run, name, bits))] for name in names]
    made = [f"- {run['made']}: errors {run['points']}², times {run['timed_points']}² points." for run in runs]
    return "\n".join([*table(head, rows), "", *made]) + "\n"


def cells(run: dict[str, Any], name: str, bits: int) -> list[str]:
    """Time a bond, time a point and error of a law; empty where it was not measured."""
    row = next((r for r in run["rows"] if r["law"] == name and r["bits"] == bits), None)
    if row is None:
        return ["", "", ""]
    error = "no equilibrium" if row["error"] is None else f"{100.0 * row['error']:+.2f} %"
    nanoseconds = 1e9 * row["seconds"]
    return [f"{nanoseconds / row['bonds']:.3g}", f"{nanoseconds / run['timed_points'] ** 2:.3g}", error]


def plot(path: Path, runs: list[dict[str, Any]]) -> None:
    """Error over time a point, a panel for each device and precision."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure, axes = plt.subplots(
        len(runs), 2, figsize=(12.0, 4.8 * len(runs)), layout="constrained", squeeze=False, sharey=True
    )
    names = list(dict.fromkeys(row["law"].rsplit(",", 1)[0] for run in runs for row in run["rows"]))
    for across, run in zip(axes, runs, strict=True):
        for ax, bits in zip(across, (32, 64), strict=True):
            for c, name in enumerate(names):
                shown = [
                    (
                        1e9 * r["seconds"] / run["timed_points"] ** 2,
                        100.0 * abs(r["error"]),
                        r["law"].rsplit(", ", 1)[1],
                    )
                    for r in run["rows"]
                    if r["law"].rsplit(",", 1)[0] == name and r["bits"] == bits and r["error"] is not None
                ]
                if not shown:
                    continue
                x, y, m = zip(*shown, strict=True)
                ax.loglog(x, y, "o-", color=f"C{c}", label=name)
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


def with_table(path: Path, text: str) -> str:
    """The page with another table between its marks; a page of the table alone if there is none yet.

    Raises:
        InputError: for a page without the marks.
    """
    page = path.read_text() if path.is_file() else f"{BEGIN}\n{END}\n"
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"--out: {path} has no place for the table; expected the lines {BEGIN!r} and {END!r}")
    return f"{before}{BEGIN}\n\n{text}\n{END}{after}"


def main() -> None:
    """Measure, then make table and plot of all devices."""
    parser = study_parser(__doc__, device="cpu", out=PAGE, only_page=False, commit=None)
    parser.add_argument("--points", type=int, default=51, help="along a side of the sheet that is solved")
    parser.add_argument(
        "--timed-points", type=int, help="along a side of the sheet that is timed; by default the same number"
    )
    parser.add_argument("--only", default="", help="only laws whose name contains this text")
    parser.add_argument("--redraw", dest="only_page", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--name", help="name of the file of the device; by default cpu or cuda, and the timed points")
    options = parser.parse_args()
    folder: Path = options.out.parent / "law-cost"
    folder.mkdir(parents=True, exist_ok=True)
    if not options.only_page:
        timed = options.timed_points or options.points
        run = measure(options.device, options.points, timed, options.only, options.commit)
        name = options.name or f"{options.device.split(':')[0]}_{timed}"
        write_atomically(folder / f"{name}.json", json.dumps(run, indent=1) + "\n")
    runs = [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]
    if not runs:
        raise InputError(f"--only-page: {folder} holds no measurements; expected those of an earlier call")
    text = laws_table(runs)
    print(text)
    plot(folder.with_suffix(".png"), runs)
    write_page(options.out, with_table(options.out, text))


if __name__ == "__main__":
    run_tool(main)
