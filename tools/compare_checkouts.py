"""Compare two checkouts bit for bit: every scene on small sheets, and every law, part and solver.

    python tools/compare_checkouts.py record before.npz --processes 2       in the one checkout
    python tools/compare_checkouts.py record after.npz --processes 2        in the other
    python tools/compare_checkouts.py compare before.npz after.npz          exit code 1 if any case differs

A case runs for a few frames. Its record holds the final displacement, a hash of velocity, torn faces and further
fields, and the energies of the last frame. Only public names are used, so that one copy of this file runs in both
checkouts: install the older one elsewhere (`pip install --no-deps --target`) and put it on PYTHONPATH.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

COLUMNS = (
    "time", "step", "kinetic", "strain", "external", "damping", "rupture", "viscous", "balance_error",
    "bonds_outside_training", "ball_force_x", "ball_force_y", "ball_force_z", "largest_damage", "mean_damage",
)  # fmt: skip

# Small settings of every scene, and variants.
SCENES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ball_penetration", {"points": 21, "duration": 2.0, "frames": 6, "safety": 0.3}),
    ("ball_penetration", {"points": 21, "horizon": 2.015, "duration": 2.0, "frames": 6, "safety": 0.3, "jitter": 0.3}),
    ("ball_penetration", {"points": 31, "duration": 1.5, "frames": 4, "safety": 0.3, "damping": 2.0}),
    ("ball_penetration", {"points": 21, "duration": 1.0, "frames": 3, "safety": 0.3, "weights": "published"}),
    ("ball_penetration", {"points": 15, "duration": 1.0, "frames": 3, "safety": 0.3, "force": "closed_form"}),
    ("bimodular_bar", {"points": 60}),
    ("bimodular_bar", {"points": 40, "solver": "relaxation"}),
    ("cantilever", {"points": 40, "load_steps": 4}),
    ("double_notch", {"points": 24, "safety": 0.4, "duration": 1.2, "frames": 8, "slow_to": 0.985}),
    ("double_notch", {"points": 24, "safety": 0.4, "duration": 1.2, "frames": 8, "slow_to": 0.985, "turn": 30.0}),
    ("kapton_shear", {"points": 38, "tolerance": 1e-4}),
    ("metamaterial", {"points": 20, "horizon": 2.015, "crack": True}),
    ("metamaterial", {"points": 20, "horizon": 2.015, "viscous": True, "law": "published"}),
    ("notched_strip", {"points": 60, "increment": 4e-5, "critical_strain": 9e-3, "tolerance": 1e-4}),
    ("off_plane_load", {"points": 17, "speed": 2e-2, "duration": 2.0, "frames": 4, "boundary_force": 1e16}),
    ("off_plane_load", {"points": 17, "speed": 2e-2, "duration": 1.0, "frames": 4, "weights": "published",
                        "boundary_force": 1e16, "form": "printed"}),
    ("off_plane_tear", {"points": 20, "horizon": 2.015, "speed": 2e-2, "travel": 0.06, "frames": 8}),
    ("off_plane_tear", {"points": 20, "speed": 2e-2, "travel": 0.06, "frames": 8, "boundary_force": 1e14}),
    ("out_of_plane", {"points": 21, "horizon": 2.015, "duration": 1.0, "frames": 4}),
    ("precut_tear", {"points": 30, "horizon": 2.015, "safety": 0.4, "frames": 12, "duration": 6.0}),
    ("pressure", {"points": 21}),
    ("pressure", {"points": 21, "follower": False}),
    ("pressure", {"points": 11, "solver": "relaxation", "weights": "plain"}),
    ("pressure", {"points": 11, "solver": "relaxation", "weights": "published"}),
    ("pressure", {"points": 11, "solver": "explicit"}),
    ("pressure_dynamic", {"points": 31, "duration": 0.3, "frames": 3}),
    ("pressure_dynamic", {"points": 21, "duration": 0.3, "frames": 3, "force": "neural_fused"}),
    ("pressure_dynamic", {"points": 21, "duration": 0.3, "frames": 3, "force": "neural"}),
    ("pressure_dynamic", {"points": 21, "duration": 0.3, "frames": 3, "force": "nodal"}),
    ("pressure_static", {"points": 21, "horizon": 2.015}),
    ("square_wrinkles", {"points": 24, "tolerance": 1e-4}),
    ("stretch", {"points": 16, "mode": "planar", "stretch": 2.0}),
    ("stretch", {"points": 14, "mode": "equibiaxial", "stretch": 1.5, "defect": "inclusion"}),
    ("stretch", {"points": 14, "mode": "equibiaxial", "stretch": 1.5, "defect": "hole", "force": "bond_associated"}),
    ("stretch", {"points": 14, "stretch": 1.5, "defect": "stiff_inclusion", "force": "bond_associated"}),
    ("tension", {"points": 15}),
    ("tension", {"points": 11, "solver": "relaxation"}),
    ("visco_crack", {"points": 16, "horizon": 2.015, "law": "published", "failure": True, "energy": 3e6,
                     "safety": 0.3}),
    ("visco_crack", {"points": 12, "horizon": 2.015, "viscous": True, "safety": 0.9}),
    ("visco_hole", {"points": 17, "horizon": 2.015, "stretch": 1.5, "load_steps": 2}),
    ("visco_sheet", {"points": 13, "horizon": 2.015, "stretch": 1.3}),
    ("visco_sheet", {"points": 13, "horizon": 2.015, "stretch": 1.3, "law": "published"}),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """What is run.

    Attributes:
        name: Unique, for the record.
        make: Gives the simulation.
        precision: 32 or 64.
    """

    name: str
    make: Callable[[], Any]
    precision: int


def cases() -> Iterator[Case]:
    """Every case in both precisions."""
    for bits in (32, 64):
        for scene, settings in SCENES:
            text = ",".join(f"{k}={v}" for k, v in settings.items())
            yield Case(f"{scene}({text}) f{bits}", partial(of_scene, scene, settings), bits)
        for name, make in parts().items():
            yield Case(f"{name} f{bits}", make, bits)


def of_scene(scene: str, settings: dict[str, Any]) -> Any:
    """A scene, without its measures: they read the state and change nothing.

    Where a follower pressure acts in time the step is fixed: whether the estimate of the stable step knows the
    stiffness of the pressure must not decide whether two checkouts agree.
    """
    from warp_pd import Explicit
    from warp_pd.__main__ import build_scene

    simulation = build_scene(scene, dict(settings))
    simulation.measures, simulation.outcomes = (), ()
    if scene.startswith("pressure") and isinstance(simulation.solver, Explicit):
        simulation.solver = replace(simulation.solver, step=2e-4)
    return simulation


def sheet_of(kind: str, points: int = 13) -> Any:
    """A small sheet of 0.1 x 0.1 m."""
    from warp_pd import Sheet

    lattice = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points)
    if kind == "cloud":
        return Sheet.filled(0.1, 0.1, thickness=1e-3, density=1000.0, points=points, jitter=0.2)
    if kind == "cut":
        return lattice.cut((0.0, 0.051), (0.04, 0.051))
    if kind == "inclusion":
        return lattice.inclusion((0.05, 0.05), 0.02)
    if kind == "stiffened":
        return lattice.stiffened(lattice.within((0.05, 0.05), 0.02), 10.0)
    return lattice


def rough(sheet: Any) -> np.ndarray:
    """A stretched and rough displacement [m]."""
    noise = np.random.default_rng(0).uniform(-0.02, 0.02, (sheet.size, 3)) * sheet.spacing
    x, y = sheet.points.T
    return np.column_stack([0.2 * x, -0.05 * y + 0.05 * x, 0.02 * np.sin(50.0 * x * y)]) + noise


def simulation(force: Any, sheet: str = "lattice", solver: Any = None, **parts: Any) -> Any:
    """A small sheet, held on the left, that starts stretched and rough; `loads` is a function of the sheet."""
    from warp_pd import Explicit, Fixed, Simulation

    found = sheet_of(sheet)
    given = parts.pop("loads", lambda s: [])(found)
    return Simulation(
        found,
        force=force,
        loads=[Fixed(found.edges("left")), *given],
        solver=solver or Explicit(2e-2, frames=2, damping=parts.pop("damping", 0.0)),
        initial_displacement=rough(found) if parts.pop("stretched", True) else None,
        **parts,
    )


def parts() -> dict[str, Callable[[], Any]]:
    """Laws, materials, parts and solvers, each alone or with what it needs."""
    import warp_pd as w
    from warp_pd import BondAssociated, Explicit, NeoHookean, Newton, Relaxation

    neo, gent = NeoHookean(1e3, 100e3), w.Gent(1e3, 200e3, 160.0)
    yeoh = w.Yeoh(0.5e3, 10.0, 1.0)
    materials = {
        "gent": gent, "mooney": w.MooneyRivlin(0.4e3, 0.1e3), "yeoh": yeoh, "ogden": w.Ogden((600.0, 50.0), (1.3, 5.0)),
        "arruda": w.ArrudaBoyce(1e3, 5.0),
    }  # fmt: skip
    prony = (w.Prony(0.2e3, time=0.01), w.Prony(0.1e3, 5.0, time=0.05, exponent=0.3))
    tear, energy = w.CriticalStretch(1.21), w.CriticalEnergy(2e-3)
    ball = w.RigidBall(0.05, (0.06, 0.05, 0.0275), (0.0, 0.0, -0.5))
    right = lambda s: [w.Motion(s.edges("right"), [0.0, 1.0], x=[0.02, 0.2], y=0.0, z=[0.0, 0.05])]  # noqa: E731
    pulled = lambda s: [w.Motion(s.edges("right"), [0.0, 1.0], x=[0.0, 0.3], y=0.0, z=0.0)]  # noqa: E731
    slowly = lambda s: [w.Motion(s.edges("right"), [0.0, 1.0], x=[0.0, 0.012], y=0.0, z=0.0)]  # noqa: E731
    ramped = ((0.0, 0.0), (0.01, 1.0), (1.0, 0.5))

    def everything(s: Any) -> list[Any]:
        return [
            w.Pressure(5.0, follower=False, ramp=ramped), w.Pressure(2.0, follower=False),
            w.BodyForce((0.0, 0.0, -9810.0), ramp=ramped), w.BodyForce((100.0, 0.0, 0.0)),
            w.PointForce(s.edges("right"), (0.01, 0.0, 0.0)),
        ]  # fmt: skip

    laws = {
        "published": BondAssociated(neo, 3.15, weights="published"),
        "plain": BondAssociated(neo, 3.15, weights="plain"),
        "corrected": BondAssociated(neo, 2.015, weights="corrected"),
        "slow": BondAssociated(neo, 2.015, weights="plain", fast=False),
        "redistribute": BondAssociated(neo, 2.015, weights="plain", broken="redistribute"),
        "wide": BondAssociated(neo, 5.1), "inverse": BondAssociated(neo, 2.015, influence="inverse"),
        "nodal": w.Nodal(neo), "bonds": w.BondBased(w.Bimodular(3e3, 1e3)), "slack": w.BondBased(w.Bimodular(3e3, 0.0)),
        "hyperelastic": w.HyperelasticBonds(w.BondNeoHookean(1e3)),
        "hyperelastic both": w.HyperelasticBonds(w.BondNeoHookean(1e3, "uniaxial", "published_both")),
        "closed form": w.Neural(neo, 2.015, evaluation="closed_form"),
        "fused": w.Neural(neo, 2.015, evaluation="fused"),
        "torch": w.Neural(neo, 2.015),
        "visco": w.Visco(yeoh, 2.015, prony=prony), "visco without terms": w.Visco(yeoh, 2.015),
        "visco bonds": w.ViscoBondBased(w.Yeoh(1e3, 10.0), prony=prony),
        "visco bonds series": w.ViscoBondBased(w.Yeoh(1e3, 10.0), prony=prony, update="series"),
        "elastic bonds": w.ViscoBondBased(w.Yeoh(1e3, 10.0)),
    }  # fmt: skip
    made: dict[str, Callable[[], Any]] = {}
    for name, law in laws.items():
        made[f"law {name}"] = partial(simulation, law)
        if name not in ("hyperelastic both", "visco without terms"):
            made[f"law {name}, cloud, torn"] = partial(simulation, law, "cloud", damage=tear, damping=5.0)
    for name, material in materials.items():
        made[f"material {name}"] = partial(simulation, BondAssociated(material, 2.015), damage=tear)
    short, slow = laws["corrected"], laws["slow"]
    made |= {
        "motion": partial(simulation, short, loads=right),
        "all loads": partial(simulation, short, loads=everything, damping=3.0),
        "pressure": partial(
            simulation, short, loads=lambda s: [w.Pressure(5.0), w.Pressure(3.0, ramp=ramped)],
            solver=Explicit(2e-2, frames=2, step=2e-4),
        ),
        "pressure torn": partial(
            simulation, laws["plain"], "cut", loads=lambda s: [w.Pressure(5.0, ramp=ramped)], damage=tear,
            solver=Explicit(2e-2, frames=2, step=2e-4),
        ),
        "boundary force": partial(simulation, laws["plain"], loads=lambda s: [w.BoundaryForce(1e15)]),
        "boundary force torn": partial(simulation, laws["plain"], loads=lambda s: [w.BoundaryForce(1e15)], damage=tear),
        "ball": partial(simulation, short, contact=ball, loads=right, damping=2.0),
        "ball torn": partial(simulation, laws["plain"], "cloud", contact=ball, damage=tear),
        "untracked": partial(simulation, short, contact=ball, loads=everything, track_energy=False),
        "inclusion": partial(
            simulation, short, "inclusion", damping=2.0, stretched=False,
            loads=lambda s: [*pulled(s), w.BodyForce((0.0, 0.0, -500.0), ramp=ramped)],
        ),
        "inclusion torn": partial(
            simulation, laws["plain"], "inclusion", loads=pulled, damage=tear, stretched=False,
            solver=Explicit(0.1, frames=3),
        ),
        "stiffened": partial(simulation, short, "stiffened", loads=right),
        "cut": partial(simulation, short, "cut", loads=right),
        "spared": partial(simulation, slow, damage=w.CriticalStretch(1.2, spared=range(40))),
        "critical energy": partial(simulation, slow, damage=energy),
        "critical energy visco": partial(simulation, laws["visco"], "cloud", damage=energy),
        "critical energy bonds": partial(simulation, laws["visco bonds"], damage=w.CriticalEnergy(2e-2)),
        "fields": partial(simulation, laws["bonds"], fields=("principal_stress", "wrinkle_level")),
        "relaxed": partial(simulation, short, solver=Relaxation(tolerance=1e-3, load_steps=2), loads=everything),
        "relaxed pressure": partial(
            simulation, short, stretched=False, solver=Relaxation(tolerance=1e-3, load_steps=2, ramp_steps=60),
            loads=lambda s: [w.Fixed(s.edges("right")), w.Pressure(2.0)],
        ),
        "relaxed torn": partial(
            simulation, laws["plain"], "cut", solver=Relaxation(tolerance=1e-2, load_steps=2), loads=slowly,
            damage=w.CriticalStretch(1.13), stretched=False,
        ),
        "relaxed inclusion": partial(
            simulation, short, "inclusion", solver=Relaxation(tolerance=1e-2), loads=right, stretched=False,
        ),
        "relaxed cloud": partial(simulation, laws["nodal"], "cloud", solver=Relaxation(tolerance=1e-2), loads=right,
                                 stretched=False),
        "newton": partial(simulation, short, solver=Newton(load_steps=2), loads=right, stretched=False),
        "newton cloud": partial(simulation, short, "cloud", solver=Newton(load_steps=2), loads=right, stretched=False),
        "newton jacobi": partial(
            simulation, short, "cut", solver=Newton(preconditioner="jacobi"), loads=right, stretched=False
        ),
        "newton loads": partial(simulation, short, solver=Newton(load_steps=2), loads=everything, stretched=False),
        "newton pressure": partial(
            simulation, short, "cloud", stretched=False, solver=Newton(),
            loads=lambda s: [
                w.Fixed(s.edges("right")), w.Pressure(2.0), w.Pressure(1.0, ramp=((0.0, 0.0), (1.0, 1.0))),
            ],
        ),
        "newton bonds": partial(simulation, laws["bonds"], solver=Newton(load_steps=2), loads=right, stretched=False),
        "newton bonds torn": partial(
            simulation, laws["bonds"], "cut", solver=Newton(load_steps=3), loads=right, stretched=False,
            damage=w.CriticalStretch(1.5),
        ),
        "newton bonds constant": partial(
            simulation, laws["bonds"], solver=Newton(stiffness="constant", most_iterations=60, tolerance=1e-4),
            loads=lambda s: [*right(s)], stretched=False,
        ),
    }  # fmt: skip
    return made


def record(case: Case, device: str) -> tuple[str, dict[str, Any], np.ndarray]:
    """Run a case: its name, what it left as hashes and numbers or the error that ended it, and its displacement."""
    try:
        result = case.make().run(device=device, precision=case.precision)
    except Exception as error:
        return case.name, {"error": f"{type(error).__name__}: {error}"}, np.zeros((0, 3))
    frame, row = result.frame, result.history[-1]
    torn = frame.intact_faces
    found: dict[str, Any] = {
        "status": result.status,
        "velocity": _hash(frame.velocity),
        "fields": {name: _hash(values) for name, values in sorted(frame.point_data.items())},
        "history": {name: float(row[name]).hex() for name in COLUMNS if name in row},
        "steps": result.summary["steps"],
        "torn_faces": None if torn is None else int((~torn).sum()),
    }
    if torn is not None:
        found["faces"] = _hash(torn)
    return case.name, found, frame.displacement


def _hash(values: Any) -> str:
    return hashlib.sha1(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]


def _run_named(job: tuple[str, str]) -> tuple[str, dict[str, Any], np.ndarray]:
    name, device = job
    return record(next(case for case in cases() if case.name == name), device)


def main() -> None:
    """Record one checkout, or compare two records."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="run all cases")
    recording.add_argument("file", type=Path)
    recording.add_argument("--device", default="cpu")
    recording.add_argument("--processes", type=int, default=2)
    recording.add_argument("--only", default="", help="text that the name of a case holds")
    comparing = commands.add_parser("compare", help="compare two records")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.command == "compare":
        sys.exit(compare(_load(given.before), _load(given.after)))
    # A process of its own for a few cases each: compiled kernels and graphs do not pile up.
    jobs = [(case.name, given.device) for case in cases() if given.only in case.name]
    found: dict[str, Any] = {}
    with get_context("spawn").Pool(given.processes, maxtasksperchild=20) as pool:
        for name, result, displacement in pool.imap_unordered(_run_named, jobs):
            found[name] = (result, displacement)
            print(f"{len(found)}/{len(jobs)} {name}: {result.get('error') or result['status']}", flush=True)
    facts = {name: result for name, (result, _) in found.items()}
    aside = given.file.with_name(given.file.name + ".part")
    with aside.open("wb") as stream:
        np.savez_compressed(
            stream, facts=np.frombuffer(json.dumps(facts).encode(), np.uint8), **{k: u for k, (_, u) in found.items()}
        )
    os.replace(aside, given.file)


