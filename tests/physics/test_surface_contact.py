"""Contact of triangles with thin bodies: a pin and a balloon, distances, momentum, energy."""

import numpy as np
import pytest
import warp as wp
from helpers import square
from small_runs import run, simulate

from warp_pd import (
    BodyPath,
    BondAssociated,
    Box,
    Capsule,
    EnclosedGas,
    Explicit,
    Fixed,
    Free,
    InputError,
    MooneyRivlin,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
    TearingEnergy,
    TensionField,
)
from warp_pd.kernels.surface_contact import clearances
from warp_pd.parts.body_shapes import in_frame, on_device
from warp_pd.parts.body_surface import segments_on_device

MU, SHARE, THICKNESS, DENSITY, RADIUS, STRETCH, LENGTH = 0.4e6, 0.1, 0.3e-3, 1000.0, 0.05, 2.5, 0.1
# Of transverse waves: the Cauchy stress over the density.
WAVE_SPEED = np.sqrt(MU * (1.0 - SHARE + SHARE * STRETCH**2) * (STRETCH**2 - STRETCH**-4) / DENSITY)


def distances(corners, half_length):
    """Distances of triangles (F, 3, 3) from a segment along z about the origin, (F,)."""
    shape = Capsule(1e-9, 2.0 * half_length) if half_length else Sphere(1e-9)
    (segments, _tree), (body, _mesh) = segments_on_device(shape, 0.0, wp.get_device("cpu")), on_device(shape, "cpu")
    found, given = wp.zeros(len(corners), dtype=wp.float64, device="cpu"), wp.array(corners, dtype=wp.vec3d, device="cpu")
    inputs = [given, 100.0, segments, body, 0]
    wp.launch(clearances(shape.distance), len(corners), inputs=inputs, outputs=[found], device="cpu")
    return np.maximum(found.numpy(), 0.0)


class Gaps:
    """A writer that keeps the least distance of a whole triangle from a body at every frame [m]."""

    def __init__(self, sheet, body, half_length):
        self.sheet, self.body, self.half_length, self.least = sheet, body, half_length, []

    def write(self, frame):
        place = self.body.motion.pose(frame.time)[0]
        whole = self.sheet.triangles if frame.intact_faces is None else self.sheet.triangles[frame.intact_faces]
        corners = (self.sheet.positions + frame.displacement - place)[whole]
        self.least.append(float(distances(corners, self.half_length).min()) - 0.5 * self.body.shape.diameter)

    def save(self):
        pass

    close = save


def pinned(diameter, speed, depth, points, frames, precision=64, **parts):
    """A run of a pin that is pushed into a balloon, and its gap at every frame."""
    top = STRETCH * RADIUS
    sheet = Sheet.sphere(top, thickness=THICKNESS, density=DENSITY, points=points)
    gauge = 2.0 * MU * THICKNESS / RADIUS * (1.0 / STRETCH - STRETCH**-7) * (1.0 - SHARE + SHARE * STRETCH**2)
    gas = EnclosedGas(gauge=gauge, leak=0.8 if parts else 0.0)
    start = top + 0.5 * LENGTH + 0.55 * diameter
    path = BodyPath([0.0, depth / speed], [(0.003, 0.002, start), (0.003, 0.002, start - depth)])
    pin = RigidBody(Capsule(diameter, LENGTH), path, name="pin", surface=True)
    law = BondAssociated(
        TensionField(MooneyRivlin(0.5 * (1.0 - SHARE) * MU, 0.5 * SHARE * MU)), horizon=2.015, weights="corrected"
    )
    scene = Simulation(
        sheet.prestretched(STRETCH), law, Explicit(depth / speed, frames=frames, damping=5.0, safety=0.3),
        loads=[Fixed(sheet.where(lambda x, y, z: z < -0.5 * top)), gas], contact=pin, track_energy=True, **parts,
    )  # fmt: skip
    gaps = Gaps(scene.sheet, pin, 0.5 * LENGTH)
    return scene.run(device="cpu", precision=precision, writers=[gaps]), np.array(gaps.least)


