"""What a law suspects where a run diverged."""

import pytest
from helpers import NEO, square

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Gent,
    Neural,
    Nodal,
    Prony,
    Simulation,
    TensionField,
    Visco,
)

LAWS = {
    "bond-associated": BondAssociated, "nodal": Nodal,
    "closed form": lambda material: Neural(material, evaluation="closed_form"),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_every_law_names_the_lock_of_its_material(name):
    causes = [
        Simulation(square(9), LAWS[name](material), Explicit(1.0)).build("cpu").law.likely_cause(0.25)
        for material in (Gent(mu=1e3, bulk=2e5, lock=20.0), NEO)
    ]
    assert "the Gent lock Jm = 20 was reached" in causes[0]
    assert "lock" not in causes[1]


@pytest.mark.parametrize(
    ("law", "remedy"),
    [
        (BondAssociated(NEO), "try a TensionField material or a safety of 0.25"),
        (BondAssociated(TensionField(NEO)), "as torn edges do; try a safety of 0.25"),
        (Visco(NEO), "try a TensionField material or a safety of 0.25"),
        (Visco(NEO, prony=(Prony(0.1, 0.1),)), "as torn edges do; try a safety of 0.25"),
        (Nodal(NEO), "try a TensionField material or a safety of 0.25"),
    ],
    ids=["bond-associated", "wrinkles already", "elastic Visco", "Visco", "nodal"],
)
def test_a_sheet_that_tears_and_cannot_wrinkle_is_told_how(law, remedy):
    scene = Simulation(square(9), law, Explicit(1.0), damage=CriticalStretch(2.0))
    assert scene.build("cpu").law.likely_cause(0.25).endswith(remedy)
