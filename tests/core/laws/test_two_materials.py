"""Sheets of two stiffnesses: what they add to a scene, and the laws that refuse them."""

import pytest
from helpers import NEO, refused, square
from two_material_cases import LAWS, built_with, laminate

from warp_pd import BondAssociated, Neural, Nodal, ViscoBondBased, Yeoh


@pytest.mark.parametrize("name", LAWS)
def test_a_second_material_adds_no_array_and_no_launch(name):
    """It changes the weights, on a lattice a longer table; the density of `BondBased` at frames takes factors."""
    contexts = [built_with(LAWS[name], sheet).context for sheet in (square(12), laminate(12))]
    plans = []
    for context in contexts:
        launches = {
            stage: [
                (launch.name, "" if (name, launch.name) == ("bond_based", "density") else launch.kernel.module.name)
                for launch in part.launches()
            ]
            for stage, part in context.stages.items()
        }
        assert launches["step"]
        plans.append(([(stored.name, stored.owner) for stored in context.fields], launches))
    added = [("stiffness_factors", "fields")] if name == "bond_based" else []
    assert sorted([*plans[0][0], *added]) == sorted(plans[1][0]) and plans[0][1] == plans[1][1]
    rows = [len(context.fields["class_area"].numpy()) for context in contexts]
    assert rows[1] > rows[0]


@pytest.mark.parametrize(
    "law",
    [
        Nodal(NEO, horizon=2.015),
        Neural(NEO, horizon=2.015, evaluation="closed_form"),
        ViscoBondBased(Yeoh(1e3, 10.0)),
        BondAssociated(NEO, weights="published"),
    ],
    ids=["nodal", "neural", "visco bond-based", "published weights"],
)
def test_a_law_of_one_material_refuses_two(law):
    assert built_with(law, square(12)).law is not None
    with refused(match=r"sheet\.stiffness"):
        built_with(law, laminate(12))
