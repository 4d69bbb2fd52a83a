"""A rubber disc that snaps through: inflated past its pressure maximum, it jumps to a stiffer state.

A disc of Yeoh rubber (c10 50 kPa, c30 5 Pa), radius 50 mm, 1 mm thick, clamped at its rim, under a follower pressure
that ends at 6 kPa. The pressure has a maximum at a height of 60 mm and a minimum at 121 mm; between them the disc is
unstable at a given pressure, so `solver=newton` jumps and adds a note, while `ArcLength` follows the path between both
branches.

The reference is the exact membrane (tools/references/shooting.py, with cubic = c30 / c10).
"""

from warp_pd import ArcLength, BondAssociated, Fixed, Measure, Newton, Outcome, Pressure, Sheet, Simulation, Yeoh
from warp_pd.device.checks import count, one_of, positive
from warp_pd.fitting import Deflection
from warp_pd.interfaces import Solver
from warp_pd.scenes.balloon_paths import where_it_begins_to_fall, where_it_stops_falling
from warp_pd.shapes.curves import Circle

RADIUS, THICKNESS, C10, C30 = 0.05, 1e-3, 5e4, 5.0
# Exact: largest and smallest pressure [Pa], and the height [m] at 6 kPa.
LARGEST, SMALLEST, HEIGHT = 3781.13, 3418.35, 0.233007
EXACT = "exact membrane"


def build(
    points: int = 31,
    horizon: float = 2.015,
    pressure: float = 6e3,
    increment: float = 0.1,
    solver: str = "arc_length",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points across the disc.
        increment: Largest change of the load factor in a step.
    """
    count("points", points, 7)
    positive("pressure", pressure)
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), thickness=THICKNESS, density=1000.0
    )
    solvers: dict[str, Solver] = {
        "arc_length": ArcLength(increment=increment, tolerance=tolerance),
        "newton": Newton(tolerance=tolerance, load_steps=max(1, round(1.0 / increment))),
    }
    folds = pressure > LARGEST and solver == "arc_length"
    folded = [
        Outcome("largest_pressure", "Pa", where_it_begins_to_fall, LARGEST, EXACT),
        Outcome("smallest_pressure", "Pa", where_it_stops_falling, SMALLEST, EXACT),
    ]
    return Simulation(
        sheet,
        force=BondAssociated(Yeoh(c10=C10, c30=C30), horizon=horizon, weights="corrected"),
        loads=[Fixed(sheet.edges("all")), Pressure(pressure)],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("pressure", "Pa", lambda built, frame: pressure * frame.time),
            Measure(
                "center_deflection",
                "m",
                Deflection(sheet.nearest(0.0, 0.0), "z"),
                HEIGHT if pressure == 6e3 else None,
                EXACT,
            ),
        ],
        outcomes=folded if folds else [],
        section="exact disc",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    middle = min(range(len(history)), key=lambda k: abs(history[k]["center_deflection"] - 0.09))
    shown = plots.frames_at(folder, [history[k]["time"] for k in (1, middle, -1)])
    plots.surfaces(folder / "disc.png", shown, field="u3")
    plots.curves(
        folder / "path.png", history, ["pressure"], ylabel="pressure (Pa)", against="center_deflection",
        xlabel="height of the centre (m)",
    )  # fmt: skip
