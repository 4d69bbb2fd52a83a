"""A square bag of two sheets joined at their edges, blown up: folds run in from its edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from study import whole

from validation.comparison import Comparison, UnfinishedError
from warp_pd import BondAssociated, Fixed, NeoHookean, Newton, Pressure, Sheet, Simulation, TensionField

# Diagonal and thickness [m], Young's modulus and pressure [Pa], Poisson's ratio.
DIAGONAL, THICKNESS, YOUNG, POISSON, PRESSURE = 1.2, 0.6e-3, 588e6, 0.4, 5e3
SIDE = DIAGONAL / 2.0**0.5


def bag(points: int, device: str | None) -> Sequence[float]:
    """Rise of the centre and way of the middle of an edge [m], largest stress at the centre [MPa].

    One sheet, whose edges stay in the plane between the two; strains are below one percent, so any law with these
    constants would do. Its edges are slack, which multigrid does not solve.
    """
    middle = 0.5 * SIDE
    sheet = Sheet.rectangle(SIDE, SIDE, thickness=THICKNESS, density=1000.0, points=points)
    material = NeoHookean(YOUNG / (2.0 + 2.0 * POISSON), YOUNG / (3.0 - 6.0 * POISSON))
    result = whole(
        Simulation(
            sheet,
            force=BondAssociated(TensionField(material), horizon=2.015),
            loads=[
                Fixed(sheet.edges("all"), "z"),
                Fixed([sheet.nearest(middle, 0.0), sheet.nearest(middle, SIDE)], "x"),
                Fixed([sheet.nearest(0.0, middle), sheet.nearest(SIDE, middle)], "y"),
                Pressure(PRESSURE),
            ],
            solver=Newton(preconditioner="algebraic", most_iterations=60),
            fields=("cauchy",),
        ).run(device=device, usd=False, pictures=False)
    )
    if result.status != "finished":
        raise UnfinishedError(f"bag of {points} points: the run ended {result.status!r}")
    u, centre = result.frame.displacement, sheet.nearest(middle, middle)
    stress = result.frame.point_data["cauchy_1"][centre]
    return [float(u[centre, 2]), float(u[sheet.nearest(0.0, middle), 0]), 1e-6 * float(stress)]


ROWS: tuple[Callable[[], Comparison], ...] = (
    lambda: Comparison(
        "bag",
        ("centre (m)", "edge (m)", "stress (MPa)"),
        (0.2167, 0.1227, 3.8),
        SIDE,
        (25, 51),
        (25, 51, 101),
        bag,
    ),
)
