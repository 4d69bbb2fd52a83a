"""Loads, contact, rupture, rigid inclusions: each against what mechanics says."""

import numpy as np
import pytest
from helpers import GENT, NEO, array, build, square, uniform

from warp_pd import (
    Bimodular,
    BodyForce,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Motion,
    Nodal,
    Ogden,
    PointForce,
    Pressure,
    Relaxation,
    RigidBall,
    Sheet,
    Simulation,
)


def run(sheet, *, solver=None, precision=64, material=NEO, horizon=2.015, weights="plain", **parts):
    law = BondAssociated(material, horizon=horizon, weights=weights)
    return Simulation(sheet, law, solver or Explicit(0.1, frames=4), **parts).run(device="cpu", precision=precision)


@pytest.mark.parametrize("ramp", [None, [(0.0, 0.0), (0.1, 1.0)]])
def test_body_force_makes_the_sheet_fall(ramp):
    result = run(
        square(5), solver=Explicit(0.1, frames=4, safety=0.05), loads=[BodyForce((0.0, 0.0, -9810.0), ramp=ramp)]
    )
    fall = 0.5 * 9.81 * 0.1**2 if ramp is None else 9.81 * 0.1**2 / 6.0
    assert result.frame.displacement[:, 2] == pytest.approx(-fall, rel=2e-2)
    assert abs(result.history[-1]["balance_error"]) < 1e-2


def test_point_force_and_dead_pressure_push_with_what_they_say():
    sheet = square(5)
    built = build(sheet, loads=[PointForce([3, 4], (1.0, 2.0, 3.0)), Pressure(7.0, follower=False)])
    external = built.to_numpy(built.state.external)
    assert external.sum(axis=0) == pytest.approx([1.0, 2.0, 3.0 + 7.0 * 0.01])


@pytest.mark.parametrize("make", [square, lambda n: square(n).as_cloud()])
def test_follower_pressure_is_nansons(make):
    """p J F^-T N of a uniform deformation, whatever it is."""
    sheet = make(9)
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    built = build(sheet, loads=[Pressure(5.0)], initial_displacement=uniform(sheet, F))
    built.context.run("setup")
    expected = 5.0 * np.outer(sheet.areas, np.cross(F[:, 0], F[:, 1]))
    assert built.to_numpy(built.state.external) == pytest.approx(expected, abs=1e-12)


def test_prescribed_motion_follows_its_knots_component_by_component():
    sheet = square(7)
    right = sheet.edges("right")
    result = run(
        sheet,
        solver=Explicit(0.4, frames=8, safety=0.1),
        loads=[Fixed(sheet.edges("left")), Motion(right, [0.0, 0.1, 0.2, 0.3], x=[0.0, 0.01, 0.01, -0.005], z=0.002)],
    )
    assert result.frame.displacement[right, 0] == pytest.approx(-0.005, abs=1e-12)
    assert result.frame.displacement[right, 2] == pytest.approx(0.002, abs=1e-12)
    assert np.ptp(result.frame.displacement[right, 1]) > 1e-8
    assert abs(result.history[-1]["balance_error"]) < 2e-2


def test_edges_that_move_in_different_directions_share_their_corners():
    """Each point has one row: two would write its velocity at once, and one motion would be lost."""
    sheet = square(7)
    right, top = sheet.edges("right"), sheet.edges("top")
    loads = [
        Fixed(sheet.edges("left")),
        Motion(right, [0.0, 0.1], x=[0.0, 0.01]),
        Motion(top[1:], [0.0, 0.1], y=[0.0, 0.02]),
    ]
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(0.1, frames=1, safety=0.1), loads=loads)
    built = simulation.build("cpu")
    assert (array(built, "moved_rows").numpy() >= 0).sum() == len(right) + len(top) - 2
    assert len(array(built, "moved_schedules")) == len(right) + len(top) - 2
    corner = np.intersect1d(right, top)
    assert simulation.run(device="cpu").frame.displacement[corner, :2] == pytest.approx(
        np.array([[0.01, 0.02]]), abs=1e-7
    )


