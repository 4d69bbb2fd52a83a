"""A crack that runs along a stretched strip, faster the more it is stretched. Rivlin and Thomas (1953).

The strip of `pure_shear_tear`, 6 H long with a cut of 1.5 H, is stretched until the energy release rate G = H W is
`overload` times the tearing energy Gc, and then let go: its cut opens, and the crack runs with the grips at rest. The
tip takes Gc; the rest of G goes into waves and damping. No crack in plane can pass the shear wave speed of the
stretched sheet, which for a neo-Hookean sheet in pure shear is sqrt(mu / rho) = 1 m/s at any stretch, measured in the
undeformed sheet.

`released_ratio` is the energy that broken bonds released over Gc times the new area, while the tip runs from 2 H to
5 H. It and `crack_length` include tears along the faces of the cut, which whip as it is let go.
"""

import numpy as np

from warp_pd import BondAssociated, Explicit, Measure, Motion, NeoHookean, Outcome, Simulation, TearingEnergy
from warp_pd.device.checks import InputError, count, positive
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, worst_balance
from warp_pd.scenes.pure_shear_tear import DENSITY, HEIGHT, MU, THICKNESS, stretch_at, strip
from warp_pd.shapes.roughness import rough_surface

LENGTH, CUT = 6.0 * HEIGHT, 1.5 * HEIGHT
BEGIN, END = 0.5 * HEIGHT, 3.5 * HEIGHT
WAVE_SPEED = (MU / DENSITY) ** 0.5


def build(
    points: int = 80,
    horizon: float = 2.015,
    wrinkles: str = "relaxed",
    tearing_energy: float = 4.0,
    damage_length: float | None = None,
    every_step: bool = False,
    overload: float = 2.0,
    duration: float = 0.6,
    damping: float = 1.0,
    frames: int = 120,
    roughness: float = 1e-3,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        every_step: Whether the damage is found closely enough for the speed of fast cracks, see TearingEnergy.
        points: Points along the height: rows.
        overload: Energy release rate of the stretched strip over the tearing energy, above 1 [-].
    """
    if positive("overload", overload) <= 1.0:
        raise InputError(f"overload = {overload!r}: expected a number greater than 1, otherwise the crack does not run")
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), wrinkles)
    sheet, top, bottom = strip(points, LENGTH, CUT, turn=turn, jitter=jitter, seed=seed)
    grips = np.concatenate([top, bottom])
    energy = positive("tearing_energy", tearing_energy)
    stretch = stretch_at(material, overload * energy / HEIGHT)
    travel = 0.5 * (stretch - 1.0) * HEIGHT
    stretched = rough_surface(sheet, roughness, seed, grips)
    stretched[:, 1] = (stretch - 1.0) * (sheet.points[:, 1] - 0.5 * HEIGHT)
    line = TearLine(sheet)
    tip, ahead = (CUT, 0.5 * HEIGHT), (LENGTH, 0.5 * HEIGHT)

    def running(history):
        rows = [row for row in history if BEGIN < row["tip"] < END]
        return rows if len(rows) > 4 else None

    def speed(history):
        rows = running(history)
        return rows and float(np.polyfit([row["time"] for row in rows], [row["tip"] for row in rows], 1)[0])

    def released(history):
        rows = running(history)
        return rows and (rows[-1]["rupture"] - rows[0]["rupture"]) / (
            energy * THICKNESS * (rows[-1]["tip"] - rows[0]["tip"])
        )

    def share_of_wave_speed(history):
        value = speed(history)
        return value and value / WAVE_SPEED

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            Motion(top, times=[0.0], x=0.0, y=[travel], z=0.0),
            Motion(bottom, times=[0.0], x=0.0, y=[-travel], z=0.0),
        ],
        damage=TearingEnergy(energy, damage_length, spared=grips, every_step=every_step),
        initial_displacement=stretched,
        solver=Explicit(duration=positive("duration", duration), frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("crack_speed", "m/s", speed),
            Outcome("share_of_wave_speed", "1", share_of_wave_speed),
            Outcome("released_ratio", "1", released, 1.0, "energy lost to tearing over Gc times new area"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"the strip is stretched to {stretch:.4g}; the shear wave speed is {WAVE_SPEED:.4g} m/s"],
        section="Rivlin and Thomas 1953",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    last = next((row["time"] for row in history if row["tip"] > END), history[-1]["time"])
    shown = plots.frames_at(folder, [fraction * last for fraction in (0.25, 0.6, 1.0)])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "tip.png", history, ["tip"], ylabel="advance of the tip (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
