"""Curved sheets: free of stress as they are, objective, and with the pressures of balloons and tubes."""

import numpy as np
import pytest
from curved_sheets import SHEETS, STATES, THICKNESS, rotation, rough_motion, small_sphere, small_tube, tear
from helpers import build, internal_force, refused, soften, strain_energy

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    NeoHookean,
    Newton,
    Pressure,
    Prony,
    Relaxation,
    Sheet,
    Simulation,
    TearingEnergy,
    Visco,
)
from warp_pd.families import unpack

MU = 1e3
RUBBER = MooneyRivlin(c10=0.4 * MU, c01=0.1 * MU)
LAWS = {
    "bond_based": BondBased(Bimodular(tension=MU, compression=0.5 * MU)),
    "visco": Visco(RUBBER, prony=(Prony(c10=100.0, time=1.0),)),
}
# Round-off over the largest force, and the step of differences with their error, by precision.
ROUND_OFF = {32: 2e-5, 64: 1e-12}


def built_in(state, sheet, precision=64):
    built = build(sheet, horizon=2.2, material=RUBBER, precision=precision, **STATES[state])
    if "damage" in STATES[state]:
        assert soften(built).any() if built.context.layout.softened else tear(built).any()
    return built


def check_invariance(built, precision=64):
    """No force at rest and after a rigid rotation; the force turns with the motion and has no resultants."""
    sheet, Q, tolerance = built.simulation.sheet, rotation(), ROUND_OFF[precision]
    unit = MU * THICKNESS * sheet.spacing
    assert np.abs(internal_force(built, np.zeros((sheet.size, 3)))).max() <= 1e-12 * unit
    assert np.abs(internal_force(built, sheet.points @ Q.T - sheet.points)).max() <= tolerance * unit
    place = sheet.points + rough_motion(sheet)
    force = internal_force(built, place - sheet.points)
    largest = np.abs(force).max()
    assert largest > 0.05 * unit
    turned = internal_force(built, place @ Q.T + 1.0 - sheet.points)
    assert np.abs(turned - force @ Q.T).max() <= tolerance * largest
    assert np.abs(force.sum(axis=0)).max() <= tolerance * largest
    assert np.abs(np.cross(place, force).sum(axis=0)).max() <= tolerance * largest


def check_gradient(built):
    """The force is minus the gradient of the energy."""
    sheet = built.simulation.sheet
    u, direction = rough_motion(sheet), np.random.default_rng(1).normal(size=sheet.points.shape)
    force, step = internal_force(built, u), 1e-6
    energies = [strain_energy(built, u + sign * step * direction) for sign in (1.0, -1.0)]
    assert -(energies[0] - energies[1]) / (2.0 * step) == pytest.approx((force * direction).sum(), rel=1e-7)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("kind", SHEETS)
def test_no_stress_at_rest_and_an_objective_force(kind, state):
    built = built_in(state, SHEETS[kind]())
    check_invariance(built)
    check_gradient(built)


@pytest.mark.parametrize("state", ["plain", "torn"])
def test_the_same_in_float32(state):
    check_invariance(built_in(state, small_sphere(), 32), 32)
    forces = [internal_force(built_in(state, small_tube(), bits), rough_motion(small_tube())) for bits in (32, 64)]
    assert np.abs(forces[0] - forces[1]).max() < 1e-5 * np.abs(forces[1]).max()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", SHEETS)
