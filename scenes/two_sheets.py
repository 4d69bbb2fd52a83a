"""A rubber sheet is pressed on another one and pulled over it: the pull is the friction force.

Two neo-Hookean sheets (mu 1 MPa, 1 mm thick). The lower one, 0.1 x 0.06 m, is held everywhere; the upper one, 0.04 m
square and turned by 17 degrees, is pressed on it by a pressure and pulled along x at 0.2 m/s by its right edge. Mass
damping removes the initial vibrations, as air and losses in the rubber would.

The reference is the pull coefficient x pressure x area. Surfaces of points are bumpy, and bumps resist: points that
keep 2.5 spacings instead of 1.5 make the surface smoother, and the pull 1 % instead of 4 % too large.
"""

import numpy as np

from warp_pd import (
    BodyForce,
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Outcome,
    Place,
    SelfContact,
    Sheet,
    Simulation,
    placed,
    together,
)
from warp_pd.device.checks import not_negative, positive
from warp_pd.measures import worst_balance

MU, THICKNESS, DENSITY, SIDE = 1e6, 1e-3, 1000.0, 0.04


def build(
    points: int = 33,
    horizon: float = 2.015,
    friction: float = 0.4,
    pressure: float = 2e3,
    speed: float = 0.2,
    duration: float = 0.04,
    frames: int = 100,
    damping: float = 200.0,
) -> Simulation:
    """Build the scene.

    Args:
        pressure: Pressure on the upper sheet [Pa].
        speed: Speed at which the upper sheet is pulled [m/s].
    """
    spacing = SIDE / (points - 1)
    lower = Sheet.rectangle(0.1, 0.06, thickness=THICKNESS, density=DENSITY, points=round(0.1 / spacing) + 1)
    upper = Sheet.rectangle(SIDE, SIDE, thickness=THICKNESS, density=DENSITY, points=points)
    sheet = together(lower, upper)
    height = 2.4 * spacing
    start = placed(sheet, Place(), Place((0.03, 0.005, height), degrees=17.0))
    moving = sheet.edges("sheet 2")
    pulled = moving[upper.edges("right")]
    times, way = [0.0, 0.25 * duration, duration], positive("speed", speed) * duration
    path = np.array([0.0, 0.125 * way, 0.875 * way])
    edge = [Motion([int(p)], times, x=(start[p, 0] + path).tolist(), y=float(start[p, 1])) for p in np.asarray(pulled)]
    reference = not_negative("friction", friction) * positive("pressure", pressure) * SIDE**2
    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(mu=MU, bulk=100.0 * MU), horizon=horizon, weights="plain"),
        loads=[Fixed(sheet.edges("sheet 1")), *edge, BodyForce((0.0, 0.0, -pressure / THICKNESS))],
        contact=SelfContact(distance=2.5 * spacing, friction=friction),
        solver=Explicit(duration, frames=frames, damping=damping),
        initial_displacement=start,
        measures=[
            Measure("height", "m", lambda built, frame: frame.displacement[moving, 2].mean()),
            Measure("slip", "m", lambda built, frame: (frame.displacement - start)[moving, 0].mean()),
        ],
        outcomes=[
            Outcome("pull", "N", pull, reference, "Coulomb: friction x pressure x area"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="own sheet",
        pictures=pictures,
    )


def pull(history):
    """Work of the supports divided by the distance in the second half of the run [N], without mass damping."""
    half = [row for row in history if row["time"] >= 0.5 * history[-1]["time"]]
    way = half[-1]["slip"] - half[0]["slip"]
    work, lost = (half[-1][name] - half[0][name] for name in ("external", "damping"))
    return (work - lost) / way if way > 0.0 else None


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [0.0, history[-1]["time"]])
    plots.surfaces(folder / "sheets.png", shown, field="u3")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
    plots.curves(folder / "slip.png", history, ["slip"], ylabel="slip (m)")
