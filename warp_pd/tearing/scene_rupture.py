"""Rupture arguments of scenes: a tearing energy or, to reproduce a paper, a critical stretch."""

from __future__ import annotations

from typing import Any

from ..device.checks import positive
from ..geometry.sheet import Sheet
from ..interfaces import Rupture
from ..parts.rupture import CriticalStretch
from .tearing_energy import TearingEnergy


def stretch_or_energy(
    critical_stretch: float | None, tearing_energy: float, length: float | None = None, spared: Any = None
) -> Rupture:
    """The criterion of a scene: a critical stretch [-] if given, otherwise a tearing energy [J/m^2]."""
    if critical_stretch is not None:
        return CriticalStretch(critical_stretch, spared)
    return TearingEnergy(tearing_energy, length, spared=spared)


def horizon_for_tears(horizon: float | None, critical_stretch: float | None) -> float:
    """Horizon of a scene in spacings: as given, otherwise 2.015, or 3.15 with a critical stretch.

    With a critical stretch cracks follow the grid at smaller horizons.
    """
    if horizon is not None:
        return positive("horizon", horizon)
    return 2.015 if critical_stretch is None else 3.15


def length_for_tears(length: float | None, default: float, horizon: float, sheet: Sheet) -> float:
    """Length of the damage field of a scene [m]: as given, otherwise the larger of the default and the horizon."""
    return max(default, horizon * sheet.spacing) if length is None else length


def notes_on_criterion(critical_stretch: float | None) -> list[str]:
    """Note of a scene if a critical stretch replaces the tearing energy."""
    if critical_stretch is None:
        return []
    return [f"bonds break at a stretch of {critical_stretch:g}; tearing energy and damage length are not used"]