def test_other_laws(kind, law):
    simulation = Simulation(SHEETS[kind](), force=LAWS[law], solver=Explicit(1.0))
    built = simulation.build("cpu", 64)
    check_invariance(built)
    check_gradient(built)


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_a_flat_surface_in_space_is_a_flat_sheet(weights):
    """On a plane that is turned in space, the forces are those of the flat sheet, turned."""
    flat = Sheet.rectangle(1.0, 0.8, thickness=THICKNESS, density=1000.0, points=11).as_cloud()
    Q, u = rotation(), rough_motion(Sheet.from_surface(flat.positions, flat.triangles, thickness=1.0, density=1.0))
    inclined = Sheet.from_surface(
        flat.positions @ Q.T, flat.triangles, thickness=THICKNESS, density=1000.0, spacing=flat.spacing
    )
    inclined = type(flat)(**{**vars(inclined), "areas": flat.areas})
    expected = internal_force(build(flat, weights=weights, material=RUBBER), u)
    found = internal_force(build(inclined, weights=weights, material=RUBBER), u @ Q.T)
    assert np.abs(found - expected @ Q.T).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_a_sphere_that_grows_stores_the_exact_energy(weights):
    """Every intersection then has F = l O: the energy is exact to round-off, the pressure by virtual work too."""
    sheet, l = small_sphere(8), 1.7
    built = build(sheet, horizon=2.2, material=RUBBER, weights=weights)
    u = (l - 1.0) * sheet.points
    exact = RUBBER.c10 * (2 * l**2 + l**-4 - 3) + RUBBER.c01 * (2 * l**-2 + l**4 - 3)
    assert strain_energy(built, u) == pytest.approx(4.0 * np.pi * THICKNESS * exact, rel=1e-12)
    pressure = -(internal_force(built, u) * sheet.points).sum() / (4.0 * np.pi * l**2)
    assert pressure == pytest.approx(sphere_pressure(l), rel=1e-12)


def sphere_pressure(l):
    """Inside a balloon of Mooney-Rivlin rubber, radius 1: p 4 pi r^2 dr = 4 pi h dPsi."""
    return 2.0 * THICKNESS * (1.0 / l - 1.0 / l**7) * (2.0 * RUBBER.c10 + 2.0 * RUBBER.c01 * l**2)


def tube_stress(along, across):
    """Derivative of the energy density by the stretch `along` of two principal stretches [Pa]."""
    third = along * across
    return 2.0 * RUBBER.c10 * (along - 1.0 / (third**2 * along)) + 2.0 * RUBBER.c01 * (across * third - 1.0 / along**3)


def tube_pressure(around, along):
    """Inside a tube, radius 1: p = (h / R) dPsi/dl_around / (l_around l_along)."""
    return THICKNESS * tube_stress(around, along) / (around * along)


def external_force(sheet, displacement, follower):
    built = build(sheet, material=RUBBER, loads=[Fixed([0]), Pressure(3.0, follower=follower)])
    internal_force(built, displacement)
    return built.to_numpy(built.state.external)


def test_dead_pressure_acts_along_the_normals():
    sheet = small_sphere()
    found = external_force(sheet, 0.5 * sheet.points, follower=False)
    np.testing.assert_allclose(found, 3.0 * sheet.areas[:, None] * sheet.points, atol=1e-12)
    assert np.abs(found.sum(axis=0)).max() < 1e-12


def test_follower_pressure_grows_and_turns_with_the_surface():
    """The grown area is exact; the normal is that of the family, and exact on the regular grid of a tube."""
    sheet, Q = small_sphere(), rotation()
    grown = external_force(sheet, 0.5 * sheet.points, follower=True)
    turned = external_force(sheet, 1.5 * sheet.points @ Q.T - sheet.points, follower=True)
    np.testing.assert_allclose(turned, grown @ Q.T, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(grown, axis=1), 3.0 * 1.5**2 * sheet.areas, rtol=1e-12)
    assert np.linalg.norm(grown / (6.75 * sheet.areas[:, None]) - sheet.points, axis=1).max() < 0.03
    tube = small_tube()
    found = external_force(tube, tube.points * (0.25, 0.25, 0.1), follower=True)
    inner = np.setdiff1d(np.arange(tube.size), tube.where(lambda x, y, z: np.abs(z - 1.0) > 0.4))
    expected = 3.0 * 1.25 * 1.1 * tube.areas[:, None] * tube.normals
    np.testing.assert_allclose(found[inner], expected[inner], atol=1e-12)


