"""Bodies that Newton (the physics engine) moves: momentum, energy, its own motion, restarts, and wrong input.

Most tests use a solver of Newton's that only integrates bodies, since that compiles in seconds; XPBD takes minutes.
"""

import sys

import numpy as np
import pytest
from helpers import refused, square
from resumed_runs import require_same_when_stopped
from small_runs import simulate

from warp_pd import Box, Explicit, Fixed, Free, InputError, Measure, NeoHookean, RigidBody, Sheet, Sphere, newton_bodies
from warp_pd.scenes import balls_on_a_sheet, gripper

try:
    import newton
    from newton import CollisionPipeline, ModelBuilder, eval_fk
    from newton.solvers import SolverBase, SolverXPBD
except ImportError:
    newton, SolverBase = None, object

needs_newton = pytest.mark.skipif(newton is None, reason="newton, the extra `bodies`, is not installed")
RADIUS, MASS, TURN = 0.03, 0.02, 1e-5
ABOVE, FALL = (0.1, 0.1, RADIUS + 0.01), (0.0, 0.0, -0.6)


class Integrates(SolverBase):
    """Neither contacts nor joints."""

    def step(self, state_in, state_out, control, contacts, dt):
        self.integrate_bodies(self.model, state_in, state_out, dt)


def xpbd(model):
    return SolverXPBD(model, iterations=10)


def world(*places, friction=0.0, spheres=((0.0, 0.0, 0.0),), moving=(*FALL, 0.0, 0.0, 0.0), gravity=0.0):
    """Bodies of one or more spheres."""
    builder = ModelBuilder(gravity=(0.0, 0.0, gravity))
    surface = ModelBuilder.ShapeConfig(density=0.0, mu=friction)
    for k, place in enumerate(places):
        inertia = (TURN * np.eye(3)).ravel().tolist()
        body = builder.add_body(xform=(*place, 0.0, 0.0, 0.0, 1.0), mass=MASS, inertia=inertia)
        builder.body_qd[body] = moving
        for s, at in enumerate(spheres):
            frame = (*at, 0.0, 0.0, 0.0, 1.0)
            builder.add_shape_sphere(body, xform=frame, radius=RADIUS, cfg=surface, label=f"ball {k}{s}")
    return builder


def on_trampoline(contact, frames=8, duration=0.16):
    sheet = Sheet.rectangle(0.2, 0.2, thickness=1e-3, density=1000.0, points=11).prestretched(1.2)
    return simulate(
        sheet, Explicit(duration, frames=frames, safety=0.1), material=NeoHookean(0.4e6, 40e6), contact=contact,
        loads=[Fixed(sheet.edges("all"))],
    )  # fmt: skip


@needs_newton
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_momentum_is_kept_but_for_what_newton_is_still_to_get(friction):
    # A body of two spheres, so that forces have arms; it turns as it hits a free sheet.
    step, moving = 2e-4, (0.2, 0.1, -1.0, 0.0, 1.0, 0.0)
    spheres = ((-0.05, 0.0, 0.0), (0.05, 0.0, 0.0))
    builder = world((0.1, 0.1, RADIUS + 1e-3), friction=friction, spheres=spheres, moving=moving)
    sheet = Sheet.rectangle(0.2, 0.2, thickness=1e-3, density=500.0, points=11)
    found = []

    def momenta(built, frame):
        """Of the sheet and of the body, linear and angular; those of the body with what it is still to get."""
        u, v = (np.array(a.numpy(), float) for a in (built.state.displacement, built.state.velocity))
        m, fields = built.state.mass.numpy()[:, None], built.context.fields
        p, s = (fields[f"newton_body_{name}"].numpy()[0].astype(float) for name in ("q", "qd"))
        given, last = (fields[f"newton_{name}"].numpy().reshape(-1, 6) for name in ("given", "last"))
        rest = given - 0.5 * last
        spheres = [built.contacts[k].pose()[:3] for k in range(2)]
        got = MASS * s[:3] - rest[:, :3].sum(0)
        turned = np.cross(p[:3], MASS * s[:3]) + TURN * s[3:] - rest[:, 3:].sum(0)
        turned -= np.cross(spheres, rest[:, :3]).sum(0)
        found.append(((m * v).sum(0), np.cross(sheet.positions + u, m * v).sum(0), got, turned))
        return 0.0

    contact, measures = newton_bodies(builder, Integrates, step), [Measure("momenta", "1", momenta)]
    simulation = simulate(sheet, Explicit(0.02, frames=20), contact=contact, measures=measures)
    assert simulation.run(device="cpu", precision=64).status == "finished"
    linear, angular, got, turned = np.moveaxis(found, 1, 0)
    exchanged = np.linalg.norm(linear, axis=1).max()
    assert exchanged > 1e-3
    # Newton's state is float32; impulses act on a body that has gone on by a step.
    assert np.abs((linear + got) - (linear + got)[0]).max() < 1e-5 * exchanged
    assert np.abs((angular + turned) - (angular + turned)[0]).max() < 2.0 * step * 1.0 * exchanged


