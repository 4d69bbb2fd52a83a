"""What is compared: scenes with their laws, solvers and references."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from study import build_scene

from warp_pd import Bimodular, BondBased, CriticalStretch, Explicit, Frame, Newton, Relaxation, Result, Simulation
from warp_pd.papers import force_law
from warp_pd.run.built import Built

from .errors import (
    Errors,
    Frames,
    bar_errors,
    dynamic_errors,
    hole_field,
    load_errors,
    onset_errors,
    pressure_field,
    static_errors,
    stress_errors,
    tension_field,
)

# Settings of a scene that select a law, or what makes the simulation one with the law at a horizon in spacings.
Variant = Mapping[str, Any] | Callable[[Simulation, float], Simulation]
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
        title: What the picture says.
        laws: Laws that apply, by name, and how the scene gets them; those of ELEMENTS get nothing.
        solvers: Solvers that apply.
        errors: Relative error of a scalar and L2 error of the displacement field (None: the scene has no reference
            for it), from the result and the frames.
        points: Along a side, unless the command says otherwise.
        horizons: In spacings, likewise.
        precisions: In bits, likewise.
        settings: Of the scene, besides points and horizon.
        times: Frames to collect [s].
        energies: Whether the scene reports energies, which a run otherwise leaves out.
    """

    scene: str
    title: str
    laws: Mapping[str, Variant]
    solvers: tuple[str, ...]
    errors: Callable[[Result, Frames], Errors]
    points: tuple[int, ...] = (7, 13, 26, 51, 101)
    horizons: tuple[float, ...] = (1.5, 2.015, 3.15)
    precisions: tuple[int, ...] = (32, 64)
    settings: Mapping[str, Any] = field(default_factory=dict)
    times: tuple[float, ...] = ()
    energies: bool = False


def bonds(simulation: Simulation, horizon: float) -> Simulation:
    """Linear bonds of E = 3 mu, IM's law with one modulus."""
    material: Any = simulation.force.material
    return replace(simulation, force=BondBased(Bimodular(3.0 * material.mu), horizon=horizon))


def closed_form(simulation: Simulation, horizon: float) -> Simulation:
    """The law of NN without its network."""
    return replace(simulation, force=force_law("closed_form", simulation.force.material, horizon))


def breaking_bonds(simulation: Simulation, horizon: float) -> Simulation:
    """Linear bonds that break at the critical stretch of the tearing energy, 4 pi Gc / (9 E reach), and their G.

    Their energy per volume is the mean over directions of 4.5 mu (stretch of a bond - 1)^2.
    """
    from warp_pd.scenes.pure_shear_tear import HEIGHT, MU

    energy: Any = simulation.damage
    reach = horizon * simulation.sheet.spacing
    critical = 1.0 + float(np.sqrt(4.0 * np.pi * energy.energy / (9.0 * 3.0 * MU * reach)))
    named = {measure.name: measure for measure in simulation.measures}
    angle = np.linspace(0.0, np.pi, 400, endpoint=False)

    def released(built: Built, frame: Frame) -> float:
        stretch = named["stretch"].value(built, frame)
        strains = np.hypot(np.cos(angle), stretch * np.sin(angle)) - 1.0
        return float(4.5 * MU * (strains**2).mean() * HEIGHT / energy.energy)

    named["release_ratio"] = replace(named["release_ratio"], value=released)
    return replace(
        simulation,
        force=BondBased(Bimodular(3.0 * MU), horizon=horizon),
        damage=CriticalStretch(critical, spared=energy.spared), measures=list(named.values()),
    )  # fmt: skip


