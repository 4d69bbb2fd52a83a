"""A tube under pressure bulges: onset of the bulge, and the pressure at which it spreads.

Ogden rubber (three terms, 1972), mu 1 MPa, radius R = 20 mm, thickness h = 1 mm, length 400 mm, stretched to twice its
length. Both ends stay in their planes and slide in them without friction. With the hoop stretch a, the axial stretch b
and the energy density W(a, b), the pressure of a cylinder is p = (h / R) W_a / (a b), which has a maximum. Before this
maximum, a bifurcation leads to a mode with half a wave along the tube; `switch=1` follows it, `switch=0` follows the
cylinder. The bulge grows at one end, at a falling pressure, until the tube has a thin and a thick part. Both parts then
have the same pressure, the same axial force F = 2 pi R h W_b - p pi r^2 with the deformed radius r, and the same
potential W - p r^2 b / (2 R h) - F b / (2 pi R h): Maxwell's line (Kyriakides and Chang, Int. J. Solids Struct. 27
(1991) 1085-1111; Fu, Pearce and Liu, Int. J. Non-Linear Mech. 43 (2008) 697-706). Because the length is fixed, F falls
while the bulge spreads, and the Maxwell pressure rises.
"""

import numpy as np

from warp_pd import ArcLength, BondAssociated, Fixed, Measure, Ogden, Outcome, Pressure, Sheet, Simulation
from warp_pd.device.checks import count
from warp_pd.measures import support_force
from warp_pd.scenes.balloon_paths import OGDEN
from warp_pd.scenes.tube import MU, RADIUS, THICKNESS, held_in_place

LENGTH, ALONG = 0.4, 2.0
# Factors from stretch derivatives of W [Pa] to pressure [Pa] and force [N].
PER_PRESSURE, PER_FORCE = THICKNESS / RADIUS, 2.0 * np.pi * RADIUS * THICKNESS
# A bulge is complete when its radius differs from that of the thick part by less than this fraction.
WHOLE = 0.05


def slopes(a, b, rubber: Ogden = OGDEN):
    """W, W_a and W_b [Pa] at the hoop stretch a and the axial stretch b."""
    terms = [(mu, k, (a * b) ** -k) for mu, k in zip(rubber.mu, rubber.exponents, strict=True)]
    return (
        sum(mu / k * (a**k + b**k + c - 3.0) for mu, k, c in terms),
        sum(mu * (a**k - c) for mu, k, c in terms) / a,
        sum(mu * (b**k - c) for mu, k, c in terms) / b,
    )


def cylinder_pressure(around):
    """Pressure [Pa] of a cylindrical tube at a hoop stretch."""
    return PER_PRESSURE * slopes(around, ALONG)[1] / (around * ALONG)


def onset():
    """Hoop stretch at which a half wave along the tube becomes unstable, from the second variation of the energy."""
    from scipy.optimize import brentq

    wave, b, e = np.pi * RADIUS / LENGTH, ALONG, 1e-5

    def determinant(a):
        _, W_a, W_b = slopes(a, b)
        aa, ab = ((slopes(a + e, b)[k] - slopes(a - e, b)[k]) / (2.0 * e) for k in (1, 2))
        bb = (slopes(a, b + e)[2] - slopes(a, b - e)[2]) / (2.0 * e)
        # Terms with the wave number: a slope lengthens a meridian by half its square.
        return (aa + W_b / b * wave**2 - W_a / a) * bb - (ab - W_a / b) ** 2

    return float(brentq(determinant, 1.0, 1.3))


def maxwell(forces):
    """Maxwell pressures [Pa], and hoop stretches of the thick part, at decreasing forces F [N]."""
    from scipy.optimize import fsolve

    state, found = np.array([0.80, 2.25, 5.47, 4.31]), []

    def differences(state, F):
        rows = []
        for a, b in state.reshape(2, 2):
            W, W_a, W_b = (value / MU for value in slopes(a, b))
            p = W_a / (a * b)
            rows.append((p, W_b - 0.5 * p * a**2, W - 0.5 * p * a**2 * b - F * b))
        thin, thick = np.array(rows)
        return [*(thin - thick), thin[1] - F]

    for F in np.asarray(forces) / (PER_FORCE * MU):
        state = fsolve(differences, state, args=(F,))
        a, b = state[2:]
        found.append((PER_PRESSURE * slopes(a, b)[1] / (a * b), a))
    return np.array(found).T


