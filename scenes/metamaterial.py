"""A membrane with four rigid inclusions is stretched. VE paper, sections 6.4 and 6.8 (figures 15 to 18, 26 to 28).

0.5 x 0.5 x 0.01 m, four inclusions of radius r0 = 0.0625 m centred at (-2.5 r0, 0), (2.5 r0, 0), (0, -1.5 r0) and (0,
1.5 r0), polyurea of table 2, 120 x 120 points, horizon 3.015; with `crack` a crack of 0.1 m along x in the middle.
The sheet is stretched equally along x and y: to 1.5, or 1.2 with Prony term and crack.

The paper leaves some choices open. Here the size of the sheet is that of the other sections; the inclusions, 144 GPa in
the paper, are rigid; edges move as in visco_hole. Without failure, dynamic relaxation finds static equilibrium
(viscous: in time, at `rate`, with exaggerated density).
Failure: Gc 6.69 N/m and a stretch rate of 1 per microsecond, shown from 150 to 190 microseconds, would mean stretches
above 150, at 170 times the speed of sound and more. Here it is as in visco_crack, 205 /s or 159.4 /s, and Gc is read as
6.69 MN/m. `wrinkles` is that of visco_crack.
"""

import math

import numpy as np

from warp_pd import (
    CriticalEnergy,
    Explicit,
    Measure,
    Outcome,
    Prony,
    Relaxation,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.device.checks import InputError, one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.materials import WRINKLES, with_wrinkles
from warp_pd.measures import time_above
from warp_pd.parts import stretching_edges

SIZE, THICKNESS, RADIUS, CRACK = 0.5, 0.01, 0.0625, 0.1
CENTRES = ((-2.5 * RADIUS, 0.0), (2.5 * RADIUS, 0.0), (0.0, -1.5 * RADIUS), (0.0, 1.5 * RADIUS))
POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)


