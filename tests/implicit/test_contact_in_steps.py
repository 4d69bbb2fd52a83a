"""Contact with rigid bodies in implicit steps: beside Newton's method and explicit steps, restarts, what is refused."""

import numpy as np
import pytest
from helpers import NEO, refused, square
from resumed_runs import require_same_when_stopped

from warp_pd import (
    BodyForce,
    BodyPath,
    BondAssociated,
    Explicit,
    Fixed,
    Free,
    Implicit,
    Maxwell,
    MooneyRivlin,
    NeoHookean,
    Newton,
    Plate,
    RigidBody,
    SelfContact,
    Sheet,
    Simulation,
    Sphere,
    TearingEnergy,
    Visco,
)
from warp_pd.statics.linear import LinearSolver

SHEET = square(13)


def pressed(solver, law=None, contact=None, **body):
    """A ball that goes 3 cm into a clamped sheet in a second."""
    path = BodyPath((0.0, 1.0), [(0.05, 0.05, 0.026), (0.05, 0.05, -0.004)])
    ball = contact or RigidBody(Sphere(0.025), **{"motion": path, **body})
    law = law or BondAssociated(NEO, horizon=2.015)
    return Simulation(SHEET, law, solver, loads=[Fixed(SHEET.edges("all"))], contact=ball)


def result(*given, precision=64, **body):
    found = pressed(*given, **body).run(device="cpu", precision=precision)
    assert found.status == "finished", found.summary["message"]
    return found


@pytest.mark.parametrize("precision", [64, 32])
def test_a_slow_body_presses_as_in_equilibrium(precision):
    found = result(Implicit(1.0, frames=5, steps=10, inertia=False), precision=precision)
    expected = result(Newton(load_steps=5))
    forces, wanted = ([row["body_force_z"] for row in r.history] for r in (found, expected))
    np.testing.assert_allclose(forces, wanted, atol=1e-3 * max(wanted))
    np.testing.assert_allclose(found.frame.displacement, expected.frame.displacement, atol=2e-5)


def test_a_sheet_that_drapes_over_a_ball_takes_few_tangents(monkeypatch):
    """No step takes the tangent of other points that touch: these would come and go without end."""
    prepare, made = LinearSolver.prepare, []
    monkeypatch.setattr(LinearSolver, "prepare", lambda self, keep=False: made.append(keep) or prepare(self, keep))
    sheet = Sheet.rectangle(0.2, 0.2, thickness=1e-3, density=1000.0, points=17)
    u, v = 10.0 * sheet.points.T - 1.0
    held = np.flatnonzero(np.maximum(np.abs(u), np.abs(v)) < 0.1)
    # The folds turn to one side.
    start = np.outer(5e-3 * u * v * (u**2 - v**2), [0.0, 0.0, 1.0])
    found = Simulation(
        sheet,
        BondAssociated(NeoHookean(mu=3e5, bulk=3e7), horizon=1.5),
        Implicit(0.12, frames=1, steps=12, damping=15.0),
        loads=[Fixed(held), BodyForce((0.0, 0.0, -9810.0)), Plate(1e-4)],
        contact=RigidBody(Sphere(0.2), BodyPath.still((0.1, 0.1, -0.1))),
        initial_displacement=start,
    ).run(device="cpu")
    assert found.status == "finished" and found.summary["solve"]["halved"] == 0 and len(made) <= 60


def test_a_body_beside_explicit_steps():
    """With damping, so that what the impact leaves dies out; explicit forces are means since the frame before."""
    found = result(Implicit(1.0, frames=50, steps=100, damping=20.0))
    expected = result(Explicit(1.0, frames=50, damping=20.0))
    deep = np.abs(expected.frame.displacement).max()
    np.testing.assert_allclose(found.frame.displacement, expected.frame.displacement, atol=0.01 * deep)
    at, means = (np.array([row["body_force_z"] for row in r.history]) for r in (found, expected))
    assert np.mean(at[-11:-1] + at[-10:]) / 2.0 == pytest.approx(np.mean(means[-10:]), rel=0.02)
    for name, share in (("external", 0.05), ("strain", 0.02)):
        assert found.history[-1][name] == pytest.approx(expected.history[-1][name], rel=share)


