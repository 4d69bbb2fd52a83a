"""The bond-based law of hyperelastic sheets, with constants for each loading mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, build_families
from ..interfaces import BuiltLaw
from ..kernels.papers.hyperelastic_bonds import hyperelastic_bonds
from ..laws.family_law import FamilyLaw, whole_sheet
from ..statics.fictitious_mass import add_row_sums, fictitious_mass
from .bond_neo_hookean import BondNeoHookean, bond_energy, bond_traction, deformed, round_family

# Stretch at which the surface correction compares energies (HE, chapter 5).
CALIBRATION = 4.0


@dataclass(frozen=True)
class HyperelasticBonds:
    """Bond-based peridynamics of an incompressible neo-Hookean sheet under one known loading mode (HE).

    Bond forces are pairwise and act along the bonds, so momentum and angular momentum are conserved. But the force has
    a factor L^2, the squared cosine of the rotation angle of a bond, which the paper does not differentiate when it
    derives the force from the energy. The law therefore

    - has no potential: no strain energy and no energy balance are reported;
    - is not objective: if a stretched sheet rotates as a whole, its forces are multiplied by the squared cosine of the
      angle. Use it only for sheets that stretch without rotating.

    The surface correction scales the energy of every point to that of a complete round family at stretch 4 (HE eqs. 40,
    63, 81, and 43; eqs. 61 to 63 print a factor 2 that eqs. 46 and 51 do not have). It matters in the interior, too:
    without it the energy of a lattice with horizon 3.015 is 20 % too small. In the published planar mode the correction
    acts only along x (below eq. 63). Refitted constants are fitted to tractions, so with them the correction compares
    tractions along x and y; in uniaxial sheets with horizon 9.015 this reduces the error from 8 to 1 %.

    An undeformed sheet has only in-plane stiffness. In plane problems, hold all out-of-plane displacements:
    `Fixed(range(sheet.size), "z")`.

    Attributes:
        material: Material for one loading mode, see `BondNeoHookean`.
        horizon: Horizon in spacings of the sheet [-], at least 1; the paper uses 3.015, and 9.015 for uniaxial loading.
    """

    material: BondNeoHookean
    horizon: float = 3.015

    weights: ClassVar[str] = "pairwise"
    has_energy: ClassVar[bool] = False
    has_tangent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        if not isinstance(self.material, BondNeoHookean):
            raise InputError(f"material = {self.material!r}: expected BondNeoHookean with the law HyperelasticBonds")

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet does not allow the horizon, or has only one row of points."""
        return HyperelasticBondsForce(self, context)


class HyperelasticBondsForce(FamilyLaw):
    """The law on one sheet and device.

    Attributes:
        bond_constants: Constants of bonds, and the surface correction of each point along x and y, (N,) vec2.
    """

    weights = "pairwise"
    has_energy = False

    def __init__(self, law: HyperelasticBonds, context: Context) -> None:
        sheet, self.law = whole_sheet(law, context), law
        if sheet.lattice is not None and sheet.lattice.rows == 1:
            raise InputError("sheet: expected at least two rows of points with the law HyperelasticBonds, got one")
        families = build_families(sheet, law.horizon, "inverse", intersections=False)
        weights = families.scaled(_bond_weights(families))
        super().__init__(law, context, families, None, weights)
        self.kernels = hyperelastic_bonds(context.layout)
        self.bond_constants = self.kernels.constants()
        self.bond_constants.tension = self.constants
        values = families.rows_of_points(surface_factors(families, law.material))
        self.bond_constants.factors = context.array("surface_factors", self.owner, context.types.vec2, values)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        self.add_launch(
            stage, self.kernels.pair_force, displacement, constants=self.bond_constants, unit_force=self.unit_force,
            force=out,
        )  # fmt: skip


def _bond_weights(families: Families) -> np.ndarray:
    """W_ik = (2/pi) (a_ref / delta^2) a_i a_k by row, areas divided by the reference area, shape (R, n)."""
    unit = 2.0 / np.pi * families.reference_area / families.horizon**2
    return unit * families.areas[:, None] * np.where(families.exists, families.member_areas, 0.0)


def surface_factors(families: Families, material: BondNeoHookean) -> np.ndarray:
    """Surface correction along x and y by row, shape (R, 2): ratio of a complete round family to that of the row.

    The ratio compares energies for published constants (which agree with the continuum to 1e-3, HE eqs. 35, 58 and 77)
    and tractions along the stretch for refitted ones. The stretch is 4, along x and then along y, in the material's
    loading mode.
    """
    p, published = material.coefficients, material.fit != "refitted"
    across = {"equibiaxial": CALIBRATION, "planar": 1.0, "uniaxial": CALIBRATION**-0.5}[material.mode]
    length = np.where(families.exists, np.linalg.norm(families.bonds, axis=-1), 1.0)
    directions = np.where(families.exists[..., None], families.bonds / length[..., None], (1.0, 0.0))
    weight = np.where(families.exists, families.member_areas / length, 0.0)
    weight *= families.reference_area / (2.0 * np.pi * families.horizon**2)

    def measured(n: np.ndarray, c: int) -> np.ndarray:
        stretches = (CALIBRATION, across) if c == 0 else (across, CALIBRATION)
        return bond_energy(p, *deformed(n, *stretches)) if published else bond_traction(p, n, *stretches)[..., c]

    factors = np.ones((len(families.exists), 2))
    for c in range(1 if material.mode == "planar" and published else 2):
        factors[:, c] = measured(round_family(), c).mean() / (weight * measured(directions, c)).sum(axis=1)
    return factors


@fictitious_mass.register(HyperelasticBondsForce)
def _(law: HyperelasticBondsForce, stage: Stage) -> Array:
    least = 1e-3 * law.law.material.mu * law.thickness
    return add_row_sums(law, stage, law.kernels.row_sums, least, constants=law.bond_constants)
