"""A cantilever of two moduli bends under an end load. IM paper, section 6.2 (figures 8 to 11, tables 1 and 2).

2 x 0.21 x 0.01 m in plane stress, E+ 3.84e8 Pa, nu 1/3, left end fixed, 1000 N down on point A in ten load steps;
200 x 21 points, horizon of 3 spacings. `ratio` is E+/E-.

The paper writes c-/c+ = 1, 5, 10, 20 in the text and c+/c- in the tables and figures. It means c+/c-: it gives E+;
its deformations grow with the ratio, which they would not with a stiffer compressed side; and its neutral layer
shifts up, to the stretched side, which is therefore the stiffer one. With c-/c+ the mirrored beam would bend less and
less.

Point A is taken as the middle of the free end. Membrane finite elements (converged to 1e-4) move the end of the
middle line of the beam of equal moduli down by 0.7690 m and in by 0.1867 m; the paper gives curves without numbers.
A horizon of 3 spacings on 21 points across is 8 % too stiff in tension and 15 % in bending; `--set
micromoduli=corrected` takes that away. `--set stiffness=constant` uses the paper's other stiffness.
"""

from warp_pd import Bimodular, BondBased, Fixed, Measure, Newton, PointForce, Relaxation, Sheet, Simulation
from warp_pd.device.checks import InputError, finite, one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.measures import row_at

LENGTH, HEIGHT, TENSILE = 2.0, 0.21, 3.84e8
DOWN, IN = -0.7690, -0.1867


def build(
    points: int = 200,
    horizon: float = 3.0,
    ratio: float = 5.0,
    load: float = 1000.0,
    load_steps: int = 10,
    solver: str = "newton",
    stiffness: str = "tangent",
    micromoduli: str = "published",
    tolerance: float | None = None,
    most_iterations: int = 30,
    most_cuts: int = 6,
) -> Simulation:
    """Build the scene.

    Args:
        ratio: E+/E-, tensile over compressive modulus [-].
        load: End load, downwards [N].
        stiffness: Newton's matrix: "tangent", or "constant" as in the paper.
        micromoduli: "published", or "corrected" for a horizon that cuts families short.
        most_cuts: Largest number of halved load steps.
    """
    if solver == "relaxation" and stiffness != "tangent":
        raise InputError(f"stiffness = {stiffness!r}: expected 'tangent' with solver 'relaxation'")
    finite("load", load)
    solvers: dict[str, Solver] = {
        "newton": Newton(
            tolerance=tolerance, load_steps=load_steps, stiffness=stiffness, most_iterations=most_iterations,
            most_cuts=most_cuts,
        ),
        "relaxation": Relaxation(tolerance=tolerance, load_steps=load_steps),
    }  # fmt: skip
    sheet = Sheet.rectangle(LENGTH, HEIGHT, thickness=0.01, density=1000.0, points=points, centred=True)
    end = sheet.nearest(LENGTH, 0.5 * HEIGHT)
    known = ratio == 1.0 and load == 1000.0
    source = "membrane finite elements, converged to 1e-4"
    return Simulation(
        sheet,
        force=BondBased(
            Bimodular(tension=TENSILE, compression=TENSILE / positive("ratio", ratio)),
            horizon=horizon, micromoduli=micromoduli,
        ),
        loads=[
            Fixed(sheet.edges("left")),
            Fixed(range(sheet.size), "z"),
            PointForce([end], (0.0, -load, 0.0), ramp=[(0.0, 0.0), (1.0, 1.0)]),
        ],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure(
                "end_down", "m", lambda built, frame: frame.displacement[end, 1], DOWN if known else None, source
            ),
            Measure("end_in", "m", lambda built, frame: frame.displacement[end, 0], IN if known else None, source),
        ],
        fields=("principal_stress",),
        section="IM 6.2",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "deformed.png", shown, field="u2")
    line = row_at(shown[0].reference, 0.5 * HEIGHT)
    x = shown[0].reference[line, 0]
    plots.profiles(
        folder / "middle_line.png",
        [(name, x, shown[0].fields[name][line], style) for name, style in (("u1", "C0-"), ("u2", "C3-"))],
        xlabel="x (m)",
        ylabel="displacement (m)",
    )
