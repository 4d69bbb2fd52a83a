"""A needle pricks an inflated balloon: it bursts.

A latex sphere of radius 0.1 m and 0.3 mm thickness without stress, mu 0.4 MPa (Mooney-Rivlin, a tenth of it c01),
inflated to twice its radius by air. A rigid needle, as fine as the points resolve, is pushed into its pole. Bonds lose
their weight by a tearing energy; the air acts on what is whole and leaves through what is torn, as through an orifice.
Rubber slackens as it snaps back, and wrinkles finer than the spacing: the tension field. There is no closed form. What
counts is the balance of energies, and that the rubber snaps back no faster than its waves: at sqrt(4 mu / rho) = 40 m/s
times the stretch.

Weights are corrected: with plain ones the stress of an irregular grid is out of balance by some percent, and an
inflated neo-Hookean sphere bulges wherever it is weakest. The tearing energy must keep the inflated balloon whole. At a
coarse spacing that takes more than the 3 to 10 kJ/m^2 of latex, since what a bond represents grows with the spacing: 25
kJ/m^2 at the default of 24 points on a quarter of the circumference, 5 kJ/m^2 at 120.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    EnclosedGas,
    Explicit,
    Measure,
    MooneyRivlin,
    Outcome,
    RigidBall,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
)
from warp_pd.device.checks import count, positive
from warp_pd.measures import largest, worst_balance

RADIUS, THICKNESS, DENSITY, MU, SHARE = 0.1, 0.3e-3, 1000.0, 0.4e6, 0.1
# Diameter of the needle in spacings of the inflated balloon: a finer one would slip between points.
NEEDLE = 3.0


def build(
    points: int = 24,
    horizon: float = 3.015,
    stretch: float = 2.0,
    tearing_energy: float = 25e3,
    speed: float = 30.0,
    duration: float = 0.012,
    damping: float = 5.0,
    frames: int = 60,
    safety: float = 0.3,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch of the inflated balloon [-].
        speed: Speed of the needle [m/s].
    """
    top = positive("stretch", stretch) * RADIUS
    sheet = Sheet.sphere(top, thickness=THICKNESS, density=DENSITY, points=count("points", points, 8))
    gauge = 2.0 * MU * THICKNESS / RADIUS * (1.0 / stretch - stretch**-7.0)
    gauge *= 1.0 - SHARE + SHARE * stretch**2
    diameter = NEEDLE * sheet.spacing
    needle = RigidBall(diameter, (0.0, 0.0, top + 0.55 * diameter), (0.0, 0.0, -positive("speed", speed)))

    def torn(built, frame):
        return float(np.mean(frame.damage > 0.5))

    return Simulation(
        sheet.prestretched(stretch),
        force=BondAssociated(
            TensionField(MooneyRivlin(0.5 * (1.0 - SHARE) * MU, 0.5 * SHARE * MU)), horizon=horizon, weights="corrected"
        ),
        loads=[EnclosedGas(gauge=gauge, leak=0.8)],
        contact=needle,
        damage=TearingEnergy(tearing_energy),
        solver=Explicit(duration, frames=frames, damping=damping, safety=safety),
        track_energy=True,
        measures=[
            Measure("torn", "-", torn),
            Measure("speed", "m/s", lambda built, frame: float(np.linalg.norm(frame.velocity, axis=1).max())),
        ],
        outcomes=[
            Outcome("largest_speed", "m/s", largest("speed")),
            Outcome("energy_balance", "-", worst_balance),
        ],
        section="burst balloon",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.output import plots

    begin = next((k for k, row in enumerate(history) if row["mean_damage"] > 0.0), 0)
    chosen = np.unique(np.linspace(begin, len(history) - 1, 4).astype(int))
    shown = plots.frames_at(folder, [history[k]["time"] for k in chosen])
    plots.surfaces(folder / "burst.png", shown, field="damage")
    plots.curves(folder / "pressure.png", history, ["pressure"], ylabel="pressure (Pa)")
