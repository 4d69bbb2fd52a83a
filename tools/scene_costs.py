"""What every scene costs, and what it would cost with features that it does not need.

    python tools/scene_costs.py                          # this CPU; writes docs/what-a-scene-costs.md
    python tools/scene_costs.py --device cuda:0 --out FILE

Scenes at rest are timed with the steps of explicit dynamics, so that all times mean the same. Forced on are: energy
sums, rupture (at a stretch that nothing reaches), a ball (that touches nothing), mass damping, and pressure (of zero),
each where the scene and its law allow it and do not have it.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stamp import device_name, one_line, stamp

from warp_pd import CriticalStretch, Explicit, InputError, Pressure, RigidBall, Simulation
from warp_pd.bench import time_step
from warp_pd.checks import positive
from warp_pd.cli import build_scene, scene_names
from warp_pd.runner import write_aside
from warp_pd.simulation import Built, find_device

# Measurements of each scene, with and without the features in turn; the best counts.
ROUNDS = 4
PAGE = Path(__file__).resolve().parents[1] / "docs/what-a-scene-costs.md"


@dataclass(frozen=True)
class Cost:
    """What a scene takes: arrays and their bytes a point, parts of a step, time a step [s]."""

    points: int
    arrays: int
    bytes_per_point: float
    parts: int
    step: float


def needed(name: str, settings: dict[str, object]) -> Simulation:
    """The scene as it is, with explicit steps, and without the sums that only the energy balance needs."""
    simulation = build_scene(name, settings)
    solver = simulation.solver
    if not isinstance(solver, Explicit):
        simulation = dataclasses.replace(simulation, solver=Explicit(1.0))
    return dataclasses.replace(simulation, track_energy=False, fields=())


def forced(simulation: Simulation, device: str) -> tuple[Simulation, list[str]]:
    """The scene with everything on that it does without, and what that is."""
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
    return Cost(
        points=built.simulation.sheet.size,
        arrays=len(built.workspace.arrays),
        bytes_per_point=built.workspace.array_bytes() / built.simulation.sheet.size,
        parts=sum(len(launch.parts) for launch in built.workspace.stages["step"]),
        step=step,
    )


def costs(pair: Sequence[Simulation], device: str, seconds: float) -> list[Cost]:
    """Build and time both in turn, so that what else the machine does meets both; the best of each."""
    built = [simulation.build(device, 32) for simulation in pair]
    for one in built:
        one.workspace.compile()
    steps = [[time_step(one, seconds / ROUNDS, 3)[0] for one in built] for _ in range(ROUNDS)]
    return [cost(one, min(row[k] for row in steps)) for k, one in enumerate(built)]


def row(name: str, device: str, seconds: float, settings: dict[str, object]) -> str:
    """One line of the table."""
    plain = needed(name, settings)
    full, added = forced(plain, device)
    a, b = costs((plain, full), device, seconds)
    return (
        f"| {name} | {a.points} | {a.arrays} / {b.arrays} | {a.parts} / {b.parts} | "
        f"{a.bytes_per_point:.0f} / {b.bytes_per_point:.0f} | {1e6 * a.step:.4g} / {1e6 * b.step:.4g} | "
        f"{b.step / a.step:.2f} | {', '.join(added)} |"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name)
    parser.add_argument("--scenes", nargs="+", default=scene_names(), choices=scene_names())
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time of each")
    parser.add_argument("--points", type=int, help="of every scene, instead of its own")
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args(arguments)
    device = find_device(options.device)
    try:
        positive("seconds", options.seconds)
    except InputError as error:
        parser.error(str(error))
    lines = [*introduction(stamp(device.name, options.stand))]
    settings: dict[str, object] = {} if options.points is None else {"points": options.points}
    for name in options.scenes:
        lines.append(row(name, str(device), options.seconds, settings))
        print(lines[-1], flush=True)
    write_aside(options.out, "\n".join([*lines, ""]))


def introduction(measured: str) -> Sequence[str]:
    """What the table holds."""
    return [
        "# What a scene costs, and what it is spared",
        "",
        f"Made by `tools/scene_costs.py` {measured}; float32, the sizes of the scenes.",
        "The first number of each pair is what the scene needs, the second what it would take with the features of",
        "the last column, which it does without: they leave no array, no part of a step and no branch. Parts that",
        "touch their own point alone share a launch; `warp-pd plan SCENE` lists what there is. Times are of explicit",
        "steps of a sheet that hardly moves, for scenes at rest too. Where a law is cheap (bond-based) the features",
        "would double the step; where it finds 28 stresses a point they",
        "nearly vanish in it on a CPU, not on a GPU ([performance](performance.md), 1.2 to 1.9 times). Best of four",
        "measurements in turn; factors from 0.9 to 1.1 are one.",
        "",
        "| scene | points | arrays | parts of a step | bytes a point | step (us) | times | forced on |",
        "|---|---|---|---|---|---|---|---|",
    ]


if __name__ == "__main__":
    one_line(main)
