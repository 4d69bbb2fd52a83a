"""Contact of triangles with thin bodies: a pin and a balloon, distances, momentum, energy."""

import numpy as np
import pytest
import warp as wp
from helpers import refused, square
from resumed_runs import require_same_when_stopped
from scipy.spatial.transform import Rotation
from small_runs import run, simulate

from warp_pd import (
    BodyPath,
    BondAssociated,
    Box,
    Capsule,
    Cylinder,
    EnclosedGas,
    Explicit,
    Fixed,
    Free,
    MooneyRivlin,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
    TearingEnergy,
    TensionField,
    TriangleMesh,
)
from warp_pd.contact.body_shapes import in_frame, on_device
from warp_pd.contact.body_surface import segments_on_device
from warp_pd.kernels.contact.narrow_phase import clearances

MU, SHARE, THICKNESS, DENSITY, RADIUS, STRETCH, LENGTH = 0.4e6, 0.1, 0.3e-3, 1000.0, 0.05, 2.5, 0.1


def distances(corners, half_length):
    """Distances of triangles (F, 3, 3) from a segment along z about the origin, (F,)."""
    shape = Capsule(1e-9, 2.0 * half_length) if half_length else Sphere(1e-9)
    segments, _tree = segments_on_device(shape, 0.0, wp.get_device("cpu"))
    body, _mesh = on_device(shape, wp.get_device("cpu"))
    found = wp.zeros(len(corners), dtype=wp.float64, device="cpu")
    given = wp.array(corners, dtype=wp.vec3d, device="cpu")
    inputs = [given, 100.0, segments, body, 0]
    wp.launch(clearances(shape.distance), len(corners), inputs=inputs, outputs=[found], device="cpu")
    return np.maximum(found.numpy(), 0.0)


def crossings(corners, vertices, triangles):
    """How many sides of triangles (F, 3, 3) pass through faces of a closed mesh, and its edges through triangles."""

    def passes(begin, end, faces):
        def side(a, b, c, d):
            return np.einsum("...c,...c->...", np.cross(b - a, c - a), d - a)

        p, q, (a, b, c) = begin[:, None], end[:, None], faces.swapaxes(0, 1)[:, None]
        turns = np.array([side(p, q, *two) for two in ((a, b), (b, c), (c, a))])
        one_way = (turns >= 0.0).all(axis=0) | (turns <= 0.0).all(axis=0)
        return int((one_way & (side(a, b, c, p) * side(a, b, c, q) <= 0.0)).sum())

    lower, upper, body = vertices.min(axis=0), vertices.max(axis=0), vertices[triangles]
    near = corners[((corners.max(axis=1) >= lower) & (corners.min(axis=1) <= upper)).all(axis=1)]
    pairs = ((near, body), (body, near))
    return sum(passes(one[:, k], one[:, (k + 1) % 3], other) for one, other in pairs for k in range(3))


class Gaps:
    """A writer that keeps how far outside a body all whole triangles are at every frame.

    Of a sphere or capsule the least distance [m]; of others minus the number of crossings with the body, smaller by
    `shrunk` [m], as points rest on its faces.
    """

    def __init__(self, sheet, body, shrunk=1e-5):
        self.sheet, self.shape, self.least = sheet, body.shape, []
        vertices, self.triangles = body.shape.outline(0.0)
        self.vertices = vertices * (1.0 - shrunk / np.abs(vertices).min(axis=0, initial=1.0, where=vertices != 0.0))

    def write(self, frame):
        whole = self.sheet.triangles if frame.intact_faces is None else self.sheet.triangles[frame.intact_faces]
        pose = np.asarray(frame.bodies, float)[0]
        corners = in_frame(self.sheet.positions + frame.displacement, pose[:3], pose[3:])[whole]
        if isinstance(self.shape, Capsule):
            self.least.append(float(distances(corners, 0.5 * self.shape.length).min()) - 0.5 * self.shape.diameter)
        else:
            self.least.append(-crossings(corners, self.vertices, self.triangles))

    def save(self):
        pass

    close = save


