"""Identification recovers constants from curves made with them, noise included."""

import sys
from pathlib import Path

import numpy as np
import pytest

from warp_pd import InputError

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))

from identify_material import RATES, TABLES, Curve, identify, made, model, read

each = pytest.mark.parametrize("name", TABLES)


@each
def test_constants_are_recovered(name):
    found = identify(made(TABLES[name], RATES[name], noise=0.0))
    np.testing.assert_allclose(found, TABLES[name], rtol=1e-4)


@each
def test_noise_leaves_the_curves_where_they_are(name):
    """Equilibrium constants within half a per cent, and every curve; the viscous constants of one term trade off."""
    wanted = np.array(TABLES[name])
    for seed in (0, 1):
        found = identify(made(wanted, RATES[name], noise=0.002, seed=seed))
        np.testing.assert_allclose(found[:2], wanted[:2], rtol=5e-3)
        np.testing.assert_allclose(found[2:], wanted[2:], rtol=0.35)
        for curve in made(wanted, RATES[name], noise=0.0):
            off = np.abs(model(found, curve, "uniaxial") - curve.stress).max()
            assert off < 0.002 * np.abs(curve.stress).max()


def test_a_file_is_read_and_fitted(tmp_path):
    wanted = TABLES["table 1, high-damping rubber"]
    rates = (0.0, 0.24, 0.88)
    lines = ["rate,stretch,stress"]
    for rate, curve in zip(rates, made(wanted, rates, 0.0, furthest=0.6), strict=True):
        lines += [f"{rate},{s:.17g},{p:.17g}" for s, p in zip(curve.stretch, curve.stress, strict=True)]
    path = tmp_path / "data.csv"
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(identify(read(path)), wanted, rtol=1e-3)


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "stretch,stress,rate\n1,x,1\n", "stretch,stress,rate\n1,0,1\n"])
def test_a_wrong_file_is_refused(text, tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError, match="allowed"):
        read(path)


def test_equilibrium_alone_says_nothing_about_time():
    with pytest.raises(InputError, match="equilibrium"):
        identify([Curve(None, np.linspace(1, 2, 9), np.linspace(0, 1, 9))])
