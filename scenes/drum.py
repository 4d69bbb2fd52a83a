"""A drum: a rubber membrane, stretched and clamped on a circle, vibrates.

Radius 0.1 m, exactly incompressible neo-Hookean rubber of mu 1 MPa, 1 mm thick and 1000 kg/m^3 before it is stretched
1.5 times in all directions. Its tension T per length divided by its mass per area gives the frequencies of a circular
membrane,

    f_mn = j_mn / (2 pi R) c,     c^2 = T / (rho h) = mu l^2 (1 - l^-6) / rho,

of which the first six are compared with the modes of the discrete sheet (`natural_modes`). `--set amplitude=0.05`
releases the membrane from its lowest mode with 0.05 m amplitude instead; the frequency increases with the amplitude.
The reference is an axisymmetric membrane of 400 elements (tests/axisymmetric_membrane.py).
"""

import itertools

import numpy as np
from scipy.special import j0, jn_zeros

from warp_pd import BondAssociated, Explicit, Fixed, Measure, MooneyRivlin, Newton, Outcome, Sheet, Simulation
from warp_pd.command.modes import natural_modes
from warp_pd.device.checks import not_negative, positive
from warp_pd.shapes.curves import Circle

RADIUS, MU, DENSITY = 0.1, 1e6, 1000.0
# Orders m and numbers n of the slowest modes; those with m > 0 come in pairs.
SLOWEST = ((0, 1), (1, 1), (1, 1), (2, 1), (2, 1), (0, 2))
# Time at which the centre first comes down to zero [s], by amplitude [m], at a stretch of 1.5.
FIRST_ZERO = {0.05: 1.41374e-3, 0.1: 1.39207e-3}


def build(
    points: int = 101,
    horizon: float = 2.015,
    weights: str = "corrected",
    stretch: float = 1.5,
    amplitude: float = 0.0,
    duration: float = 0.002,
    frames: int = 100,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points across the drum.
        stretch: Stretch of the sheet on its rim [-].
        amplitude: Height at the centre from which the sheet is let go [m]; 0: frequencies are measured.
    """
    circle = Circle((0.0, 0.0), RADIUS)
    sheet = Sheet.outline(circle, spacing=2.0 * RADIUS / (points - 1), thickness=1e-3, density=DENSITY)
    sheet = sheet.prestretched(positive("stretch", stretch))
    radius = np.hypot(*sheet.points.T)
    centre = sheet.nearest(0.0, 0.0)
    lift = np.zeros((sheet.size, 3))
    lift[:, 2] = not_negative("amplitude", amplitude) * j0(jn_zeros(0, 1)[0] * radius / RADIUS)
    speed = np.sqrt(MU * stretch**2 * (1.0 - stretch**-6) / DENSITY)
    roots = [jn_zeros(m, n)[n - 1] for m, n in SLOWEST]
    bessel = [float(root * speed / (2.0 * np.pi * RADIUS)) for root in roots]
    height = Measure("height", "m", lambda built, frame: frame.displacement[centre, 2])
    rings = [
        Measure(f"frequency_{k + 1}", "Hz", lambda built, frame, k=k: frequencies(built)[k], bessel[k], "Bessel")
        for k in range(len(SLOWEST))
    ]
    zero = FIRST_ZERO.get(amplitude) if stretch == 1.5 else None
    return Simulation(
        sheet,
        force=BondAssociated(MooneyRivlin(c10=0.5 * MU), horizon=horizon, weights=weights),
        loads=[Fixed(sheet.where(lambda x, y: np.hypot(x, y) > RADIUS * (1.0 - 1e-9)))],
        solver=Explicit(duration, frames=frames) if amplitude > 0.0 else Newton(),
        initial_displacement=lift,
        measures=[height] if amplitude > 0.0 else rings,
        outcomes=[Outcome("first_zero", "s", first_zero, zero, "axisymmetric membrane, 400 elements")]
        if amplitude > 0.0
        else [],
        section="own drum",
        pictures=pictures,
    )


def frequencies(built):
    """The six lowest frequencies [Hz]."""
    return natural_modes(built, len(SLOWEST), "z").frequencies


def first_zero(history):
    """Time at which the centre first comes down to zero [s], linear between frames; None before that."""
    for before, after in itertools.pairwise(history):
        if after["height"] < 0.0:
            fraction = before["height"] / (before["height"] - after["height"])
            return before["time"] + fraction * (after["time"] - before["time"])
    return None


def pictures(history, folder):
    from warp_pd.viewer import plots

    if "height" in history[0]:
        plots.curves(folder / "height.png", history, ["height"], ylabel="height of the centre (m)")
        plots.surfaces(folder / "drum.png", plots.frames_at(folder, [0.0]), field="u3")
    else:
        found = [{"mode": k + 1, "frequency": history[-1][f"frequency_{k + 1}"]} for k in range(len(SLOWEST))]
        plots.curves(folder / "frequencies.png", found, ["frequency"], ylabel="Hz", against="mode", xlabel="mode")
