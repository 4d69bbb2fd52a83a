"""Constants of the bond-based neo-Hookean material: reference forces, refit, traction and energy."""

import numpy as np
import pytest
from hyperelastic_cases import FITS, MODES
from scipy.optimize import brentq

from warp_pd import BondNeoHookean
from warp_pd.papers import bond_neo_hookean as law_of


def test_reference_forces_match_the_theory():
    """Force over c0 at stretch 1: planar A - B = 0.141; uniaxial 2A - B - 4D = -0.020."""
    for fit in FITS:
        assert BondNeoHookean(1.0, "equibiaxial", fit).constants[0] == 0.0
    assert BondNeoHookean(1.0, "planar").constants[0] == pytest.approx(0.1412, abs=1e-4)
    assert 2.0 * BondNeoHookean(1.0, "uniaxial").constants[0] == pytest.approx(-0.0202, abs=1e-4)
    for mode in MODES:
        assert BondNeoHookean(1.0, mode, "refitted").constants[0] == 0.0


STRETCHES = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0)


def traction(p, mode, stretch):
    """Over mu; a uniaxial sheet has its own free width."""
    width = {"equibiaxial": stretch, "planar": 1.0}.get(mode)
    if width is None:
        width = brentq(lambda across: law_of.tractions(p, stretch, across)[1], 0.3, 1.0)
    return law_of.tractions(p, stretch, width)[0]


@pytest.mark.parametrize(
    ("mode", "fit", "least", "most"),
    [
        ("equibiaxial", "published", -1e-9, 1e-9),
        ("planar", "published", 0.07, 0.13),
        ("uniaxial", "published", 0.10, 0.31),
        ("planar", "refitted", -0.01, 0.01),
        ("uniaxial", "refitted", -0.01, 0.01),
    ],
)
def test_how_far_the_traction_is_from_the_exact_one(mode, fit, least, most):
    p = BondNeoHookean(1.0, mode, fit).coefficients
    errors = [traction(p, mode, s) / law_of.exact_traction(mode, s) - 1.0 for s in STRETCHES]
    assert least <= min(errors) and max(errors) <= most
    assert mode == "equibiaxial" or max(map(abs, errors)) > 0.8 * most, "the bounds are tight"


@pytest.mark.parametrize("mode", MODES)
def test_refitted_bonds_pull_more_as_they_lengthen(mode):
    s = np.linspace(0.3, 4.0, 400)
    assert (np.diff(np.array(law_of.REFITTED[mode]) @ law_of.terms(s)) > 0.0).all()


@pytest.mark.parametrize(("mode", "energy"), [("equibiaxial", 29.00391), ("planar", 14.0625), ("uniaxial", 13.5)])
def test_published_constants_have_the_energy_of_the_continuum_at_stretch_4(mode, energy):
    """Over C1: 2 l^2 + l^-4 - 3, l^2 + l^-2 - 2, l^2 + 2/l - 3 (HE eqs. 22, 46 and 66)."""
    across = {"equibiaxial": 4.0, "planar": 1.0, "uniaxial": 0.5}[mode]
    p = BondNeoHookean(1.0, mode).coefficients
    stored = law_of.bond_energy(p, *law_of.deformed(law_of.round_family(), 4.0, across)).mean()
    assert 2.0 * stored == pytest.approx(energy, rel=1.5e-3)
