"""Identification recovers constants from curves made with them, noise included."""

import numpy as np
import pytest
from identify_material import RATES, TABLES, Curve, identify, model, read, synthetic

from warp_pd import InputError

each = pytest.mark.parametrize("name", TABLES)


@each
def test_constants_are_recovered(name):
    found = identify(synthetic(TABLES[name], RATES[name], noise=0.0))
    np.testing.assert_allclose(found, TABLES[name], rtol=1e-4)


@each
def test_noise_leaves_the_curves_where_they_are(name):
    """Equilibrium constants within half a per cent, and every curve; the viscous constants of one term trade off."""
    wanted = np.array(TABLES[name])
    for seed in (0, 1):
        found = identify(synthetic(wanted, RATES[name], noise=0.002, seed=seed))
        np.testing.assert_allclose(found[:2], wanted[:2], rtol=5e-3)
        np.testing.assert_allclose(found[2:], wanted[2:], rtol=0.35)
        for curve in synthetic(wanted, RATES[name], noise=0.0):
            off = np.abs(model(found, curve, "uniaxial") - curve.stress).max()
            assert off < 0.002 * np.abs(curve.stress).max()


def test_a_file_is_read_and_fitted(tmp_path):
    wanted = TABLES["table 1, high-damping rubber"]
    rates = (0.0, 0.24, 0.88)
    lines = ["rate,stretch,stress"]
    for rate, curve in zip(rates, synthetic(wanted, rates, 0.0, last_stretch=0.6), strict=True):
        lines += [f"{rate},{s:.17g},{p:.17g}" for s, p in zip(curve.stretch, curve.stress, strict=True)]
    path = tmp_path / "data.csv"
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(identify(read(path)), wanted, rtol=1e-3)


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "stretch,stress,rate\n1,x,1\n", "stretch,stress,rate\n1,0,1\n"])
def test_a_wrong_file_is_refused(text, tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError, match="expected"):
        read(path)


def test_equilibrium_alone_says_nothing_about_time():
    with pytest.raises(InputError, match="equilibrium"):
        identify([Curve(None, np.linspace(1, 2, 9), np.linspace(0, 1, 9))])
