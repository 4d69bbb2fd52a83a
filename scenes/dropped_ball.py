"""A ball is dropped on a trampoline and bounces.

A square of rubber (neo-Hookean, mu 0.4 MPa, 1 mm thick), stretched and clamped at its edges, and a ball without
friction, which falls on its middle. There is no damping. Points that touch the ball take its velocity immediately, as
in an inelastic impact; the ball rebounds lower because of this loss and the waves that remain in the sheet.

There is no closed form. The check is the energy balance: the energies of ball and sheet and the contact loss sum to the
initial energy of the ball.
"""

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Free,
    Measure,
    NeoHookean,
    Outcome,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
)
from warp_pd.device.checks import count, positive
from warp_pd.measures import worst_balance

MU = 0.4e6


def build(
    points: int = 41,
    horizon: float = 3.015,
    stretch: float = 1.2,
    diameter: float = 0.08,
    mass: float = 0.15,
    drop: float = 0.05,
    duration: float = 0.4,
    frames: int = 80,
    friction: float = 0.0,
    safety: float = 0.15,
) -> Simulation:
    """Build the scene.

    Args:
        stretch: Stretch of the sheet before the ball falls [-].
        diameter: Diameter of the ball [m].
        mass: Mass of the ball [kg].
        drop: Height from which the ball falls [m].
    """
    sheet = Sheet.rectangle(0.3, 0.3, thickness=1e-3, density=1000.0, points=count("points", points, 11))
    radius = 0.5 * positive("diameter", diameter)
    middle = 0.15
    ball = Free(mass, position=(middle, middle, radius + positive("drop", drop)))
    return Simulation(
        sheet.prestretched(stretch),
        force=BondAssociated(NeoHookean(mu=MU, bulk=100.0 * MU), horizon=horizon, weights="corrected"),
        loads=[Fixed(sheet.edges("all"))],
        contact=RigidBody(Sphere(diameter), ball, friction=friction, name="ball"),
        solver=Explicit(duration, frames=frames, safety=safety),
        measures=[Measure("deflection", "m", lambda built, frame: float(frame.displacement[:, 2].min()))],
        outcomes=[
            Outcome("return_height", "m", highest),
            Outcome("energy_error", "1", energy_error),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="dropped ball",
        pictures=pictures,
    )


def highest(history):
    """Rebound height of the ball's lowest point above the plane of the sheet [m]; None while it falls or rises."""
    heights = [row["ball_position_z"] for row in history]
    rise = heights[heights.index(min(heights)) :]
    return max(rise) if max(rise) > rise[-1] else None


def energy_error(history):
    """Change of the total energy with losses, divided by the initial energy of the ball."""
    names = ("ball_kinetic", "ball_potential", "ball_loss", "half_step_kinetic", "strain")
    totals = [sum(row[name] for name in names) for row in history]
    scale = max(row["ball_kinetic"] for row in history)
    return max(abs(total - totals[0]) for total in totals) / scale


def pictures(history, folder):
    from warp_pd.viewer import plots

    heights = [row["ball_position_z"] for row in history]
    first = heights.index(min(heights))
    chosen = (0, first // 2, first, min(2 * first, len(history) - 1))
    shown = plots.frames_at(folder, [history[k]["time"] for k in chosen])
    plots.surfaces(folder / "drop.png", shown, field="u3")
    plots.curves(folder / "height.png", history, ["ball_position_z", "deflection"], ylabel="height (m)")
    # The sheet was stretched before: its energy counts from there.
    begin = history[0]["strain"]
    rows = [{**row, "sheet": row["kinetic"] + row["strain"] - begin} for row in history]
    names = ["ball_kinetic", "ball_potential", "sheet", "ball_loss"]
    plots.curves(folder / "energy.png", rows, names, ylabel="energy (J)")