@pytest.mark.parametrize("steps", [20, 400])
def test_short_and_long_steps_do_not_throw_the_sheet_off(steps):
    found = result(Implicit(1.0, frames=10, steps=steps))
    assert np.abs(found.frame.displacement).max() < 0.031
    assert found.history[-1]["kinetic"] < 0.2 * found.history[-1]["strain"]


def test_viscous_rubber_under_a_body_that_stays():
    """The force relaxes to that of the long-term rubber."""
    stays = BodyPath((0.0, 1.0), [(0.05, 0.05, 0.026), (0.05, 0.05, -0.004)])
    law = Visco(MooneyRivlin(0.5 * NEO.mu, 0.0), horizon=2.015, branches=[Maxwell(NEO.mu, 5.0)])
    solver = Implicit(60.0, frames=[1.0, 60.0], steps=60, inertia=False)
    glassy, relaxed = (row["body_force_z"] for row in result(solver, law, motion=stays).history[1:])
    elastic = result(Newton(), BondAssociated(MooneyRivlin(0.5 * NEO.mu, 0.0), horizon=2.015)).history[-1]
    assert relaxed == pytest.approx(elastic["body_force_z"], rel=2e-3)
    assert glassy > 1.6 * relaxed


def test_rows_between_frames_have_the_forces_on_a_body():
    solver = {"steps": 10, "inertia": False}
    fine = result(Implicit(1.0, frames=1, history_every=0.2, **solver)).fine_history
    frames = result(Implicit(1.0, frames=5, **solver)).history
    forces, wanted = ([row["body_force_z"] for row in rows] for rows in (fine[-4:], frames[-4:]))
    np.testing.assert_allclose(forces, wanted, rtol=1e-6)


@pytest.mark.parametrize("inertia", [True, False])
def test_contact_continues_from_the_middle_bit_for_bit(inertia, tmp_path):
    solver = Implicit(1.0, frames=5, steps=10, inertia=inertia)
    require_same_when_stopped(lambda: pressed(solver), tmp_path, [4], 64)


def test_what_contact_in_implicit_steps_does_not_take():
    solver = Implicit(1.0, steps=10)
    with refused("friction = 0.3: expected 0 with a static solver or implicit steps; friction needs Explicit"):
        pressed(solver, friction=0.3).run(device="cpu")
    with refused("motion = Free: expected a BodyPath with a static solver or implicit steps; Free needs Explicit"):
        pressed(solver, motion=Free(1.0, (0.05, 0.05, 0.026))).run(device="cpu")
    with refused("radius = 0.8: expected 0 or None with contact = RigidBody 'body'"):
        pressed(Implicit(1.0, steps=10, radius=0.8)).run(device="cpu")
    with refused("not supported by the solver Implicit; expected Explicit"):
        pressed(solver, contact=SelfContact()).run(device="cpu")


def test_a_body_that_tears_the_sheet():
    scene = pressed(Implicit(1.0, frames=5, steps=20, inertia=False))
    torn = Simulation(
        scene.sheet, scene.force, scene.solver, loads=scene.loads, contact=scene.contact,
        damage=TearingEnergy(1.0, length=0.02),
    ).run(device="cpu", precision=64)  # fmt: skip
    assert torn.status == "finished"
    assert torn.history[-1]["fracture"] > 0.0


@pytest.mark.parametrize(("back", "said"), [(0.02, True), (-0.0201, False)])
def test_a_body_whose_velocity_jumps_is_noted_where_the_balance_is_off(back, said):
    """It turns round within a step, or goes on."""
    way = BodyPath([0.0, 0.02, 0.04], [(0.05, 0.05, 0.0201), (0.05, 0.05, 0.0), (0.05, 0.05, back)])
    sheet = square(11)
    scene = Simulation(
        sheet,
        BondAssociated(NEO, horizon=2.015),
        Implicit(0.04, frames=4, steps=8),
        loads=[Fixed(sheet.edges())],
        contact=RigidBody(Sphere(0.02), way),
    )
    finished = scene.run(device="cpu")
    off = max(abs(row["balance_error"]) for row in finished.history)
    assert off > 0.01, off
    notes = [note for note in finished.summary["notes"] if "its velocity jumps" in note]
    assert bool(notes) == said
    assert all("jumps by 2 m/s at 0.02 s" in note for note in notes)
