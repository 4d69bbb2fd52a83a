"""A dozen balls fall: nine on a stretched sheet, three beside it on the floor.

A square of rubber (neo-Hookean, mu 0.4 MPa, 1 mm thick) is stretched and clamped at its edges. The physics engine
Newton (extra `bodies`) moves the balls: its solver XPBD handles contact between balls and with the floor, and the sheet
exerts its contact forces on them. There is no analytical solution; the result is the deepest overlap of a ball with
another one or the floor.
"""

import itertools

import numpy as np

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    NeoHookean,
    Outcome,
    Sheet,
    Simulation,
    TensionField,
    newton_bodies,
)
from warp_pd.contact.newton_world import load_newton
from warp_pd.device.checks import count, positive
from warp_pd.measures import largest, worst_balance

MU = 0.4e6
SIDE, HEIGHT = 0.3, 0.15


def build(
    points: int = 31,
    horizon: float = 2.015,
    stretch: float = 1.2,
    diameter: float = 0.06,
    mass: float = 0.05,
    friction: float = 0.3,
    damping: float = 2.0,
    newton_step: float = 5e-4,
    duration: float = 0.6,
    frames: int = 60,
    safety: float = 0.4,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch of the sheet before the balls fall [-].
        diameter: Diameter of the balls [m].
        mass: Mass of a ball [kg].
        newton_step: Step of Newton's solver [s].
    """
    newton = load_newton()
    sheet = Sheet.rectangle(SIDE, SIDE, thickness=1e-3, density=1000.0, points=count("points", points, 21))
    radius = 0.5 * positive("diameter", diameter)
    inertia = 0.4 * positive("mass", mass) * radius**2
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -9.81))
    surface = newton.ModelBuilder.ShapeConfig(density=0.0, mu=friction)
    grid = (0.22, 0.5, 0.78)
    on_sheet = [
        (x * SIDE, y * SIDE, 0.02 + radius + 0.01 * k) for k, (x, y) in enumerate(itertools.product(grid, grid))
    ]
    beside = [(1.5 * SIDE, 0.5 * SIDE + 0.1 * k * radius, (2.1 * k + 1.5) * radius - HEIGHT) for k in range(3)]
    for k, place in enumerate([*on_sheet, *beside]):
        turn = np.diag([inertia] * 3).ravel().tolist()
        body = builder.add_body(xform=(*place, 0.0, 0.0, 0.0, 1.0), mass=mass, inertia=turn, label=f"ball_{k}")
        builder.add_shape_sphere(body, radius=radius, cfg=surface, label=f"ball_{k}")
    builder.add_ground_plane(height=-HEIGHT, cfg=surface)
    balls = range(len(on_sheet) + len(beside))

    def depth(built, frame):
        """Deepest overlap of a ball with another one or the floor [m]."""
        centres = np.array([built.contacts[k].pose()[:3] for k in balls])
        apart = [np.linalg.norm(a - b) - 2.0 * radius for a, b in itertools.combinations(centres, 2)]
        return max(0.0, -min(apart), float(radius - HEIGHT - centres[:, 2].min()))

    return Simulation(
        sheet.prestretched(stretch),
        force=BondAssociated(TensionField(NeoHookean(mu=MU, bulk=100.0 * MU)), horizon=horizon),
        loads=[Fixed(sheet.edges("all"))],
        contact=newton_bodies(builder, lambda model: newton.solvers.SolverXPBD(model, iterations=10), newton_step),
        solver=Explicit(duration, frames=frames, damping=damping, safety=safety),
        measures=[
            Measure("depth", "m", depth),
            Measure("deflection", "m", lambda built, frame: float(frame.displacement[:, 2].min())),
        ],
        outcomes=[
            Outcome("deepest", "m", largest("depth")),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="a dozen",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    last = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * last for fraction in (0.1, 0.3, 0.6, 1.0)])
    plots.surfaces(folder / "balls.png", shown, field="u3")
    plots.curves(folder / "deflection.png", history, ["deflection"], ylabel="deflection (m)")
    plots.curves(folder / "depth.png", history, ["depth"], ylabel="deepest overlap (m)")
