"""Static equilibrium by both solvers: agreement, finite elements, and sheets without a unique answer."""

import numpy as np
import pytest
from helpers import GENT, jittered, refused, square
from small_runs import run, simulate

from warp_pd import Fixed, Newton, Pressure, Relaxation

SAME = {
    "pressure on a lattice": (square(21), {"loads": [Pressure(5.0)]}),
    "dead pressure, Gent": (square(21), {"loads": [Pressure(5.0, follower=False)], "material": GENT}),
    "cloud": (jittered(13), {"loads": [Pressure(5.0)]}),
}


@pytest.mark.parametrize("case", SAME)
def test_newton_and_relaxation_agree(case, device):
    sheet, parts = SAME[case]
    parts = {**parts, "loads": [Fixed(sheet.edges()), *parts["loads"]]}
    solvers = Newton(), Relaxation(tolerance=1e-9)
    first, second = (simulate(sheet, solver, **parts).run(device=device, precision=64) for solver in solvers)
    assert first.status == second.status == "finished"
    assert first.summary["residual"] <= 1e-8
    scale = np.abs(first.frame.displacement).max()
    assert np.abs(first.frame.displacement - second.frame.displacement).max() < 1e-6 * scale


@pytest.mark.parametrize("solver", [Newton(), Relaxation()], ids=["newton", "relaxation"])
def test_a_slack_sheet_without_load_is_in_equilibrium_at_once(solver):
    sheet = square(21)
    result = run(sheet, solver, loads=[Fixed(sheet.edges())])
    assert result.status == "finished" and result.summary["residual"] == 0.0
    assert np.abs(result.frame.displacement).max() == 0.0


def test_relaxation_takes_published_weights_and_newton_refuses_them():
    sheet = square(11)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    assert run(sheet, Relaxation(), loads=loads, weights="published").status == "finished"
    with refused(match=r"weights = 'published': .* or use the solver Explicit or Relaxation"):
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
