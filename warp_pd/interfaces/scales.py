"""Sizes of a sheet, to which parts compare their own: what is far off has a unit that cannot be meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.sheet import Sheet

# Force over what the sheet carries, length over its width, speed over that of its waves, and stretch of its area, above
# which a unit cannot be meant.
MOST_FORCE, LONGEST, FASTEST, MOST_AREA = 1e3, 20.0, 30.0, 100.0
# Densities [kg/m^3] beyond which their own unit cannot be meant; no metal is as heavy as the larger one.
LIGHTEST, HEAVIEST = 20.0, 25e3
# Stress and energy density over the shear modulus, tearing energy over modulus and width, tearing energy over modulus
# [m], and a stretch, outside which units cannot be meant.
STRESSES, DENSITIES, MOST_TORN, LEAST_TORN, MOST_STRETCH = (1e-3, 1e4), (1e-5, 1e4), 20.0, 1e-6, 30.0
# Modulus of a viscous branch over that of its material outside which modulus and time may be swapped.
BRANCHES = (1e-4, 1e4)


@dataclass(frozen=True)
class Scales:
    """Sizes of a sheet.

    Attributes:
        width: Largest extent [m].
        area: Area [m^2].
        density: Mean density [kg/m^3].
        modulus: Shear modulus [Pa]; None if it is not known.
        force: Force that it carries at a stretch of about two [N]; None if its modulus is not known.
        speed: Speed of its shear waves [m/s]; None in static equilibrium, or if its modulus is not known.
    """

    width: float
    area: float
    density: float
    modulus: float | None
    force: float | None
    speed: float | None

    @classmethod
    def of(cls, sheet: Sheet, modulus: float | None, dynamic: bool) -> Scales:
        """Sizes of a sheet, those of forces and waves from its shear modulus [Pa], None if it is not known."""
        width, density = float(np.ptp(sheet.points, axis=0).max()), float(np.mean(sheet.density))
        force = None if modulus is None else modulus * float(np.mean(sheet.thickness)) * width
        speed = math.sqrt(modulus / density) if dynamic and modulus is not None else None
        return cls(width, float(sheet.areas.sum()), density, modulus, force, speed)

    def of_force(self, what: str, force: float, unit: str) -> list[str]:
        """A doubt about a force [N] that is far larger than what the sheet carries; `unit` says which is expected."""
        carried = "what the sheet carries at a stretch of about two"
        return _far(what, force, self.force, MOST_FORCE, carried, f"is its unit right? {unit}")

    def of_length(self, what: str, length: float) -> list[str]:
        """A doubt about a length [m] that is far larger than the sheet."""
        wide, meant = "the width of the sheet", "is it in mm? Lengths are in m"
        return _far(f"{what} {length:.3g} m,", length, self.width, LONGEST, wide, meant)

    def of_speed(self, what: str, speed: float) -> list[str]:
        """A doubt about a speed [m/s] that is far larger than that of waves; none in static equilibrium."""
        waves, meant = "the speed of its shear waves", "is it in mm/s? Speeds are in m/s"
        return _far(f"{what} {speed:.3g} m/s,", speed, self.speed, FASTEST, waves, meant)

    def of_volume(self, what: str, volume: float) -> list[str]:
        """A doubt about a volume [m^3] whose sphere has a far larger area than the sheet."""
        sphere = math.cbrt(36.0 * math.pi) * math.cbrt(volume) ** 2
        meant = "is it in litres or ml? Volumes are in m^3"
        return _far(
            f"{what} {volume:.3g} m^3, a ball with an area of", sphere, self.area, MOST_AREA, "the sheet's", meant
        )

    def of_stress(self, what: str, stress: float, unit: str, limits: tuple[float, float] = STRESSES) -> list[str]:
        """A doubt about a stress or energy density [Pa] far from the shear modulus; `unit` says which is expected."""
        if self.modulus is None or limits[0] <= stress / self.modulus <= limits[1]:
            return []
        return [f"{what} is {stress / self.modulus:.3g} times the shear modulus of the sheet; {unit}"]

    def of_tearing_energy(self, what: str, least: float, most: float) -> list[str]:
        """A doubt about a tearing energy [J/m^2], from least to most, by its length Gc / mu."""
        if self.modulus is None:
            return []
        if most > MOST_TORN * self.width * self.modulus:
            return [
                f"{what} of {most:.3g} J/m^2 over the shear modulus is {most / self.modulus:.3g} m, and the sheet is "
                f"{self.width:.3g} m wide, so that nothing tears; is its unit right? Rubber has 1e2 to 1e5 J/m^2"
            ]
        if least < LEAST_TORN * self.modulus:
            return [
                f"{what} of {least:.3g} J/m^2 over the shear modulus is {least / self.modulus:.3g} m; is it in kJ/m^2? "
                "Rubber has 1e2 to 1e5 J/m^2"
            ]
        return []


def of_stretch(what: str, stretch: float) -> list[str]:
    """A doubt about a critical stretch [-] that no rubber reaches."""
    if stretch <= MOST_STRETCH:
        return []
    return [f"{what} is {stretch:.3g}; is it in percent? A stretch is length over stress-free length"]


def _far(what: str, size: float, of_sheet: float | None, most: float, than: str, meant: str) -> list[str]:
    if of_sheet is None or not size > most * of_sheet:
        return []
    return [f"{what} {size / of_sheet:.3g} times {than}; {meant}"]


def largest_factor(ramp: Sequence[tuple[float, float]] | None) -> float:
    """Largest magnitude of the factor of a load's ramp; 1 without a ramp."""
    return max(abs(float(pair[1])) for pair in ramp) if ramp else 1.0
