"""Constants of Prony terms and Maxwell elements from uniform tests at several rates."""

from pathlib import Path

import numpy as np
import pytest

from warp_pd import InputError, Maxwell, NeoHookean, Prony, Visco, Yeoh
from warp_pd.fitting import Curve, RateTests, fit, nominal_stress, rate_stress, read_table

DATA = Path(__file__).parents[1] / "references" / "vhb.csv"
# VE table 1 and the rates of its figure 2.
PRINTED = {"c10": 0.1438e6, "c20": 0.1438e6, "v10": 0.0587e6, "v20": 0.0562e6, "time": 0.8673, "exponent": 0.1}
RATES = (0.0, 0.24, 0.88)
STRETCH = np.linspace(0.95, 0.4, 12)
SECTION = 1e-5


def prony(c10, c20, v10, v20, time, exponent):
    return Visco(Yeoh(c10, c20), prony=[Prony(v10, v20, time, exponent)])


def maxwell(mu, m1, m2, m3):
    branches = [Maxwell(m, time) for m, time in zip((m1, m2, m3), (1.0, 10.0, 100.0), strict=True)]
    return Visco(NeoHookean(mu, 1e3 * mu), branches=branches)


def test_printed_constants_are_found_again_from_curves_at_their_rates():
    tests = [Curve("uniaxial", STRETCH, "stress", rate_stress(prony(**PRINTED), "uniaxial", r, STRETCH)) for r in RATES]
    start = {"c10": 1e5, "c20": 1e5, "v10": 1e5, "v20": 1e4, "time": 1.0, "exponent": 0.3}
    found = fit(RateTests(prony, tests, rates=RATES), list(PRINTED), start=start)
    assert found.estimates == pytest.approx(PRINTED, rel=1e-6)


@pytest.mark.parametrize("loading", ["uniaxial", "equibiaxial", "planar"])
def test_a_fast_branch_is_a_spring_and_a_slow_one_nothing(loading):
    law = Visco(NeoHookean(1e5, 1e9), branches=[Maxwell(5e4, 2.0)])
    stretch = np.linspace(1.1, 2.0, 5)
    network = nominal_stress(law.material, loading, stretch)
    assert rate_stress(law, loading, 1e6, stretch) == pytest.approx(1.5 * network, rel=1e-3)
    assert rate_stress(law, loading, 1e-6, stretch) == pytest.approx(network, rel=1e-3)
    assert rate_stress(law, loading, 0.0, stretch) == pytest.approx(network)


def test_moduli_from_two_rates_foretell_a_third():
    """Strips of an acrylic; two runs of one test differ by 3 to 7 %."""
    columns = read_table(DATA).columns
    stretch = columns["stretch"][np.isfinite(columns["stretch"])]
    curves = {
        name: Curve("uniaxial", stretch, "stress", columns[name][: len(stretch)] / SECTION)
        for name in ("slow", "middle", "fast")
    }
    tests = RateTests(maxwell, [curves["slow"], curves["fast"]], rates=(0.01, 0.05))
    moduli = ["mu", "m1", "m2", "m3"]
    found = fit(tests, moduli, start=dict.fromkeys(moduli, 2e4), bounds=dict.fromkeys(moduli, (1.0, np.inf)))
    foretold = rate_stress(maxwell(**found.estimates), "uniaxial", 0.03, stretch)
    assert np.median(np.abs(foretold / curves["middle"].values - 1.0)) < 0.05


def test_wrong_rates_and_ramps_are_refused():
    curve = Curve("uniaxial", STRETCH, "stress", STRETCH)
    with pytest.raises(InputError, match="rates: expected one for each of 1 tests, got 0"):
        RateTests(prony, [curve])
    with pytest.raises(InputError, match="rates = -1"):
        RateTests(prony, [curve], rates=(-1,))
    with pytest.raises(InputError, match="all above 1 or all below 1"):
        rate_stress(prony(**PRINTED), "uniaxial", 1.0, np.array([0.9, 1.1]))
