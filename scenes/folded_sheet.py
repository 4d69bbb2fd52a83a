"""A strip of rubber falls on its end, on the floor and on itself, and folds.

A strip of 0.1 x 0.02 m (bond-based, 0.3 MPa, 0.5 mm thick) hangs upright with its lower end just above a smooth
floor, bent a little to one side and to the other, and falls under gravity. It has no stiffness against bending but that
of its spacing, so it folds to and fro like honey. Without self-contact the folds would pass through each other.

`clearance` is the smallest distance of two points whose reference distance is above three spacings, over the spacing:
contact keeps it well above zero. Mass damping stands for the losses of the rubber and of the air.
"""

import numpy as np
from scipy.spatial import cKDTree

from warp_pd import (
    Bimodular,
    BodyForce,
    BodyPath,
    BondBased,
    Explicit,
    Measure,
    Outcome,
    Plane,
    RigidBody,
    SelfContact,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import positive
from warp_pd.measures import worst_balance

YOUNG, THICKNESS, DENSITY, GRAVITY = 3e5, 5e-4, 1000.0, 9.81
WAVES = 2.5


def build(
    points: int = 81,
    horizon: float = 2.015,
    duration: float = 0.25,
    frames: int = 100,
    damping: float = 5.0,
    friction: float = 0.3,
    self_contact: bool = True,
    safety: float = 0.6,
) -> Simulation:
    length, width = 0.1, 0.02
    spacing = length / (positive("points", points) - 1)
    sheet = Sheet.rectangle(length, width, thickness=THICKNESS, density=DENSITY, points=points)
    # Upright: x becomes the length of a wave line of height z, which bends the strip and does not stretch it.
    turns, slope = 2.0 * np.pi * WAVES / length, 0.5
    line = np.linspace(0.0, length, 10_001)
    rise = np.sqrt(1.0 - (slope * np.cos(turns * line)) ** 2)
    height = np.concatenate([[0.0], np.cumsum(0.5 * (rise[1:] + rise[:-1]) * np.diff(line))])
    x, y = sheet.points.T
    wave = slope / turns * np.sin(turns * x)
    place = np.column_stack([wave, y, np.interp(x, line, height) + 2.0 * spacing])
    contacts = [
        RigidBody(Plane(), BodyPath.still((0.0, 0.0, 0.0)), name="floor"),
        *([SelfContact(stiffness=0.13 * YOUNG * THICKNESS, friction=friction)] if self_contact else []),
    ]
    pairs = Clearance(sheet)
    return Simulation(
        sheet,
        force=BondBased(Bimodular(YOUNG), horizon=horizon),
        loads=[BodyForce((0.0, 0.0, -DENSITY * GRAVITY))],
        contact=contacts,
        solver=Explicit(duration, frames=frames, damping=damping, safety=safety),
        initial_displacement=place - sheet.positions,
        measures=[
            Measure("height", "m", lambda built, frame: (sheet.positions + frame.displacement)[:, 2].max()),
            Measure("clearance", "1", lambda built, frame: pairs.smallest(frame)),
        ],
        outcomes=[
            Outcome("smallest_clearance", "1", lambda history: min(row["clearance"] for row in history)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="own strip",
        pictures=pictures,
    )


class Clearance:
    """Distances of points that are far from each other along the sheet."""

    def __init__(self, sheet):
        self.sheet = sheet

    def smallest(self, frame):
        """Smallest distance of two points with a reference distance above three spacings, over the spacing, up to 3."""
        spacing = self.sheet.spacing
        place = self.sheet.positions + frame.displacement
        pairs = cKDTree(place).query_pairs(3.0 * spacing, output_type="ndarray")
        apart = np.linalg.norm(np.subtract(*self.sheet.points[pairs.T]), axis=1) > 3.0 * spacing
        near = np.linalg.norm(np.subtract(*place[pairs[apart].T]), axis=1)
        return min(3.0, near.min(initial=np.inf) / spacing)


def pictures(history, folder):
    from warp_pd.viewer import plots

    duration = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * duration for fraction in (0.0, 0.4, 0.7, 1.0)])
    plots.surfaces(folder / "folded.png", shown, field="u3")
    plots.curves(folder / "height.png", history, ["height"], ylabel="height (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
