"""A needle pricks an inflated balloon: it bursts.

A latex sphere of radius 0.1 m and 0.3 mm thickness without stress, mu 0.4 MPa, inflated to twice its radius by air. A
rigid needle, a ball of 12 mm in diameter, is pushed into its pole. Bonds lose their weight by a tearing energy; the air
acts on what is whole and leaves through what is torn, as through an orifice. Rubber slackens as it snaps back, and
wrinkles finer than the spacing: the tension field. There is no closed form. What counts is the balance of energies, and
that the rims of the tear run at less than the wave speed of the stretched rubber.

The tearing energy must keep the inflated balloon whole: at a coarse spacing that takes more than latex has (about
5 kJ/m^2), since what a bond represents grows with the spacing. `--points 160` tears at 6 kJ/m^2.
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
from warp_pd.checks import count, positive
from warp_pd.measures import largest, worst_balance

RADIUS, THICKNESS, DENSITY, MU = 0.1, 0.3e-3, 1000.0, 0.4e6
NEEDLE = 0.012


def build(
    points: int = 24,
    horizon: float = 3.015,
    stretch: float = 2.0,
    tearing_energy: float = 25e3,
    speed: float = 20.0,
    duration: float = 0.012,
    damping: float = 5.0,
    frames: int = 60,
    safety: float = 0.3,
) -> Simulation:
    """`stretch` is that of the inflated balloon, `speed` that of the needle [m/s]."""
    top = positive("stretch", stretch) * RADIUS
    sheet = Sheet.sphere(top, thickness=THICKNESS, density=DENSITY, points=count("points", points, 8))
    gauge = 2.0 * MU * THICKNESS / RADIUS * (1.0 / stretch - stretch**-7.0)
    needle = RigidBall(NEEDLE, (0.0, 0.0, top + 0.55 * NEEDLE), (0.0, 0.0, -positive("speed", speed)))

    def torn(built, frame):
        return float(np.mean(frame.damage > 0.5))

    return Simulation(
        sheet.prestretched(stretch),
        force=BondAssociated(TensionField(MooneyRivlin(0.5 * MU)), horizon=horizon),
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
    plots.surfaces(folder / "burst.png", shown, field="damage", label="damage")
    plots.curves(folder / "pressure.png", history, ["pressure"], ylabel="pressure (Pa)")
