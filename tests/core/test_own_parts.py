"""Parts written outside the package, those of docs/write-your-own-part.md: physics, restart, plan, refusals."""

import re

import numpy as np
import own_parts
import pytest
from helpers import MU, NEO, build, exact_stress, jittered, refused, square, uniform
from resumed_runs import require_same_when_stopped

from warp_pd import (
    Bimodular,
    BodyPath,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    Motion,
    Newton,
    Pressure,
    Relaxation,
    RigidBody,
    Simulation,
    TriangleMesh,
)

NAMES = ("elastic_foundation",)
RECIPES = ("normal_stress", "weak_seam", "strength_surface", "torus", "obj_writer")


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own_parts")
    return {name: own_parts.load(name, folder) for name in NAMES} | {name: own_parts.recipe(name) for name in RECIPES}


def test_page_has_parts_of_less_than_sixty_lines():
    lines = {name: len([x for x in text.splitlines() if x.strip()]) for name, text in own_parts.sources().items()}
    assert set(lines) == set(NAMES)
    assert max(lines.values()) < 60, lines


LAW = BondAssociated(NEO, horizon=2.015, weights="plain")
SOLVERS = {
    "newton": Newton(tolerance=1e-10),
    "newton, jacobi": Newton(tolerance=1e-10, preconditioner="jacobi"),
    "newton, multigrid": Newton(tolerance=1e-10, preconditioner="multigrid"),
    "relaxation": Relaxation(tolerance=1e-9),
}


def on_springs(parts, solver, stiffness=1e6, pressure=20.0):
    """A sheet that is free to move up and down, on springs."""
    sheet = square(19)
    loads = [
        Pressure(pressure, follower=False), parts["elastic_foundation"].ElasticFoundation(stiffness),
        Fixed(np.arange(sheet.size), components="xy"),
    ]  # fmt: skip
    return Simulation(sheet, LAW, solver, loads=loads)


@pytest.mark.parametrize("name", SOLVERS)
def test_foundation_carries_a_pressure_in_every_static_solver(parts, name):
    result = on_springs(parts, SOLVERS[name]).run(device="cpu", precision=64)
    assert result.status == "finished"
    # Every point has its own springs: p = k u.
    np.testing.assert_allclose(result.frame.displacement[:, 2], 20.0 / 1e6, rtol=1e-6)


@pytest.mark.parametrize("name", ["newton", "newton, multigrid"])
def test_loads_per_area_act_on_the_clamped_area_of_a_prestretched_sheet(parts, name):
    """Springs of the scene's own and a dead pressure; the stress-free sheet has half of the area."""
    sheet = square(19).prestretched(1.6, 1.25)
    rim = sheet.edges("all")
    middle = sheet.nearest(0.05, 0.05)
    result = Simulation(
        sheet, LAW, SOLVERS[name], loads=[
            Fixed(rim), Fixed(range(sheet.size), "xy"), Pressure(20.0, follower=False),
            parts["elastic_foundation"].ElasticFoundation(1e9),
        ],
    ).run(device="cpu", precision=64)  # fmt: skip
    # The foundation is much stiffer than the sheet.
    assert result.frame.displacement[middle, 2] == pytest.approx(20.0 / 1e9, rel=1e-3)
    applied = result.built.to_numpy(result.built.state.external)[rim, 2].sum()
    assert applied == pytest.approx(20.0 * 0.01 * (1.0 - 17**2 / 18**2), rel=1e-9)
    assert result.built.context.fields["springs"].numpy().sum() == pytest.approx(1e9 * 0.01, rel=1e-9)


def test_foundation_lets_a_sheet_swing_at_its_frequency(parts):
    sheet = square(9)
    stiffness = 1e6
    omega = np.sqrt(stiffness / (sheet.thickness * sheet.density))
    start = np.tile([0.0, 0.0, 1e-4], (sheet.size, 1))
    simulation = Simulation(
        sheet, LAW, Explicit(2.0 * np.pi / omega, frames=8, safety=0.02), initial_displacement=start,
        loads=[parts["elastic_foundation"].ElasticFoundation(stiffness)],
    )  # fmt: skip
    result = simulation.run(device="cpu", precision=64)
    np.testing.assert_allclose(result.frame.displacement, start, atol=2e-7)
    # Energy goes into the springs and comes back; the trapezoidal rule for the work is of second order in the step.
    kinetic, work = (np.array([row[name] for row in result.history]) for name in ("kinetic", "external"))
    np.testing.assert_allclose(kinetic, work, atol=(omega * result.built.state.step.numpy()[0]) ** 2 * kinetic.max())
    assert kinetic.max() > 0.99 * 0.5 * stiffness * 1e-8 * sheet.areas.sum()


