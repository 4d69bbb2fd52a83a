"""Loads, contact and rupture: wrong input is named."""

import pytest
from helpers import NEO, refused, square

from warp_pd import BodyForce, BondAssociated, CriticalEnergy, CriticalStretch, Explicit, RigidBall, Simulation

NAN = float("nan")
WRONG = [
    (lambda: RigidBall(0.0, (0, 0, 0)), r"diameter = 0\.0"),
    (lambda: RigidBall(1.0, (0, NAN, 0)), r"RigidBall\.start = "),
    (lambda: CriticalStretch(1.0), r"stretch = 1\.0"),
    (lambda: BodyForce((1.0, NAN, 0.0)), r"BodyForce\.value = "),
    (
        lambda: Simulation(square(5), BondAssociated(NEO), Explicit(1.0), damage=CriticalEnergy(1.0)).build("cpu"),
        "CriticalEnergy with BondAssociated",
    ),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_parts_are_named(make, text):
    with refused(match=text):
        make()
