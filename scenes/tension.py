"""A sheet gripped at both ends and pulled to twice its length. BA paper, section 6.1.

Gent sheet of 100 x 100 x 1 mm, mu 1 kPa, 1/D 100 kPa, Jm 160. The left end is held, the right one moves by
100 mm; neither may contract. Finite elements (nine-node membranes, converged to 1e-5): the middle of each
free edge moves in by 13.543 mm, the grip force is 0.18112 N. The paper's own finite elements give
13.57 mm, its peridynamics 14.06 mm.
"""

from warp_pd import BondAssociated, Explicit, Fixed, Gent, Measure, Motion, Newton, Relaxation, Sheet, Simulation
from warp_pd.device.checks import InputError, finite, one_of
from warp_pd.interfaces import Solver
from warp_pd.papers import point_areas

CONTRACTION, GRIP = 13.5432e-3, 0.181116
SIDE = 0.1


def build(
    points: int = 51,
    horizon: float = 2.015,
    weights: str = "auto",
    areas: str = "auto",
    extension: float = 0.1,
    solver: str = "auto",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        extension: Displacement of the right edge [m].
    """
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance),
        "relaxation": Relaxation(tolerance=tolerance, ramp_steps=12 * points),
        "explicit": Explicit(2.0, frames=20, damping=20.0, precision=64),
    }
    # Newton needs an energy, which the published weights lack, and is slow at large horizons (docs/solvers.md).
    solvers["auto"] = solvers["relaxation" if weights == "published" or horizon > 2.5 else "newton"]
    if finite("extension", extension) <= -SIDE:
        raise InputError(f"extension = {extension!r}: expected more than {-SIDE:g} m, at which no sheet is left")
    sheet = Sheet.rectangle(
        SIDE, SIDE, thickness=1e-3, density=1000.0, points=points, areas=point_areas(areas, weights)
    )
    middle = sheet.nearest(0.05, 0.0)
    right = sheet.edges("right")
    published = extension == 0.1
    source = "membrane finite elements, Q9, converged to 1e-5"
    return Simulation(
        sheet,
        force=BondAssociated(Gent(mu=1e3, bulk=2 * 100e3, lock=160.0), horizon=horizon, weights=weights),
        loads=[Fixed(sheet.edges("left")), Motion(right, times=[0.0, 1.0], x=[0.0, extension], y=0.0, z=0.0)],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure(
                "edge_contraction",
                "m",
                lambda built, frame: frame.displacement[middle, 1],
                CONTRACTION if published else None,
                source,
            ),
            Measure(
                "grip_force",
                "N",
                lambda built, frame: -built.to_numpy(built.state.force)[right, 0].sum(),
                GRIP if published else None,
                source,
            ),
        ],
        section="BA 6.1",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "contraction.png", shown, field="u2")