def ball_run(precision=64, damping=0.0, **ball):
    sheet = square(15)
    values = {"diameter": 0.03, "start": (0.05, 0.05, 0.0151), "velocity": (0.0, 0.0, -0.1), **ball}
    return run(
        sheet, solver=Explicit(0.15, frames=15, damping=damping, safety=0.5), precision=precision,
        loads=[Fixed(sheet.edges())], contact=RigidBall(**values),
    )  # fmt: skip


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_no_point_is_inside_the_ball_and_the_energy_balances(precision, damping):
    result = ball_run(precision, damping)
    sheet = result.built.simulation.sheet
    position = np.column_stack([sheet.points, np.zeros(sheet.size)]) + result.frame.displacement
    distance = np.linalg.norm(position - result.frame.ball_center, axis=1)
    assert distance.min() > 0.015 * (1.0 - 1e-5)
    assert (distance < 0.015 * (1.0 + 1e-4)).sum() >= 5
    assert max(abs(row["balance_error"]) for row in result.history[3:]) < 0.015
    assert result.history[-1]["ball_force_z"] > 0.0


def test_the_ball_feels_the_momentum_that_it_gives():
    sheet = square(9)
    result = run(
        sheet, solver=Explicit(0.05, frames=5, safety=0.3),
        contact=RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -0.3)),
    )  # fmt: skip
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    momentum = (mass * result.frame.velocity).sum(axis=0)
    given = -sum(row["ball_force_z"] for row in result.history) * 0.01
    assert momentum[2] == pytest.approx(given, rel=1e-9)
    assert momentum[2] < 0.0


def test_a_ball_that_never_touches_changes_nothing():
    sheet = square(9)
    velocity = np.tile([0.0, 0.0, 0.1], (sheet.size, 1))
    with_ball = run(sheet, contact=RigidBall(0.01, (0.0, 0.0, 5.0)), initial_velocity=velocity)
    without = run(sheet, initial_velocity=velocity)
    assert (with_ball.frame.displacement == without.frame.displacement).all()


@pytest.mark.parametrize(("broken", "safety"), [("drop", 0.1), ("redistribute", 0.02)])
def test_tearing_a_strip_in_two(broken, safety):
    """Pulled apart at mid-height: damage appears, the halves separate, nothing is NaN, the energy balances.

    Redistributed weights stiffen what a family has left: at 0.1 of the step the released energy has either sign.
    """
    sheet = Sheet.rectangle(0.04, 0.1, thickness=1e-3, density=1000.0, points=(9, 21)).cut(
        (-0.01, 0.0512), (0.016, 0.0512)
    )
    law = BondAssociated(NEO, horizon=3.015, broken=broken)
    top = sheet.edges("top")
    simulation = Simulation(
        sheet, law, Explicit(0.5, frames=25, damping=5.0, safety=safety),
        loads=[Fixed(sheet.edges("bottom")), Motion(top, [0.0, 0.5], x=0.0, y=[0.0, 0.15], z=0.0)],
        damage=CriticalStretch(1.5),
    )  # fmt: skip
    result = simulation.run(device="cpu", precision=64)
    assert result.status == "finished", result.summary["message"]
    assert result.frame.damage.max() > 0.4
    assert not result.frame.intact_faces.all()
    damage = [row["mean_damage"] for row in result.history]
    assert (np.diff(damage) >= 0.0).all() and damage[0] == 0.0
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    assert result.history[-1]["rupture"] > 0.0


def test_every_bond_breaking_in_one_step_leaves_free_points():
    sheet = square(7)
    start = np.column_stack([sheet.points, np.zeros(sheet.size)]) * 1.0
    result = run(sheet, initial_displacement=start, damage=CriticalStretch(1.2), solver=Explicit(0.02, frames=2))
    assert result.status == "finished"
    assert (result.frame.damage == 1.0).all()
    assert not result.frame.intact_faces.any()


