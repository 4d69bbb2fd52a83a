"""Sheets of a TensionField material: energy, forces, objectivity, and an exact solution of a wrinkled membrane."""

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers import GENT, NEO, build, internal_force, jittered, rough, sever, square, strain_energy, uniform
from scipy.optimize import brentq
from wrinkled_annulus import membrane

from warp_pd import (
    BondAssociated,
    Circle,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Neural,
    Newton,
    Nodal,
    Ogden,
    Pressure,
    Reaction,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.run.checks import ShapeWatch
from warp_pd.run.recorder import FramePoints
from warp_pd.statics.tangent import tangent_of

CUT = ((0.02, 0.031), (0.071, 0.08))
OGDEN = Ogden((600.0, 12.0), (1.3, 5.0))
SHEARED = np.array([[1.0, 0.5], [0.0, 0.9], [0.0, 0.0]])


def crumpled(sheet, seed=0):
    """Taut, wrinkled and slack families side by side."""
    x = sheet.points / np.ptp(sheet.points)
    smooth = np.column_stack([0.3 * x[:, 0] ** 2 - 0.25 * x[:, 1] ** 2, -0.3 * x[:, 1], 0.1 * x[:, 0] * x[:, 1]])
    return np.ptp(sheet.points) * smooth + 0.3 * rough(sheet, 0.1, seed)


@pytest.mark.parametrize(
    ("material", "layout", "torn"),
    [(NEO, "cloud", True), (GENT, "lattice", False), (OGDEN, "cloud", True)],
    ids=["neo-Hookean, torn", "Gent", "Ogden, torn"],
)
def test_force_is_minus_the_gradient_of_the_energy(material, layout, torn):
    sheet = square(11) if layout == "lattice" else jittered(11)
    parts = {"damage": CriticalStretch(1e3)} if torn else {}
    built = build(sheet, material=TensionField(material), **parts)
    if torn:
        sever(built, CUT)
    u = crumpled(sheet)
    direction = np.random.default_rng(1).normal(size=u.shape) * sheet.spacing
    force = internal_force(built, u)
    step = 1e-6
    change = strain_energy(built, u + step * direction) - strain_energy(built, u - step * direction)
    assert change / (2 * step) == pytest.approx(-(force * direction).sum(), rel=2e-5)


def test_relaxed_forces_differ_and_have_the_digits_of_the_precision():
    sheet = square(15)
    u = crumpled(sheet)
    relaxed, exact, resolved = (
        internal_force(build(sheet, material=material, precision=bits), u)
        for material, bits in ((TensionField(NEO), 32), (TensionField(NEO), 64), (NEO, 64))
    )
    assert np.abs(relaxed - exact).max() <= 5e-6 * np.abs(exact).max()
    assert np.abs(exact - resolved).max() > 0.2 * np.abs(resolved).max()


def test_fast_kernels_are_the_reference_kernels():
    sheet, forces = square(21), []
    for fast in (True, False):
        built = build(sheet, material=TensionField(GENT), law={"fast": fast}, damage=CriticalStretch(1e3))
        sever(built, CUT)
        names = {name for launch in built.context.stages["step"] for name in launch.parts}
        assert ("family_rows_force" in names) == fast
        forces.append(internal_force(built, crumpled(sheet)))
    assert np.abs(forces[0] - forces[1]).max() <= 1e-12 * np.abs(forces[1]).max()


@pytest.mark.parametrize("law", ["bond-associated", "nodal"])
def test_a_wrinkled_patch_carries_uniaxial_stress(law):
    """A sheet sheared between rigid edges, at once wrinkled: no force inside, and the energy of uniaxial tension."""
    sheet, material = square(15), TensionField(NEO)
    force = (
        BondAssociated(material, weights="corrected") if law == "bond-associated" else Nodal(material, horizon=2.015)
    )
    built = Simulation(sheet, force, Explicit(1.0)).build("cpu", 64)
    u = uniform(sheet, SHEARED)
    found = internal_force(built, u)
    inside = sheet.where(lambda x, y: np.maximum(abs(x - 0.05), abs(y - 0.05)) < 0.02)
    assert np.abs(found[inside]).max() < 1e-11 * np.abs(found).max()
    C = SHEARED.T @ SHEARED
    stretch = np.sqrt(np.linalg.eigvalsh(C)[1])

    def density(width):
        """NN paper's energy of uniaxial tension, both widths alike, minimised over the width."""
        J = stretch * width**2
        first = J ** (-2 / 3) * (stretch**2 + 2 * width**2) - 3
        return 0.5 * NEO.mu * first + NEO.bulk / 8 * (J**2 + J**-2 - 2)

    width = brentq(lambda w: density(w + 1e-6) - density(w - 1e-6), 0.5, 1.0, xtol=1e-14)
    centre = sheet.nearest(0.05, 0.05)
    built.context.run("frame")
    energy = built.law.strain_energy.numpy()[centre] / (sheet.areas[centre] * sheet.thickness)
    assert energy == pytest.approx(density(width), rel=1e-8)


def test_the_tangent_is_the_derivative_of_the_force():
    """Taut, wrinkled and slack families, torn ones too."""
    sheet = jittered(9)
    built = build(sheet, material=TensionField(NEO), solver=Relaxation(), loads=[Fixed(sheet.edges("left"))],
                  damage=CriticalStretch(1e3))  # fmt: skip
    sever(built, CUT)
    tangent = tangent_of(built.law, built.context, True)
    context, types = built.context, built.context.types
    tension = context.array("tension", "test", types.real, shape=1, per="once")
    direction = context.array("direction", "test", types.vec3, shape=sheet.size)
    change = context.array("change", "test", types.vec3, shape=sheet.size)
    linearise, product = context.stage("linearise", "test"), context.stage("product", "test")
    tangent.add_linearise(linearise, built.state.displacement, tension)
    tangent.add_product(product, direction, change)
    u = crumpled(sheet)
    v = np.random.default_rng(2).normal(size=u.shape) * sheet.spacing
    step = 1e-7
    forward, backward = internal_force(built, u + step * v), internal_force(built, u - step * v)
    internal_force(built, u)
    direction.assign(v)
    context.run("linearise")
    context.run("product")
    expected = (forward - backward) / (2 * step)
    assert np.abs(change.numpy() - expected).max() < 1e-5 * np.abs(expected).max()


def annulus(inner, outer, rings, layers):
    """Points on circles with equal spacing, and `layers` circles beyond both edges."""
    spacing = (outer - inner) / rings
    radii = inner + spacing * np.arange(-layers, rings + layers + 1)
    points = []
    for k, radius in enumerate(radii):
        count = round(2 * np.pi * radius / spacing)
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count
        points.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    return Sheet.from_points(np.concatenate(points), thickness=1e-3, density=1000.0, spacing=spacing)


def drawn_in(inner, outer, shift, mu):
    """Exact solution of an annulus whose inner edge moves inwards: d(R P_r)/dR = P_h, by shooting.

    Incompressible neo-Hookean sheet with hoop stretch h = r/R. Wrinkled near the inner edge, where h < l^(-1/2):
    P_r = mu (l - l^-2), P_h = 0. Taut near the outer edge.

    Returns:
        Pull of the inner edge over the thickness [N/m], and the solution r(R) as a function.
    """

    def path(tension):
        return membrane(inner - shift, tension / inner, inner, outer, mu)

    pull = brentq(lambda c: path(c)(outer)[0] - outer, 1e-3 * mu * inner, 2.0 * mu * inner)
    exact = path(pull)
    return 2.0 * np.pi * pull, lambda R: exact(R)[0]


def pulled_annulus(rings, inner, outer, shift):
    """Pull of the inner edge [N] and mean displacement of the circle in the middle [m]."""
    sheet = annulus(inner, outer, rings, layers=3)
    radius = np.linalg.norm(sheet.points, axis=1)
    normal = sheet.points / radius[:, None]
    grip_in, grip_out = np.flatnonzero(radius < inner + 1e-9), np.flatnonzero(radius > outer - 1e-9)
    inwards = [Motion([i], [0.0, 1.0], x=[0.0, -shift * normal[i, 0]], y=[0.0, -shift * normal[i, 1]]) for i in grip_in]
    flat = np.setdiff1d(np.arange(sheet.size), grip_out)
    law = BondAssociated(TensionField(MooneyRivlin(500.0)), horizon=2.015, weights="corrected")
    loads = [Fixed(grip_out), *inwards, Fixed(flat, "z")]
    result = Simulation(sheet, law, Newton(tolerance=1e-8, load_steps=2), loads=loads).run(device="cpu", precision=64)
    assert result.status == "finished"
    pull = np.einsum("na,na->n", result.built.to_numpy(result.built.state.force)[:, :2], normal)
    middle = np.abs(radius - 0.5 * (inner + outer)) < 0.3 * sheet.spacing
    moved = np.einsum("na,na->n", result.frame.displacement[middle, :2], normal[middle])
    return np.array([pull[grip_in].sum() / sheet.thickness, moved.mean()])


def test_an_annulus_drawn_in_is_the_exact_wrinkled_membrane():
    """Hoops are slack near the inner edge. Grips are sharp to a spacing: first order, 0.5 % when extrapolated."""
    inner, outer, shift = 0.05, 0.1, 0.005
    force, place = drawn_in(inner, outer, shift, 1000.0)
    middle = 0.5 * (inner + outer)
    exact = np.array([force, place(middle) - middle])
    coarse, fine = (pulled_annulus(rings, inner, outer, shift) / exact - 1.0 for rings in (8, 16))
    assert np.abs(coarse).max() < 0.05
    assert (np.abs(fine) < 0.55 * np.abs(coarse)).all()
    assert np.abs(2.0 * fine - coarse).max() < 0.005


def test_the_closed_form_of_the_neural_law_wrinkles_as_the_nodal_law():
    """Both have the stress of each point's own strain: wrinkles take the same part of their forces."""
    sheet = square(9)
    forces = {}
    for name, law in (("neural", lambda m: Neural(m, evaluation="closed_form")), ("nodal", Nodal)):
        for second in (0.5, 1.2):
            u = uniform(sheet, [[1.5, 0.0], [0.0, second], [0.0, 0.0]])
            forces[name, second] = [
                internal_force(Simulation(sheet, force=law(m), solver=Explicit(1.0)).build("cpu", 64), u)
                for m in (TensionField(NEO), NEO)
            ]
    np.testing.assert_allclose(*forces["neural", 1.2], rtol=1e-12, atol=1e-14)
    shares = [np.abs(relaxed).max() / np.abs(resolved).max() for relaxed, resolved in (
        forces["neural", 0.5], forces["nodal", 0.5])]  # fmt: skip
    assert shares[0] == pytest.approx(shares[1], rel=1e-9)
    assert shares[0] < 0.4


def test_a_strip_pulled_between_grips_finds_equilibrium_by_newton_and_relaxation():
    """Flat, wide, held at both ends: its middle wrinkles. Both solvers find the same force, below the resolved one."""
    sheet = square(15)
    left, right = sheet.edges("left"), sheet.edges("right")
    flat = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    loads = [Fixed(left), Motion(right, [0.0, 1.0], x=[0.0, 0.03], y=0.0, z=0.0), Fixed(flat, "z")]
    found = [
        Simulation(sheet, BondAssociated(TensionField(NEO)), solver, loads=loads).run(device="cpu", precision=64)
        for solver in (Newton(tolerance=1e-8), Relaxation(tolerance=1e-7))
    ]
    assert [r.status for r in found] == ["finished", "finished"]
    np.testing.assert_allclose(
        found[0].frame.displacement, found[1].frame.displacement, atol=1e-4 * np.abs(found[0].frame.displacement).max()
    )


def test_a_sheared_sheet_is_the_exact_tension_field():
    """A long sheet between two parallel edges, one moved along: its wrinkled middle is in uniform uniaxial tension.

    With the shear g, the larger stretch is (g + sqrt(g^2 + 4)) / 2 and the shear stress dW/dg of the uniaxial energy.
    """
    length, height, shear = 0.6, 0.06, 0.4
    sheet = Sheet.rectangle(length, height, thickness=1e-3, density=1000.0, points=(101, 11))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    result = Simulation(
        sheet,
        BondAssociated(TensionField(NEO), horizon=2.015, weights="corrected"),
        Newton(tolerance=1e-5, load_steps=4),
        loads=[Fixed(bottom), Motion(top, [0.0, 1.0], x=[0.0, shear * height], y=0.0, z=0.0)],
    ).run(device="cpu", precision=64)
    assert result.status == "finished"
    x = sheet.points[top, 0]
    middle = top[(x > 0.35 * length) & (x < 0.65 * length)]
    force = -result.built.to_numpy(result.built.state.force)[middle, 0].sum()
    stress = force / (len(middle) * length / 100.0 * sheet.thickness)
    stretch = 0.5 * (shear + np.sqrt(shear**2 + 4.0))
    exact = 1e3 * (stretch - stretch**-2) * stretch**2 / (stretch**2 + 1.0)
    assert stress == pytest.approx(exact, rel=5e-3)
    # The sheet as it is in plane, unwrinkled, resists more: mu g.
    assert 1e3 * shear > 1.2 * exact


def test_half_of_a_cushion_is_as_thick_as_two_inextensible_discs():
    """Two discs joined at their rim under pressure, by symmetry one whose rim stays in its plane.

    Mladenov and Oprea, The Mylar balloon revisited, Amer. Math. Monthly 110 (2003): radius 0.7627 of that of the discs,
    thickness 1.198 of it.
    """
    radius = 0.1
    sheet = Sheet.outline(Circle((0, 0), radius), spacing=0.02, thickness=1e-4, density=1400.0)
    rim, centre, foot = sheet.edges("outline"), sheet.nearest(0, 0), sheet.nearest(radius, 0)
    dome = np.column_stack([0.0 * sheet.points, 0.01 * (1.0 - (sheet.points**2).sum(axis=1) / radius**2)])
    result = Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(1.5e7), slack_stiffness=3e4), horizon=2.015),
        Newton(load_steps=2),
        loads=[Fixed([centre], "xy"), Fixed(rim, "z"), Fixed([foot], "y"), Pressure(500.0)],
        initial_displacement=dome,
    ).run(device="cpu")
    assert result.status == "finished"
    place = sheet.positions + result.frame.displacement
    wide = np.hypot(*place[rim, :2].T).mean()
    assert wide == pytest.approx(0.7627 * radius, rel=0.01)
    assert 2.0 * place[centre, 2] == pytest.approx(1.198 * wide, rel=0.01)


