"""Internal variables of laws in implicit time steps."""

from __future__ import annotations

import functools
from typing import Protocol

from ..interfaces import BuiltLaw


class InternalVariables(Protocol):
    """Internal variables of a law in implicit time steps; they belong to the displacement at the end of a step."""

    def begin_step(self, dt: float, again: bool) -> None:
        """At the displacement before a step of dt [s]: let the force respond as at its end.

        `again`: the last step failed, and the arrays of a restart file are what they were before it.
        """
        ...

    def end_step(self) -> None:
        """At the displacement after the step: advance to it, at the latest when `settle` or the next step asks."""
        ...

    def settle(self) -> None:
        """Let the arrays belong to the displacement, for frames."""
        ...


@functools.singledispatch
def internal_variables_of(law: BuiltLaw) -> InternalVariables | None:
    """Prepare a law for implicit steps; laws that have internal variables register how. Before its tangent is made.

    Raises:
        InputError: if the law has some that such steps cannot advance.
    """
    return None
