"""A blade cuts a stretched strip. Cutting energy per torn area (Lake and Yeoh, 1978).

The strip is that of `pure_shear_tear`: height H = 40 mm, thickness h = 1 mm, mu 1 kPa, with a cut along its middle. It
is stretched across the cut, which opens. The energy release rate G = H W(stretch) is `opening` times the tearing energy
Gc, too small for a tear. A blade then moves along the cut at constant speed. It is a frictionless wire of diameter
`blade`, perpendicular to the sheet and thinner than the spacing; triangles of the sheet have contact with it
(`surface=True`). While the blade moves by da, it does the work F da, and the strip releases the energy G h da. A sharp
blade would need only Gc for each torn area h da, so

    cutting energy = F / h + G >= Gc.

G. J. Lake and O. H. Yeoh, Measurement of rubber cutting resistance in the absence of friction, Int. J. Fracture 14
(1978) 509. `cutting_energy` is the mean cutting energy divided by Gc over the middle half of the blade's path: 1.21,
1.13 and 1.12 with 20, 30 and 40 rows. A faster blade needs more energy because it causes waves.
"""

import numpy as np

from warp_pd import (
    BodyPath,
    BondAssociated,
    Capsule,
    Explicit,
    Measure,
    Motion,
    NeoHookean,
    Outcome,
    RigidBody,
    Simulation,
    TearingEnergy,
)
from warp_pd.device.checks import InputError, below_one, count, positive
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, worst_balance
from warp_pd.scenes.pure_shear_tear import CUT, HEIGHT, LENGTH, MU, THICKNESS, stretch_at, strip


def build(
    points: int = 40,
    horizon: float = 2.015,
    tearing_energy: float = 2.0,
    damage_length: float | None = None,
    opening: float = 0.5,
    blade: float = 5e-4,
    speed: float = 0.1,
    travel: float = 0.05,
    pull: float = 0.5,
    damping: float = 5.0,
    frames: int = 160,
    safety: float = 0.4,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the height: rows.
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        opening: Energy release rate of the stretched strip divided by the tearing energy [-].
        blade: Diameter of the blade [m].
        speed: Speed of the blade [m/s]; the wave speed is about 1 m/s.
        travel: How far the blade moves beyond the tip of the cut [m].
        pull: Duration of stretching [s].
    """
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed")
    sheet, top, bottom = strip(points, LENGTH, CUT)
    grips = np.concatenate([top, bottom])
    energy, opened = positive("tearing_energy", tearing_energy), below_one("opening", opening)
    stretch = stretch_at(material, opened * energy / HEIGHT)
    apart = 0.5 * (stretch - 1.0) * HEIGHT
    # The blade waits inside the cut until the strip is stretched.
    if positive("travel", travel) >= LENGTH - CUT:
        raise InputError(f"travel = {travel!r}: expected less than {LENGTH - CUT:.4g} m, where the strip ends")
    start, end, middle = 0.8 * CUT, CUT + travel, 0.5 * HEIGHT
    ready = positive("pull", pull)
    duration = ready + (end - start) / positive("speed", speed)
    path = BodyPath([0.0, ready, duration], [(x, middle, 0.0) for x in (start, start, end)])
    wire = RigidBody(Capsule(positive("blade", blade), 0.02), path, name="blade", surface=True)
    line = TearLine(sheet)

    def cut_length(built, frame):
        return line.reach(frame.intact_faces, (CUT, middle), (LENGTH, middle))

    def cutting_energy(history):
        rows = [row for row in history if 0.25 * travel < row["blade_position_x"] - CUT < 0.75 * travel]
        if not rows:
            return None
        force = -float(np.mean([row["blade_force_x"] for row in rows]))
        return force / (energy * THICKNESS) + opened

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            Motion(top, times=[0.0, ready], x=0.0, y=[0.0, apart], z=0.0),
            Motion(bottom, times=[0.0, ready], x=0.0, y=[0.0, -apart], z=0.0),
        ],
        contact=wire,
        damage=TearingEnergy(energy, length=damage_length, spared=grips),
        solver=Explicit(duration, frames=count("frames", frames, 1), damping=damping, safety=safety),
        measures=[Measure("cut_length", "m", cut_length)],
        outcomes=[
            Outcome("cutting_energy", "1", cutting_energy, 1.0, "a sharp blade without friction: Gc"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"Gc = {energy:.4g} J/m^2; the strip is stretched to {stretch:.4g}"],
        section="Lake and Yeoh 1978",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    last = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * last for fraction in (0.5, 0.75, 1.0)])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "force.png", history, ["blade_force_x"], ylabel="force on the blade (N)")
