"""Newton's method with the neural law: derivatives of whatever evaluates its force."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import NEO, refused, square
from point_laws import exact_module

from warp_pd import (
    ArcLength,
    CriticalStretch,
    Fixed,
    Implicit,
    Motion,
    Neural,
    Newton,
    Pressure,
    Relaxation,
    Simulation,
)

SHEET = square(9)
CLOSED = Neural(NEO, 2.015, evaluation="closed_form")
BLOWN = [Fixed(SHEET.edges("all")), Pressure(5.0)]
PULLED = [
    Fixed(SHEET.edges("left")), Motion(SHEET.edges("right"), [0.0, 1.0], x=[0.0, 0.03], y=[0.0, 0.01], z=[0.0, 0.02]),
]  # fmt: skip


def solved(law, loads, solver=None, precision=64):
    result = Simulation(SHEET, law, solver or Newton(), loads=loads).run(device="cpu", precision=precision)
    assert result.status == "finished"
    return result


@pytest.mark.parametrize("loads", [BLOWN, PULLED], ids=["blown", "pulled"])
def test_steps_converge_quadratically_and_alike_for_any_network(loads):
    """From a slack sheet, whose tangent needs an added tension: the last steps square the residual."""
    exact, module = (solved(law, loads) for law in (CLOSED, Neural(NEO, 2.015, network=exact_module())))
    residuals = exact.summary["solve"]["load_steps"][-1]["lattices"][-1]["residuals"]
    assert len(residuals) < 12
    late = [(a, b) for a, b in pairwise(residuals) if 1e-5 < a < 3e-2]
    assert late and all(b < 20.0 * a**1.5 for a, b in late)
    moved = exact.frame.displacement
    np.testing.assert_allclose(module.frame.displacement, moved, atol=1e-9 * np.abs(moved).max())


def test_the_network_of_the_package_and_single_precision_are_near():
    moved = solved(CLOSED, BLOWN).frame.displacement
    for law, precision, share in ((Neural(NEO, 2.015), 64, 5e-3), (CLOSED, 32, 1e-4)):
        other = solved(law, BLOWN, precision=precision).frame.displacement
        assert np.abs(other - moved).max() < share * np.abs(moved).max()


def test_equilibrium_is_that_of_relaxation():
    newton, relaxed = (solved(CLOSED, BLOWN, s).frame.displacement for s in (Newton(), Relaxation(tolerance=1e-7)))
    assert np.abs(newton - relaxed).max() < 1e-5 * np.abs(newton).max()


@pytest.mark.parametrize(
    ("solver", "more", "said"),
    [
        (Newton(), {"damage": CriticalStretch(2.0)}, "damage: expected None with the law Neural"),
        (Newton(stiffness="constant"), {}, "stiffness = 'constant'"),
        (Newton(preconditioner="multigrid"), {}, "preconditioner = 'multigrid'"),
        (ArcLength(), {}, "force = Neural: its tangent is not symmetric"),
        (Implicit(1.0, steps=1), {}, "force = Neural: its tangent is not symmetric"),
    ],
)
def test_what_does_not_go_with_it_is_refused(solver, more, said):
    with refused(said):
        Simulation(SHEET, CLOSED, solver, loads=BLOWN, **more).build("cpu")
