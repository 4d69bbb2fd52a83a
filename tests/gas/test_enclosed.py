"""Enclosed volumes: their size, the gradient, laws of pressure, what closes a sheet, wrong input."""

from dataclasses import replace

import numpy as np
import pytest
from curved_sheets import small_tube
from enclosed_cases import CUBE, TETRAHEDRON, ball, enclosed
from helpers import NEO, Kept, build, jittered, refused, rough, square
from scipy.spatial.transform import Rotation

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    EnclosedGas,
    EnclosedVolume,
    Explicit,
    Fixed,
    Implicit,
    Motion,
    Newton,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.gas.enclosed import edge_rings, volume_of
from warp_pd.geometry.surface import other_diagonals

GAS = EnclosedGas(gauge=30.0, ambient=100.0, exponent=1.4)
LIQUID = EnclosedVolume([(0.0, 9.0)], stiffness=7.0)


def moved(points, size, seed=0):
    return size * np.random.default_rng(seed).normal(size=points.shape)


@pytest.mark.parametrize(("surface", "volume"), [(TETRAHEDRON, 8.0 / 3.0), (CUBE, 1.0)], ids=["tetrahedron", "cube"])
def test_volume_of_polyhedra(surface, volume):
    """Wherever they are: a shift by a hundred times their size costs no digits, as sums are about their middle."""
    points, triangles = surface
    for shift in (0.0, 100.0):
        _, pressure, found = enclosed(points + shift, triangles, GAS, np.zeros_like(points))
        assert found == pytest.approx(volume, rel=1e-13)
        assert pressure == pytest.approx(30.0, rel=1e-12)
    assert volume_of(points, triangles) == pytest.approx(volume, rel=1e-14)


@pytest.mark.parametrize("load", [GAS, LIQUID])
def test_force_is_the_pressure_times_the_gradient_of_the_volume(load):
    points, triangles = ball(1)
    u = moved(points, 0.1)
    force, pressure, volume = enclosed(points, triangles, load, u)
    assert volume == pytest.approx(volume_of(points + u, triangles), rel=1e-14)
    step = 1e-5
    for point, component in [(0, 0), (3, 2), (len(points) - 1, 1)]:
        there = [u.copy(), u.copy()]
        for sign, v in zip((1.0, -1.0), there, strict=True):
            v[point, component] += sign * step
        plus, minus = (volume_of(points + v, triangles) for v in there)
        assert force[point, component] == pytest.approx(pressure * (plus - minus) / (2.0 * step), rel=1e-8, abs=1e-9)


@pytest.mark.parametrize(("bits", "bound"), [(64, 1e-14), (32, 1e-6)])
def test_a_closed_surface_feels_no_net_force_and_no_torque(bits, bound):
    points, triangles = ball(3)
    u = moved(points, 0.02)
    force, _, _ = enclosed(points, triangles, GAS, u, bits)
    size = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < bound * size
    assert np.abs(np.cross(points + u, force).sum(axis=0)).max() < bound * size


def test_pressure_and_gas_on_a_sphere():
    """Triangles lie inside the sphere, so a gas presses too little, to second order; a pressure does not."""
    off = {}
    for points in (10, 20):
        sphere = Sheet.sphere(0.05, thickness=1e-3, density=1e3, points=points)
        for load in (Pressure(100.0), EnclosedGas(gauge=100.0)):
            built = build(sphere, weights="corrected", loads=[load])
            built.context.run("setup")
            force = built.to_numpy(built.state.external)
            assert np.abs(force.sum(axis=0)).max() < 1e-13
            outward = (force * sphere.points).sum() / 0.05 / (100.0 * 4.0 * np.pi * 0.05**2)
            off.setdefault(type(load), []).append(1.0 - outward)
    assert np.abs(off[Pressure]).max() < 1e-5
    assert off[EnclosedGas][0] == pytest.approx(0.011, abs=5e-4)
    assert 3.8 < off[EnclosedGas][0] / off[EnclosedGas][1] < 4.2


