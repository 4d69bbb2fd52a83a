"""A needle pricks an inflated balloon: it bursts.

A latex sphere of radius 0.1 m and 0.3 mm thickness without stress, mu 0.4 MPa (Mooney-Rivlin, a tenth of it c01),
inflated to twice its radius by air. A rigid needle, as fine as the points resolve, is pushed into its pole. Bonds break
at a critical stretch; the air acts on what is whole and leaves through what is torn, as through an orifice.
Rubber slackens as it snaps back, and wrinkles finer than the spacing: the tension field. There is no closed form. What
counts is the balance of energies, and that the rubber snaps back no faster than its waves: at sqrt(4 mu / rho) = 40 m/s
times the stretch.

Weights are corrected: with plain ones the stress of an irregular grid is out of balance by some percent, and an
inflated neo-Hookean sphere bulges wherever it is weakest. `tearing_energy` takes the place of the critical stretch. The
inflated balloon stores 1 MJ/m^3, which it must bear: by `damage_length`, 3 Gc / (16 length) is more, and a spacing of a
third of that length resolves it. For latex of 10 kJ/m^2 these are 1.8 mm and 0.6 mm.
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
    TensionField,
)
from warp_pd.device.checks import count, positive
from warp_pd.measures import largest, worst_balance
from warp_pd.parts import stretch_or_energy

RADIUS, THICKNESS, DENSITY, MU, SHARE = 0.1, 0.3e-3, 1000.0, 0.4e6, 0.1
# Diameter of the needle in spacings of the inflated balloon: a finer one would slip between points.
NEEDLE = 3.0


def build(
    points: int = 24,
    horizon: float = 3.015,
    stretch: float = 2.0,
    critical_stretch: float = 4.2,
    tearing_energy: float | None = None,
    damage_length: float | None = None,
    speed: float = 30.0,
    duration: float = 0.012,
    damping: float = 5.0,
    frames: int = 60,
    safety: float = 0.3,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch of the inflated balloon [-].
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
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
        damage=stretch_or_energy(critical_stretch, tearing_energy, damage_length),
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