BY_WEIGHTS: dict[str, Variant] = {name: {"weights": name} for name in ("published", "plain", "corrected")}
BY_FORCE: dict[str, Variant] = {name: {"force": name} for name in ("nodal", "closed_form", "neural_fused", "neural")}
BY_ELEMENTS: dict[str, Variant] = {name: {} for name in ELEMENTS}
STATIC = ("newton", "relaxation", "explicit")
STUDIES = (
    Study(
        "pressure",
        "pressure (BA 6.2): displacement",
        BY_WEIGHTS | {"closed_form": closed_form, "bond_based": bonds} | BY_ELEMENTS,
        STATIC,
        static_errors("center_deflection", pressure_field),
    ),
    Study(
        "tension",
        "tension (BA 6.1): displacement",
        BY_WEIGHTS | {"closed_form": closed_form, "bond_based": bonds} | BY_ELEMENTS,
        STATIC,
        static_errors("edge_contraction", tension_field),
    ),
    Study(
        "stretch",
        "a hole, stretched (HE): displacement",
        {
            "plain": {"force": "bond_associated", "weights": "plain"},
            "corrected": {"force": "bond_associated", "weights": "corrected"},
            "bonds": {"force": "bond_based"},
            "bonds_refitted": {"force": "bond_based_refitted"},
            **BY_ELEMENTS,
        },
        ("newton", "relaxation"),
        static_errors("edge_force", hole_field),
        points=(13, 26, 51, 101),
        horizons=(2.015, 3.15),
        settings={"stretch": 2.0, "defect": "hole"},
    ),
    Study(
        "pressure_dynamic",
        "sudden pressure (NN 6.1): displacement",
        BY_WEIGHTS | BY_FORCE,
        ("explicit",),
        dynamic_errors,
        points=(13, 26, 51, 101),
        settings={"frames": 4},
        times=(0.25, 0.5, 0.75, 1.0),
    ),
    Study(
        "pure_shear_tear",
        "a torn strip: load at tearing",
        {"corrected": {}, "breaking_bonds": breaking_bonds, "membrane_q4": {}},
        ("explicit",),
        onset_errors,
        points=(16, 24, 32, 48, 64),
        horizons=(2.015, 3.15),
        precisions=(32, 64),
        settings={"overload": 2.0},
        energies=True,
    ),
    Study(
        "double_notch",
        "two notches, torn (BA 6.3): largest load",
        {"corrected": {}, "membrane_q4": {}},
        ("explicit",),
        load_errors,
        points=(30, 40, 60, 90),
        horizons=(2.015,),
        settings={"duration": 1.3, "frames": 20},
        energies=True,
    ),
    Study(
        "bimodular_bar",
        "a bar of two moduli (IM 6.1): displacement",
        {"bimodular": {}},
        ("newton", "relaxation"),
        bar_errors,
        points=(25, 50, 100, 200, 400),
        horizons=(3.0,),
        precisions=(64,),
    ),
    Study(
        "visco_sheet",
        "a viscoelastic sheet (VE 6.5): stress",
        {"visco": {"law": "stress_free"}, "visco_bonds": {"law": "published"}},
        ("explicit",),
        stress_errors,
        points=(7, 13, 26, 51),
        horizons=(3.015,),
        energies=True,
    ),
)


def simulation_of(study: Study, run: Configuration) -> Simulation:
    """The scene with the law and the solver."""
    settings = {**study.settings, "points": run.points, "horizon": run.horizon}
    if len(study.solvers) > 1:
        settings["solver"] = run.solver
    variant = study.laws[run.law]
    if isinstance(variant, Mapping):
        simulation = build_scene(run.scene, {**settings, **variant})
    else:
        simulation = variant(build_scene(run.scene, settings), run.horizon)
    assert isinstance(simulation.solver, SOLVERS[run.solver])
    return simulation if study.energies else replace(simulation, track_energy=False)


def applies(study: Study, run: Configuration) -> bool:
    """Whether the law, the solver, the horizon and the precision go together."""
    if study.energies:
        # Tears: the damage field at 2.015, bonds at a horizon that does not steer them; in time steps of float32.
        return run.precision == 32 and (run.law == "breaking_bonds") == (run.horizon == 3.15)
    if run.scene == "bimodular_bar":
        return True
    if run.solver == "newton":
        # Wider horizons have no multigrid, see docs/solvers.md.
        return run.precision == 64 and run.horizon < 2.5 and run.law in ("plain", "corrected", "bond_based")
    if run.solver == "explicit" and len(study.solvers) > 1:
        # Damped dynamics find the equilibrium more slowly than relaxation; one horizon shows by how much.
        return run.horizon == 2.015 and run.law in BY_WEIGHTS
    # Torch in double precision is no other law.
    return run.law != "neural" or run.precision == 32


def configurations(
    study: Study, horizons: Sequence[float], precisions: Sequence[int], elements: bool = True
) -> Iterator[Configuration]:
    """All runs of a study, with 0 for the number of points.

    Args:
        study: The study.
        horizons: In spacings; empty for those of the study.
        precisions: In bits, likewise.
        elements: Whether finite elements are among them: they run on a CPU.
    """
    horizons, precisions = horizons or study.horizons, precisions or study.precisions
    laws = [law for law in study.laws if law not in ELEMENTS]
    for law, solver, precision, horizon in itertools.product(laws, study.solvers, precisions, horizons):
        run = Configuration(study.scene, law, horizon, 0, precision, solver)
        if applies(study, run):
            yield run
    for law in ELEMENTS if elements else ():
        if law in study.laws and 64 in precisions:
            yield Configuration(study.scene, law, 0.0, 0, 64, "newton")
