"""Launches of the explicit integrator: drift and kick."""

from __future__ import annotations

from ..context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..kernels.integrate import integration
from ..step import Phase

OWNER = "solver"


def add_motion(phase: Phase, stage: Stage, context: Context, inertia: Array) -> None:
    """Add the pointwise stages of drift and kick in their phases; `inertia`: mass or fictitious mass [kg], (N,)."""
    if phase not in (Phase.DRIFT, Phase.KICK):
        return
    state = context.state
    kernels = integration(context.options)
    stage.pointwise(
        OWNER, kernels.drift if phase is Phase.DRIFT else kernels.kick, context.sheet.size,
        mass=inertia, held_mask=state.held_mask, step=state.step, damping=state.damping, force=state.force,
        external=state.external, displacement=state.displacement, velocity=state.velocity, work=state.work,
        dissipated=state.dissipated,
    )  # fmt: skip
