"""Two strips that overlap are glued and pulled apart: the glue breaks in shear from both ends. Kendall (1975).

Two strips, 80 mm long and 1 mm thick, mu 0.1 MPa, overlap by 50 mm. One end is held, the other is pulled away slowly;
all points stay in the plane and are held along y. Ahead of the crack both strips share the force, behind it one bears
all. When a crack in the glue grows by dc at the force F, a length dc changes from the one to the other, and

    G = [stretch F / b - h W(stretch)] of one strip under F - 2 [stretch F / (2 b) - h W(stretch)] of each under F / 2,

with the width b, the thickness h and the energy G of the glue in shear per area: F = 2 b sqrt(E h G) for small strains.
`largest_load` is F while the overlap is much longer than the zone that breaks, some sqrt(2 E h G) / strength.
`released_ratio` is the energy lost to the glue over G and its area.
"""

import numpy as np
from scipy.optimize import brentq

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Joint,
    Measure,
    Motion,
    NeoHookean,
    Outcome,
    Sheet,
    Simulation,
    together,
)
from warp_pd.device.checks import positive
from warp_pd.measures import at_peak, support_force, worst_balance
from warp_pd.scenes.peel import DENSITY, MU, ROWS, THICKNESS

LENGTH, OVERLAP = 0.08, 0.05


def build(
    points: int = 65,
    horizon: float = 2.015,
    energy: float = 5.0,
    strength: float = 4e3,
    pull: float = 0.06,
    speed: float = 0.05,
    damping: float = 20.0,
    frames: int = 200,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along a strip.
        energy: Energy of the glue, in peel and shear [J/m^2].
        strength: Its strength in shear [Pa].
        pull: Way of the end [m].
        speed: Its speed [m/s].
    """
    width = LENGTH / (points - 1) * (ROWS - 1)
    strip = Sheet.rectangle(LENGTH, width, thickness=THICKNESS, density=DENSITY, points=(points, ROWS))
    sheet = together(strip, strip)
    shift = [LENGTH - OVERLAP - (sheet.origins[1, 0] - sheet.origins[0, 0]), 0.0, 0.0]
    start = np.where((sheet.pieces == 2)[:, None], shift, 0.0)
    first, second = sheet.edges("sheet 1"), sheet.edges("sheet 2")
    held, pulled = first[strip.edges("left")], second[strip.edges("right")]
    glue = Joint(second, first, energy=positive("energy", energy), shear_strength=strength)
    begin, way = float(start[pulled[0], 0]), positive("pull", pull)
    area = float(sheet.areas[second][strip.points[:, 0] <= OVERLAP * (1.0 + 1e-9)].sum())

    def released_ratio(history):
        return history[-1]["joint_released"] / (energy * area)

    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(MU, 100.0 * MU), horizon=horizon),
        loads=[
            Fixed(held),
            Fixed(np.setdiff1d(np.arange(sheet.size), held), "yz"),
            Motion(pulled, [0.0, way / positive("speed", speed)], x=[begin, begin + way]),
            glue,
        ],
        initial_displacement=start,
        solver=Explicit(way / speed, frames=frames, damping=damping),
        measures=[
            Measure("pull", "m", lambda built, frame: frame.displacement[pulled, 0].mean() - begin),
            Measure("load", "N", lambda built, frame: support_force(built, pulled)[0]),
        ],
        outcomes=[
            Outcome(
                "largest_load",
                "N",
                at_peak("load", "load"),
                width * breaking_force(energy),
                "energy balance of a crack",
            ),
            Outcome("released_ratio", "1", released_ratio, 1.0, "energy of the glue times its area"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="Kendall 1975",
        pictures=pictures,
    )


def breaking_force(energy):
    """Force over width [N/m] at which a long overlap breaks."""

    def complementary(tension):
        stretch = brentq(lambda stretch: MU * THICKNESS * (stretch - stretch**-3) - tension, 1.0, 100.0)
        return stretch * tension - 0.5 * MU * THICKNESS * (stretch**2 + stretch**-2 - 2.0)

    def released(force):
        return (complementary(force) - force) - 2.0 * (complementary(0.5 * force) - 0.5 * force)

    return brentq(lambda force: released(force) - energy, 1e-3 * MU * THICKNESS, 50.0 * MU * THICKNESS)


def pictures(history, folder):
    from warp_pd.viewer import plots

    loads = [row["load"] for row in history]
    shown = plots.frames_at(
        folder, [history[k]["time"] for k in (int(0.8 * np.argmax(loads)), int(np.argmax(loads)), -1)]
    )
    plots.from_above(folder / "glue.png", shown, field="joint_damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "load.png", history, ["load"], ylabel="force (N)", against="pull", xlabel="way of the end (m)"
    )
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
