"""Tearing energy as the rupture criterion, using a damage field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np

from ..context import Context
from ..device.checks import InputError, by_point, one_of, positive
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltRupture, Law, Rupture
from ..interfaces.scales import DENSITIES, Scales, of_stretch
from ..materials import largest_energy_density
from ..parts.rupture import CriticalStretch
from .damage_ghosts import LAYERS
from .field_settings import FieldSettings


@dataclass(frozen=True, eq=False)
class TearingEnergy(FieldSettings):
    """A rupture criterion: a crack advances when the energy release rate reaches the tearing energy Gc.

    A damage field d of the points, 0 to 1 and irreversible, reduces the stiffness of the sheet; its energy per area of
    a tear is Gc (kernels/tearing/damage_field.py). `length` sets the width of the damaged zone, two lengths on each
    side of a tear. It is a property of the material or the model, not of the grid: together with the tearing energy it
    determines the strength, the energy density at which intact material is damaged, about 3 Gc / (16 length). Bonds
    break where the field is near 1.

    Attributes:
        energy: Tearing energy Gc [J/m^2], for example 1e4 for natural rubber: a number, an array of shape (N,), or a
            function of the point coordinates as for `Sheet`, for example for weak seams. If it varies, the strength
            varies with it and the length is uniform.
        length: Length of the field [m]; by default it follows from the strength, or, without a strength, is four
            spacings of the sheet and at least 1.25 horizons.
        strength: Energy density at which intact material begins to tear [J/m^3]. Given without a length, it determines
            the length; if the spacing cannot resolve that length, the default length is used and a note names the
            required spacing. Given with a length it is an independent constant, at most 3 Gc / (16 length).
        stretch_at_break: Uniaxial stretch at which intact material begins to tear [-], instead of the strength.
        spared: Points that cannot be damaged, such as those in a clamp; None for none.
        cut_profile: Whether cuts of the sheet are initially surrounded by the damage of a crack. Otherwise they are
            notches, from which a tear starts at 1.2 to 1.3 Gc.
        initial_damage: Initial damage of the points in addition to that of cuts, shape (N,), for example of a puncture.
        screened: Whether to check only points near damage or with a strongly stretched bond; checking all points in
            every step is slow and gives the same result.
        every_step: Whether to find the damage in every step and by more sweeps, instead of in every second step. Damage
            then does not lag behind cracks that run faster than half a shear wave; see docs/tearing.md. Static
            solvers refuse it.
        stiffens: Whether the energy of the material stiffens beyond the strength, as its formula says, rather than go
            on as that of a neo-Hookean sheet (kernels/tearing/continuation.py). Intact material is the same; tears of
            rubber that stiffens then take more than the tearing energy, the more the finer the spacing.

    Raises:
        InputError: if a value is not positive, both strength and stretch_at_break are given, or one of them is given
            with a varying energy.
    """

    divides: ClassVar[bool] = True
    is_field: ClassVar[bool] = True
    layers: ClassVar[int] = LAYERS

    def __post_init__(self) -> None:
        varies = callable(self.energy) or (np.iterable(self.energy) and not isinstance(self.energy, str))
        if not varies:
            positive("TearingEnergy.energy", self.energy)
        given = {name: getattr(self, name) for name in ("length", "strength", "stretch_at_break")}
        given = {name: value for name, value in given.items() if value is not None}
        for name, value in given.items():
            positive(f"TearingEnergy.{name}", value)
        if varies and given.keys() & {"strength", "stretch_at_break"}:
            raise InputError(
                f"TearingEnergy: {given} with a varying energy; expected a uniform energy, or only a length"
            )
        if "strength" in given and "stretch_at_break" in given:
            raise InputError(f"TearingEnergy: {given}; expected only one of strength and stretch_at_break")
        if self.stretch_at_break is not None and self.stretch_at_break <= 1.0:
            raise InputError(
                f"TearingEnergy.stretch_at_break = {self.stretch_at_break!r}: expected a stretch greater than 1"
            )
        one_of("TearingEnergy.cut_profile", self.cut_profile, (True, False))
        one_of("TearingEnergy.screened", self.screened, (True, False))
        one_of("TearingEnergy.every_step", self.every_step, (True, False))
        one_of("TearingEnergy.stiffens", self.stiffens, (True, False))

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether its energy, or the strength of intact material, cannot be meant."""
        energy = by_point("TearingEnergy.energy", self.energy, sheet.points)
        found = scales.of_tearing_energy("TearingEnergy.energy", float(np.min(energy)), float(np.max(energy)))
        if self.strength is not None:
            what, meant = f"TearingEnergy.strength of {self.strength:g} J/m^3", "is it in MJ/m^3? It is in J/m^3"
            found += scales.of_stress(what, self.strength, meant, DENSITIES)
        if self.stretch_at_break is not None:
            found += of_stretch("TearingEnergy.stretch_at_break", self.stretch_at_break)
        return found

    def law(self, force: Law, context: Context) -> Law:
        """The law whose material does not stiffen beyond the strength."""
        material: Any = getattr(force, "material", None)
        if self.stiffens or not hasattr(material, "functions"):
            return force

        def density(first: np.ndarray, second: np.ndarray) -> np.ndarray:
            return largest_energy_density(material, first, second, context.device)

        limit = self.constants(context, force.horizon * context.whole.spacing, density).largest_limit
        stiffness = context.whole.stiffness
        softest = 1.0 if stiffness is None else float(stiffness.min())
        law: Any = force
        from .continuation import continued

        return cast(Law, replace(law, material=continued(material, limit / softest, context.device)))

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """Build the field on a device."""
        from .damage_field import DamageField

        return DamageField(self, context, law)


def stretch_or_energy(
    critical_stretch: float | None, tearing_energy: float, length: float | None = None, spared: Any = None
) -> Rupture:
    """The criterion of a scene: a critical stretch [-] if given, otherwise a tearing energy [J/m^2]."""
    if critical_stretch is not None:
        return CriticalStretch(critical_stretch, spared)
    return TearingEnergy(tearing_energy, length, spared=spared)


def horizon_for_tears(horizon: float | None, critical_stretch: float | None) -> float:
    """Horizon of a scene in spacings: as given, otherwise 2.015, or 3.15 with a critical stretch.

    With a critical stretch cracks follow the grid at smaller horizons.
    """
    if horizon is not None:
        return positive("horizon", horizon)
    return 2.015 if critical_stretch is None else 3.15


def length_for_tears(length: float | None, default: float, horizon: float, sheet: Sheet) -> float:
    """Length of the damage field of a scene [m]: as given, otherwise the larger of the default and the horizon."""
    return max(default, horizon * sheet.spacing) if length is None else length


def notes_on_criterion(critical_stretch: float | None) -> list[str]:
    """Note of a scene if a critical stretch replaces the tearing energy."""
    if critical_stretch is None:
        return []
    return [f"bonds break at a stretch of {critical_stretch:g}; tearing energy and damage length are not used"]
