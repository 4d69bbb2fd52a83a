"""Rupture in static equilibrium: bonds break only in equilibrium, and then equilibrium is sought again."""

from __future__ import annotations

from ..device.checks import InputError
from ..interfaces import System
from ..interfaces.phases import Phase

# A sheet torn in two or gone slack carries nothing: its unbalanced force is compared with this fraction of what it
# carried before.
MIN_LOAD = 1e-3
# Rounds of rupture at one load step after which the tear counts as running through.
MAX_ROUNDS = 1000


class StaticRupture:
    """Breaks the bonds that exceed the criterion in static equilibrium; without a criterion it breaks none.

    Attributes:
        intact: Bits of the intact bonds, or None if nothing can break.
    """

    def __init__(self, system: System) -> None:
        """Add the stage "rupture", if anything can break."""
        self.intact, self._context = system.law.intact, system.context
        if system.context.features.softened:
            raise InputError("damage = TearingEnergy: expected the solver Explicit, or CriticalStretch with this one")
        if self.intact is not None:
            system.add([Phase.RUPTURE], self._context.stage("rupture", "whenever the sheet is in static equilibrium"))

    def breaks(self) -> bool:
        """Break what exceeds the criterion; whether anything did."""
        if self.intact is None:
            return False
        before = self.intact.numpy().copy()
        self._context.run("rupture")
        return self._context.communicator.any(bool((self.intact.numpy() != before).any()))
