"""Newton and relaxation: the tangent, convergence, agreement, and what happens where there is no answer."""

import json

import numpy as np
import pytest
import warp as wp
from click.testing import CliRunner
from helpers import GENT, NEO, StopAt, jittered, rough, sever, square
from material_kernels import evaluate, respond

from warp_pd import (
    BodyForce,
    BondAssociated,
    BoundaryForce,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Motion,
    NeoHookean,
    Newton,
    Pressure,
    Relaxation,
    RigidBall,
    Simulation,
)
from warp_pd.cli import build_scene, main
from warp_pd.solvers.equilibrium import assign
from warp_pd.solvers.tangent import SparseTangent, Tangent


def simulate(sheet, solver, *, material=NEO, horizon=2.015, weights="plain", law=None, **parts):
    force = BondAssociated(material, horizon=horizon, weights=weights, **(law or {}))
    return Simulation(sheet, force=force, solver=solver, **parts)


def run(sheet, solver, precision=None, **parts):
    return simulate(sheet, solver, **parts).run(device="cpu", precision=precision)


# The tangent --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", [NEO, GENT, NeoHookean(1.0, 1.0), NeoHookean(1e3, 1e7)], ids=str)
def test_moduli_are_the_derivative_of_the_stress(material):
    rng = np.random.default_rng(0)
    F = np.array([[1.4, 0.1], [0.0, 1.1]]) + rng.uniform(-0.4, 0.4, (40, 2, 2))
    F = F[np.linalg.det(F) > 0.3]
    G = F.transpose(0, 2, 1) @ F - np.eye(2)
    stress, moduli = respond(material, G, 64)
    assert stress == pytest.approx(evaluate(material, G, 64)[0], rel=1e-12, abs=1e-12 * np.abs(stress).max())
    T = moduli[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    step = 1e-5
    for column, entries in enumerate([[(0, 0)], [(1, 1)], [(0, 1), (1, 0)]]):
        change = np.zeros((2, 2))
        for entry in entries:
            change[entry] = step
        slope = (evaluate(material, G + change, 64)[0] - evaluate(material, G - change, 64)[0]) / (2.0 * step)
        found = np.stack([slope[:, 0, 0], slope[:, 1, 1], 2.0 * slope[:, 0, 1]], axis=1)
        # The material's own iteration ends at 1e-13 of the volume: times K and over the step.
        allowed = 1e-7 * np.abs(T).max() + 1e-8 * material.bulk
        assert found == pytest.approx(T[:, :, column], abs=allowed)


def tangent_of(sheet, assembled, loads=(), damage=None, crack=None, **parts):
    """A tangent on a sheet with a crack, whatever Newton itself allows."""
    simulation = simulate(sheet, Explicit(1.0), loads=loads, damage=damage, **parts)
    built = simulation.build("cpu", 64)
    if crack is not None:
        sever(built, crack)
    follower = any(isinstance(load, Pressure) for load in loads)
    tangent = Tangent(
        built.context, built.force, built.context.held, built.has_loads, follower, built.state.displacement,
        built.state.force, built.state.external, assembled,
    )  # fmt: skip
    built.context.compile()
    return built, tangent


CRACK = ((0.02, 0.048), (0.07, 0.062))
CASES = {
    "lattice": (square(11), {"horizon": 3.15}),
    "assembled lattice": (square(11), {"assembled": True, "weights": "corrected"}),
    "assembled, 32 members and more": (square(15), {"assembled": True, "horizon": 4.15}),
    "assembled Gent": (square(11), {"assembled": True, "material": GENT, "horizon": 1.5}),
    "Gent cloud": (jittered(11), {"material": GENT}),
    "broken lattice, dropped": (square(11), {"crack": CRACK, "damage": CriticalStretch(9.0)}),
    "broken lattice, redistributed": (
        square(11), {"crack": CRACK, "damage": CriticalStretch(9.0), "law": {"broken": "redistribute"}},
    ),
    "broken cloud": (jittered(11), {"crack": CRACK, "damage": CriticalStretch(9.0)}),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_tangent_is_the_derivative_of_the_force(case):
    sheet, parts = CASES[case]
    parts = {"assembled": False, **parts}
    _, tangent = tangent_of(sheet, loads=[Fixed(sheet.edges("left"))], **parts)
    displacement = rough(sheet)
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(3, sheet.size, 3)) * sheet.spacing
    for direction in directions[1:]:  # single points, their own blocks and those of their neighbours
        direction[rng.permutation(sheet.size)[3:]] = 0.0
    products = []
    for direction in directions:
        assign(tangent.displacement, displacement)
        tangent.linearise(0.0)
        assign(tangent.vector, direction)
        tangent.run("product")
        product = tangent.image.numpy().copy()
        products.append(product)
        ends = []
        for sign in (1.0, -1.0):
            assign(tangent.displacement, displacement + sign * 1e-6 * direction)
            tangent.evaluate()
            ends.append(tangent.residual.numpy().copy())
        expected = (ends[1] - ends[0]) / 2e-6
        assert np.abs(expected).max() > 0.0
        assert product == pytest.approx(expected, abs=2e-8 * np.abs(expected).max())
    free = directions.copy()
    free[:, sheet.edges("left")] = 0.0
    # Symmetry, on the free components: a . K b = b . K a.
    assign(tangent.displacement, displacement)
    images = []
    for direction in free:
        assign(tangent.vector, direction)
        tangent.run("product")
        images.append(tangent.image.numpy().copy())
    scale = np.abs(free[0] * images[0]).sum()
    assert abs((free[0] * images[1]).sum() - (free[1] * images[0]).sum()) < 1e-12 * scale
    # The sparse matrix, and the diagonal blocks, are the same operator.
    assign(tangent.displacement, displacement)
    tangent.linearise(0.0)
    sparse = SparseTangent(tangent)
    found = sparse.matrix() @ free[0].ravel()[sparse.free]
    assert found == pytest.approx(images[0].ravel()[sparse.free], abs=1e-11 * np.abs(images[0]).max())
    blocks = np.zeros((sheet.size, 3, 3))
    matrix = sparse.matrix().toarray()
    for order, point in enumerate(np.flatnonzero(sparse.free.reshape(-1, 3)[:, 0])):
        blocks[point] = matrix[3 * order : 3 * order + 3, 3 * order : 3 * order + 3]
    inverse = tangent.inverse_blocks.numpy()
    for point in np.flatnonzero(sparse.free.reshape(-1, 3)[:, 0]):
        values = np.linalg.eigvalsh(blocks[point])
        if values[0] > 1e-5 * values[-1]:
            assert inverse[point] @ blocks[point] == pytest.approx(np.eye(3), abs=1e-6)


def test_follower_pressure_makes_the_tangent_unsymmetric():
    sheet = square(11)
    displacement = rough(sheet)
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, sheet.size, 3)) * sheet.spacing
    asymmetries = []
    for loads in ([Fixed(sheet.edges()), Pressure(500.0)], [Fixed(sheet.edges("left")), Pressure(500.0)]):
        _, tangent = tangent_of(sheet, False, loads=loads, weights="corrected", horizon=1.5)
        tangent.set_loads(np.zeros((sheet.size, 3)), 500.0)
        free = ((tangent.held[:, None] >> np.arange(3)) & 1) == 0
        images = []
        for direction in (a * free, b * free):
            assign(tangent.displacement, displacement)
            tangent.linearise(0.0)
            assign(tangent.vector, direction)
            tangent.run("product")
            images.append(tangent.image.numpy().copy())
            ends = []
            for sign in (1.0, -1.0):
                assign(tangent.displacement, displacement + sign * 1e-6 * direction)
                tangent.evaluate()
                ends.append(tangent.residual.numpy().copy())
            expected = (ends[1] - ends[0]) / 2e-6
            assert images[-1] == pytest.approx(expected, abs=2e-8 * np.abs(expected).max())
        scale = np.sqrt((a * free * images[0]).sum() * (b * free * images[1]).sum())
        asymmetries.append(abs((a * free * images[1]).sum() - (b * free * images[0]).sum()) / scale)
    assert min(asymmetries) > 1e-3


