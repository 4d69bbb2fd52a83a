"""A tearing energy: the critical stretch that it stands for, what it refuses, and a strip that tears at it."""

import numpy as np
import pytest
from helpers import GENT, NEO, array, build, internal_force, jittered, square, uniform

from warp_pd import (
    ArrudaBoyce,
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    MooneyRivlin,
    Motion,
    Nodal,
    Simulation,
    TearingEnergy,
    TensionField,
    Yeoh,
)
from warp_pd.families import unpack
from warp_pd.materials import energy_density
from warp_pd.parts import tip_width
from warp_pd.scenes import pure_shear_tear

MATERIALS = [NEO, GENT, MooneyRivlin(400.0, 100.0), Yeoh(500.0, 10.0), ArrudaBoyce(1e3, 5.0), TensionField(NEO)]


@pytest.mark.parametrize("material", MATERIALS, ids=str)
@pytest.mark.parametrize("stretch", [1.2, 2.0, 4.0])
def test_the_critical_stretch_is_thomas_relation(material, stretch):
    sheet = square(11)
    energy = tip_width(3.15, gradual=True) * sheet.spacing * float(energy_density(material, stretch, 1.0))
    law = BondAssociated(material, horizon=3.15)
    built = Simulation(sheet, law, Explicit(1.0), damage=TearingEnergy(energy)).build("cpu")
    assert built.rupture.critical == pytest.approx(stretch, rel=1e-5)


def test_the_tip_is_as_wide_as_the_horizon_if_that_is_wide():
    assert tip_width(12.45, gradual=True) == pytest.approx(3.0 * tip_width(4.15, gradual=True))
    assert tip_width(1.5, gradual=True) == tip_width(2.015, gradual=True) > 0.0
    assert tip_width(2.015, gradual=False) == tip_width(4.15, gradual=False)


@pytest.mark.parametrize("material", MATERIALS[:5], ids=str)
def test_the_energy_density_is_the_work_of_the_stress(material):
    """Of pure shear, by integrating the force on a patch: an implementation apart from the energy function."""
    sheet, stretches = square(9), np.linspace(1.0, 2.0, 41)
    built = build(sheet, material=material, weights="corrected")
    right = sheet.points[:, 0] > 0.05
    loads = []
    for stretch in stretches:
        force = internal_force(built, uniform(sheet, [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]]))
        loads.append(-force[right, 0].sum() / (0.1 * sheet.thickness))
    assert float(energy_density(material, 2.0, 1.0)) == pytest.approx(np.trapezoid(loads, stretches), rel=2e-3)


@pytest.mark.parametrize("energy", [1e-6, 1e9])
def test_a_spacing_that_cannot_resolve_it_is_one_line(energy):
    line = r"^TearingEnergy\.energy = \S+: expected \S+ to \S+ J/m\^2 at a spacing of 0\.01 m, [^\n]*$"
    with pytest.raises(InputError, match=line):
        build(square(11), damage=TearingEnergy(energy))


def test_a_lock_limits_it():
    """No stretch beyond the lock of a Gent sheet is taken for a critical one."""
    from warp_pd import Gent

    with pytest.raises(InputError, match=r"stretches from 1\.05 to 2\.\d+$"):
        build(square(11), material=Gent(1e3, 1e8, 5.0), damage=TearingEnergy(1e6))


def test_laws_without_an_energy_density_refuse_it():
    sheet = square(9)
    with pytest.raises(InputError, match=r"^damage = TearingEnergy: expected .*BondAssociated.*, got BondBased$"):
        Simulation(sheet, BondBased(Bimodular(1e3)), Explicit(1.0), damage=TearingEnergy(1.0)).build("cpu")


@pytest.mark.parametrize("energy", [0.0, -1.0, float("nan"), "1"])
def test_wrong_energies_are_refused(energy):
    with pytest.raises(InputError, match=r"^TearingEnergy\.energy = "):
        TearingEnergy(energy)


def intact_after_a_step(sheet, damage, gradient):
    """Bits of the bonds that are whole; the law's bonds cannot lose their weight gradually."""
    simulation = Simulation(
        sheet,
        BondAssociated(NEO, weights="published"),
        Explicit(1e-6, frames=1),
        damage=damage,
        initial_displacement=uniform(sheet, gradient),
    )
    built = simulation.run(device="cpu", precision=64).built
    return unpack(array(built, "intact_bonds").numpy().T, built.law.families.members)


