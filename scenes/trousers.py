"""A sheet torn like a pair of trousers: two legs are pulled apart, up and down. Rivlin and Thomas (1953).

A sheet of 20 x 60 x 1 mm, mu 1 kPa, rho 1000 kg/m^3, is cut along its middle from the left for 20 mm. The two legs,
each w = 10 mm wide, begin folded by a right angle, one up and one down, and their ends move apart; the sheet follows
them along x. When the tear grows by dc, each end moves by stretch dc further, under the force F, and a length dc of
both legs is stretched. Hence

    G = 2 stretch F / h - 2 w W(stretch),

with the stretch and the energy density W of a leg in uniaxial tension under F, and the thickness h. (Rivlin and Thomas
write the width 2 w of both legs together.) The tear must run at G = Gc, and go on so: `tear_ratio` is the mean of
G / Gc while the tip moves from 0.2 to 0.6 of the way. Nothing guides the tear; only what is near the ends is spared. On
a grid that shares the symmetry of the sheet it goes straight. On others it drifts towards a leg, as nothing turns it
back, and cuts that off after two of its widths; the mean ends there.

Finite elements of this sheet at rest (tests/references/torn.json) release 1.4 % more than the formula at G = Gc. Mass
damping holds back the legs and the sheet that follows them: it adds to the force, at 20 /s and 20 mm/s a tenth, at
5 /s and 10 mm/s 3 %, at the 1 /s here less than 1 %. Waves move the force by 6 %, and its mean by 1 %.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Outcome,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.device.checks import count, positive
from warp_pd.materials import tension_energy_density, with_wrinkles
from warp_pd.measures import TearLine, support_force, worst_balance
from warp_pd.scenes.pure_shear_tear import even_rows

WIDTH, LENGTH, CUT, THICKNESS, DENSITY, MU = 0.02, 0.06, 0.02, 1e-3, 1000.0, 1e3
LEG = 0.5 * WIDTH
# G by finite elements over that by the formula, when it is 4.2 J/m^2.
MORE = 1.014


def build(
    points: int = 40,
    horizon: float = 2.015,
    tearing_energy: float = 4.0,
    damage_length: float | None = None,
    speed: float = 0.01,
    duration: float = 3.6,
    damping: float = 1.0,
    frames: int = 150,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        points: Points along the width of both legs.
        speed: Speed of each end [m/s].
    """
    columns, energy = even_rows(points), positive("tearing_energy", tearing_energy)
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed")
    sheet = Sheet.filled(
        LENGTH, WIDTH, thickness=THICKNESS, density=DENSITY, points=(3 * columns - 2, columns),
        turn=turn, jitter=jitter, seed=seed,
    ).cut((-WIDTH, LEG), (CUT, LEG))  # fmt: skip
    x, y = sheet.points.T
    reach = positive("horizon", horizon) * sheet.spacing
    ends = [sheet.where(lambda x, y, s=s: (x < 1e-9) & (s * (y - LEG) > 0.0)) for s in (1.0, -1.0)]
    far = sheet.where(lambda x, y: x > LENGTH - reach)
    # Families at the ends are cut off and would tear first.
    spared = sheet.where(lambda x, y: (x < 2.0 * reach) | (x > LENGTH - reach))
    # Legs folded by a right angle at the tip.
    folded = np.zeros((sheet.size, 3))
    leg = x < CUT
    folded[leg, 0] = CUT - x[leg]
    folded[leg, 2] = np.where(y[leg] > LEG, 1.0, -1.0) * (CUT - x[leg])
    travel = positive("speed", speed) * positive("duration", duration)
    line = TearLine(sheet)
    tip, ahead = (CUT, LEG), (LENGTH, LEG)
    stretches = np.linspace(1.0, 6.0, 4000)
    density = tension_energy_density(material, stretches)
    pulls = LEG * THICKNESS * np.gradient(density, stretches)

    def pull(built, frame):
        up, down = (support_force(built, end)[2] for end in ends)
        return 0.5 * (up - down)

    def ratio(built, frame):
        force = max(pull(built, frame), 0.0)
        stretch = float(np.interp(force, pulls, stretches))
        stored = float(np.interp(stretch, stretches, density))
        return (2.0 * stretch * force / THICKNESS - WIDTH * stored) / energy

    def tearing(history):
        way = LENGTH - CUT
        whole = [row for row in history if row["pieces"] < 2]
        rows = [row["release_ratio"] for row in whole if 0.2 * way < row["tip"] < 0.6 * way]
        return float(np.mean(rows)) if len(rows) > 4 else None

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            *(
                Motion(end, times=[0.0, duration], x=CUT, y=0.0, z=[sign * CUT, sign * (CUT + travel)])
                for end, sign in zip(ends, (1.0, -1.0), strict=True)
            ),
            Fixed(far, "yz"),
        ],
        damage=TearingEnergy(energy, damage_length, spared=spared),
        initial_displacement=folded,
        solver=Explicit(duration=duration, frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("pull", "N", pull),
            Measure("release_ratio", "1", ratio),
            Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
            Measure("pieces", "1", lambda built, frame: line.pieces(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("tear_ratio", "1", tearing, 1.0 / MORE, "finite elements; by the formula of 1953 it is 1"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="Rivlin and Thomas 1953",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [fraction * history[-1]["time"] for fraction in (0.25, 0.5, 0.75, 1.0)])
    plots.surfaces(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "release.png", history, ["release_ratio"], ylabel="G / Gc", against="tip", xlabel="tip (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
