"""Wrinkles of a stretched strip by its tension field: where they are, and their wavelength."""

import numpy as np
import pytest
from wrinkle_envelope import envelope, over_half_sine


def test_a_half_sine_has_the_wavelength_of_cerda_and_mahadevan():
    place = np.linspace(0.0, 0.3, 401)
    assert over_half_sine(place, 0.1 * np.sin(np.pi * place / 0.3)) == pytest.approx(1.0, abs=1e-3)


def test_shorter_wrinkles_have_shorter_waves():
    """Half the length: the wavelength is that of the root of a half."""
    place = np.linspace(0.0, 0.3, 4001)
    inside = np.clip((place - 0.075) / 0.15, 0.0, 1.0)
    assert over_half_sine(place, np.sin(np.pi * inside)) == pytest.approx(0.5**0.5, rel=2e-3)


def test_wrinkles_of_the_strip_end_before_its_clamps():
    place, slope = envelope(41)
    x = place / place[-1]
    assert slope[(x < 0.15) | (x > 0.85)].max() < 0.3 * slope.max()
    assert slope.max() == pytest.approx(0.098, abs=0.005) and abs(x[slope.argmax()] - 0.5) < 0.03
    assert over_half_sine(place, slope) < 0.9