def build(
    points: int = 40,
    horizon: float = 3.015,
    law: str = "stress_free",
    viscous: bool = False,
    crack: bool = False,
    failure: bool = False,
    stretch: float | None = None,
    rate: float | None = None,
    energy: float = 6.69e6,
    density: float | None = None,
    tolerance: float | None = None,
    safety: float | None = None,
    wrinkles: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        law: "stress_free", or "published", which is under tension when undeformed.
        viscous: Whether the rubber has a Prony term; the sheet then moves in time.
        crack: Whether there is a crack of 0.1 m along x in the middle.
        failure: Whether bonds break.
        stretch: Stretch at the end [-]; None: 1.5, or 1.2 with Prony term and crack, or 6 with failure.
        rate: Rate of stretching [1/s]; None: 0.15, with failure 205, or 159.4 with a Prony term.
        energy: Tearing energy Gc of the bonds [N/m].
        density: Density [kg/m^3]; None: 2e6, and 1100 with failure.
        wrinkles: "relaxed", "resolved" or "auto", as in visco_crack.
    """
    if stretch is None:
        stretch = 6.0 if failure else 1.2 if viscous and crack else 1.5
    if positive("stretch", stretch) <= 1.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1")
    published = one_of("law", law, ("stress_free", "published")) == "published"
    if rate is None:
        rate = (159.4 if viscous else 205.0) if failure else 0.15
    moving = viscous or failure
    duration = (stretch - 1.0) / positive("rate", rate) if moving else 1.0
    density = positive("density", density or (1100.0 if failure else 2e6))
    # The published law's stress at a point depends on the complete families of its neighbours.
    outside = math.ceil(positive("horizon", horizon)) * (2 if published else 1)
    layers = (outside, outside)
    sheet = Sheet.rectangle(
        SIZE,
        SIZE,
        thickness=THICKNESS,
        density=density,
        points=points + points % 2,
        origin=(-0.25, -0.25),
        layers=layers,
    )
    if crack:
        sheet = sheet.cut((-0.5 * CRACK, 0.0), (0.5 * CRACK, 0.0))
    for centre in CENTRES:
        sheet = sheet.inclusion(centre, RADIUS)
    if one_of("wrinkles", wrinkles, ("auto", *WRINKLES)) == "auto":
        wrinkles = "relaxed" if failure and not published and not viscous else "resolved"
    if wrinkles == "relaxed" and (published or viscous):
        raise InputError("wrinkles = 'relaxed': expected 'resolved' with law 'published' or a Prony term")
    if safety is None:
        crushed = failure and not published and wrinkles == "resolved"
        safety = 0.005 if crushed else 0.02 if failure else 0.5
    material = with_wrinkles(POLYUREA, wrinkles)
    prony = (TERM,) if viscous else ()
    solver: Solver = Relaxation(tolerance=tolerance, load_steps=2, ramp_steps=10 * points)
    if moving:
        damping = 0.0 if failure else 2.0 * rate
        solver = Explicit(duration, frames=40 if failure else 20, damping=damping, safety=safety)
    force = (
        ViscoBondBased(POLYUREA, horizon, prony=prony) if published else Visco(material, horizon=horizon, prony=prony)
    )  # fmt: skip
    velocity = rate * sheet.points
    for members in sheet.inclusions:
        velocity[members] = velocity[members].mean(axis=0)
    spacing = sheet.spacing
    edge = sheet.where(lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 0.5 * SIZE - 1e-3 * spacing)
    layer = sheet.where(lambda x, y: (x > 0.5 * SIZE - 1e-9) & (np.abs(y) < 0.5 * SIZE + 1e-9))
    right, top = sheet.inclusions[1], sheet.inclusions[3]
    faces = [sheet.nearest(0.0, side * 0.5 * spacing) for side in (-1.0, 1.0)]
    measures = [
        Measure("stretch", "1", lambda built, frame: 1.0 + (stretch - 1.0) * frame.time / duration),
        Measure("side_inclusion_moves", "m", lambda built, frame: frame.displacement[right, 0].mean()),
        Measure("top_inclusion_moves", "m", lambda built, frame: frame.displacement[top, 1].mean()),
        Measure(
            "nominal_stress", "Pa",
            lambda built, frame: -built.to_numpy(built.state.force)[layer, 0].sum() / (SIZE * THICKNESS),
        ),
    ]  # fmt: skip
    if crack:
        measures.append(
            Measure(
                "crack_opening", "m",
                lambda built, frame: frame.displacement[faces[1], 1] - frame.displacement[faces[0], 1],
            )
        )  # fmt: skip
    outcomes = []
    if failure:
        outcomes = [Outcome("damage_begins", "s", time_above("largest_damage", 0.0)),
                    Outcome("half_damaged", "s", time_above("mean_damage", 0.5))]  # fmt: skip
    return Simulation(
        sheet,
        force=force,
        loads=stretching_edges(sheet, 0.5 * SIZE, [0.0, duration], [1.0, stretch]),
        damage=CriticalEnergy(energy, spared=edge) if failure else None,
        solver=solver,
        initial_velocity=np.column_stack([velocity, np.zeros(sheet.size)]) if moving else None,
        measures=measures,
        outcomes=outcomes,
        section="VE 6.4 and 6.8",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    times = [row["time"] for row in history]
    shown = plots.frames_at(folder, times[-1:])
    plots.from_above(folder / "displacement_x.png", shown, field="u1")
    plots.from_above(folder / "displacement_y.png", shown, field="u2")
    if "mean_damage" in history[0]:
        begin = next((k for k, row in enumerate(history) if row["largest_damage"] > 0.0), 0)
        chosen = [times[min(begin + k, len(times) - 1)] for k in (1, 3, 6, 10)]
        plots.reference(folder / "damage.png", plots.frames_at(folder, chosen), field="damage", limits=(0.0, 1.0))
