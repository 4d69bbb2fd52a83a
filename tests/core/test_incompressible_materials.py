"""Incompressible materials against closed forms; a user's material joins by one line in `MATERIALS`."""

import numpy as np
import pytest
from helpers import build, exact_stress, internal_force, rough, square, strain_energy, uniform
from isihara import Isihara
from material_kernels import evaluate, respond, strain

from warp_pd import (
    ArrudaBoyce,
    BondAssociated,
    Carroll,
    Explicit,
    ExtendedTube,
    Fixed,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Simulation,
    TensionField,
    Yeoh,
)

CHAIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


def mooney_rivlin(i1, i2, c10, c01):
    return c10 + 0 * i1, c01 + 0 * i1


def yeoh(i1, i2, c10, c20, c30):
    return c10 + 2 * c20 * (i1 - 3) + 3 * c30 * (i1 - 3) ** 2, 0 * i1


def arruda_boyce(i1, i2, mu, lock):
    return mu * sum((k + 1) * a * i1**k / lock ** (2 * k) for k, a in enumerate(CHAIN)), 0 * i1


def carroll(i1, i2, a, b, c):
    return a + 4 * b * i1**3, c / (2 * np.sqrt(i2))


def isihara(i1, i2, c10, c20, c01):
    return c10 + 2 * c20 * (i1 - 3), c01 + 0 * i1


# Treloar's rubber (Ogden, Proc. R. Soc. A 326 (1972) 565) [Pa].
TRELOAR = Ogden(mu=(0.63e6, 0.0012e6, -0.01e6), exponents=(1.3, 5.0, -2.0))
# A material and the derivatives of its energy by I1 and I2, of (I1, I2, *constants); None stands for `own_stress`.
MATERIALS = [
    (MooneyRivlin(c10=400.0, c01=100.0), mooney_rivlin),
    (MooneyRivlin(c10=500.0), mooney_rivlin),
    (Yeoh(c10=0.1996e6, c20=0.0170e6), yeoh),
    (Yeoh(c10=500.0, c20=-10.0, c30=1.0), yeoh),
    (ArrudaBoyce(mu=1e3, lock=3.0), arruda_boyce),
    (Ogden(mu=(600.0, 12.0), exponents=(1.3, 5.0)), None),
    (Ogden(mu=(1000.0,), exponents=(2.0,)), None),
    (TRELOAR, None),
    (Carroll(a=300.0, b=0.3, c=200.0), carroll),
    (ExtendedTube(gc=600.0, delta=0.1, ge=400.0, beta=0.3), None),
    (ExtendedTube(gc=600.0, delta=0.1, ge=400.0, beta=1e-5), None),
    (Isihara(c10=400.0, c20=5.0, c01=100.0), isihara),
]
each = pytest.mark.parametrize(("material", "slopes"), MATERIALS, ids=lambda m: getattr(m, "__name__", str(m)))
LOADINGS = {
    "uniaxial": lambda stretch: (stretch, stretch**-0.5),
    "equibiaxial": lambda stretch: (stretch, stretch),
    "planar": lambda stretch: (stretch, 1.0),
}


def own_stress(material, stretches):
    """The derivative of the energy by the logarithm of each stretch, for laws that are written in stretches [Pa]."""
    if isinstance(material, Ogden):
        pairs = list(zip(material.mu, material.exponents, strict=True))
        return [sum(mu * np.expm1(a * np.log(stretch)) for mu, a in pairs) for stretch in stretches]
    gc, delta, ge, beta = material.constants
    x = sum(stretch**2 for stretch in stretches) - 3
    slope = gc / 2 * ((1 - delta**2) / (1 - delta**2 * x) ** 2 - delta**2 / (1 - delta**2 * x))
    return [2 * slope * stretch**2 - 2 * ge / beta * np.expm1(-beta * np.log(stretch)) for stretch in stretches]


def nominal_stress(material, slopes, first, second):
    """First Piola stress along the two axes of incompressible plane stress, from textbook formulas [Pa]."""
    third = 1.0 / (first * second)
    if slopes is None:
        *along, across = own_stress(material, (first, second, third))
        return [(own - across) / stretch for own, stretch in zip(along, (first, second), strict=True)]
    i1 = first**2 + second**2 + third**2
    i2 = first**-2 + second**-2 + third**-2
    one, two = slopes(i1, i2, *material.constants)
    return [
        2 * (stretch - third**2 / stretch) * (one + two * other**2)
        for stretch, other in ((first, second), (second, first))
    ]


@each
@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("loading", LOADINGS)
def test_stress_is_that_of_the_closed_form(material, slopes, bits, loading):
    stretches = np.append(np.linspace(0.6, 3.0, 13), 7.0 if material is TRELOAR else 1.0)
    axes = [LOADINGS[loading](stretch) for stretch in stretches]
    G = np.concatenate([strain(np.diag(a)) for a in axes])
    stress, _ = evaluate(material, G, bits)
    expected = np.array([nominal_stress(material, slopes, *a) for a in axes])
    found = np.array(axes) * stress[:, [0, 1], [0, 1]]
    modulus = max(nominal_stress(material, slopes, 1.0 + 1e-6, 1.0)) / 4e-6
    scale = np.abs(expected).max(axis=1, keepdims=True) + modulus
    assert np.abs((found - expected) / scale).max() < (2e-6 if bits == 32 else 1e-13)
    assert np.abs(stress[:, 0, 1] / scale[:, 0]).max() < (2e-6 if bits == 32 else 1e-13)