def test_single_precision_is_as_right_as_double():
    """Small displacements on a large surface, far from the origin."""
    points, triangles = ball(3)
    points = 1e3 + points
    u = moved(points, 1e-3)
    double, single = (enclosed(points, triangles, LIQUID, u, bits) for bits in (64, 32))
    assert single[2] == pytest.approx(double[2], rel=1e-9)
    assert single[1] == pytest.approx(double[1], rel=1e-8)
    assert single[0] == pytest.approx(double[0], abs=3e-6 * np.abs(double[0]).max())


@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_law_of_the_gas(exponent):
    """(p + ambient) V^n is constant, at a volume that grows eightfold, and as the density to the n of gas added."""
    points, triangles = ball(2)
    for size in (0.5, 1.0, 2.0):
        gas = EnclosedGas(gauge=30.0, ambient=100.0, exponent=exponent)
        _, pressure, _ = enclosed(points, triangles, gas, (size - 1.0) * points)
        assert pressure + 100.0 == pytest.approx(130.0 * size ** (-3.0 * exponent), rel=1e-12)
    sheet = square(5)
    gas = EnclosedGas(ambient=100.0, exponent=exponent, chamber=1e-3, amount=[(0.0, 1.0), (1.0, 3.0)])
    built = build(sheet, loads=[Fixed(sheet.edges("all")), gas])
    built.set_clock(0.0, 1.0, 0.5)
    built.context.run("frame")
    columns = {name: value for columns in built.columns[1:] for name, value in columns.at_frame({}, 0.0).items()}
    assert columns["pressure"] == pytest.approx(100.0 * (2.0**exponent - 1.0), rel=1e-12)
    assert columns["volume"] == pytest.approx(1e-3, rel=1e-12)


def test_a_flat_sheet_is_closed_by_a_cap():
    """The volume under a paraboloid over a square, and an even pressure on the points of a grid."""
    sheet = square(41)
    x, y = sheet.points.T / 0.1
    start = np.column_stack([np.zeros((sheet.size, 2)), 0.03 * 16.0 * x * (1 - x) * y * (1 - y)])
    built = build(
        sheet, loads=[Fixed(sheet.edges("all")), EnclosedVolume([(0.0, 1.0)], 5.0)], initial_displacement=start
    )
    built.context.run("start")
    built.context.run("frame")
    volume = next(c.at_frame({}, 0.0)["volume"] for c in built.columns if "volume" in c.names)
    assert volume == pytest.approx(0.03 * 0.1**2 * 16.0 / 36.0, rel=2e-3)
    flat = build(sheet, loads=[Fixed(sheet.edges("all")), EnclosedVolume([(0.0, 1.0)], 5.0)])
    flat.context.run("setup")
    assert flat.to_numpy(flat.state.external)[:, 2] == pytest.approx(5.0 * sheet.areas, rel=1e-12)


def test_a_rim_may_slide_in_the_plane_where_the_sheet_starts():
    """A tube whose reference is aslant; only its start has rims in planes of constant z."""
    tube, turn = small_tube(12), Rotation.from_rotvec([0.3, 0.0, 0.0]).as_matrix()
    aslant = replace(tube, points=tube.points @ turn.T, frames=turn @ tube.frames)
    loads = [Fixed(np.asarray(tube.edges()), "z"), EnclosedVolume([(0.0, 1.0)], 5.0)]
    build(aslant, horizon=2.5, loads=loads, initial_displacement=tube.points - aslant.points)
    for sheet, start in ((aslant, None), (tube, aslant.points - tube.points)):
        with refused(match="is on an edge of the sheet and free"):
            build(sheet, horizon=2.5, loads=loads, initial_displacement=start)