def test_a_tube_under_pressure_and_tension_converges_with_order_two():
    """A uniform field: energy, force balance of every point in the middle, and the tension at the end."""
    errors, (around, along) = [], (1.25, 1.1)
    for points in (40, 80, 160):
        sheet = small_tube(points, 1.5)
        built = build(
            sheet, material=RUBBER, weights="corrected", loads=[Fixed([0]), Pressure(tube_pressure(around, along))]
        )
        u = sheet.points * (around - 1.0, around - 1.0, along - 1.0)
        force, energy = internal_force(built, u), strain_energy(built, u)
        third = 1.0 / (around * along)
        density = RUBBER.c10 * (around**2 + along**2 + third**2 - 3.0)
        density += RUBBER.c01 * (around**-2 + along**-2 + third**-2 - 3.0)
        middle = np.abs(sheet.points[:, 2] - 0.75) < 0.1
        outward = sheet.points * (1.0, 1.0, 0.0)
        pull, push = ((f * outward).sum(axis=1)[middle] for f in (force, built.to_numpy(built.state.external)))
        tension = -force[sheet.edges("top"), 2].sum()
        errors.append(
            (
                energy / (2.0 * np.pi * 1.5 * THICKNESS * density) - 1.0,
                np.abs(pull / push + 1.0).max(),
                tension / (2.0 * np.pi * THICKNESS * tube_stress(along, around)) - 1.0,
            )
        )
    errors = np.abs(errors)
    assert (errors[2] < 1e-4).all()
    assert (np.log2(errors[:-1] / errors[1:]).mean(axis=0) > 1.6).all()


