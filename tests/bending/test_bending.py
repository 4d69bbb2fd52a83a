"""Bending: gradient and tangent, momentum, patches, rolled sheets, plates, buckling, dynamics."""

import helpers
import numpy as np
import pytest
import small_runs
from helpers import internal_force, jittered, random_gradient, refused, sever, square, strain_energy, uniform
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from warp_pd import (
    ArcLength,
    BodyForce,
    Circle,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    Plate,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    TearingEnergy,
)
from warp_pd.command.modes import natural_modes
from warp_pd.device.fields import assign
from warp_pd.statics.tangent import HostBlocks

# Poisson's ratio zero: a strip then bends like a beam, whatever its width.
BEAM = NeoHookean(mu=1e5, bulk=2e5 / 3.0)
LENGTH, THICKNESS = 0.1, 1e-3
STIFFNESS = 2e5 * THICKNESS**3 / 12.0


def tube():
    return Sheet.tube(0.02, 0.05, thickness=THICKNESS, density=1000.0, points=16)


SHEETS = {"lattice": lambda: square(7), "cloud": lambda: jittered(7), "tube": tube}


def with_plate(made):
    """The function with an argument `bending`: True, a stiffness, or False for a membrane."""

    def bent(*arguments, bending=False, loads=(), **parts):
        plate = [Plate(None if bending is True else bending)] if bending else []
        return made(*arguments, loads=[*loads, *plate], **parts)

    return bent


build, run = with_plate(helpers.build), with_plate(small_runs.run)


def bending_force(sheet, displacement, **parts):
    """Force of bending alone [N], (N, 3)."""
    bent, plain = (build(sheet, bending=given, **parts) for given in (True, False))
    return internal_force(bent, displacement) - internal_force(plain, displacement)


def rough_motion(sheet):
    return 0.2 * sheet.spacing * np.random.default_rng(0).normal(size=(sheet.size, 3))


def bending_energy(built, displacement):
    strain_energy(built, displacement)
    return float(built.law.energy.numpy().sum())


def strip(points, clamps=1):
    """A strip whose free part has a length of 0.1 m, and its spacing; each clamp has one more column of points."""
    spacing = LENGTH / (points - 1)
    width = round(0.2 * (points - 1)) * spacing
    made = Sheet.rectangle(
        LENGTH + clamps * spacing, width, thickness=THICKNESS, density=1000.0, points=points + clamps
    )
    return made, spacing


def orders(errors):
    return np.log2(np.abs(np.array(errors[:-1]) / np.array(errors[1:])))


@pytest.mark.parametrize("name", SHEETS)
def test_the_force_is_minus_the_gradient_of_the_energy_and_conserves_momentum(name):
    sheet = SHEETS[name]()
    built, here = build(sheet, bending=True), rough_motion(sheet)
    force = bending_force(sheet, here)
    size = np.abs(force).sum()
    assert size > 0.0
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.cross(sheet.positions + here, force).sum(axis=0)).max() < 1e-12 * size
    direction = np.random.default_rng(4).normal(size=here.shape)
    step = 1e-6 * sheet.spacing
    slope = (bending_energy(built, here + step * direction) - bending_energy(built, here - step * direction)) / (
        2 * step
    )
    assert slope == pytest.approx(-(force * direction).sum(), rel=1e-6)


def test_the_stiffness_of_a_plate_is_that_of_its_material():
    """D = E h^3 / (12 (1 - nu^2)) at every point, softened where the sheet is."""
    sheet = square(9, thickness=lambda x, y: THICKNESS * (1.0 + 5.0 * x))
    sheet = sheet.stiffened(sheet.edges("left"), 0.25)
    for material, young, poisson in ((BEAM, 2e5, 0.0), (MooneyRivlin(4e4, 1e4), 3e5, 0.5)):
        law = build(sheet, bending=True, material=material).law
        assert law.poisson == pytest.approx(poisson, abs=1e-4)
        exact = young * sheet.thickness**3 / (12.0 * (1.0 - poisson**2)) * sheet.stiffness
        assert law.stiffness == pytest.approx(exact, rel=1e-4)
        assert sheet.stiffness.min() == 0.25 and np.ptp(sheet.thickness) > 0.4 * THICKNESS


