"""The damage field of a tearing energy: its energy, its forces, what it breaks, and tears that keep their balance."""

import numpy as np
import pytest
from helpers import NEO, array, build, internal_force, jittered, refused, rough, square, strain_energy, uniform
from resumed_runs import require_same_when_stopped

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Nodal,
    Ogden,
    Prony,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    Visco,
    Yeoh,
)
from warp_pd.device import graph
from warp_pd.families import unpack
from warp_pd.geometry.couplings import gradient_couplings
from warp_pd.materials import energy_density
from warp_pd.run.checks import foreseen
from warp_pd.scenes import running_crack
from warp_pd.tearing import damage_field
from warp_pd.tearing.cut_profiles import CutEnds

LAWS = [
    BondAssociated(NEO, weights="plain"), BondAssociated(TensionField(NEO), weights="corrected", horizon=3.15),
    BondAssociated(NEO, fast=False), Visco(Yeoh(500.0, 10.0)), Nodal(NEO, horizon=2.015),
    BondAssociated(TensionField(Ogden((700.0, 12.0), (1.8, 4.0)))),
]  # fmt: skip


def damaged(built, seed=0):
    """Give the points a random damage."""
    values = np.random.default_rng(seed).uniform(0.0, 0.7, len(built.rupture.field))
    built.rupture.field.assign(values)
    return values


def fracture(built):
    """Energy of the field [J]."""
    built.context.run("frame")
    return float(built.rupture.fracture.numpy().sum())


@pytest.mark.parametrize(
    ("sheet", "law"), [(jittered(9), LAWS[1]), *((square(9), law) for law in LAWS)],
    ids=["cloud", *(f"{type(law).__name__} {law.weights}" for law in LAWS)],
)  # fmt: skip
def test_the_force_is_minus_the_gradient_of_the_energy(sheet, law):
    built = Simulation(sheet, law, Explicit(1.0), damage=TearingEnergy(10.0)).build("cpu", 64)
    damaged(built)
    displacement = rough(sheet)
    force, rng = internal_force(built, displacement), np.random.default_rng(1)
    for _ in range(2):
        direction = rng.normal(size=force.shape)
        step = 1e-6 * sheet.spacing
        ahead, behind = (strain_energy(built, displacement + sign * step * direction) for sign in (1.0, -1.0))
        slope = (ahead - behind) / (2.0 * step)
        assert slope == pytest.approx(-(force * direction).sum(), rel=2e-6)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())


