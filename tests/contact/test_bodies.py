"""Contact with rigid bodies: momentum, energy, friction, no penetration, and that runs repeat."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers import NEO, Kept, refused, square
from pxr import Usd, UsdGeom, UsdValidation
from resumed_runs import require_same_when_stopped
from small_runs import run, simulate

from warp_pd import (
    BodyForce,
    BodyPath,
    BondAssociated,
    Box,
    Capsule,
    Cylinder,
    Explicit,
    Fixed,
    Free,
    MooneyRivlin,
    Newton,
    Plane,
    RigidBall,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
    TriangleMesh,
)
from warp_pd.contact.body_shapes import signed_distances
from warp_pd.kernels.contact import distances
from warp_pd.scenes import dropped_ball
from warp_pd.viewer.plots import frames_at, surfaces

DENSITY, GRAVITY = 1000.0, 9.81
TURNED = (0.1, 0.2, 0.05, 0.9733961166965892)
LYING = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))


def vector(row, name):
    return np.array([row[f"{name}_{c}"] for c in "xyz"])


def falling(mass=5e-3, **changes):
    values = {"position": (0.05, 0.052, 0.0153), "velocity": (0.1, 0.0, -0.5), "gravity": (0.0, 0.0, 0.0), **changes}
    return Free(mass, **values)


@wp.func
def any_half_space(arm: wp.vec3d, reach: wp.float64, body: distances.BodyShape):
    """The same distance, of which contact does not know that it is a plane's."""
    return distances.plane_distance(arm, reach, body)


class Ground(Plane):
    distance = any_half_space


@pytest.mark.parametrize("spin", [0.0, 3.0])
@pytest.mark.parametrize("speed", [0.0, 0.8])
def test_points_that_a_plane_passes_over_are_those_that_it_does_not_touch(spin, speed):
    """Told by their height alone, from a floor that rises and turns; the same bits."""
    sheet = square(9)
    start = np.column_stack([np.zeros((sheet.size, 2)), 0.002 + 0.3 * sheet.points[:, 0]])
    velocity = np.tile([0.3, 0.0, -1.0], (sheet.size, 1))
    angles = spin * np.linspace(0.0, 0.03, 4)
    turned = [(0.0, float(np.sin(0.5 * a)), 0.0, float(np.cos(0.5 * a))) for a in angles]
    path = BodyPath(
        np.linspace(0.0, 0.03, 4), np.outer(np.linspace(0.0, 0.03 * speed, 4), [0.0, 0.0, 1.0]), turned
    )  # fmt: skip
    frames = []
    for shape in (Plane((0.0, 0.1, 1.0)), Ground((0.0, 0.1, 1.0))):
        body = RigidBody(shape, path, friction=0.3)
        result = run(
            sheet, Explicit(0.03, frames=3), precision=32, contact=body, initial_displacement=start,
            initial_velocity=velocity,
        )  # fmt: skip
        frames.append((result.frame, result.history))
    (found, rows), (expected, wanted) = frames
    np.testing.assert_array_equal(found.displacement, expected.displacement)
    np.testing.assert_array_equal(found.velocity, expected.velocity)
    assert rows == wanted and vector(rows[-1], "body_force")[2] != 0.0


@pytest.mark.parametrize("precision", [64, 32])
def test_momentum_and_energy_of_a_ball_and_a_free_sheet(precision):
    solver = Explicit(0.05, frames=10, safety=0.1)
    body = RigidBody(Sphere(0.03), falling(spin=(0.0, 30.0, 0.0)), friction=0.5)
    result = run(square(15), solver, precision=precision, contact=body)
    rows, mass = result.history, result.built.to_numpy(result.built.state.mass)[:, None]
    moved = (mass * result.frame.velocity).sum(axis=0)
    begin, end = vector(rows[0], "body_velocity"), vector(rows[-1], "body_velocity")
    round_off = 1e-14 if precision == 64 else 2e-6
    np.testing.assert_allclose(moved, 5e-3 * (begin - end), rtol=0.0, atol=round_off * 2.5e-3)
    assert moved[2] < -1e-4
    names = ("half_step_kinetic", "strain", "body_kinetic", "body_loss")
    energies = [sum(row[name] for name in names) for row in rows]
    assert max(abs(e - energies[0]) for e in energies) < 1e-3 * energies[0]
    assert max(abs(row["balance_error"]) for row in rows) < 2e-3
    assert (np.diff([row["body_rubbed"] for row in rows]) >= 0.0).all()
    assert rows[-1]["body_spin_y"] < 30.0


