"""Notes on bodies that do what contact does not prevent."""

import itertools

import numpy as np
import pytest
from helpers import NEO, refused, square

from warp_pd import (
    ArcLength,
    BodyPath,
    BondAssociated,
    Box,
    Capsule,
    CriticalStretch,
    Explicit,
    Fixed,
    Free,
    MooneyRivlin,
    Newton,
    RigidBody,
    SelfContact,
    Sheet,
    Simulation,
    Sphere,
)
from warp_pd.contact.body_checks import created, passes, sweeps


def notes(contact, duration=0.04, points=11, damage=None):
    sheet = square(points)
    edge = sheet.where(lambda x, y: (abs(x - 0.05) > 0.0499) | (abs(y - 0.05) > 0.0499))
    scene = Simulation(
        sheet,
        force=BondAssociated(NEO, horizon=2.015),
        loads=[Fixed(edge)],
        contact=contact,
        damage=damage,
        solver=Explicit(duration=duration, frames=8),
    )
    return [note for note in scene.run(device="cpu").summary["notes"] if "RigidBody" in note]


def pin(x, y):
    path = BodyPath([0.0, 0.2], [(x, y, 0.03), (x, y, -0.2)])
    return RigidBody(Capsule(0.0145, 0.03), path, name="pin")


def test_a_pin_between_stretched_points_is_noted_with_its_passage():
    thin, passed = notes(pin(0.055, 0.055))
    assert "'pin' is 0.0145 m thick" in thin and "may pass between them, without surface=True (at 0.0" in thin
    assert "'pin' passed through the sheet without breaking it" in passed
    assert passed.endswith(" s)") and "(at 0.0" in passed and "expected surface=True, a thicker" in passed


@pytest.mark.parametrize("solver", [Newton(load_steps=1), ArcLength(increment=0.99, most_steps=2)])
def test_a_load_step_that_takes_a_body_through_the_sheet_is_halved(solver):
    """A ball that a single load step would put on the other side presses on the sheet."""
    sheet = square(15)
    ball = RigidBody(Sphere(0.03), BodyPath([0.0, 1.0], [(0.05, 0.05, 0.01505), (0.05, 0.05, -0.01)]), name="ball")
    force, loads = BondAssociated(MooneyRivlin(500.0)), [Fixed(sheet.edges("all"))]
    result = Simulation(sheet, force, solver, loads=loads, contact=ball).run(device="cpu")
    (passed,) = [note for note in result.summary["notes"] if "passed" in note]
    assert "refused because it passed through the sheet: 1; expected more load_steps, a thicker body" in passed
    assert result.status == "finished" and result.history[-1]["ball_force_z"] > 0.0
    assert result.history[-1]["ball_force_z"] > 0.0


