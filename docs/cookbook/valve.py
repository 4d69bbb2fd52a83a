"""A diaphragm valve: a rigid disc in a stretched sheet, under a pressure from below or, negative, from above.

The disc is in the sheet before the stretch. So the sheet is described in its stress-free size, the
rim begins where it is clamped and the disc where it is. The first load step settles the ring between them, the
second brings the pressure. The closed form is the radial balance of the ring, whose tension then carries the
pressure.
"""

import numpy as np
from scipy.integrate import solve_bvp

from warp_pd import BondAssociated, Circle, Fixed, Measure, MooneyRivlin, Pressure, Relaxation, Sheet, Simulation

RADIUS, DISC, THICKNESS, MU = 0.05, 0.02, 1e-3, 1e5


def lift(pressure, stretch):
    """Of a disc that a stretched ring holds, at small slopes [m]."""

    def stresses(R, y):
        along, around = y[1], y[0] / R
        return MU * (along - along**-3 * around**-2), MU * (around - around**-3 * along**-2), along, around

    def slopes(R, y):
        radial, hoop, along, around = stresses(R, y)
        d_along = MU * (1.0 + 3.0 * along**-4 * around**-2)
        d_around = 2.0 * MU * along**-3 * around**-3
        # Balance: (R P)' = P of the hoop.
        return np.stack([along, ((hoop - radial) - d_around * (along - around)) / (R * d_along)])

    R = np.linspace(DISC, RADIUS, 200)
    ends = lambda inner, outer: np.array([inner[0] - DISC, outer[0] - stretch * RADIUS])  # noqa: E731
    y = solve_bvp(slopes, ends, R, np.stack([stretch * R, 0.0 * R + stretch]), tol=1e-8).sol(R)
    radial, _, along, _ = stresses(R, y)
    return np.trapezoid(pressure * y[0] ** 2 * along / (2.0 * THICKNESS * R * radial), R)


def build(points=16, pressure=3.0, stretch=1.1):
    """A diaphragm with a rigid disc, stretched before it is clamped; the pressure may be negative."""
    ring, disc = Circle((0, 0), RADIUS), Circle((0, 0), DISC)
    sheet = Sheet.outline(ring, inclusions={"disc": disc}, spacing=RADIUS / points, thickness=THICKNESS, density=1000.0)
    r, middle = np.hypot(*sheet.points.T), sheet.nearest(0.0, 0.0)
    # The disc keeps its size, the rim moves out, and between them the sheet settles.
    share = (stretch - 1.0) * (1.0 - (DISC / np.maximum(r, DISC)) ** 2) / (1.0 - (DISC / RADIUS) ** 2)
    return Simulation(
        sheet,
        BondAssociated(MooneyRivlin(0.5 * MU), horizon=2.015),
        Relaxation(load_steps=2),
        loads=[Fixed(sheet.edges("outline")), Pressure(pressure, ramp=[(0.0, 0.0), (0.5, 0.0), (1.0, 1.0)])],
        initial_displacement=np.column_stack([share[:, None] * sheet.points, 0.0 * r]),
        measures=[
            Measure("lift", "m", lambda built, frame: frame.displacement[middle, 2], lift(pressure, stretch), "a ring")
        ],
    )
