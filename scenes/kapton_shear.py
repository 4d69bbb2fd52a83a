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

`law`: "bonds" is the paper's law, in which single bonds go slack. "tension_field" is the bond-associated law with the
same moduli and tension field theory: a wide strip in shear carries a uniaxial stress, E times the larger principal
strain, 22.6 MPa, and its free ends keep their stiffness, so that the prestress needs no factor.
"""

import numpy as np

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.device.checks import InputError, count, finite, one_of
from warp_pd.interfaces import Solver
from warp_pd.measures import at_time, row_at, support_force

WIDTH, HEIGHT, THICKNESS, TENSILE, PRESTRESS = 0.38, 0.128, 25e-6, 3.5e9, 1.5e6
POISSON, FREE_ENDS = 1.0 / 3.0, 1.085


def build(
    points: int = 380,
    horizon: float = 3.0,
    law: str = "bonds",
    shear: float = 1.6e-3,
    solver: str = "newton",
    tolerance: float | None = None,
    most_iterations: int = 60,
    load_steps: int = 2,
) -> Simulation:
    """Build the scene.

    Args:
        shear: Displacement of the upper edge along x [m].
    """
    finite("shear", shear)
    bonds = one_of("law", law, ("bonds", "tension_field")) == "bonds"
    if not bonds and solver != "newton":
        raise InputError(f"solver = {solver!r}: expected 'newton' with the law 'tension_field'")
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
    lift = (FREE_ENDS if bonds else 1.0) * (HEIGHT - sheet.spacing) * PRESTRESS * (1.0 - POISSON**2) / TENSILE
    section = WIDTH * THICKNESS
    inner = line[len(line) // 4 : -(len(line) // 4)]
    return Simulation(
        sheet,
        force=_law(bonds, horizon),
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
                lambda built, frame: _stress(frame)[inner, 0].mean(),
            ),
            Measure(
                "middle_smallest_stress", "Pa",
                lambda built, frame: _stress(frame)[inner, 1].mean(),
            ),
            Measure("mean_wrinkle_level", "1", lambda built, frame: _slack(frame).mean()),
        ],
        outcomes=[Outcome("prestress", "Pa", at_time("traction_y", 0.5), PRESTRESS, "prescribed in the paper")]
        if lifts
        else [],
        fields=("principal_stress", "wrinkle_level") if bonds else ("cauchy", "wrinkle_state"),
        section="IM 6.4",
        pictures=pictures,
    )  # fmt: skip


def _law(bonds, horizon):
    """The paper's law, or the same modulus and Poisson's ratio in a sheet that wrinkles below the spacing."""
    if bonds:
        return BondBased(Bimodular(tension=TENSILE, compression=0.0), horizon=horizon)
    shear, bulk = 0.5 * TENSILE / (1.0 + POISSON), TENSILE / (3.0 - 6.0 * POISSON)
    return BondAssociated(TensionField(NeoHookean(shear, bulk)), horizon=horizon)


def _stress(frame):
    """Largest and smallest principal stress [Pa], virial or Cauchy."""
    fields = frame.point_data
    if "principal_stress" in fields:
        return fields["principal_stress"]
    return np.column_stack([fields["cauchy_1"], fields["cauchy_2"]])


def _slack(frame):
    """Wrinkle level of the points: fraction of compressed bonds, or 0 taut, 0.5 wrinkled and 1 slack."""
    fields = frame.point_data
    return fields["wrinkle_level"] if "wrinkle_level" in fields else 0.5 * fields["wrinkle_state"]


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    frame = shown[0]
    for name, axis in (("u1", "x"), ("u2", "y")):
        plots.reference(folder / f"{name}.png", shown, field=name, label=f"displacement along {axis} (m)")
    bonds = "wrinkle_level" in frame.fields
    largest, smallest = ("principal_stress_1", "principal_stress_2") if bonds else ("cauchy_1", "cauchy_2")
    limits = (0.0, float(np.quantile(frame.fields[largest], 0.995)))
    plots.reference(folder / "stress.png", shown, field=largest, label="largest principal stress (Pa)", limits=limits)
    if bonds:
        plots.directions(folder / "stress_directions.png", frame, label="largest principal stress (Pa)", across=60)
    field, top = ("wrinkle_level", 1.0) if bonds else ("wrinkle_state", 2.0)
    plots.reference(folder / "wrinkles.png", shown, field=field, label=field.replace("_", " "), limits=(0.0, top))
    line = row_at(frame.reference, 0.5 * HEIGHT)
    x = frame.reference[line, 0]
    plots.profiles(
        folder / "middle_line.png",
        [
            ("largest", x, frame.fields[largest][line] / 1e6, "C3-"),
            ("smallest", x, frame.fields[smallest][line] / 1e6, "C0-"),
        ],
        xlabel="x (m)",
        ylabel="principal stress on the middle line (MPa)",
    )