@pytest.mark.parametrize("name", SHEETS)
def test_a_rigid_motion_and_flat_stretching_bend_nothing(name):
    sheet = SHEETS[name]()
    scale = np.abs(bending_force(sheet, rough_motion(sheet))).max()
    rotation, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turned = sheet.positions @ (rotation * np.sign(np.linalg.det(rotation))).T - sheet.positions + 0.01
    assert np.abs(bending_force(sheet, turned)).max() < 1e-9 * scale
    if name != "tube":
        x, y = sheet.points.T
        uneven = np.column_stack([2.0 * x * y, 3.0 * x**2, 0.0 * x])
        for motion in (uniform(sheet, random_gradient(3)), uneven):
            assert np.abs(bending_force(sheet, motion)).max() < 1e-9 * scale


def test_a_rolled_sheet_has_the_energy_of_a_cylinder():
    """Second order on a lattice; a cloud, whose shape changes with its spacing, comes as close."""
    radius, errors = 0.04, {"lattice": [], "cloud": []}
    for points in (11, 21, 41):
        for name, sheet in (("lattice", square(points)), ("cloud", jittered(points))):
            x, y = sheet.points.T
            place = np.column_stack([radius * np.sin(x / radius), y, radius * (1.0 - np.cos(x / radius))])
            built = build(sheet, bending=True, material=BEAM)
            exact = 0.5 * STIFFNESS * 0.1**2 / radius**2
            errors[name].append(bending_energy(built, place - sheet.positions) / exact - 1.0)
    assert abs(errors["lattice"][-1]) < 2e-3 and orders(errors["lattice"]).min() > 1.8
    assert abs(errors["cloud"][-1]) < 2e-3


def test_a_tube_that_widens_bends_by_the_change_of_its_curvature():
    sheet = Sheet.tube(0.02, 0.05, thickness=THICKNESS, density=1000.0, points=48)
    built = build(sheet, bending=True, material=BEAM)
    around = sheet.positions * [1.0, 1.0, 0.0]
    if np.ptp(np.linalg.norm(around, axis=1)) > 1e-9:
        around = sheet.positions * [0.0, 1.0, 1.0]
    widened, radius = 1.3, 0.02
    exact = 0.5 * STIFFNESS * (2.0 * np.pi * radius * 0.05) * ((widened - 1.0) / radius) ** 2
    assert bending_energy(built, (widened - 1.0) * around) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("name", list(SHEETS))
def test_the_tangent_is_the_derivative_of_the_force_and_its_matrix(name):
    sheet = SHEETS[name]()
    built = build(sheet, bending=1e-4, solver=Newton(preconditioner="direct"))
    (level,) = built.solver.levels
    here = rough_motion(sheet)
    along = np.random.default_rng(1).normal(size=here.shape)
    assign(built.state.displacement, here)
    level.linearise(0.0)
    assign(level.vector, along)
    level.run("product")
    product, step = level.image.numpy(), 1e-6 * sheet.spacing
    slope = (internal_force(built, here + step * along) - internal_force(built, here - step * along)) / (2.0 * step)
    assert product == pytest.approx(-slope, abs=1e-7 * np.abs(slope).max())
    matrix = level.tangent.sparse().matrix()
    assert (matrix @ along.ravel()).reshape(-1, 3) == pytest.approx(product, abs=1e-11 * np.abs(product).max())
    assert abs(matrix - matrix.T).max() < 1e-12 * abs(matrix).max()