def test_distances_of_triangles_from_a_segment():
    """Against the nearest of many points of the triangle, whose distance from the segment is exact."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(300, 3, 3))
    u, v = (t.ravel() for t in np.meshgrid(*[np.linspace(0.0, 1.0, 241)] * 2))
    weights = np.column_stack([1.0 - u - v, u, v])[u + v < 1.0 + 1e-12]
    for half_length in (0.0, 0.7):
        points = np.einsum("wk,fkc->fwc", weights, corners)
        points[..., 2] -= np.clip(points[..., 2], -half_length, half_length)
        sampled = np.linalg.norm(points, axis=2).min(axis=1)
        found = distances(corners, half_length)
        assert (found <= sampled + 1e-12).all()
        assert (sampled - found).max() < 0.03
        assert half_length == 0.0 or 10 < (found == 0.0).sum() < 290


@pytest.mark.parametrize(
    ("diameter", "speed", "points", "frames"),
    [(8e-3, 0.1, 16, 200), (8e-3, 3.0, 24, 200), (8e-4, 1.0, 16, 500), (8e-4, 3.0, 16, 500)],
)
def test_a_pin_dents_a_balloon_and_stays_outside(diameter, speed, points, frames):
    """Finer than its triangles, with sides of 12 mm; every step, on every triangle."""
    depth = 0.06 if speed < 1.0 else 0.03
    result, gaps = pinned(diameter, speed * WAVE_SPEED, depth, points, frames)
    assert result.status == "finished" and result.summary["steps"] <= 1.01 * frames
    assert gaps.min() > 0.0
    assert gaps[-1] < 0.05 * diameter
    assert result.history[-1]["pin_force_z"] > 0.5
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-5
    assert all(row["pin_loss"] >= 0.0 for row in result.history)
    assert not [note for note in result.summary["notes"] if "pin" in note]


@pytest.mark.parametrize("damping", [0.0, 40.0])
def test_a_thin_pin_gives_what_the_sheet_gets(damping):
    """Momentum and angular momentum to round-off, with friction; a sheet of 7 mm and a pin of 1 mm that turns."""
    sheet, centre = square(15), np.array([0.0505, 0.0522, -0.021])
    turned = (0.0, np.sin(0.1), 0.0, np.cos(0.1))
    path = BodyPath([0.0, 0.05], [centre, centre], [(0.0, 0.0, 0.0, 1.0), turned])
    pin = RigidBody(Capsule(1e-3, 0.04), path, friction=0.3, surface=True)
    result = run(
        sheet, Explicit(0.05, frames=10, damping=damping, safety=0.3), contact=pin,
        initial_velocity=np.tile([0.3, 0.0, -0.8], (sheet.size, 1)),
    )  # fmt: skip
    rows, mass = result.history, result.built.to_numpy(result.built.state.mass)[:, None]
    assert max(abs(row["balance_error"]) for row in rows) < 2e-3
    assert 0.0 < rows[-1]["body_rubbed"] <= rows[-1]["body_loss"]
    if damping == 0.0:
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


def test_a_pin_bursts_a_balloon_that_tears():
    """Gas flows out; whole triangles stay outside, and those that tore let the pin pass. 0.8 mm: docs/contact.md."""
    result, gaps = pinned(8e-3, WAVE_SPEED, 0.2, 16, 60, 32, damage=TearingEnergy(1.4e5, 0.008))
    rows = result.history
    assert 0.9 < result.frame.intact_faces.mean() < 0.995
    assert rows[-1]["pressure"] < 0.6 * rows[0]["pressure"]
    assert gaps.min() > 0.0


def test_bodies_without_a_surface_leave_nothing_of_it():
    def plan(surface):
        pin = RigidBody(Capsule(0.03, 0.03), BodyPath.still((0.0, 0.0, 5.0)), surface=surface)
        return simulate(square(7), contact=pin).plan("cpu", 64)

    for name in ("find_pressing", "spread", "take_in_step", "body_pushes"):
        assert name in plan(True) and name not in plan(False)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"shape": Box((0.1, 0.1, 0.1))}, "expected a Sphere or Capsule on a BodyPath"),
        ({"motion": Free(1.0, (0.0, 0.0, 5.0))}, "expected a Sphere or Capsule on a BodyPath"),
        ({"surface": 1}, "RigidBody.surface = 1: expected True or False"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(body, words):
    with pytest.raises(InputError, match=words):
        RigidBody(**{"shape": Sphere(0.1), "motion": BodyPath.still((0.0, 0.0, 5.0)), "surface": True, **body})


def test_a_pin_between_points_of_the_sheet_at_the_start_is_refused():
    pin = RigidBody(Capsule(1e-3, 0.04), BodyPath.still((0.0535, 0.0535, 0.0)), surface=True)
    with pytest.raises(InputError, match="m from the sheet at the start; triangle"):
        simulate(square(15), contact=pin).build("cpu")
