"""Units: factors to SI agree with each other."""

import pytest

from warp_pd import units


def test_factors_agree():
    assert units.MPa == pytest.approx(1e-3 * units.kN / units.mm**2)
    assert units.bar == pytest.approx(1e3 * units.mbar)
    assert units.psi == pytest.approx(0.45359237 * 9.80665 / units.inch**2)
    assert units.kJ_per_m2 == pytest.approx(units.N_per_mm)
    assert units.g_per_cm3 == pytest.approx(units.g / units.cm**3)
    assert units.mJ == pytest.approx(units.mN * 1.0)
    assert units.hour == 60.0 * units.minute
    assert 180.0 * units.degree == pytest.approx(3.141592653589793)