@pytest.mark.parametrize("precision", [64, 32])
@pytest.mark.parametrize("name", list(SHEETS))
def test_rigid_motions_of_a_turned_sheet_meet_no_stiffness_of_bending(name, precision):
    sheet = SHEETS[name]()
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    built = build(sheet, bending=1e-4, solver=Newton(), precision=precision)
    level, there = built.solver.levels[0], turn.apply(sheet.positions)
    assign(level.displacement, there - sheet.positions)
    level.linearise(0.0)
    found, every = level.tangent, np.ones(3 * sheet.size, bool)
    bending, round_off = (
        HostBlocks(found.starts, found.columns, found.blocks, every).matrix(),
        1e-11 if precision == 64 else 1e-5,
    )
    for axis in np.eye(3):
        for motion in (np.broadcast_to(axis, there.shape), np.cross(axis, there)):
            largest = (abs(bending) @ np.abs(motion).ravel()).max()
            assert np.abs(bending @ motion.ravel()).max() < round_off * largest
    assert np.linalg.eigvalsh(bending.toarray())[0] > -round_off * abs(bending).max()


def test_a_cantilever_bends_like_a_beam():
    errors, force = [], 1e-6
    for points in (11, 21):
        sheet, spacing = strip(points)
        tip = sheet.edges("right")
        shares = sheet.areas[tip] / sheet.areas[tip].sum()
        loads = [PointForce([int(p)], (0.0, 0.0, force * share)) for p, share in zip(tip, shares, strict=True)]
        held = Fixed(sheet.where(lambda x, y, h=spacing: x < 1.01 * h))
        result = run(sheet, Newton(), material=BEAM, weights="corrected", loads=[held, *loads], bending=True)
        exact = force * LENGTH**3 / (3.0 * STIFFNESS * np.ptp(sheet.points[:, 1]))
        errors.append(result.frame.displacement[tip, 2].mean() / exact - 1.0)
        assert result.history[-1]["bending"] == pytest.approx(0.5 * force * exact, rel=2e-3)
    assert np.abs(errors).max() < 1e-3 and orders(errors).min() > 1.4
    # The modes have a tangent of their own, after that of Newton's method.
    (frequency,) = natural_modes(result.built, 1).frequencies
    exact = 3.516 * np.sqrt(STIFFNESS / (1000.0 * THICKNESS)) / LENGTH**2 / (2.0 * np.pi)
    assert frequency == pytest.approx(exact, rel=5e-3)


def elastica_drop(load):
    """Drop of the tip of a heavy clamped strip over its length; `load` is weight x length^2 over stiffness."""
    s, y = np.linspace(0.0, 1.0, 101), np.zeros((2, 101))
    for part in np.geomspace(1.0, load, 20):
        found = solve_bvp(
            lambda s, y, part=part: [y[1], -part * (1.0 - s) * np.cos(y[0])],
            lambda begin, end: [begin[0], end[1]], s, y, tol=1e-8, max_nodes=10_000,
        )  # fmt: skip
        s, y = found.x, found.y
    return np.trapezoid(np.sin(y[0]), s)


@pytest.mark.parametrize(("weight", "most"), [(400.0, 12), (1000.0, 12), (4000.0, 15)])
def test_a_heavy_strip_hangs_as_the_elastica_after_few_steps(weight, most):
    sheet, spacing = strip(21)
    held = Fixed(sheet.where(lambda x, y: x < 1.01 * spacing))
    weighs = BodyForce((0.0, 0.0, -weight))
    result = run(sheet, Newton(), material=BEAM, weights="corrected", loads=[held, weighs], bending=True)
    solve = result.summary["solve"]
    assert sheet.size == 110 and len(solve["load_steps"]) == 1 and solve["iterations"] <= most
    drop = -result.frame.displacement[sheet.edges("right"), 2].mean()
    # The strip stretches under its weight, too.
    stretch = 0.5 * weight * LENGTH / 2e5
    assert drop == pytest.approx(
        LENGTH * (elastica_drop(weight * THICKNESS * LENGTH**3 / STIFFNESS) + stretch), rel=4.4e-3
    )