def _load(path: Path) -> dict[str, Any]:
    """Facts and displacement by case."""
    with np.load(path) as stored:
        facts = json.loads(bytes(stored["facts"]))
        return {name: (fact, stored[name]) for name, fact in facts.items()}


def compare(before: dict[str, Any], after: dict[str, Any]) -> int:
    """Print what differs; 1 if anything does."""
    differing = 0
    for name in sorted({*before, *after}):
        if name not in before or name not in after:
            print(f"{name}: only in the {'second' if name in after else 'first'} record")
            differing += 1
            continue
        (a, u), (b, v) = before[name], after[name]
        said = [_said(key, a.get(key), b.get(key)) for key in {**a, **b} if a.get(key) != b.get(key)]
        if u.tobytes() != v.tobytes():
            scale = float(np.abs(u).max()) if u.size else 0.0
            apart = f"{np.abs(u - v).max() / scale:.1e} of the largest" if u.shape == v.shape and scale else "entirely"
            said.insert(0, f"displacement ({apart})")
        if said:
            differing += 1
            print(f"{name}: {', '.join(said)}")
    print(f"{len(before)} cases before, {len(after)} after, {differing} differ")
    return int(differing > 0)


def _said(key: str, a: Any, b: Any) -> str:
    """What differs, with sizes where there are any."""
    if isinstance(a, dict) and isinstance(b, dict):
        names = [name for name in {**a, **b} if a.get(name) != b.get(name)]
        return f"{key} ({', '.join(names)})"
    return f"{key} ({a} -> {b})"


if __name__ == "__main__":
    main()
