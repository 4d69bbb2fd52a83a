"""Rupture by the energy release rate of bonds (VE, section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import InputError, positive
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltRupture
from ..interfaces.scales import Scales
from ..kernels.papers.energy_release import critical_energy, energy_release
from ..kernels.rupture import Criterion
from ..parts.rupture import BondCriterion, BreakingBonds
from ..step import Phase


@dataclass(frozen=True, eq=False)
class CriticalEnergy(BondCriterion):
    """A bond breaks permanently when its energy release rate exceeds Gc / Nc. Source: VE, section 4.3.

    Each end of a bond contributes half of the work of the bond force, divided by the crack surface h dx that the bond
    represents. Nc is the number of interactions across such a surface, 36 at a horizon of 3.015 spacings. The work is
    summed from the start, including that of any tension of the law in the undeformed sheet. Only with the solver
    Explicit.

    Attributes:
        energy: Critical energy release rate Gc [N/m].
        spared: Points whose bonds never break, such as those in a clamp; None for none.

    Raises:
        InputError: if the energy is not positive.
    """

    energy: float
    spared: Any = None

    def __post_init__(self) -> None:
        positive("CriticalEnergy.energy", self.energy)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether its length is far from that of the sheet."""
        return scales.of_tearing_energy("CriticalEnergy.energy", self.energy, self.energy)

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The critical energy release rate of an interaction, and the array of the energy released by each bond."""
        found = critical_energy(context.layout)
        values = found.struct()
        shape = (law.families.members, context.sheet.size)
        values.energy_release = context.array(
            "energy_release", "CriticalEnergy", context.types.real, shape=shape, per="bond", restart=True
        )
        if context.sheet.spacings is not None:
            raise InputError("damage = CriticalEnergy: expected a sheet of uniform spacing, got a graded sheet")
        if np.ndim(context.sheet.thickness):
            raise InputError(
                "damage = CriticalEnergy: expected a sheet of uniform thickness, or TearingEnergy as the criterion"
            )
        values.critical = self.energy / crossing_bonds(law.horizon_ratio)
        return found, values

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """Build the criterion on a device. Raises InputError if the force law does not store bond forces."""
        return BreakingByEnergy("CriticalEnergy", self, context, law)


def crossing_bonds(horizon: float) -> int:
    """Nc: mean number of bonds across a spacing of a line, from both ends; `horizon` in spacings."""
    reach = int(horizon)
    return sum(
        abs(across)
        for across in range(-reach, reach + 1)
        for along in range(-reach, reach + 1)
        if across**2 + along**2 <= horizon**2
    )


class BreakingByEnergy(BreakingBonds):
    """BreakingBonds with a launch that sums the work of every bond."""

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase."""
        super().add(phase, stage)
        if phase is Phase.BOND_WORK:
            context, law, sheet = self.context, self.law, self.context.sheet
            stage.launch(
                self.owner, energy_release(context.layout), sheet.size,
                family=law.struct, velocity=context.state.velocity, step=context.state.step,
                bond_force=law.bond_force(), inverse_surface=1.0 / (sheet.thickness * sheet.spacing),
                energy_release=self.criterion.energy_release,
            )  # fmt: skip
