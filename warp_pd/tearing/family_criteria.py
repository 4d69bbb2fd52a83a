"""Rupture criteria on means over families: stress, stretch, energy density. See docs/tearing.md.

To write your own criterion, inherit from FamilyCriterion; docs/recipes/strength_surface.py is one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..context import Context
from ..device.checks import InputError, one_of, positive
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltRupture, Law
from ..interfaces.scales import DENSITIES, Scales
from ..kernels.rupture import Criterion
from ..kernels.tearing.family_criteria import mean_energy_density, mean_of_both_ends
from ..laws.bond_associated import with_weights_of_intact_sheets
from ..laws.point_fields import GROUPS, STRESSES, ShownFields, factors, grouped
from ..parts.rupture import BondCriterion, BreakingBonds
from ..step import Phase

DENSITY = "strain_energy_density"


class FamilyCriterion(BondCriterion):
    """A criterion evaluated for each bond from means over the families of its two ends (base class).

    The means are those of the point fields of the law, over the intact bonds of a point: `stretch_1`, `stretch_2`,
    `first_piola_1`, `first_piola_2`, `cauchy_1`, `cauchy_2`, `stretch_direction`, `wrinkle_state` (docs/guide.md,
    Fields), and `strain_energy_density` [J/m^3]. They are of the step in which bonds are broken, before any breaks.
    """

    divides = False

    @property
    def reads(self) -> Mapping[str, str]:
        """The means that the criterion reads: array of its struct -> name of the field, such as "cauchy_1"."""
        raise NotImplementedError(f"{type(self).__name__}.reads: expected names of fields by names of arrays")

    def law(self, force: Law, context: Context) -> Law:
        """The law with weights that keep a uniform state uniform up to the edges, so that the means are its own."""
        return with_weights_of_intact_sheets(force)

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """Build the criterion on a device. Raises InputError if the law does not have the fields."""
        owner = type(self).__name__
        offered = [name for group in law.field_names() for name in GROUPS.get(group, ())]
        if law.earlier_energy is not None and law.represented is not None:
            offered.append(DENSITY)
        for name in self.reads.values():
            if name not in offered:
                known = ", ".join(offered) or "none"
                raise InputError(
                    f"damage = {owner}: expected a law with the field {name}, such as BondAssociated; "
                    f"{law.label} has {known}"
                )
        return BreakingByFamilies(owner, self, context, law)


@dataclass(frozen=True, eq=False)
class CriticalStress(FamilyCriterion):
    """A bond breaks permanently when the largest principal stress, the mean of both its ends, exceeds a critical value.

    Attributes:
        principal: Critical stress [Pa].
        measure: "first_piola", force over undeformed cross-section, as tensile strengths are given, or "cauchy", over
            the deformed one.
        spared: Points whose bonds never break, such as those in a clamp; None for none.

    Raises:
        InputError: if the stress is not positive or the measure is neither of the two.
    """

    principal: float
    measure: str = "first_piola"
    spared: Any = None

    def __post_init__(self) -> None:
        positive("CriticalStress.principal", self.principal)
        one_of("CriticalStress.measure", self.measure, tuple(STRESSES))

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it is far from the modulus."""
        return scales.of_stress(
            f"CriticalStress.principal of {self.principal:g} Pa", self.principal, "is it in MPa? Stresses are in Pa"
        )

    @property
    def reads(self) -> Mapping[str, str]:
        """The largest principal stress."""
        return {"values": STRESSES[self.measure][0]}

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The critical stress."""
        return limit_of_mean(context, self.principal)


@dataclass(frozen=True, eq=False)
class CriticalEnergyDensity(FamilyCriterion):
    """A bond breaks permanently when the strain energy density, the mean of both its ends, exceeds a critical value.

    Attributes:
        density: Critical energy density [J/m^3].
        spared: Points whose bonds never break, such as those in a clamp; None for none.

    Raises:
        InputError: if the density is not positive.
    """

    density: float
    spared: Any = None

    reads: ClassVar[Mapping[str, str]] = {"values": DENSITY}

    def __post_init__(self) -> None:
        positive("CriticalEnergyDensity.density", self.density)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether it is far from the modulus."""
        what, meant = f"CriticalEnergyDensity.density of {self.density:g} J/m^3", "is it in MJ/m^3? It is in J/m^3"
        return scales.of_stress(what, self.density, meant, DENSITIES)

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The critical energy density."""
        return limit_of_mean(context, self.density)


def limit_of_mean(context: Context, limit: float) -> tuple[Criterion, Any]:
    """The criterion on the mean of both ends, and its struct with the limit."""
    found = mean_of_both_ends(context.layout)
    values = found.struct()
    values.limit = limit
    return found, values


class BreakingByFamilies(BreakingBonds):
    """BreakingBonds with launches that find the means which the criterion reads."""

    def __init__(self, owner: str, rupture: FamilyCriterion, context: Context, law: BuiltLaw) -> None:
        super().__init__(owner, rupture, context, law)
        names = rupture.reads
        groups = grouped([name for name in names.values() if name != DENSITY])
        self._shown = ShownFields(context, law, groups) if groups else None
        self._density: Array | None = None
        arrays = {} if self._shown is None else dict(self._shown.arrays)
        if DENSITY in names.values():
            self._density = context.array("mean_energy_density", owner, context.types.real, shape=context.sheet.size)
            arrays[DENSITY] = self._density
        with_values(self.criterion, {array: arrays[name] for array, name in names.items()})

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; frames show the fields of their own displacement and bonds."""
        super().add(phase, stage)
        if phase is Phase.FRAME and self._shown is not None:
            self.law.add_shown(stage, self._shown)

    def add_breaking(self, stage: Stage) -> None:
        """Add the launches that find the means, and those that break bonds."""
        law, context = self.law, self.context
        if self._shown is not None:
            law.add_shown(stage, self._shown)
        if self._density is not None:
            assert law.earlier_energy is not None and law.represented is not None
            stiffness = factors(context)
            kernel = mean_energy_density(context.layout, law.earlier_energy, law.represented, stiffness is not None)
            stage.launch(
                self.owner, kernel, context.sheet.size, family=law.struct, displacement=context.state.displacement,
                constants=law.energy_constants, stiffness=stiffness, out=self._density,
            )  # fmt: skip
        super().add_breaking(stage)
