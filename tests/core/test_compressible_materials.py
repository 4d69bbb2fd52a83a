"""Compressible materials: stress is the derivative of the energy, exact at known states, accurate in float32."""

import numpy as np
import pytest
from helpers import GENT, NEO, exact_stress
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from material_kernels import evaluate, strain

from warp_pd import Gent, NeoHookean

MATERIALS = [NEO, GENT, NeoHookean(1.0, 1.0), NeoHookean(1e3, 1e9), Gent(2.0, 1e6, 10.0)]


@pytest.mark.parametrize("material", MATERIALS, ids=str)
@settings(max_examples=40, deadline=None)
@given(a=st.floats(0.5, 2.0), b=st.floats(0.5, 2.0), shear=st.floats(-0.4, 0.4))
def test_stress_is_the_derivative_of_the_energy(material, a, b, shear):
    F = np.array([[a, shear], [0.0, b]])
    assume((F**2).sum() + 1.0 / np.linalg.det(F) ** 2 - 3.0 < 0.9 * getattr(material, "lock", np.inf))
    G = strain(F)
    stress, _ = evaluate(material, G, 64)
    step = 1e-5
    for m, n in ((0, 0), (0, 1), (1, 1)):
        change = np.zeros((1, 2, 2))
        change[0, m, n] += 0.5 * step
        change[0, n, m] += 0.5 * step
        _, up = evaluate(material, G + change, 64)
        _, down = evaluate(material, G - change, 64)
        # S = 2 dPsi/dC, and the change of an off-diagonal pair counts twice by half.
        slope = 2.0 * (up - down)[0] / (2.0 * step)
        bound = 2e-5 * np.abs(stress).max() + 1e-9 * material.bulk
        assert slope == pytest.approx(stress[0, m, n], abs=bound)


@pytest.mark.parametrize("material", MATERIALS[:3], ids=str)
def test_stress_agrees_with_an_independent_solution(material):
    rng = np.random.default_rng(1)
    states = np.array([[1.4, 0.1], [0.0, 1.1]]) + rng.uniform(-0.5, 0.5, (50, 2, 2))
    states = states[np.linalg.det(states) >= 0.2]
    assert len(states) > 40
    for F in states:
        stress, _ = evaluate(material, strain(F), 64)
        assert F @ stress[0] == pytest.approx(exact_stress(material, F), rel=1e-9, abs=1e-9 * material.mu)


@settings(max_examples=60, deadline=None)
@given(
    bulk=st.floats(0.0, 6.0), lock=st.floats(0.0, 2.5), a=st.floats(0.25, 6.0), b=st.floats(0.25, 6.0),
    share=st.floats(0.0, 0.999),
)  # fmt: skip
def test_gent_finds_its_stress_up_to_the_lock(bulk, lock, a, b, share):
    """Any K / mu, any Jm, scaled back to a state with less than 99.9 % of the lock at constant volume."""

    def excess(scale):
        x, y = 1.0 + scale * (a - 1.0), 1.0 + scale * (b - 1.0)
        return x**2 + y**2 + 1.0 / (x * y) ** 2 - 3.0

    material = Gent(mu=1.0, bulk=10.0**bulk, lock=10.0**lock)
    scale = 1.0
    while excess(scale) > share * material.lock and scale > 1e-3:
        scale *= 0.95
    F = np.diag([1.0 + scale * (a - 1.0), 1.0 + scale * (b - 1.0)])
    stress, _ = evaluate(material, strain(F), 64)
    expected = exact_stress(material, F)
    assert F @ stress[0] == pytest.approx(expected, rel=1e-6, abs=1e-7 + 1e-9 * material.bulk)


def test_nearly_incompressible_uniaxial_stress():
    material = NeoHookean(mu=1e3, bulk=1e8)
    for stretch in (0.7, 1.5, 3.0):
        F = np.diag([stretch, stretch**-0.5])
        stress, _ = evaluate(material, strain(F), 64)
        assert stretch * stress[0, 0, 0] == pytest.approx(1e3 * (stretch - stretch**-2), rel=1e-4)
        assert abs(stress[0, 1, 1]) < 2e-4 * abs(stress[0, 0, 0])


@pytest.mark.parametrize("material", [NEO, GENT], ids=str)
@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-5])
def test_float32_keeps_small_strains(material, size):
    G = size * np.array([[[1.0, 0.3], [0.3, -0.5]]])
    wide, wide_energy = evaluate(material, G, 64)
    narrow, narrow_energy = evaluate(material, G.astype(np.float32), 32)
    assert narrow == pytest.approx(wide, rel=2e-5, abs=2e-5 * np.abs(wide).max())
    # Psi is a small difference of first-order terms: its relative error grows as round-off over strain.
    assert narrow_energy[0] == pytest.approx(wide_energy[0], rel=2e-6 + 2e-6 / size)


@pytest.mark.parametrize("bits", [32, 64])
def test_gent_lock_has_no_stress(bits):
    material = Gent(mu=1e3, bulk=1e9, lock=5.0)
    below, above = strain(np.diag([2.0, 1.2])), strain(np.diag([3.5, 1.0]))
    stress, energy = evaluate(material, np.concatenate([below, above]), bits)
    assert np.isfinite(stress[0]).all() and np.isfinite(energy[0])
    assert np.isnan(stress[1]).any() and np.isnan(energy[1])


@pytest.mark.parametrize("material", [m for m in MATERIALS if isinstance(m, NeoHookean)], ids=str)
def test_extreme_states_stay_finite(material):
    states = np.concatenate([strain(np.diag([a, b])) for a in (0.05, 0.3, 1.0, 2.0) for b in (0.05, 0.3, 1.0)])
    stress, energy = evaluate(material, states, 64)
    assert np.isfinite(stress).all() and np.isfinite(energy).all()
