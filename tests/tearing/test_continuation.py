"""Materials continued beyond the strength of a damage field: the same up to it, without stiffening beyond."""

import numpy as np
import pytest
from helpers import NEO, refused, square
from isihara import Isihara
from material_kernels import evaluate, respond

from warp_pd import (
    ArrudaBoyce,
    BondAssociated,
    ByRegion,
    Explicit,
    Fixed,
    Gent,
    MooneyRivlin,
    Ogden,
    Simulation,
    TearingEnergy,
    TensionField,
    Yeoh,
)
from warp_pd.materials import capabilities, energy_density, stretch_of_density
from warp_pd.tearing.continuation import continued

LOCKING = Gent(mu=1e3, bulk=100e3, lock=8.0)
OTHERS = [
    Ogden((700.0, 12.0), (1.8, 4.0)), Isihara(c10=400.0, c20=20.0, c01=100.0), MooneyRivlin(400.0, 100.0)
]  # fmt: skip
CHANGED = [Yeoh(500.0, 20.0), Yeoh(300.0, 10.0, 5.0), ArrudaBoyce(1e3, 3.0), LOCKING, *OTHERS]
each = pytest.mark.parametrize("material", CHANGED, ids=lambda m: f"{type(m).__name__}{len(m.constants)}")
STRENGTH, YEOH = 700.0, TensionField(Yeoh(500.0, 20.0))
MODES = {"uniaxial": lambda l: l**-0.5, "planar": lambda l: 1.0 + 0.0 * l, "equibiaxial": lambda l: l}


def strains(stretches, angle=0.4):
    """G = C - I of pairs of principal stretches, in turned axes."""
    first, second = np.transpose(stretches)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    squares = np.zeros((len(first), 2, 2))
    squares[:, 0, 0], squares[:, 1, 1] = first**2 - 1.0, second**2 - 1.0
    return turn @ squares @ turn.T


def reached(material, mode):
    """Stretch at which a mode reaches the strength."""
    density = lambda l: energy_density(material, l, MODES[mode](l))  # noqa: E731
    return stretch_of_density(density, STRENGTH, np.linspace(1.0, 2.9, 400))


@each
@pytest.mark.parametrize("bits", [32, 64])
def test_nothing_changes_below_the_strength(material, bits):
    changed = continued(material, STRENGTH)
    assert changed != material
    stretches = [(f, s) for f in np.linspace(0.7, 1.8, 23) for s in np.linspace(0.7, 1.8, 23)]
    below = [pair for pair in stretches if energy_density(material, *pair) < 0.99 * STRENGTH]
    assert len(below) > 100
    for found, wanted in zip(
        evaluate(changed, strains(below), bits), evaluate(material, strains(below), bits), strict=True
    ):
        np.testing.assert_allclose(
            found, wanted, rtol=0.0, atol=4.0 * np.finfo(f"f{bits // 8}").eps * np.abs(wanted).max()
        )


@each
@pytest.mark.parametrize("mode", MODES)
def test_the_strength_is_the_same_in_every_mode(material, mode):
    stretch = reached(material, mode)
    changed = continued(material, STRENGTH)
    assert energy_density(changed, stretch, MODES[mode](np.array(stretch))) == pytest.approx(STRENGTH, rel=1e-2)


@each
def test_stress_and_moduli_are_derivatives_across_the_strength(material):
    changed = continued(material, STRENGTH)
    pairs = []
    for mode, width in MODES.items():
        for first in reached(material, mode) * np.array([0.9, 1.02, 1.3, 2.0]):
            second = float(width(first))
            pairs.append((first, second if first - second > 1e-3 else 0.97 * first))
    G, step = strains(pairs), 1e-6
    stress, _ = evaluate(changed, G, 64)
    again, moduli = respond(changed, G, 64)
    np.testing.assert_allclose(again, stress, rtol=1e-9)
    for n, direction in enumerate([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]]):
        ahead, behind = (evaluate(changed, G + sign * step * np.array(direction), 64) for sign in (1.0, -1.0))
        slope = (ahead[1] - behind[1]) / (2.0 * step)
        work = 0.5 * (stress * np.array(direction)).sum(axis=(1, 2))
        np.testing.assert_allclose(slope, work, rtol=1e-6, atol=1e-6 * np.abs(work).max())
        bend = (ahead[0] - behind[0]) / (2.0 * step)
        found = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])[n]
        wanted = np.stack([bend[:, 0, 0], bend[:, 1, 1], 2.0 * bend[:, 0, 1]], axis=1)
        np.testing.assert_allclose(moduli[:, found], wanted, rtol=2e-4, atol=1e-4 * np.abs(moduli).max())


@each
def test_beyond_the_strength_the_energy_grows_with_the_first_invariant(material):
    changed = continued(material, STRENGTH)
    stretch = reached(material, "planar") * np.array([1.05, 1.5, 2.0, 3.0, 5.0])
    density, excess = energy_density(changed, stretch, 1.0), (stretch - 1.0 / stretch) ** 2
    slopes = np.diff(density) / np.diff(excess)
    # Exactly for a function of I1 alone; a mapped energy has a slope that is linear between its knots.
    # Gent rubber thickens less than an incompressible sheet.
    mapped = isinstance(material, (*map(type, OTHERS), Gent))
    assert slopes.max() / slopes.min() < (1.1 if mapped else 1.01)


