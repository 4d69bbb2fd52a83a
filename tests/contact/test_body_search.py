"""What points remember of the search, marks, and what bodies note of blocks of points change no bit of a run."""

import numpy as np
import pytest
from helpers import square
from small_runs import simulate

from warp_pd import BodyPath, Box, Explicit, Fixed, Free, Pressure, RigidBody, Sphere, TriangleMesh
from warp_pd.contact import bodies, body_motion, body_shapes
from warp_pd.kernels.contact.body_motion import MOVES, SEARCH, STEP

TURNED = (0.1, 0.2, 0.05, 0.9733961166965892)


def scene():
    """A free mesh falls on the sheet and a turning one strikes it from below; both have friction."""
    ball = RigidBody(
        TriangleMesh(*Sphere(0.03).outline(0.0)), Free(5e-3, (0.05, 0.052, 0.0153), (0.1, 0.0, -0.5), (0.0, 30.0, 0.0)),
        friction=0.2, name="ball",
    )  # fmt: skip
    path = BodyPath([0.0, 0.02], [(0.04, 0.05, -0.024), (0.05, 0.05, 0.02)], [(0.0, 0.0, 0.0, 1.0), TURNED])
    turning = RigidBody(TriangleMesh(*Box((0.04, 0.05, 0.02)).outline(0.0)), path, friction=0.3)
    return simulate(square(13), Explicit(0.02, frames=4, safety=0.3), contact=[ball, turning])


@pytest.fixture(scope="module")
def plain():
    return scene().run(device="cpu", precision=32)


def require_same_bits(result, other):
    for row, other_row in zip(result.history, other.history, strict=True):
        assert row == other_row
    np.testing.assert_array_equal(result.frame.displacement, other.frame.displacement)
    np.testing.assert_array_equal(result.frame.velocity, other.frame.velocity)


def test_points_that_remember_nothing_touch_the_same(plain, monkeypatch):
    assert plain.history[-1]["body_force_z"] < 0.0
    assert min(row["ball_force_z"] for row in plain.history) < 0.0 or plain.history[-1]["ball_force_z"] > 0.0
    # Nothing public makes points forget: the search is to change no bit.
    monkeypatch.setattr(body_shapes, "TRUST", 0.0)
    require_same_bits(plain, scene().run(device="cpu", precision=32))


def test_points_seldom_ask(plain):
    """At the end, most points under the bodies are clear of them by more than they move in a step."""
    for name in ("ball", "body"):
        seen = plain.built.context.fields[f"{name}_seen"].numpy()
        asked = seen[:, 3] > 0.0
        assert asked.sum() >= 5
        assert np.median(seen[asked, 3]) > 0.1 * plain.built.simulation.sheet.spacing


def test_points_without_a_mark_touch_the_same(plain, monkeypatch):
    """A free body that yields touches any point."""
    monkeypatch.setattr(bodies, "SLACK", 0.0)
    assert plain.built.context.fields["ball_marks"].numpy().any()
    require_same_bits(plain, scene().run(device="cpu", precision=32))


def on_paths():
    """A ball that slides over a sheet of several blocks of points, and a turning box below it."""
    down = BodyPath.straight((0.02, 0.02, 0.0203), (0.3, 0.2, -0.05), 0.02)
    path = BodyPath([0.0, 0.02], [(0.06, 0.06, -0.0102), (0.065, 0.06, -0.008)], [(0.0, 0.0, 0.0, 1.0), TURNED])
    two = [
        RigidBody(Sphere(0.04), down, friction=0.2, name="ball"),
        RigidBody(TriangleMesh(*Box((0.04, 0.05, 0.02)).outline(0.0)), path, friction=0.3),
    ]
    return simulate(square(41), Explicit(0.02, frames=4, safety=0.3), contact=two)


@pytest.mark.parametrize("joined", [False, True])
def test_points_that_were_not_near_do_not_touch_at_the_end_of_a_step(joined, device, request, monkeypatch):
    if joined:
        request.getfixturevalue("joined_stages")
    noted = on_paths().run(device=device, precision=32)
    near = noted.built.context.fields["blocks_near"].numpy()
    assert noted.built.context.fields["ball_counts"].numpy()[MOVES] == 0
    assert near.min() == 0
    assert near.max() > 20
    # As if something else moved points in between.
    monkeypatch.setattr(body_motion, "moves_later", lambda *_: True)
    everywhere = on_paths().run(device=device, precision=32)
    assert everywhere.built.context.fields["ball_counts"].numpy()[MOVES] == 1
    require_same_bits(noted, everywhere)


def in_flight():
    """A ball and a mesh that fall on a sheet of several blocks of points, and do not touch the same ones."""
    ball = Free(5e-3, (0.03, 0.03, 0.0153), (0.1, 0.0, -0.5), (0.0, 30.0, 0.0))
    mesh = Free(5e-3, (0.07, 0.07, 0.0163), (0.0, 0.1, -0.5))
    two = [
        RigidBody(Sphere(0.03), ball, friction=0.2, name="ball"),
        RigidBody(TriangleMesh(*Sphere(0.03).outline(0.0)), mesh, friction=0.2),
    ]
    return simulate(square(41), Explicit(0.02, frames=4, safety=0.3), contact=two)


@pytest.mark.parametrize("of", [on_paths, in_flight])
@pytest.mark.parametrize("margin", [1e-6, 4.0])
def test_points_that_are_far_are_told_by_their_velocity(of, margin, monkeypatch):
    """With the smaller margin every point is looked at in every step."""
    # Nothing else moves points, as with one free body.
    monkeypatch.setattr(body_motion, "moves_later", lambda *_: False)
    results = []
    for used in (margin, bodies.MARGIN):
        monkeypatch.setattr(bodies, "MARGIN", used)
        results.append(of().run(device="cpu", precision=32))
    require_same_bits(*results)
    searches = [result.built.context.fields["ball_counts"].numpy()[SEARCH] for result in results]
    steps = results[0].built.context.fields["ball_counts"].numpy()[STEP]
    assert results[0].history[-1]["ball_force_z"] != 0.0
    assert (searches[0] == steps) == (margin < 1e-3)


def test_what_moves_points_after_a_body_on_a_path_is_noticed():
    """A free body does."""
    assert on_paths().build("cpu").context.fields["body_counts"].numpy()[MOVES] == 0
    assert scene().build("cpu").context.fields["body_counts"].numpy()[MOVES] == 1


def test_a_body_counts_the_time_where_nothing_else_needs_the_clock():
    for simulation, ticks in ((on_paths(), False), (simulate_with_load(), True)):
        result = simulation.run(device="cpu", precision=32)
        assert result.status == "finished"
        names = [part for item in result.built.context.stages["step"] for part in item.parts]
        assert ("tick" in names) == ticks
        assert result.built.context.clock.time.numpy()[0] == pytest.approx(0.02, rel=1e-12)


def simulate_with_load():
    """A ball on a path, and a load that needs a schedule."""
    sheet, down = square(9), BodyPath.straight((0.05, 0.05, 0.0203), (0.0, 0.0, -0.05), 0.02)
    loads = [Fixed(sheet.edges()), Pressure(1.0, ramp=((0.0, 0.0), (0.02, 1.0)))]
    solver = Explicit(0.02, frames=4, damping=1.0)
    return simulate(sheet, solver, loads=loads, contact=RigidBody(Sphere(0.04), down))
