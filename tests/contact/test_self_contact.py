"""Self-contact and sheets of several pieces: momentum, energy, gradients, bits, and that nothing passes through."""

import numpy as np
import pytest
from helpers import Kept, build, internal_force, largest_square, refused, sever, square, strain_energy
from passing import passing
from resumed_runs import require_same_when_stopped
from small_runs import run, simulate

from warp_pd import (
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    Place,
    Relaxation,
    RigidBall,
    SelfContact,
    Sheet,
    placed,
    together,
)
from warp_pd.contact import self_contact
from warp_pd.device import graph


def two_sheets(points=9, turn=20.0, gap=1.6):
    """A square over a smaller one, turned against it, and the displacement that brings them there."""
    upper, lower = square(points - 2, 0.1 * (points - 3) / (points - 1)), square(points)
    sheet = together(lower, upper)
    return sheet, placed(sheet, Place(), Place((0.02, 0.01, gap * lower.spacing), degrees=turn))


def collision(speed=0.5, friction=0.0, sideways=0.0, frames=10, duration=0.05, **contact):
    sheet, start = two_sheets()
    velocity = np.zeros((sheet.size, 3))
    velocity[sheet.pieces == 2] = (sideways, 0.0, -speed)
    return {
        "sheet": sheet, "solver": Explicit(duration, frames=frames, safety=0.45), "initial_displacement": start,
        "initial_velocity": velocity, "contact": SelfContact(friction=friction, **contact),
    }  # fmt: skip


def momentum(result):
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    return (mass * result.frame.velocity).sum(axis=0), mass


def folded(points=11):
    """A square folded over by half its length, with noise: positions minus reference."""
    sheet = square(points)
    x, y = sheet.points.T
    gap = 1.1 * sheet.spacing
    bend = np.pi * (x - 0.05) / gap
    there = np.column_stack([x, y, np.zeros(sheet.size)])
    after = x > 0.05
    angle = np.clip(bend, 0.0, np.pi)
    there[after, 0] = (0.05 + 0.5 * gap * np.sin(angle) * 2.0 / np.pi)[after]
    beyond = after & (bend > np.pi)
    there[beyond, 0] = (0.05 - (x - 0.05 - gap))[beyond]
    there[after, 2] = (0.5 * gap * (1.0 - np.cos(angle)))[after]
    there += 0.1 * sheet.spacing * np.random.default_rng(1).normal(size=there.shape)
    return sheet, there - sheet.positions


@pytest.mark.parametrize(("precision", "momentum_bound"), [(64, 1e-14), (32, 1e-6)])
def test_two_pieces_bounce_off_with_momentum_and_energy(precision, momentum_bound):
    parts = collision()
    result = run(**parts, precision=precision)
    after, mass = momentum(result)
    before = (mass * parts["initial_velocity"]).sum(axis=0)
    assert np.abs(after - before).max() < momentum_bound * np.abs(before).max()
    first, last = result.history[0], result.history[-1]
    assert max(row["contact"] for row in result.history) > 0.3 * first["kinetic"]
    assert last["contact"] < 0.01 * first["kinetic"]
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-2
    assert abs(last["balance_error"]) < 2e-3
    upper = parts["sheet"].pieces == 2
    assert (mass * result.frame.velocity)[upper, 2].sum() > 0.1 * before[2]


def test_the_balance_of_energy_is_of_second_order_in_the_step():
    errors = []
    for steps in (400, 800):
        parts = collision(duration=0.02, frames=20)
        result = run(**{**parts, "solver": Explicit(0.02, frames=20, step=0.02 / steps)})
        errors.append(max(abs(row["balance_error"]) for row in result.history))
    assert errors[1] < 0.4 * errors[0] < 0.4 * 1e-3