# Newton -------------------------------------------------------------------------------------------------


def finest(result):
    return result.summary["solve"]["residuals"]


@pytest.mark.parametrize("preconditioner", ["multigrid", "direct", "jacobi"])
def test_newton_converges_quadratically(preconditioner):
    """Near the solution r(n+1) <= c r(n)^2, with exact linear solves."""
    sheet = square(21)
    solver = Newton(tolerance=1e-13, preconditioner=preconditioner)
    result = run(
        sheet, solver, loads=[Fixed(sheet.edges()), BodyForce((0.0, 0.0, 4000.0))], weights="corrected", horizon=1.5
    )
    assert result.status == "finished"
    r = np.array(finest(result))
    near = np.flatnonzero((r[:-1] < 1e-1) & (r[1:] > 1e-11))
    assert len(near) >= 1
    assert (r[near + 1] < 50.0 * r[near] ** 2 + 1e-6 * r[near]).all()
    assert len(r) <= 16


SAME = {
    "pressure on a lattice": (square(21), {"loads": [Pressure(5.0)]}),
    "dead pressure, Gent": (square(21), {"loads": [Pressure(5.0, follower=False)], "material": GENT}),
    "cloud": (jittered(13), {"loads": [Pressure(5.0)]}),
    "cut": (square(13).cut((0.04, 0.052), (0.06, 0.052)), {"loads": [Pressure(5.0)]}),
    "small lattice": (square(9), {"loads": [Pressure(5.0)]}),
}


