"""Scenes: a part in the wrong place, and wrong numbers of the scene itself, are named."""

import numpy as np
import pytest
from helpers import NEO, refused, square

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    Explicit,
    Fixed,
    Measure,
    Nodal,
    Ogden,
    Outcome,
    Simulation,
)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Ogden(mu=1.0, exponents=(2.0,)), r"mu = 1\.0"),
        (lambda: Ogden(mu=(1.0,), exponents=2.0), r"exponents = 2\.0"),
        (lambda: BondAssociated("rubber"), "material = 'rubber'"),
        (lambda: BondAssociated(Bimodular(1e3)), r"material = Bimodular.* such as NeoHookean"),
        (lambda: BondBased(NEO), r"material = NeoHookean.* such as Bimodular"),
        (lambda: Nodal(type(NEO)), "material = the class NeoHookean"),
        (lambda: Simulation(square(5), None, Explicit(1.0)).build("cpu"), "force = None"),
        (lambda: Simulation(square(5), NEO, Explicit(1.0)).build("cpu"), "force = NeoHookean"),
        (lambda: Simulation(square(5), BondAssociated(NEO), Explicit(1.0), pictures=5).build("cpu"), "pictures = 5"),
    ],
)
def test_a_part_in_the_wrong_place_is_named(make, says):
    with refused(match=says):
        make()


def nothing(*_):
    return 0.0


WRONG = [
    ({"solver": "explicit"}, "solver = 'explicit'"),
    ({"loads": Fixed([0])}, "loads = "),
    ({"loads": [[Fixed([0])]]}, r"loads\[0\] = \[Fixed"),
    ({"outcomes": [5]}, r"outcomes\[0\] = 5"),
    ({"measures": [Measure("a\nb", "s", nothing)]}, "name of a measure"),
    ({"measures": [Measure("m", "s", nothing)], "outcomes": [Outcome("m", "s", nothing)]}, "two measures or outcomes"),
    ({"damage": 1.3}, r"damage = 1\.3: expected TearingEnergy"),
    ({"initial_displacement": np.full((25, 3), np.nan)}, r"initial_displacement\[0, 0\] = nan"),
    ({"initial_velocity": "none"}, "initial_velocity = 'none'"),
]


@pytest.mark.parametrize(("parts", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_scenes_are_named(parts, text):
    values = {"force": BondAssociated(NEO), "solver": Explicit(1.0), **parts}
    with refused(match=text):
        Simulation(square(5), **values).build("cpu")


def test_a_wrong_influence_function_is_named():
    with refused(match="influence = 'cubic'"):
        BondAssociated(NEO, influence="cubic")


@pytest.mark.parametrize(("kind", "value", "expected"), [
    (Measure, lambda frame: 1.0, "built, frame"), (Outcome, lambda built, frame: 1.0, "history"),
])  # fmt: skip
def test_a_function_of_other_arguments_is_refused_before_the_run(kind, value, expected):
    with refused(match=rf"^{kind.__name__} 'a': value = the function <lambda>: expected a function of \({expected}\)"):
        kind("a", "m", value)
    assert kind("a", "m", max).value is max and kind("a", "m", lambda *given: 1.0).unit == "m"


@pytest.mark.parametrize("kind", [Measure, Outcome])
@pytest.mark.parametrize(("changed", "said"), [
    ({"unit": 3}, "unit = 3: expected text"), ({"reference": "x"}, "reference = 'x'"),
    ({"reference": float("nan")}, "reference = nan"), ({"value": 5}, "value = 5: expected a function"),
])  # fmt: skip
def test_a_measure_with_a_wrong_unit_or_reference_is_named(kind, changed, said):
    with refused(match=f"^{kind.__name__} 'a': {said}"):
        kind(**{"name": "a", "unit": "m", "value": lambda *_: 0.0, **changed})
