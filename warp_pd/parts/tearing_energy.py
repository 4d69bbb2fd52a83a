"""A tearing energy as the criterion of rupture: the critical stretch that stands for it on a sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..device.checks import InputError, point_indices, positive
from ..device.launches import Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltRupture, History, Rupture
from ..interfaces.context import Context
from ..kernels.rupture import Criterion, elongation
from ..kernels.softening import softening
from ..materials import borne, stretch_of_density
from .rupture import BondCriterion, BreakingBonds, CriticalStretch, Damaged

# Width kappa of a crack tip in spacings, see docs/tearing.md: of bonds that break at once, and of bonds that lose their
# weight gradually, by the horizon in spacings.
TIP_WIDTH = 2.07
GRADUAL_HORIZONS, GRADUAL_WIDTHS = (2.015, 3.15, 4.15), (1.32, 1.20, 1.40)
# A bond loses its weight while its elongation is between these shares of the critical one.
BEGIN, END = 0.4, 1.6
# How much the spacing may vary where bonds may break.
EVEN = 0.1
# Range of the critical stretch: below it round-off and roughness break bonds, above it no rubber is known.
MIN_STRETCH, MAX_STRETCH = 1.05, 30.0


@dataclass(frozen=True, eq=False)
class TearingEnergy(BondCriterion):
    """A crack advances when the energy release rate reaches the tearing energy of the material, Gc.

    By Thomas's relation (1955), the tearing energy is the width of the tip times the work per volume to break the
    material there,

        Gc = kappa dx W(s_c),

    with the energy density W of pure shear, the spacing dx, and the width kappa of a tip in spacings, as measured in
    docs/tearing.md. A bond loses its weight gradually, and for good, while its elongation grows from 0.4 to 1.6 times
    that of the critical stretch s_c: see kernels/softening.py. The elongation of a bond shorter than the spacing, as
    irregular clouds have, counts over the spacing: otherwise the roughness of the displacement would break it.

    In static solvers, and with a law whose bonds cannot lose their weight gradually, bonds break at once at s_c, for
    which kappa is another. The summary states the stretches.

    Attributes:
        energy: Tearing energy Gc [J/m^2], such as 1e4 for natural rubber.
        spared: Points whose bonds never break, such as those in a clamp; None if all bonds may break.

    Raises:
        InputError: for an energy that is not positive.
    """

    energy: float
    spared: Any = None

    gradual: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("TearingEnergy.energy", self.energy)

    def on_partition(self, sheet: Sheet, partition: Partition) -> Rupture:
        """The same criterion for the points that are here.

        Raises:
            InputError: on a graded sheet, of which it asks the spacing where bonds may break.
        """
        if sheet.spacings is not None:
            raise InputError("damage = TearingEnergy: expected a sheet of one spacing with several processes")
        return super().on_partition(sheet, partition)

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The critical stretch, for bonds that break at once.

        Raises:
            InputError: for a law without an energy density, or a spacing that cannot resolve the tearing energy.
        """
        return _elongation(context, self.critical_stretch(context, law), self.spared)

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """The criterion on a device."""
        if context.features.gradual:
            return SofteningBonds(self, context, law)
        return TearingBonds(self, context, law)

    def critical_stretch(self, context: Context, law: BuiltLaw) -> float:
        """Critical stretch s_c that stands for the tearing energy on a sheet.

        Raises:
            InputError: if there is none in the range that the spacing resolves.
        """
        spacing = tearing_spacing(context.sheet, self.spared)
        width = tip_width(law.horizon_ratio, context.features.gradual) * spacing
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
    """Bonds that break at once by a tearing energy."""

    criterion: Any

    def __init__(self, rupture: TearingEnergy, context: Context, law: BuiltLaw) -> None:
        super().__init__("TearingEnergy", rupture, context, law)
        self._spacing = tearing_spacing(context.sheet, rupture.spared)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """The critical stretch that was used."""
        return [_stands_for(self.criterion.stretch, self._spacing)]


class SofteningBonds(Damaged):
    """Bonds that lose their weight gradually by a tearing energy.

    Attributes:
        critical: The critical stretch that stands for it.
        beginning: Struct of the stretch at which a bond begins to lose its weight.
        end: Stretch at which it has lost it.
    """

    def __init__(self, rupture: TearingEnergy, context: Context, law: BuiltLaw) -> None:
        super().__init__("TearingEnergy", rupture, context, law)
        self.critical = rupture.critical_stretch(context, law)
        begin, self.end = (1.0 + fraction * (self.critical - 1.0) for fraction in (BEGIN, END))
        _, self.beginning = _elongation(context, begin, rupture.spared)
        self._spacing = tearing_spacing(context.sheet, rupture.spared)
        self._kernel = softening(context.layout, self.spared is not None, self.tracked_energy)

    def add_breaking(self, stage: Stage) -> None:
        """Add the launch that takes weight from bonds."""
        stage.launch(
            self.owner, self._kernel, self.context.sheet.size, **self.arguments(), begin_at=self.beginning,
            none_above=self.end, shares=self.law.struct.shares,
        )  # fmt: skip

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """The stretches that were used."""
        said = _stands_for(self.critical, self._spacing)
        return [f"{said}: bonds lose their weight between {self.beginning.stretch:.4g} and {self.end:.4g}"]


def _elongation(context: Context, stretch: float, spared: Any) -> tuple[Criterion, Any]:
    """The criterion of elongation, and its struct filled in."""
    found = elongation(context.layout)
    values = found.struct()
    values.stretch, values.spacing = stretch, tearing_spacing(context.sheet, spared)
    return found, values


def _stands_for(stretch: float, spacing: float) -> str:
    """What a tearing energy is on this sheet."""
    return f"the tearing energy stands for a critical stretch of {stretch:.4g} at a spacing of {spacing:.4g} m"


def tearing_spacing(sheet: Sheet, spared: Any) -> float:
    """Spacing [m] where bonds may break.

    Args:
        sheet: The sheet.
        spared: Points whose bonds never break, or None.

    Raises:
        InputError: on a graded sheet, if it varies there by more than `EVEN`.
    """
    if sheet.spacings is None:
        return sheet.spacing
    breakable = np.ones(sheet.size, bool)
    if spared is not None:
        breakable[point_indices("TearingEnergy.spared", spared, sheet.size)] = False
    there = sheet.spacings[breakable]
    if len(there) == 0:
        return sheet.spacing
    low, high = float(there.min()), float(there.max())
    if high > (1.0 + EVEN) * low:
        raise InputError(
            f"TearingEnergy on a graded sheet, with spacings from {low:.3g} to {high:.3g} m where bonds may break: "
            f"expected one within {EVEN:.0%}; spare the other points, as with spared=sheet.where(...)"
        )
    return float(np.sqrt(low * high))


def tip_width(horizon: float, gradual: bool) -> float:
    """Width kappa of a crack tip in spacings; in proportion to wider horizons than those it was measured at.

    Args:
        horizon: In spacings.
        gradual: Whether bonds lose their weight gradually.
    """
    if not gradual:
        return TIP_WIDTH
    wider = max(horizon / GRADUAL_HORIZONS[-1], 1.0)
    return wider * float(np.interp(horizon, GRADUAL_HORIZONS, GRADUAL_WIDTHS))


def stretch_or_energy(critical_stretch: float, tearing_energy: float | None, spared: Any = None) -> BondCriterion:
    """The criterion of a scene: a tearing energy [J/m^2] if one is given, a critical stretch [-] otherwise."""
    if tearing_energy is not None:
        return TearingEnergy(tearing_energy, spared)
    return CriticalStretch(critical_stretch, spared)