@pytest.mark.parametrize("case", SAME)
def test_newton_and_relaxation_agree(case):
    sheet, parts = SAME[case]
    parts = {**parts, "loads": [Fixed(sheet.edges()), *parts["loads"]]}
    first = run(sheet, Newton(), **parts)
    second = run(sheet, Relaxation(tolerance=1e-9), **parts)
    assert first.status == second.status == "finished"
    assert first.summary["residual"] <= 1e-8
    scale = np.abs(first.frame.displacement).max()
    assert np.abs(first.frame.displacement - second.frame.displacement).max() < 1e-6 * scale


@pytest.mark.parametrize(("scene", "measure"), [("pressure", "center_deflection"), ("tension", "edge_contraction")])
@pytest.mark.parametrize("solver", ["newton", "relaxation"])
def test_both_reach_the_finite_elements(scene, measure, solver):
    result = build_scene(scene, {"points": 31, "horizon": 1.5, "solver": solver}).run(device="cpu")
    assert result.status == "finished"
    assert abs(result.summary["measures"][measure]["error"]) < 2e-3
    if solver == "newton":
        assert result.summary["solve"]["iterations"] <= 10


def test_load_steps_are_frames_and_end_where_one_step_does():
    sheet = square(21)
    loads = [
        Fixed(sheet.edges("left")),
        Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.05], y=0.0, z=0.0),
        Pressure(2.0, ramp=[(0.0, 0.0), (1.0, 1.0)]),
    ]
    once, thrice = run(sheet, Newton(), loads=loads), run(sheet, Newton(load_steps=3), loads=loads)
    assert [row["time"] for row in thrice.history] == pytest.approx([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
    assert thrice.frame.displacement == pytest.approx(once.frame.displacement, abs=1e-9)
    relaxed = run(sheet, Relaxation(tolerance=1e-8, load_steps=2, ramp_steps=100), loads=loads)
    assert relaxed.frame.displacement == pytest.approx(once.frame.displacement, abs=1e-7)


def test_too_large_a_step_is_cut():
    """Gent locks at a stretch of 3.5 beyond which it has no stress: one step across the sheet starts beyond it."""
    sheet = square(13)
    material = type(GENT)(mu=1e3, bulk=2e5, lock=3.0)
    motion = Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.08], y=0.0, z=0.0)
    result = run(sheet, Newton(), material=material, loads=[Fixed(sheet.edges("left")), motion])
    assert result.status == "finished"
    assert result.summary["solve"]["reached"] == 1.0


