"""Nodal correspondence: a law with zero-energy modes, provided as a baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..device.checks import positive
from ..device.fields import Array
from ..families import InfluenceFunction, influence_function
from ..interfaces import BuiltLaw, Law
from ..kernels.papers.bonds import BondLaw
from ..kernels.papers.nodal import nodal
from ..laws.family_law import require_one_material, whole_sheet
from ..laws.weight_tables import point_tables
from ..materials import Material, check_material, energy_density
from .bond_law import BondForces


@dataclass(frozen=True)
class Nodal:
    """Nodal (conventional) correspondence: one deformation gradient and one stress per point (NN eqs. 2 to 5).

    A checkerboard displacement, or a displacement of the point at the centre of a family, does not change its energy h
    a_i Psi(F_i). Use the law only as a baseline. The stress of a damaged family is scaled by the intact fraction of its
    area.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon in spacings of the sheet [-].
        influence: Influence function of r = |X| / horizon, as in `BondAssociated`; the paper's is "inverse".
    """

    material: Material
    horizon: float = 3.15
    influence: str | InfluenceFunction = "inverse"

    weights: ClassVar[str] = "point"
    has_energy: ClassVar[bool] = True
    has_tangent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        influence_function(self.influence)
        check_material(self.material, "functions")

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet does not allow the horizon."""
        return NodalForce(self, context)


class PointLaw(BondForces):
    """Base class of laws with one deformation gradient per point.

    The families have no intersections. Their tables have K_i^-1 and 2 / tr K_i of the undamaged sheet instead of
    K_ij^-1 and W_ij, or, with corrected weights, one weight W_ij per bond.
    """

    def __init__(
        self, law: Law, influence: str | InfluenceFunction, context: Context, weights: str, bonds: BondLaw
    ) -> None:
        require_one_material(context.sheet, f"the law {type(law).__name__}")
        sheet = whole_sheet(law, context)
        families, inverse, found, self.correction = point_tables(sheet, law.horizon, influence, weights == "corrected")
        self.weights, self.material = weights, law.material
        super().__init__(law, context, families, inverse, found, bonds)

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of each family by the damage of its point, (N,)."""
        self.damage, self.near_damage = damage, near

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density of the material [J/m^3], in pure shear by default."""
        return energy_density(self.material, stretch, across, self.context.device)


class NodalForce(PointLaw):
    """The nodal law on one sheet and device."""

    takes_tension_field = True

    def __init__(self, law: Nodal, context: Context) -> None:
        super().__init__(law, law.influence, context, law.weights, nodal(context.layout, law.material.functions))
        self.shown_stress = law.material