def test_a_plate_that_picks_up_a_sheet_loses_as_much_as_it_gives():
    """An inelastic impact, in which friction holds: half of the work of the plate, that of friction too."""
    sheet = square(7)
    path = BodyPath.straight((0.05, 0.05, -0.001), (0.5, 0.0, 1.0), 0.01)
    rows = run(sheet, Explicit(0.01, frames=2), precision=64, contact=RigidBody(Plane(), path, friction=1.0)).history
    mass = sheet.areas.sum() * sheet.thickness * sheet.density
    assert rows[-1]["kinetic"] == pytest.approx(0.5 * mass * 1.25, rel=1e-12)
    assert rows[-1]["body_loss"] == pytest.approx(0.5 * mass * 1.25, rel=1e-12)
    assert rows[-1]["body_rubbed"] == pytest.approx(0.5 * mass * 0.25, rel=1e-12)


def test_a_body_on_a_path_has_its_velocity_from_the_first_frame():
    turned = (0.0, 0.0, np.sin(0.1), np.cos(0.1))
    path = BodyPath([-0.1, 0.1], [(0.0, 0.0, 5.0), (0.1, 0.2, 4.0)], [(0.0, 0.0, 0.0, 1.0), turned])
    rows = run(square(7), Explicit(0.02, frames=2), precision=64, contact=RigidBody(Sphere(0.1), path)).history
    for name, value in {"velocity_x": 0.5, "velocity_y": 1.0, "velocity_z": -5.0, "spin_z": 1.0, "spin_x": 0.0}.items():
        assert [row[f"body_{name}"] for row in rows] == pytest.approx([value] * 3, rel=1e-9, abs=1e-12)


def rolling(shape, safety, friction=0.5, speed=1.0):
    """Rows of a body that lies along y and crosses a trampoline."""
    scene = dropped_ball.build(points=15, horizon=2.015, duration=0.3, frames=30, safety=safety, friction=friction)
    motion = Free(0.15, (0.1, 0.15, 0.05 + 0.5 * shape.thinnest()), (speed, 0.0, 0.0), rotation=LYING)
    scene = replace(scene, contact=replace(scene.contact, shape=shape, motion=motion))
    return scene.run(device="cpu", precision=64).history


@pytest.mark.parametrize("speed", [0.3, 1.0])
@pytest.mark.parametrize("shape", [Sphere(0.08), Box((0.08, 0.08, 0.05))], ids=lambda s: s.kind)
def test_a_body_that_rolls_over_a_trampoline_rubs_no_more_than_it_loses(shape, speed):
    rows = rolling(shape, 0.6, speed=speed)
    assert rows[-1]["ball_rubbed"] > 1e-3
    assert all(0.0 <= row["ball_rubbed"] <= row["ball_loss"] for row in rows)


def test_what_a_rolling_ball_loses_does_not_depend_on_the_step():
    coarse, fine = (rolling(Sphere(0.08), safety) for safety in (0.6, 0.15))
    for name in ("ball_loss", "ball_rubbed"):
        assert coarse[-1][name] == pytest.approx(fine[-1][name], rel=5e-3)
    assert dropped_ball.energy_error(coarse) < 2e-4


def test_a_ball_without_friction_loses_the_same_at_any_step():
    coarse, fine = (rolling(Sphere(0.12), safety, friction=0.0)[-1]["ball_loss"] for safety in (0.6, 0.15))
    assert coarse == pytest.approx(fine, rel=0.06)


