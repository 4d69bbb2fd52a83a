"""A tube is pulled and inflated simultaneously.

Neo-Hookean rubber, exactly incompressible, radius 20 mm, 1 mm thick, 60 mm long, mu 1 MPa, initially stress-free. Both
ends stay in their planes and slide in them without friction; one is pulled away while a pump prescribes the volume. The
strain is then the same everywhere. With the stretches a around and b along, and W = mu/2 (a^2 + b^2 + 1/(a b)^2 - 3),
virtual work gives the pressure p = (h / R) (1 / (a b)) dW/da, and the force on an end, besides that of the pressure on
its lid, N = 2 pi R h dW/db.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    EnclosedVolume,
    Explicit,
    Fixed,
    Measure,
    MooneyRivlin,
    Motion,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.measures import support_force

RADIUS, LENGTH, THICKNESS, MU = 0.02, 0.06, 1e-3, 1e6
EXACT = "exact, by virtual work"


def exact_pressure(around, along):
    """Pressure [Pa] at the stretches around and along the tube."""
    return MU * THICKNESS / RADIUS * (around - 1.0 / (around**3 * along**2)) / (around * along)


def exact_force(around, along):
    """Force on an end [N]."""
    return 2.0 * np.pi * RADIUS * THICKNESS * MU * (along - 1.0 / (along**3 * around**2))


def build(
    points: int = 80,
    horizon: float = 2.015,
    weights: str = "auto",
    around: float = 1.8,
    along: float = 1.25,
    frames: int = 8,
    solver: str = "relaxation",
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points around the tube.
        around: Final stretch around the tube [-].
        along: Final stretch along the tube [-].
    """
    sheet = Sheet.tube(RADIUS, LENGTH, thickness=THICKNESS, density=1000.0, points=points)
    duration = 0.1 if solver == "explicit" else 1.0
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=frames),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=frames, ramp_steps=10 * points),
        "explicit": Explicit(duration, frames=frames, damping=50.0),
    }
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    fraction = np.linspace(0.0, 1.0, 101)
    a, b = 1.0 + (positive("around", around) - 1.0) * fraction, 1.0 + (positive("along", along) - 1.0) * fraction
    # Of the polygon that the points around form.
    empty = len(bottom) / 2.0 * RADIUS**2 * np.sin(2.0 * np.pi / len(bottom)) * LENGTH
    times = duration * fraction
    stiffness = 10.0 * MU * THICKNESS / RADIUS / empty
    # The volume falls short by pressure / stiffness.
    wanted = empty * a**2 * b + exact_pressure(a, b) / stiffness
    middle = sheet.where(lambda x, y, z: np.abs(z - 0.5 * LENGTH) < 0.1 * LENGTH)

    def around_now(built, frame):
        place = sheet.points[middle] + frame.displacement[middle]
        return float(np.hypot(place[:, 0], place[:, 1]).mean() / RADIUS)

    def along_now(frame):
        return 1.0 + float(frame.displacement[top, 2].mean()) / LENGTH

    def force_now(built, frame):
        return float(support_force(built, top)[2])

    return Simulation(
        sheet,
        force=BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon, weights=weights),
        loads=[
            *held_in_place(sheet),
            Motion(top, times=times, z=LENGTH * (b - 1.0)),
            EnclosedVolume(list(zip(times, wanted, strict=True)), stiffness),
        ],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("stretch_around", "-", around_now),
            Measure(
                "exact_pressure", "Pa", lambda built, frame: exact_pressure(around_now(built, frame), along_now(frame))
            ),
            Measure("end_force", "N", force_now),
            Measure(
                "exact_end_force", "N", lambda built, frame: exact_force(around_now(built, frame), along_now(frame))
            ),
        ],
        outcomes=[
            Outcome(
                "last_pressure", "Pa", lambda history: history[-1]["pressure"], exact_pressure(around, along), EXACT
            ),
            Outcome("last_force", "N", lambda history: history[-1]["end_force"], exact_force(around, along), EXACT),
        ],
        section="exact tube",
        pictures=pictures,
    )


def held_in_place(sheet):
    """Supports of the bottom in its plane, and of four of its points, which prevent rigid-body motion."""
    bottom = sheet.edges("bottom")
    on_x, on_y = ([sheet.nearest(*(s * RADIUS * axis)) for s in (1.0, -1.0)] for axis in np.eye(3)[:2])
    return [Fixed(bottom, "z"), Fixed(on_x, "y"), Fixed(on_y, "x")]


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[0]["time"], history[-1]["time"]])
    plots.surfaces(folder / "tube.png", shown, field="u3")
    plots.curves(
        folder / "pressure.png", history, ["pressure", "exact_pressure"], ylabel="pressure (Pa)",
        against="stretch_around", xlabel="stretch around",
    )  # fmt: skip
    plots.curves(
        folder / "end_force.png", history, ["end_force", "exact_end_force"], ylabel="force on an end (N)",
        against="stretch_around", xlabel="stretch around",
    )  # fmt: skip
