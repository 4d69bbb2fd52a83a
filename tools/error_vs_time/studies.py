"""What is compared: scenes with their laws, solvers and references."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from study import build_scene

from warp_pd import Bimodular, BondAssociated, BondBased, Explicit, Newton, Relaxation, Result, Simulation
from warp_pd.interfaces import Law
from warp_pd.papers import force_law

from .errors import Errors, Frames, dynamic_errors, hole_field, pressure_field, static_errors, tension_field

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
        laws: Laws that apply.
        solvers: Solvers that apply.
        errors: Relative error of a scalar and L2 error of the displacement field, from the result and the frames.
        settings: Of the scene, besides points and horizon.
        times: Frames to collect [s].
    """

    scene: str
    laws: tuple[str, ...]
    solvers: tuple[str, ...]
    errors: Callable[[Result, Frames], Errors]
    settings: Mapping[str, Any] = field(default_factory=dict)
    times: tuple[float, ...] = ()


STUDIES = (
    Study(
        "pressure",
        (*WEIGHTS, "closed_form", "bond_based", *ELEMENTS),
        ("newton", "relaxation", "explicit"),
        static_errors("center_deflection", pressure_field),
    ),
    Study(
        "tension",
        (*WEIGHTS, "closed_form", "bond_based", *ELEMENTS),
        ("newton", "relaxation", "explicit"),
        static_errors("edge_contraction", tension_field),
    ),
    Study(
        "pressure_dynamic",
        (*WEIGHTS, "nodal", "closed_form", "neural_fused"),
        ("explicit",),
        dynamic_errors,
        {"frames": 4},
        (0.25, 0.5, 0.75, 1.0),
    ),
    Study(
        "stretch",
        ("plain", "corrected", *STRETCH_LAWS, *ELEMENTS),
        ("newton", "relaxation"),
        static_errors("edge_force", hole_field),
        {"stretch": 2.0, "defect": "hole"},
    ),
)


def law_of(name: str, simulation: Simulation, horizon: float) -> Law:
    """The law of a name with the material of the scene; bond-based sheets are linear, with E = 3 mu."""
    material: Any = simulation.force.material
    if name in WEIGHTS:
        return BondAssociated(material, horizon=horizon, weights=name)
    if name == "bond_based":
        return BondBased(Bimodular(3.0 * material.mu), horizon=horizon)
    return force_law(name, material, horizon, "auto" if name == "nodal" else "published")


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
