"""Cases of geometry: units, thickness, irregular clouds of points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warp_pd import Explicit, Fixed, Sheet, Simulation

from ..laws import DENSITY, MU, RUBBER, THICKNESS, Rubber, Trial
from ..motion import begin, duration, smooth, square, stretched, take_steps, volume
from ..runs import verdict_of_steps
from ..verdicts import STABLE, WRONG, Finding


def smooth_motion(trial: Trial, sheet: Sheet, rubber: Rubber) -> np.ndarray:
    """Displacement over the side after some smooth motion; the number of steps does not depend on the units."""
    built = trial.built(
        sheet, rubber, loads=[Fixed(sheet.edges("all"))],
        initial_displacement=stretched(sheet, 1.2, 1.1) + smooth(sheet, 0.05),
    )  # fmt: skip
    begin(built)
    side = float(np.ptp(sheet.points, axis=0)[0])
    dt = 0.005 * side / math.sqrt(rubber.mu / sheet.density)
    take_steps(built, dt, 200)
    return built.to_numpy(built.state.displacement) / side


def units_and_thickness(length: float = 1.0, thickness: float = THICKNESS) -> Callable[[Trial], Finding]:
    """The same sheet in units of `1/length` metres (kg and s stay), or of another thickness, against the first."""

    def find(trial: Trial) -> Finding:
        rubber = replace(RUBBER, mu=MU / length)
        sheet = square(size=length, thickness=thickness * length, density=DENSITY / length**3)
        found, expected = smooth_motion(trial, sheet, rubber), smooth_motion(trial, square(), RUBBER)
        if not np.isfinite(found).all():
            return Finding(WRONG, None, "NaN or Inf")
        error = float(np.abs(found - expected).max() / np.abs(expected).max())
        limit = 2e-5 if trial.bits == 32 else 1e-12
        return Finding(STABLE if error < limit else WRONG, error, field=found)

    return find


def graded(points: int = 8, ratio: float = 10.0) -> Sheet:
    """A square cloud whose spacing grows by `ratio` from one corner to the other, in both directions."""
    steps = np.geomspace(1.0, ratio, points - 1)
    x = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    grid = np.column_stack([g.ravel() for g in np.meshgrid(x, x)])
    corner = np.arange(points * points).reshape(points, points)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    # Horizons are in units of about the widest spacing, so that every family reaches its neighbours.
    spacing = 0.8 * float(steps[-1] / steps.sum())
    return Sheet.from_points(grid, thickness=THICKNESS, density=DENSITY, triangles=triangles, spacing=spacing)


def cloud(make: Callable[[], Sheet]) -> Callable[[Trial], Finding]:
    """A sheet on a cloud of points, stretched and shaken."""

    def find(trial: Trial) -> Finding:
        sheet = make()
        edge = sheet.edges("all")
        start = stretched(sheet, 1.2, 1.1)
        velocity = smooth(sheet, 0.3)
        velocity[edge] = 0.0
        time = duration(trial, sheet, RUBBER, 2.0)

        def simulation(share: float) -> Simulation:
            return trial.simulation(
                sheet, loads=[Fixed(edge)], initial_displacement=start, initial_velocity=velocity,
                solver=Explicit(time, frames=20, safety=share),
            )  # fmt: skip

        return verdict_of_steps(trial, simulation, 1.2 * RUBBER.energy(1.2, 1.1) * volume(sheet))

    return find
