"""Thickness and density by point: exact solutions, energies and forces, seams that tear, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import NEO, build, built_on, exact_stress, internal_force, refused, rough, square, strain_energy
from resumed_runs import require_same_when_stopped
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize
from scipy.sparse.linalg import eigsh

from warp_pd import (
    Bimodular,
    BodyForce,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    CriticalEnergy,
    Explicit,
    Fixed,
    HyperelasticBonds,
    MooneyRivlin,
    Motion,
    Newton,
    Nodal,
    SelfContact,
    Sheet,
    Simulation,
    TearingEnergy,
    together,
)
from warp_pd.command.modes import natural_modes
from warp_pd.measures import support_force
from warp_pd.tearing.field_constants import bias, seam_energy

LENGTH, WIDTH, PULL = 0.1, 0.025, 0.05
LAWS = {
    "plain": BondAssociated(NEO, horizon=3.015, weights="plain"),
    "corrected": BondAssociated(NEO, weights="corrected"),
    "reference": BondAssociated(NEO, weights="plain", fast=False),
    "bond-based": BondBased(Bimodular(1e4, 3e3)),
    "hyperelastic": HyperelasticBonds(BondNeoHookean(1e3, "uniaxial", "refitted")),
}


def wedge(x, y):
    return 1e-3 * (1.0 + x / LENGTH)


def hilly(x, y):
    return 1e-3 * (1.0 + 0.5 * np.sin(40.0 * x) * np.cos(25.0 * y))


def exact_pull():
    """Force on a strip of thickness `wedge` in planar tension [N]: P(stretch) h is the same everywhere."""
    stretches = np.linspace(1.0, 3.0, 60)
    stress = [exact_stress(NEO, [[s, 0.0], [0.0, 1.0], [0.0, 0.0]])[0, 0] for s in stretches]
    stretch = CubicSpline(stress, stretches)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    place = 0.5 * LENGTH * (nodes + 1.0)

    def misfit(force):
        return 0.5 * LENGTH * (weights * (stretch(force / wedge(place, 0.0)) - 1.0)).sum() - PULL

    return WIDTH * brentq(misfit, 1e-9, 0.999e-3 * stress[-1])


def strip_of(kind, points):
    if kind == "outline":
        corners = [(0.0, 0.0), (LENGTH, 0.0), (LENGTH, WIDTH), (0.0, WIDTH)]
        return Sheet.outline(corners, spacing=LENGTH / (points - 1), thickness=wedge, density=1e3)
    sheet = Sheet.rectangle(LENGTH, WIDTH, thickness=wedge, density=1e3, points=(points, (points - 1) // 4 + 1))
    return sheet if kind == "lattice" else sheet.as_cloud()


def pull_error(kind, points):
    sheet = strip_of(kind, points)
    left, right = sheet.edges("left"), sheet.edges("right")
    loads = [Fixed(range(sheet.size), "yz"), Fixed(left, "x"), Motion(right, [0.0, 1.0], x=[0.0, PULL])]
    result = Simulation(sheet, LAWS["corrected"], Newton(tolerance=1e-9), loads=loads).run(device="cpu")
    assert result.status == "finished"
    return support_force(result.built, right)[0] / exact_pull() - 1.0


def test_a_strip_that_grows_thicker_has_the_exact_force():
    """0.02 % with 41 points and of second order, with the coarser lattices of multigrid, on all layouts."""
    coarse, fine = pull_error("lattice", 21), pull_error("lattice", 41)
    assert abs(fine) < 3e-4 and np.log2(coarse / fine) > 1.7
    assert abs(pull_error("cloud", 41)) < 3e-4 and abs(pull_error("outline", 41)) < 3e-4


def drum_frequencies(side, stretch, mu):
    """Lowest two frequencies of a clamped square of thickness `hilly`, prestretched, by finite elements [Hz]."""
    finite_elements = pytest.importorskip("finite_elements")
    grid = np.linspace(0.0, side / stretch, 17)
    mesh, material = finite_elements.rectangle(grid, grid, True), finite_elements.incompressible(mu)
    plane, space = (finite_elements.Membrane(mesh, material, 1.0, components) for components in (2, 3))
    # Elements of thickness 1 whose areas carry the thickness.
    areas = plane.weights * hilly(*stretch * np.asarray(plane.basis.global_coordinates()))
    plane.weights = space.weights = areas
    edge = (np.isclose(plane.nodes, 0.0) | np.isclose(plane.nodes, side / stretch)).any(axis=1)
    plane.displacement = (stretch - 1.0) * plane.nodes
    plane.solve(np.repeat(edge[:, None], 2, axis=1))
    space.displacement = np.column_stack([plane.displacement, np.zeros(len(edge))])
    across = 3 * np.flatnonzero(~edge) + 2
    stiffness, values = space.assembled()[1][across][:, across], space._operators[1]
    mass = (values.T @ sparse.diags(1e3 * areas.ravel()) @ values)[~edge][:, ~edge]
    squares = eigsh(stiffness.tocsc(), k=2, M=mass.tocsc(), sigma=0.0, v0=np.ones(len(across)))[0]
    return np.sqrt(np.sort(squares)) / (2.0 * np.pi)


def test_a_drum_of_varying_thickness_sounds_as_in_finite_elements():
    """The tension is the same nowhere: first the sheet comes to rest in its plane. Second order."""
    side, stretch, mu = 0.1, 1.5, 1e3
    expected, errors = drum_frequencies(side, stretch, mu), []
    for points in (26, 51):
        sheet = Sheet.rectangle(side, side, thickness=hilly, density=1e3, points=points).prestretched(stretch)
        force = BondAssociated(MooneyRivlin(0.5 * mu), weights="corrected")
        loads = [Fixed(sheet.edges("all"))]
        built = Simulation(sheet, force, Newton(tolerance=1e-6), loads=loads).run(device="cpu").built
        built.context.run("setup")
        errors.append(np.abs(natural_modes(built, 2, "z").frequencies / expected - 1.0))
    assert errors[1].max() < 3e-3, errors
    assert np.log2(errors[0] / errors[1]).min() > 1.7


@pytest.mark.parametrize("kind", ["rectangle", "sphere", "bar"])
def test_mass_and_weight_are_those_of_thickness_and_density(kind):
    """To round-off; linear functions are summed exactly by the areas of a rectangle."""
    if kind == "sphere":
        values = {"thickness": lambda x, y, z: 1e-3 * (2.0 + z), "density": lambda x, y, z: 900.0 + 100.0 * x**2}
        sheet = Sheet.sphere(0.7, points=6, **values)
        wanted = (sheet.areas * values["thickness"](*sheet.points.T) * values["density"](*sheet.points.T)).sum()
    elif kind == "bar":
        sheet = Sheet.line(LENGTH, lambda x, y: 1e-6 * (1.0 + x / LENGTH), density=1e3, points=20)
        wanted = 1e3 * 1.5e-6 * LENGTH
    else:
        sheet = Sheet.rectangle(LENGTH, WIDTH, thickness=wedge, density=np.full(9 * 3, 950.0), points=(9, 3))
        wanted = 950.0 * 1.5e-3 * LENGTH * WIDTH
    law = BondBased(Bimodular(1e4, 3e3), state="line" if kind == "bar" else "plane stress")
    simulation = Simulation(sheet, law, Explicit(1.0), loads=[BodyForce((0.0, 0.0, -9.81))])
    built = built_on(simulation)
    assert built.to_numpy(built.state.mass).sum() == pytest.approx(wanted, rel=1e-14)
    weight = -9.81 * (sheet.areas * sheet.thickness).sum()
    assert built.external.constant[:, 2].sum() == pytest.approx(weight, rel=1e-14)


@pytest.mark.parametrize(
    ("name", "kind"), [*((name, "lattice") for name in LAWS), ("plain", "cloud"), ("corrected", "hole")]
)
def test_forces_are_those_of_each_family_and_its_thickness(name, kind):
    """Momentum, the gradient of the energy, and families that carry h of their own point; float32 as float64."""
    sheet = square(14, thickness=hilly)
    sheet = {"lattice": sheet, "cloud": sheet.as_cloud(), "hole": sheet.hole((0.05, 0.05), 0.02)}[kind]
    built = built_on(Simulation(sheet, LAWS[name], Explicit(1.0)))
    u = rough(sheet)
    force = internal_force(built, u)
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).sum()
    single = internal_force(built_on(Simulation(sheet, LAWS[name], Explicit(1.0)), precision=32), u)
    assert np.abs(single - force).max() < 3e-6 * np.abs(force).max()
    if not built.law.has_energy:
        return
    direction, step = np.random.default_rng(1).normal(size=u.shape), 1e-6 * sheet.spacing
    slope = (strain_energy(built, u + step * direction) - strain_energy(built, u - step * direction)) / (2.0 * step)
    assert -(force * direction).sum() == pytest.approx(slope, rel=1e-6)
    strain_energy(built, u)
    found = built.law.strain_energy.numpy() / sheet.thickness
    even = built_on(Simulation(replace(sheet, thickness=1.0), LAWS[name], Explicit(1.0)))
    strain_energy(even, u)
    assert found == pytest.approx(even.law.strain_energy.numpy(), rel=1e-11, abs=1e-12)


def test_an_array_adds_no_array_and_no_launch():
    """A sheet of varying thickness has the plan of one of constant thickness: only tables get more rows."""
    plans = []
    for thickness in (1e-3, hilly):
        context = build(square(12, thickness=thickness), damage=TearingEnergy(10.0), solver=Explicit(1.0)).context
        launches = {
            name: [(launch.name, launch.kernel.module.name) for launch in stage.launches()]
            for name, stage in context.stages.items()
        }
        plans.append(([(stored.name, stored.owner) for stored in context.fields], launches))
    assert plans[0] == plans[1]


def test_an_equal_array_gives_the_forces_of_the_number():
    u = rough(square(12))
    number, array = (internal_force(build(square(12, thickness=h)), u) for h in (1e-3, np.full(144, 1e-3)))
    assert np.abs(array - number).max() < 1e-14 * np.abs(number).max()


def test_pieces_and_holes_keep_their_thickness():
    sheet = square(9, thickness=hilly, density=lambda x, y: 900.0 + x)
    holed = sheet.hole((0.05, 0.05), 0.02)
    assert holed.thickness == pytest.approx(hilly(*holed.points.T)) and holed.density.shape == (holed.size,)
    both = together(sheet, square(5, thickness=2e-3, density=1e3))
    assert both.thickness[:81] == pytest.approx(sheet.thickness) and (both.thickness[81:] == 2e-3).all()
    assert together(square(5), square(6)).thickness == 1e-3
    contact = build(both, contact=SelfContact()).contact
    thin = build(together(*2 * [square(9, thickness=sheet.thickness.min())]), contact=SelfContact()).contact
    assert contact.stiffness == pytest.approx(thin.stiffness)


def test_a_sheet_tears_along_its_weak_seam():
    """The seam leaves the end of the cut askew; in an even sheet the tear goes straight on."""
    start, slope, half = np.array([0.025, 0.0501]), 0.4, 0.0125
    sheet = square(25).cut((-0.01, start[1]), tuple(start))

    def above(x, y):
        return ((y - start[1]) - slope * (x - start[0])) / np.hypot(1.0, slope)

    heights = [0.0, 0.012, 0.0156, 0.02]
    loads = [
        Motion(sheet.edges("top"), np.linspace(0.0, 1.0, 4), x=0.0, y=heights), Fixed(sheet.edges("bottom"), "xy"),
        Fixed(range(sheet.size), "z"),
    ]  # fmt: skip
    damage = TearingEnergy(
        lambda x, y: np.where(abs(above(x, y)) < half, 2.0, 6.0), spared=sheet.edges("bottom", "top")
    )
    result = Simulation(sheet, LAWS["corrected"], Newton(load_steps=3), loads=loads, damage=damage).run(device="cpu")
    torn = sheet.points[(result.built.rupture.field.numpy() > 0.7) & (sheet.points[:, 0] > 0.06)]
    assert result.status == "finished" and len(np.unique(torn[:, 0])) > 7
    assert np.abs(above(*torn.T)).max() < half
    assert torn[torn[:, 0] > 0.08, 1].mean() > 0.067
    notes = " ".join(result.summary["notes"])
    limit = 3.0 * 2.0 / (16.0 * result.built.rupture.length * bias(2.015 / 4.0))
    assert f"begins to tear at {limit:.4g} to {3.0 * limit:.4g} J/m^3" in notes
    assert "low over a width of 0.0" in notes and "a spacing of 0.00" in notes


@pytest.mark.parametrize("half", [0.2, 0.7, 1.5])
def test_the_energy_of_a_narrow_seam_is_the_least_of_all_profiles(half):
    ratio, places = 4.0, np.linspace(0.0, 3.0, 301)
    step = places[1]
    between = np.where(places[1:] - 0.5 * step < half, 1.0, ratio)
    at = step * np.append(0.5, 0.5 * (between[1:] + between[:-1]))

    def energy(damage):
        d = np.append(np.append(1.0, damage), 0.0)
        slope = np.diff(d) / step
        pull = 2.0 * between * slope
        return 0.75 * ((at * d[:-1]).sum() + step * (between * slope**2).sum()), 0.75 * (at[1:] - np.diff(pull))

    start = np.maximum(1.0 - 0.5 * places[1:-1], 0.0) ** 2
    options = {"maxiter": 20000, "maxfun": 40000, "ftol": 1e-15, "gtol": 1e-10}
    least = minimize(energy, start, jac=True, bounds=[(0.0, None)] * 299, method="L-BFGS-B", options=options).fun
    assert seam_energy(ratio, half) == pytest.approx(least, rel=3e-3)
    assert seam_energy(ratio, 0.0) == pytest.approx(ratio) and seam_energy(ratio, 2.0) == 1.0


def test_energy_balance_and_restart_of_a_sheet_that_tears(tmp_path):
    def simulation(energy=lambda x, y: 5.0 + 30.0 * y):
        sheet = square(11, thickness=hilly, density=lambda x, y: 1e3 + 1e3 * x).cut((-0.01, 0.053), (0.035, 0.053))
        top, bottom = sheet.edges("top"), sheet.edges("bottom")
        loads = [Fixed(bottom), Motion(top, [0.0, 0.5], x=0.0, y=[0.0, 0.05], z=0.0)]
        damage = TearingEnergy(energy, spared=sheet.edges("top", "bottom"))
        return Simulation(
            sheet, LAWS["corrected"], Explicit(0.5, frames=8, damping=5.0), loads=loads, damage=damage
        )  # fmt: skip

    result = require_same_when_stopped(simulation, tmp_path, [3], precision=32)
    assert result.history[-1]["fracture"] > 1e-5
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    with refused(match="written with different settings"):
        simulation(lambda x, y: 5.0 + 31.0 * y).run(
            device="cpu", precision=32, out=tmp_path / "complete", usd=False, pictures=False, resume=True
        )


@pytest.mark.parametrize(("thickness", "said"), [
    (np.ones(8), r"thickness has shape \(8,\): expected \(9,\), one number for each point"),
    (-1e-3, "thickness = -0.001: expected a positive number"),
    ([1e-3] * 8 + [-1e-3], r"thickness\[8\] = -0.001: expected a positive number"),
    (np.full(9, np.nan), r"thickness\[0\] = nan: expected finite numbers"),
    (lambda x, y: "thin", r"thickness\(x, y\) = 'thin': expected numbers"),
    (lambda x, y: 1e-3, r"thickness\(x, y\) has shape \(\): expected \(9,\)"),
    (lambda x: x, r"thickness\(x, y\): TypeError: .*; expected a function of arrays"),
    ("thin", "thickness = 'thin': expected a number"), (None, "thickness = None: expected a number"),
])  # fmt: skip
def test_wrong_thickness_is_refused_in_one_line(thickness, said):
    with refused(match=f"^{said}"):
        square(3, thickness=thickness)


@pytest.mark.parametrize(("energy", "said"), [
    (np.ones(8), r"TearingEnergy.energy has shape \(8,\)"), (np.zeros(81), r"TearingEnergy.energy\[0\] = 0.0"),
    (lambda x, y: "weak", r"TearingEnergy.energy\(x, y\) = 'weak': expected numbers"),
])  # fmt: skip
def test_wrong_tearing_energies_are_refused_in_one_line(energy, said):
    with refused(match=f"^{said}"):
        build(square(9), damage=TearingEnergy(energy))
    with refused(match=r"^TearingEnergy: .*strength.* with a varying energy; expected a uniform energy"):
        TearingEnergy(energy, strength=10.0)


@pytest.mark.parametrize("parts", [
    {"force": Nodal(NEO)}, {"force": BondAssociated(NEO, weights="published")},
    {"force": BondAssociated(NEO, fast=False, weights="plain"), "damage": CriticalEnergy(1.0)},
])  # fmt: skip
def test_laws_and_criteria_of_one_thickness_refuse_others(parts):
    with refused(match=r"^[^\n]*expected (one number|a sheet of uniform thickness)[^\n]*$"):
        Simulation(square(9, thickness=hilly), solver=Explicit(1.0), **parts).build("cpu")
