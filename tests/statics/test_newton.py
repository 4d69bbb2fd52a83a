"""Newton's method: convergence, load steps, cutbacks, and the last good load step."""

import numpy as np
import pytest
import warp as wp
from curved_sheets import small_tube
from helpers import GENT, NEO, square
from small_runs import run, simulate

from warp_pd import (
    BodyForce,
    BondAssociated,
    Fixed,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.statics.descent import Descent
from warp_pd.statics.level import Level
from warp_pd.statics.multigrid import Hierarchy


@pytest.mark.parametrize("preconditioner", ["multigrid", "algebraic", "direct", "jacobi"])
def test_newton_converges_quadratically(preconditioner):
    """Near the solution r(n+1) <= c r(n)^2, with exact linear solves."""
    sheet = square(21)
    solver = Newton(tolerance=1e-13, preconditioner=preconditioner)
    result = run(
        sheet, solver, loads=[Fixed(sheet.edges()), BodyForce((0.0, 0.0, 4000.0))], weights="corrected", horizon=1.5
    )
    assert result.status == "finished"
    r = np.array(result.summary["solve"]["residuals"])
    near = np.flatnonzero((r[:-1] < 1e-1) & (r[1:] > 1e-11))
    assert len(near) >= 1
    assert (r[near + 1] < 50.0 * r[near] ** 2 + 1e-6 * r[near]).all()
    assert len(r) <= 16


def test_a_tangent_that_leads_to_the_goal_is_kept(monkeypatch):
    """A pulled sheet takes its last step with the tangent of the one before, to the same equilibrium."""
    sheet, taken, linearise = square(21), [], Level.linearise
    pull = Motion(sheet.edges("right"), (0.0, 1.0), x=(0.0, 0.1), y=0.0, z=0.0)

    def seen(level, tension):
        taken.append(level.points)
        linearise(level, tension)

    def solved():
        taken.clear()
        result = run(
            sheet, Newton(tolerance=1e-8), loads=[Fixed(sheet.edges("left")), pull], weights="corrected", material=GENT
        )
        solve = result.summary["solve"]
        assert result.status == "finished" and solve["residuals"][-1] <= 1e-8
        return result.frame.displacement, solve["iterations"], taken.count(sheet.size)

    monkeypatch.setattr(Level, "linearise", seen)
    found, steps, tangents = solved()
    monkeypatch.setattr(Descent, "_suffices", lambda descent: False)
    expected, most, each = solved()
    assert tangents == each - 1 and steps == most == each
    assert found == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_a_lattice_that_starts_from_a_coarser_equilibrium_takes_the_tangents_found_there(monkeypatch):
    sheet, taken, linearise = square(41), [], Level.linearise
    loads = [Fixed(sheet.edges("all")), Pressure(2.0, follower=False)]

    def seen(level, tension):
        taken.append(level.points)
        linearise(level, tension)

    def anew(hierarchy, index):
        start(hierarchy, index)
        hierarchy._started = None

    def solved():
        taken.clear()
        result = run(sheet, Newton(tolerance=1e-9), loads=loads, weights="corrected", material=GENT)
        return result.frame.displacement, taken[taken.index(sheet.size) :]

    start = Hierarchy.start
    monkeypatch.setattr(Level, "linearise", seen)
    found, kept = solved()
    monkeypatch.setattr(Hierarchy, "start", anew)
    expected, renewed = solved()
    assert set(kept) == {sheet.size} and set(renewed) == {sheet.size, 441, 121}
    assert found == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("sheet", [square(21).as_cloud(), small_tube(36)], ids=["cloud", "tube"])
def test_aggregates_find_the_equilibrium_of_a_factorisation(sheet, device):
    loads = [Fixed(sheet.edges("all")), Pressure(2.0)]
    found, expected = (
        simulate(sheet, Newton(tolerance=1e-9, preconditioner=name), loads=loads).run(device=device)
        for name in ("algebraic", "direct")
    )
    assert found.status == expected.status == "finished"
    assert found.summary["solve"]["preconditioner"] == "algebraic"
    size = np.abs(expected.frame.displacement).max()
    assert found.frame.displacement == pytest.approx(expected.frame.displacement, abs=1e-6 * size)


def test_aggregates_solve_a_large_cloud_in_as_many_steps_as_a_small_one():
    products = []
    for points in (21, 47):
        sheet = square(points).as_cloud()
        loads = [Fixed(sheet.edges("all")), Pressure(2.0)]
        result = run(sheet, Newton(preconditioner="auto" if points > 45 else "algebraic"), loads=loads)
        assert result.summary["solve"]["preconditioner"] == "algebraic"
        products.append(result.summary["solve"]["products"] / result.summary["solve"]["iterations"])
    assert products[1] < 1.3 * products[0]


@pytest.mark.parametrize("preconditioner", ["multigrid", "algebraic"])
def test_newton_solves_a_pillow_with_slack_edges(preconditioner):
    """It is free in its plane, so folds run in from its edges, and coarser lattices are slack elsewhere than it is."""
    sheet = square(47)
    middles = [sheet.nearest(x, y) for x, y in ((0.05, 0.0), (0.05, 0.1), (0.0, 0.05), (0.1, 0.05))]
    loads = [Fixed(sheet.edges("all"), "z"), Fixed(middles[:2], "x"), Fixed(middles[2:], "y"), Pressure(12.0)]
    rubber = TensionField(NeoHookean(1e5 / 2.8, 1e5 / 0.6))
    results = [
        run(
            sheet, Newton(preconditioner=preconditioner, most_cuts=0, most_iterations=most), loads=loads,
            material=rubber, horizon=2.015, weights="corrected",
        )
        for most in (30, 3)
    ]  # fmt: skip
    assert [result.status for result in results] == ["finished", "not converged"]
    noted = [sum("try 'algebraic'" in note for note in result.summary["notes"]) for result in results]
    assert noted == [0, int(preconditioner == "multigrid")]


@pytest.mark.parametrize("fast", [True, False], ids=["fast", "reference"])
def test_a_slack_stiffness_lets_newton_and_relaxation_agree_behind_a_crack(fast):
    """A strip with an edge crack under a dead load: slack regions behind the crack come and go without it."""
    sheet = Sheet.rectangle(0.04, 0.02, thickness=1e-3, density=1000.0, points=21).cut((0.021, -0.001), (0.021, 0.0065))
    left, right = sheet.edges("left"), sheet.edges("right")
    loads = [Fixed(left), Fixed(right, "yz"), PointForce(right, (7.5e-3, 0.0, 0.0))]
    parts = {"loads": loads, "horizon": 2.015, "weights": "corrected", "law": {"fast": fast}}
    kept = TensionField(NEO, slack_stiffness=1.0)
    solvers = (Newton(load_steps=4), Relaxation(load_steps=4)) if fast else (Newton(load_steps=4),)
    results = [run(sheet, solver, material=kept, **parts) for solver in solvers]
    assert [result.status for result in results] == ["finished"] * len(solvers)
    energies = [result.history[-1]["strain"] for result in results]
    assert energies == pytest.approx([energies[0]] * len(solvers), rel=1e-5)
    stiffer = run(sheet, Newton(load_steps=4), material=TensionField(NEO, slack_stiffness=2.0), **parts)
    # Little is changed by it, in proportion.
    assert 0.0 < energies[0] / stiffer.history[-1]["strain"] - 1.0 < 3e-3


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
    solve = thrice.summary["solve"]
    assert solve["products"] == thrice.built.solver.solvers[0].products
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


@pytest.mark.parametrize("preconditioner", ["direct", "jacobi"])
@pytest.mark.parametrize("stretch", [2.0, 2.5])
def test_a_long_load_step_turns_no_family_inside_out(preconditioner, stretch):
    """A notched strip, pulled at once or in six steps: beyond the barrier wait equilibria with families upside down."""
    sheet = Sheet.rectangle(0.08, 0.16, thickness=1e-3, density=1000.0, points=(31, 62))
    sheet = sheet.cut((-1.0, 0.08), (0.0175, 0.08))
    pull = Motion(sheet.edges("top"), [0.0, 1.0], y=[0.0, 0.16 * (stretch - 1.0)])
    in_plane = [Fixed(np.arange(sheet.size), "z"), Fixed(sheet.edges("bottom"), "y")]
    loads = [*in_plane, Fixed([sheet.nearest(0.08, 0.0), sheet.nearest(0.08, 0.16)], "x"), pull]
    once = run(sheet, Newton(preconditioner=preconditioner), loads=loads)
    along = run(sheet, Newton(preconditioner="direct", load_steps=6), loads=loads)
    assert once.status == along.status == "finished"
    assert once.frame.displacement == pytest.approx(along.frame.displacement, abs=1e-7)
    assert once.summary["solve"]["iterations"] <= 10


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


@pytest.mark.gpu
@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device: Warp's own linear solvers stay untested")
@pytest.mark.parametrize(
    ("points", "follower", "preconditioner"),
    [(9, True, "auto"), (9, False, "auto"), (41, True, "auto"), (41, False, "auto"), (41, False, "jacobi")],
)
def test_newton_on_cuda_is_newton_on_the_cpu(points, follower, preconditioner):
    """Iterations with "jacobi" are a captured graph."""
    sheet = square(points)
    loads = [Fixed(sheet.edges()), Pressure(5.0, follower=follower)]
    there = simulate(sheet, Newton(preconditioner=preconditioner), loads=loads).run(device="cuda:0")
    here = run(sheet, Newton(), loads=loads)
    assert there.status == "finished"
    assert there.frame.displacement == pytest.approx(here.frame.displacement, abs=1e-9)


@pytest.mark.parametrize("precision", [64, 32])
@pytest.mark.parametrize("load", [BodyForce((0.0, 0.0, 100.0)), Pressure(1.0)], ids=["dead", "follower"])
def test_a_sheet_that_nothing_holds_finds_no_equilibrium(load, precision):
    """The round-off of a singular tangent once was an equilibrium 5 m to 1e11 m away."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=(9, 5))
    scene = Simulation(sheet, BondAssociated(MooneyRivlin(5e4), horizon=2.015), Newton(), loads=[load])
    result = scene.run(device="cpu", precision=precision)
    assert result.status == "not converged"
    assert not result.frame.displacement.any()
    assert any(note.startswith("supports: none holds the sheet") for note in result.summary["notes"])
