"""What happens between equilibria at constant loads: multipliers of contact are updated, then bonds break.

`LoadScale` is the size of loads and reactions, with which an unbalanced force is compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.fields import Array, to_host
from ..device.launches import Stage
from ..interfaces import System
from ..kernels.statics.equilibrium import residual

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


class LoadScale:
    """Loads and reactions of a state, without what the supports of a stressed sheet carried at the start.

    The reactions of prestress can exceed a load ten thousand times. An unbalanced force that is small against them may
    be the whole load: it must be small against what moves the sheet, too. A sheet that starts without stress has no
    arrays of its own for this.

    Attributes:
        initial: Internal force at the start of the run [N], (N,) vec3; None for a sheet without stress there.
    """

    def __init__(
        self, context: Context, owner: str, tolerance: float, accuracy: float, least: float = 0.0, stressed: bool = True
    ) -> None:
        """Allocate the sums.

        Args:
            context: The context.
            owner: Owner of the arrays.
            tolerance: Unbalanced force over loads and reactions in equilibrium.
            accuracy: The same over what moves a stressed sheet.
            least: The same over loads and reactions, below which any stressed sheet is in equilibrium.
            stressed: Whether the sheet may be stressed at the start.
        """
        self.context, self.owner, n = context, owner, context.sheet.size
        self._least, self._most = min(1.0, least / tolerance), max(1.0, accuracy / tolerance)
        self.reaction = context.array("reaction", owner, wp.float64, shape=n)
        self.initial: Array | None = None
        self._moving: Array | None = None
        if stressed and context.communicator.any(bool(context.initial_displacement.any())):
            self.initial = context.array("initial_force", owner, context.types.vec3, shape=n, restart=True)
            self._moving = context.array("moving_force", owner, wp.float64, shape=n)

    def add(self, stage: Stage, dead: Array | None, unbalanced: Array, squared: Array) -> None:
        """Add the launch of the unbalanced force, and of loads and reactions."""
        context, state, f = self.context, self.context.state, self.context.options
        kernel = residual(context.bits, f.held, f.loaded, dead is not None, self.initial is not None)
        stage.launch(
            self.owner, kernel, context.sheet.size, held_mask=state.held_mask, force=state.force,
            external=state.external, dead=dead, initial=self.initial, unbalanced=unbalanced, squared=squared,
            reaction=self.reaction, moving=self._moving,
        )  # fmt: skip

    @property
    def sums(self) -> dict[str, Array | None]:
        """Squared loads and reactions, and what moves a stressed sheet [N^2], by the arguments of `residual`."""
        return {"reaction": self.reaction, "moving": self._moving}

    def begin(self) -> None:
        """Store the internal force at the start of a run; a resumed run has it."""
        if self.initial is not None and not to_host(self.initial).any():
            wp.copy(self.initial, self.context.state.force)

    def size(self, total: Callable[[Array], float]) -> float:
        """Norm of loads and reactions [N], of a stressed sheet at most a multiple of what moves it.

        `total` sums an array of points.
        """
        size = math.sqrt(total(self.reaction))
        if self._moving is None:
            return size
        return max(min(size, self._most * math.sqrt(total(self._moving))), self._least * size)
