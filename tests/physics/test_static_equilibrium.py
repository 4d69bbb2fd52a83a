"""Static equilibrium by both solvers: agreement, finite elements, and sheets without a unique answer."""

import numpy as np
import pytest
from helpers import GENT, jittered, refused, square
from small_runs import run, simulate

from warp_pd import Fixed, Motion, Newton, Pressure, Relaxation
from warp_pd.__main__ import build_scene

SAME = {
    "pressure on a lattice": (square(21), {"loads": [Pressure(5.0)]}),
    "dead pressure, Gent": (square(21), {"loads": [Pressure(5.0, follower=False)], "material": GENT}),
    "cloud": (jittered(13), {"loads": [Pressure(5.0)]}),
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


@pytest.mark.parametrize("solver", [Newton(), Relaxation()], ids=["newton", "relaxation"])
def test_a_slack_sheet_without_load_is_in_equilibrium_at_once(solver):
    sheet = square(21)
    result = run(sheet, solver, loads=[Fixed(sheet.edges())])
    assert result.status == "finished" and result.summary["residual"] == 0.0
    assert np.abs(result.frame.displacement).max() == 0.0


@pytest.mark.parametrize(("sheet", "pressure"), [(square(21), 2.0), (jittered(11), 0.0)], ids=["lattice", "cloud"])
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


def test_relaxation_takes_published_weights_and_newton_refuses_them():
    sheet = square(11)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    assert run(sheet, Relaxation(), loads=loads, weights="published").status == "finished"
    with refused(match=r"weights = 'published': .* with the solver Newton"):
        simulate(sheet, Newton(), loads=loads, weights="published").build("cpu")


@pytest.mark.parametrize("solver", [Newton(), Relaxation()], ids=["newton", "relaxation"])
def test_float32(solver):
    sheet = square(21)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    narrow = run(sheet, solver, precision=32, loads=loads)
    wide = run(sheet, Newton(), loads=loads)
    assert narrow.status == "finished" and narrow.summary["residual"] <= 1e-4
    assert narrow.frame.displacement == pytest.approx(wide.frame.displacement, abs=2e-3 * 0.016)


def test_a_free_slack_sheet_is_in_equilibrium_at_once():
    result = run(square(7), Relaxation())
    assert result.status == "finished" and result.summary["residual"] == 0.0