def test_a_body_that_nothing_touches_flies_as_it_should():
    spin, inertia = np.array([1.0, 5.0, -3.0]), (2e-4, 3e-4, 1e-4)
    body = Free(0.1, (0.0, 0.0, 5.0), (1.0, 0.0, 2.0), tuple(spin), TURNED, inertia)
    contact = RigidBody(Sphere(0.1), body, friction=0.5)
    result = run(square(7), Explicit(0.2, frames=4), precision=64, contact=contact)
    row = result.history[-1]
    expected = np.array([0.2, 0.0, 5.0 + 0.4 - 0.5 * GRAVITY * 0.04])
    np.testing.assert_allclose(vector(row, "body_position"), expected, atol=1e-12)
    energy = [r["body_kinetic"] + r["body_potential"] for r in result.history]
    assert max(abs(e - energy[0]) for e in energy) < 1e-6 * energy[0]


@pytest.mark.parametrize("share", [0.99, 1.01, 1.5])
def test_a_block_on_an_incline_sticks_and_slides_at_the_angle_of_friction(share):
    friction, duration = 0.5, 0.02
    angle = np.arctan(share * friction)
    load = (DENSITY * GRAVITY * np.sin(angle), 0.0, -DENSITY * GRAVITY * np.cos(angle))
    result = run(
        square(7, 0.02), Explicit(duration, frames=2, safety=0.5), precision=32, loads=[BodyForce(load)],
        contact=RigidBody(Plane(), BodyPath.still((0.0, 0.0, 0.0)), friction=friction),
    )  # fmt: skip
    speed = result.frame.velocity[:, 0].mean()
    if share < 1.0:
        assert speed == 0.0
        assert (result.frame.displacement == 0.0).all()
    else:
        expected = GRAVITY * (np.sin(angle) - friction * np.cos(angle)) * duration
        assert speed == pytest.approx(expected, rel=1e-5)
        weight = DENSITY * 1e-3 * 0.02**2 * GRAVITY * np.cos(angle)
        assert -result.history[-1]["body_force_z"] == pytest.approx(weight, rel=1e-5)
        assert result.history[-1]["body_force_x"] == pytest.approx(friction * weight, rel=1e-5)


def stopping_distance(rounding, precision, friction=0.3, speed=0.5, duration=0.19):
    """How far a light box slides on a taut sheet, over speed^2 / (2 friction g), and the notes of the run."""
    sheet = Sheet.rectangle(0.2, 0.2, thickness=1e-3, density=1000.0, points=17, origin=(-0.1, -0.1)).prestretched(1.5)
    box = Box((0.055, 0.055, 0.04), rounding * sheet.spacing)
    flight = Free(0.005, (-0.03, 0.0, 0.0200001), (speed, 0.0, 0.0))
    result = run(
        sheet, Explicit(duration, frames=1, safety=0.5), material=MooneyRivlin(3e5), weights="corrected",
        loads=[Fixed(sheet.edges("all"))], contact=RigidBody(box, flight, friction=friction), precision=precision,
    )  # fmt: skip
    moved = result.history[-1]["body_position_x"] + 0.03
    return moved / (speed**2 / (2.0 * friction * GRAVITY)), result.summary["notes"]


def test_a_box_with_round_edges_stops_where_friction_stops_it_in_both_precisions():
    """Measured: 1.0002. A sharp box is caught by points in its way: 0.94, with 13 points 0.40."""
    (double, notes), (single, _) = (stopping_distance(0.25, precision) for precision in (64, 32))
    assert double == pytest.approx(1.0, abs=0.01)
    assert single == pytest.approx(double, rel=1e-3)
    assert not any("sharp edges" in note for note in notes)


def test_sharp_edges_that_slide_are_noted():
    _, notes = stopping_distance(0.0, 64, duration=0.01)
    assert sum("slid with sharp edges" in note and "0.00208 m, or more" in note for note in notes) == 1


THIN = Box((0.05, 0.06, 0.0105))