def at_once(sheet, stretch):
    """The tearing energy whose critical stretch this is, where bonds break at once."""
    return tip_width(2.015, gradual=False) * sheet.spacing * float(energy_density(NEO, stretch, 1.0))


@pytest.mark.parametrize("stretch", [1.35, 1.45])
def test_bonds_that_break_at_once_have_a_critical_stretch(stretch):
    sheet = square(9)
    gradient = [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]]
    one, other = (
        intact_after_a_step(sheet, damage, gradient)
        for damage in (TearingEnergy(at_once(sheet, 1.4)), CriticalStretch(1.4))
    )
    np.testing.assert_array_equal(one, other)
    assert one.any() and (one.sum() < one.size * 0.6) == (stretch > 1.4)


def test_short_bonds_of_a_cloud_are_not_broken_by_a_roughness():
    """A bond of half a spacing may lengthen by as much as one of a whole spacing."""
    sheet = jittered(11, share=0.3)
    energy = at_once(sheet, 1.4)
    gradient = [[1.45, 0.0], [0.0, 1.45], [0.0, 0.0]]
    families = build(sheet, damage=TearingEnergy(energy)).law.families
    length = np.linalg.norm(families.bonds, axis=-1) * families.horizon
    intact = intact_after_a_step(sheet, TearingEnergy(energy), gradient)
    expected = 0.45 * length <= 0.4 * np.maximum(length, sheet.spacing)
    exists = families.rows_of_points(families.exists)
    np.testing.assert_array_equal(intact[exists], expected[exists])
    assert 0.02 < intact[exists].mean() < 0.5


def test_the_summary_states_the_stretches():
    sheet = square(9)
    loads = [Fixed(sheet.edges("left"))]
    for law, said in ((BondAssociated(NEO), "lose their weight between"), (Nodal(NEO), "for a critical stretch of")):
        simulation = Simulation(sheet, law, Explicit(1e-6, frames=1), damage=TearingEnergy(5.0), loads=loads)
        (note,) = [note for note in simulation.run(device="cpu").summary["notes"] if "tearing energy" in note]
        assert said in note


def test_breaking_takes_energy_and_torn_strips_keep_their_balance():
    """A notched strip torn in two at the default step. A single break may add energy still; all of them take it."""
    sheet = square(15).cut((-0.01, 0.049), (0.04, 0.049))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    rough = np.random.default_rng(0).normal(size=(sheet.size, 3)) * [0.0, 0.0, 1e-5]
    rough[np.concatenate([bottom, top])] = 0.0
    result = Simulation(
        sheet, BondAssociated(TensionField(NEO), horizon=3.15), Explicit(3.0, frames=200, damping=2.0),
        loads=[Fixed(bottom), Motion(top, [0.0, 3.0], x=0.0, y=[0.0, 0.12], z=0.0)],
        damage=CriticalStretch(1.6, spared=np.concatenate([bottom, top])), initial_displacement=rough,
    ).run(device="cpu")  # fmt: skip
    assert result.status == "finished"
    losses = np.diff([row["rupture"] for row in result.history])
    assert losses[losses > 0.0].sum() > -50.0 * losses[losses < 0.0].sum()
    assert result.history[-1]["largest_damage"] > 0.4
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01


def test_a_pure_shear_strip_tears_near_its_tearing_energy():
    """Small and fast: within a third; tools/tears.py measures it."""
    scene = pure_shear_tear.build(points=12, duration=1.0, frames=60, tearing_energy=4.0, overload=2.0, advance=3.0)
    result = scene.run(device="cpu")
    assert result.status == "finished"
    measures = result.summary["measures"]
    assert sum("stands for a critical stretch of" in note for note in result.summary["notes"]) == 1
    assert 0.7 < measures["onset_ratio"]["value"] < 1.35
    assert measures["worst_energy_balance"]["value"] < 0.01


@pytest.mark.parametrize(("argument", "said"), [
    ({"points": 13}, "expected an even number"), ({"material": "steel"}, "material = 'steel'"),
    ({"wrinkles": "yes"}, "wrinkles = 'yes'"), ({"tearing_energy": -1.0}, "tearing_energy = -1.0"),
    ({"overload": 0.0}, "overload = 0.0"), ({"advance": -1.0}, "advance = -1.0"),
])  # fmt: skip
def test_wrong_arguments_of_the_strip_are_named(argument, said):
    with pytest.raises(InputError, match=said):
        pure_shear_tear.build(**argument)
