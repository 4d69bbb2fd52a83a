"""The explicit solver: launches that steps share, and steps that it refuses."""

import numpy as np
import pytest
from helpers import NEO, build, built_on, refused, square

from warp_pd import (
    BodyPath,
    BondAssociated,
    BoundaryForce,
    CriticalEnergy,
    CriticalStretch,
    Explicit,
    Fixed,
    Motion,
    Pressure,
    Prony,
    RigidBall,
    RigidBody,
    Simulation,
    Sphere,
    Visco,
    Yeoh,
)
from warp_pd.families import pack


def moved(sheet):
    return [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 30.0])]


YEOH = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERMS = (Prony(c10=0.1e6, c20=0.01e6, time=1.0), Prony(c10=0.05e6, time=0.1))
BALL = RigidBall(0.03, (0.05, 0.05, 0.016), velocity=(0.0, 0.0, -3.0))
DOWN = [(0.05, 0.05, 0.0251), (0.05, 0.06, 0.02), (0.05, 0.05, 0.025)]
# What a scene has, and the parts of the launch that two of its steps share, or None.
SHARED = {
    "bare": (lambda sheet: {}, ["gather", "kick", "drift"]),
    "motion, ball, ramp": (
        lambda sheet: {
            "loads": [*moved(sheet), Pressure(5.0, follower=False, ramp=[(0.0, 0.0), (1e-3, 1.0)])],
            "contact": BALL,
            "damage": CriticalStretch(1.1),
        },
        ["kick", "strike_points", "prescribe", "drift", "strike_points"],
    ),
    "pressure that follows": (lambda sheet: {"loads": [Pressure(5e4)], "damage": CriticalStretch(1.001)}, None),
    "boundary force": (lambda sheet: {"loads": [*moved(sheet), BoundaryForce(1e9)]}, ["kick", "prescribe", "drift"]),
    "body on a path": (
        lambda sheet: {
            "contact": RigidBody(Sphere(0.05), BodyPath([0.0, 5e-4, 1e-3], DOWN), friction=0.3)
        },
        ["gather", "kick", "strike_points", "drift", "strike_points"],
    ),
    "Prony terms, energy": (
        lambda sheet: {
            "force": Visco(YEOH, horizon=2.015, prony=TERMS), "loads": moved(sheet), "damage": CriticalEnergy(0.5)
        },
        ["kick", "prescribe", "drift"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("scene", SHARED)
def test_steps_that_share_launches_are_the_steps_one_by_one(scene, device, joined_stages):
    """The end of a step and the beginning of the next are one launch, with the time ticked before both."""
    sheet = square(9)
    parts, joined = SHARED[scene]
    states = []
    for repeat in (1, 10, 30):
        values = {"force": BondAssociated(NEO, horizon=2.015, weights="plain"), **parts(sheet)}
        velocity = 0.1 * np.random.default_rng(0).normal(size=(sheet.size, 3))
        simulation = Simulation(sheet, solver=Explicit(1.0, damping=1.0), initial_velocity=velocity, **values)
        built = built_on(simulation, device)
        step = built.context.stages["step"]
        if device == "cpu":
            # Its runs join no steps.
            assert step.wraparound is None
            step.fuse_wraparound()
        # The force of a GPU has other parts.
        parts_joined = step.wraparound and step.wraparound.parts
        assert parts_joined == joined if device == "cpu" else bool(parts_joined) == bool(joined)
        built.state.step.fill_(2e-5)
        if built.context.clock.advance is not None:
            built.context.clock.advance.assign(np.array([2e-5, 1.0]))
        built.context.run("setup")
        steps = built.context.sequence("step", repeat)
        for _ in range(60 // repeat):
            steps.run()
        states.append({name: array.numpy() for name, array in built.context.fields.in_restart().items()})
        if built.law.intact is not None:
            families = built.law.families
            assert (built.law.intact.numpy() != families.rows_of_points(pack(families.exists)).T).any()
    for other in states[1:]:
        assert other.keys() == states[0].keys() >= {"displacement", "velocity"}
        for name, one in states[0].items():
            assert (one == other[name]).all(), name
    displacement = states[0]["displacement"]
    assert np.isfinite(displacement).all() and np.abs(displacement).max() > 1e-5


def test_pressure_that_follows_does_not_share_a_launch_with_motion(joined_stages):
    """It reads where the neighbours are."""
    sheet = square(9)
    dead, follower = (
        build(sheet, loads=[Pressure(1.0, follower=follower)]).context.stages["step"] for follower in (False, True)
    )
    dead.fuse_wraparound()
    follower.fuse_wraparound()
    assert dead.wraparound is not None and {"kick", "drift"} <= set(dead.wraparound.parts)
    assert follower.wraparound is None


def test_a_step_in_which_the_ball_moves_too_far_is_refused():
    sheet = square(13)
    simulation = Simulation(
        sheet, BondAssociated(NEO, horizon=2.015), Explicit(6e-4, frames=1, step=1e-4),
        loads=[Fixed(sheet.edges())], contact=RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -100.0)),
    )  # fmt: skip
    with refused(match=r"step = 0\.0001 s: expected at most 2\.083e-05 s, .*ball"):
        simulation.run(device="cpu")


def test_a_step_above_the_stable_limit_is_refused():
    sheet = square(7)
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(0.1, step=1.0))
    with refused(match=r"step = 1\.0 s: expected at most the stable step, 0\.0"):
        simulation.run(device="cpu")


WRONG = [
    (lambda: Explicit(0.0), r"duration = 0\.0"),
    (lambda: Explicit(1.0, frames=0), "frames = 0"),
    (lambda: Explicit(1.0, damping=-1.0), r"damping = -1\.0"),
    (lambda: Explicit(1.0, safety=2.0), r"safety = 2\.0"),
    (lambda: Explicit("1"), "duration = '1'"),
    (lambda: Explicit(1.0, frames=[0.5, "end"]), "frames = "),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_numbers_are_named(make, text):
    with refused(match=text):
        make()
