"""The bond-based law of hyperelastic sheets with constants for each loading mode, and its material.

The force of a bond depends only on its own stretch, so the law holds for one loading mode: stretch l along x, and along
y

    equibiaxial  l,      planar  1,      uniaxial  that of traction-free edges; 1/sqrt(l) in the exact solution.

The law of a bond is t(s) = a s - b/s^2 - c/s^3 - d/s^5, times the squared cosine of its rotation (kernels/papers/
hyperelastic_bonds.py). Source: HE, chapter 3; eqs. 35, 58 and 77 are its constants divided by c0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..context import Context
from ..device.checks import InputError, one_of, positive
from ..families import Families, build_families
from ..interfaces import BuiltLaw
from ..kernels.papers.hyperelastic_bonds import hyperelastic_bonds
from ..laws.family_law import whole_sheet
from .bond_law import BondForces

Coefficients = tuple[float, float, float, float]

# (a, b, c, d) of t. HE write A s - 2 B/s^5 (equibiaxial), A s - B/s^3 (planar), A s - (B/2)/s^2 - 2 D/s^5 (uniaxial).
PUBLISHED: dict[str, Coefficients] = {
    "equibiaxial": (1.0, 0.0, 0.0, 2.0 * 0.5),
    "planar": (31 / 25, 0.0, 89 / 81, 0.0),
    "uniaxial": (64 / 49, 0.5 * 3 / 4, 0.0, 2.0 * 8 / 17),
}
# No force at stretch 1, a = b + c + d, and least squares of the relative error of the traction along x at 30 stretches
# up to 4. No coefficients also give a uniaxial sheet its exact width (docs/papers/he.md).
REFITTED: dict[str, Coefficients] = {
    "equibiaxial": (1.0, 0.0, 0.0, 1.0),
    "planar": (1.1650912, 1.6381354, -1.7093861, 1.2363419),
    "uniaxial": (1.2130514, 2.1773523, -1.9459207, 0.9816198),
}
# The exact traction divided by mu is l - l^-k.
EXPONENT = {"equibiaxial": 5, "planar": 3, "uniaxial": 2}
MODES, FITS = tuple(PUBLISHED), ("published", "refitted")
ANGLES = (np.arange(180) + 0.5) * np.pi / 90
# Stretch at which the surface correction compares energies (HE, chapter 5).
CALIBRATION = 4.0


@dataclass(frozen=True)
class BondNeoHookean:
    """Incompressible neo-Hookean material of bonds, made for one loading mode (HE, chapter 3).

    Attributes:
        mu: Shear modulus [Pa]; E/3.
        mode: "equibiaxial", "planar" or "uniaxial".
        fit: The set of constants:
            "published": as in the paper's final force densities (HE eqs. 44, 64, 82), the constants of tension for
                every bond. At stretch 1, t = 0.141 mu (planar), -0.010 mu (uniaxial) or zero (equibiaxial).
                (The paper's constants of uniaxial compression, eq. 77b, have t(1) = -0.873 mu: with both sets the force
                would jump.)
            "refitted": zero force at stretch 1 and the traction closest to the exact one.

    Raises:
        InputError: if the modulus is not positive, or the mode or fit is unknown.
    """

    mu: float
    mode: str = "equibiaxial"
    fit: str = "published"

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        one_of("mode", self.mode, MODES)
        one_of("fit", self.fit, FITS)

    @property
    def shear_modulus(self) -> float:
        """Mu [Pa]."""
        return self.mu

    @property
    def coefficients(self) -> Coefficients:
        """(a, b, c, d), divided by mu."""
        return REFITTED[self.mode] if self.fit == "refitted" else PUBLISHED[self.mode]

    @property
    def constants(self) -> Coefficients:
        """t(1), b, c, d [Pa]."""
        a, b, c, d = self.coefficients
        rest = a - b - c - d
        return (self.mu * (0.0 if abs(rest) < 1e-12 else rest), self.mu * b, self.mu * c, self.mu * d)


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


class HyperelasticBondsForce(BondForces):
    """The law on one sheet and device; its constants hold the surface correction of each point along x and y."""

    weights = "pairwise"

    def __init__(self, law: HyperelasticBonds, context: Context) -> None:
        sheet, self.law = whole_sheet(law, context), law
        if sheet.lattice is not None and sheet.lattice.rows == 1:
            raise InputError("sheet: expected at least two rows of points with the law HyperelasticBonds, got one")
        families = build_families(sheet, law.horizon, "inverse", intersections=False)
        bonds, Constants = hyperelastic_bonds(context.layout)
        super().__init__(law, context, families, None, families.scaled(_bond_weights(families)), bonds)
        self.least_modulus = law.material.mu
        values = families.rows_of_points(surface_factors(families, law.material))
        self.bond_constants = Constants()
        self.bond_constants.tension = self.constants
        self.bond_constants.factors = context.array("surface_factors", self.owner, context.types.vec2, values)


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


def terms(s: np.ndarray) -> np.ndarray:
    """Factors of a, b, c, d in t(s), shape (4, ...)."""
    return np.stack([s, -(s**-2), -(s**-3), -(s**-5)])


def bond_energy(p: Coefficients, s: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Energy of bonds divided by c0 and influence (HE eqs. 28, 51, 70), zero without stretch."""
    a, b, c, d = p

    def stored(s: np.ndarray | float) -> np.ndarray | float:
        return a * s**2 + 2.0 * b / s + c / s**2 + 0.5 * d / s**4

    return stored(s) * cosine**2 - stored(1.0)


def deformed(directions: np.ndarray, along_x: float, along_y: float) -> tuple[np.ndarray, np.ndarray]:
    """Stretch of bonds with unit vectors `directions`, shape (..., 2), and cosine of the angle by which they rotate."""
    y = directions * (along_x, along_y)
    s = np.linalg.norm(y, axis=-1)
    return s, (y * directions).sum(axis=-1) / s


def bond_traction(p: Coefficients, directions: np.ndarray, along_x: float, along_y: float) -> np.ndarray:
    """Contribution of bonds to the first Piola stress along x and y, divided by mu and their weight, shape (..., 2)."""
    s, cosine = deformed(directions, along_x, along_y)
    pull = np.tensordot(p, terms(s), 1) * cosine**2 / s
    return np.asarray(2.0 * directions**2 * (along_x, along_y) * pull[..., None])


def round_family() -> np.ndarray:
    """Unit vectors of the bonds of a complete round family in the limit of many bonds, shape (n, 2)."""
    return np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


def tractions(p: Coefficients, along_x: float, along_y: float) -> np.ndarray:
    """First Piola stresses along x and y over mu, at homogeneous stretches along them, for many bonds; shape (2,)."""
    return np.asarray(bond_traction(p, round_family(), along_x, along_y).mean(axis=0))


def exact_traction(mode: str, stretch: float) -> float:
    """First Piola stress along x divided by mu of the exact incompressible neo-Hookean sheet."""
    return stretch - stretch ** -EXPONENT[mode]
