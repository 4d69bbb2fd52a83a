"""A cushion: two discs of foil, welded along their rim and blown up.

Both halves are equal, so one flat half is enough: its rim stays in the plane of the weld. Foil hardly stretches and
wrinkles, so it is a stiff `TensionField`; `slack_stiffness` holds what is slack. It begins a little arched, since a
flat sheet that nothing stretches has no stiffness against the pressure.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Circle,
    Fixed,
    Measure,
    MooneyRivlin,
    Newton,
    Pressure,
    Sheet,
    Simulation,
    TensionField,
)


def build(points=6, pressure=500.0):
    """Two discs of foil, welded along their rims and blown up: the upper half; `points` along the radius."""
    radius, mu = 0.1, 3e7
    sheet = Sheet.outline(Circle((0, 0), radius), spacing=radius / points, thickness=1e-4, density=1400.0)
    rim, middle, foot = np.asarray(sheet.edges("outline")), sheet.nearest(0.0, 0.0), sheet.nearest(radius, 0.0)
    height = 0.1 * radius * (1.0 - (sheet.points**2).sum(axis=1) / radius**2)

    def flatness(built, frame):
        around = np.hypot(*(sheet.points[rim] + frame.displacement[rim, :2]).T).mean()
        return 2.0 * frame.displacement[middle, 2] / around

    # The lower half mirrors the upper one: the weld stays in its plane, and nothing else holds it.
    return Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(0.5 * mu), slack_stiffness=1e-3 * mu), horizon=2.015),
        Newton(load_steps=2),
        loads=[Fixed([middle], "xy"), Fixed(rim, "z"), Fixed([foot], "y"), Pressure(pressure)],
        initial_displacement=np.outer(height, (0.0, 0.0, 1.0)),
        measures=[Measure("flatness", "1", flatness, 1.198, "mylar balloon: Mladenov and Oprea 2003")],
    )
