"""The visco-hyperelastic bond law as published (VE)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, build_families
from ..interfaces import BuiltLaw
from ..interfaces.scales import Scales
from ..kernels.papers.visco_bonds import visco_bonds
from ..laws.family_law import require_one_material, whole_sheet
from ..materials import Yeoh
from ..step import Phase
from ..visco.law import Prony, at_once, prony_array, store_terms
from .bond_law import BondForces


@dataclass(frozen=True)
class ViscoBondBased:
    """The published visco-hyperelastic bond law of Yeoh sheets (VE eqs. 46 to 75).

    The two-dimensional energy c10 (I1 - 2) + c20 (I1 - 2)^2 has no pressure term: an undeformed sheet is under tension,
    4 c10 w |X| / m per bond, and free edges contract. I1 is that of the point's family (eq. 41); the paper uses the
    stretch of the whole sheet, which does not allow holes or cracks. m (eq. 39) is the sum over the family; the paper
    uses the integral pi h horizon^4. Without Prony terms the forces have an energy; with them they do not.

    Attributes:
        material: Yeoh with c10 and c20.
        horizon: Horizon in spacings of the sheet [-].
        prony: Relaxing terms (keyword only).
    """

    material: Yeoh
    horizon: float = 3.015
    prony: Sequence[Prony] = field(default=(), kw_only=True)

    weights: ClassVar[str] = "pairwise"
    has_tangent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        store_terms(self, "prony", Prony)
        if not isinstance(self.material, Yeoh) or self.material.c30 != 0.0:
            raise InputError(f"material = {self.material!r}: expected Yeoh with c30 = 0")

    @property
    def has_energy(self) -> bool:
        """Whether its forces have an energy."""
        return not self.prony

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet does not allow the horizon."""
        return ViscoBondBasedForce(self, context)


class ViscoBondBasedForce(BondForces):
    """The law on one sheet and device."""

    weights = "pairwise"

    def __init__(self, law: ViscoBondBased, context: Context) -> None:
        require_one_material(context.sheet, "the law ViscoBondBased")
        self.law, self.depends_on_time = law, bool(law.prony)
        families = build_families(whole_sheet(law, context), law.horizon, "inverse_square", intersections=False)
        bonds, Constants = visco_bonds(context.layout, bool(law.prony))
        super().__init__(law, context, families, None, _bond_weights(families), bonds)
        self.bond_constants = Constants()
        self.bond_constants.yeoh = self.constants
        if law.prony:
            self.bond_constants.prony = prony_array(law.prony, context)
            rows = len(law.prony) * families.members
            for name, count in (("strain", families.members), ("viscous_stretch", rows)):
                array = context.array(
                    name, self.owner, context.types.real, shape=(count, self.points), per="bond", restart=True
                )
                setattr(self.bond_constants, name, array)

    def doubts(self, scales: Scales) -> Sequence[str]:
        """Those of its terms."""
        return [doubt for term in self.law.prony for doubt in term.doubts(scales)]

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at the start the one that applies the initial displacement instantaneously."""
        super().add(phase, stage)
        if self.bonds.update is None:
            return
        if phase is Phase.INTERNAL_VARIABLES:
            self._add_update(stage, self.context.state.step, self.bond_constants.prony)
        elif phase is Phase.START and self.context.initial_displacement.any():
            self._add_update(stage, *at_once(self.law.prony, self.context))

    def _add_update(self, stage: Stage, step: Array | None, prony: Array) -> None:
        """Add the launch that advances the internal variables to the end of a step [s], a single real number."""
        assert step is not None and self.bonds.update is not None
        stage.launch(
            self.owner, self.bonds.update, self.points, family=self.struct,
            displacement=self.context.state.displacement, step=step, prony=prony,
            strain=self.bond_constants.strain, viscous_stretch=self.bond_constants.viscous_stretch,
        )  # fmt: skip


def _bond_weights(families: Families) -> np.ndarray:
    """4 w a_i a_k / sum_k w |xi|^2 a_k by row, areas divided by the reference area, shape (R, n)."""
    squared = np.where(families.exists, (families.bonds**2).sum(axis=-1), 0.0)
    c = families.member_coefficients
    return np.asarray(4.0 * families.areas[:, None] * c / (c * squared).sum(axis=1, keepdims=True))
