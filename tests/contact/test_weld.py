"""Welded seams at any angle: against sheets of one piece, the mylar balloon, and the balance of forces."""

import numpy as np
import pytest
from helpers import refused

from warp_pd import (
    BondAssociated,
    Circle,
    Explicit,
    Fixed,
    MooneyRivlin,
    Newton,
    Place,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
    Weld,
    pillow,
    placed,
    together,
)
from warp_pd.measures import support_force

MU = 1e5
LAW = BondAssociated(MooneyRivlin(0.5 * MU), horizon=2.015)
HALF = Sheet.rectangle(0.05, 0.05, thickness=1e-3, density=1000.0, points=13)
LEFT, RIGHT, TOP, BOTTOM = (np.asarray(HALF.edges(name)) for name in ("left", "right", "top", "bottom"))


def pulled(sheet, held, grip, solver, seam=(), start=None):
    """The mean displacement of the right end of a strip under a dead load [m], and the result."""
    loads = [*seam, Fixed(held), Fixed(range(sheet.size), "z"), Fixed(grip, "y"), PointForce(grip, (2.0, 0.0, 0.0))]
    result = Simulation(sheet, LAW, solver, loads=loads, initial_displacement=start).run(device="cpu")
    assert result.status == "finished", result.summary["message"]
    begin = 0.0 if start is None else start
    return (result.frame.displacement - begin)[grip, 0].mean(), result


@pytest.mark.parametrize("solver", [Newton(), Relaxation(), Explicit(0.2, frames=2, damping=60.0)])
def test_two_halves_that_are_welded_are_one_strip(solver):
    whole = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=(25, 13))
    exact, _ = pulled(whole, whole.edges("left"), whole.edges("right"), Newton())
    both, n = together(HALF, HALF), HALF.size
    start = placed(both, Place(), Place((0.05, 0.0, 0.0)))
    found, result = pulled(both, LEFT, n + RIGHT, solver, [Weld(RIGHT, n + LEFT)], start)
    assert found == pytest.approx(exact, rel=0.01)
    place = both.positions + result.frame.displacement
    assert np.abs(place[RIGHT] - place[n + LEFT]).max() < 0.02 * HALF.spacing
    if isinstance(solver, Explicit):
        assert max(abs(row["balance_error"]) for row in result.history) < 0.01


def test_a_coarse_sheet_does_not_know_its_welds():
    both = together(HALF, HALF)
    weld = Weld(RIGHT, HALF.size + LEFT)
    start = placed(both, Place(), Place((0.05, 0.0, 0.0)))
    with refused(match="loads: Weld: it holds parts of the sheet that are loose without it"):
        Simulation(both, LAW, Newton(preconditioner="algebraic"), loads=[weld], initial_displacement=start).build("cpu")


@pytest.mark.parametrize("solver", [Explicit(0.05, frames=4, damping=300.0), Newton(most_iterations=200)])
def test_two_discs_that_are_welded_and_blown_up_are_a_mylar_balloon(solver):
    """Folded by 180 degrees. Mladenov and Oprea, Amer. Math. Monthly 110 (2003): 0.7627 and 1.198."""
    radius, mu = 0.1, 3e7
    half = Sheet.outline(Circle((0, 0), radius), spacing=0.02, thickness=1e-4, density=1400.0)
    cushion, start, seam = pillow(half)
    n, rim, top, foot = half.size, np.asarray(half.edges("outline")), half.nearest(0, 0), half.nearest(radius, 0)
    height = 0.1 * radius * (1.0 - (half.points**2).sum(axis=1) / radius**2)
    start = start + np.outer(np.concatenate([height, -height]), (0.0, 0.0, 1.0))
    foil = TensionField(MooneyRivlin(0.5 * mu), slack_stiffness=1e-3 * mu)
    result = Simulation(
        cushion, BondAssociated(foil, horizon=2.015), solver,
        loads=[seam, Fixed([top, n + top], "xy"), Fixed([foot], "yz"), Pressure(500.0)], initial_displacement=start,
    ).run(device="cpu")  # fmt: skip
    place = cushion.positions + result.frame.displacement
    wide = np.hypot(*place[rim, :2].T).mean()
    assert wide == pytest.approx(0.7627 * radius, rel=0.01)
    assert place[top, 2] - place[n + top, 2] == pytest.approx(1.198 * wide, rel=0.01)
    # Both halves are alike.
    assert place[top, 2] == pytest.approx(-place[n + top, 2], rel=1e-2)


def test_at_a_t_joint_the_forces_balance():
    """Two strips side by side and one that stands on their seam and is pulled: each of the two takes half."""
    sheet, n, force = together(HALF, HALF, HALF), HALF.size, 1.0
    start = placed(
        sheet, Place(), Place((0.05, 0.0, 0.0)), Place((0.05, 0.0, 0.0), axis=(0.0, 1.0, 0.0), degrees=-90.0)
    )
    held, grip = [LEFT, n + RIGHT], 2 * n + RIGHT
    seams = [Weld(RIGHT, n + LEFT), Weld(RIGHT, 2 * n + LEFT)]
    result = Simulation(
        sheet, LAW, Relaxation(), initial_displacement=start,
        loads=[*seams, *map(Fixed, held), Fixed(grip, "xy"), PointForce(grip, (0.0, 0.0, force))],
    ).run(device="cpu")  # fmt: skip
    assert result.status == "finished", result.summary["message"]
    bears = [support_force(result.built, points)[2] for points in held]
    assert bears == pytest.approx([-0.5 * force] * 2, rel=0.02)
    place = sheet.positions + result.frame.displacement
    assert np.abs(place[RIGHT] - place[n + LEFT]).max() < 0.05 * HALF.spacing
    assert place[RIGHT, 2].mean() > 0.005


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (RIGHT, HALF.size + LEFT[1:], "13 points of first and 12 of second"),
        (RIGHT, RIGHT, "none in common"),
        (RIGHT, HALF.size + RIGHT, "apart at the start"),
        ([10**6], LEFT[:1], "Weld.first"),
    ],
)
def test_edges_that_do_not_coincide_are_refused(first, second, message):
    both = together(HALF, HALF)
    start = placed(both, Place(), Place((0.05, 0.0, 0.0)))
    with refused(match=message):
        Simulation(both, LAW, Newton(), loads=[Weld(first, second)], initial_displacement=start).build("cpu")


@pytest.mark.parametrize("stiffness", [0.0, -1.0, float("nan")])
def test_a_stiffness_that_is_none_is_refused(stiffness):
    with refused(match="Weld.stiffness"):
        Weld(RIGHT, LEFT, stiffness)


@pytest.mark.parametrize(
    "half",
    [Sheet.tube(0.01, 0.05, thickness=1e-3, density=1.0, points=12), HALF.prestretched(1.2), together(HALF, HALF), 3],
    ids=["tube", "prestretched", "pieces", "number"],
)
def test_halves_that_make_no_pillow_are_refused(half):
    with refused(match="pillow: half"):
        pillow(half)