def test_the_edges_of_a_cap_may_slide_in_its_plane():
    """Half a sphere on a plane of symmetry; the force on its rim is the gradient of the volume of the closed half."""
    points, triangles = square(7, size=2.0).points - 1.0, square(7).triangles
    lifted = np.column_stack([points, (1.0 - points[:, 0] ** 2) * (1.0 - points[:, 1] ** 2)])
    rim = np.abs(points).max(axis=1) > 0.999
    held = np.where(rim, 4, 0).astype(np.uint8)
    u = moved(lifted, 0.03)
    u[rim, 2] = 0.0
    force, pressure, volume = enclosed(lifted, triangles, LIQUID, u, held=held)

    def size(u):
        caps = [volume_of(lifted + u, t) for t in (triangles, other_diagonals(lifted, triangles))]
        return sum(caps) / 2.0

    assert volume == pytest.approx(size(u), rel=1e-12)
    for point, component in [(0, 0), (3, 1), (24, 2), (6, 1)]:
        plus, minus = u.copy(), u.copy()
        plus[point, component] += 1e-5
        minus[point, component] -= 1e-5
        assert force[point, component] == pytest.approx(
            pressure * (size(plus) - size(minus)) / 2e-5, rel=1e-7, abs=1e-8
        )


def test_rectangles_are_cut_along_both_diagonals():
    sheet = square(6)
    turned = other_diagonals(sheet.positions, sheet.triangles)
    diagonal = lambda t: {tuple(sorted(pair)) for t in t for pair in zip(t, np.roll(t, 1), strict=True)}  # noqa: E731
    assert len(diagonal(sheet.triangles) & diagonal(turned)) == 2 * 6 * 5
    assert volume_of(sheet.positions + [0, 0, 1.0], turned) == pytest.approx(1.0 * 0.1**2 / 3.0)
    cloud = jittered(6)
    assert other_diagonals(cloud.positions, cloud.triangles) is cloud.triangles


def test_rings_of_edges():
    sheet = square(9).hole((0.05, 0.05), 0.02)
    rings = sorted(edge_rings(sheet.triangles), key=len)
    assert len(rings) == 2 and len(rings[1]) == 32
    assert {int(k) for ring in rings for k in ring} == {int(k) for k in sheet.edges("all")}
    assert edge_rings(CUBE[1]) == []


def loads(sheet, *extra):
    return Simulation(sheet, BondAssociated(NEO), Explicit(1.0), loads=extra).build("cpu")


