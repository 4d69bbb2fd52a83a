"""A slit in a long balloon opens under pressure.

A tube of incompressible neo-Hookean rubber, radius 20 mm, length 60 mm, thickness 1 mm, mu 1 MPa, has an axial slit of
16 mm in its middle. Its ends are held, and one of them is pulled by 15 % of the length. A follower pressure rises to
4 kPa. The rubber on both sides of the slit bulges, and the slit opens.

The reference value is the opening in the middle of the slit from finite elements (tools/finite_elements.py), nine-node
membrane elements on a grid graded towards the tips.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Fixed,
    Measure,
    MooneyRivlin,
    Motion,
    Newton,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import count, one_of
from warp_pd.interfaces import Solver

RADIUS, LENGTH, THICKNESS, MU, SLIT = 0.02, 0.06, 1e-3, 1e6, 0.016
# Opening [m] at 4 kPa from finite elements.
OPENING = 1.288e-3


def build(
    points: int = 31,
    horizon: float = 2.015,
    pressure: float = 4e3,
    load_steps: int = 3,
    solver: str = "newton",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the tube; with 30 k + 1 points the slit ends exactly at points, and there is a reference.
    """
    around = round(2.0 * np.pi * RADIUS / LENGTH * (count("points", points, 13) - 1))
    tube = Sheet.tube(RADIUS, LENGTH, thickness=THICKNESS, density=1000.0, points=(around, points))
    # Through points of the tube, and where pictures show it.
    angle = -2.0 * np.pi * round(around / 6) / around
    x, y = RADIUS * np.cos(angle), RADIUS * np.sin(angle)
    sheet = tube.slit((x, y, 0.5 * (LENGTH - SLIT)), (x, y, 0.5 * (LENGTH + SLIT)))
    middle = [
        face[np.argmin(np.abs(sheet.points[face, 2] - 0.5 * LENGTH))]
        for face in (sheet.edges("slit 1 left"), sheet.edges("slit 1 right"))
    ]

    def opening(built, frame):
        first, second = sheet.points[middle] + frame.displacement[middle]
        return float(np.linalg.norm(first - second))

    # The slit is as long as that of the reference where it ends at points.
    reference = OPENING if pressure == 4e3 and points % 30 == 1 else None
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=load_steps),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=load_steps),
    }
    return Simulation(
        sheet,
        force=BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon, weights="corrected"),
        loads=[
            Fixed(sheet.edges("bottom")),
            Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=0.0, z=[0.0, 0.15 * LENGTH]),
            Pressure(pressure),
        ],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("pressure", "Pa", lambda built, frame: pressure * frame.time),
            Measure("opening", "m", opening, reference, "finite elements"),
        ],
        section="finite elements",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    plots.surfaces(folder / "slit.png", plots.frames_at(folder, [history[-1]["time"]]), field="u1", view=(15.0, -80.0))
    plots.curves(
        folder / "opening.png", history, ["opening"], ylabel="opening (m)", against="pressure", xlabel="pressure (Pa)"
    )
