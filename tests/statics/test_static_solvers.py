"""Newton and Relaxation: what they compile, and wrong input in one line."""

import gc
import weakref

import pytest
from helpers import refused, square
from hypothesis import given
from hypothesis import strategies as st
from small_runs import cli, simulate

from warp_pd import ArcLength, BoundaryForce, Explicit, Fixed, Newton, Pressure, Relaxation
from warp_pd.geometry.triangulation import Lattice
from warp_pd.statics.descent import shortening
from warp_pd.statics.multigrid import coarser
from warp_pd.statics.newton_settings import Report


def test_explicit_runs_compile_no_tangent_and_newton_no_steps():
    sheet = square(9)
    kernels, fields = {}, {}
    for solver in (Explicit(1.0), Relaxation(), Newton()):
        built, name = simulate(sheet, solver, loads=[Fixed(sheet.edges())]).build("cpu"), type(solver).__name__
        kernels[name] = {part for stage in built.context.stages.values() for launch in stage for part in launch.parts}
        fields[name] = {stored.name for stored in built.context.fields}
    tangent = {"linearise", "product"}
    assert tangent <= kernels["Newton"]
    assert not any(word in name for word in tangent for name in kernels["Explicit"] | kernels["Relaxation"])
    stepping = {"step", "damping", "direction", "previous_force"}
    assert stepping <= fields["Relaxation"]
    assert not stepping & fields["Newton"]
    assert "kinetic_energy" in kernels["Explicit"] and "kinetic_energy" not in kernels["Newton"]


@pytest.mark.parametrize(
    "solver", [Explicit(1e-3), Relaxation(tolerance=0.5), Newton()], ids=lambda s: type(s).__name__
)
def test_arrays_are_free_as_soon_as_nobody_has_the_result(solver):
    sheet = square(9)
    result = simulate(sheet, solver, loads=[Fixed(sheet.edges()), Pressure(1.0)]).run(device="cpu")
    left = [weakref.ref(stored.array) for stored in result.built.context.fields]
    gc.disable()
    try:
        del result
        assert left and not [array for array in left if array() is not None]
    finally:
        gc.enable()


def test_the_summary_of_newton_counts_the_finest_lattice():
    coarse = {"points": 9, "shares": [1.0], "products": 3, "residuals": [0.2]}
    fine = {"points": 25, "shares": [0.5, 1.0], "products": 7, "residuals": [0.1, 1e-9]}
    steps = [{"lattices": [coarse, fine], "rounds": 2}, {"lattices": [fine], "rounds": 1}]
    found = Report("Newton", "multigrid", steps).summary(25, 1.0)
    assert (found["iterations"], found["products"], found["rounds"]) == (4, 14, 3)
    assert found["residuals"] == 2 * [0.1, 1e-9]


def test_coarser_lattices_cover_the_same_rectangle():
    found = coarser(Lattice(65, 33, 0.02, 0.03))
    assert len(found) > 1 and (found[0].columns, found[0].rows) == (33, 17)
    for lattice in found:
        assert (lattice.dx * (lattice.columns - 1), lattice.dy * (lattice.rows - 1)) == pytest.approx((1.28, 0.96))


WRONG = [
    (lambda: Newton(tolerance=0.0), "tolerance = 0.0"),
    (lambda: Newton(load_steps=0), "load_steps = 0"),
    (lambda: Newton(most_iterations=0), "most_iterations = 0"),
    (lambda: Newton(most_cuts=-1), "most_cuts = -1"),
    (lambda: Newton(preconditioner="multigird"), "did you mean 'multigrid'"),
    (lambda: ArcLength(switch=1, modes=0), "switch = 1: expected modes > 0"),
    (lambda: simulate(square(9), ArcLength(switch=1, preconditioner="jacobi")).build("cpu"), "got 'jacobi'"),
    (lambda: Relaxation(tolerance=0.0), "tolerance = 0.0"),
    (lambda: Relaxation(load_steps=0), "load_steps = 0"),
    (lambda: Relaxation(most_steps=0), "most_steps = 0"),
    (
        lambda: simulate(square(9), Newton(preconditioner="multigrid")).build("cpu"),
        "preconditioner = 'multigrid': sheet of 81 points: expected more than 300 points; use 'direct'",
    ),
    (lambda: simulate(square(9), Newton(preconditioner="algebraic")).build("cpu"), "expected more than 300 points"),
    (
        lambda: simulate(square(21).as_cloud(), Newton(preconditioner="multigrid")).build("cpu"),
        "expected an uncut rectangle; use 'algebraic' or 'direct'",
    ),
    (
        lambda: simulate(square(9), Newton(preconditioner="algebraic"), horizon=3.015).build("cpu"),
        "horizon = 3.015: expected at most 2.5; use 'direct'",
    ),
    (lambda: simulate(square(21).inclusion((0.05, 0.05), 0.02), Newton()).build("cpu"), "sheet.inclusions"),
    (lambda: simulate(square(21), Newton(), loads=[BoundaryForce(1e10)]).build("cpu"), "BoundaryForce"),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_input_is_one_line(make, text):
    with refused(text):
        make()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["pressure", "--solver", "newtn"], "did you mean 'newton'"),
        (["pressure", "--solver", "newton", "--weights", "published"], "which have an energy and so a tangent"),
        (["ball_penetration", "--solver", "newton"], "solver is not an argument of this scene; expected one of points"),
    ],
)
def test_wrong_solver_on_the_command_line(arguments, text, tmp_path):
    done = cli("run", *arguments, "--device", "cpu", "--quiet", "--out", tmp_path)
    assert done.exit_code == 2
    assert text in done.output


@given(work=st.floats(1e-100, 1e100), left=st.floats())
def test_a_refused_trial_is_followed_by_a_shorter_one(work, left):
    assert 0.1 <= shortening(work, left) <= 0.5
    assert shortening(work, work) == 0.1