def build(
    points: int = 20,
    horizon: float = 2.015,
    weights: str = "auto",
    switch: int = 1,
    steps: int = 31,
    increment: float = 0.1,
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points around the tube.
        switch: Number of the bifurcation at which the path takes the other branch; 0 to follow the cylinder.
        steps: Maximum number of points of the path.
        increment: Largest change of the load factor in a step [-].
    """
    rows = round(2.3 * count("points", points, 12)) + 1
    sheet = Sheet.tube(RADIUS, LENGTH, thickness=THICKNESS, density=1000.0, points=(points, rows))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    around = np.linspace(1.0, 2.0, 2001)
    largest = float(cylinder_pressure(around).max())
    load, begins = 1.1 * largest, onset()
    forces = np.linspace(1.6, -0.4, 41) * PER_FORCE * MU
    lines, thick = maxwell(forces)
    turn = [np.flatnonzero(np.abs(sheet.points[top, 1 - c]) < 1e-6 * RADIUS) for c in range(2)]

    def stretch_at(ring):
        def stretch(built, frame):
            place = sheet.points[ring] + frame.displacement[ring]
            return float(np.hypot(place[:, 0], place[:, 1]).mean() / RADIUS)

        return stretch

    def resultant(built, frame):
        # Measured at the thin end, where the force of the pressure on the lid is small.
        stretch, end = min((stretch_at(ring)(built, frame), ring is top) for ring in (bottom, top))
        force = support_force(built, top if end else bottom)[2]
        return abs(float(force)) - load * frame.time * np.pi * (RADIUS * stretch) ** 2

    def at_force(values):
        return lambda built, frame: float(
            np.interp(-resultant(built, frame), -forces, values, left=np.nan, right=np.nan)
        )

    def first_unstable(name):
        return lambda history: next((row[name] for row in history if row["unstable"] > 0.0), None)

    def spreading(history):
        whole = [
            abs(row["pressure"] / row["maxwell_pressure"] - 1.0)
            for row in history
            if max(row["around_bottom"], row["around_top"]) > (1.0 - WHOLE) * row["maxwell_stretch"]
        ]
        return max(whole, default=None)

    outcomes = [
        Outcome("onset_stretch", "-", first_unstable("around_bottom"), begins, "linear stability of a membrane"),
        Outcome("onset_pressure", "Pa", first_unstable("pressure"), float(cylinder_pressure(begins)), "exact cylinder"),
    ]
    if switch:
        outcomes.append(Outcome("error_of_maxwells_line", "1", spreading))
    else:
        outcomes.append(
            Outcome("largest_pressure", "Pa", lambda history: max(row["pressure"] for row in history), largest, "exact")
        )
    start = sheet.points * [*2 * [ALONG**-0.5 - 1.0], ALONG - 1.0]
    return Simulation(
        sheet,
        force=BondAssociated(OGDEN, horizon=horizon, weights=weights),
        initial_displacement=start,
        loads=[
            *held_in_place(sheet),
            Fixed(top, "z"),
            Fixed(top[turn[0]], "y"),
            Fixed(top[turn[1]], "x"),
            Pressure(load, on="triangles"),
        ],
        solver=ArcLength(increment=increment, tolerance=tolerance, switch=switch, most_steps=count("steps", steps, 1)),
        measures=[
            Measure("pressure", "Pa", lambda built, frame: load * frame.time),
            Measure("around_bottom", "-", stretch_at(bottom)),
            Measure("around_top", "-", stretch_at(top)),
            Measure("axial_force", "N", resultant),
            Measure("maxwell_pressure", "Pa", at_force(lines)),
            Measure("maxwell_stretch", "-", at_force(thick)),
        ],
        outcomes=outcomes,
        section="exact tube",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[k]["time"] for k in (0, len(history) // 2, -1)])
    plots.surfaces(folder / "tube.png", shown, field="u3")
    # Either end may bulge.
    end = max(("top", "bottom"), key=lambda name: history[-1][f"around_{name}"])
    plots.curves(
        folder / "pressure.png", history, ["pressure", "maxwell_pressure"], ylabel="pressure (Pa)",
        against=f"around_{end}", xlabel=f"stretch around the {end}",
    )  # fmt: skip
