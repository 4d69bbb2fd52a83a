"""A balloon along its whole equilibrium path: through the maximum and the minimum of the pressure.

A sphere of Mooney-Rivlin rubber as in `balloon`, with a second constant of 0.1 of mu. Exact, by virtual work: the
pressure p = 2 mu (h / R) (1/l - 1/l^7) (1 - share + share l^2) at the stretch l = r / R. It rises to a maximum, falls,
and rises again. The follower pressure is the load (`control=pressure`): `ArcLength` follows the falling part, which is
unstable at a given pressure. With `control=piston` the stroke of a piston behind a spring is given, a volume V: the
pressure is k (V - V_balloon). The spring is half as stiff as the slope of the falling pressure, so there the stroke
must also decrease (snap-back), and prescribing it fails, too.

Ogden's rubber (`material=ogden`; his three terms, 1972) becomes a pear on the way: a bifurcation after the maximum, and
another before the minimum at which it is a sphere again (Haughton and Ogden, J. Mech. Phys. Solids 26 (1978) 93-138).
`switch=1` follows the pear. Its pressure is 2 (h / R) sum mu_p (l^(a_p - 3) - l^(-2 a_p - 3)).

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
    Ogden,
    Outcome,
    Pressure,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import below_one, one_of, positive
from warp_pd.gas.enclosed import volume_of
from warp_pd.scenes.balloon import EXACT, MU, RADIUS, THICKNESS, exact_pressure, held_in_place

OGDEN = Ogden((1.491 * MU, 0.003 * MU, -0.0237 * MU), (1.3, 5.0, -2.0))
# Stretches between which a sphere of Ogden's rubber is unstable as a pear: the second variation of the energy of a
# membrane, tests/statics/test_branches.py.
PEAR = (1.7757, 2.5238)
HAUGHTON_OGDEN = "bifurcation of a membrane, Haughton and Ogden 1978"


def ogden_pressure(stretch):
    """Pressure [Pa] of Ogden's rubber at a stretch l = r / R."""
    terms = zip(OGDEN.mu, OGDEN.exponents, strict=True)
    return 2.0 * THICKNESS / RADIUS * sum(mu * (stretch ** (a - 3.0) - stretch ** (-2.0 * a - 3.0)) for mu, a in terms)


def where_others_become_unstable(history):
    """Stretches at which a second mode becomes unstable, and at which it no longer is; None if that never happens."""
    turns = [b["stretch"] for a, b in pairwise(history) if (a["unstable"] > 1.0) != (b["unstable"] > 1.0)]
    return [*turns, None, None][:2]


def where_it_begins_to_fall(history):
    """Pressure of the last frame before it falls for the first time."""
    return next((a["pressure"] for a, b in pairwise(history) if b["pressure"] < a["pressure"]), None)


def where_it_stops_falling(history):
    """Pressure of the last frame to which it falls; None while it falls."""
    falls = [b for a, b in pairwise(history) if b["pressure"] < a["pressure"]]
    return falls[-1]["pressure"] if falls and falls[-1] is not history[-1] else None


def build(
    points: int = 12,
    horizon: float = 2.015,
    weights: str = "auto",
    stretch: float | None = None,
    share: float = 0.1,
    material: str = "mooney_rivlin",
    switch: int = 0,
    control: str = "pressure",
    increment: float = 0.1,
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points on a quarter of the circumference.
        stretch: Stretch r / R at the end [-]; by default 6, or 14 for Ogden's rubber.
        share: Fraction of mu from the second constant of Mooney-Rivlin rubber, greater than 0 and less than 1 [-].
        material: "mooney_rivlin" or "ogden".
        switch: Number of the bifurcation at which the path takes the other branch, from 1; 0: it stays on its branch.
        control: Prescribed quantity: "pressure", or "piston", the stroke of a piston behind a spring.
        increment: Largest change of the load factor in a step.
    """
    below_one("share", share)
    one_of("control", control, ("pressure", "piston"))
    ogden = one_of("material", material, ("mooney_rivlin", "ogden")) == "ogden"
    stretch = (14.0 if ogden else 6.0) if stretch is None else positive("stretch", stretch)
    path = np.linspace(1.0, stretch, 2001)[1:]

    def pressure_at(stretch):
        return ogden_pressure(stretch) if ogden else exact_pressure(stretch, share)

    exact = pressure_at(path)
    sheet = Sheet.sphere(RADIUS, thickness=THICKNESS, density=1000.0, points=points)
    empty = float(volume_of(sheet.points, sheet.triangles))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(exact)))) + 1
    if len(turns) != 2 or exact[-1] < exact.max():
        raise InputError(
            f"stretch = {stretch!r}, share = {share!r}: expected a pressure that passes a maximum and a minimum, and "
            "rises above both; try the default stretch, share=0.1"
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
        return pressure_at(stretch_now(built, frame)) / lacking

    def roundness(built, frame):
        radius = np.linalg.norm(sheet.points + frame.displacement, axis=1)
        return float(np.std(radius) / np.mean(radius))

    pressure = [Measure("pressure", "Pa", lambda built, frame: exact[-1] * frame.time)]

    def worst(history):
        return max(abs(row["pressure"] / row["exact_pressure"] - 1.0) for row in history[1:])

    turning = [
        Outcome("largest_pressure", "Pa", where_it_begins_to_fall, float(exact[turns[0]]), EXACT),
        Outcome("smallest_pressure", "Pa", where_it_stops_falling, float(exact[turns[1]]), EXACT),
    ]
    pears = [
        Outcome(name, "-", lambda history, k=k: where_others_become_unstable(history)[k], PEAR[k], HAUGHTON_OGDEN)
        for k, name in enumerate(("pear_from", "pear_to"))
    ]
    if not ogden:
        shown = [Outcome("largest_error", "1", worst)]
    else:
        shown = pears[:1] if switch else pears
    rubber = OGDEN if ogden else MooneyRivlin(0.5 * (1.0 - share) * MU, 0.5 * share * MU)
    return Simulation(
        sheet,
        force=BondAssociated(rubber, horizon=horizon, weights=weights),
        loads=[*held_in_place(sheet), load],
        # Enough eigenvalues for three pears, along x, y and z.
        solver=ArcLength(increment=increment, tolerance=tolerance, switch=switch, modes=6 if ogden else 3),
        measures=[
            *(pressure if control == "pressure" else []),
            Measure("stretch", "-", stretch_now),
            Measure("exact_pressure", "Pa", exact_now),
            Measure("roundness", "-", roundness),
        ],
        outcomes=[*([] if switch else turning), *shown],
        section="exact balloon",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    plots.curves(
        folder / "pressure.png", history, ["pressure", "exact_pressure"], ylabel="pressure (Pa)", against="stretch",
        xlabel="stretch l = r / R",
    )  # fmt: skip
    plots.curves(folder / "path.png", history, ["stretch"], ylabel="stretch l = r / R")
