"""Stiff and extreme cases with every law, at the default step: the tables of docs/stability.md.

    python -m tools.stability                                   # small sheets; a CPU takes ten minutes to compile
    python -m tools.stability --only "K/mu = 1e+06" --laws plain published
    python -m tools.stability --ball 101 --device cuda:0        # the ball of NN 6.4, critical stretch 1.3
    python -m tools.stability --only-page

Sheets of 1 m, in which a shear wave goes 1 m/s, held at all edges and released, in float32. A row is written as soon as
it is there. `tests/core/test_extreme_cases.py` runs the same cases with the laws that have an energy.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import bisect

if __package__:
    # Called by `python -m`: the other tools are in this folder.
    sys.path.insert(0, str(Path(__file__).resolve().parent))

from study import (
    DOCS,
    at_least_one,
    build_scene,
    device_title,
    load_rows,
    provenance,
    renew,
    run_tool,
    save_rows,
    study_parser,
    table,
    whole,
)

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    Explicit,
    Fixed,
    Gent,
    HyperelasticBonds,
    InputError,
    NeoHookean,
    Neural,
    Nodal,
    Prony,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.interfaces import DivergedError

NUMBERS, PAGE = DOCS / "stability.json", DOCS / "stability.md"
MU = 1e3
RUBBER = NeoHookean(MU, 100.0 * MU)
PRONY = (Prony(125.0, time=0.1), Prony(50.0, time=1.0, exponent=1.6665))
LAWS = {
    "plain": lambda material: BondAssociated(material, weights="plain"),
    "corrected": lambda material: BondAssociated(material, weights="corrected"),
    "visco": lambda material: Visco(material, prony=PRONY, weights="corrected"),
    "nodal": Nodal,
    "bond-based": lambda material: BondBased(Bimodular(3.0 * MU)),
}
# The papers' own laws; those of bonds have one material.
PAPERS = {
    "BA published": lambda material: BondAssociated(material, horizon=3.15, weights="published"),
    "NN closed form": lambda material: Neural(material, evaluation="closed_form", weights="published"),
    "NN closed form, corrected": lambda material: Neural(material, evaluation="closed_form", weights="corrected"),
    "NN network": lambda material: Neural(material, evaluation="fused", weights="published"),
    "HE": lambda material: HyperelasticBonds(BondNeoHookean(MU), horizon=3.015),
    "VE": lambda material: ViscoBondBased(Yeoh(0.5 * MU, 0.05 * MU), 3.015, prony=PRONY),
    "IM, E- = 0": lambda material: BondBased(Bimodular(3.0 * MU, 0.0), horizon=3.0),
}
ONE_MATERIAL = ("bond-based", "NN network", "HE", "VE", "IM, E- = 0")


def metre(points: int = 9, areas: str = "shared") -> Sheet:
    """A square of 1 m."""
    return Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1e3, points=points, areas=areas)


def stretched(sheet: Sheet, a: float, b: float) -> np.ndarray:
    """Displacement of a uniform stretch about the middle, shape (N, 3)."""
    return (sheet.positions - sheet.positions.mean(axis=0)) * [a - 1.0, b - 1.0, 0.0]


def smooth(sheet: Sheet, amount: float) -> np.ndarray:
    """In and out of the plane, zero at the edges."""
    x, y = sheet.points.T
    bump = amount * np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.column_stack([0.5 * bump * np.sin(2.0 * np.pi * y), -0.3 * bump * x, bump])


def rough(sheet: Sheet, share: float) -> np.ndarray:
    """Random, of up to a share of the spacing, zero at the edges."""
    noise = np.random.default_rng(0).uniform(-share, share, (sheet.size, 3)) * sheet.spacing
    noise[sheet.edges("all")] = 0.0
    return noise


def point_moved(x: float, z: float, areas: str) -> tuple[Sheet, np.ndarray, None]:
    """The middle point is elsewhere, in spacings: its bonds are turned."""
    sheet = metre(7, areas)
    start = np.zeros((sheet.size, 3))
    start[sheet.nearest(0.5, 0.5)] = np.array([x, 0.0, z]) * sheet.spacing
    return sheet, start, None


def compressed(areas: str) -> tuple[Sheet, np.ndarray, None]:
    """To half its size, and rough."""
    sheet = metre(areas=areas)
    return sheet, stretched(sheet, 0.5, 0.5) + rough(sheet, 0.01), None


def cloud_of(points: np.ndarray, triangles: np.ndarray, spacing: float) -> tuple[Sheet, np.ndarray, np.ndarray]:
    """Stretched and shaken."""
    sheet = Sheet.from_points(points, thickness=0.01, density=1e3, triangles=triangles, spacing=spacing)
    velocity = smooth(sheet, 0.3)
    velocity[sheet.edges("all")] = 0.0
    return sheet, stretched(sheet, 1.2, 1.1), velocity


def jittered(_areas: str) -> tuple[Sheet, np.ndarray, np.ndarray]:
    """By 0.45 spacings."""
    sheet = metre()
    return cloud_of(sheet.points + rough(sheet, 0.45)[:, :2], sheet.triangles, sheet.spacing)


def graded(ratio: float, _areas: str) -> tuple[Sheet, np.ndarray, np.ndarray]:
    """The spacing grows by this factor from one corner to the other."""
    steps = np.geomspace(1.0, ratio, 7)
    x = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    points = np.column_stack([values.ravel() for values in np.meshgrid(x, x)])
    return cloud_of(points, metre(8).triangles, 0.8 * steps[-1] / steps.sum())


def rough_start(a: float, b: float, share: float, areas: str) -> tuple[Sheet, np.ndarray, None]:
    """Stretched, and displaced from there."""
    sheet = metre(areas=areas)
    return sheet, stretched(sheet, a, b) + share * (smooth(sheet, 0.02) + rough(sheet, 0.01)), None


def at_lock(lock: float, areas: str) -> tuple[Sheet, np.ndarray, None]:
    """99 % of the lock, incompressible: 2 a^2 + a^-4 - 3 of it."""
    a = bisect(lambda a: 2.0 * a**2 + a**-4 - 3.0 - 0.99 * lock, 1.001, 40.0)
    return rough_start(a, a, 0.01, areas)


# Material, function from the areas of points on edges to the sheet and its start, seconds, frames.
CASES: dict[str, Any] = {
    "a bond turned by 90 degrees": (RUBBER, partial(point_moved, 1.0, -1.0), 2.0, 40),
    "a bond turned by 180 degrees": (RUBBER, partial(point_moved, 1.9, 0.0), 2.0, 40),
    "compressed to half its size": (RUBBER, compressed, 4.0, 40),
    "jittered by 0.45 spacings": (RUBBER, jittered, 2.0, 20),
    "graded 4:1": (RUBBER, partial(graded, 4.0), 2.0, 20),
    "graded 10:1": (RUBBER, partial(graded, 10.0), 2.0, 20),
    **{
        f"K/mu = {k:g}": (NeoHookean(MU, k * MU), partial(rough_start, 1.3, 0.9, 1.0), 2.0, 20) for k in (1.0, 1e4, 1e6)
    },
    **{f"lock {j:g}": (Gent(MU, 1e4 * MU, j), partial(at_lock, j), 2.0, 20) for j in (200.0, 10.0, 3.0, 1.0)},
}


def has(law: str, case: str) -> bool:
    """Whether the law can have the case: bonds and the network have one material."""
    return law not in ONE_MATERIAL or CASES[case][0] is RUBBER


def simulation(case: str, law: str) -> Simulation:
    """A case with a law."""
    material, sheet_of, seconds, frames = CASES[case]
    # BA and NN count one area a point (docs/papers/ba.md, readings).
    published = law.startswith(("BA", "NN")) and "corrected" not in law
    sheet, start, velocity = sheet_of("whole" if published else "shared")
    return Simulation(
        sheet, (LAWS | PAPERS)[law](material), Explicit(seconds, frames=frames), loads=[Fixed(sheet.edges("all"))],
        initial_displacement=start, initial_velocity=velocity,
    )  # fmt: skip


def outcome(case: str, law: str, device: str | None) -> str:
    """How the run ends: its worst energy balance, "finished" for laws without energy, or why it does not."""
    try:
        result = whole(simulation(case, law).run(device=device))
    except InputError:
        return "refused"
    except DivergedError as error:
        return _diverged(str(error))
    if result.status != "finished":
        return _diverged(result.summary["message"] or result.status)
    errors = [abs(row["balance_error"]) for row in result.history if row.get("balance_error") is not None]
    return f"{100.0 * max(errors):.2g} %" if errors else "finished"


def _diverged(message: str) -> str:
    time = message.partition("t = ")[2].split(" ")[0]
    return f"diverged at {time} s" if time else "diverged"


def ball(law: str, settings: dict[str, Any], device: str | None) -> str:
    """The ball of NN 6.4 on bonds that break: its end and worst energy balance."""
    result = whole(build_scene("ball_penetration", settings).run(device=device, usd=False, pictures=False))
    if result.status != "finished":
        return _diverged(result.summary["message"] or result.status)
    worst = result.summary["measures"].get("worst_energy_balance", {}).get("value")
    return "finished" if worst is None else f"finished, {100.0 * worst:.2g} %"


BALLS = {
    **{f"plain, {m:g} spacings": {"weights": "plain", "horizon": m} for m in (2.015, 3.15, 4.15)},
    "BA published": {"weights": "published", "horizon": 3.15, "wrinkles": "resolved"},
    "NN closed form": {"force": "closed_form", "weights": "published", "horizon": 3.15},
    "NN network": {"force": "neural_fused", "weights": "published", "horizon": 3.15},
}


def main() -> None:
    """Run, keep the rows, renew the page."""
    parser = study_parser(__doc__, device=None, out=NUMBERS, only_page=False, missing=False)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES), metavar="CASE", help="names of cases")
    parser.add_argument("--laws", nargs="+", choices=LAWS | PAPERS, default=list(LAWS | PAPERS), metavar="LAW")
    parser.add_argument("--ball", type=at_least_one, metavar="POINTS", help="run the ball, with points along a side")
    options = parser.parse_args()
    rows = load_rows(options.out)
    made = provenance(device_title(options.device))

    def keep(kind: str, case: str, law: str, found: str) -> None:
        rows[:] = [row for row in rows if (row["kind"], row["case"], row["law"]) != (kind, case, law)]
        rows.append({"kind": kind, "case": case, "law": law, "found": found, "points": options.ball, "made": made})
        save_rows(options.out, rows)
        print(f"{case}, {law}: {found}", flush=True)

    known = {(row["kind"], row["case"], row["law"]) for row in rows if options.missing}
    if not options.only_page and options.ball is None:
        for law in options.laws:
            for case in options.only:
                if has(law, case) and ("sheet", case, law) not in known:
                    keep("sheet", case, law, outcome(case, law, options.device))
    for law, settings in BALLS.items() if options.ball is not None and not options.only_page else ():
        for damping in (0.0, 2.0):
            case = f"damping {damping:g} /s"
            given = {"points": options.ball, "critical_stretch": 1.3, "damping": damping, **settings}
            if ("ball", case, law) not in known:
                keep("ball", case, law, ball(law, given, options.device))
    if options.out == NUMBERS:
        renew(PAGE, sections(rows))


def sections(rows: list[dict[str, Any]]) -> dict[str, list[str]]:
    """The tables of the page, by heading."""
    found = {(row["kind"], row["case"], row["law"]): row["found"] for row in rows}
    made = {kind: sorted({row["made"] for row in rows if row["kind"] == kind}) for kind in ("sheet", "ball")}

    def line(law: str) -> list[str]:
        ends = {case: found["sheet", case, law] for case in CASES if ("sheet", case, law) in found}
        balances = {case: end for case, end in ends.items() if end.endswith("%")}
        worst = max(balances, key=lambda case: float(balances[case][:-2]), default=None)
        refused = ", ".join(case for case, end in ends.items() if end == "refused")
        diverged = ", ".join(f"{case}{end[8:]}" for case, end in ends.items() if end.startswith("diverged"))
        balance = f"{balances[worst]}: {worst}" if worst else "has no energy"
        return [law, str(len(ends)), balance, refused, diverged]

    tables = {
        "## Every law": [
            f"`python -m tools.stability`; {'; '.join(made['sheet'])}; published weights with one area a point. "
            "`docs/stability.json` has each case.", "",
            *table(["law", "cases", "worst energy balance", "refused", "diverged"], map(line, LAWS | PAPERS)),
        ],
    }  # fmt: skip
    if made["ball"]:
        points = max(row["points"] for row in rows if row["kind"] == "ball")
        balls = [[law, *(found.get(("ball", f"damping {d:g} /s", law), "") for d in (0.0, 2.0))] for law in BALLS]
        words = (
            f"`python -m tools.stability --ball {points}`; {'; '.join(made['ball'])}: NN 6.4, critical stretch 1.3, at "
            "the scene's step; worst error of the energy balance."
        )
        tables["## The ball"] = [words, "", *table(["weights", "undamped", "damping 2 /s"], balls)]
    return tables


if __name__ == "__main__":
    run_tool(main)
