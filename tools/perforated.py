"""A perforated line: slits and bridges of one size across a sheet that is pulled until it is torn in two.

A scene file for `tools/tears.py perforated`; also `warp-pd run tools/perforated.py --points 129 --set size=4e-3`.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Outcome,
    Reaction,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
)
from warp_pd.measures import largest, worst_balance

WIDTH, HEIGHT, THICKNESS, GC, MU = 0.064, 0.04, 0.5e-3, 500.0, 0.3e6


def build(points: int = 129, size: float = 4e-3, horizon: float = 2.015, speed: float = 0.5, stretch: float = 1.8):
    """Build the scene.

    Args:
        points: Points along the width.
        size: Length of a slit and of a bridge [m].
        horizon: Horizon in spacings [-].
        speed: Speed of the upper edge [m/s].
        stretch: Stretch at the end [-].
    """
    sheet = Sheet.rectangle(WIDTH, HEIGHT, thickness=THICKNESS, density=1000.0, points=points)
    y = 0.5 * HEIGHT + 0.5 * sheet.spacing
    slits = round(WIDTH / (2.0 * size))
    for n in range(slits):
        begin = (2.0 * n + 0.5) * size
        sheet = sheet.cut((begin, y), (begin + size, y))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    uncut = THICKNESS * (WIDTH - slits * size)

    def torn_ratio(history):
        return history[-1]["rupture"] / (GC * uncut)

    duration, reach = (stretch - 1.0) * HEIGHT / speed, (stretch - 1.0) * HEIGHT
    return Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(0.5 * MU)), horizon=horizon),
        Explicit(duration, frames=100, damping=20.0),
        loads=[Fixed(bottom), Motion(top, [0.0, duration], x=0.0, y=[0.0, reach], z=0.0), Reaction(top, "pull")],
        damage=TearingEnergy(GC, spared=np.concatenate([bottom, top])),
        outcomes=[
            Outcome("torn_ratio", "1", torn_ratio),
            Outcome("peak", "N", largest("pull_y")),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
    )  # fmt: skip