def test_springs_are_in_the_stable_step(parts):
    """The step that explicit dynamics takes knows the stiffness of a load."""
    sheet = square(9)

    def omega(stiffness):
        loads = [parts["elastic_foundation"].ElasticFoundation(stiffness)]
        built = Simulation(sheet, LAW, Explicit(1.0), loads=loads).build("cpu", 64)
        return built.solver.stable_step.omega(200)

    soft, hard = 1.0, 1e12
    assert omega(hard) == pytest.approx(np.sqrt(hard / (sheet.thickness * sheet.density)), rel=1e-3)
    assert omega(soft) < 1e-2 * omega(hard)


def test_a_load_without_a_tangent_is_refused_by_newton_alone(parts):
    foundation = parts["elastic_foundation"]

    class Built(foundation.BuiltFoundation):
        def add_tangent(self, stage, displacement, direction, out):
            return False

    class NoTangent(foundation.ElasticFoundation):
        def build(self, context, law):
            return Built(self.stiffness, context)

    sheet = square(9)
    loads = [NoTangent(1e3), Fixed(sheet.edges("left"))]
    with refused(match="ElasticFoundation"):
        Simulation(sheet, LAW, Newton(), loads=loads).build("cpu")
    Simulation(sheet, LAW, Relaxation(), loads=loads).build("cpu")


def pulled(sheet, solver, damage, law=LAW, supports=()):
    loads = [
        Fixed(sheet.edges("left")),
        *supports,
        Motion(sheet.edges("right"), (0.0, solver.duration), x=(0.0, 0.05), y=0.0, z=0.0),
    ]
    return Simulation(sheet, law, solver, loads=loads, damage=damage)


def seam_of(parts, sheet):
    """Weak within a spacing of the middle."""
    weak = np.abs(sheet.points[:, 0] - 0.05) < 1.1 * sheet.spacing
    return weak, parts["weak_seam"].WeakSeam(np.where(weak, 1.2, 3.0))


@pytest.mark.parametrize(
    ("solver", "law"),
    [
        (Explicit(0.2, frames=8), LAW),
        (Relaxation(tolerance=1e-4), LAW),
        (Newton(load_steps=6), BondBased(Bimodular(3.0 * MU), horizon=2.015)),
    ],
    ids=["explicit", "relaxation", "newton"],
)
def test_a_sheet_tears_along_its_weak_seam(parts, solver, law):
    sheet = square(17)
    weak, seam = seam_of(parts, sheet)
    in_plane = [Fixed(sheet.where(lambda x, y: (x > 0.0) & (x < 0.1)), components="z")]
    built = pulled(sheet, solver, seam, law, in_plane).run(device="cpu", precision=64).built
    damage = built.to_numpy(built.rupture.damage)
    near = np.abs(sheet.points[:, 0] - 0.05) < (1.1 + 2.015) * sheet.spacing
    assert damage[weak].max() > 0.3
    assert damage[~near].max() == 0.0


def test_an_even_seam_is_the_critical_stretch(parts):
    sheet = square(17)
    solver = Explicit(0.2, frames=8)
    own, ours = (
        pulled(sheet, solver, damage).run(device="cpu", precision=64).built
        for damage in (parts["weak_seam"].WeakSeam(np.full(sheet.size, 1.25)), CriticalStretch(1.25))
    )
    assert (own.law.intact.numpy() == ours.law.intact.numpy()).all()
    assert own.to_numpy(own.rupture.damage).max() > 0.0


