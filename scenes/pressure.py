"""A sheet with fixed edges is inflated by a pressure. BA paper, section 6.2.

Gent sheet of 100 x 100 x 1 mm, mu 1 kPa, 1/D 100 kPa, Jm 160, under a follower pressure of 5 Pa. Finite
elements (nine-node membranes, converged to 1e-6): 15.680 mm at the centre; 15.466 mm if the pressure is
dead. The paper's own finite elements give 15.62 mm, its peridynamics 16.19 mm.
"""

from warp_pd import BondAssociated, Explicit, Fixed, Gent, Measure, Newton, Pressure, Relaxation, Sheet, Simulation
from warp_pd.device.checks import one_of
from warp_pd.interfaces import Solver
from warp_pd.papers import point_areas

FOLLOWER, DEAD = 15.6799e-3, 15.4661e-3


def build(
    points: int = 51,
    horizon: float = 2.015,
    weights: str = "auto",
    areas: str = "auto",
    pressure: float = 5.0,
    follower: bool = True,
    solver: str = "auto",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        follower: Whether the pressure follows the deformed surface.
    """
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance),
        "relaxation": Relaxation(tolerance=tolerance),
        "explicit": Explicit(1.0, frames=20, damping=40.0, precision=64),
    }
    # Newton needs an energy, which the published weights lack, and is slow at large horizons (docs/solvers.md).
    solvers["auto"] = solvers["relaxation" if weights == "published" or horizon > 2.5 else "newton"]
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points, areas=point_areas(areas, weights))
    centre = sheet.nearest(0.05, 0.05)
    reference = (FOLLOWER if follower else DEAD) if pressure == 5.0 else None
    return Simulation(
        sheet,
        force=BondAssociated(Gent(mu=1e3, bulk=2 * 100e3, lock=160.0), horizon=horizon, weights=weights),
        loads=[Fixed(sheet.edges("all")), Pressure(pressure, follower=follower)],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure(
                "center_deflection",
                "m",
                lambda built, frame: frame.displacement[centre, 2],
                reference,
                "membrane finite elements, Q9, converged to 1e-6",
            )
        ],
        section="BA 6.2",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.surfaces(folder / "deflection.png", shown, field="u3", label="deflection (m)")