@pytest.mark.parametrize(
    ("shape", "friction"),
    [
        (Sphere(0.03), 0.0),
        (THIN, 0.3),
        (TriangleMesh(*THIN.outline(0.0)), 0.3),
        (Plane(), 0.3),
    ],
    ids=lambda value: getattr(value, "kind", str(value)),
)
def test_no_point_ends_a_step_inside_a_body_at_ten_times_the_wave_speed(shape, friction):
    sheet = square(15)
    speed = 10.0 * np.sqrt(3.0)  # c^2 = 3 mu / density, with mu = 1 kPa
    turned = TURNED if shape.bounded else (0.0, 0.0, 0.0, 1.0)
    body = RigidBody(shape, BodyPath.still((0.05, 0.05, -0.04), turned), friction=friction)
    simulation = simulate(
        sheet, Explicit(0.005, frames=25, safety=0.15), contact=body,
        initial_velocity=np.tile([0.3, 0.2, -speed], (sheet.size, 1)),
    )  # fmt: skip
    path, q = body.motion.pose(0.0)[0], np.array(turned)

    def depth(frame):
        arms = sheet.positions + frame.displacement - path
        axis = np.cross(-q[:3], arms)
        arms = arms + 2.0 * (q[3] * axis + np.cross(-q[:3], axis))
        return -signed_distances(shape, arms, wp.get_device("cpu"))[:, 3].min()

    depths = Kept(depth)
    result = simulation.run(device="cpu", precision=32, writers=[depths])
    assert result.status == "finished"
    assert max(depths.all) < 1e-3 * sheet.spacing
    assert min(row["body_force_z"] for row in result.history) < -0.5
    if not shape.bounded:
        assert result.frame.displacement[:, 2].min() > -0.0401


def test_a_point_does_not_pass_a_thin_body_within_one_step():
    # One step takes the points two spacings, through a plate that is thinner than that.
    sheet = square(7)
    dt, spacing = 1e-5, sheet.spacing
    plate = RigidBody(Box((1.0, 1.0, 1.5 * spacing)), BodyPath.still((0.0, 0.0, -1.0 * spacing)))
    result = run(
        sheet, Explicit(dt, frames=1, step=dt), precision=64, contact=plate,
        initial_velocity=np.tile([0.0, 0.0, -1.99 * spacing / dt], (sheet.size, 1)),
    )  # fmt: skip
    np.testing.assert_allclose(result.frame.displacement[:, 2], -0.25 * spacing, atol=1e-6 * spacing)
    assert np.abs(result.frame.velocity[:, 2]).max() < 1e-6


@pytest.mark.parametrize("solver", [Explicit(0.1, frames=5, safety=0.3), Newton(load_steps=2, duration=0.1)])
def test_a_rigid_ball_is_a_sphere_on_a_straight_path(solver):
    sheet, start, velocity = square(15), (0.05, 0.05, 0.0151), (0.0, 0.0, -0.1)
    sphere = RigidBody(Sphere(0.03), BodyPath.straight(start, velocity, 0.1), name="ball")
    ball, body = (
        run(sheet, solver, loads=[Fixed(sheet.edges("all"))], contact=contact)
        for contact in (RigidBall(0.03, start, velocity), sphere)
    )
    assert ball.history == body.history
    assert ball.history[-1]["ball_force_z"] > 0.0


def test_a_body_that_never_touches_changes_nothing():
    sheet = square(9)
    velocity = np.tile([0.0, 0.0, 0.1], (sheet.size, 1))
    far = RigidBody(Sphere(0.1), BodyPath.still((0.0, 0.0, 5.0)), friction=0.3)
    frames = [run(sheet, precision=32, contact=body, initial_velocity=velocity).frame for body in (far, None)]
    np.testing.assert_array_equal(frames[0].displacement, frames[1].displacement)


def test_a_body_turns_evenly_between_two_poses():
    about = lambda angle: (0.0, 0.0, np.sin(0.5 * angle), np.cos(0.5 * angle))  # noqa: E731
    path = BodyPath([0.1, 0.3, 0.4], [(0.0, 0.0, 0.0)] * 3, [about(0.2), about(1.0), about(1.0)])
    for time, angle in ((0.0, 0.2), (0.15, 0.4), (0.25, 0.8), (0.35, 1.0), (1.0, 1.0)):
        np.testing.assert_allclose(path.pose(time)[1], about(angle), atol=1e-12)


def test_a_plane_is_drawn_as_a_square_of_twice_the_extent():
    corners, triangles = Plane((0.0, 0.6, 0.8)).outline(3.0)
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 3.0 * np.sqrt(2.0))
    np.testing.assert_allclose(corners @ [0.0, 0.6, 0.8], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(*(corners[triangles][0, 1:] - corners[triangles][0, 0])) @ [0, 0.6, 0.8], 36.0)