@each
def test_the_undeformed_state_has_no_stress_and_no_energy(material, slopes):
    for bits in (32, 64):
        stress, energy = evaluate(material, np.zeros((1, 2, 2)), bits)
        assert not stress.any() and not energy.any()


def some_states(seed=0, number=20):
    rng = np.random.default_rng(seed)
    F = np.array([[1.3, 0.1], [0.0, 1.0]]) + rng.uniform(-0.3, 0.3, (number, 2, 2))
    return np.concatenate([strain(f) for f in F])


@each
def test_stress_is_the_derivative_of_the_energy_and_moduli_of_the_stress(material, slopes):
    G, step = some_states(), 1e-5
    stress, _ = evaluate(material, G, 64)
    same, moduli = respond(material, G, 64)
    np.testing.assert_allclose(same, stress, rtol=1e-12, atol=1e-12 * np.abs(stress).max())
    full = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    for column, (m, n) in enumerate(((0, 0), (1, 1), (0, 1))):
        change = np.zeros((2, 2))
        change[m, n] = change[n, m] = step
        (up, psi_up), (down, psi_down) = evaluate(material, G + change, 64), evaluate(material, G - change, 64)
        double = 1.0 if m == n else 2.0
        slope = 2.0 * (psi_up - psi_down) / (2.0 * step * double)
        np.testing.assert_allclose(slope, stress[:, m, n], atol=1e-7 * np.abs(stress).max())
        difference = (up - down) / (2.0 * step)
        found = np.stack([difference[:, 0, 0], difference[:, 1, 1], 2.0 * difference[:, 0, 1]], axis=1)
        np.testing.assert_allclose(moduli[:, full[:, column]], found, atol=1e-7 * np.abs(moduli).max())


@each
@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-6])
def test_float32_keeps_small_strains(material, slopes, size):
    """Stress and energy: the energy too, as no first-order terms cancel in it."""
    G = size * np.array([[[1.0, 0.3], [0.3, -0.5]]])
    wide, wide_energy = evaluate(material, G, 64)
    narrow, narrow_energy = evaluate(material, G.astype(np.float32), 32)
    assert narrow == pytest.approx(wide, rel=2e-5, abs=1e-5 * np.abs(wide).max())
    assert narrow_energy[0] == pytest.approx(wide_energy[0], rel=5e-6)


@each
def test_equal_stretches_have_no_preferred_axes(material, slopes):
    """Principal axes are undetermined there; a turned small difference must not matter."""
    small = 1e-9
    G = np.array([[[0.5, 0.0], [0.0, 0.5]], [[0.5 + small, small], [small, 0.5 - small]]])
    stress, moduli = respond(material, G, 64)
    assert np.isfinite(moduli).all()
    assert stress[1] == pytest.approx(stress[0], rel=1e-7, abs=1e-7 * np.abs(stress[0]).max())
    assert moduli[1] == pytest.approx(moduli[0], rel=1e-6, abs=1e-6 * np.abs(moduli[0]).max())


def test_it_is_the_limit_of_the_slightly_compressible_sheet():
    F = np.array([[1.4, 0.2], [0.0, 1.1]])
    stress, _ = evaluate(MooneyRivlin(c10=500.0), strain(F), 64)
    errors = [
        np.abs(F @ stress[0] - exact_stress(NeoHookean(mu=1e3, bulk=bulk), F)).max() / np.abs(stress).max()
        for bulk in (1e5, 1e6, 1e7)
    ]
    assert errors[0] > 8.0 * errors[1] > 64.0 * errors[2]
    assert errors[2] < 2e-4


def test_a_uniform_state_passes_the_patch_test():
    """Fast and reference kernels, and the exact stress inside the sheet."""
    sheet, (material, slopes) = square(13), MATERIALS[5]
    axes = (1.4, 0.9)
    u = uniform(sheet, np.vstack([np.diag(axes), np.zeros((1, 2))]))
    builts = [build(sheet, material=material, weights="corrected", law={"fast": fast}) for fast in (True, False)]
    assert [built.law.force_path for built in builts] == ["rows", "reference"]
    forces = [internal_force(built, u) for built in builts]
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-10 * np.abs(forces[1]).max())
    expected = np.array(nominal_stress(material, slopes, *axes))
    stress = -forces[0][:, :2].T @ sheet.points / (0.1 * 0.1 * sheet.thickness)
    np.testing.assert_allclose(np.diag(stress), expected, rtol=1e-9)


def test_an_oscillation_keeps_its_energy():
    sheet = square(9)
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 0] = 5.0 * sheet.points[:, 0]
    result = Simulation(
        sheet,
        BondAssociated(ArrudaBoyce(mu=1e3, lock=3.0), horizon=2.015),
        Explicit(0.2, frames=10, safety=0.1),
        loads=[Fixed(sheet.edges("left"))],
        initial_velocity=velocity,
    ).run(device="cpu", precision=32)
    assert result.status == "finished"
    assert max(abs(row["balance_error"]) for row in result.history) < 2e-3


def test_a_third_term_without_modulus_changes_nothing():
    sheet, u = square(7), rough(square(7))
    found = []
    for material in (Ogden((600.0, 12.0), (1.3, 5.0)), Ogden((600.0, 12.0, 0.0), (1.3, 5.0, -2.0))):
        built = build(sheet, material=TensionField(material))
        found.append((strain_energy(built, u), internal_force(built, u)))
    (energy, force), (other, same) = found
    assert energy == pytest.approx(other, rel=1e-12) and energy > 0.0
    np.testing.assert_allclose(force, same, rtol=0.0, atol=1e-12 * np.abs(force).max())
