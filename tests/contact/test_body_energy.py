"""Contact with bodies: the exact discrete statements of energy and momentum, step by step, also under mass damping.

The only terms of the energy balance that are not exact are those that central differences have without contact: the
strain energy against the work of the force along the motion, by the trapezoidal rule. So the tests take the latter.
"""

import itertools
from functools import cache

import numpy as np
import pytest
from helpers import square
from small_runs import simulate

from warp_pd import BodyForce, BodyPath, Box, Explicit, Fixed, Free, RigidBall, RigidBody, Sphere, TriangleMesh
from warp_pd.scenes import dropped_ball

POINTS, STEPS, START = 9, 300, (0.05, 0.052, 0.01501)
MASS = 5e-3
GRAVITY = np.array([0.0, 0.0, -9.81])
SLOPE = 0.15


def bodies(kind):
    """The ball of the papers; a sloping plate too heavy to turn; or a free ball, and a body that turns on its path.

    "held": both touch points of which a support holds one component or two, too.
    """
    if kind == "ball":
        return RigidBall(0.03, START, (0.0, 0.0, -0.4))
    if kind == "plate":
        slope = (0.0, np.sin(0.5 * SLOPE), 0.0, np.cos(0.5 * SLOPE))
        flight = Free(MASS, (0.05, 0.05, 0.018), (0.4, 0.1, -0.5), rotation=slope, inertia=(1e9, 1e9, 1e9))
        return RigidBody(Box((0.3, 0.3, 0.02)), flight, friction=0.2, name="free")
    path = BodyPath(
        [0.0, 1.0], [(0.055, 0.05, -0.01002), (0.055, 0.05, 0.2)], [(0.0, 0.0, 0.0, 1.0), (0.0, 0.6, 0.0, 0.8)]
    )
    free = RigidBody(Sphere(0.03), Free(MASS, START, (0.1, 0.0, -0.5), (0.0, 30.0, 0.0)), friction=0.3, name="free")
    box = Box((0.05, 0.06, 0.02))
    return [free, RigidBody(box if kind == "held" else TriangleMesh(*box.outline(0.0)), path)]


@cache
def steps(kind, damping, precision):
    """Step [s], and states of a small sheet at every step: one dictionary each, with arrays in float64."""
    sheet, loads = square(POINTS), [BodyForce((0.0, 0.0, 2e4 if kind == "plate" else -2e4))]
    if kind == "held":
        rows = np.arange(sheet.size) // POINTS
        loads += [Fixed(np.flatnonzero(rows % 2 == 0), "y"), Fixed(np.flatnonzero(rows % 3 == 1), "x")]
    simulation = simulate(sheet, Explicit(1.0, damping=damping), loads=loads, contact=bodies(kind))
    built = simulation.build("cpu", precision)
    dt = float(np.float32(4e-5))
    for stage in ("start", "setup"):
        built.context.run(stage)
    state, arrays = built.state, built.context.fields
    state.step.assign(np.array([dt], state.step.numpy().dtype))
    built.set_clock(dt, 1.0, 0.0)
    one = built.context.sequence("step")
    names = ["displacement", "velocity", "force", "external", "mass", "work"] + ["dissipated"] * (damping > 0.0)
    found = {name: getattr(state, name) for name in names}
    free = ["free_momenta", "free_given"]
    felt = {"ball": ["ball_impulse"], "plate": free}.get(kind, ["body_impulse", *free])
    found |= {name: arrays[name] for name in felt}
    states, held = [], np.zeros(sheet.size, int) if state.held_mask is None else state.held_mask.numpy()
    moves = (held[:, None] >> np.arange(3)) & 1 == 0
    for index in range(STEPS + 1):
        if index > 0:
            one.run()
        states.append({name: np.array(array.numpy(), float) for name, array in found.items()} | {"free": moves})
    return dt, states


def half_kick(s, dt, damping):
    """Change of the velocity from a full step to the next half step, (N, 3)."""
    return s["free"] * 0.5 * dt * ((s["force"] + s["external"]) / s["mass"][:, None] - damping * s["velocity"])


def kinetic(s, dt, damping):
    return 0.5 * (s["mass"][:, None] * (s["velocity"] ** 2 - half_kick(s, dt, damping) ** 2)).sum()


