"""A visco-hyperelastic sheet is stretched equally along x and y. VE paper, sections 6.1 and 6.5 (figures 6, 7 and 19).

0.5 x 0.5 x 0.01 m, 100 x 100 points, horizon 3.015, polyurea of table 2: c10 0.1996, c20 0.0170 MPa, one Prony term
0.01733, 0.0015 MPa, phi_ref 0.9466, eta 1.6665. Section 6.1 has no Prony term and goes to a stretch of 4 (set viscous
= False, stretch = 4), section 6.5 goes to 2.5 at 0.15 /s. The paper compares with its own finite elements in pictures.
Its displacement at the corner is (stretch - 1) 0.25 m for any material. Its stresses at (-0.165, 0.125) m are
given only as differences: hyperelastic above visco-hyperelastic by 24 kPa at 1.25 and 1.2 MPa at 2.5, although the
force of its eq. 62 adds the viscous part to the hyperelastic one. At 2.5 its own viscous constants allow at most
0.15 MPa. The reference here is the exact response of each law for a homogeneous sheet.

`law` is "stress_free" (Visco) or "published" (ViscoBondBased), which is under tension when undeformed. Edges and layers
of points outside them, one horizon wide (two for the published law), move as in a uniform sheet, and the sheet starts
with the velocity of uniform stretching. Stress is that of eq. 78 at the paper's point. The paper does not give its
density; here it is exaggerated, `density`, so that steps are long; `kinetic_share` measures the remaining inertia.
Defaults are for two CPU cores.
"""

import math

import numpy as np

from warp_pd import Explicit, Measure, Outcome, Prony, Sheet, Simulation, Visco, ViscoBondBased, Yeoh
from warp_pd.device.checks import InputError, one_of, positive
from warp_pd.measures import virial_stress, worst_balance
from warp_pd.papers.analytic_response import nominal_stress, published_stress
from warp_pd.parts import stretching_edges

SIZE, THICKNESS = 0.5, 0.01
POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)
LAWS = {"stress_free": Visco, "published": ViscoBondBased}


def build(
    points: int = 31,
    horizon: float = 3.015,
    law: str = "stress_free",
    viscous: bool = True,
    stretch: float = 2.5,
    rate: float = 0.15,
    density: float = 2e6,
    safety: float = 0.5,
) -> Simulation:
    """Build the scene.

    Args:
        law: "stress_free", or "published", which is under tension when undeformed.
        viscous: Whether the rubber has a Prony term; the sheet then moves in time.
        rate: Rate of stretching [1/s].
    """
    if positive("stretch", stretch) <= 1.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1")
    duration = (stretch - 1.0) / positive("rate", rate)
    prony = (TERM,) if viscous else ()
    published = one_of("law", law, LAWS) == "published"
    # The published law's stress at a point depends on the complete families of its neighbours.
    outside = math.ceil(positive("horizon", horizon)) * (2 if published else 1)
    layers = (outside, outside)
    sheet = Sheet.rectangle(
        SIZE, SIZE, thickness=THICKNESS, density=density, points=points, origin=(-0.25, -0.25), layers=layers
    )
    right = sheet.nearest(0.25, 0.0)
    middle = sheet.nearest(-0.165, 0.125)
    velocity = np.column_stack([rate * sheet.points, np.zeros(sheet.size)])
    time = np.linspace(0.0, duration, 4001)
    path = 1.0 + rate * time
    exact = (
        published_stress(POLYUREA, prony, time, path)
        if published
        else nominal_stress(POLYUREA, prony, time, path, path)
    )
    elastic = (
        published_stress(POLYUREA, (), time, path) if published else nominal_stress(POLYUREA, (), time, path, path)
    )
    source = "exact convolution, homogeneous sheet"

    def kinetic_share(built, frame):
        """Kinetic energy of the deviation from uniform stretching, divided by the work of the full load."""
        uneven = frame.velocity - velocity
        energy = 0.5 * (built.to_numpy(built.state.mass)[:, None] * uneven**2).sum()
        return energy / (SIZE**2 * THICKNESS * 2.0 * np.trapezoid(exact, path))

    def viscous_stress(built, frame):
        """The relaxing part of the nominal stress at the point, from the internal variables of its bonds [Pa]."""
        now = 1.0 + rate * frame.time
        if not published:
            return now * built.to_numpy(built.law.state)[: built.law.families.members, middle, 0].mean()
        gamma = built.to_numpy(built.law.internal["viscous_stretch"])[:, middle].mean()
        return 2.0 * (TERM.c10 + 4.0 * TERM.c20 * (now**2 - 1.0)) * gamma

    viscous_measure = [Measure("viscous_stress", "Pa", viscous_stress, exact[-1] - elastic[-1], source)] * viscous
    return Simulation(
        sheet,
        force=LAWS[law](POLYUREA, prony=prony, horizon=horizon),
        loads=stretching_edges(sheet, 0.5 * SIZE, [0.0, duration], [1.0, stretch]),
        solver=Explicit(duration, frames=20, damping=2.0 * rate, safety=safety),
        initial_velocity=velocity,
        measures=[
            Measure("stretch", "1", lambda built, frame: 1.0 + frame.displacement[right, 0] / 0.25),
            Measure(
                "nominal_stress", "Pa", lambda built, frame: virial_stress(built, middle)[0, 0], exact[-1], source
            ),
            Measure("displacement_at_point", "m", lambda built, frame: frame.displacement[middle, 0],
                    (stretch - 1.0) * sheet.points[middle, 0], "uniform stretch"),
            Measure("kinetic_share", "1", kinetic_share),
            *viscous_measure,
        ],
        outcomes=[Outcome("worst_energy_balance", "1", worst_balance)],
        section="VE 6.1 and 6.5",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "displacement.png", shown, field="u1")
    plots.curves(
        folder / "stress.png", history, ["nominal_stress", "viscous_stress"], ylabel="nominal stress (Pa)",
        against="stretch", xlabel="stretch",
    )  # fmt: skip
