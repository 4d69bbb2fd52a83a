"""A strip between two clamps is stretched, and wrinkles along its length with a wavelength set by bending.

0.25 x 0.1 m of neo-Hookean rubber, mu 2 MPa, 0.07 mm thick, is stretched by 10 %, as in Nayyar, Ravi-Chandar and Huang
(Int. J. Solids Struct. 48, 2011). The clamps keep its width; where it narrows between them it is compressed across. Two
columns of points in each clamp hold its slope. Small random heights start the wrinkles.

Cerda and Mahadevan (Phys. Rev. Lett. 90, 2003) balance bending across the wrinkles with the tension T along them:

    wavelength = 2 sqrt(pi) (D / T)^(1/4) L^(1/2),     D = mu h^3 / 3,

with the length L of the stretched strip. Without bending (`--set bending=False`) wrinkles are as short as the spacing.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from warp_pd import BondAssociated, Explicit, Fixed, Measure, NeoHookean, Plate, Sheet, Simulation
from warp_pd.device.checks import count, positive
from warp_pd.measures import support_force

LENGTH, WIDTH, MU = 0.25, 0.1, 2e6
# Range of the heights over the thickness below which a strip is flat.
FLAT = 0.01
# Spacings along a wave that let it form, and that make it one and no zigzag from point to point.
WAVE, ZIGZAG = 10.0, 4.0
# Places for each point at which heights and slopes are summed.
FINE = 8
# Fewest waves across the strip, and steps between numbers of waves that are tried first.
FEWEST, STEP = 1.0, 0.25
# Heights of waves over those of the line below which they are round-off.
NOISE = 1e-5


def build(
    points: int = 161,
    horizon: float = 1.5,
    thickness: float = 7e-5,
    strain: float = 0.1,
    bending: bool = True,
    duration: float = 0.08,
    damping: float = 300.0,
    frames: int = 20,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the strip between the clamps.
        thickness: Thickness of the strip [m].
        strain: Length that is added to the strip over its length [-].
        bending: Whether it has bending stiffness.
        damping: Mass damping [1/s], in which the strip comes to rest.
    """
    spacing = LENGTH / (count("points", points, 3) - 1)
    rows = round(WIDTH / spacing) + 1
    sheet = Sheet.rectangle(
        LENGTH + 2.0 * spacing, (rows - 1) * spacing, thickness=thickness, density=1000.0, points=points + 2
    )
    along, across = (sheet.points[:, 0] - spacing) / LENGTH, sheet.points[:, 1]
    left, right = (np.flatnonzero(side) for side in (along < 1e-6, along > 1.0 - 1e-6))
    heights = np.random.default_rng(0).normal(size=rows)
    start = np.zeros((sheet.size, 3))
    reached = np.clip(along, 0.0, 1.0)
    narrowed = (1.0 - (1.0 + positive("strain", strain)) ** -0.5) * (1.0 - (2.0 * reached - 1.0) ** 4)
    start[:, 0] = strain * LENGTH * reached
    start[:, 1] = narrowed * (0.5 * across.max() - across)
    start[:, 2] = thickness * np.sin(np.pi * reached) * heights[np.rint(across / spacing).astype(int)]
    middle = np.flatnonzero(np.abs(along - 0.5) < 0.6 / (points - 1))
    middle = middle[np.argsort(across[middle], kind="stable")]
    middle = middle[np.append(True, np.diff(across[middle]) > 0.5 * spacing)]

    def predicted(tension):
        stiffness = MU * thickness**3 / 3.0
        return 2.0 * np.sqrt(np.pi) * (stiffness / tension) ** 0.25 * np.sqrt(LENGTH * (1.0 + strain))

    def measured(built, frame):
        moved = frame.displacement[middle]
        return wavelength(across[middle], moved) if np.ptp(moved[:, 2]) > FLAT * thickness else None

    # With the tension of a strip whose width is free.
    expected = predicted(MU * thickness * strain * (3.0 + 3.0 * strain + strain**2) / (1.0 + strain) ** 2)
    coarse = bool(bending and expected < WAVE * spacing)
    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(mu=MU, bulk=1e3 * MU), horizon=horizon),
        loads=[Fixed(left), Fixed(right), *([Plate()] if bending else [])],
        initial_displacement=start,
        solver=Explicit(duration, frames=frames, damping=damping, safety=0.5),
        measures=[
            Measure("amplitude", "m", lambda built, frame: 0.5 * np.ptp(frame.displacement[middle, 2])),
            Measure("wavelength", "m", measured),
            Measure(
                "predicted_wavelength", "m", lambda built, frame: predicted(abs(support_force(built, right)[0]) / WIDTH)
            ),
        ],
        notes=[
            f"points = {points}: wrinkles of about {expected:.3g} m are {expected / spacing:.1f} spacings long: they "
            f"need {WAVE:g} or more, points = {1 + int(np.ceil(WAVE * LENGTH / expected))}, to form"
        ]
        * coarse,
        section="own wrinkles",
        pictures=pictures,
    )


def wavelength(across, displacement):
    """Wavelength along a line of points [m]: that of the sine with the same mean squares of height and slope.

    None without waves, for heights that change from point to point, and for a line that folds over. The heights are
    those above a slow bow, and between the points those of a spline: differences would make a wave of ten points 7 %
    too long.
    """
    y = across + displacement[:, 1]
    height = displacement[:, 2] - bow(y, displacement[:, 2])
    zigzag = (height**2).sum() < (ZIGZAG / (2.0 * np.pi)) ** 2 * (np.diff(height) ** 2).sum()
    straight = np.ptp(height) <= NOISE * np.abs(displacement[:, 2]).max()
    if zigzag or straight or np.diff(y).min() <= 0.0:
        return None
    wave, fine = CubicSpline(y, height), np.linspace(y[0], y[-1], FINE * len(y))
    return float(2.0 * np.pi * np.sqrt(np.trapezoid(wave(fine) ** 2, fine) / np.trapezoid(wave(fine, 1) ** 2, fine)))


def bow(y, height):
    """Parabola on which a line of points waves [m], that of the least-squares sum of a parabola and a sine.

    Without the sine, the parabola would follow a wave of a few periods.
    """
    x = (y - y[0]) / (y[-1] - y[0])
    parabola = np.stack([np.ones_like(x), x, x**2], axis=1)

    def fit(waves):
        terms = np.column_stack([parabola, np.cos(2.0 * np.pi * waves * x), np.sin(2.0 * np.pi * waves * x)])
        found = np.linalg.lstsq(terms, height)[0]
        return ((terms @ found - height) ** 2).sum(), parabola @ found[:3]

    # The last one is a zigzag.
    most = 0.5 * (len(y) - 1)
    tried = np.append(np.arange(FEWEST, most, STEP), most)
    best = tried[np.argmin([fit(waves)[0] for waves in tried])]
    near = minimize_scalar(
        lambda waves: fit(waves)[0], bounds=(max(best - STEP, FEWEST), min(best + STEP, most)), method="bounded"
    )
    return fit(near.x)[1]


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "wrinkles.png", shown, field="u3", label="height (m)")