@pytest.mark.parametrize("precision", [64, 32])
def test_a_sheet_draped_over_a_plateau_takes_few_steps(precision):
    sheet = square(21)
    held = Fixed(sheet.where(lambda x, y: np.hypot(x - 0.05, y - 0.05) < 0.012))
    result = run(
        sheet,
        Newton(),
        precision=precision,
        weights="corrected",
        loads=[held, BodyForce((0.0, 0.0, -9810.0))],
        bending=True,
    )
    assert len(result.summary["solve"]["load_steps"]) == 1 and result.summary["solve"]["iterations"] <= 12


def test_a_clamped_plate_vibrates_at_its_frequency():
    """35.985 sqrt(D / m) / a^2 (Leissa 1969), with Poisson's ratio of rubber."""
    errors = []
    for points in (11, 21, 31):
        h = LENGTH / (points - 1)
        side = LENGTH + 2.0 * h
        sheet = Sheet.rectangle(side, side, thickness=THICKNESS, density=1000.0, points=points + 2)
        x, y = sheet.points.T
        held = np.flatnonzero((np.minimum(x, y) < 1.01 * h) | (np.maximum(x, y) > side - 1.01 * h))
        built = build(sheet, bending=2e-5, loads=[Fixed(held)], solver=Explicit(1.0))
        (frequency,) = natural_modes(built, 1, "z").frequencies
        exact = 35.985 * np.sqrt(2e-5 / (1000.0 * THICKNESS)) / LENGTH**2 / (2.0 * np.pi)
        errors.append(frequency / exact - 1.0)
    assert abs(errors[-1]) < 6e-3 and errors[1] / errors[0] == pytest.approx(0.25, abs=0.05)


def test_plates_with_held_slopes_bend_as_clamped_ones():
    """A circle from an outline, q a^4 / (64 D), and a square, 0.00126532 q a^4 / D (Timoshenko, table 35)."""
    errors = []
    for points in (11, 21):
        h = 0.1 / (points - 1)
        disc = Sheet.outline(Circle((0.0, 0.0), 0.05), spacing=h, thickness=2e-3, density=1000.0)
        side = Sheet.rectangle(0.1, 0.1, points=points, thickness=2e-3, density=1000.0)
        for sheet, edge, share in ((disc, "outline", 0.05**4 / 64.0), (side, "all", 0.00126532 * 0.1**4)):
            loads = [Fixed(sheet.edges(edge), slope=True), Pressure(1e-3)]
            result = run(sheet, Newton(load_steps=1), loads=loads, bending=0.02)
            errors.append(result.frame.displacement[:, 2].max() * 0.02 / (1e-3 * share) - 1.0)
    coarse, fine = np.array(errors).reshape(2, 2)
    assert (fine < 0.023).all() and (fine > 0.0).all() and orders([coarse.max(), fine.max()]).min() > 1.8


def test_held_slopes_are_those_of_two_held_rows():
    """Of a tube under pressure from outside, one row with held slopes moves as two held rows do."""
    found = []
    for slope in (True, False):
        tube = Sheet.tube(0.05, 0.1, points=(24, 9), thickness=2e-3, density=1000.0)
        step = 0.1 / 8
        if not slope:
            tube = Sheet.tube(0.05, 0.1 + step, points=(24, 10), thickness=2e-3, density=1000.0)
        z = tube.points[:, 2] - (0.0 if slope else step)
        held = Fixed(np.flatnonzero(z < 1e-6), slope=slope)
        result = run(tube, Newton(load_steps=1), loads=[held, Pressure(-1.0)], bending=0.1)
        found.append(np.linalg.norm(result.frame.displacement[np.abs(z - 4 * step) < 1e-6], axis=1).mean())
    assert found[0] == pytest.approx(found[1], rel=0.02)


def test_held_slopes_are_refused_where_they_mean_nothing():
    sheet = square(11)
    with refused(match="Fixed.slope = True: expected a Plate"):
        build(sheet, loads=[Fixed(sheet.edges("all"), slope=True)])
    with refused(match="Fixed.slope = True with components = 'z': expected 'xyz'"):
        Fixed([0], "z", slope=True)
    with refused(match="Fixed.slope = True: not supported on a prestretched sheet"):
        build(sheet.prestretched(1.1), bending=True, loads=[Fixed(sheet.edges("all"), slope=True)])