@pytest.mark.parametrize("breakable", [False, True])
def test_the_force_is_minus_the_gradient_of_the_energy(breakable):
    sheet, displacement = folded()
    damage = {"damage": CriticalStretch(9.0)} if breakable else {}
    built = build(sheet, contact=SelfContact(), **damage)
    without = build(sheet, **damage)
    if breakable:
        for each in (built, without):
            sever(each, ((0.025, -1.0), (0.025, 1.0)))

    def energy(u):
        for each in (built, without):
            strain_energy(each, u)
        built.context.run("setup")
        built.context.run("frame")
        return float(built.contacts[0].energy.numpy().sum())

    def force(each, u):
        each.state.displacement.assign(u)
        each.context.run("setup")
        return each.to_numpy(each.state.force)

    assert energy(displacement) > 0.0
    contact = force(built, displacement) - force(without, displacement)
    rng = np.random.default_rng(0)
    for _ in range(3):
        direction = rng.normal(size=displacement.shape)
        step = 1e-7 * sheet.spacing
        slope = (energy(displacement + step * direction) - energy(displacement - step * direction)) / (2.0 * step)
        assert slope == pytest.approx(-(contact * direction).sum(), rel=1e-5)


@pytest.mark.parametrize("pieces", [1, 2])
def test_pairs_without_a_bond_touch_and_no_others(pieces):
    """Points of one piece keep less than their distance in the sheet, also beside another piece that is far away."""
    sheet, start = square(17).cut((-0.01, 0.02), (0.03, 0.02)), None
    if pieces == 2:
        sheet = together(sheet, square(17))
        start = placed(sheet, Place(), Place((0.0, 0.0, 1.0)))
    built = build(sheet, horizon=3.15, contact=SelfContact(), damage=CriticalStretch(2.0), initial_displacement=start)
    sever(built, ((0.08, 0.08), (0.08, 0.11)))
    built.context.run("setup")
    assert np.abs(built.to_numpy(built.state.force)).max() < 1e-15
    # Squeezed, bonds are shorter than what other pairs keep.
    squeezed = np.column_stack([-0.4 * sheet.points, np.zeros(sheet.size)])
    if pieces == 2:
        squeezed[sheet.pieces == 2] = start[sheet.pieces == 2]
    built.state.displacement.assign(squeezed)
    built.context.run("setup")
    built.context.run("frame")
    touching = built.contacts[0].energy.numpy() > 0.0
    x, y = sheet.points.T / sheet.spacing
    at_cut = (np.abs(y - 3.2) < 3.0) & (x < 8.0)
    at_tear = (np.abs(x - 12.8) < 3.0) & (y > 9.0)
    assert touching[at_cut].any()
    assert touching[at_tear].any()
    assert not touching[~(at_cut | at_tear)].any()
    assert pieces == 1 or not touching[sheet.pieces == 2].any()


def test_lists_hold_every_pair_within_their_reach():
    """Wherever the sheets lie in the cells that points are sorted into."""
    sheet = together(square(5), square(5))
    built = build(sheet, contact=SelfContact())
    part = built.contacts[0]
    reach = part.distance + part._skin
    for low in np.linspace(0.0, 10.0, 101) * reach:
        start = placed(sheet, Place((0.0, 0.0, low)), Place((0.0, 0.0, low + 0.99 * reach)))
        built.state.displacement.assign(start)
        built.context.run("setup")
        place = sheet.positions + start
        apart = np.linalg.norm(place[:, None] - place, axis=2)
        expected = ((apart < reach) & (sheet.pieces[:, None] != sheet.pieces)).sum(axis=1)
        assert expected.min() >= 1
        np.testing.assert_array_equal(part._counts.numpy(), expected)
    # As far on the other side, the pieces lie apart.
    built.state.displacement.assign(-start)
    built.context.run("setup")
    assert not part._counts.numpy().any()


@pytest.mark.parametrize("precision", [64, 32])
def test_bits_repeat_and_do_not_depend_on_when_lists_are_made(precision, device, monkeypatch):
    scene, options = simulate(**collision(friction=0.3, sideways=0.2)), {"precision": precision, "device": device}
    one, again = (scene.run(**options) for _ in range(2))
    # Nothing public says how often lists are made: it is to change no bit.
    monkeypatch.setattr(self_contact, "SKIN", 0.05)
    often = scene.run(**options)
    for other in (again, often):
        np.testing.assert_array_equal(one.frame.displacement, other.frame.displacement)
        np.testing.assert_array_equal(one.frame.velocity, other.frame.velocity)
    assert one.history == again.history


