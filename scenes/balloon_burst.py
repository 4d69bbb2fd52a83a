"""An inflated balloon is pricked: it bursts.

A latex sphere of radius 0.1 m and 0.3 mm thickness when stress-free, mu 0.4 MPa (Mooney-Rivlin, a tenth of it c01),
inflated to twice its radius by air. A needle has pricked its pole: there the damage field begins with a short crack.
The air presses on intact triangles and leaves through torn ones, as through an orifice. The rubber goes slack as it
snaps back and wrinkles more finely than the spacing (tension field). There is no closed form. The checks are the energy
balance, and that the rubber snaps back no faster than its waves, sqrt(4 mu / rho) = 40 m/s times the stretch.

The inflated balloon stores 1 MJ/m^3, which must be below its strength 3 Gc / (16 damage_length). So the default tearing
energy increases with the length that the points resolve: 80 kJ/m^2 at 10 mm, and the hole opens in all directions. For
latex of 10 kJ/m^2 the length is below 1.8 mm and the spacing 0.6 mm; there cracks run, the more of them the more the
balloon is inflated (Moulinet and Adda-Bedia, Phys. Rev. Lett. 115 (2015) 184301).

Weights are corrected: with plain ones the stress of an irregular grid is out of balance by some percent, and an
inflated neo-Hookean sphere bulges wherever it is weakest.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    EnclosedGas,
    Explicit,
    Measure,
    MooneyRivlin,
    Outcome,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
)
from warp_pd.device.checks import count, not_negative, positive
from warp_pd.measures import largest, worst_balance
from warp_pd.tearing import length_for_tears

RADIUS, THICKNESS, DENSITY, MU, SHARE = 0.1, 0.3e-3, 1000.0, 0.4e6, 0.1
C10, C01 = 0.5 * (1.0 - SHARE) * MU, 0.5 * SHARE * MU


def build(
    points: int = 32,
    horizon: float = 2.015,
    stretch: float = 2.0,
    tearing_energy: float | None = None,
    damage_length: float | None = None,
    prick: float = 0.02,
    duration: float = 0.007,
    damping: float = 5.0,
    frames: int = 60,
    safety: float = 0.3,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch of the inflated balloon [-].
        tearing_energy: Energy of torn area [J/m^2]; by default 8 times the damage length and what a volume stores.
        damage_length: Length of the damage field [m]; by default 10 mm, or the horizon if that is more.
        prick: Length of the initial crack on the stress-free balloon [m].
    """
    top = positive("stretch", stretch) * RADIUS
    sheet = Sheet.sphere(top, thickness=THICKNESS, density=DENSITY, points=count("points", points, 8))
    inflated = sheet.prestretched(stretch)
    gauge = 2.0 * MU * THICKNESS / RADIUS * (1.0 / stretch - stretch**-7.0)
    gauge *= 1.0 - SHARE + SHARE * stretch**2
    length = length_for_tears(damage_length, 0.01, positive("horizon", horizon), inflated.unstretched())
    if tearing_energy is None:
        stored = C10 * (2.0 * stretch**2 + stretch**-4 - 3.0) + C01 * (stretch**4 + 2.0 * stretch**-2 - 3.0)
        tearing_energy = 8.0 * length * stored
    x, y, z = inflated.unstretched().positions.T
    apart = np.hypot(np.maximum(abs(x) - 0.5 * not_negative("prick", prick), 0.0), y)
    pricked = np.where(z > 0.0, np.maximum(1.0 - apart / (2.0 * length), 0.0) ** 2, 0.0)

    def torn(built, frame):
        return float(np.mean(frame.damage > 0.5))

    return Simulation(
        inflated,
        force=BondAssociated(TensionField(MooneyRivlin(C10, C01)), horizon=horizon, weights="corrected"),
        loads=[EnclosedGas(gauge=gauge, leak=0.8)],
        damage=TearingEnergy(tearing_energy, length, initial_damage=pricked),
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
    from warp_pd.viewer import plots

    end = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * end for fraction in (0.05, 0.2, 0.5, 0.8)])
    plots.surfaces(folder / "burst.png", shown, field="damage")
    plots.curves(folder / "pressure.png", history, ["pressure"], ylabel="pressure (Pa)")