@needs_newton
def test_a_bounce_is_that_of_a_free_body_up_to_the_square_of_newtons_step():
    free = RigidBody(Sphere(2.0 * RADIUS), Free(MASS, ABOVE, FALL, inertia=(TURN,) * 3, gravity=(0, 0, 0)), name="free")
    exact = on_trampoline(free).run(device="cpu", precision=64).history[-1]
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        contact = newton_bodies(world(ABOVE), Integrates, step)
        last = on_trampoline(contact).run(device="cpu", precision=64).history[-1]
        # What the body lost went to the sheet and to the contact.
        begun, left = (0.5 * MASS * speed**2 for speed in (FALL[2], last["ball_00_velocity_z"]))
        errors.append((last["external"] + last["ball_00_loss"] - (begun - left)) / begun)
        assert last["ball_00_velocity_z"] == pytest.approx(exact["free_velocity_z"], rel=2e-3)
    assert abs(errors[0]) < 0.02
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5


def pendulum():
    """A rod on a hinge, far from a sheet."""
    builder = ModelBuilder(gravity=(0.0, 0.0, -9.81))
    rod = builder.add_link(label="rod")
    builder.add_shape_capsule(rod, radius=RADIUS, half_height=0.1, label="rod")
    hinge = builder.add_joint_revolute(
        -1, rod, axis=(0.0, 1.0, 0.0), parent_xform=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        child_xform=(0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 1.0),
    )  # fmt: skip
    builder.add_articulation([hinge])
    builder.joint_q[0] = 0.7
    return builder


@needs_newton
def test_a_pendulum_of_newtons_own_swings_as_without_this_package():
    step, frames = 1e-3, 80
    contact = newton_bodies(pendulum(), xpbd, step)
    result = simulate(square(5), Explicit(step * frames, frames=frames), contact=contact).run(device="cpu")
    model = pendulum().finalize(device="cpu")
    solver, state, after, control = xpbd(model), model.state(), model.state(), model.control()
    pipeline = CollisionPipeline(model, deterministic=True)
    contacts = pipeline.contacts()
    eval_fk(model, model.joint_q, model.joint_qd, state)
    begin = state.body_q.numpy()[0, 0]
    for row in result.history:
        found = [row[f"rod_position_{c}"] for c in "xyz"]
        np.testing.assert_array_equal(np.float32(found), state.body_q.numpy()[0, :3])
        state.clear_forces()
        pipeline.collide(state, contacts)
        solver.step(state, after, control, contacts, step)
        state, after = after, state
    assert abs(begin - after.body_q.numpy()[0, 0]) > 1e-2


@needs_newton
def test_a_stopped_run_goes_on_with_the_same_bits(tmp_path):
    # Two balls, one on top of the other, hit the sheet and each other.
    def simulation():
        places = (ABOVE, (0.101, 0.1, 3.0 * RADIUS + 0.012))
        builder = world(*places, friction=0.3, gravity=-9.81)
        builder.add_ground_plane(height=-0.1)
        return on_trampoline(newton_bodies(builder, xpbd, 1e-3), frames=6, duration=0.06)

    result = require_same_when_stopped(simulation, tmp_path, [3], precision=32)
    assert result.history[-1]["ball_10_velocity_z"] > -0.5


@needs_newton
@pytest.mark.parametrize("scene", [balls_on_a_sheet, gripper])
def test_the_scenes_of_newtons_bodies(scene):
    small = {
        balls_on_a_sheet: {"points": 21, "duration": 0.15, "frames": 15},
        gripper: {"points": 31, "duration": 0.06, "frames": 15, "damage_length": 15e-3},
    }[scene]
    result = scene.build(**small).run(device="cpu")
    found = {name: entry["value"] for name, entry in result.summary["measures"].items()}
    assert result.status == "finished"
    assert found["worst_energy_balance"] < 0.01
    if scene is balls_on_a_sheet:
        # No ball is in another one, or in the floor.
        assert found["deepest"] < 1e-5
        assert result.history[-1]["deflection"] < -1e-3
    else:
        assert found["torn_area_share"] > 0.0
        assert found["largest_force"] > 0.5


