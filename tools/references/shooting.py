"""Circular membrane clamped at its rim under a pressure that follows its surface: exact but for an integration.

A disc of radius R and thickness h, at rest in its plane, incompressible. A point at the radius r moves to the radius
rho and the height z. With the stretches l1 = |d(rho, z)/dr| and l2 = rho/r, the energy W(l1, l2) per volume, the
nominal tensions N1 = h dW/dl1 and N2 = h dW/dl2, and the angle a of the meridian below the plane, equilibrium is

    d(r N1)/dr = N2 cos a     along the meridian,
    N1 da/dr + N2 sin a / r = p l1 l2     across the surface,
    d rho/dr = l1 cos a,  dz/dr = -l1 sin a.

Lengths are in units of mu h / p, so that the pressure drops out: integration starts at the centre with its stretch and
ends where rho = r, which is the rim. Its radius is the pressure p R / (mu h). There is nothing to shoot at, and the
maximum of pressure is no obstacle. The method is that of Hart-Smith and Crisp (1967), the equations are those of Adkins
and Rivlin (1952).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

Array = npt.NDArray[np.float64]
# Radius at which the integration starts, over about that of the rim. What it leaves out is of second order in it.
START = 1e-6


@dataclass(frozen=True)
class Material:
    """W(l1, l2) = c1 f(I1 - 3) + c2 (I2 - 3) of an incompressible sheet with the shear modulus 1.

    Attributes:
        share: c2 over c1 + c2: 0 is neo-Hookean, above it Mooney-Rivlin.
        limit: Largest I1 - 3 of a Gent material, where f = -limit log(1 - (I1 - 3)/limit).
        cubic: c30 / c10 of a Yeoh material, where f = (I1 - 3) + cubic (I1 - 3)^3.
    """

    share: float = 0.0
    limit: float = np.inf
    cubic: float = 0.0

    def energy(self, l1: Array, l2: Array) -> Array:
        """Per volume, over the shear modulus."""
        i1, i2 = l1**2 + l2**2 + (l1 * l2) ** -2 - 3.0, l1**-2 + l2**-2 + (l1 * l2) ** 2 - 3.0
        first = i1 + self.cubic * i1**3 if np.isinf(self.limit) else -self.limit * np.log1p(-i1 / self.limit)
        return 0.5 * ((1.0 - self.share) * first + self.share * i2)

    def tensions(self, l1: float, l2: float) -> tuple[float, float, float, float]:
        """dW/dl1, dW/dl2, d2W/dl1^2 and d2W/dl1dl2."""
        a, b = 0.5 * (1.0 - self.share), 0.5 * self.share
        # Derivatives of I1 and I2.
        p1, p2 = 2.0 * l1 - 2.0 / (l1**3 * l2**2), 2.0 * l2 - 2.0 / (l2**3 * l1**2)
        p11, p12 = 2.0 + 6.0 / (l1**4 * l2**2), 4.0 / (l1 * l2) ** 3
        q1, q2 = 2.0 * l1 * l2**2 - 2.0 / l1**3, 2.0 * l2 * l1**2 - 2.0 / l2**3
        q11, q12 = 2.0 * l2**2 + 6.0 / l1**4, 4.0 * l1 * l2
        i1 = l1**2 + l2**2 + (l1 * l2) ** -2 - 3.0
        if np.isinf(self.limit):
            slope, curve = 1.0 + 3.0 * self.cubic * i1**2, 6.0 * self.cubic * i1
        else:
            left = 1.0 - i1 / self.limit
            slope, curve = 1.0 / left, 1.0 / (self.limit * left**2)
        return (
            a * slope * p1 + b * q1,
            a * slope * p2 + b * q2,
            a * (slope * p11 + curve * p1 * p1) + b * q11,
            a * (slope * p12 + curve * p1 * p2) + b * q12,
        )


NEO_HOOKEAN = Material()


@dataclass(frozen=True)
class Disc:
    """An inflated disc. Lengths are in units of its radius at rest.

    Attributes:
        pressure: p R / (mu h).
        stretch: Of the centre.
        deflection: Of the centre.
        volume: Below the surface, over R^3.
        energy: Stored, over mu h R^2.
        profile: Radius at rest -> radius and height, (n,) -> (2, n).
    """

    pressure: float
    stretch: float
    deflection: float
    volume: float
    energy: float
    profile: Callable[[Array], Array]


def at_stretch(stretch: float, material: Material = NEO_HOOKEAN, tolerance: float = 1e-11) -> Disc:
    """The disc whose centre has a stretch, on either side of the maximum of pressure.

    Args:
        stretch: Of the centre, above 1.
        material: Its material.
        tolerance: Relative tolerance of the integration.

    Raises:
        ValueError: for a stretch of 1 or less, or one that the material does not reach.
    """
    if stretch <= 1.0:
        raise ValueError(f"stretch = {stretch!r}: expected a stretch above 1")

    def change(r: float, state: Array) -> list[float]:
        l1, rho, angle = state[:3]
        l2 = rho / r
        n1, n2, n11, n12 = material.tensions(l1, l2)
        cos, sin = np.cos(angle), np.sin(angle)
        bend = (l1 * l2 - n2 * sin / r) / n1
        steeper = ((n2 * cos - n1) - n12 * (l1 * cos - l2)) / (r * n11)
        energy = 2.0 * np.pi * r * float(material.energy(l1, l2))
        return [steeper, l1 * cos, bend, -l1 * sin, np.pi * rho**2 * l1 * sin, energy]

    def rim(r: float, state: Array) -> float:
        return float(state[1] / r - 1.0)

    rim.terminal, rim.direction = True, -1.0  # type: ignore[attr-defined]
    n1, *_ = material.tensions(stretch, stretch)
    if not np.isfinite(n1) or n1 <= 0.0:
        raise ValueError(f"stretch = {stretch!r}: the material does not reach it")
    # Flat discs have a small radius: the pressure grows as the strain to the power 3/2.
    first = START * min(1.0, (stretch - 1.0) ** 1.5)
    # Near the centre the disc is a sphere: the angle grows by l^2 p / (2 N).
    start = [stretch, stretch * first, 0.5 * stretch**2 * first / n1, 0.0, 0.0, 0.0]
    found = solve_ivp(
        change, (first, 1e3), start, method="DOP853", rtol=tolerance, atol=1e-3 * tolerance, events=rim,
        dense_output=True,
    )  # fmt: skip
    if not found.t_events[0].size:
        raise ValueError(f"stretch = {stretch!r}: no rim found, {found.message}")
    radius, end = float(found.t_events[0][0]), found.y_events[0][0]

    def profile(r: Array) -> Array:
        at = np.asarray(r, float) * radius
        inside = found.sol(np.maximum(at, first))
        return np.stack([np.where(at < first, stretch * at, inside[1]), inside[3] - end[3]]) / radius

    deflection, volume, energy = (float(x) for x in end[3:6] / radius ** np.array([1.0, 3.0, 2.0]))
    return Disc(radius, stretch, -deflection, volume, energy, profile)


def maximum(material: Material = NEO_HOOKEAN, bracket: tuple[float, float] = (1.2, 4.0)) -> Disc:
    """The disc at the first maximum of pressure, by the stretch of its centre within a bracket.

    Raises:
        ValueError: if the pressure has no maximum inside the bracket.
    """
    found = minimize_scalar(lambda s: -at_stretch(s, material).pressure, bounds=bracket, method="bounded",
                            options={"xatol": 1e-6})  # fmt: skip
    if min(found.x - bracket[0], bracket[1] - found.x) < 1e-3:
        raise ValueError(f"bracket = {bracket!r}: no maximum of pressure inside")
    return at_stretch(float(found.x), material)


def inflated_disc(
    pressure: float, material: Material = NEO_HOOKEAN, bracket: tuple[float, float] = (1.0 + 1e-7, 1.6)
) -> Disc:
    """The disc under a pressure p R / (mu h), on the branch within a bracket of the stretch of its centre.

    Raises:
        ValueError: if the pressure is not reached exactly once inside the bracket.
    """
    found = brentq(lambda s: at_stretch(s, material).pressure - pressure, *bracket, xtol=1e-13, rtol=1e-13)
    return at_stretch(float(found), material)
