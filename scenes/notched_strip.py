"""A membrane strip with a notch is torn and wrinkles next to the crack. IM paper, section 6.5 (figure 21).

0.1 x 0.04 x 0.001 m, a notch of 6 mm in the middle of the lower edge, 200 x 80 points, horizon of 3 spacings, E+ 1e5
Pa, nu 1/3, no compressive modulus; the ends move apart by Ux each, bonds break at a strain of 6e-3. The paper shows
crack and wrinkle level at Ux = 2.1, 2.4, 2.7 and 3.0e-4 m, without numbers; the membrane next to the crack is slack.

One load step goes to `start`, the others continue to 3.0e-4 m by `increment` (the paper's smallest: 1e-6 m). In every
load step the solver finds static equilibrium, breaks the overstretched bonds, and repeats this until no bond breaks.
The ends are free to contract; the middle of each keeps its height.
"""

import math

import numpy as np

from warp_pd import (
    Bimodular,
    BondBased,
    CriticalStretch,
    Fixed,
    Measure,
    Motion,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.checks import InputError, count, one_of, positive
from warp_pd.measures import TearLine, largest, support_force, when_above
from warp_pd.solvers import Solver

WIDTH, HEIGHT, NOTCH, TRAVEL = 0.1, 0.04, 6e-3, 3.0e-4
SHOWN = (2.1e-4, 2.4e-4, 2.7e-4, 3.0e-4)


def build(
    points: int = 200,
    horizon: float = 3.0,
    critical_strain: float = 6e-3,
    start: float = 1.0e-4,
    increment: float = 5e-6,
    solver: str = "newton",
    tolerance: float = 1e-6,
) -> Simulation:
    if not 0.0 < positive("start", start) < TRAVEL:
        raise InputError(f"start = {start!r}: expected a displacement greater than 0 and less than {TRAVEL:g} m")
    if not 0.0 < positive("increment", increment) <= TRAVEL - start:
        raise InputError(f"increment = {increment!r}: expected a step greater than 0 and at most {TRAVEL - start:g} m")
    further = max(1, round((TRAVEL - start) / increment))
    if count("points", points, 3) * NOTCH < 2.0 * WIDTH:
        least = math.ceil(2.0 * WIDTH / NOTCH)
        raise InputError(f"points = {points}: expected at least {least}, two spacings per notch")
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=1 + further, most_iterations=60),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=1 + further, most_steps=10_000_000),
    }
    sheet = Sheet.rectangle(
        WIDTH, HEIGHT, thickness=1e-3, density=1000.0, points=points + points % 2, centred=True
    ).cut((0.5 * WIDTH, -0.01 * HEIGHT), (0.5 * WIDTH, NOTCH))
    left, right = sheet.edges("left"), sheet.edges("right")
    middles = [sheet.nearest(x, 0.5 * HEIGHT) for x in (0.0, WIDTH)]
    times = [0.0, 1.0 / (1 + further), 1.0]
    line = TearLine(sheet)
    return Simulation(
        sheet,
        force=BondBased(Bimodular(tension=1e5, compression=0.0), horizon=horizon),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(middles, "y"),
            Motion(left, times, x=[0.0, -start, -TRAVEL]),
            Motion(right, times, x=[0.0, start, TRAVEL]),
        ],
        damage=CriticalStretch(1.0 + critical_strain, spared=np.concatenate([left, right])),
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("end_displacement", "m", lambda built, frame: frame.displacement[right, 0].mean()),
            Measure("load", "N", lambda built, frame: support_force(built, right)[0]),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
            Measure("crack_direction", "degrees", lambda built, frame: line.direction(frame.intact_faces)),
            Measure("mean_wrinkle_level", "1", lambda built, frame: frame.point_data["wrinkle_level"].mean()),
        ],
        outcomes=[
            Outcome("largest_load", "N", largest("load")),
            Outcome("tear_begins_at", "m", when_above("end_displacement", "crack_length", 0.0)),
        ],
        fields=("principal_stress", "wrinkle_level"),
        section="IM 6.5",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.output import plots

    ends = np.array([row["end_displacement"] for row in history])
    times = [history[int(np.argmin(np.abs(ends - end)))]["time"] for end in SHOWN]
    shown = plots.frames_at(folder, times)
    plots.reference(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.reference(folder / "wrinkles.png", shown, field="wrinkle_level", label="wrinkle level", limits=(0.0, 1.0))
    plots.curves(
        folder / "load.png", history, ["load"], ylabel="load (N)", against="end_displacement", xlabel="Ux (m)"
    )  # fmt: skip