def test_a_strip_buckles_at_eulers_load():
    errors = []
    strain = 4.0 * np.pi**2 * STIFFNESS / LENGTH**2 / (2e5 * THICKNESS)
    for points in (11, 21):
        sheet, spacing = strip(points, 2)
        left = Fixed(sheet.where(lambda x, y, h=spacing: x < 1.01 * h))
        right = sheet.where(lambda x, y, h=spacing: x > LENGTH + 0.99 * h)
        loads = [left, Motion(right, [0.0, 1.0], x=[0.0, -1.5 * strain * LENGTH], y=[0.0, 0.0], z=[0.0, 0.0])]
        result = run(
            sheet, ArcLength(increment=0.2), material=BEAM, horizon=1.5, weights="corrected", loads=loads, bending=True
        )
        errors.append(next(f["load_factor"] for f in result.summary["solve"]["found"]) * 1.5 - 1.0)
    assert errors[1] < 0.03 and orders(errors).min() > 1.4


def test_a_strip_that_is_let_go_keeps_its_energy():
    sheet, spacing = strip(11)
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 2] = np.maximum(sheet.points[:, 0] - spacing, 0.0) ** 2
    held = Fixed(sheet.where(lambda x, y: x < 1.01 * spacing))
    result = run(
        sheet, Explicit(0.05, frames=10), material=BEAM, loads=[held], initial_velocity=velocity, bending=0.1,
    )  # fmt: skip
    rows = result.history
    assert result.status == "finished" and max(abs(row["balance_error"]) for row in rows) < 2e-3
    assert max(row["bending"] for row in rows) > 0.9 * rows[0]["kinetic"]


def test_a_stiffer_plate_takes_shorter_steps():
    sheet = square(9)
    steps = [run(sheet, Explicit(1e-4, frames=1), bending=given).built.solver.estimate(40) for given in (1e-3, 4e-3)]
    assert steps[0] / steps[1] == pytest.approx(2.0, rel=0.02)


def weakened(built):
    """Let triangles lose what broken bonds and damage take."""
    built.context.run("step")
    built.state.velocity.zero_()


@pytest.mark.parametrize("name", SHEETS)
def test_a_damaged_sheet_keeps_gradient_and_momentum(name):
    sheet = SHEETS[name]()
    damage = np.random.default_rng(5).uniform(-0.5, 0.7, sheet.size).clip(0.0)
    built, plain = (
        build(sheet, bending=given, damage=TearingEnergy(1e6, initial_damage=damage), weights="corrected")
        for given in (True, False)
    )
    here = rough_motion(sheet)
    force = internal_force(built, here) - internal_force(plain, here)
    size = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.cross(sheet.positions + here, force).sum(axis=0)).max() < 1e-12 * size
    step, direction = 1e-6 * sheet.spacing, np.random.default_rng(4).normal(size=here.shape)
    slope = bending_energy(built, here + step * direction) - bending_energy(built, here - step * direction)
    assert slope / (2.0 * step) == pytest.approx(-(force * direction).sum(), rel=1e-6)
    left = (1.0 - damage[sheet.triangles].max(axis=1)) ** 2
    assert built.law.plate.left.numpy() == pytest.approx(left)