@pytest.mark.parametrize("damage", [None, CriticalStretch(1.4)], ids=["whole", "torn"])
def test_launches_with_nothing_to_do_are_left_out_with_the_same_bits(monkeypatch, damage):
    """The sheets meet, slide and part: lists are made anew, and friction begins and ends."""
    case, left_out = {**collision(friction=0.3, sideways=0.4, duration=0.08), "damage": damage}, []

    def always(launch):
        left_out.append(launch._needed is not None and not launch._needed[0])
        launch._needed = None
        run_launch(launch)

    run_launch = graph.CpuLaunch.run
    quick = run(**case)
    # Launches that are left out leave no trace but time.
    monkeypatch.setattr(graph.CpuLaunch, "run", always)
    every = run(**case)
    assert quick.history == every.history
    for name in ("displacement", "velocity"):
        np.testing.assert_array_equal(getattr(quick.frame, name), getattr(every.frame, name))
    assert any(left_out) and every.history[-1]["sheet_friction"] > 0.0


def test_the_default_stiffness_is_that_of_the_softest_rubber():
    """In pure shear, incompressible rubber has the modulus 4 mu."""
    sheet, rubber = square(9), MooneyRivlin(2e5, 1e5)
    part = build(sheet.stiffened(sheet.edges("left"), 0.5), material=rubber, contact=SelfContact())
    expected = self_contact.STIFFNESS * 0.5 * 4.0 * 6e5 * sheet.thickness
    assert part.contact.stiffness == pytest.approx(expected, rel=1e-4)


def test_both_precisions_agree():
    one, other = (run(**collision(), precision=precision) for precision in (64, 32))
    scale = np.abs(one.frame.displacement[:, 2]).max()
    assert np.abs(one.frame.displacement - other.frame.displacement).max() < 1e-3 * scale


def test_a_run_resumes_in_contact(tmp_path):
    parts = collision(friction=0.3, sideways=0.2, duration=0.03, frames=6)
    whole = require_same_when_stopped(lambda: simulate(**parts), tmp_path, [2, 4])
    assert whole.history[2]["contact"] > 0.0


def test_friction_dissipates_and_conserves_momentum():
    parts = collision(friction=0.5, sideways=0.5)
    result = run(**parts)
    after, mass = momentum(result)
    before = (mass * parts["initial_velocity"]).sum(axis=0)
    assert np.abs(after - before).max() < 1e-14 * np.abs(before).max()
    lost = [row["sheet_friction"] for row in result.history]
    assert (np.diff(lost) >= 0.0).all()
    assert lost[-1] > 0.01 * result.history[0]["kinetic"]
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-2


@pytest.mark.parametrize("held", [False, True])
def test_the_balance_of_friction_with_damping_is_of_second_order(held):
    """Half a step of damping lies between the impulse of friction and the velocities before and after it.

    A support that moves the lower sheet along does work against friction.
    """
    parts = collision(friction=0.5, sideways=0.5)
    lower = np.flatnonzero(parts["sheet"].pieces == 1)
    loads = [Motion(lower, times=[0.0, 1.0], x=[0.0, -0.5], y=0.0, z=0.0)] if held else []
    if held:
        parts["initial_velocity"][lower, 0] = -0.5
    worst = []
    for safety in (0.4, 0.2, 0.1):
        solver = Explicit(0.05, frames=10, safety=safety, damping=30.0)
        result = run(**{**parts, "solver": solver, "loads": loads})
        worst.append(max(abs(row["balance_error"]) for row in result.history))
    assert result.history[-1]["sheet_friction"] > 0.1 * result.history[0]["kinetic"]
    # Over two halvings: where in its step the sheets meet matters in a single one.
    assert np.log(worst[0] / worst[2]) / np.log(4.0) > 1.9 and worst[2] < worst[1]


def passed(parts, triangles=None, **options):
    """Pairs (point, triangle) that pass through each other in any step of a run; a frame is a step."""
    positions = Kept(lambda frame: parts["sheet"].positions + frame.displacement.astype(float))
    simulate(**parts).run(device="cpu", precision=64, writers=[positions], **options)
    chosen = parts["sheet"].triangles if triangles is None else triangles
    return [pair for before, after in zip(positions.all, positions.all[1:], strict=False)
            for pair in passing(before, after, chosen)]  # fmt: skip


def test_no_point_passes_a_triangle_of_the_other_piece():
    parts = collision(duration=0.06, frames=200)
    assert passed(parts) == []
    assert passed({**parts, "contact": SelfContact(stiffness=1e-6)})