def test_a_way_through_a_triangle_is_told_from_one_beside_it():
    """Its plane passes the origin early or late on the way; there its sides are half a length from its middle."""
    corners = np.array([[0.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    for part, (beside, met) in itertools.product((0.2, 0.8), ((0.45, True), (0.5, True), (0.55, False))):
        begin, end = ((shift, 0.0, height) for shift, height in ((0.0, part), (beside / part, part - 1.0)))
        assert passes(corners + begin, corners + end, np.array([[0, 1, 2]]), None) == met


@pytest.mark.parametrize(("begin", "end", "met"), [
    ((-2.0, 0.1, 0.0), (2.0, 0.1, 0.0), True), ((-2.0, 0.45, 0.0), (2.0, 0.45, 0.0), False),
    ((-2.0, 0.1, 0.0), (-0.6, 0.1, 0.0), False), ((-1.0, 0.1, 0.0), (39.0, 0.1, 0.0), True),
])  # fmt: skip
def test_a_way_through_a_body_is_told_from_one_beside_it(begin, end, met):
    """A point that comes out on the other side of a ball of diameter 1, at least 0.1 deep on its way."""
    ways = np.array([begin, (3.0, 3.0, 3.0)]), np.array([end, (3.0, 3.0, 2.0)])
    assert sweeps(*ways, Sphere(1.0), 0.1, lambda places: np.linalg.norm(places, axis=1) - 0.5) == met
    # The way close above a flat box is nearer to its middle than its corners are.
    above = np.array([(-2.0, 0.0, 0.15)]), np.array([(2.0, 0.0, 0.15)])
    assert not sweeps(*above, Box((1.0, 1.0, 0.2)), 0.05, lambda places: np.abs(places[:, 2]) - 0.1)


@pytest.mark.parametrize("what", ["ball", "SelfContact"])
def test_contact_far_from_the_origin_is_refused_in_float32(what):
    """Coordinates of a survey: positions of 32 bits are half a metre apart, and a ball would miss the sheet."""
    near = square(5)
    away = np.array([500e3, 4.5e6])
    for shift, precision in ((away, 32), (away, 64), (1e-4 * away, 32)):
        sheet = Sheet.from_points(near.points + shift, triangles=near.triangles, thickness=1e-3, density=1e3)
        place = (*(shift + 0.05), 0.05)
        contact = (
            SelfContact() if what == "SelfContact" else RigidBody(Sphere(0.04), BodyPath([0.0], [place]), name=what)
        )
        scene = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3), loads=[Fixed(range(3))], contact=contact)
        if shift is away and precision == 32:
            with refused(match=f"{what}.*reaches 4.5e.06 m from the origin, and 32 bits do not resolve its spacing"):
                scene.build(device="cpu", precision=precision)
        else:
            scene.build(device="cpu", precision=precision)


def test_a_pin_beside_the_sheet_is_not_noted():
    assert notes(pin(0.15, 0.055)) == ["contact = RigidBody 'pin' did not touch the sheet"]


def test_a_way_through_a_torn_triangle_is_no_passage():
    corners = np.array([[0.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [5.0, 5.0, 0.0]])
    for torn, met in ((3, True), (1, False)):
        assert (
            passes(corners + [0.0, 0.0, 0.2], corners - [0.0, 0.0, 0.8], np.array([[0, 1, 2]]), np.arange(4) == torn)
            == met
        )


def test_a_pin_that_tears_its_way_is_no_passage():
    """Bonds that the run broke are told from those that were there at its start."""
    assert any("passed through" in note for note in notes(pin(0.055, 0.055), damage=CriticalStretch(50.0)))
    assert not any("passed through" in note for note in notes(pin(0.055, 0.055), damage=CriticalStretch(1.1)))


def test_the_sides_of_a_tear_are_no_gap_that_a_body_slips_through():
    """A ball three times as thick as what a triangle of the sheet allows comes through the hole that it tears."""
    path = BodyPath([0.0, 0.04], [(0.051, 0.052, 0.0301), (0.051, 0.052, -0.06)])
    ball = RigidBody(Sphere(0.06), path, name="ball")
    assert notes(ball, damage=CriticalStretch(1.3)) == []


@pytest.mark.parametrize(("apart", "overlap"), [(0.02, True), (0.05, False)])
def test_bodies_that_overlap_are_noted(apart, overlap):
    balls = [RigidBody(Sphere(0.03), Free(0.01, (0.03 + apart * k, 0.05, 0.02)), name=f"b{k}") for k in range(2)]
    found = [note for note in notes(balls, duration=0.01) if "did not touch" not in note]
    assert len(found) == overlap
    said = "'b0' and contact = RigidBody 'b1' overlap: rigid bodies do not interact with each other (at 0 s)"
    assert all(said in note for note in found)


def pressed_together(gap, **options):
    """Notes of a ball that presses the sheet towards a box, up to a gap between them [m]."""
    box = RigidBody(Box((0.06, 0.06, 0.04)), BodyPath.still((0.05, 0.05, -0.025)), name="box")
    end = 0.015 + gap
    path = BodyPath([0.0, 2.0 * (0.0202 - end)], [(0.05, 0.05, 0.0202), (0.05, 0.05, end)])
    bodies = [RigidBody(Sphere(0.04), path, name="ball"), box]
    return [note for note in notes(bodies, points=21, **options) if "created" in note or "overlap" in note]


def test_bodies_create_energy_only_where_they_overlap():
    """Two that do push points to and fro: what one loses the other gains, until points are thrown out."""
    assert pressed_together(1e-5) == []
    (overlap,) = pressed_together(-0.0025)
    assert "overlap" in overlap
    created, _ = pressed_together(-0.015)
    assert "created an energy of" in created and "'ball'" in created and "'box'" in created
    assert " s: the sum of ball_loss and box_loss fell" in created


@pytest.mark.parametrize(("losses", "energy"), [
    ((0.0, 0.3, 0.25, 0.5), None), ((0.0, 0.3, 0.1, 0.5), 0.2), ((0.0, 0.0, -0.01, 0.0), 0.01),
    ((0.0, -1e-6, 0.0, 0.0), None), ((0.0,), None),
])  # fmt: skip
def test_a_loss_that_falls_is_energy_created(losses, energy):
    history = [{"time": 0.1 * k, "half_step_kinetic": 1.0, "strain": 5.0, "box_loss": x} for k, x in enumerate(losses)]
    found = created(history, ["box"])
    assert (found and found[0]) == (energy and pytest.approx(energy))
    assert found is None or found[2:] == (0.1, 0.2)
    # Another body takes what it gives.
    taken = [{**row, "ball_loss": -row["box_loss"]} for row in history]
    assert created(taken, ["box", "ball"]) is None