@pytest.mark.parametrize("material", OTHERS, ids=lambda m: type(m).__name__)
def test_far_beyond_the_strength_energy_is_that_of_one_neo_hookean_sheet(material):
    """A material that knows more than I1 is softer along a tear than across it, and widens it."""
    changed, stretch = continued(material, STRENGTH), np.array([8.0, 10.0])
    moduli = []
    for width in MODES.values():
        first, second = stretch, width(stretch)
        excess = first**2 + second**2 + (first * second) ** -2.0 - 3.0
        moduli.append(float(np.diff(energy_density(changed, first, second))[0] / np.diff(excess)[0]))
    assert max(moduli) / min(moduli) < 1.05


@each
@pytest.mark.parametrize("bits", [32, 64])
def test_a_tension_field_of_it_wrinkles_at_the_same_width(material, bits):
    changed, wide = TensionField(continued(material, STRENGTH)), TensionField(material)
    pairs = [(1.3, 0.6), (1.6, 0.75), (1.9, 0.5)]
    small, large = (evaluate(each, strains(pairs), bits) for each in (changed, wide))
    for stress in (small[0], large[0]):
        assert np.abs(np.linalg.eigvalsh(stress)[:, 0]).max() < 2e-3 * np.abs(stress).max()
    assert np.isfinite(evaluate(changed, strains([(6.0, 0.5), (6.0, 5.0)]), bits)[0]).all()


@pytest.mark.parametrize("material", [NEO, MooneyRivlin(400.0), TensionField(NEO)])
def test_rubber_that_does_not_stiffen_is_left_alone(material):
    assert continued(material, STRENGTH) == material


def test_every_region_is_continued():
    given = ByRegion(
        TensionField(Yeoh(500.0, 20.0)), [(np.arange(4), TensionField(LOCKING)), (np.arange(5, 9), TensionField(NEO))]
    )
    found = continued(given, STRENGTH)
    first, second, third = (each.material for each in found.materials)
    assert [type(first).__name__, type(second).__name__, third] == ["ContinuedInvariant", "ContinuedGent", NEO]
    assert capabilities(found).response is not None


def test_a_damage_field_continues_the_material_from_its_strength():
    def scene(damage, material=YEOH):
        return Simulation(square(9), BondAssociated(material), Explicit(1.0), damage=damage).build("cpu", 64)

    built = scene(TearingEnergy(10.0))
    limit = built.rupture.limit
    found = built.law.material.material
    assert energy_density(YEOH.material, stretch := 1.0 + 0.5 * found.excess**0.5, 1.0) > 0.0 and stretch > 1.0
    planar = np.roots([1.0, 0.0, -2.0 - found.excess, 0.0, 1.0]).real.max()
    assert energy_density(YEOH.material, planar, 1.0) == pytest.approx(limit, rel=1e-6)
    assert scene(TearingEnergy(10.0, stiffens=True)).law.material == YEOH
    assert scene(None).law.material == YEOH
    with refused(match="TearingEnergy.stiffens = 'no'"):
        TearingEnergy(10.0, stiffens="no")


def test_weak_seams_leave_strong_material_as_it_is():
    energies = np.where(square(9).points[:, 0] > 0.05, 10.0, 5.0)
    built = Simulation(square(9), BondAssociated(YEOH), Explicit(1.0), damage=TearingEnergy(energies)).build("cpu")
    uniform = Simulation(square(9), BondAssociated(YEOH), Explicit(1.0), damage=TearingEnergy(10.0)).build("cpu")
    assert built.law.material == uniform.law.material


@pytest.mark.parametrize(
    ("material", "precision"), [(YEOH, 32), (YEOH, 64), (TensionField(MooneyRivlin(400.0, 100.0)), 32)]
)
def test_a_sheet_just_below_its_strength_keeps_its_bits(material, precision):
    sheet, ends = square(9), []
    sides = sheet.edges("left", "right")
    for stiffens in (False, True):
        damage = TearingEnergy(10.0, spared=sides, stiffens=stiffens)
        free = Simulation(sheet, BondAssociated(material), Explicit(1.0), damage=damage)
        strength = 0.99 * free.build("cpu").rupture.limit
        stretch = stretch_of_density(lambda l: energy_density(material, l, 1.0), strength, np.linspace(1.0, 3.0, 200))
        scene = Simulation(
            sheet, BondAssociated(material), Explicit(0.02, frames=2, precision=precision),
            loads=[Fixed(sides), Fixed(sheet.edges("bottom", "top"), "y")], damage=damage,
            initial_displacement=np.outer(sheet.points[:, 0], [stretch - 1.0, 0.0, 0.0]),
        )  # fmt: skip
        ends.append(scene.run(device="cpu"))
    first, second = (end.frame.displacement for end in ends)
    assert np.array_equal(first, second) and np.abs(first).max() > 1e-3
    assert ends[0].history[-1]["largest_damage"] == 0.0
    np.testing.assert_equal([row["strain"] for row in ends[0].history], [row["strain"] for row in ends[1].history])


def test_a_gent_sheet_goes_on_from_where_its_energy_of_constant_volume_is_the_strength():
    """-mu Jm / 2 log(1 - (I1 - 3) / Jm), so nothing is changed below the strength."""
    material, strength = Gent(mu=1e3, bulk=1e5, lock=160.0), 3e4
    excess = continued(material, strength).excess
    assert -0.5 * material.mu * material.lock * np.log1p(-excess / material.lock) == pytest.approx(strength, rel=1e-12)
