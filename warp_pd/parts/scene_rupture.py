"""Rupture of scenes that take a tearing energy, or the critical stretch of a paper in its place."""

from __future__ import annotations

from typing import Any

from ..device.checks import positive
from ..geometry.sheet import Sheet
from ..interfaces import Rupture
from .rupture import CriticalStretch
from .tearing_energy import TearingEnergy


def stretch_or_energy(
    critical_stretch: float | None, tearing_energy: float, length: float | None = None, spared: Any = None
) -> Rupture:
    """The criterion of a scene: a critical stretch [-] if one is given, a tearing energy [J/m^2] otherwise."""
    if critical_stretch is not None:
        return CriticalStretch(critical_stretch, spared)
    return TearingEnergy(tearing_energy, length, spared=spared)


def horizon_for_tears(horizon: float | None, critical_stretch: float | None) -> float:
    """Horizon of a scene in spacings: the given one, or 2.015, or 3.15 with a critical stretch.

    With a critical stretch cracks follow the grid at smaller horizons.
    """
    if horizon is not None:
        return positive("horizon", horizon)
    return 2.015 if critical_stretch is None else 3.15


def length_for_tears(length: float | None, default: float, horizon: float, sheet: Sheet) -> float:
    """Length of the damage field of a scene [m]: the given one, or the default, or the horizon if that is more."""
    return max(default, horizon * sheet.spacing) if length is None else length


def notes_on_criterion(critical_stretch: float | None) -> list[str]:
    """What the notes of a scene say of a critical stretch that takes the place of the tearing energy."""
    if critical_stretch is None:
        return []
    return [f"bonds break at a stretch of {critical_stretch:g}: tearing energy and damage length have no part in it"]