def test_a_turning_drum_drags_the_sheet():
    sheet = square(9)
    quarter = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    half = (0.5, 0.5, -0.5, 0.5)  # a quarter turn about y after it
    path = BodyPath([0.0, 0.1], [(0.05, 0.05, -0.0201)] * 2, [quarter, half])
    load = BodyForce((0.0, 0.0, -2e4))
    result = run(
        sheet, Explicit(0.05, frames=2), loads=[load], contact=RigidBody(Cylinder(0.04, 0.3), path, friction=0.5)
    )  # fmt: skip
    row = result.history[-1]
    assert row["body_spin_y"] == pytest.approx(0.5 * np.pi / 0.1, rel=1e-6)
    assert result.frame.velocity[:, 0].mean() > 0.01
    assert row["body_torque_y"] < 0.0


def test_two_bodies_at_once_restart_in_contact(tmp_path):
    def scene():
        sheet = square(11)
        ball = RigidBody(Sphere(0.03), falling(), name="ball", friction=0.2)
        slab = TriangleMesh(*Box((0.2, 0.2, 0.02)).outline(0.0))
        floor = RigidBody(slab, BodyPath.still((0.05, 0.05, -0.012)), friction=0.1)
        return simulate(sheet, Explicit(0.02, frames=4), contact=[ball, floor])

    complete = require_same_when_stopped(scene, tmp_path, [2], precision=32)
    again = scene().run(device="cpu", precision=32)
    assert again.history == complete.history
    assert complete.history[-1]["body_force_z"] < 0.0 < complete.history[1]["ball_force_z"]


def test_bodies_are_in_files_and_pictures(tmp_path):
    shapes = [Sphere(0.03), Capsule(0.02, 0.03), Cylinder(0.02, 0.03), Box((0.02, 0.03, 0.02)), Plane()]
    bodies = [
        RigidBody(
            s,
            BodyPath.straight((0.05, 0.05, -0.1), (0.0, 0.0, -1.0), 1e-3, TURNED),
            name=s.kind,
            friction=0.3 if s.kind in ("capsule", "plane") else 0.0,
        )
        for s in shapes
    ]
    scene = simulate(square(9), Explicit(1e-3, frames=2), contact=bodies)
    scene.run(device="cpu", precision=64, out=tmp_path / "run", usd=True)
    stage = Usd.Stage.Open(str(tmp_path / "run" / "animation.usd"))
    found = {str(p.GetTypeName()) for p in stage.GetPrimAtPath("/World/Bodies").GetChildren()}
    assert found == {"Sphere", "Capsule", "Cylinder", "Mesh"}
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []
    for shape in shapes:
        # What USD draws from the sizes is as large as the body, in its frame.
        drawn = UsdGeom.Boundable.ComputeExtentFromPlugins(
            UsdGeom.Boundable(stage.GetPrimAtPath(f"/World/Bodies/{shape.kind}")), Usd.TimeCode(0)
        )
        corners = shape.outline(1.0)[0]
        if shape.bounded:
            np.testing.assert_allclose(drawn, [corners.min(axis=0), corners.max(axis=0)], rtol=5e-3)
    placed = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Bodies/box")).ComputeLocalToWorldTransform(2)
    np.testing.assert_allclose(placed.ExtractTranslation(), (0.05, 0.05, -0.101), atol=1e-9)
    np.testing.assert_allclose(placed.ExtractRotationQuat().GetReal(), TURNED[3], atol=1e-6)
    shown = frames_at(tmp_path / "run", [1e-3])
    assert len(shown[0].bodies) == len(shapes)
    surfaces(tmp_path / "bodies.png", shown, field="u3", label="u3 (m)")
    assert (tmp_path / "bodies.png").stat().st_size > 1000


def test_what_is_not_used_leaves_nothing():
    plan = simulate(square(7), contact=RigidBody(Sphere(0.1), BodyPath.still((0.0, 0.0, 5.0)))).plan("cpu", 64)
    assert "body_impulse" in plan
    for name in ("body_rubbed", "find_contact", "body_rows", "body_seen", "body_marks"):
        assert name not in plan


