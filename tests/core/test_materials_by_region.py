"""Materials by region: laminates against exact solutions, energy and force at the interface, what is refused."""

import numpy as np
import pytest
from helpers import NEO, build, built_on, exact_stress, internal_force, refused, rough, square, strain_energy
from resumed_runs import require_same_when_stopped
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from warp_pd import (
    BondAssociated,
    ByRegion,
    CriticalStretch,
    Explicit,
    Fixed,
    Gent,
    InputError,
    Motion,
    Newton,
    Nodal,
    Prony,
    SelfContact,
    Sheet,
    Simulation,
    TensionField,
    Visco,
    together,
)
from warp_pd.measures import support_force

STIFF = Gent(mu=8e3, bulk=4e5, lock=80.0)
LENGTH, WIDTH, PULL = 0.1, 0.025, 0.05


def wedge(x, y):
    return 1e-3 * (1.0 + x / LENGTH)


def stretches():
    """Stretch in planar tension by first Piola stress, of the two materials."""
    at = np.linspace(1.0, 3.0, 60)
    stress = [[exact_stress(m, [[s, 0.0], [0.0, 1.0], [0.0, 0.0]])[0, 0] for s in at] for m in (NEO, STIFF)]
    return [CubicSpline(values, at) for values in stress], stress[0][-1]


def exact_pull():
    """Force on two materials in series [N], in a strip of thickness `wedge`."""
    (soft, stiff), most = stretches()
    nodes, weights = np.polynomial.legendre.leggauss(20)
    place = 0.25 * LENGTH * (nodes + 1.0)

    def misfit(force):
        first = soft(force / wedge(place, 0.0)) - 1.0
        second = stiff(force / wedge(place + 0.5 * LENGTH, 0.0)) - 1.0
        return 0.25 * LENGTH * (weights * (first + second)).sum() - PULL

    return brentq(misfit, 1e-9, 0.999e-3 * most)


