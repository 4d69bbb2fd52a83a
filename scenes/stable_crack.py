"""Draft."""

import math

import numpy as np

from warp_pd import (
    BondAssociated,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, support_force

HEIGHT, THICKNESS, DENSITY, MU = 0.04, 1e-3, 1000.0, 1e3
MATERIAL = NeoHookean(MU, 100.0 * MU)


def build(
    points: int = 24,
    length: float = 4.0,
    cut: float = 1.25,
    hinge: float = 5.0,
    horizon: float = 2.015,
    wrinkles: str = "resolved",
    tearing_energy: float | None = 2.0,
    damage_length: float | None = None,
    begin: float = 0.04,
    end: float = 0.075,
    load_steps: int = 20,
    tolerance: float = 1e-6,
    cut_profile: bool = True,
) -> Simulation:
    L = length * HEIGHT
    sheet = Sheet.filled(L, HEIGHT, thickness=THICKNESS, density=DENSITY, points=(round(length * points), points), layers=(0, math.ceil(horizon)))
    if cut:
        sheet = sheet.cut((-HEIGHT, 0.5 * HEIGHT), (cut * HEIGHT, 0.5 * HEIGHT))
    loads = []
    grips = []
    for s in (1.0, -1.0):
        grip = sheet.where(lambda x, y, s=s: s * (y - 0.5 * HEIGHT) > 0.5 * HEIGHT - 1e-9)
        grips.append(grip)
        x = sheet.points[grip, 0]
        for place in np.unique(x.round(9)):
            opening = 0.5 * s * (hinge * HEIGHT - place)
            first = 1.0 / load_steps
            loads.append(Motion(grip[np.abs(x - place) < 1e-6], times=[0.0, first, 1.0], x=0.0, y=[0.0, opening * begin, opening * end]))
    loads.append(Fixed(np.arange(sheet.size), "z"))
    line = TearLine(sheet)
    tip, ahead = (cut * HEIGHT, 0.5 * HEIGHT), (L, 0.5 * HEIGHT)
    both = np.concatenate(grips)

    def angle(built, frame):
        return float(np.interp(frame.time, [0.0, 1.0 / load_steps, 1.0], [0.0, begin, end]))
    return Simulation(
        sheet, force=BondAssociated(with_wrinkles(MATERIAL, wrinkles), horizon=horizon), loads=loads,
        damage=None if tearing_energy is None else TearingEnergy(tearing_energy, length=damage_length, spared=both, cut_profile=cut_profile),
        solver=Newton(load_steps=load_steps, tolerance=tolerance),
        measures=[
            Measure("angle", "1", angle),
            *([] if tearing_energy is None else [Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead))]),
        ],
    )
