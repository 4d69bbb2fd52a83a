"""Internal variables of viscous laws in implicit time steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..device.fields import assign
from ..implicit.internal import InternalVariables
from ..kernels.visco.in_step import relaxed

if TYPE_CHECKING:
    from .law import BranchedForce, ViscoForce
    from .viscous import Maxwell


class MaxwellInStep(InternalVariables):
    """M of Maxwell elements, by the exact update for a C^-1 that is linear in time in each step.

    With x = dt / tau that is M <- (1 - k) M + (k - b) C^-1(n) + b C^-1(n+1), k = 1 - exp(-x), b = 1 - k / x. It is
    taken as two steps at constant C, one at each end, that are x - ln(x / k) and ln(x / k) long, so that what is lost
    is known exactly. What forms during the step is free of stress at its end: b weakens the branch, no more.
    """

    def __init__(self, force: BranchedForce, branches: Sequence[Maxwell]) -> None:
        """Allocate the terms of a step, and let the force and its tangent take them."""
        self._force, context = force, force.context
        self._exact = np.array([term.constants for term in branches])
        one = context.array("unit_step", force.owner, context.types.real, np.ones(1), per="table")
        self._terms = {
            name: context.array(f"branches_{name}", force.owner, context.types.parameters, self._exact, per="table")
            for name in ("before", "trial", "after")
        }
        for name in ("before", "after"):
            stage = context.stage(f"relax {name}", "every implicit step")
            force.add_pairs(stage, context.state.displacement, one, self._terms[name])
        self._dt, self.trial_terms, self.trial_state = 0.0, self._terms["trial"], force.state

    def begin_step(self, dt: float) -> None:
        """Relax at the displacement before a step of dt [s]."""
        if dt != self._dt:
            self._dt = dt
            x = dt / self._exact[:, 1]
            left = -np.expm1(-x) / x
            after = -np.log(left)
            for name, values in (("before", {1: 1.0 / (x - after)}), ("after", {1: 1.0 / after})):
                self._set(name, values)
            self._set("trial", {0: self._exact[:, 0] * left})
        self._force.context.sequence("relax before").run()

    def end_step(self) -> None:
        """Relax at the displacement after the step."""
        self._force.context.sequence("relax after").run()

    def _set(self, name: str, columns: dict[int, np.ndarray]) -> None:
        values = self._exact.copy()
        for column, value in columns.items():
            values[:, column] = value
        assign(self._terms[name], values)


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

    def begin_step(self, dt: float) -> None:
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
