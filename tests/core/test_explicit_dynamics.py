"""Explicit dynamics: momentum, energy, stability, wave speed, damping, fast balls."""

import numpy as np
import pytest
from helpers import MU, NEO, Kept, build, exact_stress, square
from small_runs import run

from warp_pd import (
    BodyForce,
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    Gent,
    Motion,
    RigidBall,
    Sheet,
    Simulation,
)
from warp_pd.solvers.explicit import STEPS_BETWEEN


def totals(built):
    mass = built.to_numpy(built.state.mass)[:, None]
    velocity = built.to_numpy(built.state.velocity)
    sheet = built.simulation.sheet
    position = np.column_stack([sheet.points, np.zeros(sheet.size)]) + built.to_numpy(built.state.displacement)
    return (mass * velocity).sum(axis=0), (mass * np.cross(position, velocity)).sum(axis=0)


def test_a_free_sheet_keeps_its_momentum_over_ten_thousand_steps():
    sheet = square(9)
    velocity = np.random.default_rng(0).normal(size=(sheet.size, 3))
    built = build(sheet, horizon=2.015, initial_velocity=velocity)
    linear, angular = totals(built)
    stable = 2.0 / built.solver.stable_step.omega(100)
    built.context.run("setup")
    built.state.step.assign(np.array([0.2 * stable]))
    steps = built.context.sequence("step")
    for _ in range(10_000):
        steps.run()
    linear_after, angular_after = totals(built)
    mass = built.to_numpy(built.state.mass)
    speed = np.abs(built.to_numpy(built.state.velocity)).max()
    assert np.abs(linear_after - linear).max() < 1e-10 * mass.sum() * speed
    assert np.abs(angular_after - angular).max() < 1e-10 * mass.sum() * speed * 0.1


def oscillation(precision):
    """A smoothly stretched sheet let go, undamped; share of energy gained or lost."""
    sheet = square(15)
    x = sheet.points[:, 0] / 0.1
    start = np.zeros((sheet.size, 3))
    start[:, 0] = 0.02 * np.sin(0.5 * np.pi * x)
    start[:, 2] = 0.005 * np.sin(np.pi * x) ** 2
    simulation = Simulation(
        sheet,
        BondAssociated(NEO, horizon=3.15, weights="plain"),
        Explicit(1.0, frames=20, safety=0.05),
        loads=[Fixed(sheet.edges("left"))],
        initial_displacement=start,
    )
    result = simulation.run(device="cpu", precision=precision)
    total = np.array([row["kinetic"] + row["strain"] for row in result.history])
    return np.abs(total / total[0] - 1.0).max(), result


@pytest.mark.parametrize("frames", [1, 7, (2e-4, 9e-4, 1.3e-3, 4e-3)])
def test_the_balance_is_exact_from_the_first_step_on_and_where_the_step_changes(frames):
    """A linear sheet, pulled from rest by its weight, in few steps a frame."""
    result = run(
        square(9), solver=Explicit(4e-3, frames=frames, safety=0.9), precision=64,
        loads=[Fixed(square(9).edges("left")), BodyForce((1e-3, 0.0, 0.0))],
    )  # fmt: skip
    steps = np.array([row["step"] for row in result.history])
    assert steps[0] == steps[1] and (frames != (2e-4, 9e-4, 1.3e-3, 4e-3) or np.ptp(steps) > 0.1 * steps[0])
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-6
    assert result.history[-1]["external"] > 0.0


@pytest.mark.parametrize("precision", [32, 64])
def test_an_undamped_oscillation_keeps_its_energy(precision):
    change, result = oscillation(precision)
    assert result.status == "finished"
    assert result.summary["steps"] > 300
    assert change < 1e-3


def fast_ball(speed, **solver):
    sheet = square(13)
    return Simulation(
        sheet, BondAssociated(NEO, horizon=2.015), Explicit(0.06 / speed, frames=1, **solver),
        loads=[Fixed(sheet.edges())], contact=RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -speed)),
        damage=CriticalStretch(1.3),
    )  # fmt: skip


@pytest.mark.parametrize("speed", [1.0, 10.0, 100.0])
def test_no_ball_is_too_fast_to_be_felt(speed):
    """The shear wave goes at 1 m/s. No point in its way stays behind; at steps of the sheet alone all would."""
    simulation = fast_ball(speed)
    result = simulation.run(device="cpu")
    under = simulation.sheet.within((0.05, 0.05), 0.012)
    assert result.status == "finished"
    assert result.frame.displacement[under, 2].max() < -0.005
    assert result.frame.displacement[simulation.sheet.nearest(0.05, 0.05), 2] == pytest.approx(-0.0599, rel=1e-3)
    assert abs(result.history[-1]["balance_error"]) < 0.01


