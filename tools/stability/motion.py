"""Sheets of the cases, their displacements, and what a case does with a built simulation."""

from __future__ import annotations

import math

import numpy as np

from warp_pd import Built, Sheet
from warp_pd.run.divergence import MAX_GAIN
from warp_pd.solvers.explicit import FIRST_ITERATIONS, BuiltExplicit

from .laws import DENSITY, THICKNESS, Rubber, Trial


def square(points: int = 9, size: float = 1.0, thickness: float = THICKNESS, density: float = DENSITY) -> Sheet:
    """A square sheet on a lattice."""
    return Sheet.rectangle(size, size, thickness=thickness, density=density, points=points)


def volume(sheet: Sheet) -> float:
    """Volume of the sheet [m^3]."""
    return float(sheet.areas.sum() * sheet.thickness)


def duration(trial: Trial, sheet: Sheet, rubber: Rubber, crossings: float) -> float:
    """Time in which a shear wave crosses the sheet so many times [s]; a quarter of it in short trials."""
    side = float(np.ptp(sheet.points, axis=0).max())
    return (0.25 if trial.short else 1.0) * crossings * side / math.sqrt(rubber.mu / sheet.density)


# Displacements [m], shape (N, 3) ----------------------------------------------------------------------------


def stretched(sheet: Sheet, a: float, b: float) -> np.ndarray:
    """A uniform stretch about the middle."""
    middle = sheet.points - sheet.points.mean(axis=0)
    return np.column_stack([(a - 1.0) * middle[:, 0], (b - 1.0) * middle[:, 1], np.zeros(sheet.size)])


def smooth(sheet: Sheet, amount: float) -> np.ndarray:
    """A smooth displacement in and out of the plane, zero at the edges, `amount` of the side."""
    low = sheet.points.min(axis=0)
    side = np.ptp(sheet.points, axis=0)
    x, y = ((sheet.points - low) / side).T
    bump = amount * side[0] * np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.column_stack([0.5 * bump * np.sin(2.0 * np.pi * y), -0.3 * bump * x, bump])


def rough(sheet: Sheet, amount: float, seed: int = 0) -> np.ndarray:
    """Random displacements of up to `amount` spacings, zero at the edges."""
    noise = np.random.default_rng(seed).uniform(-amount, amount, (sheet.size, 3)) * sheet.spacing
    noise[sheet.edges("all")] = 0.0
    return noise


# Built simulations ------------------------------------------------------------------------------------------


def put(built: Built, displacement: np.ndarray) -> None:
    """Give the sheet a displacement [m], shape (N, 3)."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))


def begin(built: Built) -> None:
    """Do what a run does before its first step."""
    built.context.run("start")
    for part in built.parts:
        part.begin()
    built.context.run("setup")


def force_at(built: Built, displacement: np.ndarray) -> np.ndarray:
    """Internal force [N] at a displacement [m], both of shape (N, 3)."""
    put(built, displacement)
    built.context.run("setup")
    return built.to_numpy(built.state.force)


def energies(built: Built) -> tuple[float, float]:
    """Kinetic energy, and stored energy plus viscous loss [J]; the latter is NaN for a law without an energy."""
    built.context.run("frame")
    strain = built.law.strain_energy
    stored = math.nan if strain is None else float(strain.numpy().sum()) + viscous_loss(built)
    return float(built.checks.kinetic_energy.numpy().sum()), stored


def viscous_loss(built: Built) -> float:
    """Energy lost to viscosity as of the last frame [J]; 0 for a law that does not report it."""
    viscous = getattr(built.law, "viscous", None)
    return 0.0 if viscous is None else float(viscous.numpy().sum())


def relax(built: Built, displacement: np.ndarray) -> None:
    """Put the sheet at a displacement [m], shape (N, 3), with internal variables as after a long time there."""
    internal = getattr(built.law, "internal", {})
    if internal:
        put(built, displacement)
        built.state.velocity.zero_()
        # A step of no length sets the strain; everything else has relaxed.
        take_steps(built, 1e-9, 1)
        for name, array in internal.items():
            if name != "strain":
                array.zero_()
    put(built, displacement)


def estimated_step(built: Built) -> float:
    """Stable step as a run estimates it [s]."""
    solver = built.solver
    assert isinstance(solver, BuiltExplicit)
    return solver.estimate(FIRST_ITERATIONS)


def take_steps(built: Built, dt: float, steps: int) -> None:
    """Take steps of `dt` [s] from the present state."""
    assert built.state.step is not None
    built.context.run("setup")
    built.state.step.fill_(dt)
    many = built.context.sequence("step", repeat=max(1, min(100, steps)))
    for _ in range(max(1, steps // 100)):
        many.run()


def why_diverged(built: Built, total: np.ndarray, dt: float) -> str:
    """Why a run would have ended as diverged, or "".

    Args:
        built: The simulation.
        total: Energies up to now [J].
        dt: Step [s].
    """
    state = built.state
    if not (np.isfinite(state.displacement.numpy()).all() and np.isfinite(state.velocity.numpy()).all()):
        return "it became NaN or Inf"
    if np.linalg.norm(built.to_numpy(state.velocity), axis=1).max() * dt > built.law.families.horizon:
        return "points move more than a horizon in a step"
    gained = built.law.has_energy and not (total / total[0]).max() <= 1.0 + MAX_GAIN
    return "it gained energy" if gained else ""
