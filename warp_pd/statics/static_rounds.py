"""What happens between equilibria at constant loads: multipliers of contact are updated, then bonds break."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..device.fields import Array
from ..interfaces import System

# A point that is so many sizes of the sheet from its place, beyond what is prescribed, is in no equilibrium: no rubber
# stretches that far.
FARTHEST = 100.0
# Relative round-off of a number, by precision.
UNIT_ROUND_OFF = {64: 2.0**-53, 32: 2.0**-24}
# A sheet torn in two or gone slack carries nothing: its unbalanced force is compared with this fraction of what it
# carried before.
MIN_LOAD = 1e-3
# Rounds of rupture at one load step after which the tear counts as running through.
MAX_ROUNDS = 1000


def flies(context: Context, moved: np.ndarray, prescribed: float) -> bool:
    """Whether a displacement [m], shape (N, 3), is too large for any equilibrium, beyond the prescribed one [m]."""
    farthest = prescribed + FARTHEST * float(context.whole.extent.max())
    return context.communicator.any(bool(np.abs(moved).max() > farthest))


@dataclass(frozen=True)
class Round:
    """A search for equilibrium at the same loads as the one before it.

    Attributes:
        broken: Whether bonds have broken, or the damage has grown.
        tolerance: Relative residual at which it ends.
        title: Text such as "round 2 of contact", or "".
    """

    broken: bool
    tolerance: float
    title: str


class StaticRounds:
    """Contact and rupture in static equilibrium. After each change equilibrium is found again.

    Attributes:
        contacts: Bodies that touch the sheet.
        close_enough: Relative residual of an equilibrium to which breaking is applied; 0 for the solver's tolerance.
    """

    def __init__(self, system: System, moved: Array | None = None) -> None:
        """Compose the stages; `moved` as for `BuiltRupture.prepare_at_rest`."""
        self._rupture, self._communicator = system.rupture, system.context.communicator
        self.contacts = system.external.contacts
        self.close_enough = 0.0
        self._endless: list[float] = []
        for contact in self.contacts:
            contact.prepare()
        if self._rupture is not None:
            self.close_enough = self._rupture.close_enough
            self._rupture.prepare_at_rest(moved)

    def following(self, entry: dict[str, Any], settled: bool, tolerance: float) -> Round | None:
        """The round after an equilibrium; None if nothing has changed there, and it is `settled` to `tolerance`.

        `entry` is that of the load step in the report, whose rounds it counts.
        """
        # Bonds break only with the final forces of contact.
        updated = self.update_multipliers()
        broken = not updated and self.breaks(entry["rounds"])
        if not updated and not broken and settled:
            return None
        entry["rounds"] += updated or broken
        title = f"round {entry['rounds']} of {'contact' if updated else 'rupture'}" if entry["rounds"] else ""
        return Round(broken, max(tolerance, self.close_enough) if broken else tolerance, title)

    def update_multipliers(self) -> bool:
        """Update the multipliers of contact; return whether equilibrium must be found again."""
        # A sum, so that every contact is asked.
        return sum(contact.update_multipliers() for contact in self.contacts) > 0

    def passed(self) -> bool:
        """Whether a body has passed through the sheet, so that the load step must be refused."""
        return sum(contact.passed() for contact in self.contacts) > 0

    def breaks(self, rounds: int) -> bool:
        """Break the bonds that exceed the criterion after some rounds at these loads; return whether any did."""
        return self._rupture is not None and self._communicator.any(self._rupture.break_at_rest(rounds > 0))

    def energy(self, rounds: int | None = None) -> float:
        """Energy of the damage field [J] that `breaks` would find; without `rounds`, that of the damage as it is."""
        assert self._rupture is not None
        return self._rupture.energy_at_rest(None if rounds is None else rounds > 0)

    def runs_through(self, load_step: Mapping[str, Any]) -> bool:
        """Whether a load step of the report reached the maximum number of rounds, so that the tear runs through."""
        if load_step["rounds"] < MAX_ROUNDS:
            return False
        self._endless.append(load_step["share"])
        return True

    def notes(self) -> list[str]:
        """Notes on load steps at which rupture did not stop."""
        return [
            f"at load factor {factor:.4g} rupture went on after {MAX_ROUNDS} rounds: it runs through, or needs smaller "
            "load steps"
            for factor in dict.fromkeys(self._endless)
        ]
