"""The visco-hyperelastic bond law as published (VE)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, build_families
from ..interfaces import BuiltLaw
from ..kernels.papers.visco_bonds import visco_bonds
from ..laws.family_law import FamilyLaw, require_one_material, whole_sheet
from ..materials import Yeoh
from ..step import Phase
from ..visco.prony import at_once, prony_array, store_terms
from ..visco.viscous import Prony


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


class ViscoBondBasedForce(FamilyLaw):
    """The law on one sheet and device.

    Attributes:
        internal: Internal variables by name.
    """

    weights = "pairwise"

    def __init__(self, law: ViscoBondBased, context: Context) -> None:
        self.law, self.has_energy, self.depends_on_time = law, law.has_energy, bool(law.prony)
        self.has_own_density = law.has_energy
        require_one_material(context.sheet, "the law ViscoBondBased")
        families = build_families(whole_sheet(law, context), law.horizon, "inverse_square", intersections=False)
        super().__init__(law, context, families, None, _bond_weights(families))
        self.kernels = visco_bonds(context.layout, bool(law.prony))
        self.earlier_energy = self.kernels.earlier_energy
        self.prony: Array | None = None
        self.internal: dict[str, Any] = {}
        if law.prony:
            self.prony = prony_array(law.prony, context)
            rows = len(law.prony) * families.members
            for name, count in (("strain", families.members), ("viscous_stretch", rows)):
                self.internal[name] = context.array(
                    name, self.owner, context.types.real, shape=(count, self.points), per="bond", restart=True
                )

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at the start the one that applies the initial displacement instantaneously."""
        super().add(phase, stage)
        if self.prony is None:
            if phase is Phase.FRAME:
                self.add_launch(stage, self.kernels.density, self.context.state.displacement, out=self.own_density)
            return
        state = self.context.state
        if phase is Phase.INTERNAL_VARIABLES:
            assert state.step is not None
            self._add_update(stage, state.displacement, state.step, self.prony)
        elif phase is Phase.START and self.context.initial_displacement.any():
            self._add_update(stage, state.displacement, *at_once(self.law.prony, self.context))

    def _add_update(self, stage: Stage, displacement: Array, step: Array, prony: Array) -> None:
        """Add the launch that advances the internal variables to the end of a step [s], a single real number."""
        stage.launch(
            self.owner, self.kernels.update, self.points, family=self.struct, displacement=displacement, step=step,
            prony=prony, **self.internal,
        )  # fmt: skip

    def bond_force(self) -> Array:
        """Force of each family on its bonds [N], (members, N) vec3."""
        return self.pairs

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        self.add_launch(
            stage, self.kernels.half_forces, displacement, unit_force=self.unit_force, prony=self.prony,
            strain=self.internal.get("strain"), viscous_stretch=self.internal.get("viscous_stretch"),
            bond_force=self.pairs,
        )  # fmt: skip
        self.add_gather(stage, self.pairs, out)


def _bond_weights(families: Families) -> np.ndarray:
    """4 w a_i a_k / sum_k w |xi|^2 a_k by row, areas divided by the reference area, shape (R, n)."""
    squared = np.where(families.exists, (families.bonds**2).sum(axis=-1), 0.0)
    c = families.member_coefficients
    return np.asarray(4.0 * families.areas[:, None] * c / (c * squared).sum(axis=1, keepdims=True))
