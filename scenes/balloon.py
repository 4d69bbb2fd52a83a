"""A balloon is inflated through its pressure maximum.

A sphere of neo-Hookean rubber, exactly incompressible, radius 0.1 m, 1 mm thick, mu 1 MPa, stress-free at this radius.
A pump prescribes its volume, so that the pressure may fall. Exact: p = 2 mu (h / R) (1/l - 1/l^7) at the stretch l = r
/ R, by virtual work p 4 pi r^2 dr = 4 pi R^2 h dW with W = mu/2 (2 l^2 + l^-4 - 3). It is largest at l = 7^(1/6) =
1.383: beyond it the pressure decreases. At larger stretches the balloon does not stay a sphere: one side becomes
thinner (`--set stretch=2.5`; Haughton and Ogden, J. Mech. Phys. Solids 26 (1978) 93-138). Mooney-Rivlin rubber (`--set
share=0.3`) stiffens again: its pressure has a factor 1 - share + share l^2.

The pressure acts on flat triangles: it is too large by their missing volume, 0.3 % at 20 points on a quarter of
the circumference and 0.07 % at 40.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    EnclosedVolume,
    Explicit,
    Fixed,
    Measure,
    MooneyRivlin,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import below_one, count, not_negative, one_of, positive
from warp_pd.gas.enclosed import volume_of
from warp_pd.interfaces import Solver
from warp_pd.measures import largest

RADIUS, THICKNESS, MU = 0.1, 1e-3, 1e6
EXACT = "exact, by virtual work"


def exact_pressure(stretch, share=0.0):
    """Pressure [Pa] at a stretch l = r / R."""
    stiffening = 1.0 - share + share * stretch**2
    return 2.0 * MU * THICKNESS / RADIUS * (1.0 / stretch - stretch**-7.0) * stiffening


def build(
    points: int = 20,
    horizon: float = 2.015,
    weights: str = "auto",
    stretch: float = 1.8,
    share: float = 0.0,
    frames: int = 8,
    solver: str = "relaxation",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch r / R at the end [-].
        share: Fraction of mu from the second constant of Mooney-Rivlin rubber, at least 0 and less than 1 [-].
    """
    if not_negative("share", share) > 0.0:
        below_one("share", share)
    count("frames", frames, 1)
    sheet = Sheet.sphere(RADIUS, thickness=THICKNESS, density=1000.0, points=points)
    duration = 0.5 if solver == "explicit" else 1.0
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=frames),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=frames, ramp_steps=20 * points),
        "explicit": Explicit(duration, frames=frames, damping=20.0),
    }
    empty = float(volume_of(sheet.points, sheet.triangles))
    path = np.linspace(1.0, positive("stretch", stretch), 101)
    shown = np.linspace(1.0, stretch, frames + 1)
    stiffness = 10.0 * MU * THICKNESS / RADIUS / empty
    # The volume falls short by pressure / stiffness.
    exact = exact_pressure(path, share)
    wanted = empty * path**3 + exact / stiffness
    filling = list(zip(np.linspace(0.0, duration, 101), wanted, strict=True))

    def stretch_now(built, frame):
        return float((volume_of(sheet.points + frame.displacement, sheet.triangles) / empty) ** (1.0 / 3.0))

    def exact_now(built, frame):
        return exact_pressure(stretch_now(built, frame), share)

    def roundness(built, frame):
        radius = np.linalg.norm(sheet.points + frame.displacement, axis=1)
        return float(np.std(radius) / np.mean(radius))

    return Simulation(
        sheet,
        force=BondAssociated(
            MooneyRivlin(0.5 * (1.0 - share) * MU, 0.5 * share * MU), horizon=horizon, weights=weights
        ),
        loads=[*held_in_place(sheet), EnclosedVolume(filling, stiffness)],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("stretch", "-", stretch_now),
            Measure("exact_pressure", "Pa", exact_now),
            Measure("roundness", "-", roundness),
        ],
        outcomes=[
            Outcome("largest_pressure", "Pa", largest("pressure"), float(exact_pressure(shown, share).max()), EXACT),
            Outcome("last_pressure", "Pa", lambda history: history[-1]["pressure"], float(exact[-1]), EXACT),
        ],
        section="exact balloon",
        pictures=pictures,
    )


def held_in_place(sheet):
    """Supports of the points nearest to the axes that prevent rigid-body motion."""
    names = "xyz"
    poles = [[sheet.nearest(*(sign * RADIUS * np.eye(3)[c])) for sign in (1.0, -1.0)] for c in range(3)]
    return [Fixed(pair, names.replace(names[c], "")) for c, pair in enumerate(poles)]


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[0]["time"], history[len(history) // 2]["time"], history[-1]["time"]])
    plots.surfaces(folder / "balloon.png", shown, field="u3")
    plots.curves(
        folder / "pressure.png", history, ["pressure", "exact_pressure"], ylabel="pressure (Pa)", against="stretch",
        xlabel="stretch l = r / R",
    )  # fmt: skip