# Where there is little or no answer ---------------------------------------------------------------------


@pytest.mark.parametrize("solver", [Newton(), Relaxation()], ids=["newton", "relaxation"])
def test_a_slack_sheet_without_load_is_at_rest_at_once(solver):
    sheet = square(21)
    result = run(sheet, solver, loads=[Fixed(sheet.edges())])
    assert result.status == "finished" and result.summary["residual"] == 0.0
    assert np.abs(result.frame.displacement).max() == 0.0


@pytest.mark.parametrize("sheet", [square(21), jittered(11)], ids=["lattice", "cloud"])
@pytest.mark.parametrize("pressure", [0.0, 2.0])
def test_edges_moved_inwards_end_with_an_answer_or_a_status(sheet, pressure):
    loads = [
        Fixed(sheet.edges("left")),
        Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, -0.01], y=0.0, z=0.0),
    ]
    loads += [Pressure(pressure)] if pressure else []
    result = run(sheet, Newton(most_cuts=2, most_iterations=15), loads=loads)
    assert result.status in ("finished", "not converged")
    assert np.isfinite(result.frame.displacement).all()
    if result.status == "finished":
        assert result.summary["residual"] <= 1e-8
    else:
        assert "last good load step" in result.summary["message"]


def test_no_convergence_keeps_the_last_good_load_step():
    """The second half of the path asks for more than the Gent lock allows."""
    sheet = square(13)
    material = type(GENT)(mu=1e3, bulk=2e5, lock=1.0)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.3], y=0.0, z=0.0)]
    result = run(sheet, Newton(load_steps=4, most_cuts=3, most_iterations=12), material=material, loads=loads)
    solve = result.summary["solve"]
    assert result.status == "not converged" and 0.0 < solve["reached"] < 1.0
    assert result.built.to_numpy(result.built.state.displacement) == pytest.approx(result.frame.displacement)
    assert result.frame.displacement[sheet.edges("right"), 0] == pytest.approx(0.3 * solve["reached"])
    alone = run(
        sheet, Newton(tolerance=1e-8), material=material,
        loads=[loads[0], Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.3 * solve["reached"]], y=0.0, z=0.0)],
    )  # fmt: skip
    assert alone.frame.displacement == pytest.approx(result.frame.displacement, abs=1e-7)


SCENE = """
from warp_pd import *

def build(points=9):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=points)
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), SOLVER, [Fixed(sheet.edges()), Pressure(5.0)])
"""


@pytest.mark.parametrize("solver", ["Newton(most_iterations=1, most_cuts=0)", "Relaxation(most_steps=50)"])
def test_no_convergence_ends_the_command_with_code_3(solver, tmp_path):
    scene = tmp_path / "scene.py"
    scene.write_text(SCENE.replace("SOLVER", solver))
    done = CliRunner().invoke(main, ["run", str(scene), "--device", "cpu", "--quiet", "--no-usd", "--out",
                                     str(tmp_path / "out")])  # fmt: skip
    assert done.exit_code == 3, done.output
    assert "not converged" in done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "not converged" and summary["solve"]["reached"] == 0.0
    assert summary["solve"]["seconds"] > 0.0


# Relaxation ---------------------------------------------------------------------------------------------


def test_relaxation_takes_published_weights_and_newton_refuses_them():
    sheet = square(11)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    assert run(sheet, Relaxation(), loads=loads, weights="published").status == "finished"
    with pytest.raises(InputError, match="weights = 'published': allowed with the solver Newton are"):
        simulate(sheet, Newton(), loads=loads, weights="published").build("cpu")


@pytest.mark.parametrize("solver", [Newton(), Relaxation()], ids=["newton", "relaxation"])
def test_float32(solver):
    sheet = square(21)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    narrow = run(sheet, solver, precision=32, loads=loads)
    wide = run(sheet, Newton(), loads=loads)
    assert narrow.status == "finished" and narrow.summary["residual"] <= 1e-4
    assert narrow.frame.displacement == pytest.approx(wide.frame.displacement, abs=2e-3 * 0.016)


