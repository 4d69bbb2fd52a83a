"""Cases of the time step: the estimate of the stable step must be a bound, and a sharp one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from warp_pd import Built, Fixed, PointForce, Sheet

from ..laws import Trial
from ..motion import estimated_step, force_at, relax, stretched, take_steps
from ..verdicts import SMALLER, STABLE, WRONG, Finding


def largest_share(built: Built, start: np.ndarray, shares: Sequence[float], steps: int) -> tuple[float, float]:
    """The last share of the estimate at which small motion stays bounded, and the first at which it does not."""
    velocity = 1e-5 * np.random.default_rng(1).normal(size=start.shape)
    velocity[built.context.held != 0] = 0.0
    state = built.state
    dtype = state.displacement.numpy().dtype
    relax(built, start)
    estimate, bounded = estimated_step(built), 0.0
    # A dead load keeps the start in equilibrium. It does not affect small motion.
    assert state.external is not None
    state.external.assign((-force_at(built, start)).astype(dtype))
    for share in shares:
        relax(built, start)
        state.velocity.assign(velocity.astype(dtype))
        take_steps(built, share * estimate, steps)
        growth = np.abs(built.to_numpy(state.velocity)).max() / np.abs(velocity).max()
        if not growth < 30.0:
            return bounded, share
        bounded = share
    return bounded, math.inf


def step_bound(make: Callable[[], Sheet], a: float, b: float) -> Callable[[Trial], Finding]:
    """A sheet at rest at a uniform stretch: stable at the estimate, unstable not far above."""

    def find(trial: Trial) -> Finding:
        sheet = make()
        edge = sheet.edges("left")
        # Its value is replaced by what keeps the stretched sheet in equilibrium.
        load = PointForce(np.arange(sheet.size), (0.0, 0.0, 1e-30))
        built = trial.built(sheet, loads=[Fixed(edge), load])
        shares = (0.5, 0.8, 1.0, 1.02, 1.05, 1.1, 1.2)
        bounded, broke = largest_share(built, stretched(sheet, a, b), shares, 400 if trial.short else 1000)
        if bounded < 1.0 and largest_share(built, stretched(sheet, a, b), (0.2,), 5000)[0] == 0.0:
            bounded = 0.0
        verdict = STABLE if bounded >= 1.0 else SMALLER
        remark = f"unstable at {broke:g}" if broke < math.inf else "stable at all shares"
        if bounded >= 1.0 and broke > 1.1:
            verdict, remark = WRONG, f"{remark}: the estimate wastes steps"
        if bounded == 0.0:
            verdict, remark = WRONG, "small motion grows at any step: the force has no potential"
        return Finding(verdict, bounded, remark)

    return find