def test_spared_points_keep_their_bonds():
    sheet = square(7)
    start = np.column_stack([sheet.points, np.zeros(sheet.size)]) * 1.0
    spared = sheet.edges("left")
    damage = CriticalStretch(1.2, spared=spared)
    result = run(sheet, initial_displacement=start, damage=damage, solver=Explicit(0.002, frames=2))
    assert (result.frame.damage[spared] == 0.0).all()
    assert (result.frame.damage[sheet.edges("right")] == 1.0).all()


def test_nothing_breaks_below_the_critical_stretch():
    sheet = square(7)
    start = 0.15 * np.column_stack([sheet.points, np.zeros(sheet.size)])
    built = build(sheet, initial_displacement=start, damage=CriticalStretch(1.2))
    built.context.run("setup")
    built.state.step.assign(np.array([1e-6]))
    before = built.law.intact.numpy().copy()
    built.context.run("step")
    assert (built.law.intact.numpy() == before).all()


def test_a_rigid_inclusion_moves_as_a_body():
    sheet = square(17).inclusion((0.05, 0.05), 0.018)
    members = sheet.inclusions[0]
    result = run(
        sheet, solver=Explicit(0.3, frames=6, safety=0.5),
        loads=[Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 0.3], x=[0.0, 0.03], y=[0.0, 0.03], z=[0.0, 0.02])],  # noqa: E501
    )  # fmt: skip
    reference = np.column_stack([sheet.points, np.zeros(sheet.size)])
    moved = reference + result.frame.displacement
    before = np.linalg.norm(reference[members][:, None] - reference[members], axis=-1)
    after = np.linalg.norm(moved[members][:, None] - moved[members], axis=-1)
    assert after == pytest.approx(before, abs=1e-9)
    assert np.linalg.norm(result.frame.displacement[members], axis=1).min() > 1e-3
    assert abs(result.history[-1]["balance_error"]) < 0.01


def test_a_free_sheet_with_an_inclusion_keeps_its_momentum():
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    spin = np.column_stack([-sheet.points[:, 1], sheet.points[:, 0], 0.3 * sheet.points[:, 0]])
    spin[sheet.inclusions[0]] = 0.0
    result = run(sheet, initial_velocity=spin, solver=Explicit(0.3, frames=3, safety=0.3))
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    before, after = (mass * spin).sum(axis=0), (mass * result.frame.velocity).sum(axis=0)
    assert after == pytest.approx(before, abs=1e-10 * np.abs(mass * spin).sum())
    total = [row["kinetic"] + row["strain"] for row in result.history]
    assert total[-1] == pytest.approx(total[0], rel=5e-3)


def test_gent_near_its_lock_ends_with_the_cause():
    sheet = square(7)
    simulation = Simulation(
        sheet, BondAssociated(GENT, weights="plain"), Explicit(1.0, frames=50),
        loads=[Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 2.0])],
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.status == "diverged"
    assert "lock" in result.summary["message"]
    assert np.isfinite(result.frame.displacement).all()


def test_a_slack_sheet_is_at_rest_at_once():
    result = run(square(7), solver=Relaxation())
    assert result.status == "finished" and result.summary["residual"] == 0.0


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Ogden(mu=1.0, exponents=(2.0,)), "mu = 1.0"),
        (lambda: Ogden(mu=(1.0,), exponents=2.0), "exponents = 2.0"),
        (lambda: BondAssociated("rubber"), "material = 'rubber'"),
        (lambda: BondAssociated(Bimodular(1e3)), "material = Bimodular.* such as NeoHookean"),
        (lambda: BondBased(NEO), "material = NeoHookean.* such as Bimodular"),
        (lambda: Nodal(type(NEO)), "material = <class"),
        (lambda: Simulation(square(5), None, Explicit(1.0)).build("cpu"), "force = None"),
        (lambda: Simulation(square(5), NEO, Explicit(1.0)).build("cpu"), "force = NeoHookean"),
    ],
)
def test_a_part_in_the_wrong_place_is_named(make, says):
    with pytest.raises(InputError, match=says):
        make()
