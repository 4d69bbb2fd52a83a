"""Contact with a rigid ball: no penetration, momentum, energy."""

import numpy as np
import pytest
from helpers import square
from small_runs import run

from warp_pd import Explicit, Fixed, RigidBall


def ball_run(precision=64, damping=0.0, **ball):
    sheet = square(15)
    values = {"diameter": 0.03, "start": (0.05, 0.05, 0.0151), "velocity": (0.0, 0.0, -0.1), **ball}
    return run(
        sheet, solver=Explicit(0.15, frames=15, damping=damping, safety=0.5), precision=precision,
        loads=[Fixed(sheet.edges())], contact=RigidBall(**values),
    )  # fmt: skip


@pytest.mark.parametrize(("precision", "damping"), [(32, 0.0), (64, 3.0)])
def test_no_point_is_inside_the_ball_and_the_energy_balances(precision, damping):
    result = ball_run(precision, damping)
    sheet = result.built.simulation.sheet
    position = np.column_stack([sheet.points, np.zeros(sheet.size)]) + result.frame.displacement
    distance = np.linalg.norm(position - result.frame.bodies[0, :3], axis=1)
    assert distance.min() > 0.015 * (1.0 - 1e-5)
    assert (distance < 0.015 * (1.0 + 1e-4)).sum() >= 5
    assert max(abs(row["balance_error"]) for row in result.history[3:]) < 0.015
    assert result.history[-1]["ball_force_z"] > 0.0


def test_the_balance_with_damping_is_of_second_order_in_the_step():
    """Damping takes part of the impulses of the ball."""
    sheet, worst = square(13), []
    for safety in (0.2, 0.1, 0.05):
        ball = RigidBall(0.04, (0.05, 0.05, 0.0201), (0.0, 0.0, -0.5))
        solver = Explicit(0.04, frames=8, safety=safety, damping=30.0)
        result = run(sheet, solver, loads=[Fixed(sheet.edges())], contact=ball)
        worst.append(max(abs(row["balance_error"]) for row in result.history))
    assert worst[0] < 1e-3 and worst[1] < 0.35 * worst[0] and worst[2] < 0.3 * worst[1]


def test_the_ball_feels_the_momentum_that_it_gives():
    sheet = square(9)
    result = run(
        sheet, solver=Explicit(0.05, frames=5, safety=0.3),
        contact=RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -0.3)),
    )  # fmt: skip
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    momentum = (mass * result.frame.velocity).sum(axis=0)
    given = -sum(row["ball_force_z"] for row in result.history) * 0.01
    assert momentum[2] == pytest.approx(given, rel=1e-9)
    assert momentum[2] < 0.0


def test_a_ball_that_never_touches_changes_nothing():
    sheet = square(9)
    velocity = np.tile([0.0, 0.0, 0.1], (sheet.size, 1))
    with_ball = run(sheet, contact=RigidBall(0.1, (0.0, 0.0, 5.0)), initial_velocity=velocity)
    without = run(sheet, initial_velocity=velocity)
    assert (with_ball.frame.displacement == without.frame.displacement).all()