@pytest.mark.parametrize("name", ["lattice", "cloud"])
def test_two_pieces_of_a_torn_strip_bend_each_on_its_own(name):
    """Pieces that are turned against each other are rigid: no moment, whatever fits across the tear would say."""
    sheet = square(15) if name == "lattice" else jittered(15)
    built, plain = (build(sheet, bending=given, damage=CriticalStretch(50.0)) for given in (True, False))
    x, middle = sheet.points[:, 0], 0.5 * 0.1 + 0.1 * sheet.spacing
    right, angle = x > middle, 0.7
    motion = np.zeros((sheet.size, 3))
    motion[right, 0] = (x[right] - middle) * (np.cos(angle) - 1.0) + 2.0 * sheet.spacing
    motion[right, 2] = (x[right] - middle) * np.sin(angle)
    whole = np.abs(internal_force(built, motion) - internal_force(plain, motion)).max()
    for each in (built, plain):
        sever(each, ((middle, -1.0), (middle, 1.0)))
    weakened(built)
    assert np.abs(internal_force(built, motion) - internal_force(plain, motion)).max() < 1e-9 * whole
    curled = 0.1 * sheet.spacing * np.random.default_rng(1).normal(size=motion.shape)
    still = np.abs(internal_force(built, curled) - internal_force(plain, curled)).max(axis=1)
    assert still[np.abs(x - middle) > 0.02].min() > 0.0


def test_a_tear_takes_the_energy_of_bending_of_the_triangles_that_it_cuts():
    """At rest, all that is missing afterwards."""
    sheet, radius = square(11), 0.04
    x, y = sheet.points.T
    rolled = np.column_stack([radius * np.sin(x / radius), y, radius * (1.0 - np.cos(x / radius))]) - sheet.positions
    built = build(sheet, bending=True, material=BEAM, damage=CriticalStretch(50.0))
    before = bending_energy(built, rolled)
    sever(built, ((0.051, -1.0), (0.051, 0.0501)))
    built.state.step.assign(np.array([1e-12]))
    weakened(built)
    left = bending_energy(built, rolled)
    assert 0.05 * before < before - left < 0.5 * before
    assert built.law.lost.numpy().sum() == pytest.approx(before - left, rel=1e-6)


def torn_strip(damage, precision=64):
    """A plate that bends and vibrates while it is torn apart."""
    sheet = square(21, thickness=4e-3).cut((-0.01, 0.0501), (0.03, 0.0501))
    ends = [sheet.edges("bottom"), sheet.edges("top")]
    y = sheet.points[:, 1] / 0.1
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 2] = 2.0 * np.sin(np.pi * y) ** 2
    moved = Motion(ends[1], [0.0, 0.1], x=0.0, y=[0.0, 0.08], z=0.0)
    return run(
        sheet, Explicit(0.1, frames=25), loads=[Fixed(ends[0]), moved], bending=2e-4, initial_velocity=velocity,
        damage=damage(np.concatenate(ends)), precision=precision,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("damage", "precision"),
    [(lambda ends: TearingEnergy(20.0, spared=ends), 32), (lambda ends: CriticalStretch(1.6, spared=ends), 64)],
    ids=["field", "stretch"],
)
def test_a_plate_torn_while_it_bends_keeps_its_energy(damage, precision):
    results = [torn_strip(damage, precision) for _ in range(2)]
    rows = results[0].history
    assert results[0].status == "finished" and max(abs(row["balance_error"]) for row in rows) < 5e-3
    lost = np.array([row["bending_lost"] for row in rows])
    assert lost[-1] > 0.05 * max(row["bending"] for row in rows) and np.diff(lost).min() > -1e-3 * lost[-1]
    for first, second in zip(*(r.built.context.fields for r in results), strict=True):
        assert first.array.numpy().tobytes() == second.array.numpy().tobytes()


def test_what_bending_refuses_and_a_scene_without_it():
    sheet = square(7)
    for given in (-1.0, 0, True, "yes", [1.0]):
        with refused(match=r"Plate.stiffness = .*: expected a (positive )?number"):
            Plate(given)
    with refused(match="two or more parts Plate; expected one"):
        build(sheet, loads=[Plate(), Plate(1e-6)])
    with refused(match="'multigrid': loads = Plate: not supported"):
        build(square(25), bending=True, solver=Newton(preconditioner="multigrid"))
    with refused(match="damage not supported in equilibrium"):
        build(sheet, bending=True, damage=CriticalStretch(2.0), solver=Relaxation())
    assert not [stored for stored in build(sheet).context.fields if stored.field.owner == "bending"]
