"""Measure what every scene costs, and what it would cost with features that it does not use.

    python tools/scene_costs.py                          # this CPU; writes docs/what-a-scene-costs.md
    python tools/scene_costs.py --device cuda:0 --out FILE

Static scenes are timed with the steps of explicit dynamics, so that all times mean the same. The tool adds energy
sums, rupture (at a stretch that nothing reaches), a ball (that touches nothing), mass damping, and a pressure of zero,
wherever the scene and its law allow a feature and do not have it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from study import DOCS, page_header, paragraph, run_tool, study_parser, table, table_row, write_page

from warp_pd import Built, CriticalStretch, Explicit, InputError, Pressure, RigidBall, Simulation
from warp_pd.__main__ import build_scene, scene_names
from warp_pd.device.checks import positive
from warp_pd.interfaces.context import find_device
from warp_pd.run.bench import time_step

# Alternating measurements of each scene with and without the features; the best counts.
ROUNDS = 4
HEAD = ["scene", "points", "arrays", "parts of a step", "bytes a point", "step (us)", "times", "added features"]


@dataclass(frozen=True)
class Cost:
    """What a scene takes: arrays and their bytes a point, parts of a step, time of a step [s]."""

    points: int
    arrays: int
    bytes_per_point: float
    parts: int
    step: float


def minimal(name: str, settings: dict[str, object]) -> Simulation:
    """The scene with explicit steps, and without the sums that only the energy balance needs."""
    simulation = build_scene(name, settings)
    if not isinstance(simulation.solver, Explicit):
        simulation = dataclasses.replace(simulation, solver=Explicit(1.0))
    return dataclasses.replace(simulation, track_energy=False, fields=())


def with_all_features(simulation: Simulation, device: str) -> tuple[Simulation, list[str]]:
    """The scene with all features that it can have, and the names of those that were added."""
    added = ["energy sums"]
    simulation = dataclasses.replace(simulation, track_energy=True)
    solver = simulation.solver
    assert isinstance(solver, Explicit)
    if solver.damping == 0.0:
        simulation = dataclasses.replace(simulation, solver=dataclasses.replace(solver, damping=1e-9))
        added.append("damping")
    low, high = simulation.sheet.points.min(axis=0), simulation.sheet.points.max(axis=0)
    size = float((high - low).max())
    ball = RigidBall(diameter=size, start=(0.0, 0.0, 100.0 * size), velocity=(0.0, 0.0, 1e-9 * size))
    extra = [
        ("rupture", {"damage": CriticalStretch(1e6)}, simulation.damage is None),
        ("contact", {"contact": ball}, simulation.contact is None),
        (
            "pressure",
            {"loads": [*simulation.loads, Pressure(0.0)]},
            not any(isinstance(load, Pressure) for load in simulation.loads),
        ),
    ]
    for name, change, missing in extra:
        if missing:
            changed = dataclasses.replace(simulation, **change)  # type: ignore[arg-type]
            try:
                changed.build(device, 32)
            except InputError:
                continue
            simulation = changed
            added.append(name)
    return simulation, added


def cost(built: Built, step: float) -> Cost:
    """What a built scene takes."""
    context, points = built.context, built.simulation.sheet.size
    return Cost(
        points=points,
        arrays=len(context.fields.stored),
        bytes_per_point=context.fields.nbytes / points,
        parts=sum(len(launch.parts) for launch in context.stages["step"]),
        step=step,
    )


def costs(pair: Sequence[Simulation], device: str, seconds: float) -> list[Cost]:
    """Build both, time them in turn, so that other load on the machine affects both; the best of each."""
    built = [simulation.build(device, 32) for simulation in pair]
    for one in built:
        one.context.compile()
    steps = [[time_step(one, seconds / ROUNDS, 3)[0] for one in built] for _ in range(ROUNDS)]
    return [cost(one, min(row[k] for row in steps)) for k, one in enumerate(built)]


def row(name: str, device: str, seconds: float, settings: dict[str, object]) -> list[str]:
    """Cells of one line of the table."""
    without = minimal(name, settings)
    full, added = with_all_features(without, device)
    a, b = costs((without, full), device, seconds)
    return [
        name, f"{a.points}", f"{a.arrays} / {b.arrays}", f"{a.parts} / {b.parts}",
        f"{a.bytes_per_point:.0f} / {b.bytes_per_point:.0f}", f"{1e6 * a.step:.4g} / {1e6 * b.step:.4g}",
        f"{b.step / a.step:.2f}", ", ".join(added),
    ]  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = study_parser(__doc__, device=None, out=DOCS / "what-a-scene-costs.md", commit=None)
    parser.add_argument("--scenes", nargs="+", default=scene_names(), choices=scene_names(), metavar="SCENE")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time of each scene")
    parser.add_argument("--points", type=int, help="of every scene, instead of its own")
    options = parser.parse_args(arguments)
    device = find_device(options.device)
    positive("--seconds", options.seconds)
    settings: dict[str, object] = {} if options.points is None else {"points": options.points}
    rows = []
    for name in options.scenes:
        rows.append(row(name, str(device), options.seconds, settings))
        print(table_row(rows[-1]), flush=True)
    lines = [*introduction(page_header("scene_costs.py", device.name, options.commit)), *table(HEAD, rows), ""]
    write_page(options.out, "\n".join(lines))


def introduction(header: str) -> list[str]:
    """Title and text of the page."""
    return [
        "# What a scene costs",
        "",
        *paragraph(
            f"{header} All runs are in float32, at the sizes of the scenes. The first number of each pair is what the "
            "scene needs. The second is what it would take with the features of the last column. Without a feature "
            "there is no array, no part of a step and no branch for it. Parts that touch only their own point share a "
            "launch; `warp-pd plan SCENE` lists them. Times are those of explicit steps of a sheet that hardly moves, "
            "for static scenes too. Where a law is cheap (bond-based) the features would double the step. Where a law "
            "computes 28 stresses a point they nearly vanish on a CPU, but not on a GPU "
            "([performance](performance.md), 1.2 to 1.9 times). Each time is the best of four alternating "
            "measurements. Factors between 0.9 and 1.1 are noise."
        ),
    ]


if __name__ == "__main__":
    run_tool(main)
