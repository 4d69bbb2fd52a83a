"""Internal variables of viscous laws in implicit time steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..device.fields import assign
from ..implicit.steps import InternalVariables
from ..kernels.visco.in_step import relaxed

if TYPE_CHECKING:
    from .law import BranchedForce, Maxwell, ViscoForce


class MaxwellInStep(InternalVariables):
    """M of Maxwell elements, by the exact update for a C^-1 that is linear in time in each step.

    With x = dt / tau that is M <- (1 - k) M + (k - b) C^-1(n) + b C^-1(n+1), k = 1 - exp(-x), b = 1 - k / x. It is
    taken as two steps at constant C, one at each end, that are x - ln(x / k) and ln(x / k) long, so that what is lost
    is known exactly. What forms during the step is free of stress at its end: b weakens the branch, no more. The second
    and the first of the next step, at the same C, are one.
    """

    def __init__(self, force: BranchedForce, branches: Sequence[Maxwell]) -> None:
        """Allocate the terms of a step, and let the force and its tangent take them."""
        self._force, context = force, force.context
        self._exact = np.array([term.constants for term in branches])
        one = context.array("unit_step", force.owner, context.types.real, np.ones(1), per="table")
        self._relaxing, self.trial_terms = (
            context.array(f"branches_{name}", force.owner, context.types.parameters, self._exact, per="table")
            for name in ("relaxing", "in_step")
        )
        self.trial_state = force.state
        force.add_pairs(context.stage("relax", "every implicit step"), context.state.displacement, one, self._relaxing)
        self._dt = 0.0
        # Time over relaxation time at the end of a step, by branch; what is still to relax, and was before the step.
        self._after = self._left = self._was_left = np.zeros(len(branches))
        self._set = self._left

    def begin_step(self, dt: float, again: bool) -> None:
        """Relax at the displacement before a step of dt [s], also what the last step has left."""
        if dt != self._dt:
            self._dt, values = dt, self._exact.copy()
            x = dt / self._exact[:, 1]
            weaker = -np.expm1(-x) / x
            values[:, 0] *= weaker
            assign(self.trial_terms, values)
            self._after = -np.log(weaker)
        if again:
            self._left = self._was_left
        self._was_left = self._left
        self._relax(self._left + dt / self._exact[:, 1] - self._after)

    def end_step(self) -> None:
        """Leave the rest to the next step, which begins at the same displacement."""
        self._left = self._after

    def settle(self) -> None:
        """Relax what the last step has left."""
        if self._left.any():
            self._relax(self._left)

    def _relax(self, x: np.ndarray) -> None:
        """Relax at the present displacement for x times the relaxation time of each branch."""
        if not np.array_equal(x, self._set):
            values = self._exact.copy()
            values[:, 1] = 1.0 / x
            assign(self._relaxing, values)
            self._set = x
        self._force.context.sequence("relax").run()
        self._left = np.zeros_like(x)


class PronyInStep(InternalVariables):
    """Stresses of Prony terms, by the exact update for a stress S_p(C) that is linear in time in each step."""

    def __init__(self, force: ViscoForce) -> None:
        """Allocate the terms and the state of a step, and let the force and its tangent take them."""
        self._force, context = force, force.context
        self._exact = np.array([term.constants for term in force.prony])
        self._step = context.array("law_step", force.owner, context.types.real, np.ones(1), per="once")
        self.trial_terms = context.array(
            "prony_in_step", force.owner, context.types.parameters, self._exact, per="table"
        )
        self.trial_state = context.array(
            "viscous_state_in_step", force.owner, context.types.parameters, shape=force.state.shape, per="bond"
        )
        stage = context.stage("relax before", "every implicit step")
        stage.launch(
            force.owner, relaxed(context.bits), force.points, step=self._step, prony=force.terms, state=force.state,
            members=force.families.members, relaxed=self.trial_state,
        )  # fmt: skip
        stage = context.stage("relax after", "every implicit step")
        force.add_pairs(stage, context.state.displacement, self._step, force.terms)
        self._dt = 0.0

    def begin_step(self, dt: float, again: bool) -> None:
        """Find what is left of the stresses after a step of dt [s], and what remains of those that it adds."""
        if dt != self._dt:
            self._dt = dt
            assign(self._step, np.array([dt]))
            x = dt / self._exact[:, 2]
            values = self._exact.copy()
            values[:, :2] *= (-np.expm1(-x) / x)[:, None]
            assign(self.trial_terms, values)
        self._force.context.sequence("relax before").run()

    def end_step(self) -> None:
        """Advance to the displacement after the step."""
        self._force.context.sequence("relax after").run()

    def settle(self) -> None:
        """Nothing is left."""
