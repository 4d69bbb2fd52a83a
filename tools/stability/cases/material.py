"""Cases of the material: stiff in volume, near and past its lock, relaxing fast and slowly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import bisect

from warp_pd import Built, Explicit, Fixed, Gent, NeoHookean, Sheet, Visco, ViscoBondBased

from ..laws import RUBBER, Rubber, Trial
from ..motion import duration, force_at, rough, smooth, square, stretched, volume
from ..runs import verdict_of_run, verdict_of_steps
from ..verdicts import CLEAN, Finding, NotApplicableError

# K/mu of the sheets near their lock; softer ones swell instead.
LOCK_RATIO = 1e4


def stretch_at(rubber: Rubber, share_of_lock: float) -> float:
    """Equibiaxial stretch at a share of the lock."""
    return float(bisect(lambda a: rubber.share_of_lock(a) - share_of_lock, 1.001, 40.0))


def stress_error(built: Built, sheet: Sheet, rubber: Rubber, a: float, b: float) -> tuple[float, np.ndarray]:
    """Error of the mean stress of a uniformly stretched sheet over the exact stress, and the mean stress [Pa]."""
    force = force_at(built, stretched(sheet, a, b))
    mean = -(force[:, :2] * sheet.points).sum(axis=0) / volume(sheet)
    exact = rubber.stress(a, b)
    for term in getattr(built.simulation.force, "prony", ()):
        # Nothing has relaxed yet; the terms are incompressible.
        exact = exact + 2.0 * term.c10 * (np.array([a, b]) - 1.0 / (np.array([a, b]) * (a * b) ** 2))
    return float(np.abs(mean - exact).max() / np.abs(exact).max()), mean


def stiffness(rubber: Rubber, share_of_lock: float | None = None) -> Callable[[Trial], Finding]:
    """A sheet of this rubber: first its stress under a uniform stretch, then its motion from a rough start."""

    def find(trial: Trial) -> Finding:
        sheet, a, b = square(), 1.3, 0.9
        if share_of_lock is not None:
            a = b = stretch_at(rubber, share_of_lock)
        known = isinstance(trial.simulation(sheet, rubber).force.material, NeoHookean | Gent)
        error, stress = stress_error(trial.built(sheet, rubber), sheet, rubber, a, b)
        small = 1.0 if share_of_lock is None else 1.0 - share_of_lock
        start = stretched(sheet, a, b) + small * (smooth(sheet, 0.02) + rough(sheet, 0.01))
        time = duration(trial, sheet, rubber, 2.0)
        found = verdict_of_steps(
            trial,
            lambda share: trial.simulation(
                sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=20, safety=share),
            ),
            rubber.energy(a, b) * volume(sheet),
        )  # fmt: skip
        if found.verdict == CLEAN:
            return replace(found, number=None)
        if not known:
            return replace(found, unit=found.unit or "energy ")
        return replace(found, number=error, field=stress, unit="")

    return find


def past_lock(trial: Trial) -> Finding:
    """Stretched to one and a half times 99 % of the lock: the run must end with a message, or swell correctly."""
    rubber, sheet = Rubber(lock=20.0, ratio=LOCK_RATIO), square()
    a = 1.5 * stretch_at(rubber, 0.99)
    simulation = trial.simulation(
        sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, a, a),
        solver=Explicit(duration(trial, sheet, rubber, 1.0), frames=20),
    )  # fmt: skip
    return verdict_of_run(trial, simulation, math.inf)


def relaxing(relaxation: float) -> Callable[[Trial], Finding]:
    """A sheet that relaxes much faster than a step, or much slower than the run, from a rough start."""

    def find(trial: Trial) -> Finding:
        sheet, rubber = square(), replace(RUBBER, relaxation=relaxation)
        if not isinstance(trial.simulation(sheet, rubber).force, Visco | ViscoBondBased):
            raise NotApplicableError("nothing relaxes")
        start, time = stretched(sheet, 1.3, 0.9) + smooth(sheet, 0.1), duration(trial, sheet, rubber, 2.0)
        return verdict_of_steps(
            trial,
            lambda share: trial.simulation(
                sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=20, safety=share),
            ),
            rubber.energy(1.3, 1.0) * volume(sheet),
        )  # fmt: skip

    return find
