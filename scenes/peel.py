"""A strip is peeled off another one, or two glued strips are peeled apart. Rivlin (1944), Kendall (1975).

Two strips, 60 mm long and 1 mm thick, mu 0.1 MPa, are glued face to face but for the first 10 mm. With `kind` = "T"
their ends are pulled apart, up and down; with "180" the lower strip is held, the end of the upper one is folded back
and pulled along. All points are held along y, so that the strips are in pure shear.

When a length dc peels off, an end moves by stretch dc, at 180 degrees by (stretch + 1) dc, under the force F, and a
length dc of each free strip is stretched. So the energy G of the glue per area gives the steady force,

    T:  2 stretch F / b - 2 h W(stretch) = G,          180 degrees:  (stretch + 1) F / b - h W(stretch) = G,

with the width b, the thickness h, and the stretch and the energy density W of a strip under F. Strips that do not
stretch have F / b = G / 2 in both, Rivlin's G / (1 - cos angle). `force` is the work of the ends over their way in the
second half of the peel. Nothing is tuned: the force does not depend on the strength of the glue, if the spacing
resolves the zone that breaks.
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
from warp_pd.device.checks import one_of, positive
from warp_pd.measures import support_force, worst_balance

MU, LENGTH, FREE, THICKNESS, DENSITY = 1e5, 0.06, 0.01, 1e-3, 1000.0
ROWS = 4
# Height of the folded strip at its end, and of the arc on which it gets there, over the free length.
CLEAR, ARC = 0.2, 0.6


def build(
    points: int = 41,
    horizon: float = 2.015,
    kind: str = "T",
    energy: float = 100.0,
    strength: float | None = None,
    peel: float = 0.03,
    speed: float = 0.05,
    damping: float = 20.0,
    frames: int = 200,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along a strip.
        kind: "T" or "180".
        energy: Energy to peel the glue [J/m^2].
        strength: Its strength [Pa]; by default that of Joint.
        peel: Length that is peeled [m].
        speed: Speed of the ends [m/s].
    """
    one_of("kind", kind, ("T", "180"))
    spacing = LENGTH / (points - 1)
    width = spacing * (ROWS - 1)
    strip = Sheet.rectangle(LENGTH, width, thickness=THICKNESS, density=DENSITY, points=(points, ROWS))
    sheet = together(strip, strip)
    start = np.where((sheet.pieces == 2)[:, None], [*-(sheet.origins[1] - sheet.origins[0]), 0.0], 0.0)
    place = (sheet.positions + start)[:, 0]
    lower, upper = (sheet.edges(f"sheet {number}") for number in (1, 2))
    low_end, end = (points[place[points] < 0.5 * spacing] for points in (lower, upper))
    stretch, pull = steady_state(kind, positive("energy", energy))
    if kind == "T":
        way = stretch * (FREE + positive("peel", peel))
        times = [0.0, way / positive("speed", speed)]
        loads = [
            Fixed(np.arange(sheet.size), "y"),
            Motion(low_end, times, z=[0.0, -way]),
            Motion(end, times, z=[0.0, way]),
        ]
    else:
        angle = np.linspace(0.0, np.pi, 9)
        way = 2.0 * FREE + (stretch + 1.0) * positive("peel", peel)
        x = [*(FREE * (1.0 - np.cos(angle))), way]
        z = [*np.maximum(ARC * FREE * np.sin(angle), CLEAR * FREE * angle / np.pi), CLEAR * FREE]
        times = np.append(angle / np.pi * 2.0 * FREE, way) / positive("speed", speed)
        loads = [Fixed(lower), Fixed(upper, "y"), Motion(end, times, x=list(start[end[0], 0] + np.array(x)), z=z)]
    glue = Joint(upper[place[upper] > FREE + 0.5 * spacing], lower, energy=energy, strength=strength)

    def travel(built, frame):
        """Way that the ends have moved apart, or the end has moved along the strip [m]."""
        moved = frame.displacement - start
        if kind == "T":
            return moved[end, 2].mean() - moved[low_end, 2].mean()
        return moved[end, 0].mean()

    def force(history):
        half = [row for row in history if row["time"] >= 0.5 * history[-1]["time"]]
        way = half[-1]["travel"] - half[0]["travel"]
        return (half[-1]["external"] - half[0]["external"]) / way if way > 0.0 else None

    axis = 2 if kind == "T" else 0
    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(MU, 100.0 * MU), horizon=horizon),
        loads=[*loads, glue],
        initial_displacement=start,
        solver=Explicit(float(times[-1]), frames=frames, damping=damping),
        measures=[
            Measure("travel", "m", travel),
            Measure("pull", "N", lambda built, frame: support_force(built, end)[axis]),
        ],
        outcomes=[
            Outcome("force", "N", force, pull * width, "Rivlin 1944, with the energy of the stretched strips"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"stretch of the free strips {stretch:.4g}; without stretch the force is {0.5 * energy * width:.4g} N"],
        section="Rivlin 1944",
        pictures=pictures,
    )


def steady_state(kind, energy):
    """Stretch of a free strip [-] and force over width [N/m] of a steady peel."""

    def tension(stretch):
        return MU * THICKNESS * (stretch - stretch**-3)

    def released(stretch):
        stored = 0.5 * MU * THICKNESS * (stretch**2 + stretch**-2 - 2.0)
        return (
            2.0 * (tension(stretch) * stretch - stored) if kind == "T" else tension(stretch) * (stretch + 1.0) - stored
        )

    stretch = float(brentq(lambda stretch: released(stretch) - energy, 1.0, 10.0))
    return stretch, tension(stretch)


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [0.4 * history[-1]["time"], history[-1]["time"]])
    plots.surfaces(folder / "peel.png", shown, field="joint_damage", limits=(0.0, 1.0), view=(8.0, -80.0))
    plots.curves(
        folder / "pull.png", history, ["pull"], ylabel="force (N)", against="travel", xlabel="way of the ends (m)"
    )
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