def wave_speed(stretch):
    """Of transverse waves in the balloon, by the Cauchy stress over the density, or those in plane without stress."""
    stress = MU * (1.0 - SHARE + SHARE * stretch**2) * (stretch**2 - stretch**-4)
    return np.sqrt(max(stress, 4.0 * MU) / DENSITY)


def pushed_in(shape, speed, depth, points, frames, precision=64, stretch=STRETCH, **parts):
    """A run of a body that is pushed into a balloon at a speed over that of its waves, and its gap at every frame."""
    top, speed = stretch * RADIUS, speed * wave_speed(stretch)
    sheet = Sheet.sphere(top, thickness=THICKNESS, density=DENSITY, points=points)
    gauge = 2.0 * MU * THICKNESS / RADIUS * (1.0 / stretch - stretch**-7) * (1.0 - SHARE + SHARE * stretch**2)
    gas = EnclosedGas(gauge=gauge, leak=0.8 if parts else 0.0)
    start = top + 0.02 * shape.thinnest() + 0.03 * sheet.spacing - shape.outline(0.0)[0][:, 2].min()
    path = BodyPath([0.0, depth / speed], [(0.003, 0.002, start), (0.003, 0.002, start - depth)])
    pin = RigidBody(shape, path, name="pin", surface=True)
    law = BondAssociated(
        TensionField(MooneyRivlin(0.5 * (1.0 - SHARE) * MU, 0.5 * SHARE * MU)), horizon=2.015, weights="corrected"
    )
    scene = Simulation(
        sheet.prestretched(stretch), law, Explicit(depth / speed, frames=frames, damping=5.0, safety=0.3),
        loads=[Fixed(sheet.where(lambda x, y, z: z < -0.5 * top)), gas], contact=pin, track_energy=True, **parts,
    )  # fmt: skip
    gaps = Gaps(scene.sheet, pin)
    return scene.run(device="cpu", precision=precision, writers=[gaps]), np.array(gaps.least)