@pytest.mark.parametrize(
    ("sheet", "strength"), [(square(17), None), (jittered(17), None), (square(17), 60.0), (square(17), 15.0)],
    ids=["lattice", "cloud", "weak", "weakest"],
)  # fmt: skip
def test_after_a_step_the_energy_is_stationary_in_the_damage_that_grew(sheet, strength):
    """A strain far above the limit in the middle; where the damage grew, no small change of it lowers the energy."""
    built = build(sheet, damage=TearingEnergy(8.0, length=0.016, strength=strength), weights="corrected")
    built.state.step.fill_(1e-12)
    x = sheet.points - 0.05
    bump = np.exp(-(x**2).sum(axis=1, keepdims=True) / 0.02**2)
    displacement = np.hstack([0.4 * x * bump, 0.0 * bump])
    built.state.displacement.assign(displacement)
    for _ in range(60):
        built.context.run("step")
        built.state.velocity.zero_()
        built.state.displacement.assign(displacement)
    field = built.rupture.field.numpy().copy()
    grown = np.flatnonzero(field > 1e-3)
    assert 0 < len(grown) < sheet.size and 0.1 < field.max() < 0.8

    # What the step left of the stiffness is what the same damage leaves when it is given.
    stored = strain_energy(built, displacement)
    built.rupture.assign(field)
    assert strain_energy(built, displacement) == pytest.approx(stored, rel=1e-12)

    def energy(values):
        built.rupture.assign(values)
        return strain_energy(built, displacement) + float(built.rupture.fracture.numpy().sum())

    def slope(point, size=1e-6):
        change = np.zeros(sheet.size)
        change[point] = size
        return (energy(field + change) - energy(field - change)) / (2.0 * size)

    scale = built.rupture.limit * sheet.thickness * sheet.areas
    for point in grown[:: max(1, len(grown) // 30)]:
        assert abs(slope(point)) < 2e-4 * scale[point]
    for point in np.flatnonzero(field == 0.0)[::7]:
        assert slope(point, 1e-9) > -1e-6 * scale[point]


GRADED = Sheet.outline(
    [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)], spacing=lambda x, y: 0.002 + 0.02 * np.abs(y - 0.05),
    thickness=1e-3, density=1e3,
)  # fmt: skip


@pytest.mark.parametrize(
    ("sheet", "degrees"),
    [(square(41), 0.0), (jittered(41, share=0.3), 0.0), (square(41).turned(20.0), 20.0), (GRADED, 0.0)],
    ids=["lattice", "cloud", "turned", "graded"],
)  # fmt: skip
def test_the_energy_of_a_crack_is_its_length_times_the_tearing_energy(sheet, degrees):
    """The field that a line of severed points takes around it; no displacement."""
    built, angle = build(sheet, damage=TearingEnergy(7.0, length=0.012)), np.deg2rad(degrees)
    x = (sheet.points - sheet.points.mean(axis=0)) @ [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    on_line = np.abs(x[:, 1]) < 0.4 * sheet.spacing
    built.rupture.field.assign(np.where(on_line, 1.0, 0.0))
    built.context.run("start")
    for _ in range(60):
        built.context.run("step")
    field = built.rupture.field.numpy()
    expected = np.maximum(1.0 - np.abs(x[:, 1]) / 0.024, 0.0) ** 2
    assert np.abs(field - expected).max() < 0.1
    # A tear takes more than the energy of the field, as families average over the horizon.
    given = 16.0 / 3.0 * built.rupture.length * built.rupture.limit
    ratio = built.law.families.horizon / 0.012
    assert given == pytest.approx(7.0 / (1.0 + 0.12 * ratio + 0.075 * ratio**2))
    assert fracture(built) == pytest.approx(given * 0.1 * sheet.thickness, rel=0.04)


@pytest.mark.parametrize("sheet", [jittered(15, share=0.3), square(9)], ids=["cloud", "lattice"])
def test_couplings_are_exact_for_linear_fields(sheet):
    neighbours, weights = gradient_couplings(sheet)
    field = sheet.points @ [2.0, -3.0]
    found = 0.5 * (weights * (field - field[neighbours]) ** 2).sum()
    assert found == pytest.approx(13.0 * 0.01, rel=1e-6)
    for i in range(sheet.size):
        for m, w in zip(neighbours[:, i], weights[:, i], strict=True):
            assert w == 0.0 or w in weights[:, m][neighbours[:, m] == i]


@pytest.mark.parametrize("sheet", [jittered(15), square(9)], ids=["cloud", "lattice"])
def test_couplings_of_some_points_are_theirs_among_all(sheet):
    some = np.random.default_rng(0).permutation(sheet.size)[:40]
    for found, whole in zip(gradient_couplings(sheet, some), gradient_couplings(sheet), strict=True):
        np.testing.assert_array_equal(found, whole[:, some])


def test_damage_never_heals():
    sheet = square(9)
    built = build(sheet, damage=TearingEnergy(5.0))
    built.state.step.fill_(1e-12)
    found = []
    for stretch in (1.0, 1.3, 1.6, 1.2, 1.0):
        internal_force(built, uniform(sheet, [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]]))
        for _ in range(20):
            built.context.run("step")
        found.append(built.rupture.field.numpy().copy())
    assert (np.diff(found, axis=0) >= 0.0).all() and found[0].max() == 0.0 and found[2].max() > 0.2
    np.testing.assert_array_equal(found[2], found[4])


def torn_strip(law, precision=32, screened=True, sheet=None):
    sheet = sheet or square(17).cut((-0.01, 0.047), (0.035, 0.047))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    return Simulation(
        sheet, law, Explicit(0.6, frames=60, damping=2.0, precision=precision),
        loads=[Fixed(bottom), Motion(top, [0.0, 0.6], x=0.0, y=[0.0, 0.08], z=0.0)],
        damage=TearingEnergy(6.0, spared=np.concatenate([bottom, top]), screened=screened, length=0.016),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("sheet", "precision"), [(None, 32), (jittered(17).cut((-0.01, 0.047), (0.04, 0.047)), 64)],
    ids=["lattice", "cloud"],
)  # fmt: skip
def test_looking_where_something_can_happen_gives_the_bits_of_looking_everywhere(sheet, precision):
    law = BondAssociated(TensionField(NEO), horizon=2.015)
    one, other = (torn_strip(law, precision, screened, sheet).run(device="cpu").built for screened in (True, False))
    for name in ("displacement", "damage_field", "intact_bonds", "released"):
        np.testing.assert_array_equal(array(one, name).numpy(), array(other, name).numpy())
    assert one.rupture.field.numpy().max() > 0.8


@pytest.mark.parametrize(
    "law",
    [BondAssociated(TensionField(NEO), horizon=2.015), Visco(Yeoh(500.0)), Nodal(NEO, 2.015)],
    ids=["relaxed", "Visco", "Nodal"],
)
def test_a_torn_strip_keeps_its_balance(law):
    result = torn_strip(law).run(device="cpu")
    assert result.status == "finished"
    history = result.history
    assert history[-1]["largest_damage"] > 0.8 and not result.built.rupture.intact_faces.numpy().all()
    losses = np.diff([row["rupture"] for row in history])
    assert losses.sum() > 0.0 and losses.min() > -2e-3 * losses.sum()
    assert max(abs(row["balance_error"]) for row in history if row["time"] > 0.05) < 0.005


@pytest.mark.parametrize("material", [NEO, Yeoh(500.0, 50.0)], ids=["neo-Hookean", "stiffening"])
def test_a_run_resumed_in_the_middle_of_a_tear_is_the_same(material, tmp_path):
    law = BondAssociated(TensionField(material), horizon=2.015)
    whole = require_same_when_stopped(lambda: torn_strip(law), tmp_path, (40,))
    field = array(whole.built, "damage_field").numpy()
    assert ((field > 0.1) & (field < 0.7)).any() and (field > 0.8).any()


def test_each_point_is_listed_once_by_any_number_of_threads(monkeypatch):
    """Those of a CPU have no atomics; a list that two of them share loses points, now and then."""
    monkeypatch.setattr(graph, "SPLIT_FROM", 0.0)
    monkeypatch.setattr(graph, "available_cores", lambda: 8)
    built = build(square(301), damage=TearingEnergy(10.0, screened=False))
    built.context.compile()
    listing = [item for item in built.context.stages["start"] if item.name in ("wake", "pack")]
    launches = [graph.CpuLaunch(item, built.context.device) for item in listing]
    for _ in range(50):
        for launch in launches:
            launch.run()
        count = int(array(built, "listed_count").numpy()[0])
        listed = array(built, "listed_points").numpy()[:count]
        np.testing.assert_array_equal(np.sort(listed), np.arange(301**2))


def test_two_runs_are_equal_however_launches_are_divided(monkeypatch):
    law = BondAssociated(TensionField(NEO), horizon=2.015)
    one = torn_strip(law).run(device="cpu")
    monkeypatch.setattr(graph, "SPLIT_FROM", 0.0)
    other = torn_strip(law).run(device="cpu")
    assert one.history == other.history and one.history[-1]["largest_damage"] > 0.8
    for name in ("displacement", "damage_field", "intact_bonds", "released"):
        np.testing.assert_array_equal(array(one.built, name).numpy(), array(other.built, name).numpy())


def test_spared_points_stay_undamaged_and_keep_their_bonds():
    sheet = square(17).cut((-0.01, 0.047), (0.04, 0.047))
    spared = sheet.where(lambda x, y: x > 0.06)
    built = build(sheet, damage=TearingEnergy(2.0, spared=spared))
    built.state.step.fill_(1e-12)
    for _ in range(20):
        internal_force(built, uniform(sheet, [[2.0, 0.0], [0.0, 2.0], [0.0, 0.0]]))
        built.context.run("step")
    field = built.rupture.field.numpy()
    assert (field[spared] == 0.0).all() and field.max() > 0.9
    intact = unpack(built.law.intact.numpy().T, built.law.families.members)
    exists = built.law.families.rows_of_points(built.law.families.exists)
    np.testing.assert_array_equal(intact[spared], exists[spared])
    members = built.law.families.members_of(np.arange(sheet.size))
    assert not (intact & ~np.isin(members, spared))[field > 0.8].any()


def test_both_ends_of_a_bond_agree():
    built = torn_strip(BondAssociated(TensionField(NEO)), sheet=jittered(17, share=0.3)).build("cpu", 64)
    families, n = built.law.families, len(built.rupture.field)
    built.rupture.field.assign(np.where(np.random.default_rng(0).random(n) < 0.05, 0.9, 0.01))
    built.context.run("start")
    built.state.step.fill_(1e-12)
    built.context.run("step")
    intact = unpack(built.law.intact.numpy().T, families.members)
    members = families.members_of(np.arange(n))
    bonds = {(i, int(members[i, k])) for i, k in zip(*np.nonzero(intact), strict=True)}
    assert 0.3 * (members >= 0).sum() < len(bonds) < 0.96 * (members >= 0).sum()
    assert all((m, i) in bonds for i, m in bonds)


def test_intact_material_begins_to_tear_at_its_strength():
    """In uniaxial, planar and equibiaxial tension: the energy density at the first damage."""
    sheet, inside = square(15), lambda x, y: np.maximum(np.abs(x - 0.05), np.abs(y - 0.05)) < 0.03
    for widths in (lambda s: s**-0.5, lambda s: 1.0 + 0.0 * s, lambda s: s):
        built = build(sheet, damage=TearingEnergy(5.0, strength=300.0), weights="corrected")
        assert built.rupture.length == pytest.approx(4.0 * sheet.spacing)
        built.state.step.fill_(1e-12)
        stretches = np.linspace(1.0, 1.5, 2001)
        energies = energy_density(NEO, stretches, widths(stretches))
        for share in (0.99, 1.01):
            stretch = float(np.interp(share * built.rupture.limit, energies, stretches))
            internal_force(built, uniform(sheet, [[stretch, 0.0], [0.0, widths(stretch)], [0.0, 0.0]]))
            built.context.run("step")
            assert (built.rupture.field.numpy()[sheet.where(inside)] > 0.0).all() == (share > 1.0)


def test_a_stiffened_sheet_tears_as_one_of_stiffer_rubber():
    fields, stiffer = [], NeoHookean(4.0 * NEO.mu, 4.0 * NEO.bulk)
    for sheet, material in ((square(15).stiffened(np.arange(225), 4.0), NEO), (square(15), stiffer)):
        built = build(sheet, material=material, damage=TearingEnergy(5.0, strength=300.0), weights="corrected")
        built.state.step.fill_(1e-12)
        internal_force(built, uniform(sheet, 1.2 * np.eye(3)[:, :2]))
        built.context.run("step")
        fields.append(built.rupture.field.numpy())
    assert fields[0].max() > 0.0
    np.testing.assert_allclose(*fields, rtol=1e-9)


def test_a_stretch_at_break_is_a_strength():
    sheet = square(11)
    strength = float(energy_density(NEO, 1.3, 1.3**-0.5))
    by_stretch, by_energy = (
        build(sheet, damage=TearingEnergy(60.0, **given)).rupture
        for given in ({"stretch_at_break": 1.3}, {"strength": strength})
    )
    assert by_stretch.constants.wanted_length() == pytest.approx(by_energy.constants.wanted_length(), rel=5e-3)


def test_the_spacing_that_is_named_for_a_strength_resolves_it():
    coarse = build(square(11), damage=TearingEnergy(60.0, strength=3e4)).rupture
    needed = coarse.constants.resolving_length()
    spacing = coarse.context.sheet.spacing * needed / coarse.length
    fine = Sheet.rectangle(10 * spacing, 10 * spacing, thickness=1e-3, density=1000.0, points=11)
    rupture = build(fine, damage=TearingEnergy(60.0, strength=3e4)).rupture
    assert rupture.length == pytest.approx(needed) and rupture.limit == pytest.approx(3e4)


def test_a_strength_that_the_spacing_resolves_gives_the_length():
    built = build(square(41), damage=TearingEnergy(60.0, strength=300.0))
    assert built.rupture.limit == pytest.approx(300.0) and built.rupture.length > 4.0 * built.context.sheet.spacing


def test_the_cut_of_a_sheet_breaks_no_bonds_while_nothing_pulls():
    simulation = Simulation(
        square(21).cut((-0.01, 0.0475), (0.05, 0.0475)), BondAssociated(TensionField(NEO)), Explicit(1e-3, frames=1),
        damage=TearingEnergy(5.0), loads=[Fixed([0])],
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.history[-1]["largest_damage"] > 0.8 and result.built.rupture.intact_faces.numpy().all()


def test_cuts_have_the_profile_of_a_crack_unless_they_are_notches():
    sheet = square(21).cut((-0.01, 0.0475), (0.05, 0.0475))
    tip = 0.05 - CutEnds.of(sheet, 0.01).recesses(0.01, sheet.spacing)[0]
    apart = np.hypot(np.maximum(sheet.points[:, 0] - tip, 0.0), sheet.points[:, 1] - 0.0475)
    crack, notch = (build(sheet, damage=TearingEnergy(5.0, length=0.01, cut_profile=p)).rupture for p in (True, False))
    np.testing.assert_allclose(crack.field.numpy(), np.maximum(1.0 - apart / 0.02, 0.0) ** 2, atol=1e-12)
    assert (notch.field.numpy() == 0.0).all()


def test_a_crack_of_an_outline_has_the_profile_too():
    sheet = Sheet.outline(
        [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)], spacing=0.005, thickness=1e-3, density=1e3,
        cracks={"slit": [(0.0, 0.05), (0.05, 0.05)]}, holes={"hole": [(0.08, 0.08), (0.095, 0.08), (0.095, 0.095)]},
    )  # fmt: skip
    tip = 0.05 - CutEnds.of(sheet, 0.01).recesses(0.01, sheet.spacing)[0]
    apart = np.hypot(np.maximum(sheet.points[:, 0] - tip, 0.0), sheet.points[:, 1] - 0.05)
    field = build(sheet, damage=TearingEnergy(5.0, length=0.01)).rupture.field.numpy()
    np.testing.assert_allclose(field, np.minimum(np.maximum(1.0 - apart / 0.02, 0.0) ** 2, 0.98), atol=1e-9)


def test_a_start_beyond_the_strength_is_one_line():
    sheet = square(9)
    start = uniform(sheet, [[1.9, 0.0], [0.0, 1.9], [0.0, 0.0]])
    with refused(match=r"^damage = TearingEnergy: the sheet starts with [^\n]*$"):
        Simulation(
            sheet, BondAssociated(NEO), Explicit(1e-3, frames=1), damage=TearingEnergy(5.0), initial_displacement=start
        ).run(device="cpu")


def test_a_start_far_beyond_the_strength_is_known_without_compiling():
    """From the triangles, to the digit for a uniform stretch; also as a prestretch."""
    sheet = square(9)
    start = uniform(sheet, [[1.9, 0.0], [0.0, 1.9], [0.0, 0.0]])
    message = r"the sheet starts with ([0-9.e+]+) J/m\^3"
    for at, more in ((sheet, {"initial_displacement": start}), (sheet.prestretched(1.9), {})):
        scene = Simulation(at, BondAssociated(NEO), Explicit(1e-3, frames=1), damage=TearingEnergy(5.0), **more)
        with refused(match=message):
            scene.build("cpu")


def test_a_crack_may_start_above_the_strength_beside_its_tip_and_there_alone():
    sheet = square(21).cut((-0.01, 0.0475), (0.0225, 0.0475))
    x, y = sheet.points.T

    def begin(place):
        start = np.zeros((sheet.size, 3))
        start[:, 1] = 0.9 * (y - 0.05) * np.exp(-((x - place) ** 2 + (y - 0.05) ** 2) / 0.015**2)
        damage = TearingEnergy(5.0, length=0.008)
        return Simulation(
            sheet, BondAssociated(NEO), Explicit(1e-6, frames=1), damage=damage, initial_displacement=start
        ).run(device="cpu")

    assert begin(0.03).status == "finished"
    with refused(match=r"^damage = TearingEnergy: the sheet starts with [^\n]*$"):
        begin(0.09)


def test_the_summary_states_length_and_strength():
    sheet = square(9)
    loads = [Fixed(sheet.edges("left"))]
    for given, said in (({}, 1), ({"strength": 1e5}, 2)):
        simulation = Simulation(
            sheet, BondAssociated(NEO), Explicit(1e-6, frames=1), damage=TearingEnergy(5.0, **given), loads=loads
        )
        notes = simulation.run(device="cpu").summary["notes"]
        assert sum("length of" in note for note in notes) == said


def test_the_stress_that_frames_show_is_that_which_is_left():
    sheet = square(9)
    shown = []
    for field in (0.0, 0.5):
        built = build(sheet, damage=TearingEnergy(10.0), fields=["first_piola"])
        built.rupture.field.assign(np.full(sheet.size, field))
        strain_energy(built, uniform(sheet, [[1.2, 0.0], [0.0, 1.0], [0.0, 0.0]]))
        shown.append(array(built, "first_piola_1").numpy().copy())
    assert shown[0].min() > 0.0
    np.testing.assert_allclose(shown[1], 0.25 * shown[0], rtol=1e-12)


@pytest.mark.parametrize(
    "law",
    [Visco(Yeoh(500.0), prony=(Prony(c10=100.0, time=0.1),)), BondAssociated(NEO, weights="published")],
    ids=["Prony", "published"],
)
def test_what_cannot_have_the_field_is_one_line(law):
    sheet = square(9)
    loads = [Fixed(sheet.edges("left", "right", "bottom", "top"))]
    with refused(match=r"^[^\n]*TearingEnergy[^\n]*expected[^\n]*$|expected[^\n]*TearingEnergy$"):
        Simulation(sheet, law, Explicit(1.0), damage=TearingEnergy(5.0), loads=loads).build("cpu")


def test_other_criteria_have_no_field():
    sheet = square(9)
    for damage in (None, CriticalStretch(1.5)):
        built = Simulation(sheet, BondAssociated(NEO), Explicit(1.0), damage=damage).build("cpu")
        assert "damage_field" not in [stored.name for stored in built.context.fields]
        launched = {part for stage in built.context.stages.values() for launch in stage for part in launch.parts}
        assert not launched & {"wake", "drive", "sweep", "finish"}


@pytest.mark.parametrize(("damage", "broken", "at_an_end", "severed"), [
    (0.95, 5, False, True), (0.95, 4, False, False), (0.95, 3, True, True), (0.95, 2, True, False),
    (0.85, 5, False, False),
])  # fmt: skip
def test_a_point_that_a_tear_has_passed_is_severed(damage, broken, at_an_end, severed):
    """With nearly the damage that severs it, and 0.4 of its 12 bonds broken; 0.25 of them ahead of the end of a cut."""
    rupture = build(square(9), damage=TearingEnergy(8.0)).rupture
    rupture.prepare_at_rest()
    middle, limits = 40, rupture._severed_at.numpy().copy()
    field, intact = np.zeros(81), rupture.intact.numpy()
    field[middle] = damage * limits[middle]
    rupture.assign(field)
    intact[0, middle] &= ~np.uint32(2**broken - 1)
    rupture.intact.assign(intact)
    rupture._ahead.assign(np.full(81, at_an_end, np.uint8))
    rupture.context.run("damage")
    limits[middle] = field[middle] if severed else limits[middle]
    np.testing.assert_array_equal(rupture._severed_at.numpy(), limits)


@pytest.mark.parametrize("given", [
    {"energy": 0.0}, {"energy": -1.0}, {"energy": float("nan")}, {"energy": "1"}, {"length": 0.0}, {"strength": -1.0},
    {"stretch_at_break": 0.9}, {"stretch_at_break": 1.9, "strength": 1.0},
])  # fmt: skip
def test_wrong_values_are_refused(given):
    with refused(match=r"^TearingEnergy"):
        TearingEnergy(**{"energy": 1.0, **given})


def test_a_strength_below_that_of_the_length_is_a_constant_of_its_own():
    """Where intact material begins to tear; the energy of a crack, and the profile around it, stay."""
    given = {"sheet": square(41), "weights": "corrected"}
    strong, weak = (build(damage=TearingEnergy(60.0, length=0.02, strength=s), **given).rupture for s in (None, 200.0))
    assert strong.limit > 500.0 and weak.limit == pytest.approx(200.0)
    assert weak.length == strong.length and len(weak.notes([{"mean_damage": 0.0}], None)) == 1
    with refused(match=r"^TearingEnergy\.strength = 600 J/m\^3 at a length of 0\.02 m: expected at most 5"):
        build(damage=TearingEnergy(60.0, length=0.02, strength=600.0), **given)


def test_a_length_shorter_than_the_families_is_refused():
    with refused(match=r"^TearingEnergy\.length = 0\.001: expected 0\.0151 m or more"):
        build(square(11), damage=TearingEnergy(5.0, length=1e-3))


@pytest.mark.parametrize("given", [{"length": 0.2}, {"length": 1e308}, {"strength": 1e-3}])
def test_a_length_longer_than_the_sheet_is_refused(given):
    with refused(match=r"^TearingEnergy: its length is .* m; expected .*, 0\.141 m, or a higher"):
        build(square(11), damage=TearingEnergy(5.0, **given))


@pytest.mark.parametrize("few", [0, 10**6], ids=["listed before", "lists"])
@pytest.mark.parametrize("strength", [None, 10.0], ids=["default", "weak"])
def test_one_launch_finds_the_damage_that_several_find(few, strength, monkeypatch):
    """As on a GPU, here by one thread: a strain that tears the middle of a sheet with a cut gives the same bits."""
    sheet = square(17).cut((0.0, 0.05), (0.03, 0.05))
    damage = TearingEnergy(2.0, length=0.016, strength=strength, spared=sheet.edges("right"))
    x = sheet.points - 0.05
    stretched = np.hstack([0.5 * x, np.zeros((sheet.size, 1))])

    def torn():
        built = build(sheet, damage=damage, weights="corrected")
        built.state.step.fill_(1e-12)
        for name in ("start", "setup"):
            built.context.run(name)
        driving = built.rupture._driving.numpy().copy()
        built.state.displacement.assign(stretched)
        for _ in range(20):
            built.context.run("step")
        fields = {stored.field.name: stored.array.numpy().copy() for stored in built.context.fields}
        return driving, {name: fields[name] for name in FOUND}

    driving, several = torn()
    monkeypatch.setattr(damage_field, "finds_at_once", lambda context: True)
    monkeypatch.setattr(damage_field, "FEW_POINTS", few)
    driving_again, one = torn()
    assert several["damage_field"].max() > 0.9 and several["released"].any()
    np.testing.assert_array_equal(driving_again, driving)
    for name, values in several.items():
        np.testing.assert_array_equal(one[name], values, err_msg=name)


FOUND = ("damage_field", "intact_bonds", "released", "severed_at", "awake", "near_damage", "force")


def test_damage_found_in_every_step_does_not_lag_behind_a_fast_crack(monkeypatch):
    """The crack is faster by more than a tenth, and by no more than a fiftieth with three times the sweeps.

    It takes less energy, and what it does not take of what the strip frees goes into waves and damping.
    """
    speeds, taken = [], []
    for every_step, closer in ((False, 1.0), (True, damage_field.CLOSER), (True, 3.0 * damage_field.CLOSER)):
        monkeypatch.setattr(damage_field, "CLOSER", closer)
        scene = running_crack.build(20, overload=1.3, duration=0.2, damage_length=5e-3, every_step=every_step)
        result = scene.run(device="cpu", usd=False, pictures=False)
        speeds.append(result.summary["measures"]["crack_speed"]["value"])
        begin, end = (min(result.history, key=lambda r, at=at: abs(r["tip"] - at)) for at in (0.02, 0.08))
        freed, rupture = begin["strain"] - end["strain"], end["rupture"] - begin["rupture"]
        taken.append(rupture / freed)
    assert speeds[1] > 1.1 * speeds[0] and taken[1] < taken[0] < 1.0
    assert speeds[2] == pytest.approx(speeds[1], rel=0.02)


def test_the_field_passes_points_whose_bonds_determine_no_deformation():
    """They store no energy, as two points that cuts sever from the sheet; their own area carries the field."""
    pair = jittered(11, share=0.1).cut((-0.01, 0.0149), (0.005, 0.0149)).cut((0.005, 0.015), (0.005, -0.01))
    built = build(pair, horizon=1.8, weights="corrected", damage=TearingEnergy(10.0))
    assert (built.law.represented_areas() == 0.0).any()
    rupture = built.rupture
    for values in (rupture.fracture, built.context.fields["field_couplings"], built.context.fields["driving_scale"]):
        assert np.isfinite(values.numpy()).all()


def test_lopsided_families_of_a_sheet_that_tears_are_noted():
    sheet = Sheet.rectangle(0.06, 0.02, thickness=1e-3, density=1000.0, points=(30, 10))
    for horizon, said in ((2.015, 1), (1.5, 0)):
        rupture = build(sheet, horizon=horizon, damage=TearingEnergy(4.0)).rupture
        notes = rupture.notes([{"mean_damage": 0.0}], None)
        assert sum("reach further along one axis" in note for note in notes) == said


@pytest.mark.parametrize(("height", "strength", "softens"), [
    (0.012, None, True), (0.06, None, False), (0.012, 2e4, False),
])  # fmt: skip
def test_a_sheet_that_softens_before_its_crack_moves_is_noted_before_and_after_a_run(height, strength, softens):
    """A strip of height H stores Gc / H where its crack moves: above the strength if H is less than some 6 lengths.

    A strength that is given, and that the spacing resolves, is meant.
    """
    sheet = Sheet.rectangle(0.06, height, thickness=8e-4, density=1000.0, points=(21, round(height / 3e-3) + 1))
    sheet = sheet.cut((-0.01, 0.5 * height + 1.5e-3), (0.02, 0.5 * height + 1.5e-3))
    edges = sheet.edges("bottom"), sheet.edges("top")
    pull = [
        Motion(edge, [0.0, 0.02], x=0.0, y=[0.0, sign * 0.5 * height], z=0.0)
        for edge, sign in zip(edges, (-1, 1), strict=True)
    ]
    criterion = TearingEnergy(1500.0, strength=strength, spared=sheet.edges("bottom", "top"))
    law = BondAssociated(TensionField(MooneyRivlin(1.85e5)))
    scene = Simulation(sheet, law, Explicit(0.02, frames=20, damping=100.0), pull, damage=criterion)
    result = scene.run(device="cpu", precision=32)
    before = [note for note in foreseen(result.built) if "before a crack moves" in note]
    after = [note for note in result.summary["notes"] if "intact material had a mean damage" in note]
    assert (len(before), len(after)) == (softens, softens)
    assert all("which needs a spacing of" in note for note in (*before, *after))
