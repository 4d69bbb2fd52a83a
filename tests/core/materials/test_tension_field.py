"""Relaxed energy of tension field theory: stress, moduli and width against their definitions."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from helpers import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from isihara import Isihara
from material_kernels import evaluate, respond

from warp_pd import ArrudaBoyce, Bimodular, Gent, MooneyRivlin, NeoHookean, Ogden, TensionField, Yeoh
from warp_pd.materials import capabilities, with_wrinkles
from warp_pd.materials.energy import tension_energy_density


@dataclass(frozen=True)
class Bare:
    """A material of a user who gives no more than a law asks for: its width is found by a search."""

    base: object
    isotropic: ClassVar[bool] = True

    @property
    def constants(self):
        return self.base.constants

    @property
    def functions(self):
        return self.base.functions


MATERIALS = [
    NeoHookean(1e3, 1e5),
    NeoHookean(1e3, 700.0),
    NeoHookean(1e3, 300.0),
    Gent(1e3, 1e5, 20.0),
    Gent(1e3, 2e3, 5.0),
    MooneyRivlin(400.0, 100.0),
    Yeoh(500.0, -10.0, 1.0),
    ArrudaBoyce(1e3, 3.0),
    Ogden((600.0, 12.0), (1.3, 5.0)),
    Isihara(c10=400.0, c20=5.0, c01=100.0),
    Bare(NeoHookean(1e3, 2e3)),
    Bare(NeoHookean(1e3, 300.0)),
    Bare(Ogden((600.0, 12.0), (1.3, 5.0))),
]
each = pytest.mark.parametrize("material", MATERIALS, ids=str)


def turned(first, second, angle):
    """G = C - I of principal stretches, the first at an angle to x, shape (n, 2, 2)."""
    first, second, angle = np.broadcast_arrays(first, second, angle)
    c, s = np.cos(angle), np.sin(angle)
    axes = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    values = np.zeros((*first.shape, 2, 2))
    values[..., 0, 0], values[..., 1, 1] = (first - 1) * (first + 1), (second - 1) * (second + 1)
    return axes @ values @ axes.swapaxes(-1, -2)


def widths(material, stretch):
    """Width in uniaxial tension, from the stress alone, by halving in float64."""
    low, high = np.full_like(stretch, 0.05), np.maximum(stretch, 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        pressed = evaluate(material, turned(stretch, middle, 0.0), 64)[0][:, 1, 1] < 0.0
        low, high = np.where(pressed, middle, low), np.where(pressed, high, middle)
    return middle


@each
@pytest.mark.parametrize("bits", [32, 64])
def test_states_are_told_apart(material, bits):
    """Taut sheets keep their stress bit for bit; wrinkled ones have that of uniaxial tension; slack ones none."""
    stretch, angle = np.linspace(1.02, 1.9, 9), np.linspace(0.0, 3.0, 9)
    width = widths(material, stretch)
    relaxed = TensionField(material)
    taut = turned(stretch, width + 0.5 * (stretch - width), angle)
    for found, own in zip(evaluate(relaxed, taut, bits), evaluate(material, taut, bits), strict=True):
        np.testing.assert_array_equal(found, own)
    stress, energy = evaluate(relaxed, turned(stretch, 0.6 * width, angle), bits)
    uniaxial, stored = evaluate(material, turned(stretch, width, angle), 64)
    tolerance = 1e-11 if bits == 64 else 3e-5
    np.testing.assert_allclose(stress, uniaxial, atol=tolerance * np.abs(uniaxial).max())
    np.testing.assert_allclose(energy, stored, rtol=tolerance, atol=tolerance)
    assert np.abs(uniaxial).max() > 10.0
    for part in evaluate(relaxed, turned(0.4 + 0.3 * (stretch - 1.0), 0.3, angle), bits):
        np.testing.assert_array_equal(part, 0.0)


@each
@pytest.mark.parametrize("bits", [32, 64])
def test_small_strains_keep_their_digits(material, bits):
    """A sheet pulled by 1e-6 and squeezed as much: stress along the pull is E times strain, E from the stress."""
    G = turned(1.0 + 1e-6, 1.0 - 1e-6, np.array([0.3]))
    found = evaluate(TensionField(material), G, bits)[0]
    width = widths(material, np.array([1.0 + 1e-6]))
    exact = evaluate(material, turned(1.0 + 1e-6, width, np.array([0.3])), 64)[0]
    np.testing.assert_allclose(found, exact, atol=(1e-5 if bits == 32 else 1e-7) * np.abs(exact).max())


@each
@settings(max_examples=40, deadline=None)
@given(first=st.floats(0.5, 1.9), second=st.floats(0.15, 1.9), angle=st.floats(0.0, 3.2))
def test_stress_is_twice_the_gradient_of_the_energy(material, first, second, angle):
    """Everywhere, also across the borders of the states; and no principal stress is negative."""
    relaxed, G = TensionField(material), turned(first, second, angle)
    h, directions = 1e-5, np.array([[[1.0, 0], [0, 0]], [[0, 0], [0, 1.0]], [[0, 0.5], [0.5, 0]]])
    stress = evaluate(relaxed, G[None], 64)[0][0]
    energies = evaluate(relaxed, np.concatenate([G + h * directions, G - h * directions]), 64)[1]
    slopes = (energies[:3] - energies[3:]) / h
    np.testing.assert_allclose(slopes, [stress[0, 0], stress[1, 1], stress[0, 1]], atol=0.03, rtol=1e-6)
    assert np.linalg.eigvalsh(stress).min() > -1e-7 * max(np.abs(stress).max(), 1.0)


@pytest.mark.parametrize("material", [m for m in MATERIALS if capabilities(m).response], ids=str)
def test_moduli_are_the_change_of_the_stress(material):
    """Taut, wrinkled and slack, away from the borders of the states."""
    stretch, angle = np.array([1.05, 1.4, 1.8, 1.3, 1.6, 0.9]), np.linspace(0.0, 2.5, 6)
    narrow = np.where(np.arange(6) < 3, 1.3, 0.7) * widths(material, stretch)
    G, relaxed = turned(stretch, narrow, angle), TensionField(material)
    stress, moduli = respond(relaxed, G, 64)
    alone = evaluate(relaxed, G, 64)[0]
    np.testing.assert_allclose(stress, alone, atol=1e-12 * np.abs(alone).max())
    h = 1e-5
    moduli = moduli[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    for column, direction in enumerate(([[1.0, 0], [0, 0]], [[0, 0], [0, 1.0]], [[0, 1.0], [1.0, 0]])):
        change = h * np.array(direction)
        difference = evaluate(relaxed, G + change, 64)[0] - evaluate(relaxed, G - change, 64)[0]
        slopes = np.stack([difference[:, 0, 0], difference[:, 1, 1], 2 * difference[:, 0, 1]], -1) / (2 * h)
        atol = 2e-6 * np.abs(slopes).max()
        np.testing.assert_allclose(moduli[..., column], slopes, atol=atol)


@pytest.mark.parametrize("bits", [32, 64])
def test_a_slack_stiffness_is_added_to_stress_energy_and_moduli(bits):
    """k G, k G : G / 4, and k for each component of G, taut, wrinkled and slack."""
    material, k = Gent(1e3, 1e5, 20.0), 30.0
    G = turned(np.array([1.3, 1.3, 0.9, 1e-3]), np.array([1.1, 0.5, 0.5, 1e-3]), np.array([0.2, 0.7, 1.3, 0.0]))
    relaxed, kept = TensionField(material), TensionField(material, slack_stiffness=k)
    tolerance = {"rtol": 1e-6 if bits == 32 else 1e-12, "atol": (1e-6 if bits == 32 else 1e-13) * 1e3}
    (stress, energy), (kept_stress, kept_energy) = (evaluate(m, G, bits)[:2] for m in (relaxed, kept))
    np.testing.assert_allclose(kept_stress - stress, k * G, **tolerance)
    np.testing.assert_allclose(kept_energy - energy, 0.25 * k * (G**2).sum(axis=(1, 2)), **tolerance)
    moduli = respond(kept, G, bits)[1] - respond(relaxed, G, bits)[1]
    np.testing.assert_allclose(moduli, np.tile([k, 0.0, 0.0, k, 0.0, 2.0 * k], (4, 1)), **tolerance)


@pytest.mark.parametrize("bits", [32, 64])
def test_the_search_finds_the_width_of_the_closed_form(bits):
    """A material with and without its own width has the same relaxed stress."""
    G = turned(np.linspace(1.001, 5.0, 30), 0.3, np.linspace(0.0, 3.0, 30))
    for material in (NeoHookean(1e3, 1e5), Gent(1e3, 1e4, 60.0), Yeoh(500.0, 20.0)):
        known, found = (evaluate(TensionField(m), G, bits)[0] for m in (material, Bare(material)))
        np.testing.assert_allclose(found, known, atol=(1e-5 if bits == 32 else 1e-9) * np.abs(known).max())


def test_beyond_the_lock_a_wrinkled_sheet_swells_as_the_sheet_itself_does():
    """A Gent sheet beyond the stretch at which it locks at constant volume; the search knows no lock."""
    material, stretch = Gent(1e3, 1e5, 5.0), np.array([2.6, 3.0, 3.5])
    relaxed, found = (evaluate(TensionField(m), turned(stretch, 0.2, 0.4), 64)[0] for m in (material, Bare(material)))
    np.testing.assert_allclose(relaxed, found, rtol=1e-8)
    assert relaxed[-1, 0, 0] > 3e4


def test_energy_in_tension_is_that_of_the_width_which_tension_makes():
    """Mooney-Rivlin in uniaxial tension, also beyond a stretch of 4."""
    stretch = np.array([1.1, 2.0, 6.0])
    exact = 400.0 * (stretch**2 + 2.0 / stretch - 3.0) + 100.0 * (2.0 * stretch + stretch**-2 - 3.0)
    found = tension_energy_density(with_wrinkles(MooneyRivlin(400.0, 100.0), "relaxed"), stretch, "cpu")
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    assert with_wrinkles(MooneyRivlin(400.0, 100.0), "resolved") == MooneyRivlin(400.0, 100.0)


@pytest.mark.parametrize(
    ("material", "said"),
    [
        (TensionField(NeoHookean(1.0, 1.0)), "expected a material that resists compression"),
        (Bimodular(1.0), r"expected a material such as NeoHookean\(mu, bulk\)"),
        (3.0, r"expected a material such as NeoHookean\(mu, bulk\)"),
    ],
)
def test_wrong_materials_are_refused(material, said):
    with refused(match=said):
        TensionField(material)


def test_a_negative_slack_stiffness_is_refused():
    with refused(match=r"^TensionField.slack_stiffness = -1.0: expected"):
        TensionField(NeoHookean(1.0, 1.0), slack_stiffness=-1.0)


def test_an_anisotropic_material_is_refused():
    material = Bare(NeoHookean(1.0, 1.0))
    anisotropic = type("Fibres", (), {"constants": (1.0,), "functions": material.functions})()
    with refused(match=r"^TensionField.material = Fibres: expected an isotropic material"):
        TensionField(anisotropic)