@pytest.mark.parametrize(
    ("solver", "ramp"), [(Newton(load_steps=2), None), (Explicit(0.02, frames=2), [(0, 0), (0.02, 1)])]
)
def test_an_own_load_follows_load_factor_and_ramp(parts, solver, ramp, tmp_path):
    """As a dead pressure of the same size does, at every frame."""
    sheet = square(11)
    rim = sheet.edges("all")
    own, ours = (
        Simulation(sheet, LAW, solver, loads=[Fixed(rim), load]).run(
            device="cpu", precision=64, out=tmp_path / name, usd=False, view=False, pictures=False
        )
        for name, load in (
            ("own", parts["normal_stress"].NormalStress(np.full(sheet.size, 20.0), ramp)),
            ("ours", Pressure(20.0, follower=False, ramp=ramp)),
        )
    )
    for first, second in zip(own.frames, ours.frames, strict=True):
        np.testing.assert_allclose(first.displacement, second.displacement, rtol=1e-6, atol=1e-12)
    assert 0.0 < np.abs(own.frames[1].displacement).max() < np.abs(own.frames[-1].displacement).max()


UNIAXIAL, BIAXIAL = np.diag([1.5, 1.5**-0.5, 1.0]), np.diag([1.3, 1.3, 1.0])


@pytest.mark.parametrize("layout", [square, jittered])
def test_strengths_in_uniaxial_and_biaxial_tension_are_apart(parts, layout):
    """A sheet of each kind breaks at its own strength, whatever the other one is."""
    sheet = layout(7)
    uniaxial = exact_stress(NEO, UNIAXIAL[:, :2])[0, 0]
    biaxial = exact_stress(NEO, BIAXIAL[:, :2])[0, 0]
    surface = parts["strength_surface"].StrengthSurface
    for gradient, strengths in (
        (UNIAXIAL, lambda share: (share * uniaxial, 0.7 * biaxial)),
        (BIAXIAL, lambda share: (1.5 * uniaxial, share * biaxial)),
    ):
        for share, broken in ((1.01, 0.0), (0.99, 1.0)):
            start = uniform(sheet, gradient[:, :2])
            built = build(sheet, initial_displacement=start, damage=surface(*strengths(share)))
            built.context.run("setup")
            built.state.step.assign(np.array([1e-9]))
            built.context.run("step")
            built.context.run("frame")
            assert built.rupture.damage.numpy() == pytest.approx(broken, abs=1e-6)


def test_a_law_without_a_stress_is_refused(parts):
    limit = parts["strength_surface"].StrengthSurface(1e6, 1e6)
    with refused(match="expected a law with the field first_piola_1"):
        pulled(square(9), Explicit(0.1), limit, BondBased(Bimodular(3.0 * MU), horizon=2.015)).plan("cpu")


def ring(parts, start, velocity, duration):
    path = BodyPath.straight(start, velocity, duration)
    return RigidBody(parts["torus"].Torus(0.06, 0.02), path, name="ring")


def from_ring(place, centre):
    """Distance of points from the surface of the ring [m]."""
    x, y, z = (place - centre).T
    return np.hypot(np.hypot(x, y) - 0.03, z) - 0.01


def test_ring_lifts_a_free_sheet(parts):
    sheet, start = square(19), (0.05, 0.05, -0.0101)
    simulation = Simulation(sheet, LAW, Explicit(4e-3, frames=8), contact=ring(parts, start, (0.0, 0.0, 1.0), 4e-3))
    result = simulation.run(device="cpu", precision=64)
    apart = from_ring(sheet.positions + result.frame.displacement, np.array(start) + [0.0, 0.0, 4e-3])
    assert apart.min() > -1e-9
    assert (apart < 1e-7).sum() >= 10
    # What the ring gave is the momentum of the sheet, with the sign turned.
    given = -sum(row["ring_force_z"] * 4e-3 / 8 for row in result.history)
    mass = result.built.to_numpy(result.built.state.mass)
    assert given == pytest.approx(mass @ result.frame.velocity[:, 2], rel=1e-9)
    assert given > 0.1 * mass.sum()


def test_newton_lays_a_sheet_over_the_ring(parts):
    sheet = square(19)
    contact = ring(parts, (0.05, 0.05, -0.0101), (0.0, 0.0, 5e-3), 1.0)
    result = Simulation(sheet, LAW, Newton(load_steps=2), loads=[Fixed(sheet.edges("all"))], contact=contact).run(
        device="cpu", precision=64
    )
    apart = from_ring(sheet.positions + result.frame.displacement, np.array([0.05, 0.05, -0.0051]))
    assert result.history[-1]["ring_force_z"] < 0.0
    assert (np.abs(apart) < 1e-5 * sheet.spacing).sum() >= 10 and apart.min() > -1e-5 * sheet.spacing