def stretched(points, thickness=wedge, axis=0, law=NEO):
    """A strip in planar tension whose stiff half is at large x or y; its edge force [N/m] comes with it."""
    shape = (points, (points - 1) // 4 + 1)
    sheet = Sheet.rectangle(LENGTH, WIDTH, thickness=thickness, density=1e3, points=shape).as_cloud()
    middle = 0.5 * (LENGTH, WIDTH)[axis] - 1e-9
    material = ByRegion(NEO, [(sheet.points[:, axis] > middle, law)])
    left, right = sheet.edges("left"), sheet.edges("right")
    loads = [Fixed(range(sheet.size), "yz"), Fixed(left, "x"), Motion(right, [0.0, 1.0], x=[0.0, PULL])]
    simulation = Simulation(
        sheet, BondAssociated(material), Newton(tolerance=1e-9), loads=loads, fields=("first_piola",)
    )
    result = simulation.run(device="cpu")
    assert result.status == "finished", result.summary["message"]
    return result, support_force(result.built, right)[0] / WIDTH


def test_two_materials_in_series_converge_to_the_exact_force():
    """0.016 % with 41 points and of second order; the stress is smooth across the interface."""
    wanted = exact_pull()
    errors = []
    for points in (21, 41):
        result, force = stretched(points, law=STIFF)
        errors.append(force / wanted - 1.0)
    assert abs(errors[1]) < 3e-4 and np.log2(errors[0] / errors[1]) > 1.8, errors
    sheet = result.built.simulation.sheet
    along = np.isclose(sheet.points[:, 1], 0.5 * WIDTH)
    carried = result.frame.point_data["first_piola_1"][along] * wedge(*sheet.points[along].T)
    assert np.abs(carried[2:-2] / force - 1.0).max() < 1e-3


@pytest.mark.parametrize("axis", [0, 1])
def test_uniform_halves_are_exact(axis):
    """Where each material has one stretch, the families fit it to round-off, in series and in parallel."""
    (soft, stiff), most = stretches()
    _, force = stretched(11, 1e-3, axis, STIFF)
    if axis:
        gradient = [[1.5, 0.0], [0.0, 1.0], [0.0, 0.0]]
        wanted = 0.5e-3 * (exact_stress(NEO, gradient)[0, 0] + exact_stress(STIFF, gradient)[0, 0])
        assert force == pytest.approx(wanted, rel=1e-9)
    else:
        pull = lambda f: 0.5 * LENGTH * (soft(f) + stiff(f) - 2.0) - PULL  # noqa: E731
        assert force == pytest.approx(1e-3 * brentq(pull, 1e-6, most), rel=1e-6)


def patched(kind):
    """A sheet with a patch of another material; at its corners points have a quarter of their area in the patch."""
    if kind == "tube":
        sheet = Sheet.tube(0.05, 0.15, thickness=1e-3, density=1e3, points=18)
        # The slit crosses the interface, the hole ends at it.
        sheet = sheet.slit((0.05, 0.0, 0.04), (0.05, 0.0, 0.1)).hole((-0.05, 0.0, 0.09), 0.02)
        return sheet, ByRegion(NEO, [(sheet.where(lambda x, y, z: z > 0.07), STIFF)])
    if kind == "together":
        sheet = together(square(9), square(7)).as_cloud()
        return sheet, ByRegion(NEO, [(sheet.edges("sheet 2"), STIFF)])
    sheet = square(11, thickness=wedge).as_cloud()
    inside = sheet.where(lambda x, y: (np.abs(x - 0.05) < 0.021) & (np.abs(y - 0.05) < 0.031))
    if kind == "wrinkled":
        return sheet, ByRegion(TensionField(NEO), [(inside, TensionField(STIFF))])
    return sheet, ByRegion(NEO, [(inside, STIFF)])


@pytest.mark.parametrize(("kind", "fast"), [
    ("patch", True), ("patch", False), ("tube", True), ("together", True), ("wrinkled", True),
])  # fmt: skip
def test_force_is_the_gradient_of_the_energy(kind, fast):
    """Momentum, the gradient of the energy, and float32 as float64, on both paths of a CPU."""
    sheet, material = patched(kind)
    simulation = Simulation(sheet, BondAssociated(material, fast=fast), Explicit(1.0))
    built, u = built_on(simulation), rough(sheet, size=0.02)
    force = internal_force(built, u)
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * np.abs(force).sum()
    direction, step = np.random.default_rng(1).normal(size=u.shape), 1e-6 * sheet.spacing
    slope = (strain_energy(built, u + step * direction) - strain_energy(built, u - step * direction)) / (2.0 * step)
    assert -(force * direction).sum() == pytest.approx(slope, rel=1e-7)
    if kind == "patch":
        single = internal_force(built_on(simulation, precision=32), u)
        assert np.abs(single - force).max() < 3e-6 * np.abs(force).max()


def test_each_region_has_its_own_material():
    """Far from the interface the force is that of the material alone, also where pieces do not touch."""
    sheet, material = patched("together")
    u = rough(sheet)
    both = internal_force(build(sheet, material=material, weights="corrected"), u)
    alone = [internal_force(build(sheet, material=m, weights="corrected"), u) for m in (NEO, STIFF)]
    expected = np.where((sheet.pieces == 1)[:, None], *alone)
    assert np.abs(both - expected).max() < 1e-11 * np.abs(expected).max()


def test_visco_without_terms_takes_regions():
    sheet, material = patched("patch")
    u = rough(sheet, size=0.02)
    elastic, viscous = (internal_force(built_on(Simulation(sheet, law(material, fast=False), Explicit(1.0))), u)
                        for law in (BondAssociated, Visco))  # fmt: skip
    np.testing.assert_array_equal(viscous, elastic)


def test_energy_balance_and_restart(tmp_path):
    def simulation(edge=0.02):
        sheet = square(9).as_cloud()
        inside = sheet.where(lambda x, y: np.abs(x - 0.05) < edge)
        loads = [Fixed(sheet.edges("bottom")), Motion(sheet.edges("top"), [0.0, 0.2], x=0.0, y=[0.0, 0.02], z=0.0)]
        law = BondAssociated(ByRegion(NEO, [(inside, STIFF)]))
        return Simulation(sheet, law, Explicit(0.2, frames=4), loads=loads, damage=CriticalStretch(4.0))

    result = require_same_when_stopped(simulation, tmp_path, [2], precision=32)
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-3
    with refused(match="written with different settings"):
        simulation(0.03).run(
            device="cpu", precision=32, out=tmp_path / "complete", usd=False, pictures=False, resume=True
        )


CLOUD = square(5).as_cloud()
HALF = CLOUD.points[:, 0] > 0.049


@pytest.mark.parametrize(("parts", "said"), [
    ({"sheet": square(5)}, r"sheet: expected sheet\.as_cloud\(\) with ByRegion"),
    ({"sheet": CLOUD.cut((-0.01, 0.03), (0.05, 0.03))}, "sheet: expected no cuts"),
    ({"regions": [(HALF, STIFF), (HALF, NEO)]}, r"ByRegion.regions\[1\] and regions\[0\] overlap"),
    ({"regions": [([0, 1], STIFF)]}, r"ByRegion.regions\[0\] contains no triangle"),
    ({"regions": [([99], STIFF)]}, r"ByRegion.regions\[0\] contains point 99"),
    ({"regions": [(HALF, STIFF), (~(CLOUD.points[:, 0] > 0.051), NEO)]}, "ByRegion.material contains no triangle"),
    ({"weights": "published"}, "weights = 'published': expected 'plain' or 'corrected' with ByRegion"),
])  # fmt: skip
def test_wrong_regions_are_refused_in_one_line(parts, said):
    sheet, regions = parts.pop("sheet", CLOUD), parts.pop("regions", [(HALF, STIFF)])
    with refused(match=f"^{said}"):
        build(sheet, material=ByRegion(NEO, regions), **parts)


@pytest.mark.parametrize("regions", [[], [STIFF], [(HALF, "rubber")], HALF, [(HALF, ByRegion(NEO, [(HALF, NEO)]))]])
def test_what_are_no_regions_is_refused(regions):
    with pytest.raises(InputError):
        ByRegion(NEO, regions)


def test_messages_name_the_region():
    with refused(match=r"^ByRegion.regions\[0\]\[1\] = 'rubber': expected a material"):
        ByRegion(NEO, [(HALF, "rubber")])
    corner = (CLOUD.points[:, :2] > 0.07).all(axis=1)
    with refused(match=r"^ByRegion.regions\[0\], as a sheet of its own: horizon = "):
        build(CLOUD, material=ByRegion(NEO, [(corner, STIFF)]))


def test_laws_of_one_material_refuse_it():
    material = ByRegion(NEO, [(HALF, STIFF)])
    for law in (Nodal(material), Visco(material, prony=(Prony(c10=1e3, time=1.0),))):
        with refused(match=r"expected a material without regions \(ByRegion\), or the force Bond"):
            built_on(Simulation(CLOUD, law, Explicit(1.0)))
    with refused(match="expected a TensionField in each region instead"):
        TensionField(material)


def test_a_contact_takes_the_stiffness_of_the_stiffest():
    material = ByRegion(NEO, [(HALF, STIFF)])
    found, wanted = (build(CLOUD, material=m, contact=SelfContact()).contacts[0].stiffness for m in (material, STIFF))
    assert found == pytest.approx(wanted)
