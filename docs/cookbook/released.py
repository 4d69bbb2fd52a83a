"""A strained strip that is cut across while it is held.

A `Slit` opens at its time, here at once; with two times it runs from end to end.
"""

import numpy as np

from warp_pd import BondAssociated, CutsInTime, Explicit, Fixed, Measure, NeoHookean, Sheet, Simulation, Slit


def build(points=101, strain=1e-3):
    """A strained strip that is cut across while it is held: how fast its ends fly apart."""
    length, mu, density = 0.2, 1e5, 1000.0
    sheet = Sheet.rectangle(length, 0.1 * length, thickness=1e-3, density=density, points=points)
    middle, wave = 0.5 * length + 0.5 * sheet.spacing, np.sqrt(4.0 * mu / density)
    behind = sheet.where(lambda x, y: (x > 0.4 * length) & (x < 0.47 * length))
    start = np.outer(sheet.points[:, 0], (strain, 0.0, 0.0))

    def speed(built, frame):
        return -frame.velocity[behind, 0].mean()

    return Simulation(
        sheet,
        BondAssociated(NeoHookean(mu=mu, bulk=1e3 * mu), horizon=2.015),
        Explicit(0.15 * length / wave, frames=2),
        initial_displacement=start,
        loads=[Fixed(sheet.edges("left", "right")), Fixed(np.arange(sheet.size), "yz")],
        damage=CutsInTime(Slit([(middle, -1.0), (middle, 1.0)], at=0.0)),
        measures=[Measure("speed", "m/s", speed, strain * wave, "strain times speed of waves")],
    )
