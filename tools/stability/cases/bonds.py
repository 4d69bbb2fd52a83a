"""Cases of few bonds: all others are broken."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from warp_pd import Built, CriticalStretch
from warp_pd.families import pack

from ..laws import DENSITY, MU, Trial
from ..motion import begin, energies, square, take_steps, volume, why_diverged
from ..runs import ENERGY_ERROR, with_prestress
from ..verdicts import CLEAN, KINETIC, STABLE, WRONG, Finding


def keep_bonds(built: Built, pairs: Sequence[tuple[int, int]]) -> None:
    """Break all bonds except those between these points."""
    heads = built.law.families.members_of(np.arange(built.simulation.sheet.size))
    wanted = {(a, b) for a, b in pairs} | {(b, a) for a, b in pairs}
    keep = np.array([[(i, int(j)) in wanted for j in row] for i, row in enumerate(heads)])
    assert built.law.intact is not None
    built.law.intact.assign(np.ascontiguousarray(pack(keep).T))


def few_bonds(pairs: Sequence[tuple[int, int]]) -> Callable[[Trial], Finding]:
    """A sheet of 5 x 5 points with these intact bonds only, displaced, shaken and left alone."""

    def find(trial: Trial) -> Finding:
        sheet = square(5)
        rng = np.random.default_rng(2)
        velocity = 0.05 * rng.normal(size=(sheet.size, 3))
        built = trial.built(
            sheet, initial_displacement=0.05 * sheet.spacing * rng.normal(size=(sheet.size, 3)),
            initial_velocity=velocity, damage=CriticalStretch(1e3),
        )  # fmt: skip
        keep_bonds(built, pairs)
        begin(built)
        mass = built.to_numpy(built.state.mass)[:, None]
        before, momentum = energies(built), (mass * velocity).sum(axis=0)
        dt = 0.02 * sheet.spacing / math.sqrt(MU / DENSITY)
        take_steps(built, dt, 500 if trial.short else 3000)
        kinetic, strain = energies(built)
        if why := why_diverged(built, np.array([sum(before), kinetic + strain]), dt):
            return Finding(CLEAN, None, f"a run ends with a message: {why}")
        error = np.abs((mass * built.to_numpy(built.state.velocity)).sum(axis=0) - momentum).max()
        error /= (mass * np.abs(velocity)).sum()
        field = built.to_numpy(built.state.displacement)
        if math.isnan(strain):
            # Without an energy of the law: a few bonds cannot store more than the sheet at this strain.
            assert built.rupture is not None
            intact = 1.0 - float(built.to_numpy(built.rupture.damage).mean())
            budget = with_prestress(built.simulation, before[0] + 0.01 * MU * volume(sheet), intact)
            good = error < 1e-3 and kinetic < (1.0 + ENERGY_ERROR) * budget
            return Finding(STABLE if good else WRONG, kinetic / budget, field=field, unit=KINETIC)
        budget = before[0] + before[1]
        number = max(float(error), abs(kinetic + strain - budget) / budget)
        return Finding(STABLE if number < 1e-3 else WRONG, number, field=field)

    return find