def test_the_test_of_passing_sees_a_point_that_passes():
    before = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, 1e-300], [2.0, 0.0, 1.0]])
    after = before * [[1.0, 1.0, -1.0]]
    assert passing(before, after, np.array([[0, 1, 2]])) == [(3, 0)]


def passes_between_torn_halves(contact, steps=400):
    """Pairs (point, triangle) that pass while the halves of a torn sheet run into each other."""
    sheet = square(11)
    tear = 0.05 - 0.25 * sheet.spacing
    half = np.where(sheet.points[:, 0] < tear, 1.0, -1.0)
    # Without contact the left one passes downwards through the right one once they overlap.
    offset, velocity = np.zeros((2, sheet.size, 3))
    offset[:, 2] = 0.2 * half * sheet.spacing
    velocity[:, 0], velocity[:, 2] = 0.15 * half, -0.05 * half
    built = simulate(
        sheet, contact=contact, damage=CriticalStretch(9.0), initial_velocity=velocity, initial_displacement=offset
    ).build("cpu", 64)  # fmt: skip
    sever(built, ((tear, -1.0), (tear, 1.0)))
    for name in ("start", "setup"):
        built.context.run(name)
    built.state.step.assign(np.array([5e-4]))
    step, before, found = built.context.sequence("step"), sheet.positions, []
    triangles = sheet.triangles[np.ptp(half[sheet.triangles], axis=1) == 0.0]
    for _ in range(steps):
        step.run()
        after = sheet.positions + built.to_numpy(built.state.displacement)
        found += passing(before, after, triangles)
        before = after
    return found


def test_the_faces_of_a_tear_do_not_pass_through_each_other():
    assert passes_between_torn_halves(SelfContact()) == []
    assert passes_between_torn_halves(None, steps=120)


def test_a_sheet_without_contact_has_no_array_and_no_launch_of_it():
    for contact in (None, RigidBall(0.1, (0.0, 0.0, 1.0))):
        plan = simulate(square(9), contact=contact).plan("cpu")
        assert "SelfContact" not in plan
    frictionless = simulate(square(9), contact=SelfContact()).plan("cpu")
    assert "near_points" in frictionless
    assert "friction" not in frictionless
    assert "friction_impulse" in simulate(square(9), contact=SelfContact(friction=0.1)).plan("cpu")
    surface = simulate(square(9), contact=SelfContact(surface=True)).plan("cpu")
    assert "surface_near" in surface and "near_points" not in surface and "surface_dragged" not in surface


def test_a_ball_and_self_contact_act_together():
    ball = RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -0.1))
    solver, loads = Explicit(0.05, frames=2), [Fixed(square(9).edges())]
    both = run(square(9), solver, contact=[ball, SelfContact()], loads=loads)
    alone = run(square(9), solver, contact=ball, loads=loads)
    assert both.history[-1]["ball_force_z"] == pytest.approx(alone.history[-1]["ball_force_z"], rel=0.05)
    assert len(both.frame.bodies) == 1


def test_the_step_is_shorter_by_no_more_than_the_bound_of_the_contacts():
    parts = collision()
    free = run(**{**parts, "contact": None, "solver": Explicit(1e-3, frames=1)})
    built = run(**{**parts, "solver": Explicit(1e-3, frames=1)}).built
    omega = 2.0 / (1.02 * free.summary["stable_dt"])
    together_ = np.hypot(omega, built.contacts[0].added_frequency())
    assert built.solver.estimate(120) == pytest.approx(2.0 / (1.02 * together_), rel=5e-3)
    # The frequency of all contacts that a sheet pressed flat on another has is below the bound.
    contact = built.contacts[0]
    u = np.asarray(parts["initial_displacement"]).copy()
    u[parts["sheet"].pieces == 2, 2] -= 1.2 * parts["sheet"].spacing
    soft, bare = build(parts["sheet"], contact=SelfContact()), build(parts["sheet"])
    largest = largest_square(
        lambda x: internal_force(soft, x) - internal_force(bare, x), u, soft, parts["sheet"].spacing
    )
    assert 0.3 * contact.added_frequency() ** 2 < largest < contact.added_frequency() ** 2


