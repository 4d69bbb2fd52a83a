"""A strip with a hole is pulled; one displacement field and the force determine the constants of an Ogden material.

100 x 50 mm, 1 mm thick, a hole of radius 10 mm in the middle, both short edges in grips. The rubber is Ogden's with one
term (mu1, a1), or two if mu2 is not 0. Around the hole the sheet is in uniaxial tension, pure shear and all states
between, so one displacement field contains all of them. Displacements alone determine the exponents and the ratio of
the moduli; their magnitude needs the force.

    warp-pd fit holed_strip picture.csv force.csv --vary mu1,a1

with columns stretch, x, y, u, v in the picture (places and displacements from a camera, digital image correlation) and
stretch, edge_force in the other file (docs/fitting.md). `stretch` is the distance of the grips divided by the initial
distance.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Circle,
    Fixed,
    InputError,
    Measure,
    Motion,
    Newton,
    Ogden,
    Polygon,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import finite, positive
from warp_pd.fitting import SupportForce

LENGTH, WIDTH, RADIUS, THICKNESS, DENSITY = 0.1, 0.05, 0.01, 1e-3, 1000.0


def build(
    points: int = 41,
    horizon: float = 2.015,
    mu1: float = 0.5e6,
    a1: float = 1.6,
    mu2: float = 0.0,
    a2: float = 5.0,
    stretch: float = 1.8,
    load_steps: int = 4,
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        mu1: Constant mu of the first Ogden term [Pa].
        a1: Exponent of the first Ogden term [-].
        mu2: Constant mu of the second Ogden term [Pa]; 0: there is one term.
        a2: Exponent of the second Ogden term [-].
    """
    if not 1.0 < finite("stretch", stretch) <= 4.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1 and at most 4")
    terms = ((mu1, a1),) if mu2 == 0.0 else ((mu1, a1), (mu2, a2))
    corners = [(0.0, 0.0), (LENGTH, 0.0), (LENGTH, WIDTH), (0.0, WIDTH)]
    sheet = Sheet.outline(
        Polygon(corners),
        spacing=LENGTH / (positive("points", points) - 1),
        thickness=THICKNESS,
        density=DENSITY,
        holes={"hole": Circle((0.5 * LENGTH, 0.5 * WIDTH), RADIUS)},
    )
    left, right = sheet.edges("left"), sheet.edges("right")
    others = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    return Simulation(
        sheet,
        force=BondAssociated(Ogden(*zip(*terms, strict=True)), horizon=horizon, weights="corrected"),
        loads=[
            Fixed(left),
            Fixed(others, "z"),
            Motion(right, times=[0.0, 1.0], x=[0.0, (stretch - 1.0) * LENGTH], y=0.0, z=0.0),
        ],
        solver=Newton(tolerance=tolerance, load_steps=load_steps),
        measures=[
            Measure("stretch", "1", lambda built, frame: 1.0 + (stretch - 1.0) * frame.time),
            Measure("edge_force", "N", SupportForce(right, "x")),
        ],
        section="own strip",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "strip.png", shown, field="u1", label="u1 (m)")
    plots.curves(folder / "force.png", history, ["edge_force"], ylabel="force (N)", against="stretch", xlabel="stretch")