CASES = [("ball", 40.0, 32), ("ball", 40.0, 64), ("two", 40.0, 64), ("two", 2000.0, 64), ("held", 40.0, 64)]


@pytest.mark.parametrize(("kind", "damping", "precision"), CASES)
def test_energy_balances_to_round_off_in_every_step(kind, damping, precision):
    dt, states = steps(kind, damping, precision)
    errors, moved = [], 0.0
    for s, t in itertools.pairwise(states):
        change = kinetic(t, dt, damping) - kinetic(s, dt, damping)
        elastic = -0.5 * ((s["force"] + t["force"]) * (t["displacement"] - s["displacement"])).sum()
        work = (t["work"] - s["work"]).sum()
        lost = (t["dissipated"] - s["dissipated"]).sum() if damping > 0.0 else 0.0
        errors.append(change + elastic - work + lost)
        moved += abs(change) + abs(elastic) + abs(work)
    assert states[-1]["work"].sum() > 1e-6
    assert np.abs(np.cumsum(errors)).max() < (1e-12 if precision == 64 else 3e-5) * moved


@pytest.mark.parametrize(("kind", "damping", "precision"), CASES)
def test_bodies_feel_the_momentum_that_they_give(kind, damping, precision):
    dt, states = steps(kind, damping, precision)
    arriving = [s["velocity"] - half_kick(s, dt, damping) for s in states]
    given = np.zeros(3)
    for s, before, after in zip(states, arriving, arriving[1:], strict=False):
        given += (s["mass"][:, None] * (after - before - 2.0 * half_kick(s, dt, damping))).sum(axis=0)
    last = states[-1]
    felt = last["ball_impulse" if kind == "ball" else "body_impulse"].sum(axis=0)
    if kind in ("two", "held"):
        lost = MASS * (states[0]["free_momenta"][0] - last["free_momenta"][0] + STEPS * dt * GRAVITY)
        np.testing.assert_allclose(last["free_given"][:3], lost, rtol=0.0, atol=1e-12 * np.abs(lost).max())
        assert min(abs(felt[2]), abs(lost[2])) > 1e-4
        felt += lost
    if kind == "held":
        # In the plane the supports take a part of it.
        assert abs(felt[:2] - given[:2]).min() > 0.01 * abs(given[2])
        felt, given = felt[2:], given[2:]
    bound = (1e-12 if precision == 64 else 3e-5) * sum(np.abs(v).sum() for v in (felt, given))
    np.testing.assert_allclose(felt, given, rtol=0.0, atol=bound)


def test_friction_has_its_exact_part_of_the_loss():
    """What points and plate lose along the plate, by the velocities before and after each impulse."""
    dt, states = steps("plate", 0.0, 64)
    normal = np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    along = np.eye(3) - np.outer(normal, normal)
    heat, lost = [0.0], [0.0]
    for s, t in itertools.pairwise(states):
        mass, u = s["mass"][:, None], (t["displacement"] - s["displacement"]) / dt
        early, late = u - s["velocity"] - half_kick(s, dt, 0.0), t["velocity"] - u - half_kick(t, dt, 0.0)
        pushed = mass.T @ early / MASS, mass.T @ late / MASS
        begin, end = s["free_momenta"][0], t["free_momenta"][0]
        first = s["velocity"] + 0.5 * early - (begin - 0.5 * pushed[0])
        second = t["velocity"] - 0.5 * late - (end + 0.5 * pushed[1])
        heat.append(-(mass * ((early @ along) * first + (late @ along) * second)).sum())
        lost.append(-(mass * (early * first + late * second)).sum())
    given = np.array([s["free_given"] for s in states])
    for found, expected in ((given[:, 6], np.cumsum(lost)), (given[:, 7], np.cumsum(heat))):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    assert 0.0 < given[-1, 7] < given[-1, 6]


def test_a_ball_that_bounces_keeps_the_energy():
    """Of ball, sheet and loss together, over the energy of the ball."""
    scene = dropped_ball.build(points=15, horizon=2.015, diameter=0.12, duration=1.0, frames=100, safety=0.3)
    rows = scene.run(device="cpu", precision=64).history
    touched = np.array([row["ball_force_z"] != 0.0 for row in rows])
    assert (touched[1:] & ~touched[:-1]).sum() >= 4
    assert dropped_ball.energy_error(rows) < 2e-5
