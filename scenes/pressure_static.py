"""Static equilibrium of a neo-Hookean sheet with fixed edges under pressure. NN paper, section 6.1 (figures 6 and 7).

1 x 1 x 0.01 m, mu 1 kPa, K 100 kPa, all edges fixed, a follower pressure of 20 Pa (`--set pressure=10` is the
paper's other case). Finite elements (nine-node membranes, converged to 1e-6): 0.302585 m at the centre at
20 Pa. The paper shows contours of u3 and its profile along the centre line, and no table of numbers.
"""

import numpy as np

from warp_pd import Explicit, Fixed, Measure, NeoHookean, Newton, Pressure, Relaxation, Sheet, Simulation
from warp_pd.device.checks import one_of
from warp_pd.interfaces import Solver
from warp_pd.papers import force_law, point_areas

CENTRE = {20.0: 0.302585}


def build(
    points: int = 101,
    horizon: float = 3.15,
    weights: str = "auto",
    areas: str = "auto",
    force: str = "bond_associated",
    pressure: float = 20.0,
    solver: str = "auto",
    tolerance: float | None = None,
) -> Simulation:
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance),
        "relaxation": Relaxation(tolerance=tolerance),
        "explicit": Explicit(20.0, frames=20, damping=4.0, precision=64),
    }
    # Newton needs a tangent and an energy, and is fast at small horizons (docs/solvers.md).
    law = force_law(force, NeoHookean(mu=1e3, bulk=100e3), horizon, weights)
    wide = weights == "published" or horizon > 2.5
    solvers["auto"] = solvers["relaxation" if wide or not law.has_tangent else "newton"]
    notes = [] if law.has_tangent or solver != "auto" else [f"solver: Relaxation, as {force} has no tangent for Newton"]
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points, areas=point_areas(areas, weights))
    centre = sheet.nearest(0.5, 0.5)
    return Simulation(
        sheet,
        force=law,
        loads=[Fixed(sheet.edges("all")), Pressure(pressure)],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure(
                "center_deflection",
                "m",
                lambda built, frame: frame.displacement[centre, 2],
                CENTRE.get(pressure),
                "membrane finite elements, Q9, converged to 1e-6",
            )
        ],
        section="NN 6.1",
        notes=notes,
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.surfaces(folder / "deflection.png", shown, field="u3")
    x, y, _ = shown[0].reference.T
    line = np.flatnonzero(abs(y - 0.5) < 1e-9) if (abs(y - 0.5) < 1e-9).any() else np.argsort(abs(y - 0.5))[:50]
    line = line[np.argsort(x[line])]
    profile = [{"x": x[i], "u3": shown[0].fields["u3"][i]} for i in line]
    plots.curves(folder / "centre_line.png", profile, ["u3"], ylabel="u3 (m)", against="x", xlabel="X1 (m)")