WRONG = [
    (lambda: EnclosedGas(exponent=-1.0), r"exponent = -1\.0"),
    (lambda: EnclosedGas(gauge=-2e5), r"ambient \+ EnclosedGas\.gauge = "),
    (lambda: EnclosedGas(chamber=-1.0), r"chamber = -1\.0"),
    (lambda: EnclosedGas(amount=[(0.0, 1.0), (1.0, 0.0)]), r"amount = 0\.0"),
    (lambda: EnclosedGas(leak=-1.0), r"leak = -1\.0"),
    (lambda: EnclosedGas(density=0.0), r"density = 0\.0"),
    (lambda: EnclosedGas(gauge=1.0, ambient=0.0, leak=0.6), "if the ambient pressure is 0"),
    (
        lambda: loads(square(5), Fixed(square(5).edges("all")), EnclosedGas(chamber=1.0, leak=0.6)),
        "if bonds cannot break",
    ),
    (lambda: EnclosedVolume([(0.0, 1.0)], 0.0), r"stiffness = 0\.0"),
    (lambda: EnclosedVolume([(1.0, 1.0), (0.0, 1.0)], 1.0), "increasing times"),
    (lambda: EnclosedVolume(3.0, 1.0), "expected pairs"),
    (lambda: EnclosedVolume(None, 1.0), "expected pairs"),
    (lambda: loads(square(5), EnclosedVolume([(0.0, 1.0)], 1.0)), "is on an edge of the sheet and free"),
    (lambda: loads(square(5), Fixed(square(5).edges("all")), EnclosedGas()), r"encloses 0 m\^3"),
    (
        lambda: loads(square(5), Fixed(square(5).edges("all")), EnclosedGas(chamber=1.0), EnclosedGas(chamber=1.0)),
        "loads: two or more loads that enclose a volume: expected at most one",
    ),
    (
        lambda: loads(
            square(9).cut((0.02, 0.03), (0.06, 0.031)), Fixed(square(9).edges("all")), EnclosedGas(chamber=1.0)
        ),
        "and free",
    ),
    (lambda: enclosed(CUBE[0], CUBE[1][:, ::-1], GAS, np.zeros((8, 3))), "turn triangles that face inwards"),
    (lambda: edge_rings(np.vstack([CUBE[1][:-1], CUBE[1][-1:, ::-1]])), "in one direction"),
    (lambda: edge_rings(np.array([[0, 1, 2], [2, 3, 4]])), "meet at point 2"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_input_is_named(make, text):
    with refused(match=text):
        make()


def test_moved_edges_are_held_edges():
    sheet = square(5)
    edge = sheet.edges("all")
    loads(sheet, Motion(edge, [0.0, 1.0], x=0.0, y=0.0, z=[0.0, 0.01]), EnclosedGas(chamber=1.0))


def test_the_tangent_is_the_derivative_of_the_force():
    sheet = jittered(9)
    edge = sheet.edges("all")
    for load in (EnclosedGas(gauge=30.0, ambient=50.0, exponent=1.4, chamber=1e-4), EnclosedVolume([(0, 1e-4)], 1e6)):
        built = build(sheet, loads=[Fixed(edge), load])
        context = built.context
        u, d = rough(sheet), rough(sheet, 0.3, seed=1)
        u[:, 2] += 0.03
        d[edge] = u[edge] = 0.0
        arrays = {n: context.array(n, "test", context.types.vec3, shape=sheet.size) for n in ("u", "d", "force", "out")}
        following = built.external.following[0]
        following.add_force(context.stage("test force", ""), arrays["u"], arrays["force"])
        assert following.add_tangent(context.stage("test tangent", ""), arrays["u"], arrays["d"], arrays["out"])
        built.context.run("clock")
        arrays["u"].assign(u)
        arrays["d"].assign(d)
        context.run("test tangent")
        forces = []
        for sign in (1.0, -1.0):
            arrays["u"].assign(u + sign * 1e-6 * d)
            arrays["force"].zero_()
            context.run("test force")
            forces.append(arrays["force"].numpy().copy())
        free = np.setdiff1d(np.arange(sheet.size), edge)
        expected = ((forces[0] - forces[1]) / 2e-6)[free]
        assert arrays["out"].numpy()[free] == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("solver", "damage"),
    [
        (Relaxation(), CriticalStretch(2.0)),
        (Newton(), CriticalStretch(2.0)),
        (Implicit(1.0, steps=9), TearingEnergy(9.0)),
    ],
)
def test_a_leak_needs_explicit_steps(solver, damage):
    sheet = square(5)
    loads = [Fixed(sheet.edges("all")), EnclosedGas(chamber=1.0, leak=0.6)]
    with refused(match=r"^EnclosedGas\.leak = 0\.6: expected 0, or the solver Explicit$"):
        Simulation(sheet, BondAssociated(NEO), solver, loads=loads, damage=damage).build("cpu")


@pytest.mark.parametrize(
    "solver", [Newton(load_steps=2), Relaxation(load_steps=2), Implicit(1.0, steps=4, inertia=False)]
)
def test_a_gas_at_the_pressure_outside_leaves_a_sheet_at_rest(solver):
    """The round-off of its volume was its only load, which no search could balance."""
    tube = Sheet.tube(0.02, 0.06, thickness=1e-3, density=1e3, points=(20, 10))
    gas = EnclosedGas(amount=[(0.0, 1.0), (0.5, 1.0), (1.0, 1.02)])
    kept = Kept(lambda frame: np.abs(frame.displacement).max())
    force = BondAssociated(NEO, weights="corrected")
    result = Simulation(tube, force, solver, loads=[Fixed(tube.edges()), gas]).run(
        device="cpu", precision=64, writers=[kept]
    )
    assert result.status == "finished" and kept.all[-1] > 0.0
    assert max(kept.all[: 1 + len(kept.all) // 2]) == 0.0