def test_the_step_follows_a_sheet_that_stiffens_within_one_long_frame(monkeypatch):
    """Pulled to four times its length, towards the lock: the step of its rest state diverges, however many frames."""
    sheet = square(7)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 40.0], x=[0.0, 0.3], y=0.0, z=0.0)]
    law = BondAssociated(Gent(mu=MU, bulk=1e5, lock=30.0), horizon=2.015)
    pulled = Simulation(sheet, law, Explicit(40.0, frames=1, damping=2.0, retries=0), loads=loads)
    result = pulled.run(device="cpu")
    assert result.status == "finished", result.summary["message"]
    assert result.summary["steps"] > 2 * STEPS_BETWEEN
    # A step that is given is checked; one that is estimated once only is what this rules out.
    monkeypatch.setattr("warp_pd.solvers.explicit.STEPS_BETWEEN", 10**6)
    assert pulled.run(device="cpu").status == "diverged"


def test_stable_at_the_estimate_and_unstable_above():
    """Small motion of a stretched, clamped sheet: bounded at 0.98 of the step, not at 1.05."""
    sheet = square(11)
    start = np.zeros((sheet.size, 3))
    start[:, :2] = 0.2 * sheet.points
    growth = {}
    for share in (0.98, 1.05):
        velocity = 1e-5 * np.random.default_rng(0).normal(size=(sheet.size, 3))
        velocity[sheet.edges()] = 0.0
        built = build(sheet, horizon=2.015, weights="corrected", loads=[Fixed(sheet.edges())], initial_displacement=start,  # noqa: E501
                      initial_velocity=velocity)  # fmt: skip
        stable = 2.0 / built.solver.stable_step.omega(300, accuracy=0.0)
        built.context.run("setup")
        built.state.step.assign(np.array([share * stable]))
        steps = built.context.sequence("step")
        for _ in range(200):
            steps.run()
        growth[share] = np.abs(built.to_numpy(built.state.velocity)).max() / np.abs(velocity).max()
    assert growth[0.98] < 10.0
    assert growth[1.05] > 100.0


def wave_error(points):
    """Relative error of the speed of a transverse wave along a stretched strip, from its period."""
    length, stretch = 1.0, 1.2
    sheet = Sheet.rectangle(length, 8.0 / (points - 1), thickness=1e-3, density=1000.0, points=(points, 9))
    x = sheet.points[:, 0]
    start = np.zeros((sheet.size, 3))
    start[:, 0] = (stretch - 1.0) * x
    start[:, 2] = 1e-4 * np.sin(np.pi * x / length)
    tension = exact_stress(NEO, [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]])[0, 0]
    # A string of tension P per reference area: its points cross zero after half of pi / omega.
    omega = np.pi / length * np.sqrt(tension / stretch / 1000.0)
    period = 2.0 * np.pi / omega
    simulation = Simulation(
        sheet,
        BondAssociated(NEO, horizon=2.015, weights="corrected"),
        Explicit(0.6 * period, frames=240, safety=0.5),
        loads=[Fixed(sheet.edges("left", "right")), Fixed(np.arange(sheet.size), "xy")],
        initial_displacement=start,
    )
    watched = Kept(lambda frame: (frame.time, frame.displacement[:, 2] @ np.sin(np.pi * x / length)))
    simulation.run(device="cpu", precision=64, writers=[watched])
    times, heights = np.transpose(watched.all)
    k = int(np.flatnonzero(heights < 0.0)[0])
    crossing = times[k - 1] + (times[k] - times[k - 1]) * heights[k - 1] / (heights[k - 1] - heights[k])
    return abs((0.25 * period) / crossing - 1.0)


def test_wave_speed_converges_to_the_exact_one():
    # P is per reference area and rho per reference volume, on reference length: omega^2 = (pi/L)^2 P'/rho with
    # P' the transverse stiffness, the tension over the stretch.
    errors = [wave_error(n) for n in (9, 17, 33)]
    assert errors[2] < 2e-3
    assert errors[0] / errors[2] > 8.0


def test_mass_damping_follows_the_exact_decay():
    sheet = square(5)
    simulation = Simulation(
        sheet, BondAssociated(NEO), Explicit(1.0, frames=5, damping=2.0, safety=0.1),
        initial_velocity=np.tile([0.3, 0.0, 0.1], (sheet.size, 1)),
    )  # fmt: skip
    result = simulation.run(device="cpu", precision=64)
    assert result.frame.velocity == pytest.approx(np.tile([0.3, 0.0, 0.1], (sheet.size, 1)) * np.exp(-2.0), rel=2e-3)
    row = result.history[-1]
    lost = result.history[0]["kinetic"] - row["kinetic"]
    assert row["damping"] == pytest.approx(lost, rel=1e-2)


def test_half_step_energy_is_that_of_the_velocities_half_a_step_before_and_after():
    """A sheet that falls against damping: m (v - d) (v + d) / 2, with d = dt (g - c v) / 2."""
    sheet, gravity, damping = square(5), -9.81, 40.0
    result = run(
        sheet, loads=[BodyForce((0.0, 0.0, 1000.0 * gravity))], solver=Explicit(0.05, frames=1, damping=damping)
    )
    row, speed = result.history[-1], float(result.frame.velocity[:, 2].mean())
    mass = 1000.0 * 1e-3 * sheet.areas.sum()
    change = 0.5 * row["step"] * (gravity - damping * speed)
    assert row["kinetic"] - row["half_step_kinetic"] == pytest.approx(0.5 * mass * change**2, rel=1e-4)
