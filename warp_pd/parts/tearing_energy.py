"""A tearing energy as the criterion of rupture: the critical stretch that stands for it on a sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import InputError, positive
from ..device.context import Context
from ..interfaces import BuiltLaw, BuiltRupture, History
from ..kernels.rupture import Criterion, elongation
from ..materials import borne, stretch_of_density
from .rupture import BondCriterion, BreakingBonds, CriticalStretch

# Width kappa of a crack tip in spacings, at horizons from 2 to 4 spacings; see docs/tearing.md.
TIP_WIDTH = 2.07
# Range of the critical stretch: below it round-off and roughness break bonds, above it no rubber is known.
MIN_STRETCH, MAX_STRETCH = 1.05, 30.0


@dataclass(frozen=True, eq=False)
class TearingEnergy(BondCriterion):
    """A crack advances when the energy release rate reaches the tearing energy of the material, Gc.

    A bond breaks for good at the critical stretch s_c that stands for Gc on the sheet, by Thomas's relation (1955): the
    tearing energy is the width of the tip times the work per volume to break the material there,

        Gc = kappa dx W(s_c),

    with the energy density W of pure shear, the spacing dx, and the width kappa of a tip in spacings, as measured in
    docs/tearing.md. It costs no more than `CriticalStretch`. The elongation of a bond shorter than the spacing, as
    irregular clouds have, counts over the spacing: otherwise the roughness of the displacement would break it.

    Attributes:
        energy: Tearing energy Gc [J/m^2], such as 1e4 for natural rubber.
        spared: Points whose bonds never break, such as those in a clamp; None if all bonds may break.

    Raises:
        InputError: for an energy that is not positive.
    """

    energy: float
    spared: Any = None

    def __post_init__(self) -> None:
        positive("TearingEnergy.energy", self.energy)

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The critical stretch.

        Raises:
            InputError: for a law without an energy density, or a spacing that cannot resolve the tearing energy.
        """
        stretch = self.critical_stretch(law, context.sheet.spacing)
        found = elongation(context.layout, context.bits, context.module)
        values = found.struct()
        values.stretch, values.spacing = stretch, context.sheet.spacing
        return found, values

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """The criterion on a device."""
        return TearingBonds("TearingEnergy", self, context, law)

    def critical_stretch(self, law: BuiltLaw, spacing: float) -> float:
        """Critical stretch s_c that stands for the tearing energy at a spacing [m].

        Raises:
            InputError: if there is none in the range that the spacing resolves.
        """
        width = TIP_WIDTH * spacing
        stretches = np.geomspace(MIN_STRETCH, MAX_STRETCH, 400)
        found = stretch_of_density(law.energy_density, self.energy / width, stretches)
        if np.isnan(found):
            density = law.energy_density(stretches)
            last = borne(density) - 1
            low, high, largest = density[0] * width, density[last] * width, stretches[last]
            raise InputError(
                f"TearingEnergy.energy = {self.energy:g}: expected {low:.3g} to {high:.3g} J/m^2 at a spacing of "
                f"{spacing:.3g} m, which are stretches from {MIN_STRETCH:g} to {largest:.3g}"
            )
        return found


class TearingBonds(BreakingBonds):
    """Bonds that break by a tearing energy."""

    criterion: Any

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """The critical stretch that was used."""
        values = self.criterion
        return [
            f"the tearing energy stands for a critical stretch of {values.stretch:.4g} at a spacing of "
            f"{values.spacing:.4g} m"
        ]


def stretch_or_energy(critical_stretch: float, tearing_energy: float | None, spared: Any = None) -> BondCriterion:
    """The criterion of a scene: a tearing energy [J/m^2] if one is given, a critical stretch [-] otherwise."""
    if tearing_energy is not None:
        return TearingEnergy(tearing_energy, spared)
    return CriticalStretch(critical_stretch, spared)