@pytest.mark.parametrize(("tolerance", "status"), [(1e-9, "finished"), (1e-15, "not converged")])
def test_a_load_step_that_begins_without_steps_left_looks_at_the_residual_once(tolerance, status):
    sheet = square(9)
    solver = Relaxation(load_steps=4, ramp_steps=7, most_steps=100, tolerance=tolerance)
    result = run(sheet, solver, loads=[Fixed(sheet.edges()), Pressure(5.0)])
    entries = result.summary["solve"]["load_steps"]
    assert result.status == status
    assert [entry["steps"] for entry in entries[1:]] == [50] * len(entries[1:])


def test_relaxation_breaks_only_at_rest_and_relaxes_again():
    """A notched strip pulled until its tip bonds pass the criterion: it tears, and what is left is at rest."""
    sheet = square(13).cut((-0.01, 0.051), (0.03, 0.051))
    motion = Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=[0.0, 0.05], z=0.0)
    solver = Relaxation(tolerance=1e-5, load_steps=2, ramp_steps=100, most_steps=20_000)
    loads = [Fixed(sheet.edges("bottom")), motion]
    whole = run(sheet, Relaxation(tolerance=1e-5, ramp_steps=100), loads=loads)
    torn = run(sheet, solver, loads=loads, damage=CriticalStretch(1.56))
    assert torn.status == "finished" and torn.summary["residual"] <= 1e-5
    assert sum(entry["rounds"] for entry in torn.summary["solve"]["load_steps"]) >= 1
    assert torn.frame.damage.max() > 0.0
    assert torn.history[-1]["strain"] < whole.history[-1]["strain"]
    # Nothing left to break: one more round of rupture leaves the bits alone.
    alive = torn.built.law.intact.numpy()
    torn.built.context.run("rupture")
    assert (torn.built.law.intact.numpy() == alive).all()


def test_explicit_runs_compile_no_tangent_and_newton_no_steps():
    sheet = square(9)
    kernels = {}
    for solver in (Explicit(1.0), Relaxation(), Newton()):
        built = simulate(sheet, solver, loads=[Fixed(sheet.edges())]).build("cpu")
        names = {launch.name for stage in built.context.stages.values() for launch in stage}
        kernels[type(solver).__name__] = names | {key.split(".")[-1] for key in module_kernels(built)}
    assert not any("linearise" in name or "product" in name for name in kernels["Explicit"] | kernels["Relaxation"])
    assert not {use.name for use in built.context.fields} & {"step", "damping", "direction", "previous_force"}


def module_kernels(built):
    launch = next(iter(built.context.stages["setup"]))
    return list(launch.kernel.module.kernels)