def test_pieces_share_no_bond_and_start_without_stress():
    sheet, start = two_sheets()
    built = build(sheet, horizon=3.15)
    members = built.law.families.members_of(np.arange(sheet.size))
    exists = members >= 0
    owners = np.repeat(sheet.pieces[:, None], members.shape[1], axis=1)
    assert (sheet.pieces[members[exists]] == owners[exists]).all()
    assert strain_energy(built, start) < 1e-25
    alone = build(square(9).turned(10.0), horizon=3.15).law.families.members_of(np.arange(81)) >= 0
    assert (exists[:81].sum(axis=1) == alone.sum(axis=1)).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SelfContact(distance=0.0), "SelfContact.distance = 0.0: expected a positive number"),
        (lambda: SelfContact(stiffness=-1.0), "SelfContact.stiffness = -1.0: expected a positive number"),
        (lambda: SelfContact(friction=-0.1), "SelfContact.friction = -0.1: expected"),
        (lambda: SelfContact(surface=1), "SelfContact.surface = 1: expected True or False"),
        (lambda: SelfContact(stiffness=1.0, surface=True), "stiffness = 1.0: expected None with surface = True"),
        (lambda: simulate(square(9), contact=[SelfContact(), SelfContact()]).build("cpu"), "two or more SelfContact"),
        (lambda: simulate(square(9), Newton(), contact=SelfContact()).build(
            "cpu"
        ), "not supported by the solver Newton"),
        (lambda: simulate(square(9), Relaxation(), contact=SelfContact()).build("cpu"), "not supported by the solver"),
        (lambda: simulate(square(9), contact=["ball"]).build("cpu"), r"contact\[0\] = 'ball': expected an instance"),
        (lambda: together(square(9)), "sheets: expected two or more sheets, got 1"),
        (lambda: together(square(9), square(9).prestretched(1.2)), r"sheets\[1\] is prestretched"),
        (lambda: together(square(9), Sheet.tube(0.1, 0.1, thickness=1e-3, density=1000.0, points=20)), "is curved"),
        (lambda: placed(square(9), Place()), "expected a sheet of several pieces"),
        (lambda: placed(together(square(9), square(9)), Place()), "places: expected 2, one per piece, got 1"),
        (lambda: placed(together(square(9), square(9)), Place(), "x"), r"^places\[1\] = 'x': expected a Place"),
        (lambda: together(square(9), "b"), r"^sheets\[1\] = 'b': expected a Sheet"),
        (lambda: Place(axis=(0.0, 0.0, 0.0)), "expected a nonzero vector"),
        (lambda: Place(degrees=float("nan")), "^Place.degrees = nan: expected a finite number"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_in_one_line(make, message):
    with refused(match=message):
        make()


def test_a_crushed_sheet_is_refused():
    sheet = square(13)
    with refused(match="points without bonds came within"):
        run(sheet, initial_displacement=-0.9 * sheet.positions, contact=SelfContact(stiffness=1e-3))


def test_a_block_slides_with_coulombs_friction():
    """It hits a fixed sheet obliquely: all along, its impulse of friction is the coefficient times the normal one."""
    lower, upper = square(21), square(9, 0.0388)
    sheet = together(lower, upper)
    block = sheet.pieces == 2
    start = placed(sheet, Place(), Place((0.02, 0.03, 1.5 * lower.spacing), degrees=17.0))
    velocity = np.zeros((sheet.size, 3))
    velocity[block] = (1.0, 0.0, -0.2)
    means = {}
    for coefficient in (0.0, 0.3):
        mean = Kept(lambda frame: frame.velocity[block].mean(axis=0))
        result = simulate(
            sheet, Explicit(0.03, frames=3, safety=0.45), initial_displacement=start, initial_velocity=velocity,
            loads=[Fixed(sheet.edges("sheet 1"))], contact=SelfContact(friction=coefficient),
        ).run(device="cpu", precision=64, writers=[mean])  # fmt: skip
        means[coefficient] = mean.all[-1]
    smooth, rough = means[0.0], means[0.3]
    assert rough[2] > 0.1
    assert (1.0 - rough[0]) - (1.0 - smooth[0]) == pytest.approx(0.3 * (rough[2] + 0.2), rel=0.03)
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-2
