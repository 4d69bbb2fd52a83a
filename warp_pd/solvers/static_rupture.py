"""Rupture in static equilibrium: the criterion acts only in equilibrium, and then equilibrium is sought again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..interfaces import System

# A sheet torn in two or gone slack carries nothing: its unbalanced force is compared with this fraction of what it
# carried before.
MIN_LOAD = 1e-3
# Rounds of rupture at one load step after which the tear counts as running through.
MAX_ROUNDS = 1000


class StaticRupture:
    """Breaks the bonds that exceed the criterion in static equilibrium; without a criterion it breaks none.

    Attributes:
        close_enough: Relative residual at which more may break; 0: that of the solver.
    """

    def __init__(self, system: System) -> None:
        """Compose the stages of the criterion, if there is one."""
        self._rupture, self._communicator = system.rupture, system.context.communicator
        self.close_enough = 0.0
        self._endless: list[float] = []
        if self._rupture is not None:
            self.close_enough = self._rupture.close_enough
            self._rupture.prepare_at_rest()

    def breaks(self, rounds: int) -> bool:
        """Break what exceeds the criterion, after some rounds at these loads; whether to seek equilibrium again."""
        return self._rupture is not None and self._communicator.any(self._rupture.break_at_rest(rounds > 0))

    def goes_on(self, load_step: Mapping[str, Any]) -> bool:
        """Whether a load step of the report had so many rounds that the tear counts as running through."""
        if load_step["rounds"] < MAX_ROUNDS:
            return False
        self._endless.append(load_step["share"])
        return True

    def notes(self) -> list[str]:
        """Load steps at which rupture did not end."""
        return [
            f"at load factor {share:.4g} rupture went on after {MAX_ROUNDS} rounds: it runs through, or needs smaller "
            "load steps"
            for share in dict.fromkeys(self._endless)
        ]

    def remember(self) -> Sequence[np.ndarray]:
        """Copies of what rupture has left so far."""
        return [] if self._rupture is None else [array.numpy().copy() for array in self._rupture.memory]

    def restore(self, kept: Sequence[np.ndarray]) -> None:
        """Undo what broke since `remember`."""
        if self._rupture is not None:
            for array, values in zip(self._rupture.memory, kept, strict=True):
                array.assign(values)
