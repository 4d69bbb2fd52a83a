"""Rigid inclusions: they move as bodies, and keep momentum and energy."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import BULK, MU, refused, square
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from small_runs import run

from warp_pd import (
    BodyForce,
    BodyPath,
    BondAssociated,
    Circle,
    Explicit,
    Fixed,
    Implicit,
    MooneyRivlin,
    Motion,
    Newton,
    Reaction,
    Relaxation,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
)
from warp_pd.run.result import units_of


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


INCLUSION = square(9).inclusion((0.05, 0.05), 0.02)


def framed(points, mass=0.1):
    """A sheet with a rigid frame two points wide at its right edge."""
    sheet = square(points)
    return sheet.rigid(sheet.where(lambda x, y: x > 0.1 - 1.5 * sheet.spacing), mass)


@pytest.mark.parametrize(
    ("sheet", "damping"), [(INCLUSION, 0.0), (INCLUSION, 2.0), (framed(9), 0.0)], ids=["0", "2", "heavy frame"]
)
def test_a_free_sheet_with_an_inclusion_keeps_its_momenta_but_for_damping(sheet, damping):
    """It drifts, spins and tumbles; damping takes both momenta, those of the inclusion too, at one rate."""
    place = sheet.positions - np.average(sheet.positions, axis=0, weights=sheet.areas * sheet.density)
    velocity = np.cross([2.0, 1.0, 3.0], place) + [0.02, 0.01, 0.03]
    velocity[sheet.inclusions[0]] = 0.0
    result = run(sheet, initial_velocity=velocity, solver=Explicit(0.3, frames=3, safety=0.3, damping=damping))
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    left = np.exp(-damping * 0.3)

    def momenta(place, velocity):
        return (mass * velocity).sum(axis=0), (mass * np.cross(place, velocity)).sum(axis=0)

    linear, angular = momenta(place, velocity)
    after, turning = momenta(place + result.frame.displacement, result.frame.velocity)
    # Damping is of second order in the step.
    within = 1e-5 if damping else 1e-12
    assert after == pytest.approx(left * linear, abs=within * np.abs(linear).max())
    # The drift moves the origin of the arms.
    shift = (mass * (place + result.frame.displacement)).sum(axis=0) / mass.sum()
    assert turning - np.cross(shift, after) == pytest.approx(left * angular, abs=within * np.abs(angular).max())
    total = [row["kinetic"] + row["strain"] for row in result.history]
    assert damping or total[-1] == pytest.approx(total[0], rel=5e-3)


def test_an_inclusion_starts_with_the_velocity_of_its_points():
    """A sheet and its inclusion that fly and spin as one body go on so, but for the angle squared."""
    sheet = square(9).inclusion((0.03, 0.06), 0.02)
    spin, drift, duration = 0.05, np.array([0.3, -0.1, 0.2]), 0.02
    place = sheet.positions - np.average(sheet.positions, axis=0, weights=sheet.areas)
    velocity = np.cross([0.0, 0.0, spin], place) + drift
    result = run(sheet, initial_velocity=velocity, solver=Explicit(duration, frames=2, safety=0.3))
    bent = (spin * duration) ** 2 * np.abs(place).max()
    assert result.frame.displacement == pytest.approx(duration * velocity, abs=bent)


@pytest.mark.parametrize("name", ["initial_displacement", "initial_velocity"])
def test_an_inclusion_that_would_deform_is_refused(name):
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    strained = np.zeros((sheet.size, 3))
    strained[:, 0] = 0.1 * sheet.points[:, 0]
    with refused(match=rf"{name} of point \d+ = .*expected a rigid motion of its rigid inclusion"):
        run(sheet, **{name: strained})


def test_rounding_of_an_inclusion_that_stays_is_no_strain():
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    moved = 0.01 * (sheet.positions - sheet.positions[40])
    moved[sheet.inclusions[0]] = 1e-19 * np.arange(3 * len(sheet.inclusions[0])).reshape(-1, 3)
    run(sheet, initial_displacement=moved, solver=Explicit(1e-4, frames=1))


def around_an_insert(radius, insert, stretch, at):
    """Radii [m] of circles, of radius `at` before, in a stretched neo-Hookean disc with a rigid centre."""

    def slopes(r, state):
        along, around = state[1], state[0] / r
        apart = (around - around**-3 * along**-2) - (along - along**-3 * around**-2)
        turned = 2.0 * along**-3 * around**-3 * (along - around)
        return along, (apart - turned) / (r * (1.0 + 3.0 * along**-4 * around**-2))

    def shot(first):
        return solve_ivp(slopes, (insert, radius), (insert, first), rtol=1e-10, atol=1e-12, dense_output=True)

    first = brentq(lambda first: shot(first).y[0, -1] - stretch * radius, 1.05, 3.0)
    return shot(first).sol(at)[0]


def test_a_rigid_insert_in_a_stretched_sheet_is_where_it_was():
    """A disc of a stretched ring that is described in its stress-free size, as docs/shapes.md says."""
    radius, insert, stretch = 0.05, 0.015, 1.3
    sheet = Sheet.outline(
        Circle((0, 0), radius), inclusions=[Circle((0, 0), insert)], spacing=5e-3, thickness=1e-3, density=1000.0
    )
    rim, r = sheet.edges("outline"), np.hypot(*sheet.points.T)
    share = np.clip((r - insert) / (radius - insert), 0.0, 1.0) / np.maximum(r, insert)
    outward = (stretch - 1.0) * radius * share[:, None] * sheet.positions
    between = np.setdiff1d(sheet.where(lambda x, y: np.hypot(x, y) > 1.001 * insert), rim)
    law, clamps = BondAssociated(MooneyRivlin(c10=2e5), horizon=2.015), [Fixed(rim), Fixed(between, "z")]
    simulation = Simulation(sheet, law, Relaxation(tolerance=1e-6), loads=clamps, initial_displacement=outward)
    result = simulation.run(device="cpu", precision=64)
    moved = result.frame.displacement
    assert result.status == "finished" and np.abs(moved[sheet.inclusions[0]]).max() < 1e-5
    found = np.hypot(*(sheet.points + moved[:, :2])[between].T)
    exact = around_an_insert(radius, insert, stretch, r[between])
    np.testing.assert_allclose(found, exact, atol=0.015 * 0.3 * radius)
    # The start, in which each radius has the same stretch, is further off.
    start = np.hypot(*(sheet.points + outward[:, :2])[between].T)
    assert np.abs(start - exact).max() > 2.0 * np.abs(found - exact).max()


def test_an_inclusion_starts_where_its_points_are():
    """A sheet that starts turned about an oblique axis, and elsewhere, does as the sheet in its place."""
    sheet = square(9).inclusion((0.03, 0.06), 0.02)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    velocity = np.cross([2.0, 1.0, 3.0], sheet.positions - sheet.positions[40])
    here = run(sheet, initial_velocity=velocity, solver=Explicit(0.05, frames=1, safety=0.3))
    there = run(
        sheet, initial_displacement=sheet.positions @ turn.T + [0.1, 0.2, 0.3] - sheet.positions,
        initial_velocity=velocity @ turn.T, solver=Explicit(0.05, frames=1, safety=0.3),
    )  # fmt: skip
    moved, turned = (result.frame.displacement + sheet.positions for result in (here, there))
    assert turned == pytest.approx(moved @ turn.T + [0.1, 0.2, 0.3], abs=1e-9)


@pytest.mark.parametrize(("points", "bound"), [(9, 0.007), (17, 0.0038)])
def test_a_heavy_frame_swings_at_the_frequency_of_its_mass_on_a_spring(points, bound):
    """A strip that may not contract along its width has the stiffness E / (1 - nu^2) t w / L; its own mass counts for a
    third (Rayleigh). The frame is thrown along the strip, and is back after half a period."""
    mass, sheet = 0.1, framed(points)
    frame, length = sheet.inclusions[0], 0.1 - sheet.spacing
    free = np.setdiff1d(np.arange(sheet.size), [*frame, *sheet.edges("left")])
    strip = 1e-3 * 0.1 * length * 1e3
    ratio = (3.0 * BULK - 2.0 * MU) / (6.0 * BULK + 2.0 * MU)
    stiffness = 2.0 * MU / (1.0 - ratio) * 1e-3 * 0.1 / length
    frequency = np.sqrt(stiffness / (mass + strip / 3.0))
    velocity = np.zeros((sheet.size, 3))
    velocity[frame, 0] = speed = 1e-3 * length * frequency
    result = run(
        sheet, initial_velocity=velocity, solver=Explicit(np.pi / frequency, frames=1, safety=0.5),
        loads=[Fixed(sheet.edges("left")), Fixed(free, "y")],
    )  # fmt: skip
    late = result.frame.displacement[frame, 0].mean() * frequency / (np.pi * speed)
    assert abs(late) < bound


def test_a_body_pushes_a_sheet_with_an_inclusion():
    """Both are bodies with arrays of their own; the ball touches the sheet outside the inclusion."""
    sheet = square(17).inclusion((0.03, 0.05), 0.012)
    ball = RigidBody(Sphere(0.03), BodyPath([0.0, 0.3], [(0.07, 0.05, 0.0151), (0.07, 0.05, 0.0051)]))
    result = run(sheet, contact=ball, loads=[Fixed(sheet.edges("all"))], solver=Explicit(0.3, frames=3))
    below = sheet.nearest(0.07, 0.05)
    assert result.frame.displacement[below, 2] == pytest.approx(-0.0099, abs=1e-4)
    assert result.history[-1]["body_force_z"] > 0.0
    assert np.ptp(result.frame.displacement[sheet.inclusions[0], 2]) > 0.0


# Columns of the history ---------------------------------------------------------------------------------


def test_inclusion_has_columns_of_its_motion_and_of_the_force_of_the_sheet():
    """A heavy disc falls in a clamped sheet: m a = force of the sheet + weight, at every frame."""
    sheet, gravity, duration = square(9).inclusion((0.05, 0.05), 0.02), 9.81, 2e-3
    members = sheet.inclusions[0]
    result = run(
        sheet, solver=Explicit(duration, frames=40, safety=0.2),
        loads=[Fixed(sheet.edges("all")), BodyForce((0.0, 0.0, -1000.0 * gravity))],
    )  # fmt: skip
    rows, mass = result.history, 1000.0 * sheet.areas[members].sum() * 1e-3
    z, v, f = (np.array([row[f"inclusion_1_{what}_z"] for row in rows]) for what in ("position", "velocity", "force"))
    times = np.array([row["time"] for row in rows])
    assert z[-1] == pytest.approx(result.frame.displacement[members, 2].mean(), rel=1e-9)
    assert v[1:-1] == pytest.approx((z[2:] - z[:-2]) / (times[2:] - times[:-2]), rel=2e-3)
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(times))]) - mass * gravity * times
    assert mass * v == pytest.approx(impulse, abs=1e-3 * np.abs(impulse).max())
    assert all(rows[-1][f"inclusion_1_rotation_{c}"] == pytest.approx(0.0, abs=1e-9) for c in "xyz")


def test_columns_follow_a_body_that_turns():
    sheet = Sheet.outline(
        Circle((0.0, 0.0), 0.02), inclusions={"hub": Circle((0.0, 0.0), 0.008)}, spacing=2e-3, thickness=1e-3,
        density=1000.0,
    )  # fmt: skip
    spin = 50.0
    result = run(
        sheet, initial_velocity=np.cross([0.0, 0.0, spin], sheet.positions), solver=Explicit(1e-3, frames=4)
    )  # fmt: skip
    row = result.history[-1]
    assert row["hub_spin_z"] == pytest.approx(spin, rel=1e-2)
    assert row["hub_rotation_z"] == pytest.approx(spin * 1e-3, rel=1e-2)
    assert {name for name in row if name.startswith("hub_")} == {
        f"hub_{what}_{c}" for what in ("position", "rotation", "velocity", "spin", "force", "torque") for c in "xyz"
    }
    assert result.built.parts and units_of(result.built)["hub_rotation_z"] == "rad"


# Given motion, and prestretched sheets --------------------------------------------------------------------

RIM, HUB, TURN = 0.05, 0.0175, 0.02
WAYS = {
    "newton": Newton(), "relaxation": Relaxation(tolerance=1e-6),
    "implicit": Implicit(1e3, steps=2),
}  # fmt: skip


def moment(angle):
    """Of a hub turned by `angle` in a clamped ring [N m]: shear alone, of neo-Hookean rubber at any stretch."""
    return 4.0 * np.pi * MU * 1e-3 * angle / (HUB**-2 - RIM**-2)


def in_plane(sheet):
    """Supports of a ring around its inclusion."""
    rim = sheet.where(lambda x, y: np.hypot(x, y) > 0.9999 * RIM)
    return [Fixed(rim), Fixed(np.setdiff1d(np.arange(sheet.size), [*rim, *sheet.inclusions[0]]), "z")]


def turned(sheet, way, end=1.0, angle=TURN, precision=64, **motion):
    """A run in which the inclusion turns and moves."""
    moves = Motion(sheet.inclusions[0], [0.0, end], z=0.0, angle=[0.0, angle], **motion)
    return run(sheet, way, weights="corrected", precision=precision, loads=[*in_plane(sheet), moves])


def require_balance(result, name):
    """Check that the supports of the rim give what the inclusion takes, force and moment."""
    sheet = result.built.context.given
    row, rim = result.history[-1], in_plane(sheet)[0].points
    force = result.built.to_numpy(result.built.state.force)[rim]
    pull, place = (np.array([row[f"{name}_{what}_{c}"] for c in "xyz"]) for what in ("force", "position"))
    torque = row[f"{name}_torque_z"]
    about = np.cross(sheet.positions[rim], force).sum(axis=0) + np.cross(place, pull)
    assert about[2] == pytest.approx(-torque, rel=1e-3)
    assert force.sum(axis=0)[:2] == pytest.approx(-pull[:2], abs=1e-3 * abs(torque) / HUB)


@pytest.mark.parametrize(("way", "precision"), [*((way, 64) for way in WAYS), ("newton", 32)])
def test_a_hub_that_turns_in_a_ring_takes_the_moment_of_its_closed_form(way, precision):
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RIM), inclusions={"hub": Circle((0.0, 0.0), HUB)}, spacing=2.5e-3, thickness=1e-3,
        density=1000.0,
    )  # fmt: skip
    result = turned(sheet, WAYS[way], 1e3 if way == "implicit" else 1.0, precision=precision)
    row = result.history[-1]
    assert result.status == "finished"
    assert row["hub_rotation_z"] == pytest.approx(TURN, rel=1e-5)
    assert row["hub_torque_z"] == pytest.approx(-moment(TURN), rel=0.01)
    require_balance(result, "hub")


def disc(stretch):
    """Circles of points, stretched, with a disc glued on."""
    angles = [(k * RIM / 20, 2.0 * np.pi * np.arange(6 * k) / (6 * k)) for k in range(1, 21)]
    around = np.concatenate([np.stack([r * np.cos(a), r * np.sin(a)], axis=1) for r, a in angles])
    sheet = Sheet.from_points(np.vstack([np.zeros((1, 2)), around]), thickness=1e-3, density=1000.0)
    sheet = sheet.prestretched(stretch)
    return sheet.rigid(sheet.within((0.0, 0.0), HUB), mass=0.01)


@pytest.mark.parametrize(("stretch", "within"), [(1.0, 0.015), (1.4, 0.04)])
def test_a_disc_glued_on_a_stretched_sheet_takes_the_same_moment_and_a_shift(stretch, within):
    """Its moment does not depend on the stretch, but for the volume (0.7 %); families see a kink at its edge."""
    sheet = disc(stretch)
    mass = sheet.density * sheet.thickness * sheet.unstretched().areas
    assert mass[sheet.inclusions[0]].sum() == pytest.approx(0.01)
    row = turned(sheet, Newton()).history[-1]
    assert row["inclusion_1_torque_z"] == pytest.approx(-moment(TURN), rel=within)
    moved = turned(sheet, Newton(), x=[0.0, 1e-3], y=[0.0, 5e-4])
    row = moved.history[-1]
    assert [row[f"inclusion_1_position_{c}"] for c in "xyz"] == pytest.approx([1e-3, 5e-4, 0.0], abs=1e-9)
    assert row["inclusion_1_force_x"] == pytest.approx(2.0 * row["inclusion_1_force_y"], rel=0.01)
    assert row["inclusion_1_force_x"] < 0.0
    require_balance(moved, "inclusion_1")


def test_a_disc_glued_on_a_stretched_sheet_is_in_equilibrium_and_swings_at_the_frequency_of_its_tension():
    """A heavy disc on a membrane that weighs little: m w^2 = 2 pi T / ln(RIM / HUB), with the tension T per length."""
    stretch = 1.4
    sheet = disc(stretch)
    tension = MU * 1e-3 * (1.0 - stretch**-6)
    frequency = np.sqrt(2.0 * np.pi * tension / np.log(RIM / HUB) / 0.01)
    velocity = np.zeros((sheet.size, 3))
    velocity[sheet.inclusions[0], 2] = speed = 1e-3 * HUB * frequency
    sheet = replace(sheet, density=np.where(np.isin(np.arange(sheet.size), sheet.inclusions[0]), sheet.density, 100.0))
    end = 0.5 * np.pi / frequency
    result = run(
        sheet, Explicit(end, frames=1, safety=0.5), weights="corrected", initial_velocity=velocity,
        loads=in_plane(sheet)[:1],
    )  # fmt: skip
    row = result.history[-1]
    assert row["inclusion_1_position_z"] == pytest.approx(speed / frequency, rel=0.03)
    assert abs(row["inclusion_1_velocity_z"]) < 0.05 * speed
    assert abs(result.frame.displacement[:, :2]).max() < 1e-6


def test_a_disc_on_a_motion_has_its_velocity_spin_and_force_in_dynamics():
    sheet = disc(1.4)
    moves = Motion(sheet.inclusions[0], [0.0, 0.02], x=[0.0, 1e-3], y=0.0, z=0.0, angle=[0.0, TURN])
    result = run(sheet, Explicit(0.02, frames=1, safety=0.5), loads=[in_plane(sheet)[0], moves])
    row = result.history[-1]
    assert row["inclusion_1_velocity_x"] == pytest.approx(0.05, rel=1e-6)
    assert row["inclusion_1_spin_z"] == pytest.approx(TURN / 0.02, rel=1e-3)
    assert row["inclusion_1_force_x"] < 0.0 > row["inclusion_1_torque_z"]
    assert abs(row["balance_error"]) < 0.01


@pytest.mark.parametrize(("support", "said"), [
    (lambda inside: Motion(inside, [0.0, 1.0], angle=[0.0, 1.0]), "holds xy"),
    (lambda inside: Fixed(inside[1:]), "holds only some of its points"),
])  # fmt: skip
def test_an_inclusion_that_is_held_in_part_is_refused(support, said):
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    with refused(match=rf"\.points contains points of the rigid inclusion 'inclusion_1', but {said}: expected all"):
        run(sheet, Newton(), loads=[Fixed(sheet.edges("all")), support(sheet.inclusions[0])])


def test_newton_takes_inclusions_that_are_held():
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    with refused("sheet.inclusions that no Fixed or Motion holds: not supported by the solver Newton"):
        run(sheet, Newton(), loads=[Fixed(sheet.edges("all"))])


# Guides ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", [Explicit(0.1, frames=2), Relaxation(tolerance=1e-6)])
def test_a_disc_on_a_stem_rises_and_does_not_tilt(solver):
    """Beside the middle of its sheet it tilts without a guide; the guide takes the force along the sheet."""
    sheet = square(17).inclusion((0.035, 0.05), 0.015)
    disc = sheet.inclusions[0]
    loads = [Fixed(sheet.edges("all")), BodyForce((0.0, 0.0, 2e3))]
    free, guided = (
        run(sheet, solver, loads=[*loads, *more]).history[-1]
        for more in ((), [Fixed(disc, "xy"), Reaction(disc, "guide")])
    )
    turns = [f"inclusion_1_rotation_{c}" for c in "xyz"]
    assert [guided[name] for name in turns] == [0.0, 0.0, 0.0] and abs(free[turns[1]]) > 1e-4
    start = np.average(sheet.positions[disc], axis=0, weights=sheet.areas[disc])
    assert [guided[f"inclusion_1_position_{c}"] for c in "xy"] == pytest.approx(start[:2], abs=1e-15)
    assert guided["inclusion_1_position_z"] > 1e-4 and guided["guide_z"] == 0.0
    assert guided["guide_x"] == pytest.approx(-guided["inclusion_1_force_x"], rel=1e-5)
    assert solver.dynamic is False or abs(guided["balance_error"]) < 0.01


def test_in_the_plane_a_disc_drifts_and_spins_as_without_guides():
    """All points held along z, as a problem in the plane is: momentum and moment about z stay."""
    sheet = INCLUSION
    place = sheet.positions - np.average(sheet.positions, axis=0, weights=sheet.areas)
    velocity = np.cross([0.0, 0.0, 3.0], place) + [0.02, 0.01, 0.0]
    velocity[sheet.inclusions[0]] *= 0.5
    loads = [Fixed(np.arange(sheet.size), "z")]
    held, free = (
        run(sheet, initial_velocity=velocity, solver=Explicit(0.05, frames=2, safety=0.3), loads=more)
        for more in (loads, [])
    )
    assert held.frame.displacement == pytest.approx(free.frame.displacement, abs=1e-12)
    assert held.history[-1]["inclusion_1_spin_z"] == pytest.approx(free.history[-1]["inclusion_1_spin_z"], rel=1e-9)
