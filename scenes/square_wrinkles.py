"""A square membrane is pulled at its corners and wrinkles. IM paper, section 6.3 (figures 13 to 15).

0.5 x 0.5 x 0.001 m, 100 x 100 points, E+ 1e5 Pa, nu 1/3, no compressive modulus; four forces of 5 N pull the corners
outwards along the diagonals, the four middle points are fixed; one load step. The paper needs 6 Newton steps.

The paper prints a horizon of 5e-3 m: one spacing, four bonds per point. Such a net has no shear stiffness along its
lines; pulled at its corners it deforms into a shape in which no bond is compressed, without any wrinkled region
(`--horizon 1`). The paper's pictures show wrinkles, so here the horizon is that of its other examples, 3 spacings.
Strains are far from small where the 5 N act: against 0.1 N/m of stiffness times spacing, the bonds of a corner point
stretch to several times their length. With `--set pull=0.05` strains stay small.
"""

import numpy as np

from warp_pd import Bimodular, BondBased, Fixed, Measure, Newton, PointForce, Relaxation, Sheet, Simulation
from warp_pd.device.checks import one_of, positive
from warp_pd.interfaces import Solver

SIDE = 0.5


def build(
    points: int = 100,
    horizon: float = 3.0,
    pull: float = 5.0,
    solver: str = "newton",
    tolerance: float | None = None,
    most_iterations: int = 60,
) -> Simulation:
    """Build the scene.

    Args:
        pull: Force on each corner [N].
    """
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, most_iterations=most_iterations),
        "relaxation": Relaxation(tolerance=tolerance, ramp_steps=20 * points),
    }
    sheet = Sheet.rectangle(SIDE, SIDE, thickness=1e-3, density=1000.0, points=points, centred=True)
    corners = [sheet.nearest(x, y) for x in (0.0, SIDE) for y in (0.0, SIDE)]
    middle = sheet.where(lambda x, y: np.maximum(abs(x - 0.5 * SIDE), abs(y - 0.5 * SIDE)) < 0.8 * sheet.spacing)
    outwards = np.sign(sheet.points[corners] - 0.5 * SIDE) * positive("pull", pull) / np.sqrt(2.0)
    pulls = [
        PointForce([corner], (fx, fy, 0.0), ramp=[(0.0, 0.0), (1.0, 1.0)])
        for corner, (fx, fy) in zip(corners, outwards, strict=True)
    ]
    return Simulation(
        sheet,
        force=BondBased(Bimodular(tension=1e5, compression=0.0), horizon=horizon),
        loads=[Fixed(range(sheet.size), "z"), Fixed(middle), *pulls],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("corner_displacement", "m", lambda built, frame: np.abs(frame.displacement[corners, :2]).mean()),
            Measure("wrinkled_share", "1", lambda built, frame: (frame.point_data["wrinkle_level"] > 0.0).mean()),
            Measure("mean_wrinkle_level", "1", lambda built, frame: frame.point_data["wrinkle_level"].mean()),
            Measure("largest_stress", "Pa", lambda built, frame: frame.point_data["principal_stress"][:, 0].max()),
        ],
        fields=("principal_stress", "wrinkle_level"),
        section="IM 6.3",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    frame = shown[0]
    for name, axis in (("u1", "x"), ("u2", "y")):
        plots.reference(folder / f"{name}.png", shown, field=name, label=f"displacement along {axis} (m)")
    # Otherwise the corner points alone would set the scale.
    high = float(np.quantile(frame.fields["principal_stress_1"], 0.99))
    plots.reference(
        folder / "stress.png", shown, field="principal_stress_1", label="largest principal stress (Pa)",
        limits=(0.0, high),
    )  # fmt: skip
    frame.fields["principal_stress"][:, 0] = np.minimum(frame.fields["principal_stress"][:, 0], high)
    plots.directions(folder / "stress_directions.png", frame, label="largest principal stress (Pa)")
    plots.reference(folder / "wrinkles.png", shown, field="wrinkle_level", label="wrinkle level", limits=(0.0, 1.0))
