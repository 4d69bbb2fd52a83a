"""Incompressible materials: the constants that they refuse, and the material of the documentation."""

import re
from dataclasses import dataclass
from pathlib import Path

import isihara
import numpy as np
import pytest
from helpers import GENT, NEO, refused

from warp_pd import (
    ArrudaBoyce,
    BondAssociated,
    ByRegion,
    Carroll,
    ExtendedTube,
    MooneyRivlin,
    Ogden,
    TensionField,
    Yeoh,
)
from warp_pd.materials import capabilities, energy_density, stability_notes, stable_to


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: MooneyRivlin(0.0, 1.0), r"^c10 = 0\.0: expected a positive number$"),
        (lambda: Yeoh(-1.0), r"^c10 = -1\.0: expected a positive number$"),
        (lambda: ArrudaBoyce(1.0, 1.0), r"^lock = 1\.0: .* a stretch greater than 1$"),
        (
            lambda: Ogden((1.0,), (2.0, 3.0)),
            r"^mu = \(1\.0,\) with exponents = .* equal numbers of both, at least one$",
        ),
        (lambda: Ogden((), ()), r"^mu = \(\) with exponents = \(\): .* equal numbers of both, at least one$"),
        (lambda: Ogden.of(mu_1=1.0), r"^Ogden\.of\(mu_1\): expected mu_1, alpha_1$"),
        (lambda: Ogden.of(mu_1=1.0, alpha_2=1.0), r"^Ogden\.of\(mu_1, alpha_2\): expected mu_1, alpha_1$"),
        (
            lambda: Ogden((1.0,), (-2.0,)),
            r"^mu = \(1\.0,\) with exponents = \(-2\.0,\): .* a positive sum of products$",
        ),
        (
            lambda: MooneyRivlin(1.0, -1.0),
            r"^c01 = -1\.0: expected more than -c10 = -1\.0, for a positive shear modulus$",
        ),
        (lambda: Ogden((float("nan"),), (1.0,)), r"^mu\[0\] = nan: expected a finite number$"),
        (lambda: Ogden((1.0,), ("a",)), r"^exponents\[0\] = 'a': expected a number$"),
        (lambda: Carroll(1.0, -1.0, 0.0), r"^b = -1\.0: expected 0 or a positive number$"),
        (lambda: Carroll(0.0, 0.0, 0.0), r"^a = b = c = 0: expected a positive shear modulus"),
        (lambda: ExtendedTube(1.0, 0.8, 1.0, 0.5), r"^delta = 0\.8: expected less than sqrt\(1/2\)"),
        (lambda: ExtendedTube(1.0, 0.1, 1.0, 0.0), r"^beta = 0\.0: expected a positive number$"),
        (lambda: ExtendedTube(1.0, 0.1, 1.0, 1.5), r"^beta = 1\.5: expected at most 1$"),
        (lambda: Yeoh(1.0, float("nan")), r"^c20 = nan: expected a finite number$"),
    ],
)
def test_wrong_constants_are_refused(make, said):
    with refused(match=said):
        make()


def test_a_material_says_where_it_is_not_stable():
    """By its energy alone: Drucker's condition, and no derivative of a material is used."""
    stable = [Ogden((0.63e6, 1.2e3, -1e4), (1.3, 5.0, -2.0)), MooneyRivlin(1.0, 0.5), Yeoh(1.0, 0.1, 0.01), GENT, NEO]
    for material in [*stable, ArrudaBoyce(1.0, 3.0), Carroll(1.0, 1e-3, 1.0), ExtendedTube(1.0, 0.0, 1.0, 0.5)]:
        assert stability_notes(material) == []
        assert all(stable_to(material, loading) == float("inf") for loading in ("uniaxial", "planar", "equibiaxial"))
    # A term that softens: mu_1 a_1 = 2, mu_2 a_2 = -0.2. In equibiaxial tension p1 = p2 = 2 l^2 - 0.2 l^4, and
    # p1 + 2 p3 is then negative beyond l = sqrt(10), as p3 has vanished.
    weak = Ogden((1.0, -0.05), (2.0, 4.0))
    assert weak.stable_to("equibiaxial") == pytest.approx(10**0.5, rel=2e-3)
    (note,) = stability_notes(weak)
    assert note.startswith("Ogden: the material is unstable beyond these stretches: uniaxial ")
    # Of Mooney and Rivlin p1 + 2 p3 is 4 c10 (l^2 + 2 l^-4) + 4 c01 (2 l^4 + l^-2), and least of those in this state.
    soft = MooneyRivlin(1.0, -0.05)
    end = soft.stable_to("equibiaxial")
    assert end**2 + 2.0 * end**-4 == pytest.approx(0.05 * (2.0 * end**4 + end**-2), rel=5e-3)
    assert stability_notes(TensionField(soft)) == stability_notes(ByRegion(NEO, [([0], soft)])) != []


@pytest.mark.parametrize("constants", [(1e5, -5e4, 1e3), (1e5, -1e4, 0.0)])
def test_yeoh_is_unstable_where_its_tension_falls(constants):
    """Before the nominal stress of uniaxial tension, 2 (l - l^-2) dPsi/dI1, falls with the true one."""
    stretch = np.linspace(1.0, 6.0, 5001)
    x = stretch**2 + 2.0 / stretch - 3.0
    true = 2.0 * (stretch**2 - 1.0 / stretch) * (constants[0] + 2.0 * constants[1] * x + 3.0 * constants[2] * x**2)
    falls = stretch[np.argmax(np.diff(true) < 0.0)]
    assert 1.0 < Yeoh(*constants).stable_to("uniaxial") <= falls * 1.01
    assert "Yeoh: the material is unstable beyond these stretches: uniaxial" in stability_notes(Yeoh(*constants))[0]


def test_constants_that_the_functions_do_not_take_are_refused():
    @dataclass(frozen=True)
    class Long(MooneyRivlin):
        constants = (1.0, 2.0, 3.0, 4.0, 5.0)

    with refused(match=r"^Long\.constants has 5 numbers: expected at most 4$"):
        BondAssociated(Long(1.0))


def test_the_docs_show_the_material_of_the_tests():
    own = Path(isihara.__file__)
    page = (own.parents[1] / "docs" / "materials.md").read_text()
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1)
    assert code.strip() == own.read_text(encoding="utf-8").split('"""\n', 1)[1].strip()


def test_ogden_takes_pairs_of_negative_numbers():
    """As Ogden (1972) does: what counts is the sum of the products."""
    assert Ogden((600.0, -10.0), (1.3, -2.0)).mu == (600.0, -10.0)


@pytest.mark.parametrize(
    "material",
    [MooneyRivlin(2e5, 5e4), Yeoh(2e5, 1e4), Ogden((6e5, -1e4), (1.3, -2.0)), ArrudaBoyce(3e5, 4.0)],
    ids=lambda material: type(material).__name__,
)
def test_shear_modulus_is_that_of_the_energy_in_small_pure_shear(material):
    strain = 1e-3
    energy = float(energy_density(material, 1.0 + strain, 1.0 / (1.0 + strain)))
    assert capabilities(material).shear_modulus == pytest.approx(energy / (2.0 * np.log1p(strain) ** 2), rel=1e-3)
