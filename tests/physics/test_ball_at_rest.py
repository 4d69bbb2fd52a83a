"""A ball at rest on a clamped disc: force against depth meets the shooting of tools/references."""

from functools import cache

import numpy as np
import pytest
from helpers import square
from references import ball_on_disc
from small_runs import run

from warp_pd import (
    BodyForce,
    BodyPath,
    BondAssociated,
    Explicit,
    Fixed,
    MooneyRivlin,
    RigidBall,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
)
from warp_pd.geometry.curves import Circle

MU, RADIUS, THICKNESS = 1e3, 0.1, 1e-3
# Radius of the ball, in radii of the disc.
BALL = 0.6
FORCE = MU * THICKNESS * RADIUS


@cache
def reference(depth):
    return ball_on_disc.at_depth(depth, BALL)


def pressed(points, depth, horizon, damping=40.0):
    """The disc at rest, half a second after a ball has been lowered to a depth in half a second."""
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), thickness=THICKNESS, density=1e3
    )
    rim = sheet.where(lambda x, y: np.hypot(x, y) > RADIUS * (1.0 - 1e-9))
    a = BALL * RADIUS
    end = (0.0, 0.0, a - depth * RADIUS)
    path = BodyPath([0.0, 0.5, 1.0], [(0.0, 0.0, a * (1.0 + 1e-6)), end, end])
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon, weights="corrected"),
        Explicit(1.0, frames=10, damping=damping), loads=[Fixed(rim)], contact=RigidBody(Sphere(2.0 * a), path),
    ).run(device="cpu")  # fmt: skip
    assert result.status == "finished"
    inner = result.built.to_numpy(result.built.state.force)[np.setdiff1d(np.arange(sheet.size), rim)]
    return result.history, inner[:, 2].sum()


@cache
def error(points, depth, horizon):
    """Relative error of the force on the ball at rest."""
    rows, _ = pressed(points, depth, horizon)
    last = rows[-1]["body_force_z"]
    assert rows[-2]["body_force_z"] == pytest.approx(last, rel=2e-4)
    return last / (FORCE * reference(depth).force) - 1.0


# Measured: -0.61 % and -0.61 % at a horizon of 1.7, -1.04 % and -1.03 % at 2.015; 61 points: -0.25 % and -0.43 %.
@pytest.mark.parametrize("depth", [0.5, 0.7])
@pytest.mark.parametrize(("horizon", "bound"), [(1.7, 0.0065), (2.015, 0.011)])
def test_the_force_at_a_depth(depth, horizon, bound):
    assert abs(error(41, depth, horizon)) < bound


def test_the_force_is_within_half_a_percent_at_61_points():
    assert abs(error(61, 0.5, 2.015)) < 0.005


@pytest.mark.parametrize("horizon", [1.7, 2.015])
def test_the_error_falls_with_the_square_of_the_spacing(horizon):
    coarse, fine = (abs(error(points, 0.5, horizon)) for points in (25, 41))
    assert np.log(coarse / fine) / np.log(40.0 / 24.0) >= 1.8


@pytest.mark.parametrize("damping", [20.0, 40.0, 80.0])
def test_the_force_on_a_body_at_rest_balances_the_sheet_at_any_damping(damping):
    """The impulse at the end of a step goes through the damping of the second half kick: it is more than what it
    changes in the velocity, by a factor 1 + c dt / 2."""
    rows, inner = pressed(25, 0.5, 2.015, damping)
    assert rows[-1]["body_force_z"] == pytest.approx(inner, rel=1e-3)


def test_the_force_on_a_still_ball_is_what_a_load_leaves():
    """At rest: the load on the free points, less what the rim takes of it."""
    sheet = square(21)
    load = BodyForce((0.0, 0.0, -2e4))
    ball = RigidBall(0.06, (0.05, 0.05, -0.03 * (1.0 + 1e-6)))
    result = run(sheet, Explicit(0.6, frames=6, damping=60.0), loads=[Fixed(sheet.edges("all")), load], contact=ball)
    state = result.built.state
    free = result.built.to_numpy(state.force) + result.built.to_numpy(state.external)
    left = np.delete(free, sheet.edges("all"), axis=0)[:, 2].sum()
    assert left < 0.0
    assert result.history[-1]["ball_force_z"] == pytest.approx(left, rel=1e-3)


def test_the_reference_works_as_much_as_it_stores():
    """The force is the slope of the energy over the depth, which the shooting does not use."""
    low, middle, high = (ball_on_disc.at_edge(edge, BALL) for edge in (0.799, 0.8, 0.801))
    assert (high.energy - low.energy) / (high.depth - low.depth) == pytest.approx(middle.force, rel=1e-5)
    assert middle.least_tension > 0.0


@pytest.mark.parametrize("prestretch", [1.0, 1.2])
def test_the_reference_has_converged(prestretch):
    coarse, fine = (ball_on_disc.at_edge(0.8, BALL, prestretch, tolerance=t) for t in (1e-7, 1e-10))
    assert coarse.force == pytest.approx(fine.force, rel=1e-6)
    assert coarse.depth == pytest.approx(fine.depth, rel=1e-6)
