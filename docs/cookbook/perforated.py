"""A perforated line that is torn.

`pull_y` in the history is the force. Bridges need four lengths of the damage field; where they are narrower a note
says how much of the tearing energy they take (docs/tearing.md).
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


def build(points=65, size=8e-3, tearing_energy=500.0, frames=20):
    """Slits and bridges of one size across a sheet that is torn in two along them: what the tear takes."""
    width, height, thickness, mu, stretch, speed = 0.064, 0.04, 0.5e-3, 0.3e6, 1.8, 0.5
    sheet = Sheet.rectangle(width, height, thickness=thickness, density=1000.0, points=points)
    y, slits = 0.5 * height + 0.5 * sheet.spacing, round(width / (2.0 * size))
    for begin in (2.0 * np.arange(slits) + 0.5) * size:
        sheet = sheet.cut((begin, y), (begin + size, y))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    duration, uncut = (stretch - 1.0) * height / speed, thickness * (width - slits * size)
    return Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(0.5 * mu)), horizon=2.015),
        Explicit(duration, frames=frames, damping=20.0),
        loads=[
            Fixed(bottom), Motion(top, [0.0, duration], x=0.0, y=[0.0, (stretch - 1.0) * height], z=0.0),
            Reaction(top, "pull"),
        ],
        damage=TearingEnergy(tearing_energy, spared=np.concatenate([bottom, top])),
        outcomes=[
            Outcome("torn_ratio", "1", lambda rows: rows[-1]["rupture"] / (tearing_energy * uncut), 1.0, "uncut area"),
            Outcome("peak", "N", largest("pull_y")),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
    )  # fmt: skip
