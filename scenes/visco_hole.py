"""A sheet with a hole is stretched equally along x and y. VE paper, sections 6.2 and 6.6 (figures 9, 10, 20 and 21).

0.5 x 0.5 x 0.01 m, hole radius 0.08 m, polyurea of table 2, 100 x 100 points, horizon 3.015. Section 6.2 has no Prony
term and shows stretches of 4 and 7; section 6.6 (set viscous = True, stretch = 2.5 or 3) has one, and stretches at
0.15 /s. The paper shows pictures of the displacements, and that the hole stays round.

`law` is "stress_free", with static equilibrium by Newton's method, or "published", by dynamic relaxation. With
`viscous` both move in time, and the density is exaggerated as in visco_sheet. Edges move as in a uniform sheet: the
paper does not say which components its boundary layers leave free.

`rim` is "circle", points on the hole and on the edges, or "staircase", the cells of a square grid that are left, as in
the paper, with layers of points outside that move as in a uniform sheet. The published law needs complete families at
the edges, so it takes the staircase. The references are membrane finite elements. Defaults are for two CPU cores.
"""

import math

import numpy as np

from warp_pd import (
    BondAssociated,
    Circle,
    Explicit,
    Fixed,
    Measure,
    Newton,
    Outcome,
    Prony,
    Relaxation,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.device.checks import InputError, count, one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.measures import worst_balance
from warp_pd.parts import stretching_edges

SIZE, THICKNESS, RADIUS = 0.5, 0.01, 0.08
POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)
# Growth of the radius and nominal stress [Pa] without Prony term, by stretch: tests/references/visco.json.
GROWTH = {1.5: 2.35978, 2.0: 3.36655, 2.5: 4.27650, 3.0: 5.15867, 4.0: 6.89779, 7.0: 12.07659}
STRESS = {1.5: 0.583408e6, 2.0: 1.22357e6, 2.5: 2.17514e6, 3.0: 3.54166e6, 4.0: 7.8698e6, 7.0: 39.7095e6}


def build(
    points: int = 31,
    horizon: float = 3.015,
    law: str = "stress_free",
    viscous: bool = False,
    stretch: float = 4.0,
    rate: float = 0.15,
    density: float = 2e6,
    load_steps: int = 12,
    tolerance: float | None = None,
    safety: float = 0.5,
    rim: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        law: "stress_free", by Newton's method, or "published", by dynamic relaxation.
        viscous: Whether the rubber has a Prony term; the sheet then moves in time.
        rate: Rate of stretching [1/s].
    """
    if not 1.0 < positive("stretch", stretch) <= 10.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1 and at most 10")
    published = one_of("law", law, ("stress_free", "published")) == "published"
    duration = (stretch - 1.0) / positive("rate", rate) if viscous else 1.0
    if one_of("rim", rim, ("auto", "circle", "staircase")) == "auto":
        rim = "staircase" if published else "circle"
    if rim == "circle" and published:
        raise InputError(
            "rim = 'circle': expected 'staircase' with law 'published', which needs points outside the edges"
        )
    positive("horizon", horizon)
    sheet = outlined(points, density) if rim == "circle" else stepped(points, density, horizon, 2 if published else 1)
    inner = np.hypot(*sheet.points.T) < RADIUS + 0.8 * sheet.spacing
    angle = np.arctan2(sheet.points[inner, 1], sheet.points[inner, 0])
    layer = sheet.where(lambda x, y: (x > 0.5 * SIZE - 1e-9) & (np.abs(y) < 0.5 * SIZE + 1e-9))
    prony = (TERM,) if viscous else ()
    solver: Solver = Newton(tolerance=tolerance, load_steps=load_steps)
    if viscous:
        solver = Explicit(duration, frames=20, damping=2.0 * rate, safety=safety)
    elif published:
        solver = Relaxation(tolerance=tolerance, load_steps=load_steps, ramp_steps=10 * points)
    force = (
        BondAssociated(POLYUREA, horizon=horizon) if not published else ViscoBondBased(POLYUREA, horizon, prony=prony)
    )
    if viscous and not published:
        force = Visco(POLYUREA, prony=prony, horizon=horizon)

    def growth(frame):
        """Growth of the hole's radius, and how much more it grows along the axes than on average.

        The points at the edge of the hole are not all at its radius: a linear fit in the distance corrects for that.
        """
        place = np.hypot(*sheet.points[inner].T)
        moved = sheet.points[inner] + frame.displacement[inner, :2]
        terms = np.column_stack([np.ones_like(place), place - RADIUS, np.cos(4.0 * angle)])
        mean, _, harmonic = np.linalg.lstsq(terms, np.hypot(*moved.T) / RADIUS, rcond=None)[0]
        return mean, harmonic / mean

    grown, pulled = (None, None) if viscous else (GROWTH.get(stretch), STRESS.get(stretch))
    return Simulation(
        sheet,
        force=force,
        loads=[Fixed(range(sheet.size), "z"), *stretching_edges(sheet, 0.5 * SIZE, [0.0, duration], [1.0, stretch])],
        solver=solver,
        initial_velocity=np.column_stack([rate * sheet.points, np.zeros(sheet.size)]) if viscous else None,
        measures=[
            Measure("stretch", "1", lambda built, frame: 1.0 + (stretch - 1.0) * frame.time / duration),
            Measure("hole_growth", "1", lambda built, frame: growth(frame)[0], grown, "membrane finite elements"),
            Measure("squareness", "1", lambda built, frame: growth(frame)[1]),
            Measure(
                "nominal_stress", "Pa",
                lambda built, frame: -built.to_numpy(built.state.force)[layer, 0].sum() / (SIZE * THICKNESS),
                pulled, "membrane finite elements",
            ),
        ],
        outcomes=[Outcome("worst_energy_balance", "1", worst_balance)] if viscous and not published else [],
        section="VE 6.2 and 6.6",
        pictures=pictures,
    )  # fmt: skip


def outlined(points: int, density: float) -> Sheet:
    """The sheet with points on its edges and on the circle of the hole."""
    return Sheet.outline(
        [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)],
        spacing=SIZE / (count("points", points, 2) - 1),
        thickness=THICKNESS,
        density=positive("density", density),
        holes=[Circle((0.0, 0.0), RADIUS)],
    )


def stepped(points: int, density: float, horizon: float, families: int) -> Sheet:
    """The sheet of cells, with layers of points outside; their width is `families` families."""
    # The published law's stress at a point depends on the complete families of its neighbours.
    layers = 2 * (math.ceil(horizon) * families,)
    return Sheet.rectangle(
        SIZE, SIZE, thickness=THICKNESS, density=density, points=points, origin=(-0.25, -0.25), layers=layers
    ).hole((0.0, 0.0), RADIUS)


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "displacement_x.png", shown, field="u1")
    plots.from_above(folder / "displacement_y.png", shown, field="u2")
    plots.curves(
        folder / "stress.png", history, ["nominal_stress"], ylabel="nominal stress (Pa)", against="stretch",
        xlabel="stretch",
    )  # fmt: skip