def built(contact):
    return simulate(square(7), contact=contact).build("cpu")


def cube(**changes):
    vertices, triangles = Box((1.0, 1.0, 1.0)).outline(0.0)
    return {"vertices": vertices, "triangles": triangles, **changes}


def two_boxes(other, place=(0.0, 0.0, 0.0), inwards=False):
    """A box of 4 x 4 x 4 and another one, whose triangles may face inwards, as one mesh."""
    (a, of_a), (b, of_b) = Box((4.0, 4.0, 4.0)).outline(0.0), Box(other).outline(0.0)
    return TriangleMesh(np.vstack([a, b + place]), np.vstack([of_a, (of_b[:, ::-1] if inwards else of_b) + len(a)]))


def test_a_cavity_has_the_inertia_of_what_it_leaves_and_points_in_it_are_outside():
    hollow = two_boxes((2.0, 2.0, 2.0), (0.9, 0.0, 0.0), inwards=True)
    assert hollow.notes == () and hollow.centroid == pytest.approx([-0.9 * 8.0 / 56.0, 0.0, 0.0])
    x = hollow.centroid[0]
    moment = (64.0 * (8.0 / 3.0 + x**2) - 8.0 * (2.0 / 3.0 + (0.9 - x) ** 2)) / 56.0
    assert np.diag(hollow.inertia())[1:] == pytest.approx([moment, moment])
    places = np.array([(0.9, 0.1, 0.0), (-1.0, 0.0, 0.0), (3.0, 0.0, 0.0)]) - hollow.centroid
    found = signed_distances(hollow, places, wp.get_device("cpu"))[:, 3]
    assert found == pytest.approx([0.9, -0.9, 1.0], abs=1e-5)


@pytest.mark.parametrize(("other", "place"), [((4.0,) * 3, (2.0, 0.0, 0.0)), ((1.0,) * 3, (1.0, 0.0, 0.0))])
def test_pieces_that_overlap_are_noted_and_have_no_inertia(other, place):
    shape = two_boxes(other, place)
    with refused(match="lies inside another one at .* places compared, which counts twice"):
        RigidBody(shape, Free(1.0, (0.0, 0.0, 9.0)))
    body = RigidBody(shape, BodyPath.still((0.0, 0.0, 9.0)), name="double")
    (note,) = body.remarks()
    assert note.startswith("RigidBody 'double': piece ") and "which counts twice" in note
    assert not two_boxes((4.0,) * 3, (4.0, 0.5, 0.0)).notes
    assert not two_boxes((3.0, 3.0, 2e-3), (0.0, 0.0, 2.001)).notes