def test_the_ring_has_the_inertia_of_what_is_drawn(parts):
    torus = parts["torus"].Torus(0.06, 0.02)
    np.testing.assert_allclose(torus.inertia(), TriangleMesh(*torus.outline(0.0)).inertia(), rtol=0.02, atol=1e-12)


def test_writer_leaves_a_file_per_frame(parts, tmp_path):
    sheet = square(17)
    _, seam = seam_of(parts, sheet)
    simulation = pulled(sheet, Explicit(0.2, frames=8), seam)
    writer = parts["obj_writer"].ObjWriter(tmp_path, sheet)
    frame = simulation.run(device="cpu", precision=64, writers=[writer]).frame
    files = sorted(tmp_path.glob("*.obj"))
    assert [path.name for path in files] == [f"frame-{k:04d}.obj" for k in range(9)]
    text = files[-1].read_text()
    vertices = np.array(re.findall(r"^v (\S+) (\S+) (\S+)$", text, re.MULTILINE), float)
    expected = np.column_stack([sheet.points, np.zeros(sheet.size)]) + frame.displacement
    np.testing.assert_allclose(vertices, expected, atol=1e-8)
    faces = np.array(re.findall(r"^f (\d+) (\d+) (\d+)$", text, re.MULTILINE), int) - 1
    assert len(faces) == frame.intact_faces.sum() < len(sheet.triangles)
    np.testing.assert_array_equal(faces, sheet.triangles[frame.intact_faces])


def everything(parts, sheet):
    """All four parts but the writer in one scene."""
    _, seam = seam_of(parts, sheet)
    simulation = pulled(sheet, Explicit(0.2, frames=8), seam)
    simulation.loads = [*simulation.loads, parts["elastic_foundation"].ElasticFoundation(1e4)]
    simulation.contact = ring(parts, (0.05, 0.05, -0.0101), (0.0, 0.0, 0.01), 0.2)
    return simulation


def test_own_parts_go_on_from_a_restart_bit_for_bit(parts, tmp_path):
    sheet = square(17)

    def shapes(folder):
        return folder.with_name(folder.name + "_obj")

    through = require_same_when_stopped(
        lambda: everything(parts, sheet), tmp_path, [5], precision=64,
        writers=lambda folder: [parts["obj_writer"].ObjWriter(shapes(folder), sheet)],
    )  # fmt: skip
    assert through.frame.damage.max() > 0.0
    for path in shapes(tmp_path / "complete").glob("*.obj"):
        assert path.read_bytes() == (shapes(tmp_path / "stopped") / path.name).read_bytes()


def test_plan_names_own_parts_and_what_they_allocate(parts):
    plan = everything(parts, square(17)).plan("cpu", 64)
    for array, owner in (
        ("springs", "ElasticFoundation"),
        ("critical_stretch", "WeakSeam"),
        ("ring_impulse", "ring"),
    ):
        assert re.search(rf"^  {array} .*{owner}$", plan, re.MULTILINE), array
    for kernel, owner in (("add_spring_force", "ElasticFoundation"), ("strike_points", "ring")):
        assert re.search(rf"{kernel}.*{owner}", plan), kernel


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("elastic_foundation", ("ElasticFoundation", -1.0), "ElasticFoundation.stiffness = -1"),
        ("weak_seam", ("WeakSeam", [0.5]), "WeakSeam.stretch"),
        (
            "strength_surface",
            ("StrengthSurface", 1e6, 5e5),
            "StrengthSurface.biaxial = 500000.0: expected more than half",
        ),
        ("torus", ("Torus", 0.02, 0.06), "Torus.tube = 0.06: expected less than circle"),
    ],
)
def test_wrong_arguments_of_own_parts_end_in_one_line(parts, name, arguments, message):
    with refused(match=message):
        getattr(parts[name], arguments[0])(*arguments[1:])


def test_a_part_given_as_another_argument_is_refused(parts):
    with refused(match="RigidBody"):
        Simulation(square(9), LAW, Explicit(1.0), loads=[ring(parts, (0, 0, -1), (0, 0, 1), 1.0)]).build("cpu")
    with refused(match="contact"):
        Simulation(square(9), LAW, Explicit(1.0), contact=Fixed([0])).build("cpu")
