"""What points remember of the search, and marks, change no bit of a run."""

import numpy as np
import pytest
from helpers import square
from small_runs import simulate

from warp_pd import BodyPath, Box, Explicit, Free, RigidBody, Sphere, TriangleMesh
from warp_pd.parts import bodies

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
    monkeypatch.setattr(bodies, "UNSURE", 1e6)
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
