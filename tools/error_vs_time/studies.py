"""What is compared: scenes with their laws, solvers and references."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from warp_pd import Bimodular, BondAssociated, BondBased, Explicit, Newton, Relaxation, Result, Simulation
from warp_pd.__main__ import build_scene
from warp_pd.interfaces import History, Law
from warp_pd.laws import force_law

from .references import Errors, Frames, dynamic_errors, hole_errors, pressure_errors, tear_errors, tension_errors

WEIGHTS = ("published", "plain", "corrected")
STRETCH_LAWS = {"bonds": {"force": "bond_based"}, "bonds refitted": {"force": "bond_based_refitted"}}
# Finite elements instead of a law: nodes of an element. They have no horizon.
ELEMENTS = {"membrane_q4": 4, "membrane_q9": 9}
SOLVERS = {"newton": Newton, "relaxation": Relaxation, "explicit": Explicit}


@dataclass(frozen=True)
class Configuration:
    """One run.

    Attributes:
        scene: Name of the scene.
        law: Name of the law.
        horizon: Over the spacing; 0 of finite elements.
        points: Along a side; nodes of finite elements.
        precision: In bits.
        solver: Name of the solver.
    """

    scene: str
    law: str
    horizon: float
    points: int
    precision: int
    solver: str


@dataclass(frozen=True, eq=False)
class Study:
    """A scene and what its runs are compared with.

    Attributes:
        scene: Its name.
        about: What is measured, and how accurate the reference is.
        laws: Laws that apply.
        solvers: Solvers that apply.
        errors: Relative error of a scalar and L2 error of the displacement field, from the result, the collected
            frames and the history of the finer run.
        settings: Of the scene, besides points and horizon.
        times: Frames to collect [s].
        finer: Run that is the reference, twice as fine as the finest, where there are no finite elements.
    """

    scene: str
    about: str
    laws: tuple[str, ...]
    solvers: tuple[str, ...]
    errors: Callable[[Result, Frames, History], Errors]
    settings: Mapping[str, Any] = field(default_factory=dict)
    times: tuple[float, ...] = ()
    finer: Configuration | None = None


STUDIES = (
    Study(
        "pressure",
        "Sheet under static follower pressure (BA 6.2): deflection of the centre, and the displacement field. "
        "Reference: Q9 membrane, 1e-6. Nodal correspondence finds no equilibrium because of its zero-energy modes "
        "([neural law](neural-law.md)).",
        (*WEIGHTS, "closed_form", "bond_based", *ELEMENTS),
        ("newton", "relaxation", "explicit"),
        pressure_errors,
    ),
    Study(
        "tension",
        "Sheet pulled to twice its length (BA 6.1): contraction of the free edge, and the displacement field. "
        "Reference: Q9 membrane, 1e-5.",
        (*WEIGHTS, "closed_form", "bond_based", *ELEMENTS),
        ("newton", "relaxation", "explicit"),
        tension_errors,
    ),
    Study(
        "pressure_dynamic",
        "Sheet under sudden pressure (NN 6.1): largest deflection and field at 0.25, 0.5, 0.75 and 1 s, root mean "
        "squares. Reference: Q4 membrane, accurate to 0.5, 0.5, 1 and 0.2 % at these times. Smaller differences mean "
        "nothing.",
        (*WEIGHTS, "nodal", "closed_form", "neural_fused"),
        ("explicit",),
        dynamic_errors,
        {"frames": 4},
        (0.25, 0.5, 0.75, 1.0),
    ),
    Study(
        "stretch",
        "Incompressible sheet with a hole, stretched to twice its size in both directions (HE chapter 5): force on an "
        "edge, and the displacement field. `bonds` and `bonds refitted` are the bond laws made for this mode, with "
        "layers of points outside the sheet. Reference: Q9 membrane, 1e-4. With published weights there was no "
        "equilibrium (26 points: float32 diverged, float64 did not converge in 150 s).",
        ("plain", "corrected", "bonds", "bonds refitted", *ELEMENTS),
        ("newton", "relaxation"),
        hole_errors,
        {"stretch": 2.0, "defect": "hole"},
    ),
    Study(
        "double_notch",
        "Sheet torn between two notches (BA 6.3): largest load, and in place of a field the L2 norm of load over "
        "extension. Reference: plain weights, 3.15, float32, twice as fine as the finest row. A critical stretch is no "
        "fracture energy, so the load falls with the spacing: there is no order to observe.",
        ("published", "plain"),
        ("explicit",),
        tear_errors,
        {"duration": 1.8, "frames": 180},
        finer=Configuration("double_notch", "plain", 3.15, 0, 32, "explicit"),
    ),
)


def law_of(name: str, simulation: Simulation, horizon: float) -> Law:
    """The law of a name with the material of the scene; bond-based sheets are linear, with E = 3 mu."""
    material: Any = simulation.force.material
    if name in WEIGHTS:
        return BondAssociated(material, horizon=horizon, weights=name)
    if name == "bond_based":
        return BondBased(Bimodular(3.0 * material.mu), horizon=horizon)
    return force_law(name, material, horizon)


def simulation_of(study: Study, run: Configuration) -> Simulation:
    """The scene with the law and the solver, without energy sums."""
    settings = {**study.settings, "points": run.points, "horizon": run.horizon}
    if len(study.solvers) > 1:
        settings["solver"] = run.solver
    if run.scene == "stretch":
        settings |= STRETCH_LAWS.get(run.law, {"force": "bond_associated", "weights": run.law})
        return replace(build_scene(run.scene, settings), track_energy=False)
    simulation = build_scene(run.scene, settings)
    assert isinstance(simulation.solver, SOLVERS[run.solver])
    return replace(simulation, force=law_of(run.law, simulation, run.horizon), track_energy=False)


def applies(study: Study, run: Configuration) -> bool:
    """Whether the law and the solver go together."""
    if run.solver == "newton":
        # Wider horizons have no multigrid, see docs/solvers.md.
        return run.precision == 64 and run.horizon < 2.5 and run.law in ("plain", "corrected", "bond_based")
    if study.finer is not None:
        return run.precision == 32 and 2.0 < run.horizon < 4.0
    if run.solver == "explicit" and len(study.solvers) > 1:
        # Damped dynamics find the equilibrium more slowly than relaxation; one horizon shows by how much.
        return run.horizon == 2.015 and run.law in WEIGHTS
    return True


def configurations(study: Study, horizons: Sequence[float], precisions: Sequence[int]) -> Iterator[Configuration]:
    """All runs of a study, with 0 for the number of points."""
    laws = [law for law in study.laws if law not in ELEMENTS]
    for law, solver, precision, horizon in itertools.product(laws, study.solvers, precisions, horizons):
        run = Configuration(study.scene, law, horizon, 0, precision, solver)
        if applies(study, run):
            yield run
    for law in ELEMENTS:
        if law in study.laws and 64 in precisions:
            yield Configuration(study.scene, law, 0.0, 0, 64, "newton")
