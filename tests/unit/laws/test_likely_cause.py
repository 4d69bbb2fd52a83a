"""What a law suspects where a run diverged."""

import pytest
from helpers import NEO, square

from warp_pd import BondAssociated, Explicit, Gent, Neural, Nodal, Simulation

LAWS = {
    "bond-associated": BondAssociated, "nodal": Nodal,
    "closed form": lambda material: Neural(material, evaluation="closed_form"),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_every_law_names_the_lock_of_its_material(name):
    causes = [
        Simulation(square(9), LAWS[name](material), Explicit(1.0)).build("cpu").law.likely_cause()
        for material in (Gent(mu=1e3, bulk=2e5, lock=20.0), NEO)
    ]
    assert "the Gent lock Jm = 20 was reached" in causes[0]
    assert "lock" not in causes[1]