def test_turns_of_half_a_turn_or_more_are_noted():
    about = lambda angle: (0.0, 0.0, np.sin(0.5 * angle), np.cos(0.5 * angle))  # noqa: E731
    for angle, back in ((1.0, None), (-1.0, None), (np.pi, "3.142"), (1.5 * np.pi, "1.571"), (2.0 * np.pi, "0")):
        path = BodyPath([0.0, 1.0, 2.0], [(0.0, 0.0, 9.0)] * 3, [about(0.0), about(0.0), about(angle)])
        said = f"BodyPath.rotations[1] and [2] are {angle:.4g} rad apart by their signs: the body turns the shorter way"
        assert [note.split(" rad; ")[0] for note in path.notes] == ([f"{said}, by {back}"] if back else [])
    scene = simulate(square(7), Explicit(1e-4, frames=1), contact=RigidBody(Box((0.1,) * 3), path, name="box"))
    (note,) = [each for each in scene.run(device="cpu").summary["notes"] if "by their signs" in each]
    assert note.startswith("RigidBody 'box': BodyPath.rotations[1] and [2] are 6.283 rad")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: two_boxes((1.0, 1.0, 1.0), (5.0, 0.0, 0.0), inwards=True), "piece 1 .* encloses -1 m.3: expected"),
        (lambda: two_boxes((4.0, 4.0, 1.0), (1.0, 0.5, 0.0), inwards=True), "piece 1 .* encloses -16 m.3: expected"),
        (lambda: Free(0.0, (0, 0, 0)), r"Free.mass = 0.0: expected a positive number"),
        (lambda: Free(1.0, (0, 0, 0), inertia=(1.0, 0.0, 1.0)), "expected positive moments"),
        (lambda: BodyPath([0.0], [(0, 0, np.nan)]), "BodyPath.positions"),
        (lambda: BodyPath([1.0, 0.0], [(0, 0, 0)] * 2), "expected one or more increasing times"),
        (lambda: BodyPath([0.0], [(0, 0, 0)], [(0, 0, 0, 2.0)]), "expected a unit quaternion"),
        (lambda: RigidBody(Sphere(1.0), BodyPath.still((0, 0, 0)), friction=-0.1), "RigidBody.friction = -0.1"),
        (lambda: RigidBody(Plane(), Free(1.0, (0, 0, 0))), "a plane has no finite mass"),
        (lambda: RigidBody(Sphere, BodyPath.still((0, 0, 0))), "RigidBody.shape"),
        (lambda: RigidBody(Sphere(1.0), (0, 0, 0)), "RigidBody.motion"),
        (lambda: TriangleMesh(**cube(triangles=cube()["triangles"][1:])), "expected a closed surface"),
        (lambda: TriangleMesh(**cube(triangles=cube()["triangles"][:, ::-1])), "expected triangles that face outwards"),
        (lambda: TriangleMesh(**cube(vertices=np.full((8, 3), np.nan))), "TriangleMesh.vertices"),
        (lambda: Box((1.0, 1.0, -1.0)), "Box.sides = -1.0"),
        (
            lambda: built(RigidBody(Sphere(0.05), BodyPath.still((0.05, 0.05, 0.01)))),
            r"point 24 is 0.015 m inside it",
        ),
        (
            lambda: simulate(square(7), contact=RigidBody(Sphere(0.01), BodyPath.still((0.0, 0.0, 1.0)))).build("cpu"),
            "expected at least 1.42 spacings",
        ),
        (
            lambda: built([RigidBody(Plane(), BodyPath.still((0.0, 0.0, -1.0)))] * 2),
            "expected different names",
        ),
        (lambda: simulate(square(7), contact="ball").build("cpu"), "contact = 'ball'"),
    ],
)  # fmt: skip
def test_wrong_bodies_are_named_in_one_line(make, words):
    with refused(match=words):
        make()


def test_a_body_that_never_touches_the_sheet_is_noted():
    sheet = square(7)
    for solver, height, said in (
        (Explicit(1e-3, frames=2), 0.1, True), (Explicit(1e-3, frames=2), 0.025, False), (Newton(), 0.1, True),
    ):  # fmt: skip
        ball = RigidBall(0.05, (0.05, 0.05, height), (0.0, 0.0, -0.01))
        scene = simulate(sheet, solver, loads=[Fixed(sheet.edges())], contact=ball)
        found = [note for note in scene.run(device="cpu").summary["notes"] if "did not touch the sheet" in note]
        assert found == (["contact = RigidBall did not touch the sheet"] if said else [])


@pytest.mark.parametrize("surface", [False, True])
def test_a_ball_far_from_the_origin_pushes_as_one_near_it(surface):
    """In float32, by a shift that floats of this size resolve to 0.06 mm."""
    shapes = []
    for shift in (0.0, 1024.0):
        sheet = Sheet.rectangle(1.0, 1.0, points=11, thickness=1e-2, density=1e3, origin=(shift, 0.0))
        way = BodyPath((0.0, 0.05), [(shift + 0.34, 0.43, 0.153), (shift + 0.34, 0.43, 0.05)])
        ball = RigidBody(Sphere(0.3), way, surface=surface)
        law, loads = BondAssociated(NEO, horizon=2.015), [Fixed(sheet.edges())]
        result = Simulation(sheet, law, Explicit(0.05, frames=4), loads=loads, contact=ball).run(
            device="cpu", precision=32
        )
        shapes.append(result.frame.displacement)
    assert np.abs(shapes[0]).max() > 0.05
    assert shapes[1] == pytest.approx(shapes[0], abs=1e-5 * np.abs(shapes[0]).max())
