"""Verdicts of whole runs, at the default step and at smaller ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from warp_pd import Frame, Simulation, ViscoBondBased
from warp_pd.interfaces import Writer
from warp_pd.run.divergence import DivergedError
from warp_pd.run.runner import DIVERGED

from .laws import Trial
from .motion import volume
from .verdicts import CLEAN, KINETIC, NONE, SMALLER, STABLE, WRONG, Finding

# Steps over the estimated stable step that are tried in turn.
SHARES = (0.9, 0.45, 0.2, 0.1, 0.05, 0.02)
# Error of the energy balance, or energy beyond the available one, above which a run is wrong.
ENERGY_ERROR = 0.02
# Decrease of the viscous loss from frame to frame, over the largest energy, above which a run is wrong.
LOSS_ERROR = 1e-4
# No further step is tried so many seconds after the first one, which includes compilation.
PATIENCE = 10.0


class FiniteFrames(Writer):
    """Remembers whether every frame was finite."""

    def __init__(self) -> None:
        self.all_finite = True

    def write(self, frame: Frame) -> None:
        """Look at the frame."""
        self.all_finite &= bool(np.isfinite(frame.displacement).all() and np.isfinite(frame.velocity).all())


def with_prestress(simulation: Simulation, budget: float, intact: float = 1.0) -> float:
    """An energy [J] plus what the prestress of the law ViscoBondBased releases if its bonds shrink to nothing.

    Args:
        simulation: With any law; only this one has a prestress.
        budget: [J], of the long-term shear modulus; forces are of the instantaneous one.
        intact: Share of intact bonds.
    """
    law = simulation.force
    if not isinstance(law, ViscoBondBased):
        return budget
    more = 1.0 + sum(term.c10 for term in law.prony) / law.material.c10
    return more * (budget + intact * 3.0 * law.material.c10 * volume(simulation.sheet))


def verdict_of_run(trial: Trial, simulation: Simulation, budget: float) -> Finding:
    """Verdict of one whole run.

    The number is the worst error of the energy balance over the largest energy. For a law without an energy it is the
    largest kinetic energy over `budget`, the available energy [J].
    """
    watch, budget = FiniteFrames(), with_prestress(simulation, budget)
    try:
        result = simulation.run(device=trial.device, precision=trial.bits, writers=[watch])
    except DivergedError as error:
        return Finding(CLEAN, None, str(error))
    rows = result.history
    if "balance_error" in rows[-1]:
        number, limit, unit = max(abs(row["balance_error"]) for row in rows), ENERGY_ERROR, ""
    else:
        number, limit, unit = max(row["kinetic"] for row in rows) / budget, 1.0 + ENERGY_ERROR, KINETIC
    if not watch.all_finite:
        return Finding(WRONG, number, "a frame with NaN or Inf was written", unit=unit)
    if result.status == DIVERGED:
        return Finding(CLEAN, number, result.summary["message"], unit=unit)
    if number > limit:
        return Finding(WRONG, number, "energy", unit=unit)
    losses = np.array([row.get("viscous", 0.0) for row in rows])
    fall = -np.diff(losses).min() / max(row["kinetic"] + row.get("strain", 0.0) for row in rows)
    # Where a bond breaks, the strain of the others jumps, and with it the energy that they store.
    if simulation.damage is None and fall > LOSS_ERROR:
        return Finding(WRONG, fall, "the viscous loss falls", unit=unit)
    return Finding(STABLE, number, field=result.frame.displacement, unit=unit)


def verdict_of_steps(trial: Trial, make: Callable[[float], Simulation], budget: float) -> Finding:
    """Finding at the largest share of the estimated step at which the run is stable; failing that, at the smallest.

    Args:
        trial: Where it runs.
        make: Makes the simulation of a share.
        budget: Available energy [J].
    """
    found, first_end = Finding(NONE), math.inf
    for share in SHARES:
        found = verdict_of_run(trial, make(share), budget)
        if found.verdict == STABLE:
            return found if share == SHARES[0] else replace(found, verdict=SMALLER, remark=f"at {share:g}")
        found = replace(found, remark=f"at {share:g}: {found.remark}")
        first_end = min(first_end, perf_counter())
        if perf_counter() - first_end > PATIENCE:
            break
    return found