def test_distances_of_triangles_from_a_segment():
    """Against the nearest of many points of the triangle, whose distance from the segment is exact."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(100, 3, 3))
    u, v = (t.ravel() for t in np.meshgrid(*[np.linspace(0.0, 1.0, 241)] * 2))
    weights = np.column_stack([1.0 - u - v, u, v])[u + v < 1.0 + 1e-12]
    for half_length in (0.0, 0.7):
        points = np.einsum("wk,fkc->fwc", weights, corners)
        points[..., 2] -= np.clip(points[..., 2], -half_length, half_length)
        sampled = np.linalg.norm(points, axis=2).min(axis=1)
        found = distances(corners, half_length)
        assert (found <= sampled + 1e-12).all()
        assert (sampled - found).max() < 0.03
        assert half_length == 0.0 or 5 < (found == 0.0).sum() < 95


def test_a_pin_dents_a_balloon_and_stays_outside():
    """Finer than its triangles, with sides of 25 mm; every step, on every triangle."""
    diameter = 8e-4
    result, gaps = pushed_in(Capsule(diameter, LENGTH), 3.0, 0.03, 16, 500, stretch=5.0)
    assert result.status == "finished" and result.summary["steps"] <= 1.01 * 500
    assert gaps.min() > 0.0
    assert gaps[-1] < 0.05 * diameter
    assert result.history[-1]["pin_force_z"] > 0.2
    assert abs(result.history[-1]["balance_error"]) < 1e-4
    assert all(row["pin_loss"] >= 0.0 for row in result.history)
    assert not [note for note in result.summary["notes"] if "pin" in note]


def spike(length=0.04, width=0.005):
    """A thin tetrahedron with its sharp corner down."""
    vertices = [(0.0, 0.0, -length), (width, 0.0, 0.0), (-0.5 * width, width, 0.0), (-0.5 * width, -width, 0.0)]
    return TriangleMesh(np.array(vertices), np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]))


def test_the_edge_of_a_blade_dents_a_balloon_and_stays_outside():
    result, gaps = pushed_in(Box((0.03, 6e-4, 0.06)), 3.0, 0.03, 16, 400)
    assert result.status == "finished" and result.summary["steps"] <= 1.01 * 400
    assert gaps.max() == gaps.min() == 0.0
    assert result.history[-1]["pin_force_z"] > 0.5


def test_a_thin_pin_gives_what_the_sheet_gets():
    """Momentum and angular momentum to round-off, with friction; a sheet of 7 mm and a pin of 1 mm that turns."""
    sheet, centre = square(15), np.array([0.0505, 0.0522, -0.021])
    turned = (0.0, np.sin(0.1), 0.0, np.cos(0.1))
    path = BodyPath([0.0, 0.05], [centre, centre], [(0.0, 0.0, 0.0, 1.0), turned])
    pin = RigidBody(Capsule(1e-3, 0.04), path, friction=0.3, surface=True)
    result = run(
        sheet, Explicit(0.05, frames=10, safety=0.3), contact=pin,
        initial_velocity=np.tile([0.3, 0.0, -0.8], (sheet.size, 1)),
    )  # fmt: skip
    rows, mass = result.history, result.built.to_numpy(result.built.state.mass)[:, None]
    assert max(abs(row["balance_error"]) for row in rows) < 2e-3
    assert 0.0 < rows[-1]["body_rubbed"] <= rows[-1]["body_loss"]
    force, torque = (
        np.sum([[row[f"body_{what}_{c}"] for c in "xyz"] for row in rows[1:]], axis=0) * 0.005
        for what in ("force", "torque")
    )
    begin, end = mass * [0.3, 0.0, -0.8], mass * result.frame.velocity
    x = sheet.positions + result.frame.displacement
    turn = np.cross(x, end).sum(axis=0) - np.cross(sheet.positions, begin).sum(axis=0)
    np.testing.assert_allclose((end - begin).sum(axis=0), -force, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(turn, -torque - np.cross(centre, force), rtol=0.0, atol=1e-15)
    assert force[2] < -1e-4


def test_a_sheet_that_slides_along_a_pin_is_rubbed_by_coulombs_law():
    """The pin lies between two rows of points, so that its side presses on triangles alone, straight up."""
    sheet = square(15)
    lying = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))
    path = BodyPath([0.0], [(0.05, 6.5 * sheet.spacing, -5.3e-4)], [lying])
    pin = RigidBody(Capsule(1e-3, 0.03), path, friction=0.3, surface=True)
    row = run(
        sheet, Explicit(1e-3, frames=1, safety=0.3), contact=pin,
        initial_velocity=np.tile([1.0, 0.0, -0.2], (sheet.size, 1)),
    ).history[-1]  # fmt: skip
    assert row["body_force_z"] < 0.0
    assert row["body_force_x"] == pytest.approx(-0.3 * row["body_force_z"], rel=0.01)


@pytest.mark.parametrize(
    ("shape", "mass", "friction"), [(Capsule(1e-3, 0.04), 1e-4, 0.0), (spike(), 0.1, 0.4)], ids=["needle", "spike"]
)
def test_a_free_body_loses_what_the_sheet_gets(shape, mass, friction):
    """Momentum and angular momentum of both, to round-off, and the energy: 0.01 and 10 times the mass of the sheet."""
    sheet, turn = square(15), np.array([0.19, 0.28, 0.09, 0.0])
    turn[3] = np.sqrt(1.0 - turn @ turn)
    moves, spins = np.array([0.1, 0.05, -0.8]), np.array([3.0, -2.0, 5.0])
    lowest = in_frame(shape.outline(0.0)[0], np.zeros(3), turn * [-1.0, -1.0, -1.0, 1.0])[:, 2].min()
    place = (0.0505, 0.0522, 1e-3 - lowest)
    motion = Free(mass, place, tuple(moves), tuple(spins), tuple(turn), gravity=(0.0, 0.0, 0.0))
    body = RigidBody(shape, motion, friction=friction, surface=True)
    scene = simulate(sheet, Explicit(0.05, frames=50, safety=0.1), contact=body)
    gaps = Gaps(sheet, body, 1e-5)
    result = scene.run(device="cpu", precision=64, writers=[gaps])
    rows, pose = result.history, np.asarray(result.frame.bodies, float)[0]
    now = {what: np.array([rows[-1][f"body_{what}_{c}"] for c in "xyz"]) for what in ("velocity", "spin")}
    mv = result.built.to_numpy(result.built.state.mass)[:, None] * result.frame.velocity

    def angular(place, rotation, velocity, spin):
        axes = Rotation.from_quat(rotation)
        return mass * (np.cross(place, velocity) + axes.apply(shape.inertia() @ axes.inv().apply(spin)))

    began = angular(place, turn, moves, spins)
    ended = angular(pose[:3], pose[3:], now["velocity"], now["spin"])
    ended += np.cross(sheet.positions + result.frame.displacement, mv).sum(axis=0)
    exact = 1e-13
    assert np.linalg.norm(mv.sum(axis=0)) > 0.1 * min(mass, 0.01) * 0.8
    np.testing.assert_allclose(mv.sum(axis=0) + mass * now["velocity"], mass * moves, rtol=0.0, atol=exact * mass)
    # Points drift by what the body foresees, see docs/contact.md.
    points = 0.0 if isinstance(shape, Capsule) else 1e-6
    np.testing.assert_allclose(ended, began, rtol=0.0, atol=(exact + points) * np.linalg.norm(began))
    energy = [sum(row[k] for k in ("kinetic", "strain", "body_kinetic", "body_loss")) for row in rows]
    assert np.ptp(energy) < 2e-4 * energy[0]
    assert min(gaps.least) > 0.0 if isinstance(shape, Capsule) else max(gaps.least) == min(gaps.least) == 0.0
    if friction:
        assert 0.0 < rows[-1]["body_rubbed"] <= rows[-1]["body_loss"]


def test_a_run_resumed_in_contact_goes_on_bit_for_bit(tmp_path):
    def scene():
        body = RigidBody(spike(), Free(1e-3, (0.0505, 0.0522, 0.032), (0.1, 0.0, -0.8)), 0.4, surface=True)
        return simulate(square(15), Explicit(0.02, frames=4, safety=0.3), contact=body)

    complete = require_same_when_stopped(scene, tmp_path, [2], 64)
    forces = [row["body_force_z"] for row in complete.history]
    assert forces[2] > 0.0 < forces[3]


def test_a_pin_bursts_a_balloon_that_tears():
    """Gas flows out; whole triangles stay outside, and those that tore let the pin pass."""
    result, gaps = pushed_in(Capsule(8e-3, LENGTH), 1.0, 0.24, 16, 72, 32, damage=TearingEnergy(1.4e5, 0.008))
    rows = result.history
    assert 0.9 < result.frame.intact_faces.mean() < 0.995
    assert rows[-1]["pressure"] < 0.6 * rows[0]["pressure"]
    assert gaps.min() > 0.0


def test_bodies_without_a_surface_leave_nothing_of_it():
    def plan(surface):
        pin = RigidBody(Capsule(0.03, 0.03), BodyPath.still((0.0, 0.0, 5.0)), surface=surface)
        return simulate(square(7), contact=pin).plan("cpu", 64)

    for name in ("find_pressing", "spread", "take_impulses", "body_pushes_after"):
        assert name in plan(True) and name not in plan(False)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"shape": Cylinder(0.1, 0.1)}, "expected a Sphere, Capsule, Box or TriangleMesh, got a cylinder"),
        ({"surface": 1}, "RigidBody.surface = 1: expected True or False"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(body, words):
    with refused(match=words):
        RigidBody(**{"shape": Sphere(0.1), "motion": BodyPath.still((0.0, 0.0, 5.0)), "surface": True, **body})


def test_a_pin_between_points_of_the_sheet_at_the_start_is_refused():
    pin = RigidBody(Capsule(1e-3, 0.04), BodyPath.still((0.0535, 0.0535, 0.0)), surface=True)
    with refused(match="m from the sheet at the start; triangle"):
        simulate(square(15), contact=pin).build("cpu")
