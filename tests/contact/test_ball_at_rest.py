"""A ball at rest on a clamped disc: force against depth meets the shooting of tools/references."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers import NEO, refused, square
from references import ball_on_disc
from resumed_runs import require_same_when_stopped
from small_runs import run

from warp_pd import (
    ArcLength,
    BodyForce,
    BodyPath,
    BondAssociated,
    Box,
    Cylinder,
    Explicit,
    Fixed,
    Free,
    Implicit,
    MooneyRivlin,
    Motion,
    Newton,
    Plane,
    Relaxation,
    RigidBall,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
    TearingEnergy,
)
from warp_pd.contact import body_at_rest
from warp_pd.fitting.equilibrium import require_newton
from warp_pd.measures import support_force
from warp_pd.output.progress import Progress
from warp_pd.shapes.curves import Circle
from warp_pd.statics.linear import LinearSolver

MU, RADIUS, THICKNESS = 1e3, 0.1, 1e-3
# Radius of the ball, in radii of the disc.
BALL = 0.6
FORCE = MU * THICKNESS * RADIUS


@cache
def reference(depth):
    return ball_on_disc.at_depth(depth, BALL)


def disc(points):
    """The disc, and the points of its rim."""
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), thickness=THICKNESS, density=1e3
    )
    return sheet, sheet.where(lambda x, y: np.hypot(x, y) > RADIUS * (1.0 - 1e-9))


def law(horizon):
    return BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon, weights="corrected")


def height(depth):
    """Of the centre of a ball whose lowest point is at a depth."""
    return (BALL - depth) * RADIUS


ABOVE = BALL * RADIUS * (1.0 + 1e-6)


@cache
def pressed(points, depth, horizon, damping=40.0):
    """The disc at rest, half a second after a ball has been lowered to a depth in half a second."""
    sheet, rim = disc(points)
    end = (0.0, 0.0, height(depth))
    path = BodyPath([0.0, 0.5, 1.0], [(0.0, 0.0, ABOVE), end, end])
    result = Simulation(
        sheet, law(horizon), Explicit(1.0, frames=10, damping=damping), loads=[Fixed(rim)],
        contact=RigidBody(Sphere(2.0 * BALL * RADIUS), path),
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


# Measured: -0.61 % at a horizon of 1.7, -1.04 % at 2.015; with 61 points -0.25 % and -0.43 %.
@pytest.mark.parametrize(("horizon", "depth", "bound"), [(1.7, 0.7, 0.0065), (2.015, 0.5, 0.011)])
def test_the_force_at_a_depth(horizon, depth, bound):
    assert abs(error(41, depth, horizon)) < bound


def test_the_error_falls_with_the_square_of_the_spacing():
    coarse, fine = (abs(error(points, 0.5, 2.015)) for points in (25, 41))
    assert np.log(coarse / fine) / np.log(40.0 / 24.0) >= 1.8


@pytest.mark.parametrize("damping", [40.0, 80.0])
def test_the_force_on_a_body_at_rest_balances_the_sheet_at_any_damping(damping):
    """The impulse at the end of a step goes through the damping of the second half kick: it is more than what it
    changes in the velocity, by a factor 1 + c dt / 2."""
    rows, inner = pressed(25, 0.5, 2.015, damping)
    assert rows[-1]["body_force_z"] == pytest.approx(inner, rel=1e-3)


def lowered(sheet, rim, horizon=2.015, depth=0.5, solver=None, **body):
    """A ball lowered onto a disc, in static equilibrium."""
    path = BodyPath([0.0, 1.0], [(0.0, 0.0, ABOVE), (0.0, 0.0, height(depth))])
    given = {"motion": path, **body}
    return Simulation(
        sheet, law(horizon), solver or Newton(load_steps=4), loads=[Fixed(rim)],
        contact=RigidBody(Sphere(2.0 * BALL * RADIUS), **given),
    )  # fmt: skip


@cache
def at_rest(precision=64, **settings):
    return lowered(*disc(25), **settings).run(device="cpu", precision=precision)


def test_a_tangent_serves_many_rounds_of_contact(monkeypatch):
    prepare, made = LinearSolver.prepare, []
    monkeypatch.setattr(LinearSolver, "prepare", lambda self, keep=False: made.append(keep) or prepare(self, keep))
    found = at_rest.__wrapped__()
    assert 0 < 2 * len(made) < found.summary["solve"]["iterations"]


def test_static_contact_is_what_a_slow_ball_comes_to():
    """Measured: 6e-6 apart."""
    slow, _ = pressed(25, 0.5, 2.015)
    assert at_rest().status == "finished"
    assert at_rest().history[-1]["body_force_z"] == pytest.approx(slow[-1]["body_force_z"], rel=1e-4)


def test_points_rest_on_the_ball_and_it_carries_what_they_pull():
    result = at_rest()
    built, row = result.built, result.history[-1]
    sheet, rim = disc(25)
    gap = np.linalg.norm(sheet.positions + built.to_numpy(built.state.displacement) - built.contact.pose()[:3], axis=1)
    gap -= BALL * RADIUS
    pressed = built.to_numpy(built.contact.multiplier) > 0.0
    assert 40 < pressed.sum() < 200
    assert np.abs(gap[pressed]).max() < 1e-5 * sheet.spacing
    assert gap.min() > -1e-5 * sheet.spacing
    inner = built.to_numpy(built.state.force)[np.setdiff1d(np.arange(sheet.size), rim)]
    assert row["body_force_z"] == pytest.approx(inner[:, 2].sum(), rel=1e-6)
    for name in ("body_force_x", "body_force_y"):
        assert abs(row[name]) < 1e-3 * row["body_force_z"]
    # Without friction no ball turns.
    assert abs(row["body_torque_z"]) < 1e-12


def test_a_ball_without_friction_is_turned_by_no_torque_wherever_it_rests():
    """All pressures point to its centre; about the origin the force would have a moment of its own."""
    off = np.array([0.3 * RADIUS, -0.2 * RADIUS, height(0.3)])
    path = BodyPath([0.0, 1.0], [(*off[:2], ABOVE), off])
    row = lowered(*disc(15), motion=path, solver=Newton(load_steps=3)).run(device="cpu", precision=64).history[-1]
    force, torque = (np.array([row[f"body_{what}_{c}"] for c in "xyz"]) for what in ("force", "torque"))
    assert np.abs(np.cross(off, force)[:2]).min() > 0.05 * FORCE * RADIUS
    assert np.abs(torque).max() < 1e-12 * FORCE * RADIUS


def test_relaxation_finds_the_same_contact():
    """Measured: 1e-6 apart."""
    relaxed = at_rest(solver=Relaxation(load_steps=2, ramp_steps=10))
    assert relaxed.status == "finished"
    assert relaxed.history[-1]["body_force_z"] == pytest.approx(at_rest().history[-1]["body_force_z"], rel=1e-5)


def on_a_square(body, path, solver, precision, prestretch=1.0, load=0.0):
    """Force on a body that presses on a clamped square, and those of its supports along the edges [N]."""
    sheet = square(15)
    edges = {name: sheet.edges(name) for name in ("left", "right", "bottom", "top", "all")}
    result = Simulation(
        sheet.prestretched(prestretch), BondAssociated(NEO, horizon=2.015), solver,
        loads=[Fixed(edges.pop("all")), BodyForce((0.0, 0.0, load))], contact=RigidBody(body, path),
    ).run(device="cpu", precision=precision)  # fmt: skip
    assert result.status == "finished"
    row = result.history[-1]
    forces = [[row[f"body_force_{c}"] for c in "xyz"]]
    return np.array(forces + [support_force(result.built, edge) for edge in edges.values()])


def straight(start, end):
    return BodyPath([0.0, 1.0], [(0.05, 0.05, start), (0.05, 0.05, end)])


SLOW = Implicit(1.0, frames=1, steps=3, inertia=False)
LIGHT, TOUCHING = (Sphere(0.025), straight(0.026, 0.01)), (Sphere(0.025), straight(0.0126, 0.0125 - 1e-5))
PUNCH, BOX = Cylinder(0.04, 0.04), Box((0.04, 0.03, 0.02), rounding=0.005)


@pytest.mark.parametrize(
    "scene",
    [
        (*LIGHT, Newton(load_steps=2)),
        (*LIGHT, SLOW),
        (*LIGHT, Implicit(1.0, frames=1, steps=3, damping=20.0)),
        (Sphere(0.025), straight(0.0125 * (1.0 + 1e-6), 0.01), ArcLength()),
        (*TOUCHING, Newton(load_steps=2), 1.3),
        (PUNCH, straight(0.0201, 0.01), Newton(load_steps=2), 1.1),
        (BOX, straight(0.0101, 0.005), Newton(load_steps=2), 1.2),
        (Plane(), BodyPath.still((0.0, 0.0, -0.005)), Newton(load_steps=2), 1.0, -2e5),
        (Sphere(0.1), BodyPath.still((0.05, 0.05, -0.0505)), Newton(load_steps=2), 1.0, -9810.0),
    ],
    ids=["ball", "slow", "moving", "path", "touching", "punch", "box", "plane", "weight"],
)
def test_forces_of_contact_settle(scene, monkeypatch):
    """Rounds end neither early nor late, however little of what the supports carry is on the body.

    Measured: 8e-7 in float64, 1.2e-5 in float32.
    """
    body, path, solver, *loads = scene
    double, single = (on_a_square(body, path, solver, bits, *loads) for bits in (64, 32))
    for name in ("SETTLED", "STEADY"):
        monkeypatch.setattr(body_at_rest, name, {64: 1e-10})
    expected = on_a_square(body, path, solver, 64, *loads)
    size = np.linalg.norm(expected[0])
    for found, error in ((double, 1e-6), (single, 1e-4)):
        assert np.abs(found - expected)[0].max() < error * size
        assert np.abs(found - expected).max() < error * max(size, 0.1 * np.abs(expected).max())


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5])
def test_relaxation_in_float32_is_as_close_as_its_tolerance(tolerance):
    """The sheet without stress is soft, and residuals of 1e-4 leave six times as much in the force."""
    body, path = LIGHT
    expected = on_a_square(body, path, Newton(load_steps=2), 64)[0]
    found = on_a_square(body, path, Relaxation(load_steps=2, tolerance=tolerance), 32)[0]
    assert np.abs(found - expected).max() < 10.0 * tolerance * np.linalg.norm(expected)


def test_a_disc_pulled_over_a_still_ball():
    """It is the same but for a shift: the path, and where the last digits are, differ."""
    sheet, rim = disc(25)
    result = Simulation(
        sheet, law(2.015), Newton(load_steps=4),
        loads=[Motion(rim, [0.0, 1.0], x=[0.0, 0.0], y=[0.0, 0.0], z=[0.0, 0.5 * RADIUS])],
        contact=RigidBody(Sphere(2.0 * BALL * RADIUS), BodyPath.still((0.0, 0.0, ABOVE))),
    ).run(device="cpu")  # fmt: skip
    assert result.status == "finished"
    assert result.history[-1]["body_force_z"] == pytest.approx(at_rest().history[-1]["body_force_z"], rel=1e-4)


def test_a_flat_punch_at_rest_is_what_a_slow_one_comes_to():
    """Its edge is sharper than the spacing: points lie on either of its faces. Measured: 3e-6 apart."""
    flat, rim = disc(17)
    length, depth = 0.1, 0.2
    begin, end = (0.0, 0.0, 0.5 * length * (1.0 + 1e-6)), (0.0, 0.0, 0.5 * length - depth * RADIUS)
    forces = []
    for solver, times in (
        (Newton(load_steps=4), [0.0, 1.0, 2.0]), (Explicit(1.0, frames=10, damping=40.0), [0.0, 0.5, 1.0])
    ):  # fmt: skip
        result = Simulation(
            flat.prestretched(1.1), law(2.015), solver, loads=[Fixed(rim)],
            contact=RigidBody(Cylinder(2.0 * BALL * RADIUS, length), BodyPath(times, [begin, end, end])),
        ).run(device="cpu")  # fmt: skip
        assert result.status == "finished"
        forces.append(result.history[-1]["body_force_z"])
    assert forces[0] == pytest.approx(forces[1], rel=1e-4)


def test_a_ball_that_goes_up_again_leaves_nothing():
    """Multipliers of points that are no longer pressed vanish, and the disc is flat."""
    sheet, rim = disc(17)
    path = BodyPath([0.0, 0.5, 1.0], [(0.0, 0.0, ABOVE), (0.0, 0.0, height(0.3)), (0.0, 0.0, ABOVE)])
    reporter, said = Progress(quiet=True), []
    reporter.residual = lambda *given: said.append(given[-1])
    result = lowered(sheet, rim, motion=path, solver=Newton(load_steps=6)).run(device="cpu", reporter=reporter)
    assert result.status == "finished"
    assert "round 1 of contact" in said and not any("rupture" in text for text in said)
    forces = [row["body_force_z"] for row in result.history]
    assert forces[2] == pytest.approx(forces[4], rel=1e-4)
    assert abs(forces[6]) < 1e-3 * forces[3]


def test_static_contact_goes_on_after_a_stop(tmp_path):
    require_same_when_stopped(lambda: lowered(*disc(13)), tmp_path, [2])


def test_a_path_of_a_ball_ends_where_newtons_method_does():
    """The motion of the ball is the load factor; at the first point it touches the sheet."""
    along, at_once = (lowered(*disc(13), solver=solver).run(device="cpu") for solver in (ArcLength(), None))
    assert along.status == "finished" and along.history[-1]["load_factor"] == 1.0 and len(along.history) > 5
    assert along.frame.displacement == pytest.approx(at_once.frame.displacement, abs=1e-6 * RADIUS)
    forces = [row["body_force_z"] for row in along.history]
    assert forces[-1] == pytest.approx(at_once.history[-1]["body_force_z"], rel=1e-5)
    assert (np.diff(forces) > 0.0).all()


@pytest.mark.parametrize("solver", [Newton(most_cuts=0), Relaxation(tolerance=1e-6)], ids=["Newton", "Relaxation"])
def test_a_ball_whose_centre_passes_beside_the_sheet_does_not_pass(solver):
    """Its side passes through points near the edge, in one load step: both ends of it are in equilibrium."""
    sheet = square(21)
    path = BodyPath([0.0, 1.0], [(-0.02, 0.05, 0.0401), (-0.02, 0.05, -0.06)])
    ball = RigidBody(Sphere(0.08), path, name="ball")
    result = run(sheet, solver, loads=[Fixed(sheet.edges())], contact=ball)
    assert result.status == "not converged"
    assert any("'ball': load steps refused because it passed through" in note for note in result.summary["notes"])


def test_derivatives_at_equilibrium_refuse_contact():
    with refused(match="contact: expected None for derivatives at equilibrium"):
        require_newton(lowered(*disc(9)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"friction": 0.3},
            "friction = 0.3: expected 0 with a static solver or implicit steps; friction needs Explicit",
        ),
        (
            {"surface": True},
            "surface = True: expected False with a static solver or implicit steps; surface needs Explicit",
        ),
        (
            {"motion": Free(0.1, (0.0, 0.0, ABOVE))},
            "motion = Free: expected a BodyPath with a static solver or implicit steps; Free needs Explicit",
        ),
        ({"solver": Newton(preconditioner="jacobi")}, "expected 'auto' or 'direct'"),
    ],
)
def test_what_static_contact_refuses(changes, words):
    with refused(match=words):
        lowered(*disc(9), **changes).build("cpu")


def test_a_path_takes_contact_or_tears():
    scene = replace(lowered(*disc(13), solver=ArcLength()), damage=TearingEnergy(10.0))
    with refused(match="'body': expected no damage with ArcLength, or the solver Newton"):
        scene.build("cpu")


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