@needs_newton
def test_shapes_of_every_kind_are_where_newton_has_them():
    builder = ModelBuilder(gravity=(0.0, 0.0, 0.0))
    half, at = np.array([0.04, 0.05, 0.06]), np.array([0.01, 0.02, 0.03])
    turned = (0.0, 0.0, np.sin(0.2), np.cos(0.2))
    corners, triangles = Box(tuple(2.0 * half)).outline(0.0)
    # The mesh has its own corner as the origin.
    mesh = newton.Mesh(corners + half, triangles.ravel())
    body = builder.add_body(xform=(0.1, 0.1, 0.5, *turned), mass=MASS, inertia=(TURN * np.eye(3)).ravel().tolist())
    kept = ModelBuilder.ShapeConfig(density=0.0)
    frame = (*at, 0.0, 0.0, 0.0, 1.0)
    builder.add_shape_box(body, xform=frame, hx=half[0], hy=half[1], hz=half[2], cfg=kept, label="box")
    builder.add_shape_mesh(body, xform=(*(at - half), 0.0, 0.0, 0.0, 1.0), mesh=mesh, cfg=kept, label="mesh")
    builder.add_shape_cylinder(body, xform=frame, radius=0.04, half_height=0.06, cfg=kept, label="cylinder")
    builder.add_shape_capsule(body, xform=frame, radius=0.04, half_height=0.02, cfg=kept, label="capsule")
    builder.add_ground_plane(height=-0.2, label="floor")
    contacts = newton_bodies(builder, Integrates, 1e-3, shapes=["box", "mesh", "cylinder", "capsule", "floor"])
    built = on_trampoline(contacts).build("cpu")
    box, found, cylinder, capsule, floor = (c.outline().placed(c.pose()) for c in built.contacts[:5])
    assert np.abs(np.sort(box, axis=0) - np.sort(found, axis=0)).max() < 1e-6
    rotation = np.array([[np.cos(0.4), -np.sin(0.4), 0.0], [np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    centre = np.array([0.1, 0.1, 0.5]) + rotation @ at
    for round_shape in (cylinder, capsule):
        middle = 0.5 * (round_shape.min(axis=0) + round_shape.max(axis=0))
        np.testing.assert_allclose(middle, centre, atol=1e-6)
        assert np.ptp(round_shape[:, 2]) == pytest.approx(0.12, abs=1e-6)
    np.testing.assert_allclose(floor[:, 2], -0.2, atol=1e-6)


@needs_newton
def test_a_floor_alone_is_a_world():
    builder = ModelBuilder()
    builder.add_ground_plane(height=-0.05)
    result = on_trampoline(newton_bodies(builder, Integrates, 1e-3), frames=2, duration=0.01).run(device="cpu")
    assert result.status == "finished"


def contacts_of(**changed):
    given = {"builder": world(ABOVE), "solver": Integrates, "step": 1e-3, **changed}
    return newton_bodies(**given)


def with_cone():
    builder = world(ABOVE)
    builder.add_shape_cone(0, label="hat")
    return builder


def relabelled():
    builder = world(ABOVE)
    builder.shape_label[0] = "other"
    return builder


WRONG = {
    "builder": (lambda: contacts_of(builder=3), "builder = 3: expected a newton.ModelBuilder"),
    "solver": (lambda: contacts_of(solver=3), "solver = 3: expected a class or function that makes a solver"),
    "step": (lambda: contacts_of(step=0.0), "step = 0.0: expected a positive number"),
    "shapes": (lambda: contacts_of(shapes=["cup"]), "shapes: expected labels from ['ball 00'], got 'cup'"),
    "no shapes": (lambda: contacts_of(shapes=[]), "shapes: expected at least one shape that touches"),
    "kind": (lambda: contacts_of(builder=with_cone()), "shape 'hat' is a CONE: expected a sphere"),
    "world": (
        lambda: on_trampoline(contacts_of()[:1]).build("cpu"),
        "contact: 'ball_00' has no Newton world: expected all contacts from newton_bodies",
    ),
    "body": (
        lambda: on_trampoline(contacts_of()[1:]).build("cpu"),
        "contact: 'ball_00' is missing: expected all contacts from newton_bodies",
    ),
    "two worlds": (
        lambda: on_trampoline([*contacts_of(), *contacts_of(builder=relabelled())]).build("cpu"),
        "contact: two or more Newton worlds: expected one",
    ),
    "two names": (
        lambda: on_trampoline([contacts_of()[0], *contacts_of()]).build("cpu"),
        "contact: two or more bodies with the name 'ball_00': expected different names: give each a name=...",
    ),
    "times": (
        lambda: on_trampoline(contacts_of(), frames=(0.01, 0.16)).build("cpu"),
        "expected a number of equally spaced frames, got times",
    ),
}


@needs_newton
@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line(case):
    make, expected = WRONG[case]
    with refused(expected):
        make()


def test_without_newton_a_scene_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "newton", None)
    expected = "newton_bodies: expected the package newton, which is not installed (pip install 'warp-pd[bodies]')"
    for make in (balls_on_a_sheet.build, gripper.build, lambda: newton_bodies(None, None, 1e-3)):
        with pytest.raises(InputError) as caught:
            make()
        assert str(caught.value) == expected