WRONG = [
    (lambda: Newton(tolerance=0.0), "tolerance = 0.0"),
    (lambda: Newton(load_steps=0), "load_steps = 0"),
    (lambda: Newton(most_iterations=0), "most_iterations = 0"),
    (lambda: Newton(most_cuts=-1), "most_cuts = -1"),
    (lambda: Newton(preconditioner="multigird"), "did you mean 'multigrid'"),
    (lambda: Relaxation(tolerance=-1.0), "tolerance = -1.0"),
    (lambda: Relaxation(load_steps=0), "load_steps = 0"),
    (lambda: Relaxation(most_steps=0), "most_steps = 0"),
    (lambda: simulate(square(9), Newton(preconditioner="multigrid")).build("cpu"), "preconditioner = 'multigrid'"),
    (lambda: simulate(square(9), Newton(), damage=CriticalStretch(2.0)).build("cpu"), "damage = CriticalStretch"),
    (
        lambda: simulate(square(9), Newton(), contact=RigidBall(0.01, (0.05, 0.05, 0.1), (0, 0, -1))).build("cpu"),
        "contact = RigidBall",
    ),
    (lambda: simulate(square(21).inclusion((0.05, 0.05), 0.02), Newton()).build("cpu"), "sheet.inclusions"),
    (lambda: simulate(square(21), Newton(), loads=[BoundaryForce(1e10)]).build("cpu"), "BoundaryForce"),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_input_is_one_line(make, text):
    with pytest.raises(InputError) as error:
        make()
    assert text in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["pressure", "--solver", "newtn"], "did you mean 'newton'"),
        (["pressure", "--solver", "newton", "--weights", "published"], "allowed with the solver Newton are"),
        (["ball_penetration", "--solver", "newton"], "solver: this scene knows"),
    ],
)
def test_wrong_solver_on_the_command_line(arguments, text, tmp_path):
    done = CliRunner().invoke(main, ["run", *arguments, "--device", "cpu", "--quiet", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert text in done.output


@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device: Warp's own linear solvers stay untested")
@pytest.mark.parametrize("follower", [True, False])
@pytest.mark.parametrize("points", [9, 41])
def test_newton_on_cuda_is_newton_on_the_cpu(points, follower):
    sheet = square(points)
    loads = [Fixed(sheet.edges()), Pressure(5.0, follower=follower)]
    there = simulate(sheet, Newton(), loads=loads).run(device="cuda:0")
    here = run(sheet, Newton(), loads=loads)
    assert there.status == "finished"
    assert there.frame.displacement == pytest.approx(here.frame.displacement, abs=1e-9)


@pytest.mark.parametrize("solver", ["Newton(most_iterations=1, most_cuts=0)", "Relaxation(most_steps=50)"])
def test_resuming_what_did_not_converge_is_not_taken_for_finished(solver, tmp_path):
    """Relaxation goes on from where it stopped, until it is at rest; Newton fails at the same load step again."""
    scene = tmp_path / "scene.py"
    scene.write_text(SCENE.replace("SOLVER", solver))
    command = ["run", str(scene), "--device", "cpu", "--quiet", "--no-usd", "--out", str(tmp_path / "out")]
    assert CliRunner().invoke(main, command).exit_code == 3
    codes = [CliRunner().invoke(main, [*command, "--resume"]).exit_code for _ in range(4)]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    if "Newton" in solver:
        assert codes == [3, 3, 3, 3] and summary["status"] == "not converged"
    else:
        assert codes[-1] == 0 and summary["status"] == "finished"


@pytest.mark.parametrize(
    "solver", [Newton(load_steps=4), Relaxation(load_steps=4, tolerance=1e-4)], ids=["newton", "relaxation"]
)
def test_a_resumed_run_reports_all_its_load_steps(solver, tmp_path):
    sheet = square(9)
    simulation = simulate(sheet, solver, loads=[Fixed(sheet.edges()), Pressure(5.0, ramp=[(0.0, 0.0), (1.0, 1.0)])])
    begun = simulation.run(out=tmp_path, device="cpu", usd=False, writers=[StopAt(3)]).summary
    assert begun["status"] == "interrupted"
    ended = simulation.run(out=tmp_path, device="cpu", usd=False, resume=True).summary
    again = simulation.run(out=tmp_path, device="cpu", usd=False, resume=True).summary
    assert [step["share"] for step in ended["solve"]["load_steps"]] == [0.25, 0.5, 0.75, 1.0]
    assert ended["solve"]["iterations"] == ended["steps"] > 0
    # It has nothing left to do, and says what was done all the same.
    for name in ("status", "steps", "residual", "solve", "load_share"):
        assert again[name] == ended[name]


def test_runs_at_rest_say_their_share_of_the_load_and_no_time(tmp_path, capfd):
    from warp_pd.output import info, plots
    from warp_pd.output.progress import Progress

    sheet = square(9)
    simulation = simulate(sheet, Newton(load_steps=2, duration=3.0), loads=[Fixed(sheet.edges()), Pressure(5.0)])
    summary = simulation.run(out=tmp_path, device="cpu", reporter=Progress()).summary
    assert summary["time"] is None and summary["load_share"] == 1.0
    said = capfd.readouterr().err
    assert "50 % of the load" in said and "t = " not in said
    assert "0 % of the load to 100 % of the load" in info.describe(tmp_path / "frames.vtkhdf")
    assert [frame.when for frame in plots.frames_at(tmp_path, [1.5, 3.0])] == ["50 % of the load", "100 % of the load"]