# Free edges ---------------------------------------------------------------------------------------------


def free_strip(points=15, horizon=3.15, **settings):
    """A strip with free sides, pulled to 1.5 times its length; nothing reaches its criterion."""
    sheet = Sheet.rectangle(0.05, 0.02, thickness=1e-3, density=1000.0, points=points)
    left, right = sheet.edges("left"), sheet.edges("right")
    return Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(1e5)), horizon=horizon, **settings),
        Explicit(0.125, frames=4, damping=100.0),
        damage=CriticalStretch(20.0),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(left, "x"),
            Fixed([int(left[len(left) // 2])], "y"),
            Motion(right, [0.0, 0.125], x=[0.0, 0.025]),
            Reaction(right, "pull"),
        ],
    )


@pytest.mark.parametrize("horizon", [2.015, 3.15])
def test_free_strip_narrows_as_in_uniaxial_tension_beside_a_critical_stretch(horizon):
    scene = free_strip(horizon=horizon)
    result = scene.run(device="cpu")
    across = (scene.sheet.positions + result.frame.displacement)[scene.sheet.edges("right"), 1]
    assert np.ptp(across) == pytest.approx(0.02 * 1.5**-0.5, rel=2e-3)
    assert result.history[-1]["pull_x"] == pytest.approx(2e5 * (1.5 - 1.5**-2) * 0.02e-3, rel=2e-3)
    assert result.summary["weights"] == "corrected" and not result.summary["notes"]


def test_strip_that_closes_like_a_curtain_is_noted():
    notes = free_strip(weights="plain").run(device="cpu").summary["notes"]
    assert len(notes) == 2
    assert "turned over" in notes[0] and "of its stress-free area" in notes[1]
    assert all("take the weights 'corrected'" in note for note in notes)


def test_what_turns_over_for_a_time_is_noted_with_that_time():
    """The shape is looked at in every frame, and what was found goes into a restart file as JSON."""
    sheet = square(5)
    built = Simulation(sheet, BondAssociated(NEO), Explicit(1.0)).build("cpu", 64)
    points, found, flat = FramePoints(built), {}, sheet.positions
    shapes = [flat, flat * [-0.5, 0.5, 1.0], np.where(flat[:, :1] > 0.08, flat - [0.05, 0.0, 0.0], flat), flat]
    for index, shape in enumerate(shapes):
        frame = replace(points.frame(index, 0.1 * index), displacement=shape - flat)
        ShapeWatch(built).look(points.surface, frame, found)
        found = json.loads(json.dumps(found))
    over, area = ShapeWatch(built).notes(points.surface, frame, found)
    assert "8 of 32 of the untorn sheet are turned over (first at t = 0.2 s, not at the end)" in over
    assert "its stress-free area (first at t = 0.1 s, not at the end), down to 25 %" in area
    found = {}
    ShapeWatch(built).look(points.surface, replace(frame, displacement=shapes[2] - flat), found)
    assert "(from t = 0.3 s on)" in ShapeWatch(built).notes(points.surface, frame, found)[0]


def test_rigid_turn_by_half_a_circle_is_no_note():
    sheet = square(5)
    turned = sheet.positions * [1.0, -1.0, -1.0] - sheet.positions
    scene = Simulation(
        sheet, BondAssociated(NEO), Explicit(1e-5, frames=1), initial_displacement=turned + [0.0, 0.1, 0.0]
    )
    assert not [note for note in scene.run(device="cpu").summary["notes"] if "turned over" in note or "area" in note]
