"""Gravity: a constant force on every point, its mass times an acceleration."""

from dataclasses import dataclass

import numpy as np

from warp_pd.device.checks import vector
from warp_pd.interfaces import BuiltLoad, Load


@dataclass(frozen=True)
class Gravity(Load):
    """The weight of the sheet, for any thickness and density; static solvers apply it at once, not in load steps."""

    acceleration: tuple = (0.0, 0.0, -9.81)

    def __post_init__(self):
        vector("Gravity.acceleration", self.acceleration, 3)

    def build(self, context, law):
        return Weight(self, context.sheet)


class Weight(BuiltLoad):
    label = "loads: Gravity"

    def __init__(self, gravity, sheet):
        mass = sheet.areas * sheet.thickness * sheet.density
        self.force = np.outer(mass, gravity.acceleration)

    def constant_force(self):
        return self.force
