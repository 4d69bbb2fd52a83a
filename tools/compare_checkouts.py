"""Compare two checkouts bit for bit: every scene on small sheets, and every law, part and solver.

    python tools/compare_checkouts.py record before.npz --processes 2       in the one checkout
    python tools/compare_checkouts.py record after.npz --processes 2        in the other
    python tools/compare_checkouts.py compare before.npz after.npz          exit code 1 if any case differs

A case runs for a few frames. Its record holds the final displacement, a hash of velocity, torn faces and further
fields, and the energies of the last frame; a case that one checkout refuses has its error there. Only public names are
used, so that one copy of this file runs in both checkouts: install the older one elsewhere (`pip install
--no-deps --target`) and put it on PYTHONPATH.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import importlib.util
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

import warp_pd as w

COLUMNS = (
    "time", "step", "kinetic", "strain", "external", "damping", "rupture", "viscous", "balance_error",
    "bonds_outside_training", "ball_force_x", "ball_force_y", "ball_force_z", "largest_damage", "mean_damage",
)  # fmt: skip

# Small settings of every scene, and variants.
SCENES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ball_penetration", {"points": 21, "duration": 2.0, "frames": 6, "safety": 0.3, "critical_stretch": 1.3}),
    ("ball_penetration", {"points": 31, "horizon": 2.015, "tearing_energy": 20.0, "damage_length": 0.07}),
    ("ball_penetration", {"points": 21, "horizon": 2.015, "duration": 2.0, "frames": 6, "safety": 0.3, "jitter": 0.3,
                          "critical_stretch": 1.3}),
    ("ball_penetration", {"points": 31, "duration": 1.5, "frames": 4, "safety": 0.3, "damping": 2.0,
                          "critical_stretch": 1.3}),
    ("ball_penetration", {"points": 21, "duration": 1.0, "frames": 3, "safety": 0.3, "weights": "published",
                          "critical_stretch": 1.3}),
    ("ball_penetration", {"points": 15, "duration": 1.0, "frames": 3, "safety": 0.3, "force": "closed_form",
                          "critical_stretch": 1.3}),
    ("bimodular_bar", {"points": 60}),
    ("bimodular_bar", {"points": 40, "solver": "relaxation"}),
    ("cantilever", {"points": 40, "load_steps": 4}),
    ("double_notch", {"points": 24, "safety": 0.4, "duration": 1.2, "frames": 8, "slow_to": 0.985,
                      "critical_stretch": 2.0}),
    ("double_notch", {"points": 24, "safety": 0.4, "duration": 1.2, "frames": 8, "slow_to": 0.985, "turn": 30.0,
                      "critical_stretch": 2.0}),
    ("kapton_shear", {"points": 38, "tolerance": 1e-4}),
    ("metamaterial", {"points": 20, "horizon": 2.015, "crack": True}),
    ("metamaterial", {"points": 20, "horizon": 2.015, "viscous": True, "law": "published"}),
    ("notched_strip", {"points": 60, "increment": 4e-5, "critical_strain": 9e-3, "tolerance": 1e-4}),
    ("off_plane_load", {"points": 17, "speed": 2e-2, "duration": 2.0, "frames": 4, "boundary_force": 1e16}),
    ("off_plane_load", {"points": 17, "speed": 2e-2, "duration": 1.0, "frames": 4, "weights": "published",
                        "boundary_force": 1e16, "form": "printed"}),
    ("off_plane_tear", {"points": 20, "horizon": 2.015, "speed": 2e-2, "travel": 0.06, "frames": 8,
                        "critical_stretch": 2.0}),
    ("off_plane_tear", {"points": 20, "speed": 2e-2, "travel": 0.06, "frames": 8, "boundary_force": 1e14,
                        "critical_stretch": 2.0}),
    ("out_of_plane", {"points": 21, "horizon": 2.015, "duration": 1.0, "frames": 4}),
    ("precut_tear", {"points": 30, "horizon": 2.015, "safety": 0.4, "frames": 12, "duration": 6.0,
                     "critical_stretch": 1.3}),
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
    ("balloon", {"points": 8, "stretch": 1.6, "frames": 4}),
    ("balloon_burst", {"points": 10, "tearing_energy": 3e5, "duration": 4e-3, "frames": 8}),
    ("balloon_paths", {"points": 6, "control": "piston"}),
    ("bulge_test", {"points": 11, "load_steps": 4}),
    ("cutting", {"points": 20, "frames": 40, "speed": 0.4, "travel": 0.03, "pull": 0.2}),
    ("drum", {"points": 21}),
    ("cyclic_strip", {"columns": 9, "cycles": 2}),
    ("rate_test", {"points": 4}),
    ("rate_test", {"points": 4, "stretch": 2.0, "maxwell_1": 2e5, "maxwell_2": 1e5}),
    ("dropped_ball", {"points": 15, "horizon": 2.015, "diameter": 0.12, "duration": 0.2, "frames": 20}),
    ("edge_notch", {"points": 20, "horizon": 2.015, "duration": 1.0, "frames": 40, "notch": 8e-3}),
    ("folded_sheet", {"points": 31, "frames": 25}),
    ("glove", {"spacing": 6e-3, "load_steps": 2}),
    ("holed_strip", {"points": 21, "load_steps": 2}),
    ("needle", {"points": 21, "depth": 0.05, "frames": 10}),
    ("balls_on_a_sheet", {"points": 21, "duration": 0.15, "frames": 15}),
    ("gripper", {"points": 31, "duration": 0.06, "frames": 15}),
    ("flaw_sensitivity", {"points": 20, "duration": 1.0, "frames": 40, "damage_length": 0.01}),
    ("puncture", {"points": 21, "frames": 20}),
    ("pure_shear_tear", {"points": 12, "duration": 0.8, "frames": 40, "tearing_energy": 4.0, "advance": 3.0}),
    ("running_crack", {"points": 12, "horizon": 2.015, "frames": 60}),
    ("trousers", {"points": 10, "horizon": 2.015, "duration": 1.2, "frames": 40, "speed": 0.03}),
    ("slit_balloon", {"points": 13, "load_steps": 1}),
    ("snap_through", {"points": 11}),
    ("stable_crack", {"points": 16, "damage_length": 0.0075, "growth": 0.6, "load_steps": 3}),
    ("tube_bulge", {"points": 12, "switch": 0, "steps": 12}),
    ("tube", {"points": 24, "frames": 3}),
    ("two_sheets", {"points": 13, "frames": 20}),
    ("wrinkles", {"points": 25, "thickness": 3e-4, "duration": 5e-3, "frames": 2}),
    ("peel", {"points": 31, "peel": 0.02, "speed": 0.1, "strength": 1e4, "frames": 20}),
    ("lap_joint", {"points": 33, "speed": 0.2, "frames": 20}),
    ("patched_sheet", {"points": 17, "duration": 0.1, "frames": 10}),
)  # fmt: skip

# Left out where the extra `bodies` is not installed.
OF_NEWTON = ("balls_on_a_sheet", "gripper")


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
            if scene in OF_NEWTON and importlib.util.find_spec("newton") is None:
                continue
            text = ",".join(f"{k}={v}" for k, v in settings.items())
            yield Case(f"{scene}({text}) f{bits}", partial(of_scene, scene, settings), bits)
        for name, make in parts().items():
            yield Case(f"{name} f{bits}", make, bits)


def of_scene(scene: str, settings: dict[str, Any]) -> Any:
    """A scene, without its measures: they read the state and change nothing.

    Where a follower pressure acts in time the step is fixed: whether the estimate of the stable step knows the
    stiffness of the pressure must not decide whether two checkouts agree.
    """
    simulation = importlib.import_module(f"warp_pd.scenes.{scene}").build(**settings)
    simulation.measures, simulation.outcomes = (), ()
    if scene.startswith("pressure") and isinstance(simulation.solver, w.Explicit):
        simulation.solver = replace(simulation.solver, step=2e-4)
    return simulation


def sheet_of(kind: str, points: int = 13) -> Any:
    """A small sheet of 0.1 x 0.1 m."""
    lattice = w.Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points)
    if kind == "cloud":
        return w.Sheet.filled(0.1, 0.1, thickness=1e-3, density=1000.0, points=points, jitter=0.2)
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


def neo() -> Any:
    """The material of most cases."""
    return w.NeoHookean(1e3, 100e3)


def prony() -> Any:
    """Two terms, one of which relaxes faster in fast motion."""
    return w.Prony(0.2e3, time=0.01), w.Prony(0.1e3, 5.0, time=0.05, exponent=0.3)


LAWS: dict[str, Callable[[], Any]] = {
    "published": lambda: w.BondAssociated(neo(), 3.15, weights="published"),
    "plain": lambda: w.BondAssociated(neo(), 3.15, weights="plain"),
    "corrected": lambda: w.BondAssociated(neo(), 2.015, weights="corrected"),
    "slow": lambda: w.BondAssociated(neo(), 2.015, weights="plain", fast=False),
    "wide": lambda: w.BondAssociated(neo(), 5.1),
    "inverse": lambda: w.BondAssociated(neo(), 2.015, influence="inverse"),
    "nodal": lambda: w.Nodal(neo()),
    "bonds": lambda: w.BondBased(w.Bimodular(3e3, 1e3)),
    "slack": lambda: w.BondBased(w.Bimodular(3e3, 0.0)),
    "hyperelastic": lambda: w.HyperelasticBonds(w.BondNeoHookean(1e3)),
    "closed form": lambda: w.Neural(neo(), 2.015, evaluation="closed_form", weights="published"),
    "fused": lambda: w.Neural(neo(), 2.015, evaluation="fused", weights="published"),
    "torch": lambda: w.Neural(neo(), 2.015, weights="published"),
    "visco": lambda: w.Visco(w.Yeoh(0.5e3, 10.0, 1.0), 2.015, prony=prony()),
    "visco without terms": lambda: w.Visco(w.Yeoh(0.5e3, 10.0, 1.0), 2.015),
    "visco bonds": lambda: w.ViscoBondBased(w.Yeoh(1e3, 10.0), prony=prony()),
    "elastic bonds": lambda: w.ViscoBondBased(w.Yeoh(1e3, 10.0)),
}
MATERIALS: dict[str, Callable[[], Any]] = {
    "gent": lambda: w.Gent(1e3, 200e3, 160.0),
    "mooney": lambda: w.MooneyRivlin(0.4e3, 0.1e3),
    "yeoh": lambda: w.Yeoh(0.5e3, 10.0, 1.0),
    "ogden": lambda: w.Ogden((600.0, 50.0), (1.3, 5.0)),
    "arruda": lambda: w.ArrudaBoyce(1e3, 5.0),
}
RAMP = ((0.0, 0.0), (0.01, 1.0), (1.0, 0.5))


def moved(x: list[float], times: Any = (0.0, 1.0), z: Any = 0.0) -> Callable[[Any], list[Any]]:
    """A motion of the right edge."""
    return lambda s: [w.Motion(s.edges("right"), list(times), x=x, y=0.0, z=z)]


RIGHT, PULLED, SLOWLY = moved([0.02, 0.2], z=[0.0, 0.05]), moved([0.0, 0.3]), moved([0.0, 0.012])


def everything(s: Any) -> list[Any]:
    """Every load but those that follow the surface."""
    return [
        w.Pressure(5.0, follower=False, ramp=RAMP), w.Pressure(2.0, follower=False),
        w.BodyForce((0.0, 0.0, -9810.0), ramp=RAMP), w.BodyForce((100.0, 0.0, 0.0)),
        w.PointForce(s.edges("right"), (0.01, 0.0, 0.0)),
    ]  # fmt: skip


def falling(s: Any) -> list[Any]:
    """The right edge pulled, and gravity."""
    return [*PULLED(s), w.BodyForce((0.0, 0.0, -500.0), ramp=RAMP)]


def pressures(*ramped: Any, fixed: bool = False) -> Callable[[Any], list[Any]]:
    """Follower pressures: (value, ramp); with the right edge fixed too."""
    return lambda s: [*([w.Fixed(s.edges("right"))] if fixed else []), *(w.Pressure(p, ramp=r) for p, r in ramped)]


def later(name: str, *values: Any, **more: Any) -> Callable[[], Any]:
    """A part by its name in `warp_pd`, made in the run: a checkout that lacks it refuses one case."""
    return lambda: getattr(w, name)(*values, **more)


BOUNDARY, BALL = (lambda s: [w.BoundaryForce(1e15)]), later("RigidBall", 0.05, (0.06, 0.05, 0.0275), (0.0, 0.0, -0.5))
STEPPED, NEWTON = later("Explicit", 2e-2, frames=2, step=2e-4), later("Newton", load_steps=2)
# By name: law, sheet, and the other arguments of `simulation`.
PARTS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "motion": ("corrected", "lattice", {"loads": RIGHT}),
    "all loads": ("corrected", "lattice", {"loads": everything, "damping": 3.0}),
    "pressure": ("corrected", "lattice", {"loads": pressures((5.0, None), (3.0, RAMP)), "solver": STEPPED}),
    "pressure torn": ("plain", "cut", {"loads": pressures((5.0, RAMP)), "stretch": 1.21, "solver": STEPPED}),
    "boundary force": ("plain", "lattice", {"loads": BOUNDARY}),
    "boundary force torn": ("plain", "lattice", {"loads": BOUNDARY, "stretch": 1.21}),
    "ball": ("corrected", "lattice", {"contact": BALL, "loads": RIGHT, "damping": 2.0}),
    "ball torn": ("plain", "cloud", {"contact": BALL, "stretch": 1.21}),
    "untracked": ("corrected", "lattice", {"contact": BALL, "loads": everything, "track_energy": False}),
    "inclusion": ("corrected", "inclusion", {"loads": falling, "damping": 2.0, "flat": True}),
    "inclusion torn": (
        "plain", "inclusion",
        {"loads": PULLED, "stretch": 1.21, "flat": True, "solver": later("Explicit", 0.1, frames=3)},
    ),
    "stiffened": ("corrected", "stiffened", {"loads": RIGHT}),
    "cut": ("corrected", "cut", {"loads": RIGHT}),
    "spared": ("slow", "lattice", {"damage": later("CriticalStretch", 1.2, spared=range(40))}),
    "critical energy": ("slow", "lattice", {"damage": later("CriticalEnergy", 2e-3)}),
    "critical energy visco": ("visco", "cloud", {"damage": later("CriticalEnergy", 2e-3)}),
    "critical energy bonds": ("visco bonds", "lattice", {"damage": later("CriticalEnergy", 2e-2)}),
    "fields": ("bonds", "lattice", {"fields": ("principal_stress", "wrinkle_level")}),
    "relaxed": (
        "corrected", "lattice", {"loads": everything, "solver": later("Relaxation", tolerance=1e-3, load_steps=2)}
    ),
    "relaxed pressure": (
        "corrected", "lattice",
        {
            "loads": pressures((2.0, None), fixed=True), "flat": True,
            "solver": later("Relaxation", tolerance=1e-3, load_steps=2, ramp_steps=60),
        },
    ),
    "relaxed torn": (
        "plain", "cut",
        {"loads": SLOWLY, "stretch": 1.13, "flat": True, "solver": later("Relaxation", tolerance=1e-2, load_steps=2)},
    ),
    "relaxed inclusion": (
        "corrected", "inclusion", {"loads": RIGHT, "flat": True, "solver": later("Relaxation", tolerance=1e-2)}
    ),
    "relaxed cloud": ("nodal", "cloud", {"loads": RIGHT, "flat": True, "solver": later("Relaxation", tolerance=1e-2)}),
    "newton": ("corrected", "lattice", {"loads": RIGHT, "flat": True, "solver": NEWTON}),
    "newton cloud": ("corrected", "cloud", {"loads": RIGHT, "flat": True, "solver": NEWTON}),
    "newton jacobi": (
        "corrected", "cut", {"loads": RIGHT, "flat": True, "solver": later("Newton", preconditioner="jacobi")}
    ),
    "newton loads": ("corrected", "lattice", {"loads": everything, "flat": True, "solver": NEWTON}),
    "newton pressure": (
        "corrected", "cloud",
        {
            "loads": pressures((2.0, None), (1.0, ((0.0, 0.0), (1.0, 1.0))), fixed=True), "flat": True,
            "solver": later("Newton"),
        },
    ),
    "newton bonds": ("bonds", "lattice", {"loads": RIGHT, "flat": True, "solver": NEWTON}),
    "newton bonds torn": (
        "bonds", "cut", {"loads": RIGHT, "stretch": 1.5, "flat": True, "solver": later("Newton", load_steps=3)}
    ),
    "newton bonds constant": (
        "bonds", "lattice",
        {
            "loads": RIGHT, "flat": True,
            "solver": later("Newton", stiffness="constant", most_iterations=60, tolerance=1e-4),
        },
    ),
}  # fmt: skip


def simulation(
    law: Callable[[], Any], sheet: str = "lattice", loads: Callable[[Any], list[Any]] = lambda s: [],
    damping: float = 0.0, stretch: float | None = None, flat: bool = False, **more: Any,
) -> Any:  # fmt: skip
    """A small sheet, held on the left, that starts stretched and rough unless it is `flat`.

    `stretch` is a critical one. Parts among `more` are functions that make them.
    """
    found = sheet_of(sheet)
    given = {name: value() if callable(value) else value for name, value in more.items()}
    if stretch is not None:
        given["damage"] = w.CriticalStretch(stretch)
    return w.Simulation(
        found,
        force=law(),
        solver=given.pop("solver", None) or w.Explicit(2e-2, frames=2, damping=damping),
        loads=[w.Fixed(found.edges("left")), *loads(found)],
        initial_displacement=None if flat else rough(found),
        **given,
    )


def parts() -> dict[str, Callable[[], Any]]:
    """Laws, materials, parts and solvers, each alone or with what it needs."""
    made: dict[str, Callable[[], Any]] = {}
    for name, law in LAWS.items():
        made[f"law {name}"] = partial(simulation, law)
        if name != "visco without terms":
            made[f"law {name}, cloud, torn"] = partial(simulation, law, "cloud", stretch=1.21, damping=5.0)
    for name, material in MATERIALS.items():
        law = partial(lambda m: w.BondAssociated(m(), 2.015), material)
        made[f"material {name}"] = partial(simulation, law, stretch=1.21)
    return made | {name: partial(simulation, LAWS[law], sheet, **more) for name, (law, sheet, more) in PARTS.items()}


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
