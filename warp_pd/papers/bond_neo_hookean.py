"""Neo-Hookean material of bonds for one loading mode, and the response of its sheet to uniform stretch.

The force of a bond depends only on its own stretch, so the law holds for one loading mode: stretch l along x, and along
y

    equibiaxial  l,      planar  1,      uniaxial  that of traction-free edges; 1/sqrt(l) in the exact solution.

The law of a bond is t(s) = a s - b/s^2 - c/s^3 - d/s^5, times the squared cosine of its rotation (kernels/
hyperelastic_bonds.py). Source: HE, chapter 3; eqs. 35, 58 and 77 are its constants divided by c0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.checks import one_of, positive

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
    def coefficients(self) -> Coefficients:
        """(a, b, c, d), divided by mu."""
        return REFITTED[self.mode] if self.fit == "refitted" else PUBLISHED[self.mode]

    @property
    def constants(self) -> Coefficients:
        """t(1), b, c, d [Pa]."""
        a, b, c, d = self.coefficients
        rest = a - b - c - d
        return (self.mu * (0.0 if abs(rest) < 1e-12 else rest), self.mu * b, self.mu * c, self.mu * d)


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