def equilibrium(sheet, pressure, displacement, held, solver):
    simulation = Simulation(
        sheet, force=BondAssociated(RUBBER, horizon=2.015), solver=solver, loads=[*held, Pressure(pressure)],
        initial_displacement=displacement,
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.status == "finished" and result.built.law.weights == "corrected"
    return sheet.points + result.frame.displacement


def volume(place, triangles):
    a, b, c = (place[triangles[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6.0


def test_a_balloon_in_equilibrium_has_the_exact_pressure():
    """With quadrupled points the error falls by more than four times; 40 points on a quarter circle: below 1e-5."""
    errors = []
    for points in (10, 20):
        sheet = small_sphere(points)
        poles = [[sheet.nearest(*(sign * np.eye(3)[c])) for sign in (1.0, -1.0)] for c in range(3)]
        held = [Fixed(pair, "xyz".replace("xyz"[c], "")) for c, pair in enumerate(poles)]
        place = equilibrium(sheet, sphere_pressure(1.2), 0.2 * sheet.points, held, Relaxation())
        grown = (volume(place, sheet.triangles) / volume(sheet.points, sheet.triangles)) ** (1.0 / 3.0)
        errors.append(abs(sphere_pressure(1.2) / sphere_pressure(grown) - 1.0))
    assert errors[0] < 1e-3 and errors[1] < 1e-4 and errors[0] > 4.0 * errors[1]


def test_a_tube_in_equilibrium_has_the_exact_pressure():
    sheet = small_tube(80, 1.5)
    pressure = tube_pressure(1.25, 1.1)
    place = equilibrium(sheet, pressure, sheet.points * (0.25, 0.25, 0.1), [Fixed(sheet.edges())], Newton())
    middle = np.abs(sheet.points[:, 2] - 0.75) < 0.1
    radius = np.hypot(*place[middle, :2].T).mean()
    assert pressure == pytest.approx(tube_pressure(radius, 1.1), rel=1e-3)


def test_a_rigid_patch_of_a_tube_keeps_its_shape_and_the_momenta():
    """A free tube that bulges, spins and drifts, with a curved rigid patch on one side."""
    sheet = small_tube(24, 2.0).inclusion((1.0, 0.0, 1.0), 0.6)
    (members,) = sheet.inclusions
    assert len(members) > 10 and sheet.points[members, 0].min() > 0.7
    place = sheet.points - (0.0, 0.0, 1.0)
    velocity = np.cross([0.3, 0.5, 0.2], place) + [0.1, 0.2, -0.1]
    outward = sheet.points * (0.5, 0.5, 0.0)
    outward[members] = outward[members].mean(axis=0)
    simulation = Simulation(
        sheet, force=BondAssociated(NeoHookean(MU, 100 * MU)), solver=Explicit(0.2, frames=3, safety=0.3, precision=64),
        initial_velocity=velocity + outward,
    )  # fmt: skip
    result = simulation.run(device="cpu")
    moved = sheet.points + result.frame.displacement
    apart = [np.linalg.norm(p[members][:, None] - p[members], axis=-1) for p in (sheet.points, moved)]
    assert apart[1] == pytest.approx(apart[0], abs=1e-10)
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    for arm in (lambda x, v: v, np.cross):
        before, after = ((mass * arm(x, v)).sum(axis=0) for x, v in (
            (sheet.points, velocity + outward), (moved, result.frame.velocity)))  # fmt: skip
        assert after == pytest.approx(before, abs=1e-10 * np.abs(before).max())


def test_an_inclusion_is_one_patch_of_a_sheet():
    sheet = small_tube(24, 2.0)
    assert len(sheet.inclusion((0.0, 0.0, 0.0), 1.02).inclusions[0]) == 24
    with refused(match=r"^inclusion at .* contains the whole sheet: expected a smaller one$"):
        sheet.inclusion((0.0, 0.0, 1.0), 9.0)
    in_two = sheet.slit(lambda x, y, z: z - 1.0)
    with refused(match=r"^inclusion at .* contains 2 patches that are not connected"):
        in_two.inclusion((1.0, 0.0, 1.0), 0.6)


def test_both_ends_of_a_bond_break_together():
    """A tube that is torn apart: broken bonds are broken from both ends, at the stretch of the chord."""
    sheet = small_tube()
    built = build(sheet, material=NeoHookean(MU, 100 * MU), damage=CriticalStretch(1.2))
    u = np.zeros((sheet.size, 3))
    u[:, 2] = 0.4 * np.clip(sheet.points[:, 2] - 1.0, 0.0, 0.3)
    built.state.displacement.assign(u.astype(built.state.displacement.numpy().dtype))
    built.context.run("step")
    families = built.law.families
    members = families.members_of(np.arange(sheet.size))
    broken = (members >= 0) & ~unpack(built.law.intact.numpy().T, families.members)
    chord, place = sheet.points[members] - sheet.points[:, None], sheet.points + u
    length = np.where(members >= 0, np.linalg.norm(chord, axis=-1), 1.0)
    stretch = np.linalg.norm(place[members] - place[:, None], axis=-1) / length
    point, member = np.nonzero((members >= 0) & (np.abs(stretch - 1.2) > 1e-4))
    assert 0 < broken.sum() < 0.5 * (members >= 0).sum()
    assert (broken[point, member] == (stretch > 1.2)[point, member]).all()
    point, member = np.nonzero(broken)
    assert broken[families.heads(point, member), families.reverse_members(point, member)].all()


def test_a_torn_balloon_keeps_its_energy_balance():
    sheet = small_sphere(10)
    weak = sheet.within((0.0, 0.0, 1.0), 0.3)
    simulation = Simulation(
        sheet, force=BondAssociated(NeoHookean(MU, 100 * MU)), solver=Explicit(0.1, frames=4, safety=0.3, precision=64),
        damage=TearingEnergy(720.0, length=0.25, spared=np.setdiff1d(np.arange(sheet.size), weak)),
        initial_displacement=0.3 * sheet.points, initial_velocity=6.0 * sheet.points,
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.history[-1]["largest_damage"] > 0.3
    assert abs(result.history[-1]["balance_error"]) < 0.01


@pytest.mark.parametrize("kind", ["saddle", "bumpy"])
def test_corrected_weights_balance_tension_along_an_uneven_surface(kind):
    """Grown to 1.2 times its size, it is pulled along its normals alone, but at its edges."""
    sheet = SHEETS["saddle"]()
    if kind == "bumpy":
        bumps = 0.05 * np.column_stack(
            [0.0 * sheet.points[:, :2], np.cos(9.0 * sheet.points[:, 0] * sheet.points[:, 1] + 1.0)]
        )
        sheet = Sheet.from_surface(sheet.points + bumps, sheet.triangles, thickness=THICKNESS, density=1000.0)
    built = build(sheet, horizon=2.2, material=RUBBER, weights="corrected")
    assert built.law.correction["points_left_unbalanced"] == 0
    force = internal_force(built, 0.2 * sheet.points)
    along = force - (force * sheet.normals).sum(axis=1)[:, None] * sheet.normals
    inside = np.setdiff1d(np.arange(sheet.size), sheet.parts["rim"])
    assert np.abs(along[inside]).max() < 1e-9 * np.abs(along).max()
