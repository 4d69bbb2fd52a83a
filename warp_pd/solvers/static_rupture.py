"""Rupture in static equilibrium: bonds break only in equilibrium, which is then found again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..device.fields import Array
from ..interfaces import System

# A sheet torn in two or gone slack carries nothing: its unbalanced force is compared with this fraction of what it
# carried before.
MIN_LOAD = 1e-3
# Rounds of rupture at one load step after which the tear counts as running through.
MAX_ROUNDS = 1000


# Irreversible state, such as broken bonds and the multipliers of contact: arrays and their values.
Kept = list[tuple[Array, np.ndarray]]


def copies(arrays: Iterable[Array]) -> Kept:
    """Arrays and copies of their values."""
    return [(array, array.numpy().copy()) for array in arrays]


def put_back(kept: Kept) -> None:
    """Give arrays the values that they had."""
    for array, values in kept:
        array.assign(values)


class StaticRupture:
    """Breaks the bonds that exceed the criterion in static equilibrium, if there is a criterion.

    Attributes:
        close_enough: Relative residual of an equilibrium to which breaking is applied; 0 for the solver's tolerance.
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
        """Break the bonds that exceed the criterion; return whether equilibrium must be found again.

        Args:
            rounds: Number of rounds so far at these loads.
        """
        return self._rupture is not None and self._communicator.any(self._rupture.break_at_rest(rounds > 0))

    def energy(self, rounds: int | None = None) -> float:
        """Energy of the damage field [J] that `breaks` would find; without `rounds`, that of the damage as it is."""
        assert self._rupture is not None
        return self._rupture.energy_at_rest(None if rounds is None else rounds > 0)

    def goes_on(self, load_step: Mapping[str, Any]) -> bool:
        """Whether a load step of the report reached the maximum number of rounds, so that the tear runs through."""
        if load_step["rounds"] < MAX_ROUNDS:
            return False
        self._endless.append(load_step["share"])
        return True

    def notes(self) -> list[str]:
        """Notes on load steps at which rupture did not stop."""
        return [
            f"at load factor {share:.4g} rupture went on after {MAX_ROUNDS} rounds: it runs through, or needs smaller "
            "load steps"
            for share in dict.fromkeys(self._endless)
        ]

    @property
    def memory(self) -> Sequence[Array]:
        """Arrays of the irreversible state."""
        return [] if self._rupture is None else self._rupture.memory
