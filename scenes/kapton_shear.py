"""A stretched Kapton membrane is sheared and wrinkles. IM paper, section 6.4 (figures 17 to 19).

0.38 x 0.128 m, 25 um thick, E+ 3.5e9 Pa, nu 1/3, no compressive modulus; 380 x 128 points, horizon of 3 spacings. The
lower edge is fixed; the upper edge moves along y until the membrane carries 1.5 MPa, then by 1.6 mm along x. The
paper takes 16 Newton steps in all and compares principal stresses on the middle line, which it shows as curves, with
finite elements; its own lie above those, more so at larger horizons.

The paper does not say how the prestress is applied. Here the upper edge moves up first. A wide strip would need height
x 1.5 MPa (1 - nu^2) / E. The ends of this one are free and contract without resistance, because the membrane takes no
compression, so it needs 1.085 times as much for a mean traction of 1.5 MPa at the paper's horizon. The scene reports
the resulting traction as `prestress`. The paper applies all loads in one load step, here `--set load_steps=1`: fewer
steps of Newton to the same equilibrium, but no prestress to report. Use multiples of 95 points: cells are then square,
as in the paper. Otherwise a horizon of just 3 spacings loses the longest bonds along one axis, which changes the
prestress by up to 40 %.
"""

import numpy as np

from warp_pd import (
    Bimodular,
    BondBased,
    Fixed,
    Measure,
    Motion,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.checks import count, finite, one_of
from warp_pd.measures import at_time, row_at, support_force
from warp_pd.solvers import Solver

WIDTH, HEIGHT, THICKNESS, TENSILE, PRESTRESS = 0.38, 0.128, 25e-6, 3.5e9, 1.5e6
FREE_ENDS = 1.085


def build(
    points: int = 380,
    horizon: float = 3.0,
    shear: float = 1.6e-3,
    solver: str = "newton",
    tolerance: float | None = None,
    most_iterations: int = 60,
    load_steps: int = 2,
) -> Simulation:
    finite("shear", shear)
    # Half of the load path lifts the upper edge. In an odd number of load steps none ends there, with the prestress.
    lifts = count("load_steps", load_steps, 1) % 2 == 0
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=load_steps, most_iterations=most_iterations),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=load_steps, ramp_steps=10 * points),
    }
    sheet = Sheet.rectangle(WIDTH, HEIGHT, thickness=THICKNESS, density=1420.0, points=points, centred=True)
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    line = row_at(sheet.points, 0.5 * HEIGHT)
    # The held rows are closer together than the edges by one spacing.
    lift = FREE_ENDS * (HEIGHT - sheet.spacing) * PRESTRESS * (1.0 - 1.0 / 9.0) / TENSILE
    section = WIDTH * THICKNESS
    inner = line[len(line) // 4 : -(len(line) // 4)]
    return Simulation(
        sheet,
        force=BondBased(Bimodular(tension=TENSILE, compression=0.0), horizon=horizon),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(bottom),
            Motion(top, times=[0.0, 0.5, 1.0], x=[0.0, 0.0, shear], y=[0.0, lift, lift]),
        ],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("traction_y", "Pa", lambda built, frame: support_force(built, top)[1] / section),
            Measure("traction_x", "Pa", lambda built, frame: support_force(built, top)[0] / section),
            Measure(
                "middle_largest_stress", "Pa",
                lambda built, frame: frame.point_data["principal_stress"][inner, 0].mean(),
            ),
            Measure(
                "middle_smallest_stress", "Pa",
                lambda built, frame: frame.point_data["principal_stress"][inner, 1].mean(),
            ),
            Measure("mean_wrinkle_level", "1", lambda built, frame: frame.point_data["wrinkle_level"].mean()),
        ],
        outcomes=[Outcome("prestress", "Pa", at_time("traction_y", 0.5), PRESTRESS, "prescribed in the paper")]
        if lifts
        else [],
        fields=("principal_stress", "wrinkle_level"),
        section="IM 6.4",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.output import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    frame = shown[0]
    for name, axis in (("u1", "x"), ("u2", "y")):
        plots.reference(folder / f"{name}.png", shown, field=name, label=f"displacement along {axis} (m)")
    limits = (0.0, float(np.quantile(frame.fields["principal_stress_1"], 0.995)))
    plots.reference(
        folder / "stress.png", shown, field="principal_stress_1", label="largest principal stress (Pa)", limits=limits
    )
    plots.directions(folder / "stress_directions.png", frame, label="largest principal stress (Pa)", across=60)
    plots.reference(folder / "wrinkles.png", shown, field="wrinkle_level", label="wrinkle level", limits=(0.0, 1.0))
    line = row_at(frame.reference, 0.5 * HEIGHT)
    x = frame.reference[line, 0]
    plots.profiles(
        folder / "middle_line.png",
        [
            ("largest", x, frame.fields["principal_stress_1"][line] / 1e6, "C3-"),
            ("smallest", x, frame.fields["principal_stress_2"][line] / 1e6, "C0-"),
        ],
        xlabel="x (m)",
        ylabel="principal stress on the middle line (MPa)",
    )
