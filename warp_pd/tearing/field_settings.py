"""Settings of a damage field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import by_point
from ..geometry.couplings import crack_segments
from ..geometry.sheet import ByPoint
from ..interfaces import Rupture
from .cut_profiles import longest_between_cuts
from .field_constants import Density, FieldConstants


@dataclass(frozen=True, eq=False)
class FieldSettings(Rupture):
    """What a damage field is; attributes as for `TearingEnergy`."""

    energy: ByPoint
    length: float | None = None
    strength: float | None = None
    spared: Any = None
    stretch_at_break: float | None = None
    cut_profile: bool = True
    initial_damage: np.ndarray | None = None
    screened: bool = True
    every_step: bool = False
    stiffens: bool = False

    def constants(self, context: Context, horizon: float, density: Density) -> FieldConstants:
        """Constants of the field at a horizon [m] and an energy density [J/m^3]; see `FieldConstants`."""
        points = context.given.points
        free = self.cut_profile and self.length is None and len(crack_segments(context.whole))
        return FieldConstants(
            by_point("TearingEnergy.energy", self.energy, points), self.length, self.strength, self.stretch_at_break,
            horizon, density, context.sheet.spacing, float(np.linalg.norm(np.ptp(points, axis=0))),
            longest_between_cuts(context.whole) if free else float("inf"),
        )  # fmt: skip
