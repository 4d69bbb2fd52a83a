"""Incompressible materials: the constants that they refuse, and the material of the documentation."""

import re
from pathlib import Path

import isihara
import pytest

from warp_pd import ArrudaBoyce, InputError, MooneyRivlin, Ogden, Yeoh


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: MooneyRivlin(0.0, 1.0), r"^c10 = 0\.0: expected a positive number$"),
        (lambda: Yeoh(-1.0), r"^c10 = -1\.0: expected a positive number$"),
        (lambda: ArrudaBoyce(1.0, 1.0), r"^lock = 1\.0: .* a stretch above 1$"),
        (lambda: Ogden((1.0,), (2.0, 3.0)), r"^mu = \(1\.0,\) with exponents = \(2\.0, 3\.0\): .* one or two of each$"),
        (lambda: Ogden((1.0,), (-2.0,)), r"^mu = \(1\.0,\) with exponents = \(-2\.0,\): .* a sum of products above 0$"),
        (lambda: MooneyRivlin(1.0, -1.0), r"^c01 = -1\.0: expected 0 or a positive number$"),
    ],
)
def test_wrong_constants_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_the_docs_show_the_material_of_the_tests():
    own = Path(isihara.__file__)
    page = (own.parents[1] / "docs" / "materials.md").read_text()
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1)
    assert code.strip() == own.read_text().split('"""\n', 1)[1].strip()


def test_ogden_takes_pairs_of_negative_numbers():
    """As Ogden (1972) does: what counts is the sum of the products."""
    assert Ogden((600.0, -10.0), (1.3, -2.0)).mu == (600.0, -10.0)
