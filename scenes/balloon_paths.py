"""A balloon along its whole equilibrium path: through the maximum and the minimum of the pressure.

A sphere of Mooney-Rivlin rubber as in `balloon`, with a second constant of 0.1 of mu. Exact, by virtual work: the
pressure p = 2 mu (h / R) (1/l - 1/l^7) (1 - share + share l^2) at the stretch l = r / R. It rises to a maximum, falls,
and rises again. The follower pressure is the load (`control=pressure`): `ArcLength` follows the falling part, which is
unstable at a given pressure. With `control=piston` the stroke of a piston behind a spring is given, a volume V: the
pressure is k (V - V_balloon). The spring is half as stiff as the slope of the falling pressure, so there the stroke
must also decrease (snap-back), and prescribing it fails, too.

A sphere of flat triangles encloses less than the ball, so the pressure on them is larger by 0.9 % at 12 points on a
quarter of the circumference; the exact pressure of the piston has this factor.
"""

from itertools import pairwise

import numpy as np

from warp_pd import (
    ArcLength,
    BondAssociated,
    EnclosedVolume,
    InputError,
    Measure,
    MooneyRivlin,
    Outcome,
    Pressure,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import below_one, one_of, positive
from warp_pd.geometry.enclosure import volume_of
from warp_pd.scenes.balloon import EXACT, MU, RADIUS, THICKNESS, exact_pressure, held_in_place


def where_it_begins_to_fall(history):
    """Pressure of the last frame before it falls for the first time."""
    return next((a["pressure"] for a, b in pairwise(history) if b["pressure"] < a["pressure"]), None)


def where_it_stops_falling(history):
    """Pressure of the last frame to which it falls."""
    falls = [b["pressure"] for a, b in pairwise(history) if b["pressure"] < a["pressure"]]
    return falls[-1] if falls else None


def build(
    points: int = 12,
    horizon: float = 2.015,
    weights: str = "auto",
    stretch: float = 6.0,
    share: float = 0.1,
    control: str = "pressure",
    increment: float = 0.1,
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points on a quarter of the circumference.
        stretch: Stretch r / R at the end [-].
        share: Fraction of mu from the second constant of Mooney-Rivlin rubber, greater than 0 and less than 1 [-].
        control: Prescribed quantity: "pressure", or "piston", the stroke of a piston behind a spring.
        increment: Largest change of the load factor in a step.
    """
    below_one("share", share)
    one_of("control", control, ("pressure", "piston"))
    path = np.linspace(1.0, positive("stretch", stretch), 2001)[1:]
    exact = exact_pressure(path, share)
    sheet = Sheet.sphere(RADIUS, thickness=THICKNESS, density=1000.0, points=points)
    empty = float(volume_of(sheet.points, sheet.triangles))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(exact)))) + 1
    if len(turns) != 2 or exact[-1] < exact.max():
        raise InputError(
            f"stretch = {stretch!r}, share = {share!r}: expected a pressure that passes a maximum and a minimum, and "
            "rises above both; try stretch=6, share=0.1"
        )
    if control == "pressure":
        lacking, load = 1.0, Pressure(exact[-1])
    else:
        lacking = empty / (4.0 / 3.0 * np.pi * RADIUS**3)
        exact, volume = exact / lacking, empty * path**3
        stiffness = 0.5 * float((exact[turns[0]] - exact[turns[1]]) / (volume[turns[1]] - volume[turns[0]]))
        load = EnclosedVolume([(0.0, empty), (1.0, volume[-1] + exact[-1] / stiffness)], stiffness)

    def stretch_now(built, frame):
        return float((volume_of(sheet.points + frame.displacement, sheet.triangles) / empty) ** (1.0 / 3.0))

    def exact_now(built, frame):
        return exact_pressure(stretch_now(built, frame), share) / lacking

    pressure = [Measure("pressure", "Pa", lambda built, frame: exact[-1] * frame.time)]

    def worst(history):
        return max(abs(row["pressure"] / row["exact_pressure"] - 1.0) for row in history[1:])

    turning = [
        Outcome("largest_pressure", "Pa", where_it_begins_to_fall, float(exact[turns[0]]), EXACT),
        Outcome("smallest_pressure", "Pa", where_it_stops_falling, float(exact[turns[1]]), EXACT),
    ]
    return Simulation(
        sheet,
        force=BondAssociated(
            MooneyRivlin(0.5 * (1.0 - share) * MU, 0.5 * share * MU), horizon=horizon, weights=weights
        ),
        loads=[*held_in_place(sheet), load],
        solver=ArcLength(increment=increment, tolerance=tolerance),
        measures=[
            *(pressure if control == "pressure" else []),
            Measure("stretch", "-", stretch_now),
            Measure("exact_pressure", "Pa", exact_now),
        ],
        outcomes=[*turning, Outcome("largest_error", "1", worst)],
        section="exact balloon",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.output import plots

    plots.curves(
        folder / "pressure.png", history, ["pressure", "exact_pressure"], ylabel="pressure (Pa)", against="stretch",
        xlabel="stretch l = r / R",
    )  # fmt: skip
    plots.curves(folder / "path.png", history, ["stretch"], ylabel="stretch l = r / R")
