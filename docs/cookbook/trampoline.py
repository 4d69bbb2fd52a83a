"""A trampoline: a bed of rubber, stretched before it was clamped, under a plate.

`prestretched` describes the clamped bed. Its tension is h mu (1 - stretch^-6), with the thickness h of the
stress-free bed.
"""

import numpy as np

from warp_pd import BondAssociated, Circle, Fixed, Measure, MooneyRivlin, Newton, PointForce, Sheet, Simulation


def build(points=24, weight=20.0):
    """A bed of rubber, stretched by 1.5 and clamped, under a plate; `points` along the radius."""
    radius, plate, thickness, stretch, mu = 1.0, 0.25, 2e-3, 1.5, 1e6
    sheet = Sheet.outline(Circle((0, 0), radius), spacing=radius / points, thickness=thickness, density=1000.0)
    sheet = sheet.prestretched(stretch)
    under = sheet.where(lambda x, y: np.hypot(x, y) < plate)
    middle = sheet.nearest(0.0, 0.0)
    # Small deflections of a membrane with the tension T, under a load that is even inside the radius a.
    tension = thickness * mu * (1.0 - stretch**-6)
    held = np.sqrt(sheet.areas[under].sum() / np.pi)
    exact = weight / (4.0 * np.pi * tension) * (1.0 + 2.0 * np.log(radius / held))
    return Simulation(
        sheet,
        BondAssociated(MooneyRivlin(0.5 * mu), horizon=2.015),
        Newton(),
        loads=[Fixed(sheet.edges("outline")), PointForce(under, (0.0, 0.0, -weight))],
        measures=[Measure("sag", "m", lambda built, frame: -frame.displacement[middle, 2], exact, "linear membrane")],
    )
